"""TOML of a user's file, bounded: no text of a few kilobytes takes gigabytes or the interpreter's stack."""

from __future__ import annotations

import re
import tomllib
from typing import Any

DEEPEST = 100
"""Parts of a dotted key; the formats here have five. The library's memory grows with the square of their number."""
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
