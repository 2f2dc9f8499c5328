"""Where readings and a sheet come from: files, or what a program holds. Both go the same way from their text on."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from vjm.io.toml_parsing import parse_toml
from vjm.io.toml_text import toml_text

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
        name: for messages.
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
    if isinstance(readings, Source):
        return readings
    if isinstance(readings, (str, Path)):
        path = Path(readings)
        try:
            return Source(path.name, path.read_bytes(), path.parent)
        except OSError as error:
            raise DataError(f"{path}: cannot be read: {error.strerror}") from error
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
    if isinstance(sheet, Source):
        return sheet
    if isinstance(sheet, (str, Path)):
        path = Path(sheet)
        try:
            return Source(path.name, path.read_bytes(), path.parent)
        except OSError as error:
            raise SheetError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        return Source(SHEET, toml_text(sheet).encode(), Path())
    except TypeError as error:
        raise SheetError(f"{SHEET}: {error}: write numbers, texts, lists and tables of them") from error


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


def table_in(source: Source) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The header of a CSV text and its rows, numbered as lines of the file; lines that begin with # are comments.

    Raises:
        DataError: it is no such text; one line.
    """
    try:
        lines = ["" if line.startswith("#") else line for line in source.raw.decode("utf-8-sig").splitlines()]
        head = next((i for i, line in enumerate(lines) if line.strip()), 0)
        header, table = _table_of(list(csv.reader(lines[head:])))
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{source.name}: no CSV text in UTF-8: {error}") from error
    except ValueError as error:
        raise DataError(f"{source.name}: {error}") from error
    return header, [(number + head, cells) for number, cells in table]


def _table_of(lines: list[list[str]]) -> tuple[list[str], list[tuple[int, list[str]]]]:
    if not lines:
        raise ValueError("the file is empty; its first line must name the columns")
    header = [name.strip() for name in lines[0]]
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"column '{twice}' stands twice: leave one")
    table = []
    for i, cells in enumerate(lines[1:], start=2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(header):
            raise ValueError(f"row {i}: {len(cells)} cells for {len(header)} columns: complete it or delete it")
        table.append((i, [cell.strip() for cell in cells]))
    if not table:
        raise ValueError("there is a header but no reading below it")
    return header, table


def _cell(value: object) -> str:
    """Of a column, as a file has it: blank where it was not read."""
    return "" if value is None or value != value else str(value)
