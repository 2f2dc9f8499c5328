"""The terminal: console, progress, one-line errors."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table


class TerminalTable(Table):
    """A table that breaks what is too long for its column over lines, where rich would cut it off."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """As rich's."""
        for column in self.columns:
            column.overflow = "fold"
        yield from super().__rich_console__(console, options)


EVERY_S = 10.0
"""Seconds between two lines about the same work."""
LONGEST_WORD, LONGEST_MESSAGE = 160, 1200
"""Characters: a path or a value that is repeated to the user, and a whole message."""


def console() -> Console:
    """Standard output, wide enough for the tables also where it is no terminal; brackets are printed as text."""
    plain = Console(markup=False, emoji=False)
    return plain if plain.is_terminal else Console(width=120, markup=False, emoji=False)


def error(message: str) -> None:
    """One line on standard error."""
    Console(stderr=True, highlight=False, markup=False, emoji=False).print(
        f"validate: {shortened(message)}", soft_wrap=True
    )


def shortened(message: str) -> str:
    """A message in which no word of the user's is longer than `LONGEST_WORD`, and which ends somewhere."""
    words = (w if len(w) <= LONGEST_WORD else f"{w[: LONGEST_WORD - 20]}…{w[-15:]}" for w in message.split(" "))
    text = " ".join(words)
    return text if len(text) <= LONGEST_MESSAGE else f"{text[:LONGEST_MESSAGE]}…"


def one_line(failure: Exception) -> str:
    """An exception's message as one line."""
    if isinstance(failure, OSError) and failure.strerror:
        where = f"{failure.filename}: " if failure.filename else ""
        return shortened(f"{where}{failure.strerror[:1].lower()}{failure.strerror[1:]}")
    return shortened(" ".join(str(failure).split()))


def compiling() -> Callable[[str], None]:
    """What says on standard error that kernels are being compiled, at the first one and then every ten seconds."""
    started, count, due = 0.0, 0, 0.0

    def watch(_kernel: str) -> None:
        nonlocal started, count, due
        now = time.monotonic()
        started, count = started or now, count + 1
        if now < due:
            return
        due = now + EVERY_S
        so_far = f": {count - 1} done in {now - started:.0f} s" if count > 1 else " takes some minutes"
        error(f"compiling the kernels, once after an installation{so_far}")

    return watch


class Progressing(Protocol):
    """How a progress display is called."""

    def __call__(self, stage: str, done: int, total: int, so_far: str = "") -> None:
        """Show how much of a stage is done."""


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Progressing]:
    """A progress display on standard error, called with a stage's name, how much is done, and of how much.

    Of zero means that nobody knows of how much. What is found so far may stand behind the name. An
    interrupt that was swallowed is raised again with the next call, or at the end.
    """
    # help and what fails at once need none
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with interruptible() as check, Progress(*columns, console=Console(stderr=True), disable=quiet) as display:
        tasks = {}

        def update(stage: str, done: int, total: int, so_far: str = "") -> None:
            check()
            if stage not in tasks:
                tasks[stage] = display.add_task(stage, total=total or None)
            said = f"{stage}, {so_far}" if so_far else stage
            display.update(tasks[stage], completed=done, total=total or None, description=said)

        yield update


@contextmanager
def interruptible() -> Iterator[Callable[[], None]]:
    """Let Ctrl-C and SIGTERM leave the block as ``KeyboardInterrupt``, whatever a foreign library makes of it.

    A library that calls back into Python may swallow what is raised there, or raise an error of its own instead
    (Exudyn does both). The block is left as interrupted all the same: with the next call of what this yields, in
    place of the library's error, or at the end. Only the main thread can handle signals; elsewhere nothing is done.
    """
    asked = False

    def interrupt(_signal: int, _frame: FrameType | None) -> None:
        nonlocal asked
        asked = True
        raise KeyboardInterrupt

    def check() -> None:
        if asked:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield check
        return
    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield check
        check()
    except Exception as error:
        if asked:
            raise KeyboardInterrupt from error
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def two_columns(title: str, rows: Mapping[str, str]) -> TerminalTable:
    """Names and what they are."""
    table = TerminalTable(
        title=title, title_justify="left", show_header=False, box=None, padding=(0, 2), min_width=len(title)
    )
    for name, text in rows.items():
        table.add_row(name, text)
    return table
