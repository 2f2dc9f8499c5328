"""A table of a page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReportTable:
    """A table of the page.

    Attributes:
        caption: what it holds.
        header: of its columns; the first ones are words.
        rows: as they are written.
        words: number of leading columns that hold words.
    """

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1
