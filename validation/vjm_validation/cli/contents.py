"""Natural frequencies, sensitivities, sweeps and optima as commands print, draw and write them."""

from __future__ import annotations

from typing import TYPE_CHECKING, assert_never

from vjm.design.modes import Modes, ModesVerdict
from vjm.design.optimum import told_row
from vjm_validation.design_documents import (
    ConfirmedRow,
    FrontDocument,
    OptimumDocument,
    SweepDocument,
    sensitivity_lines,
    sensitivity_table,
)
from vjm_validation.documents import ModesDocument, SensitivityDocument
from vjm_validation.page_content import Content, ReportTable

if TYPE_CHECKING:
    from vjm_output.plots import Picture


def modes_lines(document: ModesDocument, wanted: int) -> list[str]:
    """What is to be said of natural frequencies besides their table."""
    lines = []
    verdict = ModesVerdict(document.verdict)
    match verdict:
        case ModesVerdict.STABLE:
            lines.append("The equilibrium is stable.")
        case ModesVerdict.NEUTRAL:
            lines.append("A motion has no stiffness: it has the frequency zero.")
        case ModesVerdict.DIVERGENCE:
            lines.append("The equilibrium is unstable: a motion grows without oscillation (divergence).")
        case ModesVerdict.FLUTTER:
            lines.append("The equilibrium is unstable: an oscillation grows (flutter).")
        case _:
            assert_never(verdict)
    if len(document.modes) < wanted:
        lines.append(f"There are {len(document.modes)} frequencies: no further motion of this model moves a mass.")
    if document.massless:
        lines.append(f"Without mass: {', '.join(document.massless)}. They count as if they weighed nothing.")
    return lines


def modes_content(modes: Modes, document: ModesDocument, wanted: int) -> Content:
    """The natural frequencies of a posture."""

    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import modes_picture

        return [modes_picture(modes)]

    held = "end held" if document.control == "displacement" else "end free"
    cells = [
        (str(k + 1), f"{row.frequency_Hz:.6g}", f"{row.growth_per_s:.4g}", row.largest_at)
        for k, row in enumerate(document.modes)
    ]
    return Content(
        f"{document.model}, posture {document.posture}, {document.engine}, {held}, {document.mass_kg:.6g} kg",
        modes_lines(document, wanted),
        [
            ReportTable(
                "Natural frequencies",
                ("mode", "frequency Hz", "growth 1/s", "moves most at"),
                tuple(cells),
                words=0,
            )
        ],
        draw,
    )


def sensitivity_content(document: SensitivityDocument) -> Content:
    """The derivatives of a quantity, and what to change."""

    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import tornado_picture

        return [tornado_picture(document)]

    title = f"{document.model}, posture {document.posture}, {document.engine}: {document.quantity}"
    return Content(title, sensitivity_lines(document), [sensitivity_table(document)], draw)


def sweep_content(document: SweepDocument) -> Content:
    """A row for each machine and case: numbers, case, quantities, whether it is on the front, and why not."""

    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import sweep_picture

        return [sweep_picture(document)]

    first = document.rows[0].cases
    several = len(first) > 1
    header = (
        *map(_with_unit, document.keys, document.units),
        *(("posture", "wrench") if several else ()),
        *(f"{q}, {u}" for q, u in zip(document.quantities, document.quantity_units, strict=True)),
        "front",
        "why",
    )
    cells = tuple(
        (
            *(f"{v:.6g}" for v in row.numbers),
            *((case.posture, case.wrench) if several else ()),
            *("" if v is None else f"{v:.6g}" for v in case.values),
            "yes" if row.on_front else "",
            case.why,
        )
        for row in document.rows
        for case in row.cases
    )
    front, total = sum(row.on_front for row in document.rows), len(document.rows)
    lines = [f"{front} of {total} machines are not beaten by another in {' and '.join(document.quantities)}."]
    if several:
        lines.append(f"Each is judged by the worst of its {len(first)} cases.")
    without = sum(any(case.why for case in row.cases) for row in document.rows)
    if without:
        lines.append(f"{without} have no answer in a case; the column why says the reason.")
    where = f"{len(first)} cases" if several else f"posture {first[0].posture}"
    title = f"{document.model}, {where}, {document.engine}: {total} machines"
    return Content(title, lines, [ReportTable("Machines", header, cells, words=0)], draw)


def _with_unit(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name


def front_content(document: FrontDocument) -> Content:
    """The machines of a front, and what is to be said of them."""

    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import front_picture

        return [front_picture(document)]

    first, both = document.points[0], " and ".join(document.quantities)
    header = (
        *map(_with_unit, document.quantities, document.quantity_units),
        *(_with_unit(row.key, row.unit) for row in first.numbers),
        *(part.key for part in first.parts),
    )
    cells = tuple(
        (
            *(f"{value:.6g}" for value in point.values),
            *(f"{row.value:.6g}" for row in point.numbers),
            *(told_row(part.row) for part in point.parts),
        )
        for point in document.points
    )
    limits = f", and keep {'; '.join(document.limits)}" if document.limits else ""
    lines = [f"{len(document.points)} machines are not beaten by another in {both}{limits}."]
    confirmed = [row for point in document.points for row in point.confirmed]
    agreeing = [row for row in confirmed if row.elements is not None and not row.doubt]
    if agreeing:
        apart = max(abs(row.elements - row.value) / abs(row.value) for row in agreeing if row.elements is not None)
        lines.append(
            f"Computed again with twice as many springs and with finite elements, {len(agreeing)} of "
            f"{len(confirmed)} values agree within the stated errors. The largest difference is {apart:.1e} of the "
            "value."
        )
    lines += sorted({f"Not computed: {row.quantity}: {row.why}" for row in confirmed if row.why})
    lines += [
        f"Warning: machine {k}: {row.quantity}: {row.doubt}"
        for k, point in enumerate(document.points, start=1)
        for row in point.confirmed
        if row.doubt
    ]
    return Content(
        f"{document.model}: the Pareto front of {both}",
        lines,
        [ReportTable("Machines", header, cells, words=0)],
        draw,
    )


def optimum_content(document: OptimumDocument) -> Content:
    """The best machine; it has no figure."""
    cases = len(document.postures) * max(len(document.wrenches), 1)
    judged = "the weighted mean" if document.weights else "the worst"
    where = f"posture {document.postures[0]}" if cases == 1 else f"{judged} of {cases} cases"
    title = f"{document.model}, {where}: best {document.objective}"
    cells = [
        (row.key, row.unit, f"{row.before:.6g}", f"{row.value:.6g}", "at its bound" if row.at_bound else "")
        for row in document.numbers
    ] + [(part.key, "", "", told_row(part.row), "of the catalogue") for part in document.parts]
    tables = [ReportTable(title, ("number", "unit", "before", "best", ""), tuple(cells), words=0)]
    was = "no answer" if document.before is None else f"{document.before:.6g}"
    unit = f" {document.unit}" if document.unit else ""
    lines = [f"{document.objective}: {document.value:.6g}{unit}, before {was}"]
    for limit in document.limits:
        state = "reached" if limit.active else "kept" if document.kept else ""
        lines.append(f"{limit.limit}: {limit.value:.6g} {state}".rstrip())
    if not document.kept:
        lines.append("No machine within the bounds was found that keeps all limits; this one misses them least.")
    if document.confirmed:
        header = ("quantity", "unit", "here", "twice the springs", "finite elements", "stated error")
        tables.append(
            ReportTable("Computed again", header, tuple(map(_confirmed_cells, document.confirmed)), words=0)
        )
    lines += [
        f"{'Warning' if row.doubt else 'Not computed'}: {row.quantity}: {row.doubt or row.why}"
        for row in document.confirmed
        if row.why or row.doubt
    ]
    agreement = f"{document.agreeing} of {document.starts} starts ended there; " if document.starts else ""
    lines.append(f"{agreement}{document.machines} machines were computed.")
    return Content(title, lines, tables, list)


def _confirmed_cells(row: ConfirmedRow) -> tuple[str, ...]:
    values = (f"{v:.6g}" if v is not None else "-" for v in (row.value, row.refined, row.elements))
    return row.quantity, row.unit, *values, f"{row.error:.1g}" if row.elements is not None else "-"
