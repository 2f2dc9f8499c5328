"""The command ``validate section``."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from rich.console import Console

from vjm import __version__
from vjm.io.errors import did_you_mean
from vjm.io.machine_file import part_tables
from vjm.io.shapes import SHAPES, Polygon, Shape, checked_shape, shape
from vjm.plain_numbers import plain_number
from vjm_output import terminal
from vjm_validation.cli import OK, UsageError
from vjm_validation.cli.pages import RESULT_OUTPUT, ResultOutput
from vjm_validation.documents import SectionRow, SectionsDocument
from vjm_validation.page_content import Content, ReportTable

if TYPE_CHECKING:
    from vjm_output.plots import Picture

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
OF_POLYGONS = (
    ("centroid, y, z of the points", "mm", lambda row: row.centroid_mm),
    ("product of inertia", "mm⁴", lambda row: [row.product_of_inertia_mm4]),
    ("shear centre from the centroid, y, z", "mm", lambda row: row.shear_centre_mm),
)
"""What is printed of a polygon besides."""


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
    points: Annotated[
        tuple[Path, ...],
        Parameter(
            consume_multiple=True,
            help="Of a polygon: CSV files with columns y_mm,z_mm of corners along the border: outline, then holes.",
        ),
    ] = (),
    output: ResultOutput = RESULT_OUTPUT,
) -> int:
    """Areas, second moments, torsion, warping and shear of cross-sections, and their stiffness."""
    output.check()
    if points and what != "polygon":
        raise UsageError("--points: belong to the shape polygon")
    if what == "polygon":
        shapes: dict[str, Shape] = _of_points(points, sizes)
    else:
        shapes = _of_shape(what, sizes) if what in SHAPES else _of_model(what, sizes, part)
    document = SectionsDocument(version=__version__, sections=[_row(name, shape) for name, shape in shapes.items()])

    def told(console: Console) -> None:
        for row in document.sections:
            console.print(terminal.two_columns(_title(row), dict(_cells(row))))

    output.show(document, lambda: _content(what, shapes, document), told)
    return OK


def _of_points(points: Sequence[Path], sizes: Sequence[str]) -> dict[str, Shape]:
    if not points:
        raise UsageError("polygon: give its corners, --points outline.csv hole.csv")
    outline, *holes = (_corners(file) for file in points)
    return {"polygon": shape("polygon", outline_mm=outline, holes_mm=holes, **_values(sizes))}


def _corners(file: Path) -> list[tuple[float, float]]:
    try:
        rows = [row for row in csv.reader(file.read_text(encoding="utf-8-sig").splitlines()) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"--points {file}: cannot be read: give a CSV file in UTF-8") from error
    header = [cell.strip() for cell in rows[0]] if rows else []
    if header != ["y_mm", "z_mm"]:
        raise UsageError(f"--points {file}: begin with the line y_mm,z_mm")
    corners = []
    for number, row in enumerate(rows[1:], start=1):
        try:
            y, z = (plain_number(cell) for cell in row)
        except ValueError:
            raise UsageError(f"--points {file}, row {number}: write two numbers, y and z in mm") from None
        corners.append((y, z))
    return corners


def _of_shape(name: str, sizes: Sequence[str]) -> dict[str, Shape]:
    return {name: shape(name, **_values(sizes))}


def _values(sizes: Sequence[str]) -> dict[str, Any]:
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
    return values


def _of_model(model: str, sizes: Sequence[str], parts: Sequence[str]) -> dict[str, Shape]:
    if sizes:
        hint = did_you_mean(model, SHAPES) or f"; there are {', '.join(SHAPES)}"
        raise UsageError(f"'{sizes[0]}' belongs to a shape, and '{model}' is none{hint}")
    tables = {table["name"]: table.get("section") or {} for table in part_tables(model)}
    for name in parts:
        if name not in tables:
            hint = did_you_mean(name, tables) or f"; it has {', '.join(tables)}"
            raise UsageError(f"--part: {model} has no part '{name}'{hint}")
    shapes = {
        name: checked_shape(tables[name], f"{model}: part '{name}', section")
        for name in parts or tables
        if "shape" in tables[name]
    }
    if not shapes:
        raise UsageError(
            f"{', '.join(parts) or model}: no section has a shape: one that is given by its stiffness has no areas"
        )
    return shapes


def _row(name: str, shape: Shape) -> SectionRow:
    shear, (Iy, Iz), E = list(shape.shear_areas), shape.inertias, shape.youngs_modulus_MPa
    constants = shape.geometry if isinstance(shape, Polygon) else None
    return SectionRow(
        name=name, shape=next(kind for kind, one in SHAPES.items() if one is type(shape)), area_mm2=shape.area,
        second_moments_mm4=list(shape.inertias), section_moduli_mm3=list(shape.section_moduli),
        torsion_constant_mm4=shape.torsion_constant, warping_constant_mm6=shape.warping_constant,
        warping_length_mm=shape.warping_length, shear_areas_mm2=shear,
        shear_factors=[each / shape.area for each in shear], EA_N=E * shape.area,
        GJ_Nmm2=shape.shear_modulus * shape.torsion_constant, EI_Nmm2=[E * Iy, E * Iz],
        mass_kg_per_m=1e-6 * shape.area * (shape.density_kg_per_m3 or 0.0),
        product_of_inertia_mm4=constants.product if constants else 0.0,
        centroid_mm=list(constants.centroid) if constants else [0.0, 0.0],
        shear_centre_mm=list(constants.shear_centre) if constants else [0.0, 0.0],
        mesh_errors=constants.errors if constants else {},
        no_beam=_no_beam(shape),
    )  # fmt: skip


def _no_beam(shape: Shape) -> str:
    """Why a profile is no section of a beam; empty where it is one."""
    try:
        shape.stiffness()
    except ValueError as error:
        return str(error)
    return ""


def _title(row: SectionRow) -> str:
    return row.shape if row.name == row.shape else f"{row.name}: {row.shape}"


def _cells(row: SectionRow) -> list[tuple[str, str]]:
    rows = ROWS if not row.mesh_errors else (*ROWS, *OF_POLYGONS)
    cells = [
        (name, f"{', '.join(f'{value:.6g}' for value in values(row))} {unit}".strip())
        for name, unit, values in rows
    ]
    if row.mesh_errors:
        cells.append(
            ("errors of the mesh, relative", ", ".join(f"{k} {v:.0e}" for k, v in row.mesh_errors.items()))
        )
    return [*cells, ("no section of a beam", row.no_beam)] if row.no_beam else cells


def _content(what: str, shapes: Mapping[str, Shape], document: SectionsDocument) -> Content:
    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import sections_picture

        return [sections_picture(shapes)]

    tables = [ReportTable(_title(row), ("constant", "value"), tuple(_cells(row))) for row in document.sections]
    verdict = "x is along the beam; y is drawn upwards and z to the right."
    return Content(f"{what}: cross-sections", [verdict], tables, draw)
