"""``python -m contradictions --machines 500 --seed S``: where commands differ on random machines."""

import argparse
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

from contradictions.answers import Asked, Judged, judge
from contradictions.machines import drawn
from contradictions.questions import asked_of


def asked_all(
    seed: int, number: int, *, slow: bool, elements: bool = False, only: str = ""
) -> list[tuple[str, Judged]]:
    """All questions on one machine."""
    machine = drawn(seed, number)
    with tempfile.TemporaryDirectory() as folder:
        asked = Asked(machine, Path(folder))
        return [
            (question.name, judge(question, asked, slow=slow, elements=elements))
            for question in asked_of(machine, slow=slow)
            if only in question.name
        ]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m contradictions")
    parser.add_argument("--machines", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first machine")
    parser.add_argument("--kind", default="", help="only kinds that hold this word")
    parser.add_argument("--question", default="", help="only questions that hold this word")
    parser.add_argument("--quick", action="store_true", help="without the slow ways")
    parser.add_argument("--elements", action="store_true", help="with finite elements: seconds a machine")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    compared, refused, failures, spent = Counter[str](), Counter[str](), Counter[str](), Counter[str]()
    began = time.process_time()
    for number in range(options.first, options.first + options.machines):
        if options.kind not in drawn(options.seed, number).kind:
            continue
        found = asked_all(
            options.seed, number, slow=not options.quick, elements=options.elements, only=options.question
        )
        for name, judged in found:
            compared[name] += judged.compared
            failures[name] += bool(judged.contradictions)
            for way, why in judged.refused:
                refused[f"{why}: {way}"] += 1
            for way, seconds in judged.seconds.items():
                spent[f"{name}, {way}"] += seconds
            for each in judged.contradictions:
                print(each, flush=True)
    print(f"\n{'question':40} {'compared':>10} {'machines that contradict':>26}")
    for name, pairs in compared.items():
        print(f"{name:40} {pairs:10d} {failures[name]:26d}")
    print("\nrefused for a listed reason")
    for line, count in refused.most_common():
        print(f"{count:6d}  {line}")
    print(f"\n{time.process_time() - began:.0f} s of a processor; the most by")
    for line, seconds in spent.most_common(12):
        print(f"{seconds:8.1f}  {line}")
    return 1 if any(failures.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
