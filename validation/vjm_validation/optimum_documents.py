"""What ``validate optimise`` prints: the best machine, and a Pareto front."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field
from rich.console import Console

from vjm.design.optimum import Optimum
from vjm_output.documents import DoubtRow, Row
from vjm_output.terminal import TerminalTable


class ConfirmedRow(Row):
    """A quantity of a design by finer models."""

    quantity: str
    unit: str
    value: float
    refined: float | None
    """With twice as many springs; null where there is no answer."""
    elements: float | None
    """With finite elements; null where there is no answer."""
    error: float
    """Stated: what half as many springs and half as many elements change."""
    why: str
    """There is no answer of one; empty where there are both."""
    doubt: str
    """In what they differ by more than they state; empty where they agree."""


class OptimumNumber(Row):
    """A number of the model file at the optimum."""

    key: str
    unit: str
    before: float
    value: float
    at_bound: bool


class OptimumPart(Row):
    """A standard part at the optimum."""

    key: str
    row: dict[str, float | str]
    """Of its catalogue."""


class OptimumLimit(Row):
    """A limit at the optimum."""

    limit: str
    value: float
    """Of the quantity."""
    active: bool
    """Whether the optimum reaches it."""


class OptimumDocument(Row):
    """What ``validate optimise --json`` prints."""

    model: str
    model_sha256: str
    version: str
    postures: list[str]
    wrenches: list[str]
    """On the end, fx,fy,fz,mx,my,mz in N and N mm. All values are those of the worst case."""
    weights: list[float] = Field([])
    """Of the cases in the objective, which is their weighted mean then."""
    objective: str
    unit: str
    before: float | None
    """With the file's own numbers."""
    value: float
    kept: bool
    """Whether all limits are kept."""
    numbers: list[OptimumNumber]
    parts: list[OptimumPart] = Field([])
    """Chosen from catalogues."""
    limits: list[OptimumLimit]
    starts: int
    agreeing: int
    """Starts that ended there."""
    machines: int
    """That were computed."""
    confirmed: list[ConfirmedRow] = Field([])
    """What was made best and the limited quantities by other models; empty where it was not asked for."""
    interrupted: bool = False
    """Whether it was ended before its time: the best so far."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


class FrontPoint(Row):
    """A machine of a front."""

    values: list[float]
    """Of both quantities."""
    numbers: list[OptimumNumber]
    parts: list[OptimumPart] = Field([])
    confirmed: list[ConfirmedRow] = Field([])


class FrontDocument(Row):
    """What ``validate optimise --against --json`` prints."""

    model: str
    model_sha256: str
    version: str
    postures: list[str]
    wrenches: list[str]
    quantities: list[str]
    quantity_units: list[str]
    limits: list[str]
    """That all machines keep."""
    points: list[FrontPoint]
    interrupted: bool = False
    """Whether it was ended before its time: the points so far."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


def number_rows(found: Optimum) -> list[OptimumNumber]:
    """The numbers of a machine beside those of its file."""
    return [
        OptimumNumber(key=key, unit=unit, before=float(old), value=float(new), at_bound=row["at_bound"])
        for row, key, unit, old, new in zip(
            found.table(), found.space.keys, found.space.units, found.space.present, found.values, strict=False
        )
    ]


def part_rows(found: Optimum) -> list[OptimumPart]:
    """The standard parts of a machine."""
    return [OptimumPart(key=key, row=dict(row)) for key, row in found.chosen.items()]


def confirmed_rows(found: Optimum) -> list[ConfirmedRow]:
    """A design by finer models, which are asked here."""
    return [
        ConfirmedRow(
            quantity=str(row.of), unit=row.of.unit, value=row.value, refined=_known(row.refined),
            elements=_known(row.elements), error=row.error, why=row.why, doubt=row.doubt,
        )
        for row in found.confirmed()
    ]  # fmt: skip


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def print_confirmed(console: Console, rows: Sequence[ConfirmedRow]) -> None:
    """Quantities beside what finer models say, and where they differ."""
    if not rows:
        return
    table = TerminalTable(title="Computed again", title_justify="left")
    for name in ("quantity", "unit", "here", "twice the springs", "finite elements", "stated error"):
        table.add_column(name, justify="right")
    for row in rows:
        values = (f"{v:.6g}" if v is not None else "-" for v in (row.value, row.refined, row.elements))
        error = f"{row.error:.1g}" if row.elements is not None else "-"
        table.add_row(row.quantity, row.unit, *values, error)
    console.print(table)
    for row in rows:
        if row.why or row.doubt:
            word = "Warning" if row.doubt else "Not computed"
            console.print(f"{word}: {row.quantity}: {row.doubt or row.why}", soft_wrap=True)
