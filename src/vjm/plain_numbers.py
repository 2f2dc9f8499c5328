"""Numbers as people give them: in text the digits 0 to 9, no more of what Python accepts; vectors, checked."""

from __future__ import annotations

import math
from typing import Any

IN_WORDS = {3: "three", 6: "six"}
"""How many numbers a vector has, in words."""


def finite_numbers(
    name: str,
    values: Any,  # noqa: ANN401  whatever was given
    count: int,
    *,
    nonzero: bool = False,
) -> tuple[float, ...]:
    """Numbers of a vector that somebody gave.

    Args:
        name: of what they are.
        values: as they were given.
        count: how many there have to be.
        nonzero: whether one at least must not be zero.

    Raises:
        ValueError: they are not so many finite numbers; the message says what was given.

    Example:
        >>> finite_numbers("wrench", [0, -10, 0, 0, 0, 0], 6)
        (0.0, -10.0, 0.0, 0.0, 0.0, 0.0)
    """
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)) or (nonzero and not any(numbers)):
        which = ", not all zero" if nonzero else ""
        raise ValueError(f"{name} must be {IN_WORDS[count]} finite numbers{which}, got {values!r}")
    return numbers


def plain_number(word: str) -> float:
    """A number of a text; ``float`` also takes the digits of other scripts, and underscores between them.

    Raises:
        ValueError: it is none.
    """
    return float(_plain(word))


def whole_number(word: str) -> int:
    """A whole number of a text; as `plain_number`.

    Raises:
        ValueError: it is none.
    """
    return int(_plain(word))


def _plain(word: str) -> str:
    if not word.isascii() or "_" in word:
        raise ValueError(f"'{word}' is no number: write it with the digits 0 to 9")
    return word
