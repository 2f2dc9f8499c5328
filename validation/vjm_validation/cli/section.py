"""The command ``validate section``."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from cyclopts import Parameter

from vjm import __version__
from vjm.io.errors import did_you_mean
from vjm.io.machine_file import part_tables
from vjm.io.shapes import SHAPES, Shape, checked_shape, shape
from vjm.plain_numbers import plain_number
from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_validation.cli import pages
from vjm_validation.cli.options import Json
from vjm_validation.cli.status import OK, UsageError
from vjm_validation.documents import SectionRow, SectionsDocument

ROWS = (
    ("area", "mm²", lambda row: [row.area_mm2]),
    ("second moments of area about y, z", "mm⁴", lambda row: row.second_moments_mm4),
    ("section moduli about y, z", "mm³", lambda row: row.section_moduli_mm3),
    ("torsion constant", "mm⁴", lambda row: [row.torsion_constant_mm4]),
    ("warping constant", "mm⁶", lambda row: [row.warping_constant_mm6]),
    ("warping stiffens within, of a clamped end", "mm", lambda row: [row.warping_length_mm]),
    ("shear areas along y, z", "mm²", lambda row: row.shear_areas_mm2),
    ("shear factors along y, z", "", lambda row: row.shear_factors),
    ("EA", "N", lambda row: [row.EA_N]),
    ("GJ", "N mm²", lambda row: [row.GJ_Nmm2]),
    ("EI about y, z", "N mm²", lambda row: row.EI_Nmm2),
    ("mass", "kg/m", lambda row: [row.mass_kg_per_m]),
)  # fmt: skip
"""What is printed of a section."""


def section_(
    what: Annotated[str, Parameter(help=f"A shape: {', '.join(SHAPES)}; or a model, with shapes in its sections.")],
    sizes: Annotated[
        tuple[str, ...],
        Parameter(
            help="Of a shape: the keys that it has in a model file, such as width_mm=60 wall_mm=4. Steel, where no "
            "youngs_modulus_MPa is among them."
        ),
    ] = (),
    /,
    *,
    part: Annotated[tuple[str, ...], Parameter(help="Parts of a model by name; all of them else.")] = (),
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
) -> int:
    """Areas, second moments, torsion, warping and shear of cross-sections, and their stiffness."""
    pages.check(plot, report)
    found = _of_shape(what, sizes) if what in SHAPES else _of_model(what, sizes, part)
    document = SectionsDocument(version=__version__, sections=[_row(name, shape) for name, shape in found.items()])
    if json:
        sys.stdout.write(as_json(document))
    else:
        for row in document.sections:
            terminal.console().print(terminal.two_columns(_title(row), dict(_cells(row))))
    console = None if json else terminal.console()
    pages.draw(plot, report, lambda: _content(what, found, document), console)
    return OK


def _of_shape(name: str, sizes: Sequence[str]) -> dict[str, Shape]:
    values: dict[str, Any] = {}
    for word in sizes:
        key, equals, text = word.partition("=")
        if not equals:
            raise UsageError(f"'{word}' is no key=value, such as width_mm=60")
        if key in values:
            raise UsageError(f"{key} stands twice: give it once")
        try:
            values[key] = plain_number(text)
        except ValueError:
            raise UsageError(f"{word}: '{text}' is no number") from None
    return {name: shape(name, **values)}


def _of_model(model: str, sizes: Sequence[str], parts: Sequence[str]) -> dict[str, Shape]:
    if sizes:
        hint = did_you_mean(model, SHAPES) or f"; there are {', '.join(SHAPES)}"
        raise UsageError(f"'{sizes[0]}' belongs to a shape, and '{model}' is none{hint}")
    tables = {table["name"]: table.get("section") or {} for table in part_tables(model)}
    for name in parts:
        if name not in tables:
            hint = did_you_mean(name, tables) or f"; it has {', '.join(tables)}"
            raise UsageError(f"--part: {model} has no part '{name}'{hint}")
    found = {
        name: checked_shape(tables[name], f"{model}: part '{name}', section")
        for name in parts or tables
        if "shape" in tables[name]
    }
    if not found:
        raise UsageError(
            f"{', '.join(parts) or model}: no section has a shape: one that is given by its stiffness has no areas"
        )
    return found


def _row(name: str, shape: Shape) -> SectionRow:
    stiff, shear = shape.stiffness(), list(shape.shear_areas)
    return SectionRow(
        name=name, shape=next(kind for kind, one in SHAPES.items() if one is type(shape)), area_mm2=shape.area,
        second_moments_mm4=list(shape.inertias), section_moduli_mm3=list(shape.section_moduli),
        torsion_constant_mm4=shape.torsion_constant, warping_constant_mm6=shape.warping_constant,
        warping_length_mm=shape.warping_length, shear_areas_mm2=shear,
        shear_factors=[each / shape.area for each in shear], EA_N=stiff.EA, GJ_Nmm2=stiff.GJ,
        EI_Nmm2=[stiff.EIy, stiff.EIz], mass_kg_per_m=1e3 * stiff.mass,
    )  # fmt: skip


def _title(row: SectionRow) -> str:
    return row.shape if row.name == row.shape else f"{row.name}: {row.shape}"


def _cells(row: SectionRow) -> list[tuple[str, str]]:
    return [
        (name, f"{', '.join(f'{value:.6g}' for value in values(row))} {unit}".strip())
        for name, unit, values in ROWS
    ]


def _content(what: str, found: Mapping[str, Shape], document: SectionsDocument) -> pages.Content:
    from vjm_validation.report.design_figures import sections_picture
    from vjm_validation.report.words import ReportTable

    tables = [ReportTable(_title(row), ("constant", "value"), tuple(_cells(row))) for row in document.sections]
    return pages.Content(
        f"{what}: cross-sections",
        "x is along the beam; y is drawn upwards and z to the right.",
        [sections_picture(found)],
        tables,
    )
