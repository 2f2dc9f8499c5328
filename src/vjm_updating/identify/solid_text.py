"""A part identified from its drawing, in tables and sentences for people."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE
from rich.console import Console

from vjm.io.errors import printed
from vjm_output.number_text import number, percent
from vjm_output.terminal import TerminalTable, two_columns
from vjm_updating.constants import numerical
from vjm_updating.identify.documents import BeamDocument
from vjm_updating.identify.solid_documents import BoundDocument, SolidDocument, StressDocument

TIPS = {
    "rigid": "tip moved as a rigid body: the lower bound",
    "spread": "wrench spread over the tip's face: the upper bound",
}
NOTHING = numerical(2e-4)
"""Of √(c_ii c_jj): what an irregular mesh leaves of an exact zero."""
HEADS = ("x", "y", "z", "φx", "φy", "φz")


def show(console: Console, document: SolidDocument) -> None:
    """Print a document."""
    console.print(two_columns(document.name, _rows(document)), highlight=False)
    for bound in document.bounds:
        console.print(_matrix(bound), highlight=False)
    console.print(_beams(document.beams), highlight=False)
    if document.stress is not None:
        console.print(two_columns("Von Mises stress under the wrench", _stress(document.stress)), highlight=False)
    for line in document.findings:
        console.print(f"- {line}", highlight=False, markup=False)
    for line in document.warnings:
        console.print(f"- WARNING: {line}", highlight=False, markup=False)


def _rows(document: SolidDocument) -> dict[str, str]:
    unknowns = ", ".join(f"{mesh.unknowns:,}" for mesh in document.meshes)
    held = "clamped" if document.base_held == "clamped" else "still in the mean"
    reached = percent(document.accuracy_reached)
    mass = "not known: give --density" if document.mass_kg is None else f"{printed(document.mass_kg, 5)} kg"
    return {
        "material": f"E {printed(document.youngs_modulus_MPa)} MPa, ν {printed(document.poissons_ratio)}",
        "base": f"faces {_numbers(document.base_faces)}, {held}, centre at {_point(document.base_centre_mm)} mm",
        "tip": f"faces {_numbers(document.tip_faces)}, centre at {_point(document.tip_centre_mm)} mm",
        "read at": f"{_point(document.read_at_mm)} mm, in the drawing's axes",
        "meshes": f"{unknowns} unknowns; {reached} reached, {percent(document.accuracy_asked)} asked",
        "mass": f"{mass}; volume {printed(document.volume_mm3, 5)} mm³",
        "centre of mass": f"{_point(document.centre_of_mass_mm)} mm",
    }


def _matrix(bound: BoundDocument) -> TerminalTable:
    table = TerminalTable(
        title=f"Compliance, {TIPS[bound.tip]} (mm/N, 1/N, rad/(N mm); ± half-width)",
        title_justify="left",
        box=SIMPLE,
    )
    table.add_column("")
    scale = [bound.compliance[i][i] ** 0.5 for i in range(6)]
    for head in HEADS:
        table.add_column(head, justify="right")
    for i, head in enumerate(HEADS):
        cells = []
        for j in range(6):
            value, half = bound.compliance[i][j], bound.interval[i][j]
            nothing = abs(value) <= max(half, NOTHING * scale[i] * scale[j])
            cells.append("0" if nothing else f"{value:.4e}\n± {100.0 * half / abs(value):.2g} %")
        table.add_row(head, *cells)
    return table


def _beams(beams: Sequence[BeamDocument]) -> TerminalTable:
    table = TerminalTable(title="Uniform beams", title_justify="left", box=SIMPLE)
    for head in (
        "form",
        "length, mm",
        "EA, N",
        "GJ, N mm²",
        "EIy, N mm²",
        "EIz, N mm²",
        "worst miss",
        "like the part",
    ):
        table.add_column(head, justify="left" if head == "form" else "right")
    for beam in beams:
        stiffnesses = (beam.EA_N, beam.GJ_Nmm2, beam.EIy_Nmm2, beam.EIz_Nmm2)
        table.add_row(
            beam.form,
            number(beam.length_mm),
            *(number(value) for value in stiffnesses),
            f"{beam.worst_entry} {percent(beam.worst_scaled)}",
            "yes" if beam.met else "no",
        )
    return table


def _stress(stress: StressDocument) -> dict[str, str]:
    rows = {
        "wrench": f"{_point(stress.wrench)} N, N mm, {TIPS[stress.tip].partition(':')[0]}",
        "largest away from the ends": f"{number(stress.away_MPa)} MPa at {_point(stress.away_at_mm)} mm",
        "largest of all": f"{number(stress.largest_MPa)} MPa at {_point(stress.largest_at_mm)} mm: at a clamped or "
        "re-entrant edge it has no limit",
    }
    if stress.yield_MPa is not None:
        rows["yields"] = f"at {number(stress.factor_to_yield)} times this wrench, away from the ends"
    return rows


def _numbers(values: Sequence[int]) -> str:
    return ", ".join(map(str, values))


def _point(values: Sequence[float]) -> str:
    return "[" + ", ".join(printed(0.0 if abs(value) < 1e-6 else value, 5) for value in values) + "]"
