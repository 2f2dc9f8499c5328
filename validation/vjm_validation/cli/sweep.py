"""The command ``validate sweep``."""

from __future__ import annotations

import csv
import io
import json as json_text
import sys
import time
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.batch import map_all
from vjm.design.space import DesignSpace
from vjm.design.sweep import AskedQuantity, Sweep, asked, evaluated, grid_of, tasks_of
from vjm.io.files import write_whole
from vjm.io.path_files import cell_number
from vjm.io.provenance import Provenance
from vjm.rotations import Array
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_updating.cluster import on_cluster
from vjm_validation.cli import pages
from vjm_validation.cli.design_space import (
    CostOption,
    HoldTool,
    Postures,
    Wrenches,
    design_space,
    ranges_of,
    refuse_nothing,
)
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption
from vjm_validation.cli.options import Json, Model, Segments, processes
from vjm_validation.cli.status import OK, UsageError
from vjm_validation.cli.tables import rows_table
from vjm_validation.sweep_documents import (
    SweepDocument,
    sweep_cells,
    sweep_document,
    sweep_header,
    sweep_lines,
    sweep_title,
)

MOST = 100_000
"""Machines in a sweep."""
INTERRUPTED = 130
EVERY_S = 2.0
"""Seconds between two writings of the CSV: as much can be lost."""


def sweep_(
    model: Model,
    *,
    vary: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="Numbers of parts with first, last and count: KEY=a:b:n."),
    ] = (),
    of: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="mass, deflection, stiffness.z, critical, frequency, reach, cost."),
    ] = ("mass", "deflection"),
    posture: Postures = (),
    wrench: Wrenches = (),
    gravity: GravityOption = "",
    load: LoadOption = (),
    hold_tool: HoldTool = False,
    cost: CostOption = "",
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    segments: Segments = None,
    csv: Annotated[
        Path | None, Parameter(name="--csv", help="Write the rows there; what it has already is not done again.")
    ] = None,
    jobs: Annotated[int, Parameter(help="Processes; 0 is one a core.")] = 1,
    scheduler: Annotated[str, Parameter(help="Address of a Dask scheduler instead, such as tcp://host:8786.")] = "",
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Compute quantities over ranges of numbers of a model file, and say which machines no other one beats."""
    ranges = ranges_of(vary, counted=True)
    quantities = [asked(word) for text in of for word in text.split(",")]
    refuse_nothing(wrench or load, gravity, quantities)
    workers = processes(jobs)
    pages.check(plot, report, csv=csv)
    grid = grid_of(ranges)
    if len(grid) > MOST:
        raise UsageError(f"--vary: these are {len(grid)} machines; take {MOST} at most")
    space = design_space(
        model, list(ranges), postures=posture, wrenches=wrench, gravity=gravity, loads=load, end=end,
        segments=segments, hold_tool=hold_tool, cost=cost,
    )  # fmt: skip
    machine = space.files.machine()
    made_of = Provenance.of(
        machine.files, machine=machine, engine=space.engine, vary=space.keys, of=[str(each) for each in quantities],
        gravity=space.gravity, load=[str(each) for each in space.loads], end=end,
        hold_tool=hold_tool, cost=cost,
    )  # fmt: skip
    store = Store(csv, space, made_of, quantities)
    doubts = considered(model, strict, weighed=bool(gravity))
    try:
        found = _computed(space, grid, quantities, store, (workers, scheduler), quiet=json)
    except KeyboardInterrupt:
        where = f"; what is finished is in {csv}: the same command goes on" if csv else ""
        terminal.error(f"interrupted{where}")
        return INTERRUPTED
    assert space.engine is not None
    document = sweep_document(found, machine.name, machine.sha256, space.engine.label, doubt_rows(doubts))
    if json:
        sys.stdout.write(as_json(document))
    else:
        console = terminal.console()
        console.print(rows_table(sweep_title(document), sweep_header(document), sweep_cells(document)))
        for line in (*sweep_lines(document), *([str(csv)] if csv is not None else [])):
            console.print(line, soft_wrap=True)
    pages.draw(plot, report, lambda: _content(document), None if json else terminal.console())
    return OK


def _computed(
    space: DesignSpace,
    grid: Array,
    quantities: list[AskedQuantity],
    store: Store,
    how: tuple[int, str],
    *,
    quiet: bool,
) -> Sweep:
    """The machines of a sweep; those that its CSV has are read."""
    values = np.full((len(grid), len(space.cases), len(quantities)), np.nan)
    why = [[""] * len(space.cases) for _ in grid]
    todo = []
    for i, row in enumerate(grid):
        known = store.find(row)
        if known is None:
            todo.append(i)
        else:
            values[i], why[i] = known
    store.say(len(grid) - len(todo), grid)
    tasks = tasks_of(space, grid[todo], quantities)
    starts = np.cumsum([0, *(len(task.rows) for task in tasks)])
    jobs, scheduler = how
    with terminal.progress(quiet=quiet) as progress:
        done = 0

        def finish(index: int, result: tuple[Array, list[list[str]]]) -> None:
            nonlocal done
            own = todo[starts[index] : starts[index + 1]]
            for i, found, said in zip(own, *result, strict=True):
                values[i], why[i] = found, said
                store.keep(grid[i], found, said)
            store.write_soon()
            done += len(own)
            progress("machines", done, len(todo))

        try:
            if scheduler:
                for index, result in on_cluster(evaluated, tasks, scheduler):
                    finish(index, result)
            elif tasks:
                map_all(evaluated, tasks, min(jobs, len(tasks)), done=finish)
        finally:
            if done:
                store.write()
    return Sweep(space, tuple(quantities), grid, values, why)


Key = tuple[str, ...]
Cells = tuple[list[float], str]
"""Quantities, and why there are none."""


class Store:
    """The rows of a sweep in a CSV: a row for each machine and case, with all the digits of their numbers.

    What it was made of, and does not stand in the rows, stands in the first line.
    """

    def __init__(
        self, file: Path | None, space: DesignSpace, made_of: Provenance, quantities: list[AskedQuantity]
    ) -> None:
        """Open a file, or none.

        Raises:
            OtherInputsError: it is of another machine or question.
            UsageError: a row of it is damaged.
        """
        self._file, self._space, self._made_of = file, space, made_of
        self._head = [*space.keys, "posture", "wrench", *map(str, quantities), "why"]
        self._rows: dict[Key, Cells] = {}
        self._due = 0.0
        if file is not None and file.exists():
            self._read(file)

    def _read(self, file: Path) -> None:
        """Take over the rows of a file; a last line without an end was cut off, and is computed anew."""
        text = file.read_text(encoding="utf-8", errors="replace")
        first, *lines = text.splitlines() or [""]
        try:
            earlier = json_text.loads(first.removeprefix("# "))
        except ValueError:
            earlier = None
        where = f"--csv {file}: is of another machine, load or question"
        self._made_of.check(earlier, where, "give another name, or remove it")
        if lines and not text.endswith("\n"):
            terminal.error(f"{file}, line {len(lines) + 1}: was cut off: its machine is computed anew")
            del lines[-1]
        for number, row in enumerate(csv.reader(lines), start=2):
            try:
                if number > 2:
                    key, cells = self._parsed(row)
                    self._rows[key] = cells
                elif row != self._head:
                    raise ValueError("is not the header that was written")
            except ValueError as error:
                raise UsageError(
                    f"--csv {file}, line {number}: {error}: delete the line, and it is computed anew"
                ) from None

    def _parsed(self, row: list[str]) -> tuple[Key, Cells]:
        """The key and the cells of a row.

        Raises:
            ValueError: it is none that `write` writes.
        """
        if len(row) != len(self._head):
            raise ValueError(f"{len(row)} cells for {len(self._head)} columns")
        names, numbers = len(self._space.keys), len(self._space.keys) + 2
        *cells, why = row[numbers:]
        for name, cell in zip(self._head, row, strict=True):
            if name in self._head[:names] or (name in self._head[numbers:-1] and not why):
                cell_number(name, cell)
        if why and any(cells):
            raise ValueError(f"has values, and '{why}' in column why")
        return tuple(row[:numbers]), ([float(cell) if cell else np.nan for cell in cells], why)

    def _keys(self, row: Array) -> list[Key]:
        numbers = [f"{v:.17g}" for v in row]
        return [(*numbers, case.posture, case.wrench_text) for case in self._space.cases]

    def find(self, row: Array) -> tuple[Array, list[str]] | None:
        """Quantities ``(c, q)`` of a machine in its cases, and why there are none; None where one is not there."""
        keys = self._keys(row)
        if any(key not in self._rows for key in keys):
            return None
        cells = [self._rows[key] for key in keys]
        return np.array([found for found, _ in cells]), [text for _, text in cells]

    def keep(self, row: Array, values: Array, why: list[str]) -> None:
        """Remember a machine, in all its cases."""
        for key, found, text in zip(self._keys(row), values, why, strict=True):
            self._rows[key] = found.tolist(), text

    def write_soon(self) -> None:
        """Write the file, but not so often that writing takes more than a tenth of the time."""
        if time.monotonic() > self._due:
            began = time.monotonic()
            self.write()
            self._due = began + max(EVERY_S, 10.0 * (time.monotonic() - began))

    def write(self) -> None:
        """Write the file anew, if there is one: whole or not at all."""
        if self._file is None:
            return
        stream = io.StringIO()
        stream.write(f"# {json_text.dumps(self._made_of.inputs)}\n")
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(self._head)
        for key, (found, text) in self._rows.items():
            table.writerow([*key, *("" if text else f"{v:.17g}" for v in found), text])
        write_whole(self._file, stream.getvalue())

    def say(self, known: int, grid: Array) -> None:
        """Say what the file has already."""
        wanted = {key for row in grid for key in self._keys(row)}
        other = sum(key not in wanted for key in self._rows)
        if known == len(grid):
            terminal.error(f"{self._file}: has all machines already; nothing is computed")
        elif known:
            terminal.error(f"{self._file}: has {known} of {len(grid)} machines already")
        if other:
            terminal.error(f"{self._file}: {other} rows of other values or cases stay in it")


def _content(document: SweepDocument) -> pages.Content:
    from vjm_validation.report.design_figures import sweep_picture
    from vjm_validation.report.words import ReportTable

    verdict, *others = sweep_lines(document)
    title = f"{sweep_title(document)}, over {', '.join(document.keys)}"
    table = ReportTable("Machines", sweep_header(document), tuple(sweep_cells(document)))
    return pages.Content(title, verdict, [sweep_picture(document)], [table], others)
