"""What ``validate optimise --against`` does: the Pareto front of two quantities."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vjm import __version__
from vjm.design.best_machine import Choices
from vjm.design.front import ParetoFront, front_of
from vjm.design.optimum import QuantityLimit, told_row
from vjm.design.space import DesignSpace
from vjm.design.sweep import AskedQuantity
from vjm.io.findings import Finding
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli import pages
from vjm_validation.cli.status import INTERRUPTED, OK
from vjm_validation.cli.tables import rows_table
from vjm_validation.optimum_documents import FrontDocument, FrontPoint, confirmed_rows, number_rows, part_rows


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
