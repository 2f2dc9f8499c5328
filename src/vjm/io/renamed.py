"""Words of model files that have a new name: the old one is read for one release, and said."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from vjm.io.findings import Finding, Grade

RENAMED = {"coupling": {"as bent": "as deflected"}}
"""Of a key of a part: its old values, and what each is now."""
UNTIL = "0.4.0"
"""The version that reads the old words no more."""


def read_on(key: str) -> Callable[[object], object]:
    """What turns an old value of a key into the present one, for a validator; other values stay.

    Example:
        >>> read_on("coupling")("as bent")
        'as deflected'
    """

    def present(value: object) -> object:
        return RENAMED[key].get(value, value) if isinstance(value, str) else value

    return present


def old_words(content: Mapping[str, Any], file: str) -> Iterator[Finding]:
    """The old words in a model's document.

    Args:
        content: as its file says it.
        file: its name for messages.
    """
    for part in content.get("parts", []):
        for key, values in RENAMED.items():
            old = part.get(key)
            if isinstance(old, str) and old in values:
                found = f"'{old}' is now called '{values[old]}': write that; the old word is read until {UNTIL}"
                yield Finding(Grade.NOTED, f"{file}: part '{part.get('name', '')}', {key}", found)
