"""TOML: files that are read, and plain documents as text, such as a model file that a calibration has changed."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")
WIDTH = 110
"""Longer lists get a line for each entry."""


def toml_text(document: Mapping[str, Any]) -> str:
    """A document of tables, lists, numbers, texts and booleans as TOML; reading it gives the same document.

    Lists of tables at the top become ``[[tables]]``, deeper ones stand inline.
    """
    return "\n".join(_table(document, "")).strip() + "\n"


def toml_line(key: str, value: object) -> str:
    """One key of a document, a table inline.

    Example:
        >>> toml_line("units", {"length": "mm"})
        'units = { length = "mm" }'
    """
    return f"{_key(key)} = {_value(value)}"


def _table(table: Mapping[str, Any], path: str) -> list[str]:
    lines, later = [], []
    for key, value in table.items():
        name = f"{path}.{_key(key)}" if path else _key(key)
        if isinstance(value, Mapping):
            later += ["", f"[{name}]", *_table(value, name)]
        elif not path and isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            for one in value:
                later += ["", f"[[{name}]]", *_table(one, name)]
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    return [*lines, *later]


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _value(key)


def _value(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return '"' + "".join(_escaped(letter) for letter in value) + '"'
        case list() | tuple():
            entries = [_value(one) for one in value]
            flat = "[" + ", ".join(entries) + "]"
            return flat if len(flat) <= WIDTH else "[\n" + "".join(f"  {one},\n" for one in entries) + "]"
        case Mapping():
            return "{ " + ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items()) + " }"
        case _:
            raise TypeError(f"TOML has no {type(value).__name__}")


def _escaped(letter: str) -> str:
    if letter in '"\\':
        return "\\" + letter
    return letter if letter.isprintable() else f"\\U{ord(letter):08X}"


# --- TOML of a user's file, bounded: no text of a few kilobytes takes gigabytes or the interpreter's stack --------

DEEPEST = 100
"""Parts of a dotted key; the formats here have five. What `tomllib` allocates grows with the square of their
number."""
LARGEST = 50_000_000
"""Characters of a file."""
# a bare part begins where a word begins, or a long word would be looked at from each of its letters
_DOTTED = re.compile(r"(?:(?:(?<![\w-])[\w-]++|\"[^\"\n]*\"|'[^'\n]*')[ \t]*+\.[ \t]*+)" + f"{{{DEEPEST}}}")


def parse_toml(text: str) -> dict[str, Any]:
    """The content of a text.

    Raises:
        ValueError: not TOML, nested too deeply, or too large.
    """
    if len(text) > LARGEST:
        raise ValueError(f"{len(text)} characters: a file may have {LARGEST}")
    deep = _DOTTED.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise ValueError(f"a key of more than {DEEPEST} parts (line {line})")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        at = re.search(r"at line (\d+)", str(error))
        lines = text.splitlines()
        raise ValueError(f"{error}{_remedy(lines[int(at[1]) - 1] if at and lines else '')}") from None


def _remedy(line: str) -> str:
    """What to write instead of a line that is no TOML; nothing where that is not plain."""
    if match := re.match(r"\s*([\w-]+)\s*=\s*([-+]?\d+),(\d+)\s*(#|$)", line):
        return f": write a decimal point, {match[1]} = {match[2]}.{match[3]}"
    if match := re.match(r"\s*([\w-]+)\s*=\s*([-+]?\d[\d.]*(?:e[-+]?\d+)?)\s*[A-Za-zµ°%/]", line):
        return f": write the number without its unit, {match[1]} = {match[2]}"
    if line.split("#")[0].count('"') % 2:
        return ": a text begins and ends with a quotation mark, on one line"
    if "=" not in line and line.count(",") > 0 and not line.lstrip().startswith(("[", "#")):
        return ": this is a table of readings; a TOML file has lines such as name = value"
    return ""
