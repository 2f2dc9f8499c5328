"""The command ``validate compare``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm_output import terminal
from vjm_output.number_text import number, percent
from vjm_output.terminal import TerminalTable
from vjm_validation.cli import pages
from vjm_validation.cli.doubts import warn
from vjm_validation.cli.status import NOT_ACCEPTED, OK, UsageError
from vjm_validation.run_difference import MovedFigure, RunDifference, compared, document_of

SHOWN = 20
"""Figures that a terminal lists."""


def compare_(
    first: Annotated[Path, Parameter(help="A run's folder, or a JSON file of the suite: the reference.")],
    second: Annotated[Path, Parameter(help="Another run's folder or file.")],
    *,
    tolerance: Annotated[
        float, Parameter(help="Change relative to the first run up to which a figure has not moved.")
    ] = 1e-6,
    absolute: Annotated[
        float,
        Parameter(
            help="Difference up to which it has not moved either, in its own unit: for zeros but for rounding."
        ),
    ] = 0.0,
    report: Annotated[Path | None, Parameter(help="Write a page to this file.")] = None,
) -> int:
    """Compare two runs: which figures moved, and by how much."""
    pages.check(None, report)
    if not 0.0 <= tolerance < 1.0:
        raise UsageError(f"--tolerance: must be from 0 to 1, not {tolerance:g}")
    if not 0.0 <= absolute < math.inf:
        raise UsageError(f"--absolute: must be from 0, not {absolute:g}")
    (before, old_first), (after, old_second) = document_of(first), document_of(second)
    warn([*old_first, *old_second])
    found = compared(before, after, tolerance, absolute)
    if not found.compared:
        raise UsageError(f"{first} and {second} have no figure in common: compare runs of one command")
    console = terminal.console()
    table = TerminalTable(title=f"{first} and {second}", title_justify="left")
    for column in ("figure", "before", "after", "change"):
        table.add_column(column, justify="left" if column == "figure" else "right")
    for move in found.moved[:SHOWN]:
        table.add_row(*_row(move))
    if found.moved:
        console.print(table)
    if len(found.moved) > SHOWN:
        console.print(f"and {len(found.moved) - SHOWN} more" + ("" if report else "; --report writes all"))
    for name in found.lost[:SHOWN]:
        console.print(f"only in the first: {name}", soft_wrap=True, markup=False)
    if len(found.lost) > SHOWN:
        console.print(f"and {len(found.lost) - SHOWN} more" + ("" if report else "; --report writes all"))
    console.print(_words(found, tolerance, absolute), soft_wrap=True)
    if report is not None:
        _page(report, f"{first} and {second}", found, _words(found, tolerance, absolute))
        console.print(f"page: {report}", soft_wrap=True)
    return OK if found.same else NOT_ACCEPTED


def _row(move: MovedFigure) -> tuple[str, str, str, str]:
    change = (
        percent(move.change) if math.isfinite(move.change) else "from 0" if _is_zero(move.before) else "another"
    )
    return move.name, _figure(move.before), _figure(move.after), change


def _is_zero(figure: object) -> bool:
    return isinstance(figure, int | float) and not isinstance(figure, bool) and figure == 0


def _figure(figure: object) -> str:
    return str(figure) if isinstance(figure, float) and math.isinf(figure) else number(figure, 7)


def _words(found: RunDifference, tolerance: float, absolute: float) -> str:
    also = f" and by more than {absolute:g} in their own units" if absolute else ""
    moved = (
        f"{len(found.moved)} of {found.compared} figures moved by more than {tolerance:g} of the first run's{also}"
    )
    rest = f"; the others by at most {found.largest:.2g}" if found.largest else "; the others are equal"
    lost = f"; {len(found.lost)} have no value in the second" if found.lost else ""
    new = f"; {len(found.new)} are new in it" if found.new else ""
    return moved + rest + lost + new


def _page(file: Path, title: str, found: RunDifference, words: str) -> None:
    # matplotlib takes a second to import
    from vjm_validation.report.small_page import write_small_page
    from vjm_validation.report.words import ReportTable, Tone

    moved = tuple(_row(move) for move in found.moved)
    absent = tuple(
        (name, where) for names, where in ((found.lost, "first"), (found.new, "second")) for name in names
    )
    tables = [
        ReportTable("Figures that moved, the most first", ("figure", "before", "after", "change"), moved),
        ReportTable("Figures that only one run has", ("figure", "run"), absent),
    ]
    write_small_page(
        file, f"Comparison: {title}", f"{words}.",
        tone=Tone.AGREES if found.same else Tone.FAILED, tables=[table for table in tables if table.rows],
    )  # fmt: skip
