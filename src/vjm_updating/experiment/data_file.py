"""Tables of readings: which quantity and unit a column is, and where readings and a sheet come from.

From files, or from what a program holds. Both go the same way from their text on.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vjm.io.errors import did_you_mean, printed
from vjm.io.files import parse_toml, toml_text
from vjm.plain_numbers import plain_number
from vjm.rotations import Array

POSE = ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad")
"""Displacement of the end-effector from its unloaded pose, world axes."""
WRENCH = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
"""Wrench that the chain needs at the end-effector, world axes."""
TIME, POSTURE, RUN, TEMPERATURE = "time_s", "posture", "run", "temperature_C"
MOTION, EFFORT = ("angle_rad", "deflection_mm"), ("torque_Nmm", "force_N")
"""Of a test of one joint: its turn, or the shift of a point on a lever; its torque, or the force on a lever."""
OF_JOINT = (TIME, RUN, *MOTION, *EFFORT, TEMPERATURE)
"""Every column of a test of one joint."""
PLAIN = (TIME, POSTURE, RUN, *POSE, *WRENCH, TEMPERATURE)
"""Every column that needs no point."""

_OTHER_UNITS = {
    "mm": {"m": 1e3, "cm": 10.0, "um": 1e-3, "µm": 1e-3, "in": 25.4},
    "rad": {"mrad": 1e-3, "deg": 0.017453292519943295},
    "N": {"kN": 1e3, "mN": 1e-3, "MN": 1e6, "lbf": 4.4482216152605},
    "Nmm": {"Nm": 1e3, "kNmm": 1e3, "kNm": 1e6, "mNm": 1.0},
    "s": {"ms": 1e-3, "min": 60.0, "h": 3600.0},
    "C": {"K": 1.0, "F": 1.0},
}
"""What people write instead, and what it takes to convert."""
_QUANTITY = re.compile(r"(?:(?P<point>[A-Za-z][\w-]*)\.)?(?P<name>[a-z]+)(?:_(?P<unit>.+))?")


def split_point(column: str) -> tuple[str, str]:
    """The point that a column belongs to, empty for the end-effector, and the channel there: ``mid``, ``uy_mm``."""
    point, dot, channel = column.rpartition(".")
    return (point, channel) if dot else ("", column)


def unit_of(channel: str) -> str:
    """A channel's unit: ``mm`` of ``mid.uy_mm``."""
    return split_point(channel)[1].rpartition("_")[2]


def beyond_turn(angle: float, most: float, remedy: str = "") -> str:
    """What may be wrong with an angle in rad that is larger than any: degrees, where they explain it.

    Angles are in rad; ``remedy`` is for those in degrees.
    """
    explained = radians(abs(angle)) <= most
    return f"is it in degrees?{remedy and f' {remedy}'}" if explained else "degrees do not explain it either"


def converted(given: str, unit: str) -> str:
    """How a column in a unit is written in the format's: ``multiply it by 1000``."""
    factor = _OTHER_UNITS.get(unit, {}).get(given, 1.0)
    return "convert it" if factor == 1.0 else f"multiply it by {printed(factor)}"


def check_column(column: str, points: tuple[str, ...], plain: tuple[str, ...] = PLAIN) -> None:
    """Refuse a column that is no channel, with the remedy.

    ``points`` are those that the sheet names, ``plain`` are columns that need none.

    Raises:
        ValueError: an unknown quantity or point, or a unit other than the format's.
    """
    point, channel = split_point(column)
    if point and point not in points:
        known = f"the sheet names {', '.join(points)}" if points else "the sheet names none"
        raise ValueError(f"column '{column}': no point '{point}'; {known}: add [points.{point}]")
    known_channels = POSE if point else plain
    if channel in known_channels:
        return
    match = _QUANTITY.fullmatch(column)
    quantity = match["name"] if match else column
    right = next((name for name in known_channels if name.split("_")[0] == quantity and "_" in name), None)
    if right is None:
        hint = did_you_mean(channel, known_channels)
        raise ValueError(f"column '{column}' is no channel{hint or '; known are ' + ', '.join(known_channels)}")
    name = f"{point}.{right}" if point else right
    unit, given = right.split("_")[1], match["unit"] if match else None
    if given is None:
        raise ValueError(f"column '{column}' has no unit: name it {name} if it is in {unit}")
    if (how := converted(given, unit)) == "convert it":
        raise ValueError(
            f"column '{column}': '{given}' is not the unit of {quantity}: convert to {unit}, as {name}"
        )
    raise ValueError(f"column '{column}' must be in {unit}: {how} and name it {name}")


READINGS, SHEET = "readings", "sheet"
"""Names in messages of what is no file."""


class DataError(ValueError):
    """Data that cannot be used; its text is one line that names the file, the column, the row and the remedy."""


class SheetError(ValueError):
    """A sheet that cannot be used; its text is one line that names the file, the key and the remedy."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


class Columns(Protocol):
    """Columns by name: a mapping of sequences, or a DataFrame of pandas."""

    def keys(self) -> Iterable[str]:
        """Names."""

    def __getitem__(self, name: str, /) -> Iterable[Any]:
        """Values of one; a number that is none was not read."""


@dataclass(frozen=True)
class Source:
    """A text and where it is from.

    Attributes:
        raw: the text in UTF-8.
        folder: beside which other files are looked for.
    """

    name: str
    raw: bytes
    folder: Path

    @property
    def sha256(self) -> str:
        """Of the text."""
        return hashlib.sha256(self.raw).hexdigest()


TableSource = Path | str | Columns | Source
"""Readings: a CSV file, or columns under the names that a file has."""
SheetSource = Path | str | Mapping[str, Any] | Source
"""A sheet: a TOML file, or its content."""


def source_of_readings(readings: TableSource) -> Source:
    """The text of readings.

    Raises:
        DataError: the file cannot be read, or columns are of different lengths; one line.
    """
    if isinstance(readings, Source | str | Path):
        return _source(readings, DataError)
    columns = {str(name): [_cell(value) for value in readings[name]] for name in readings.keys()}  # noqa: SIM118
    lengths = {len(cells) for cells in columns.values()}
    if len(lengths) > 1:
        said = ", ".join(f"{name} has {len(cells)}" for name, cells in columns.items())
        raise DataError(f"{READINGS}: columns differ in length ({said}): give each a value for every reading")
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([list(columns), *zip(*columns.values(), strict=True)])
    return Source(READINGS, text.getvalue().encode(), Path())


def source_of_sheet(sheet: SheetSource) -> Source:
    """The text of a sheet.

    Raises:
        SheetError: the file cannot be read, or the content has what TOML has not; one line.
    """
    if isinstance(sheet, Source | str | Path):
        return _source(sheet, SheetError)
    try:
        return Source(SHEET, toml_text(sheet).encode(), Path())
    except TypeError as error:
        raise SheetError(f"{SHEET}: {error}: write numbers, texts, lists and tables of them") from error


def _source(given: Source | str | Path, kind: type[ValueError]) -> Source:
    """A file's text, or what was read before."""
    if isinstance(given, Source):
        return given
    path = Path(given)
    try:
        return Source(path.name, path.read_bytes(), path.parent)
    except OSError as error:
        raise kind(f"{path}: cannot be read: {error.strerror}") from error


def toml_of(source: Source) -> dict[str, Any]:
    """The content of a sheet.

    Raises:
        SheetError: it is no TOML; one line.
    """
    try:
        return parse_toml(source.raw.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise SheetError(f"{source.name}: not UTF-8 text; save it as UTF-8") from error
    except ValueError as error:
        raise SheetError(f"{source.name}: not valid TOML: {error}") from error


@dataclass(frozen=True)
class DataTable:
    """The cells of a CSV text as they are written.

    Attributes:
        row: lines of the file ``(n,)``, the first being line 1.
        cells: n by column, in the order of the header.
    """

    name: str
    sha256: str
    row: np.ndarray
    cells: Mapping[str, list[str]]

    @contextmanager
    def named(self) -> Iterator[None]:
        """What is wrong with the readings begins with their name.

        Raises:
            DataError: in place of any ValueError within that is not of the sheet; one line.
        """
        try:
            yield
        except SheetError:
            raise
        except ValueError as error:
            raise DataError(f"{self.name}: {error}") from error

    def numbers(self, column: str) -> Array:
        """A column ``(n,)``, nan for a blank.

        Raises:
            ValueError: a cell is no finite number.
        """
        result = np.full(len(self.row), np.nan)
        for i, (cell, row) in enumerate(zip(self.cells[column], self.row, strict=True)):
            if not cell:
                continue
            try:
                result[i] = plain_number(cell)
            except ValueError:
                remedy = "write it with a point" if "," in cell else "leave the cell of a missed sample blank"
                raise ValueError(f"row {row}, column {column}: '{cell}' is no number: {remedy}") from None
            if not np.isfinite(result[i]):
                raise ValueError(f"row {row}, column {column}: '{cell}' is not finite: leave a missed sample blank")
        return result


def table_of(readings: TableSource) -> DataTable:
    """The cells of readings; lines of a file that begin with # are comments.

    Raises:
        DataError: it is no CSV text with a header and rows as long; one line.
    """
    source = source_of_readings(readings)
    try:
        lines = ["" if line.startswith("#") else line for line in source.raw.decode("utf-8-sig").splitlines()]
        head = next((i for i, line in enumerate(lines) if line.strip()), 0)
        header, *rows = [[cell.strip() for cell in cells] for cells in csv.reader(lines[head:])] or [[]]
        if not header:
            raise ValueError("the file is empty; its first line must name the columns")
        if several := [name for name in header if re.search(r"[;\t]", name)]:
            raise ValueError(f"column '{several[0]}' is several: separate columns by commas, write decimal points")
        if twice := [name for name in header if header.count(name) > 1]:
            raise ValueError(f"column '{twice[0]}' stands twice: leave one")
        table = [(number, cells) for number, cells in enumerate(rows, start=head + 2) if any(cells)]
        for number, cells in table:
            if len(cells) != len(header):
                raise ValueError(
                    f"row {number}: {len(cells)} cells for {len(header)} columns: complete it or delete it"
                )
        if not table:
            raise ValueError("there is a header but no reading below it")
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{source.name}: no CSV text in UTF-8: {error}: save it as CSV in UTF-8") from error
    except ValueError as error:
        raise DataError(f"{source.name}: {error}") from error
    numbers, cells_of_rows = zip(*table, strict=True)
    columns = map(list, zip(*cells_of_rows, strict=True))
    return DataTable(source.name, source.sha256, np.array(numbers), dict(zip(header, columns, strict=True)))


def _cell(value: object) -> str:
    """Of a column, as a file has it: blank where it was not read."""
    return "" if value is None or value != value else str(value)
