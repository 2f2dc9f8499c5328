"""Reference pages that are made of the programs: the command line of its parser, the formats of their schemas."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vjm.io.manipulator_file import manipulator_schema
from vjm.io.model_file import model_schema
from vjm_updating.experiment.sheet import Sheet
from vjm_updating.poses.measurement import PoseSheet
from vjm_validation.cli.main import app

FORMATS = {
    "model-keys": ("Keys of a model file", "[Model files](../model-file.md) says it in words.", model_schema),
    "manipulator-keys": (
        "Keys of a manipulator file",
        "[Manipulators](../manipulators.md) says it in words.",
        manipulator_schema,
    ),
    "sheet-keys": (
        "Keys of a test sheet of ramps",
        "[Measured data](../measured-data.md) says it in words.",
        Sheet.model_json_schema,
    ),
    "pose-sheet-keys": (
        "Keys of a test sheet of poses",
        "[Robots measured by where they are](../poses.md) says it in words.",
        PoseSheet.model_json_schema,
    ),
}
"""By page: title, a word, and the schema."""


def write_reference(folder: Path) -> None:
    """Write the pages that have changed."""
    _write(folder / "cli.md", _command_line())
    for name, (title, word, schema) in FORMATS.items():
        _write(folder / f"{name}.md", _format(title, word, schema()))


def _write(file: Path, text: str) -> None:
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def _command_line() -> str:
    made = app.generate_docs(output_format="markdown")
    # its sections only: the list of commands is in the page's own table of contents
    sections = made[made.index("\n## validate all") :]
    return f"# The command line\n\nMade from the parser. `validate COMMAND --help` says the same.\n{sections}"


def _format(title: str, word: str, schema: Mapping[str, Any]) -> str:
    lines = [f"# {title}", "", f"Made from the schema that checks the file. {word}", ""]
    lines += _table("The file", schema)
    for name, part in schema.get("$defs", {}).items():
        if part.get("properties"):
            lines += _table(_title(name, part), part)
    return "\n".join(lines)


def _title(name: str, part: Mapping[str, Any]) -> str:
    kind = part["properties"].get("kind", {})
    kinds = kind.get("enum", [kind["const"]] if "const" in kind else [])
    return f"{name}: kind = " + " or ".join(f'"{one}"' for one in kinds) if kinds else name


def _table(title: str, part: Mapping[str, Any]) -> list[str]:
    lines = [f"## {title}", ""]
    if part.get("description"):
        lines += [part["description"].split("\n\n")[0].replace("\n", " ").replace("``", "`"), ""]
    lines += ["| key | type | if left out | meaning |", "| --- | --- | --- | --- |"]
    needed = part.get("required", ())
    for key, entry in part["properties"].items():
        left_out = "**needed**" if key in needed else _cell(entry.get("default"))
        lines.append(f"| `{key}` | {_type(entry)} | {left_out} | {_words(entry)} |")
    return [*lines, ""]


def _cell(default: object) -> str:
    return "" if default in (None, "", [], {}) else f"`{str(default).replace('|', chr(92) + '|')}`"


def _words(entry: Mapping[str, Any]) -> str:
    limits = [
        f"{word} {entry[key]:g}"
        for key, word in (("minimum", "from"), ("exclusiveMinimum", "above"), ("maximum", "to"))
        if key in entry
    ]
    words = entry.get("description", "").replace("\n", " ").replace("|", "\\|")
    return "; ".join(filter(None, (words, " ".join(limits))))


def _type(entry: Mapping[str, Any]) -> str:
    """A type in words."""
    if "$ref" in entry:
        return str(entry["$ref"]).rpartition("/")[2]
    if "const" in entry:
        return f"`{entry['const']!r}`"
    if "enum" in entry:
        return ", ".join(f"`{one!r}`" for one in entry["enum"])
    for key in ("anyOf", "oneOf"):
        if key in entry:
            return " or ".join(dict.fromkeys(_type(one) for one in entry[key] if one.get("type") != "null"))
    if entry.get("type") == "array" or "prefixItems" in entry:
        inner = _type(entry["items"]) if isinstance(entry.get("items"), dict) else "number"
        count = f"{entry['minItems']} " if entry.get("minItems") == entry.get("maxItems", -1) else ""
        return f"list of {count}{inner}"
    if entry.get("type") == "object":
        return "table"
    return str(entry.get("type", "any"))
