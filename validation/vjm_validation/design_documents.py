"""Compliance shares and natural frequencies as documents, as tables and as pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never

import numpy as np
from rich.console import Console

from vjm import __version__
from vjm.design.modes import Modes, ModesVerdict
from vjm.design.sensitivity import DesignQuantity, Sensitivities
from vjm.design.shares import Shares
from vjm.rotations import Array
from vjm_output.terminal import TerminalTable
from vjm_validation.documents import (
    ModeRow,
    ModesDocument,
    SensitivityDocument,
    SensitivityRow,
    ShareRow,
    SharesRow,
)

AXES = ("ux mm", "uy mm", "uz mm", "rx rad", "ry rad", "rz rad")
SOUGHT = 3
"""Parameters of which it is said by what factor they alone would do."""
NOTICED = 1e-3
"""Of a deflection, by which large deflections change it, from which on it is said."""
NOTHING = 1e-12
"""Of the largest deflection, turns counting times a length, below which a number is rounding."""


def shares_row(found: Shares) -> SharesRow:
    """The shares of one posture as ``validate stiffness --shares --json`` prints them."""
    return SharesRow(
        posture=found.posture,
        deflection=_felt(found, found.deflection),
        deflection_loaded=_felt(found, found.deflection_loaded),
        nonlinearity=_known(found.nonlinearity),
        parts=[
            ShareRow(
                part=row.part, kind=row.kind, deflection=_felt(found, row.deflection), energy=_known(energy),
                energy_loaded=_known(loaded),
            )
            for row, energy, loaded in zip(found.rows, found.energies, found.energies_loaded, strict=True)
        ],
    )  # fmt: skip


def modes_document(found: Modes) -> ModesDocument:
    """What ``validate modes --json`` prints of a result."""
    return ModesDocument(
        model=found.model,
        model_sha256=found.model_sha256,
        version=__version__,
        engine=found.engine,
        posture=found.posture,
        control=found.control,
        end=found.end,
        displacement=found.displacement.tolist(),
        verdict=str(found.verdict),
        mass_kg=found.mass,
        massless=list(found.massless),
        stations=[f"{part}@{fraction:.4g}" for part, fraction in found.stations],
        positions=found.shape.tolist(),
        modes=[
            ModeRow(frequency_Hz=f, growth_per_s=g, largest_at=found.largest(k), shape=found.shapes[k].tolist())
            for k, (f, g) in enumerate(zip(found.frequencies.tolist(), found.growth.tolist(), strict=True))
        ],
    )


def _felt(found: Shares, deflection: Array) -> list[float]:
    """A deflection without what is rounding beside the largest one of all parts."""
    unit = np.repeat([1.0, found.length], 3)
    size = max(float(np.abs(row.deflection * unit).max()) for row in found.rows)
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


def modes_lines(document: ModesDocument, wanted: int) -> list[str]:
    """What is to be said of natural frequencies besides their table."""
    lines = []
    verdict = ModesVerdict(document.verdict)
    match verdict:
        case ModesVerdict.STABLE:
            lines.append("The equilibrium is stable.")
        case ModesVerdict.NEUTRAL:
            lines.append("A motion has no stiffness: it has the frequency zero.")
        case ModesVerdict.DIVERGENCE:
            lines.append("The equilibrium is unstable: a motion grows without oscillation (divergence).")
        case ModesVerdict.FLUTTER:
            lines.append("The equilibrium is unstable: an oscillation grows (flutter).")
        case _:
            assert_never(verdict)
    if len(document.modes) < wanted:
        lines.append(f"There are {len(document.modes)} frequencies: no further motion of this model moves a mass.")
    if document.massless:
        lines.append(f"Without mass: {', '.join(document.massless)}. They count as if they weighed nothing.")
    return lines


# --- tables -------------------------------------------------------------------------------------------------


def shares_cells(row: SharesRow) -> list[tuple[str, ...]]:
    """Part, kind, six components with the sum last, and both shares in the strain energy."""
    cells = [
        (part.part, part.kind, *_numbers(part.deflection), _percent(part.energy), _percent(part.energy_loaded))
        for part in row.parts
    ]
    return [*cells, ("sum", "", *_numbers(row.deflection), "", "")]


def _numbers(values: Sequence[float]) -> list[str]:
    return [f"{v:.3g}" for v in values]


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


SHARES_HEADER = ("part", "kind", *AXES, "energy", "energy, loaded")
MODES_HEADER = ("mode", "frequency Hz", "growth 1/s", "moves most at")


def modes_cells(document: ModesDocument) -> list[tuple[str, ...]]:
    """Number, frequency, growth and place of each mode."""
    return [
        (str(k + 1), f"{row.frequency_Hz:.6g}", f"{row.growth_per_s:.4g}", row.largest_at)
        for k, row in enumerate(document.modes)
    ]


def print_shares(console: Console, rows: Sequence[SharesRow]) -> None:
    """The shares of some postures."""
    for row in rows:
        _print(console, f"Shares in the deflection, posture {row.posture}", SHARES_HEADER, shares_cells(row), 2)
        for line in shares_lines(row):
            console.print(line, soft_wrap=True)


def print_modes(console: Console, document: ModesDocument, wanted: int) -> None:
    """The natural frequencies of a posture."""
    held = "end held" if document.control == "displacement" else "end free"
    title = f"{document.model}, posture {document.posture}, {document.engine}, {held}, {document.mass_kg:.6g} kg"
    _print(console, title, MODES_HEADER, modes_cells(document), 0)
    for line in modes_lines(document, wanted):
        console.print(line, soft_wrap=True)


def _print(
    console: Console, title: str, header: Sequence[str], cells: Sequence[tuple[str, ...]], words: int
) -> None:
    table = TerminalTable(title=title, title_justify="left")
    for k, name in enumerate(header):
        table.add_column(
            name, justify="left" if k < words or name == "moves most at" else "right", no_wrap=k < words
        )
    for row in cells:
        table.add_row(*row)
    console.print(table)


# --- sensitivity --------------------------------------------------------------------------------------------

SENSITIVITY_HEADER = ("parameter", "value", "unit", "derivative", "% per %", "verified")
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


def sensitivity_document(found: Sensitivities) -> SensitivityDocument:
    """What ``validate sensitivity --json`` prints of a result."""
    return SensitivityDocument(
        model=found.model,
        model_sha256=found.model_sha256,
        version=__version__,
        engine=found.engine,
        posture=found.posture,
        quantity=str(found.quantity),
        along=found.along,
        value=found.value,
        unit=found.unit,
        parameters=[
            SensitivityRow(
                parameter=row.parameter, unit=row.unit, value=row.value, derivative=row.derivative,
                relative=row.relative, factor=row.factor, difference=row.verification.difference,
                doubt=row.verification.why, geometric=row.geometric,
            )
            for row in found.rows
        ],
        left_out=dict(found.left_out),
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
        told = "; or ".join(ways) if ways else "no number alone is enough"
        lines.append(f"With the geometry as it is, {goal[0].lower()}{goal[1:]}: {told}.")
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


def sensitivity_cells(document: SensitivityDocument) -> list[tuple[str, ...]]:
    """Name, value, unit, derivative and relative derivative of each parameter, and whether a difference agrees."""
    return [
        (
            row.parameter, f"{row.value:.6g}", row.unit, f"{row.derivative:.5g}", f"{row.relative:.4f}",
            "yes" if not row.doubt else "no" if row.difference is None else f"no: {row.difference:.5g}",
        )
        for row in document.parameters
    ]  # fmt: skip


def print_sensitivity(console: Console, document: SensitivityDocument) -> None:
    """The derivatives of a quantity, and what to change."""
    title = f"{document.model}, posture {document.posture}, {document.engine}: {document.quantity}"
    _print(console, title, SENSITIVITY_HEADER, sensitivity_cells(document), 1)
    for line in sensitivity_lines(document):
        console.print(line, soft_wrap=True)
