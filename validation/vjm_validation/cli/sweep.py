"""The command ``validate sweep``."""

from __future__ import annotations

import csv
import io
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from vjm import __version__
from vjm.design.sweep import Asked, asked, grid_of, pareto, swept
from vjm.io.files import check_writable, write_whole
from vjm.rotations import Array
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli import pages
from vjm_validation.cli.design_space import DesignSpace, Loading, design_space, ranges_of
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption
from vjm_validation.cli.options import Json, Model, Posture, Segments
from vjm_validation.cli.status import OK, UsageError
from vjm_validation.sweep_documents import SweepDocument, SweepRow, sweep_cells, sweep_header

AT_ONCE = 20
"""Machines that are computed before the CSV is written again."""
MOST = 100_000
"""Machines in a sweep."""


def sweep_(
    model: Model,
    *,
    vary: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="Numbers of parts with first, last and count: KEY=a:b:n."),
    ] = (),
    of: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="mass, deflection, stiffness.z, frequency and the like."),
    ] = ("mass", "deflection"),
    posture: Posture = None,
    wrench: Annotated[str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end.")] = None,
    gravity: GravityOption = "",
    load: LoadOption = (),
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    segments: Segments = None,
    csv: Annotated[
        Path | None, Parameter(name="--csv", help="Write the rows there; what it has already is not done again.")
    ] = None,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Compute quantities over ranges of numbers of a model file, and say which machines no other one beats."""
    ranges = ranges_of(vary, counted=True)
    quantities = [asked(word) for text in of for word in text.split(",")]
    loading = Loading.of(wrench, gravity, load, end)
    loading.refuse_deflection_of_nothing(quantities)
    pages.check(plot, report)
    grid = grid_of(ranges)
    if len(grid) > MOST:
        raise UsageError(f"--vary: these are {len(grid)} machines; take {MOST} at most")
    if csv is not None:
        check_writable(csv.parent)
    space = design_space(str(model), list(ranges), posture, segments, loading)
    doubts = considered(model, strict, weighed=loading.gravity is not None)
    values, why = _computed(space, grid, quantities, csv)
    front = pareto(values, quantities)
    document = SweepDocument(
        model=str(space.document.content["name"]),
        model_sha256=space.document.sha256,
        version=__version__,
        posture=space.posture,
        keys=list(space.keys),
        units=space.units,
        quantities=[str(each) for each in quantities],
        quantity_units=[each.unit for each in quantities],
        rows=[
            SweepRow(
                numbers=row.tolist(),
                values=[float(v) if np.isfinite(v) else None for v in found],
                why=text,
                on_front=bool(best),
            )
            for row, found, text, best in zip(grid, values, why, front, strict=True)
        ],
        doubts=doubt_rows(doubts),
    )
    if json:
        sys.stdout.write(as_json(document))
    else:
        console = terminal.console()
        console.print(_table(document))
        console.print(_said(document), soft_wrap=True)
        if csv is not None:
            console.print(f"{csv}", soft_wrap=True)
    pages.draw(plot, report, lambda: _content(document), None if json else terminal.console())
    return OK


def _computed(
    space: DesignSpace, grid: Array, quantities: list[Asked], file: Path | None
) -> tuple[Array, list[str]]:
    """The rows of a sweep; those that a CSV of the same machine has are read."""
    head = [*space.keys, *map(str, quantities), "why"]
    # what makes a row another one stands in the first line
    made = f"# {space.document.file} {space.document.sha256} {space.posture} {__version__}"
    known = {} if file is None else _read(file, made, head, len(space.keys))
    values, why = np.full((len(grid), len(quantities)), np.nan), [""] * len(grid)
    todo = []
    for i, row in enumerate(grid):
        found = known.get(tuple(f"{v:.17g}" for v in row))
        if found is None:
            todo.append(i)
        else:
            values[i], why[i] = found
    if known and not len(todo):
        terminal.error(f"{file}: has all rows already; nothing was computed")
    elif known:
        terminal.error(f"{file}: has {len(grid) - len(todo)} of {len(grid)} rows already")
    for first in range(0, len(todo), AT_ONCE):
        some = todo[first : first + AT_ONCE]
        values[some], said = swept(space.at, grid[some], quantities)
        for i, text in zip(some, said, strict=True):
            why[i] = text
        if file is not None:
            done = sorted(set(range(len(grid))) - set(todo[first + AT_ONCE :]))
            _write(file, made, head, grid[done], values[done], [why[i] for i in done])
        if len(todo) > AT_ONCE:
            terminal.error(f"{min(first + AT_ONCE, len(todo))} of {len(todo)} machines")
    return values, why


def _write(file: Path, made: str, head: list[str], grid: Array, values: Array, why: list[str]) -> None:
    stream = io.StringIO()
    stream.write(made + "\n")
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(head)
    for row, found, text in zip(grid, values, why, strict=True):
        cells = ["" if np.isnan(v) else f"{v:.17g}" for v in found]
        table.writerow([*(f"{v:.17g}" for v in row), *cells, text])
    write_whole(file, stream.getvalue())


def _read(file: Path, made: str, head: list[str], count: int) -> dict[tuple[str, ...], tuple[Array, str]]:
    """Rows of a CSV by their numbers; none where there is no file yet.

    Raises:
        UsageError: it is of another sweep.
    """
    if not file.exists():
        return {}
    lines = file.read_text(encoding="utf-8").splitlines()
    rows = list(csv.reader(lines[1:]))
    if not lines or lines[0] != made or not rows or rows[0] != head:
        raise UsageError(
            f"--csv {file}: is of another machine, posture or question: give another name, or remove it"
        )
    result = {}
    for row in rows[1:]:
        found = np.array([float(cell) if cell else np.nan for cell in row[count:-1]])
        result[tuple(row[:count])] = found, row[-1]
    return result


def _table(document: SweepDocument) -> Table:
    table = Table(
        title=f"{document.model}, posture {document.posture}: {len(document.rows)} machines", title_justify="left"
    )
    for name in sweep_header(document):
        table.add_column(name, justify="right")
    for cells in sweep_cells(document):
        table.add_row(*cells)
    return table


def _said(document: SweepDocument) -> str:
    front = sum(row.on_front for row in document.rows)
    without = sum(bool(row.why) for row in document.rows)
    in_all = " and ".join(document.quantities)
    said = f"{front} of {len(document.rows)} machines are not beaten by another in {in_all}."
    return f"{said} {without} have no answer; the column why says the reason." if without else said


def _content(document: SweepDocument) -> pages.Content:
    from vjm_validation.report.design_figures import sweep_picture
    from vjm_validation.report.tables import Table as PageTable

    title = f"{document.model}, posture {document.posture}: a sweep over {', '.join(document.keys)}"
    table = PageTable("Machines", sweep_header(document), tuple(sweep_cells(document)))
    return pages.Content(title, _said(document), [sweep_picture(document)], [table])
