"""The command ``validate optimise``."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm import __version__
from vjm.design.best_machine import Choices, best_machine, objective_of
from vjm.design.front import ParetoFront, front_of
from vjm.design.optimum import Optimum, QuantityLimit, limits_of, told_row
from vjm.design.space import DesignSpace
from vjm.design.sweep import AskedQuantity, asked, signs, swept
from vjm.io.catalogues import catalogue, catalogue_names
from vjm.io.file_parameters import MachineFiles
from vjm.io.findings import Finding
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_output.terminal import TerminalTable
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
from vjm_validation.cli.options import Json, Model, Segments
from vjm_validation.cli.status import INTERRUPTED, NOT_ACCEPTED, OK, UsageError
from vjm_validation.cli.tables import rows_table
from vjm_validation.optimum_documents import (
    FrontDocument,
    FrontPoint,
    OptimumDocument,
    OptimumLimit,
    confirmed_rows,
    number_rows,
    part_rows,
    print_confirmed,
)

# --- What ``validate optimise --against`` does: the Pareto front of two quantities --------------------------------


@dataclass(frozen=True)
class FrontSearch:
    """What is asked of a front.

    Attributes:
        space: of the machines.
        bounds: of the numbers, by key.
        chosen: rows of catalogues, by key.
        of: the two quantities.
        limits: that all machines keep.
        points: that are looked for.
        starts: of the optimiser.
        state: file of what was computed.
    """

    space: DesignSpace
    bounds: Mapping[str, tuple[float, float]]
    chosen: Choices
    of: tuple[AskedQuantity, AskedQuantity]
    limits: Sequence[QuantityLimit]
    points: int
    starts: int
    state: Path | None


def front_(
    search: FrontSearch,
    doubts: Sequence[Finding],
    plot: Path | None,
    report: Path | None,
    *,
    confirm: bool,
    json: bool,
) -> int:
    """Find the front, print it and draw it."""
    try:
        with terminal.progress(quiet=json) as progress:
            found = front_of(
                search.space, search.bounds, search.chosen, search.of, search.limits, search.points, search.starts,
                lambda count, _: progress("machines", count, 0, ""), search.state,
            )  # fmt: skip
    except KeyboardInterrupt:
        terminal.error("interrupted before any machine of the front was found")
        return INTERRUPTED
    document = _document(search, found, doubts, confirm=confirm)
    if json:
        sys.stdout.write(as_json(document))
    else:
        console = terminal.console()
        console.print(rows_table(_title(document), _header(document), _cells(document)))
        for line in _lines(document):
            console.print(line, soft_wrap=True)
    pages.draw(plot, report, lambda: _content(document), None if json else terminal.console())
    if found.interrupted:
        terminal.error("interrupted: these are the machines so far")
        return INTERRUPTED
    return OK


def _document(
    search: FrontSearch, found: ParetoFront, doubts: Sequence[Finding], *, confirm: bool
) -> FrontDocument:  # fmt: skip
    machine, space = search.space.files.machine(), search.space
    return FrontDocument(
        model=machine.name,
        model_sha256=machine.sha256,
        version=__version__,
        postures=list(dict.fromkeys(case.posture for case in space.cases)),
        wrenches=list(dict.fromkeys(case.wrench_text for case in space.cases if case.wrench_text)),
        quantities=[str(each) for each in found.of],
        quantity_units=[each.unit for each in found.of],
        limits=[str(limit) for limit in search.limits],
        points=[
            FrontPoint(
                values=values.tolist(), numbers=number_rows(point), parts=part_rows(point),
                confirmed=confirmed_rows(point) if confirm and not found.interrupted else [],
            )
            for values, point in zip(found.values, found.points, strict=True)
        ],
        interrupted=found.interrupted,
        doubts=doubt_rows(doubts),
    )  # fmt: skip


def _header(document: FrontDocument) -> tuple[str, ...]:
    quantities = zip(document.quantities, document.quantity_units, strict=True)
    first = document.points[0]
    return (
        *(f"{of}, {unit}" if unit else of for of, unit in quantities),
        *(f"{row.key}, {row.unit}" if row.unit else row.key for row in first.numbers),
        *(part.key for part in first.parts),
    )


def _cells(document: FrontDocument) -> list[tuple[str, ...]]:
    return [
        (
            *(f"{value:.6g}" for value in point.values),
            *(f"{row.value:.6g}" for row in point.numbers),
            *(told_row(part.row) for part in point.parts),
        )
        for point in document.points
    ]


def _lines(document: FrontDocument) -> list[str]:
    """What is to be said of a front besides its table."""
    limits = f", and keep {'; '.join(document.limits)}" if document.limits else ""
    lines = [
        f"{len(document.points)} machines are not beaten by another in {' and '.join(document.quantities)}{limits}."
    ]
    checked = [row for point in document.points for row in point.confirmed]
    both = [row for row in checked if row.elements is not None and not row.doubt]
    if both:
        apart = max(abs(row.elements - row.value) / abs(row.value) for row in both if row.elements is not None)
        lines.append(
            f"Computed again with twice as many springs and with finite elements, {len(both)} of {len(checked)} "
            f"values agree within the stated errors. The largest difference is {apart:.1e} of the value."
        )
    lines += sorted({f"Not computed: {row.quantity}: {row.why}" for row in checked if row.why})
    lines += [
        f"Warning: machine {k}: {row.quantity}: {row.doubt}"
        for k, point in enumerate(document.points, start=1)
        for row in point.confirmed
        if row.doubt
    ]
    return lines


def _title(document: FrontDocument) -> str:
    return f"{document.model}: the Pareto front of {' and '.join(document.quantities)}"


def _content(document: FrontDocument) -> pages.Content:
    from vjm_validation.report.design_figures import front_picture
    from vjm_validation.report.words import ReportTable

    verdict, *others = _lines(document)
    table = ReportTable("Machines", _header(document), tuple(_cells(document)))
    return pages.Content(_title(document), verdict, [front_picture(document)], [table], others)


CATALOGUE = "=catalogue:"
"""Between the key of a section and the name of a catalogue."""


def optimise_(
    model: Model,
    *,
    minimise: Annotated[
        str, Parameter(help="mass, cost or deflection, perhaps with a component: deflection.z.")
    ] = "",
    maximise: Annotated[str, Parameter(help="critical, frequency, reach or stiffness.z.")] = "",
    against: Annotated[str, Parameter(help="A second quantity: the Pareto front of both.")] = "",
    points: Annotated[int, Parameter(help="Machines of the front that are looked for.")] = 7,
    such_that: Annotated[str, Parameter(help="Bounds: 'deflection<=0.2; critical>=3*load; frequency>=20'.")] = "",
    vary: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="Numbers of parts with their bounds: KEY=a:b. Sections from a catalogue: KEY=catalogue:tubes.csv, "
            f"a .toml file or one of {', '.join(catalogue_names())}.",
        ),
    ] = (),
    starts: Annotated[int, Parameter(help="Starts of the optimiser.")] = 3,
    posture: Postures = (),
    wrench: Wrenches = (),
    gravity: GravityOption = "",
    load: LoadOption = (),
    weights: Annotated[
        str,
        Parameter(help="a,b,…: of the cases in what is made best, postures first; the worst case counts else."),
    ] = "",
    hold_tool: HoldTool = False,
    cost: CostOption = "",
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    segments: Segments = None,
    confirm: Annotated[
        bool, Parameter(help="Compute the result again with twice as many springs and with finite elements.")
    ] = True,
    out: Annotated[Path | None, Parameter(help="Write the best machine's model file, .toml.")] = None,
    state: Annotated[
        Path | None, Parameter(help="Keep what was computed there; the same command goes on after an interrupt.")
    ] = None,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Find the numbers of a model file within bounds that make a machine best and keep limits."""
    try:
        objective = objective_of(minimise, maximise)
    except ValueError as error:
        raise UsageError(f"--minimise, --maximise: {error}") from None
    limits = limits_of(such_that)
    listed = [text for text in vary if CATALOGUE in text]
    chosen = {key.strip(): catalogue(name) for key, _, name in (text.partition(CATALOGUE) for text in listed)}
    if len(chosen) < len(listed):
        raise UsageError("--vary: a part stands twice: give one catalogue")
    ranges = ranges_of([text for text in vary if text not in listed], counted=False, needed=not chosen)
    bounds = {key: (low, high) for key, (low, high, _) in ranges.items()}
    if starts < 1:
        raise UsageError(f"--starts {starts}: take one at least")
    second = [asked(against)] if against else []
    refuse_nothing(wrench or load, gravity, [objective, *(limit.of for limit in limits), *second])
    if out is not None and out.suffix != ".toml":
        raise UsageError(f"--out {out}: write a name that ends in .toml")
    if against and out is not None:
        raise UsageError("--out: a front has several machines: take a bound from it, then write the best one")
    if not against and (plot or report):
        raise UsageError("--plot, --report: show a front: say --against which quantity")
    pages.check(plot, report, out=out, state=state)
    space = design_space(
        model, list(ranges), postures=posture, wrenches=wrench, gravity=gravity, loads=load, end=end,
        segments=segments, weights=weights, hold_tool=hold_tool, cost=cost,
    )  # fmt: skip
    doubts = considered(model, strict, weighed=bool(gravity))
    if second:
        search = FrontSearch(space, bounds, chosen, (objective, second[0]), limits, points, starts, state)
        return front_(search, doubts, plot, report, confirm=confirm, json=json)
    found: Optimum | None = None
    try:
        with terminal.progress(quiet=json) as progress:

            def tell(count: int, best: float | None) -> None:
                known = "none keeps the limits yet" if best is None else f"best {objective} {best:.6g}"
                progress("machines", count, 0, known)

            found = best_machine(space, bounds, chosen, objective, limits, starts, tell, state)
    except KeyboardInterrupt:
        # which the block raises once more at its end, where the best so far is known
        if found is None:
            terminal.error(f"interrupted before any machine was computed{_goes_on(state)}")
            return INTERRUPTED
    as_it_is = swept(space, space.present[None], [objective]).values[0, :, 0]
    before = space.in_all_cases(as_it_is, signs([objective])[0])
    best = found.best
    assert isinstance(best, MachineFiles)
    machine = space.files.machine()
    document = OptimumDocument(
        model=machine.name,
        model_sha256=machine.sha256,
        version=__version__,
        postures=list(dict.fromkeys(case.posture for case in space.cases)),
        wrenches=list(dict.fromkeys(case.wrench_text for case in space.cases if case.wrench_text)),
        weights=list(space.weights),
        objective=str(objective),
        unit=objective.unit,
        before=before if np.isfinite(before) else None,
        value=found.objective,
        kept=found.kept,
        numbers=number_rows(found),
        parts=part_rows(found),
        limits=[
            OptimumLimit(limit=str(limit), value=float(value), active=abs(limit.margin(float(value))) < 1e-4)
            for limit, value in zip(limits, found.quantities, strict=True)
        ],
        starts=found.starts,
        agreeing=found.agreeing,
        machines=found.evaluations,
        confirmed=confirmed_rows(found) if confirm and not found.interrupted else [],
        interrupted=found.interrupted,
        doubts=doubt_rows(doubts),
    )
    written: list[Path] = []
    if out is not None:
        bounded = "; ".join(str(limit) for limit in limits)
        what = f"{objective}, such that {bounded}" if bounded else f"{objective}, with no limits"
        head = f"# Optimised from {best.document.file} by `validate optimise`: {what}.\n"
        written = best.write(out, head, f"{best.document.content['title']}, optimised")
    if json:
        sys.stdout.write(as_json(document))
    else:
        _print(document, written)
    if found.interrupted:
        terminal.error(f"interrupted: this is the best machine so far{_goes_on(state)}")
        return INTERRUPTED
    return OK if found.kept else NOT_ACCEPTED


def _goes_on(state: Path | None) -> str:
    return "" if state is None else f"; what was computed is in {state}: the same command goes on"


def _print(document: OptimumDocument, written: Sequence[Path]) -> None:
    console = terminal.console()
    cases = len(document.postures) * max(len(document.wrenches), 1)
    judged = "the weighted mean" if document.weights else "the worst"
    where = f"posture {document.postures[0]}" if cases == 1 else f"{judged} of {cases} cases"
    table = TerminalTable(title=f"{document.model}, {where}: best {document.objective}", title_justify="left")
    for name in ("number", "unit", "before", "best", ""):
        table.add_column(name, justify="right")
    for row in document.numbers:
        table.add_row(
            row.key, row.unit, f"{row.before:.6g}", f"{row.value:.6g}", "at its bound" if row.at_bound else ""
        )
    for part in document.parts:
        table.add_row(part.key, "", "", told_row(part.row), "of the catalogue")
    console.print(table)
    was = "no answer" if document.before is None else f"{document.before:.6g}"
    unit = f" {document.unit}" if document.unit else ""
    console.print(f"{document.objective}: {document.value:.6g}{unit}, before {was}", soft_wrap=True)
    for limit in document.limits:
        state = "reached" if limit.active else "kept" if document.kept else ""
        console.print(f"{limit.limit}: {limit.value:.6g} {state}".rstrip(), soft_wrap=True)
    if not document.kept:
        console.print("No machine within the bounds was found that keeps all limits; this one misses them least.")
    print_confirmed(console, document.confirmed)
    there = f"{document.agreeing} of {document.starts} starts ended there; " if document.starts else ""
    console.print(f"{there}{document.machines} machines were computed.", soft_wrap=True)
    for file in written:
        console.print(f"{file}", soft_wrap=True)
