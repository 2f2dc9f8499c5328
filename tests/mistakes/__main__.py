"""``python -m mistakes [--sound] [TEST...]``: what is met, of tests in folders or of `mistakes.rigs`.

With ``--sound`` the tests are read as they stand, and every warning about them is a false one.

``python -m mistakes --kinds [FIRST:LAST [KIND...]]`` makes the table of mistakes in tests of all kinds, of the
seeds from the first to the one before the last.
"""

import sys
import tempfile
import warnings
from pathlib import Path

from mistakes.matrix import as_it_stands, tried
from mistakes.of_all_kinds import table
from mistakes.rigs import RIGS, made
from mistakes.sets import SETS


def main() -> int:
    """Number of mistakes that were taken in silence or guessed wrongly, at most 1."""
    missed = count = 0
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        work = Path(folder)
        if sys.argv[1:2] == ["--kinds"]:
            seeds, *kinds = sys.argv[2:] or ["0:1"]
            first, last = map(int, seeds.split(":"))
            for line in table(kinds or list(SETS), range(first, last), work):
                print(line, flush=True)
            return 0
        words = [word for word in sys.argv[1:] if word != "--sound"]
        tests = [Path(word) for word in words] or [made(name, work / "rigs") for name in RIGS]
        if "--sound" in sys.argv:
            return _sound(tests, work)
        for test in tests:
            met = here = 0
            for one in tried(test, work):
                here += 1
                met += one.met
                if not one.met:
                    print(f"{test.name}: {one.name}: {' | '.join(one.said) or 'in silence'}", flush=True)
            print(f"{test.name}: {met} of {here} met", flush=True)
            missed, count = missed + here - met, count + here
    print(f"{count - missed} of {count} mistakes in {len(tests)} tests refused or named with the right guess")
    return min(missed, 1)


def _sound(tests: list[Path], work: Path) -> int:
    doubted = {test.name: said for test in tests if (said := as_it_stands(test, work))}
    for name, said in doubted.items():
        print(f"{name}: {' | '.join(said)}")
    print(f"{len(doubted)} of {len(tests)} sound tests doubted")
    return min(len(doubted), 1)


if __name__ == "__main__":
    sys.exit(main())
