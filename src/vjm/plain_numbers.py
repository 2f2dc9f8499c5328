"""Numbers in text as people and files write them: the digits 0 to 9, no more of what Python accepts."""

from __future__ import annotations


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
