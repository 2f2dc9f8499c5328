"""Plain documents as TOML text, such as a model file that a calibration has changed."""

from __future__ import annotations

import re
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
