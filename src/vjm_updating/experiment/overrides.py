"""A sheet's ``[model]`` table: changes of the model file's own values, before the chain is built."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any

from vjm.io.errors import did_you_mean
from vjm.io.schema import BeamTable
from vjm.io.sections import StiffnessSection, Table
from vjm.io.shapes import SHAPES, Shape

SEGMENTS = ("link_segments", "foot_segments")
"""Keys that say how the model is solved and are no values of the machine."""
ACTUATOR = "actuator_compliance_mm_per_N"
_MATERIAL = tuple(Shape.model_fields)
_SECTIONS: tuple[type[Table], ...] = (StiffnessSection, *SHAPES.values())
_SECTION_KEYS = {key for table in _SECTIONS for key in table.model_fields} - {"source"}


def overridden(content: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A model document with a sheet's overrides.

    A key is one of docs/measured-data.md's, a key of the link or its section, or a dotted path into the file. A
    list's table is found by its ``name`` or its number from 1, and a path may begin at a part's name.

    Args:
        content: as TOML gives it; not changed.
        overrides: the sheet's ``[model]``.

    Raises:
        ValueError: a key leads nowhere.
    """
    document = copy.deepcopy(dict(content))
    flat = {key: value for key, value in _flat(overrides) if key not in SEGMENTS}
    shape = flat.pop("section", None)
    if shape is not None:
        _reshape(_link(document), shape)
    for key, value in flat.items():
        if key == ACTUATOR:
            drives = [part for part in _parts(document) if part.get("kind") == "actuator"]
            if value and not drives:
                raise ValueError(f"[model]: {ACTUATOR} = {value}, but the model has no actuator: leave it out")
            for part in drives:
                part["compliance_mm_per_N"] = value
        elif "." in key:
            _set(document, key, value)
        elif key in BeamTable.model_fields:
            _link(document)[key] = value
        elif key in _SECTION_KEYS:
            _link(document).setdefault("section", {})[key] = value
        elif key in document:
            document[key] = value
        else:
            known = [*SEGMENTS, ACTUATOR, *BeamTable.model_fields, *sorted(_SECTION_KEYS)]
            raise ValueError(f"[model]: unknown key '{key}'{did_you_mean(key, known)}")
    return document


def _flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _parts(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    parts: list[dict[str, Any]] = document.get("parts", [])
    return parts


def _link(document: Mapping[str, Any]) -> dict[str, Any]:
    """The beam that a key without a path means: the one called link, else the only one."""
    beams = [part for part in _parts(document) if part.get("kind") == "beam"]
    named = [part for part in beams if part.get("name") == "link"] or beams
    if len(named) != 1:
        names = ", ".join(str(part.get("name")) for part in beams)
        raise ValueError(f"[model]: the model has no one link: write a path such as 'parts.<name>.key' ({names})")
    return named[0]


def _reshape(link: dict[str, Any], shape: object) -> None:
    """Another cross-section of the same material."""
    if not isinstance(shape, str) or shape not in SHAPES:
        raise ValueError(f"[model]: section must be one of {', '.join(SHAPES)}, got {shape!r}")
    old = link.get("section", {})
    kept = SHAPES[shape].model_fields if old.get("shape") == shape else _MATERIAL
    link["section"] = {key: value for key, value in old.items() if key in kept} | {"shape": shape}


def _set(document: dict[str, Any], path: str, value: object) -> None:
    *way, last = path.split(".")
    here: Any = document
    for i, step in enumerate(way):
        if i == 0 and step in BeamTable.model_fields:
            here = _link(document).setdefault(step, {})
        elif i == 0 and step not in document:
            here = _part(document, step, path)
        elif isinstance(here, list):
            here = _entry(here, step, path)
        elif isinstance(here, dict):
            here = here.setdefault(step, {})
        else:
            raise ValueError(f"[model]: '{path}' leads nowhere: '{step}' is inside a value")
    if not isinstance(here, dict):
        raise ValueError(f"[model]: '{path}' leads nowhere: name a key of a table")
    here[last] = value


def _part(document: Mapping[str, Any], name: str, path: str) -> dict[str, Any]:
    for part in _parts(document):
        if part.get("name") == name:
            return part
    names = [str(part.get("name")) for part in _parts(document)]
    raise ValueError(f"[model]: '{path}' leads nowhere: no table or part '{name}'{did_you_mean(name, names)}")


def _entry(table: list[Any], step: str, path: str) -> object:
    for entry in table:
        if isinstance(entry, dict) and entry.get("name") == step:
            return entry
    if step.isdigit() and 1 <= int(step) <= len(table):
        return table[int(step) - 1]
    raise ValueError(f"[model]: '{path}' leads nowhere: no entry '{step}'")
