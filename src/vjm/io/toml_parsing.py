"""TOML of a user's file, bounded: no text of a few kilobytes takes gigabytes or the interpreter's stack."""

from __future__ import annotations

import re
import tomllib
from typing import Any

DEEPEST = 100
"""Parts of a dotted key; the formats here have five. The library's working memory grows with the square
of their number."""
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
