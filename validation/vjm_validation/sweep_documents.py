"""What ``validate sweep`` prints."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from vjm import __version__
from vjm.design.sweep import Sweep
from vjm.rotations import Array
from vjm_output.documents import DoubtRow, Row


class SweepCase(Row):
    """A machine of a sweep in one posture under one wrench."""

    posture: str
    wrench: str
    """On the end, fx,fy,fz,mx,my,mz in N and N mm; empty for none."""
    values: list[float | None]
    """Of the quantities; null where there is no answer."""
    why: str
    """There is no answer; empty where there is one."""


class SweepRow(Row):
    """One machine of a sweep."""

    numbers: list[float]
    """Of the keys."""
    values: list[float | None]
    """Of the quantities, each in its worst case; null where one has no answer."""
    on_front: bool
    """Whether no other machine is as good in all quantities and better in one."""
    cases: list[SweepCase]


class SweepDocument(Row):
    """What ``validate sweep --json`` prints."""

    model: str
    model_sha256: str
    version: str
    engine: str
    keys: list[str]
    """Numbers of the model files that vary."""
    units: list[str]
    quantities: list[str]
    """Of a deflection the size."""
    quantity_units: list[str]
    rows: list[SweepRow]
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


def sweep_document(found: Sweep, name: str, sha256: str, engine: str, doubts: list[DoubtRow]) -> SweepDocument:
    """What ``validate sweep --json`` prints of a result.

    Args:
        found: the sweep.
        name: of the machine.
        sha256: of its files.
        engine: label.
        doubts: what is implausible about it.
    """
    return SweepDocument(
        model=name,
        model_sha256=sha256,
        version=__version__,
        engine=engine,
        keys=list(found.space.keys),
        units=found.space.units,
        quantities=[str(each) for each in found.quantities],
        quantity_units=[each.unit for each in found.quantities],
        rows=[
            SweepRow(
                numbers=numbers.tolist(),
                values=_known(worst),
                on_front=bool(best),
                cases=[
                    SweepCase(posture=case.posture, wrench=case.wrench_text, values=_known(own), why=text)
                    for case, own, text in zip(found.space.cases, values, why, strict=True)
                ],
            )
            for numbers, worst, best, values, why in zip(
                found.rows, found.worst, found.front, found.values, found.why, strict=True
            )
        ],
        doubts=doubts,
    )


def _known(values: Array) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


def sweep_header(document: SweepDocument) -> tuple[str, ...]:
    """Names of the columns of `sweep_cells`."""
    numbers = [f"{key}, {unit}" if unit else key for key, unit in zip(document.keys, document.units, strict=True)]
    found = [f"{q}, {u}" for q, u in zip(document.quantities, document.quantity_units, strict=True)]
    return (*numbers, *(("posture", "wrench") if _several(document) else ()), *found, "front", "why")


def sweep_cells(document: SweepDocument) -> list[tuple[str, ...]]:
    """A row for each machine and case: numbers, case, quantities, whether it is on the front, and why not."""
    return [
        (
            *(f"{v:.6g}" for v in row.numbers),
            *((case.posture, case.wrench) if _several(document) else ()),
            *("" if v is None else f"{v:.6g}" for v in case.values),
            "yes" if row.on_front else "",
            case.why,
        )
        for row in document.rows
        for case in row.cases
    ]


def sweep_lines(document: SweepDocument) -> list[str]:
    """What is to be said of a sweep besides its table."""
    front, total = sum(row.on_front for row in document.rows), len(document.rows)
    lines = [f"{front} of {total} machines are not beaten by another in {' and '.join(document.quantities)}."]
    if _several(document):
        lines.append(f"Each is judged by the worst of its {len(document.rows[0].cases)} cases.")
    without = sum(any(case.why for case in row.cases) for row in document.rows)
    if without:
        lines.append(f"{without} have no answer in a case; the column why says the reason.")
    return lines


def sweep_title(document: SweepDocument) -> str:
    """The machine, its posture where it has one alone, and how many machines there are."""
    cases = document.rows[0].cases
    where = f"{len(cases)} cases" if _several(document) else f"posture {cases[0].posture}"
    return f"{document.model}, {where}, {document.engine}: {len(document.rows)} machines"


def _several(document: SweepDocument) -> bool:
    return len(document.rows[0].cases) > 1
