"""Load cases as plain data: for the records and the heads of curve files."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import Any

from vjm.model.load_case import Load, LoadCase, PointControl


def plain(load_case: LoadCase) -> dict[str, Any]:
    """What a load case says, as JSON's types, without what it leaves at its default."""
    everything = asdict(load_case)
    return {
        field.name: everything[field.name]
        for field in fields(LoadCase)
        if getattr(load_case, field.name) != field.default
    }


def from_plain(data: dict[str, Any]) -> LoadCase:
    """The load case that `plain` wrote.

    Raises:
        KeyError: a key is missing.
        TypeError: a key is unknown.
        ValueError: the load case makes no sense.
    """
    data = dict(data)
    data["loads"] = tuple(Load(**load) for load in data.get("loads", ()))
    if isinstance(data.get("control"), dict):
        control = data["control"]
        data["control"] = PointControl(control["part"], control["at"], tuple(control["direction"]))
    return LoadCase(**data)


def words(load_case: LoadCase) -> dict[str, str]:
    """`plain` as words without blanks, for one line of ``key=value``."""
    return {
        key: value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
        for key, value in plain(load_case).items()
    }


def from_words(head: dict[str, str]) -> LoadCase:
    """The load case that `words` wrote, among other keys.

    Raises:
        KeyError, TypeError, ValueError: as `from_plain`.
    """
    names = {field.name for field in fields(LoadCase)}
    data = {key: _value(text) for key, text in head.items() if key in names - {"posture"}}
    return from_plain({"posture": head["posture"], **data})


def _value(text: str) -> Any:  # noqa: ANN401
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text
