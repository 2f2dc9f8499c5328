"""A calibration in sentences and tables for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO

from rich.box import SIMPLE
from rich.console import Console

from vjm_output.number_text import number
from vjm_output.terminal import TerminalTable
from vjm_updating.calibration.document import Calibration, FigureRow, ProposedRampRow
from vjm_updating.constants import shown

DIGITS = shown(5)
JUDGED = "the model file is judged by the readings that it was fitted to: tests of this kind hold nothing out"
WIDTH = shown(120)
"""Columns of `fit_report`."""


def tables(document: Calibration) -> list[TerminalTable | str]:
    """What a person wants to know first."""
    found: list[TerminalTable | str] = [document.fit.statement, *document.identifiability.statement]
    if document.calibrated_model:
        found.append(JUDGED)
    if document.fit.outliers:
        rows = ", ".join(str(one.row) for one in document.fit.outliers[:10])
        more = ", …" if len(document.fit.outliers) > 10 else ""
        found.append(f"{len(document.fit.outliers)} outliers do not count, in rows {rows}{more}")
    found += [_parameters(document)]
    if document.combinations:
        found.append(_combinations(document))
    if document.predictions.calibrated:
        found.append(_figures("What the calibrated machine will do", document.predictions.calibrated))
    if document.pairing:
        found.append(_pairing(document))
    # a test of one joint or of frequencies has no ramps
    elif document.identifiability.directions:
        found += _next(document)
    return found


def fit_report(document: Calibration) -> str:
    """Fit, parameters with their uncertainty, predictions and what to measure next, as the command prints them."""
    console = Console(width=WIDTH, file=StringIO(), markup=False, color_system=None)
    for item in tables(document):
        console.print(item, soft_wrap=isinstance(item, str))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def _table(title: str, columns: Sequence[str]) -> TerminalTable:
    table = TerminalTable(title=title, title_justify="left", box=SIMPLE)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left")
    return table


def interval(ends: Sequence[float] | None) -> str:
    """``0.94 to 0.96``."""
    return number(None) if ends is None else f"{number(ends[0], DIGITS)} to {number(ends[1], DIGITS)}"


def _parameters(document: Calibration) -> TerminalTable:
    columns = ("parameter", "value", "unit", "std", "95 % interval", "over nominal")
    table = _table(f"{document.model}, {document.engine}: {document.title}", columns)
    for row in document.parameters:
        ratio = number(row.over_nominal, DIGITS)
        ends = interval(row.interval95) + (" (at its bound)" if row.at_bound else "")
        table.add_row(row.name, number(row.value, DIGITS), row.unit, number(row.std, 2), ends, ratio)
    return table


def _combinations(document: Calibration) -> TerminalTable:
    table = _table("What can be told only together, in z", ("combination", "value", "std", "95 % interval"))
    for row in document.combinations:
        if row.seen:
            table.add_row(row.name, number(row.value), number(row.std, 2), interval(row.interval95))
        else:
            table.add_row(row.name, "not seen", "", "")
    return table


def _pairing(document: Calibration) -> TerminalTable:
    columns = ("posture", "Hz, measured", "mode", "Hz, calibrated", "sigma off", "pairing's probability")
    table = _table("Which mode each frequency is", columns)
    for row in document.pairing:
        for i, one in enumerate(row.modes):
            load = f" with {number(row.payload_kg)} kg" if row.payload_kg else ""
            first = ("", "") if i else (row.posture + load, number(row.probability, 3))
            table.add_row(
                first[0], number(one.measured, DIGITS), str(one.mode), number(one.computed, DIGITS),
                number(one.in_sigma, 2), first[1],
            )  # fmt: skip
    return table


def _figures(title: str, rows: Sequence[FigureRow]) -> TerminalTable:
    columns = ("figure", "value", "unit", "std", "95 % interval", "mostly from")
    table = _table(title, columns)
    for row in rows:
        if row.quantity == "K0" and row.direction == "compression":
            continue  # the same as in tension
        kind = f" ({row.kind})" if row.kind else ""
        name = f"{row.posture} {row.direction} {row.quantity}{kind}"
        first = next(iter(row.sensitivities), "")
        std = number(row.std, 2)
        table.add_row(name, number(row.value, DIGITS), row.unit, std, interval(row.interval95), first)
    return table


def _next(document: Calibration) -> list[TerminalTable | str]:
    found = document.next_experiment
    if found.d_optimal is None:
        return ["no feasible ramp tells anything new"]
    table = _table("Which posture next", ("ramp", "parameters' std times", f"std of {_figure(found.figure)}"))
    for row in found.candidates[:8]:
        name = _ramp(row)
        table.add_row(name, number(row.parameters_shrink_to, 3), number(row.figure_std, 3))
    d, i = found.d_optimal, found.i_optimal
    words = f"for the parameters (D-optimal): {_ramp(d)}"
    if i is not None:
        words += f"; for {_figure(found.figure)} (I-optimal): {_ramp(i)}"
    return [table, words]


def _ramp(row: ProposedRampRow) -> str:
    """``D x -12``: a colon would make a picture of it in a terminal."""
    return f"{row.posture} {row.ramp.replace(':', ' ')}"


def _figure(label: str) -> str:
    return label.replace(":", " ")
