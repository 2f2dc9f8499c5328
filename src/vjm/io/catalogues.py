"""Catalogues of standard parts: rows of what a designer can buy, from a file or from the library."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TypeAlias

from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.files import csv_rows, parse_toml, toml_content

Row: TypeAlias = Mapping[str, float | str]
"""What a standard part is, by key."""
COLUMN_OF_NAME = "name"
"""For people; it does not go into the machine."""
NO_ROWS = "has no rows: give one for each part that there is"
COLUMN_OF_COST = "cost"
"""Of a part, in the user's currency; it does not go into the machine either."""


def catalogues() -> dict[str, str]:
    """The catalogues that come with the package: their titles by name.

    Example:
        >>> import vjm
        >>> sorted(vjm.catalogues())
        ['harmonic-drive-50-100', 'harmonic-drive-csf-30', 'round-tubes', 'square-tubes']
    """
    return {
        name: str(parse_toml(_folder().joinpath(f"{name}.toml").read_text(encoding="utf-8"))["title"])
        for name in catalogue_names()
    }


def catalogue_names() -> list[str]:
    """Names of the catalogues that come with the package; no file is read."""
    return sorted(file.name.removesuffix(".toml") for file in _folder().iterdir() if file.name.endswith(".toml"))


def catalogue(name_or_path: str | Path) -> list[Row]:
    """The rows of a catalogue.

    Args:
        name_or_path: one of `catalogues`; a CSV file, whose columns are keys of a table of a model file; or a TOML
            file with ``[[rows]]``. A column or key ``name`` is for people, ``cost`` is of a part.

    Raises:
        ModelFileError: no such catalogue, no rows, or a cell that is missing; one line.

    Example:
        >>> import vjm
        >>> rows = vjm.catalogue("square-tubes")
        >>> rows[0]["shape"], rows[0]["width_mm"]
        ('square_tube', 40.0)
    """
    where, text = _text(name_or_path)
    rows = _from_csv(where, text) if where.endswith(".csv") else _from_toml(where, text)
    if not rows:
        raise ModelFileError(f"{where}: {NO_ROWS}")
    return rows


def _folder() -> Traversable:
    return resources.files("vjm").joinpath("models", "catalogues")


def _text(name_or_path: str | Path) -> tuple[str, str]:
    inside = _folder() / f"{name_or_path}.toml"
    if isinstance(name_or_path, str) and inside.is_file():
        return inside.name, inside.read_text(encoding="utf-8")
    path = Path(name_or_path)
    if path.suffix not in (".csv", ".toml"):
        known = catalogue_names()
        hint = did_you_mean(str(name_or_path), known)
        raise ModelFileError(
            f"no catalogue '{name_or_path}'{hint}; give a file .csv or .toml, or one of {', '.join(known)}"
        )
    try:
        return path.name, path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelFileError(f"{path}: cannot be read: give a CSV or TOML file in UTF-8") from error


def _from_csv(where: str, text: str) -> list[Row]:
    records: list[Row] = []
    for place, row in csv_rows(text, where, lambda cells, _: cells, NO_ROWS):
        if not all(row.values()):
            raise ModelFileError(f"{place}: needs a value for each of {', '.join(row)}")
        records.append({key: _cell(cell) for key, cell in row.items()})
    return records


def _cell(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _from_toml(where: str, text: str) -> list[Row]:
    content = toml_content(text, where)
    rows = content.get("rows", [])
    common = dict(content.get("all", {}))
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        raise ModelFileError(f"{where}: write [[rows]], one for each part")
    return [
        {k: float(v) if isinstance(v, int) and not isinstance(v, bool) else v for k, v in {**common, **row}.items()}
        for row in rows
    ]
