"""Files of tables of Denavit and Hartenberg, TOML or CSV, that name their convention and their units.

A TOML file has a table for each joint::

    convention = "mdh"
    units = { length = "mm", angle = "deg" }

    [[joints]]
    name = "shoulder"
    a = 0.0
    d = 0.0
    alpha = -90.0
    theta = 0.0
    limits = [-245.0, 65.0]

A CSV file has a row for each joint; all else stands in the same words in comment lines at its head::

    # convention = "mdh"
    # units = { length = "mm", angle = "deg" }
    name,a,d,alpha,theta,lower,upper
    shoulder,0,0,-90,0,-245,65
"""

from __future__ import annotations

import csv
import io
import math
import re
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic
from pydantic import Field, model_validator

from vjm.io.dh_table import ANGLES, DhRow, DhTable
from vjm.io.errors import ModelFileError, did_you_mean, one_line
from vjm.io.robot import Notes, Placing, Reading, Robot
from vjm.io.sections import Table
from vjm.io.serial_robot import table_robot, table_text
from vjm.io.toml_text import parse_toml, toml_line, toml_text

MM = {"mm": 1.0, "m": 1e3}
RADIANS = {"rad": 1.0, "deg": math.pi / 180.0}
NUMBERS = ("a", "d", "alpha", "theta", "beta", "lower", "upper")
COLUMNS = ("name", "kind", *NUMBERS)
NEEDED = ("a", "d", "alpha", "theta")
_AXES = (((0.0, 0.0, 1.0), 2), ((0.0, 1.0, 0.0), 1), ((1.0, 0.0, 0.0), 0))
_SAYS = re.compile(r"#\s*(\w[\w.]*\s*=.*)")

Three = Annotated[list[float], Field(min_length=3, max_length=3)]


class DhUnits(Table):
    """Of the whole file."""

    length: Literal["mm", "m"]
    angle: Literal["rad", "deg"]


class DhFrame(Table):
    """A frame in the one before it."""

    xyz: Three = Field([0.0, 0.0, 0.0], description="its place")
    rpy: Three = Field([0.0, 0.0, 0.0], description="roll, pitch, yaw about the fixed axes x, y, z, in this order")


class RowTable(Table):
    """One joint; lengths and angles in the file's units."""

    name: str = ""
    kind: Literal["revolute", "prismatic"] = "revolute"
    a: float
    d: float = Field(description="offset along the joint's axis; its coordinate is added where it slides")
    alpha: float
    theta: float = Field(description="offset of the angle; the joint's coordinate is added where it turns")
    beta: float = Field(0.0, description="Hayati's angle: about y, behind alpha")
    limits: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None


class DhFile(Table):
    """The whole file."""

    convention: Literal["dh", "mdh"] = Field(description="dh: Rz Tz Tx Rx; mdh: Rx Tx Rz Tz")
    units: DhUnits
    name: str = ""
    source: str = ""
    base: DhFrame | None = Field(None, description="of the first row, in the world")
    tool: DhFrame | None = Field(None, description="of the end, behind the last row")
    joints: list[RowTable] = Field(min_length=1)

    @model_validator(mode="after")
    def _names(self) -> DhFile:
        names = [row.name for row in self.joints if row.name]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two joints are called '{twice[0]}': rename one")
        return self


_KEYS: dict[str, type[Table]] = {"units": DhUnits, "base": DhFrame, "tool": DhFrame, "joint": RowTable}


def dh_robot(path: Path, reading: Reading) -> Robot:
    """The robot of a table's file.

    Raises:
        ModelFileError: it cannot be read, or lacks a column or the name of its convention or units.

    Example:
        >>> dh_robot(Path("puma.csv"), Reading())  # doctest: +SKIP
    """
    return table_robot(read_table(path), path.name, reading, Notes())


def read_table(path: Path) -> DhTable:
    """The table of a file, mm and rad.

    Raises:
        ModelFileError: see `dh_robot`.
    """
    text, file = table_text(path), path.name
    content = _csv_content(text, file) if path.suffix.lower() == ".csv" else _toml_content(text, file)
    if "parts" in content:
        raise ModelFileError(f"{file}: is a model file: all commands read it as it is")
    try:
        table = DhFile.model_validate(content)
    except pydantic.ValidationError as error:
        said = one_line(error, content, lambda name: _KEYS.get(name, DhFile).model_fields)
        raise ModelFileError(f"{file}: {said}") from error
    mm, rad = MM[table.units.length], RADIANS[table.units.angle]
    rows = []
    for k, row in enumerate(table.joints, start=1):
        slides = row.kind == "prismatic"
        limits = None
        if row.limits is not None:
            low, high = (limit * (mm if slides else rad) for limit in row.limits)
            limits = low, high
        angles = {key: getattr(row, key) * rad for key in ANGLES}
        rows.append(DhRow(row.name or f"joint-{k}", slides, row.a * mm, row.d * mm, limits=limits, **angles))
    name = table.name or path.name.split(".")[0]
    base, tool = (_placing(one, mm, rad) for one in (table.base, table.tool))
    return DhTable(name, table.convention, tuple(rows), base, tool)


def _placing(table: DhFrame | None, mm: float, rad: float) -> Placing:
    if table is None:
        return Placing()
    x, y, z = (value * mm for value in table.xyz)
    angles = [math.remainder(angle * rad, 2.0 * math.pi) for angle in table.rpy]
    return Placing((x, y, z), tuple((axis, angles[k]) for axis, k in _AXES if angles[k]))


def _toml_content(text: str, file: str) -> dict[str, Any]:
    try:
        return parse_toml(text)
    except ValueError as error:
        raise ModelFileError(f"{file}: {error}") from error


def _csv_content(text: str, file: str) -> dict[str, Any]:
    lines = text.splitlines()
    said = "\n".join(match[1] for line in lines if (match := _SAYS.match(line.strip())))
    content = _toml_content(said, f"{file}: the comment lines at its head")
    # comments are blanked, not taken out: the lines keep their numbers
    plain = "\n".join("" if line.lstrip().startswith("#") else line for line in lines)
    reader = csv.reader(io.StringIO(plain))
    rows: list[dict[str, Any]] = []
    head: list[str] = []
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells):
                continue
            if not head:
                head = _head([cell.strip() for cell in cells], f"{file}: line {reader.line_num}")
                continue
            where = f"{file}: line {reader.line_num}"
            if len(cells) != len(head):
                raise ModelFileError(f"{where}: has {len(cells)} cells, and the table has {len(head)} columns")
            rows.append(_csv_row(dict(zip(head, (cell.strip() for cell in cells), strict=True)), where))
    except csv.Error as error:
        raise ModelFileError(f"{file}: line {reader.line_num}: {error}") from error
    if not head:
        raise ModelFileError(f"{file}: has no columns: give {', '.join(NEEDED)}")
    return content | {"joints": rows}


def _head(cells: list[str], where: str) -> list[str]:
    for column in cells:
        if column not in COLUMNS:
            hint = did_you_mean(column, COLUMNS) or f"; known are {', '.join(COLUMNS)}, with commas between them"
            raise ModelFileError(f"{where}: unknown column '{column}'{hint}")
    if twice := [column for column in COLUMNS if cells.count(column) > 1]:
        raise ModelFileError(f"{where}: the column {twice[0]} stands twice: take one out")
    if lacking := [column for column in NEEDED if column not in cells]:
        raise ModelFileError(f"{where}: the column {lacking[0]} is missing: add it")
    return cells


def _csv_row(cells: dict[str, str], where: str) -> dict[str, Any]:
    row: dict[str, Any] = {key: cells[key] for key in ("name", "kind") if cells.get(key)}
    numbers: dict[str, float] = {}
    for key in NUMBERS:
        if not cells.get(key):
            if key in NEEDED:
                raise ModelFileError(f"{where}: {key} is empty: give a number")
            continue
        try:
            numbers[key] = float(cells[key])
        except ValueError:
            raise ModelFileError(
                f"{where}: {key} is {cells[key]!r}, which is no number: write one with a decimal point"
            ) from None
    limits = [numbers.pop(key) for key in ("lower", "upper") if key in numbers]
    if len(limits) == 1:
        raise ModelFileError(f"{where}: has one limit of two: give lower and upper, or none")
    return row | numbers | ({"limits": limits} if limits else {})


# --- writing --------------------------------------------------------------------------------------------------


def dh_text(table: DhTable, source: str, suffix: str) -> str:
    """The file of a table, in mm and rad; every number is written exactly.

    Args:
        table: to be written.
        source: of the machine.
        suffix: of the file, ``.csv`` or ``.toml``.

    Example:
        >>> print(dh_text(DhTable("one", "dh", (DhRow("hip", a=300.0),)), "", ".csv"))
        # convention = "dh"
        # units = { length = "mm", angle = "rad" }
        # name = "one"
        name,kind,a,d,alpha,theta
        hip,revolute,300.0,0.0,0.0,0.0
        <BLANKLINE>
    """
    head: dict[str, Any] = {
        "convention": table.convention,
        "units": {"length": "mm", "angle": "rad"},
        "name": table.name,
    }
    head |= {"source": source} if source else {}
    for key, placing in (("base", table.base), ("tool", table.tool)):
        if not placing.is_identity:
            angles = dict(placing.turns)
            head[key] = {"xyz": list(placing.shift), "rpy": [angles.get(axis, 0.0) for axis, _ in reversed(_AXES)]}
    rows = [_row_keys(row, beta=any(one.beta for one in table.rows)) for row in table.rows]
    if suffix == ".csv":
        return _csv_text(head, rows)
    return toml_text(head | {"joints": rows})


def _row_keys(row: DhRow, *, beta: bool) -> dict[str, Any]:
    keys: dict[str, Any] = {"name": row.name, "kind": "prismatic" if row.slides else "revolute"}
    keys |= {key: getattr(row, key) + 0.0 for key in (*NEEDED, *(["beta"] if beta else []))}
    return keys | ({"limits": list(row.limits)} if row.limits else {})


def _csv_text(head: dict[str, Any], rows: list[dict[str, Any]]) -> str:
    out = io.StringIO()
    for key, value in head.items():
        out.write(f"# {toml_line(key, value)}\n")
    limited = any("limits" in row for row in rows)
    columns = [key for key in COLUMNS if key in rows[0] or (limited and key in ("lower", "upper"))]
    writer = csv.DictWriter(out, columns, restval="", lineterminator="\n")
    writer.writeheader()
    for row in rows:
        limits = dict(zip(("lower", "upper"), row.pop("limits", []), strict=False))
        writer.writerow(
            {key: repr(value) if isinstance(value, float) else value for key, value in (row | limits).items()}
        )
    return out.getvalue()
