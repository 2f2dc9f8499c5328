"""Results of analysis and design as documents, with their words and tables.

Here are loaded stiffness, compliance shares, natural frequencies, sensitivities, sweeps, optima and Pareto fronts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from vjm import __version__
from vjm.analysis import LoadedStiffness
from vjm.design.modes import Modes
from vjm.design.optimum import Optimum
from vjm.design.sensitivity import DesignQuantity, Sensitivities
from vjm.design.shares import Shares
from vjm.design.sweep import Sweep
from vjm.io.findings import Finding
from vjm.rotations import Array
from vjm_output.documents import DoubtRow, Row, doubt_rows
from vjm_validation.documents import (
    MapRowsDocument,
    ModeRow,
    ModesDocument,
    SensitivityDocument,
    SensitivityRow,
    ShareRow,
    SharesRow,
    StiffnessDocument,
    UnderLoads,
)
from vjm_validation.page_content import ReportTable

if TYPE_CHECKING:
    from pathlib import Path

    from vjm_updating.maps.output import Difference
    from vjm_updating.maps.run import MapResult


def stiffness_document(stiffness: LoadedStiffness) -> StiffnessDocument:
    """What ``validate stiffness --json`` prints of a result."""
    return StiffnessDocument(
        model=stiffness.model,
        model_sha256=stiffness.model_sha256,
        version=__version__,
        engine=stiffness.engine,
        posture=stiffness.posture,
        control=stiffness.control,
        displacement=stiffness.displacement.tolist(),
        wrench=stiffness.wrench.tolist(),
        end=stiffness.end,
        gravity=list(stiffness.gravity) if stiffness.gravity is not None else None,
        stiffness_loaded=_finite(stiffness.loaded),
        stiffness_unloaded=_finite(stiffness.unloaded),
        compliance_loaded=_finite(stiffness.loaded_compliance),
        compliance_unloaded=_finite(stiffness.unloaded_compliance),
        rigid=stiffness.rigid.tolist() if stiffness.rigid is not None and _finite(stiffness.loaded) is None else [],
        torques=dict(stiffness.torques) if stiffness.torques is not None else None,
        pulls=dict(stiffness.pulls),
        laws=list(stiffness.laws),
        stable=stiffness.stable,
        eigenvalue=None if np.isnan(stiffness.eigenvalue) else stiffness.eigenvalue,
        eigenvalue_relative=None if np.isnan(stiffness.eigenvalue_relative) else stiffness.eigenvalue_relative,
        iterations=stiffness.iterations,
        residual=stiffness.residual,
        events=list(stiffness.events),
    )


def _finite(matrix: Array | None) -> list[list[float]] | None:
    return None if matrix is None or not np.all(np.isfinite(matrix)) else matrix.tolist()


AXES = ("ux mm", "uy mm", "uz mm", "rx rad", "ry rad", "rz rad")
SOUGHT = 3
"""Parameters of which it is said by what factor they alone would do."""
NOTICED = 1e-3
"""Of a deflection, by which large deflections change it, from which on it is said."""
NOTHING = 1e-12
"""Of the largest deflection, turns counting times a length, below which a number is rounding."""


def shares_row(shares: Shares) -> SharesRow:
    """The shares of one posture as ``validate stiffness --shares --json`` prints them."""
    return SharesRow(
        posture=shares.posture,
        deflection=_felt(shares, shares.deflection),
        deflection_loaded=_felt(shares, shares.deflection_loaded),
        nonlinearity=_known(shares.nonlinearity),
        parts=[
            ShareRow(
                part=row.part, kind=row.kind, deflection=_felt(shares, row.deflection), energy=_known(energy),
                energy_loaded=_known(loaded),
            )
            for row, energy, loaded in zip(shares.rows, shares.energies, shares.energies_loaded, strict=True)
        ],
    )  # fmt: skip


def modes_document(modes: Modes) -> ModesDocument:
    """What ``validate modes --json`` prints of a result."""
    return ModesDocument(
        model=modes.model,
        model_sha256=modes.model_sha256,
        version=__version__,
        engine=modes.engine,
        posture=modes.posture,
        control=modes.control,
        end=modes.end,
        displacement=modes.displacement.tolist(),
        verdict=str(modes.verdict),
        mass_kg=modes.mass,
        massless=list(modes.massless),
        stations=[f"{part}@{fraction:.4g}" for part, fraction in modes.stations],
        positions=modes.shape.tolist(),
        modes=[
            ModeRow(frequency_Hz=f, growth_per_s=g, largest_at=modes.largest(k), shape=modes.shapes[k].tolist())
            for k, (f, g) in enumerate(zip(modes.frequencies.tolist(), modes.growth.tolist(), strict=True))
        ],
    )


def map_document(
    result: MapResult,
    difference: Difference | None = None,
    files: Sequence[Path] = (),
    doubts: Sequence[Finding] = (),
) -> MapRowsDocument:
    """What ``validate map --json`` prints of one map."""
    from vjm_updating.maps.evaluate import COLUMNS  # as no other document

    setting = result.map.setting
    return MapRowsDocument(
        model=setting.machine.name,
        model_sha256=setting.machine.sha256,
        version=__version__,
        engine=setting.engine.label,
        quantity=str(setting.quantity),
        columns=list(COLUMNS[setting.quantity]),
        places_mm=[_finite_values(row) for row in result.map.points.places],
        joints={name: _finite_values(values) for name, values in result.joints.items()},
        values=[_finite_values(row) for row in result.values],
        parts=[part for part, _ in result.names],
        kinds=[kind for _, kind in result.names],
        status=list(result.why),
        wrench=list(setting.wrench),
        against=difference.against if difference else "",
        difference_percent=_finite_values(difference.percent) if difference else [],
        files=[str(file) for file in files],
        doubts=doubt_rows(doubts),
    )


def _felt(shares: Shares, deflection: Array) -> list[float]:
    """A deflection without what is rounding beside the largest one of all parts."""
    unit = np.repeat([1.0, shares.length], 3)
    size = max(float(np.abs(row.deflection * unit).max()) for row in shares.rows)
    return [float(v) if abs(v * u) > NOTHING * size else 0.0 for v, u in zip(deflection, unit, strict=True)]


def _known(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


# --- words --------------------------------------------------------------------------------------------------


def shares_lines(row: SharesRow) -> list[str]:
    """What is to be said of the shares of a posture besides their table."""
    change = row.nonlinearity
    if change is None:
        return ["This load strains nothing in this posture, to first order."]
    if change < NOTICED:
        return [f"What is not linear changes the whole by {change:.1e}: the linear shares hold."]
    return [
        f"What is not linear changes the whole by {change:.1%}. The shares of the components are linear; "
        f"those of the strain energy are given for both."
    ]


# --- tables -------------------------------------------------------------------------------------------------


def shares_table(row: SharesRow) -> ReportTable:
    """Part, kind, six components with the sum last, and both shares in the strain energy."""
    cells = [
        (part.part, part.kind, *_numbers(part.deflection), _percent(part.energy), _percent(part.energy_loaded))
        for part in row.parts
    ]
    return ReportTable(
        f"Shares in the deflection, posture {row.posture}",
        ("part", "kind", *AXES, "energy", "energy, loaded"),
        (*cells, ("sum", "", *_numbers(row.deflection), "", "")),
        words=2,
    )


def _numbers(values: Sequence[float]) -> list[str]:
    return [f"{v:.3g}" for v in values]


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


# --- sensitivity --------------------------------------------------------------------------------------------

GOAL_WORDS = {
    DesignQuantity.DEFLECTION: "halve the deflection",
    DesignQuantity.STIFFNESS: "double the stiffness",
    DesignQuantity.FREQUENCY: "double the frequency",
    DesignQuantity.CRITICAL: "double the critical load",
    DesignQuantity.MASS: "halve the mass",
    DesignQuantity.REACH: "double the reach",
    DesignQuantity.COST: "halve the cost",
}
"""What the factors of `vjm.design.sensitivity.GOALS` do."""


def sensitivity_document(sensitivities: Sensitivities) -> SensitivityDocument:
    """What ``validate sensitivity --json`` prints of a result."""
    return SensitivityDocument(
        model=sensitivities.model,
        model_sha256=sensitivities.model_sha256,
        version=__version__,
        engine=sensitivities.engine,
        posture=sensitivities.posture,
        quantity=str(sensitivities.quantity),
        along=sensitivities.along,
        value=sensitivities.value,
        unit=sensitivities.unit,
        parameters=[
            SensitivityRow(
                parameter=row.parameter, unit=row.unit, value=row.value, derivative=row.derivative,
                relative=row.relative, factor=row.factor, difference=row.verification.difference,
                doubt=row.verification.why, geometric=row.geometric,
            )
            for row in sensitivities.rows
        ],
        left_out=dict(sensitivities.left_out),
    )  # fmt: skip


def sensitivity_lines(document: SensitivityDocument) -> list[str]:
    """What to change, in words."""
    along = f" along {document.along}" if document.along else ""
    name = "critical load" if document.quantity == DesignQuantity.CRITICAL else document.quantity
    lines = [f"The {name}{along} is {document.value:.6g} {document.unit}."]
    goal = f"To {GOAL_WORDS[DesignQuantity(document.quantity)]}{along}"
    largest = document.parameters[:SOUGHT]
    for row in largest:
        if row.factor is not None:
            lines.append(f"{goal}: {_change(row)}.")
        elif row.relative:
            lines.append(f"{goal}: {row.parameter} alone is not enough, or no such part is possible.")
    if any(row.geometric for row in largest):
        staying = [row for row in document.parameters if not row.geometric][:SOUGHT]
        ways = [_change(row) for row in staying if row.factor is not None]
        changes = "; or ".join(ways) if ways else "no number alone is enough"
        lines.append(f"With the geometry as it is, {goal[0].lower()}{goal[1:]}: {changes}.")
    lines += [f"Left out: {key}: {why}" for key, why in document.left_out.items()]
    for row in document.parameters:
        if row.doubt:
            word = "Not verified" if row.difference is None else "Doubtful"
            lines.append(f"{word}: {row.parameter}: {row.doubt}")
    return lines


def _change(row: SensitivityRow) -> str:
    """What is done to a number."""
    assert row.factor is not None
    return (
        f"{row.parameter} from {row.value:.4g} to {row.factor * row.value:.4g} {row.unit} (times {row.factor:.3g})"
    )


def sensitivity_table(document: SensitivityDocument, caption: str = "Derivatives") -> ReportTable:
    """Name, value, unit, derivative and relative derivative of each parameter, and whether a difference agrees."""
    rows = [
        (
            row.parameter, f"{row.value:.6g}", row.unit, f"{row.derivative:.5g}", f"{row.relative:.4f}",
            "yes" if not row.doubt else "no" if row.difference is None else f"no: {row.difference:.5g}",
        )
        for row in document.parameters
    ]  # fmt: skip
    header = ("parameter", "value", "unit", "derivative", "% per %", "verified")
    return ReportTable(caption, header, tuple(rows))


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


class SweepDocument(UnderLoads):
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


def sweep_document(sweep: Sweep, name: str, sha256: str, engine: str, doubts: list[DoubtRow]) -> SweepDocument:
    """What ``validate sweep --json`` prints of a result.

    Args:
        sweep: the sweep.
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
        keys=list(sweep.space.keys),
        units=sweep.space.units,
        quantities=[str(each) for each in sweep.quantities],
        quantity_units=[each.unit for each in sweep.quantities],
        rows=[
            SweepRow(
                numbers=numbers.tolist(),
                values=_finite_values(worst),
                on_front=bool(best),
                cases=[
                    SweepCase(posture=case.posture, wrench=case.wrench_text, values=_finite_values(own), why=text)
                    for case, own, text in zip(sweep.space.cases, values, why, strict=True)
                ],
            )
            for numbers, worst, best, values, why in zip(
                sweep.rows, sweep.worst, sweep.front, sweep.values, sweep.why, strict=True
            )
        ],
        doubts=doubts,
    )


def _finite_values(values: Array) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


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


class OptimumDocument(UnderLoads):
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


class FrontDocument(UnderLoads):
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


def number_rows(optimum: Optimum) -> list[OptimumNumber]:
    """The numbers of a machine beside those of its file."""
    return [
        OptimumNumber(key=key, unit=unit, before=float(old), value=float(new), at_bound=row["at_bound"])
        for row, key, unit, old, new in zip(
            optimum.table(),
            optimum.space.keys,
            optimum.space.units,
            optimum.space.present,
            optimum.values,
            strict=False,
        )
    ]


def part_rows(optimum: Optimum) -> list[OptimumPart]:
    """The standard parts of a machine."""
    return [OptimumPart(key=key, row=dict(row)) for key, row in optimum.chosen.items()]


def confirmed_rows(optimum: Optimum) -> list[ConfirmedRow]:
    """A design by finer models, which are asked here."""
    return [
        ConfirmedRow(
            quantity=str(row.of), unit=row.of.unit, value=row.value, refined=_finite_value(row.refined),
            elements=_finite_value(row.elements), error=row.error, why=row.why, doubt=row.doubt,
        )
        for row in optimum.confirmed()
    ]  # fmt: skip


def _finite_value(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
