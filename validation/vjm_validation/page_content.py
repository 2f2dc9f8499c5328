"""What a command says of its result, for a terminal and for a page alike: tables, sentences and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import Console

from vjm_output.terminal import TerminalTable

if TYPE_CHECKING:
    # matplotlib takes a second to import, which a command without a figure does not need
    from vjm_output.plots import Picture


@dataclass(frozen=True)
class ReportTable:
    """A table of a page, or of a terminal.

    Attributes:
        caption: what it holds.
        header: of its columns; the first ones are words.
        rows: as they are written.
        words: number of leading columns that hold words.
        printed: whether a terminal has it; else only the page.
    """

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1
    printed: bool = True

    def for_terminal(self, title: str = "") -> TerminalTable:
        """The table as it is printed, under another title where there is one."""
        table = TerminalTable(title=title or self.caption, title_justify="left")
        for k, name in enumerate(self.header):
            table.add_column(name, justify="left" if k < self.words else "right", no_wrap=k < self.words)
        for cells in self.rows:
            table.add_row(*cells)
        return table


@dataclass(frozen=True)
class Content:
    """What is printed, drawn and written.

    Attributes:
        title: of the page, and in a terminal of the first table.
        lines: sentences; the first one is the page's verdict.
        tables: in their order.
        draw: makes the figures; the first one is the plot.
    """

    title: str
    lines: Sequence[str]
    tables: Sequence[ReportTable]
    draw: Callable[[], Sequence[Picture]]

    def print(self, console: Console) -> None:
        """The tables and what is to be said of them."""
        for k, table in enumerate(table for table in self.tables if table.printed):
            console.print(table.for_terminal("" if k else self.title))
        for line in self.lines:
            console.print(line, soft_wrap=True, highlight=False)
