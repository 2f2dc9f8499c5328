"""Every way of being mistaken in every place of a test: is it refused, or named with the right guess?"""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mistakes.kinds import Row, places, ways
from vjm.io.findings import Grade
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.data_file import POSE, WRENCH
from vjm_updating.experiment.plausibility import plausibility


@dataclass(frozen=True)
class Tried:
    """One mistake, and what was said."""

    name: str
    met: bool
    said: tuple[str, ...]


def tried(test: Path, work: Path) -> Iterator[Tried]:
    """All mistakes of a test."""
    rows = _rows(test)
    moved, loaded = (_main(rows, names) for names in (POSE, WRENCH))
    for way in ways(list(rows[0]), moved, loaded):
        for place, spoilt in places(rows):
            again = [dict(row) for row in rows]
            changed = 0
            for k, row in enumerate(again):
                if spoilt(k, row):
                    way.spoil(row)
                    changed += 1
            if changed:
                said, refused = answer(test, again, work)
                met = refused or any(word in line for word in way.says for line in said)
                yield Tried(f"{way.name}, {place}", met, said)


def as_it_stands(test: Path, work: Path) -> tuple[str, ...]:
    """What is said of a test that nobody spoilt."""
    return answer(test, _rows(test), work)[0]


def _rows(test: Path) -> list[Row]:
    data = next(file for name in ("DATA.csv", "readings.csv", "data.csv") if (file := test / name).exists())
    with open(data, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def answer(test: Path, rows: list[Row], work: Path) -> tuple[tuple[str, ...], bool]:
    """What is said of rows, and whether they are refused."""
    data = work / "DATA.csv"
    with open(data, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    try:
        found = plausibility(read_measurement(data, _sheet(test)))
    except ValueError as refused:
        return (str(refused),), True
    refused_too = any(finding.grade is Grade.REFUSED for finding in found)
    return tuple(str(finding) for finding in found if finding.grade is not Grade.NOTED), refused_too


def _sheet(test: Path) -> Path:
    return next(file for name in ("SHEET.toml", "sheet.toml") if (file := test / name).exists())


def _main(rows: list[Row], names: tuple[str, ...]) -> str:
    """The column of those that spans most; lengths and forces before angles and moments."""
    spans = {}
    for name in (name for name in names if name in rows[0]):
        values = [float(row[name]) for row in rows if row[name]]
        spans[name] = max(values) - min(values)
    first = [name for name in spans if name in names[:3]] or list(spans)
    return max(first, key=spans.__getitem__)
