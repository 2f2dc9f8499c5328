"""``python -m fuzz SECONDS [FIRST_SEED]``: mutated files for so long; what went wrong, and a line of figures."""

import sys
import tempfile
import time
from pathlib import Path

from fuzz.harness import answer, prepare, subjects


def main() -> int:
    """Number of wrong answers, at most 1."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3600.0
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    seed, wrong = first, 0
    with tempfile.TemporaryDirectory() as folder:
        prepare(Path(folder))
        # kernels are compiled once, before anything is timed
        for subject in subjects():
            file = Path(folder) / subject.name
            file.write_bytes(subject.content)
            subject.load(file)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for subject in subjects():
                said = answer(subject, seed, Path(folder))
                if said:
                    wrong += 1
                    print(said, flush=True)
                seed += 1
    print(
        f"{seed - first} inputs from seed {first}, {wrong} wrong answers (tracebacks, hangs over 20 s, or lines "
        "without an end)"
    )
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
