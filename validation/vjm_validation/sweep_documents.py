"""What ``validate sweep`` and ``validate optimise`` print."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from vjm_output.documents import DoubtRow


class SweepRow(BaseModel):
    """One machine of a sweep."""

    model_config = ConfigDict(frozen=True)

    numbers: list[float]
    """Of the keys."""
    values: list[float | None]
    """Of the quantities; null where there is no answer."""
    why: str
    """There is no answer; empty where there is one."""
    on_front: bool
    """Whether no other machine is as good in all quantities and better in one."""


class SweepDocument(BaseModel):
    """What ``validate sweep --json`` prints."""

    model_config = ConfigDict(frozen=True)

    model: str
    model_sha256: str
    version: str
    posture: str
    keys: list[str]
    """Numbers of the model file that vary."""
    units: list[str]
    quantities: list[str]
    """Of a deflection the size."""
    quantity_units: list[str]
    rows: list[SweepRow]
    doubts: list[DoubtRow] = []
    """What is implausible about the model."""


class OptimumNumber(BaseModel):
    """A number of the model file at the optimum."""

    model_config = ConfigDict(frozen=True)

    key: str
    unit: str
    before: float
    value: float
    at_bound: bool


class OptimumLimit(BaseModel):
    """A limit at the optimum."""

    model_config = ConfigDict(frozen=True)

    limit: str
    value: float
    """Of the quantity."""
    active: bool
    """Whether the optimum reaches it."""


class OptimumDocument(BaseModel):
    """What ``validate optimise --json`` prints."""

    model_config = ConfigDict(frozen=True)

    model: str
    model_sha256: str
    version: str
    posture: str
    objective: str
    unit: str
    before: float | None
    """With the file's own numbers."""
    value: float
    kept: bool
    """Whether all limits are kept."""
    numbers: list[OptimumNumber]
    limits: list[OptimumLimit]
    starts: int
    agreeing: int
    """Starts that ended there."""
    machines: int
    """That were computed."""
    doubts: list[DoubtRow] = []
    """What is implausible about the model."""


def sweep_header(document: SweepDocument) -> tuple[str, ...]:
    """Names of the columns of `sweep_cells`."""
    numbers = [f"{key}, {unit}" if unit else key for key, unit in zip(document.keys, document.units, strict=True)]
    found = [f"{q}, {u}" for q, u in zip(document.quantities, document.quantity_units, strict=True)]
    return (*numbers, *found, "front", "why")


def sweep_cells(document: SweepDocument) -> list[tuple[str, ...]]:
    """Numbers and quantities of each machine, whether it is on the Pareto front, and why it has no answer."""
    return [
        (
            *(f"{v:.6g}" for v in row.numbers),
            *("" if v is None else f"{v:.6g}" for v in row.values),
            "yes" if row.on_front else "",
            row.why,
        )
        for row in document.rows
    ]
