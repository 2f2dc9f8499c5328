"""What Table II implies for the matrices (19) and (20): a JSON document, and tables and sentences for people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from rich.box import SIMPLE
from rich.console import Console

from vjm import __version__
from vjm.io.errors import printed
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import translation
from vjm_output.documents import Row
from vjm_output.terminal import TerminalTable
from vjm_updating.identify.matrix_file import entry_name
from vjm_validation.studies.table2 import QUANTITIES, TABLE_II, table_figures
from vjm_validation.studies.table2_fit import Figure, RoundedMatrices, TableFit
from vjm_validation.studies.table2_reach import reach

# --- Table II with an offset between the point where (19) is read and the axes of q1 and q2: a fit, and no evidence
#
# The paper does not say where along the foot its matrix (19) is read. With 8 mm between that point and the axes the
# largest miss of K0 falls from 16 to 4 %. The length was sought for that; nothing in the paper gives it.

OFFSET_MM = (-8.0, 0.0, 0.0)
"""Behind the foot's end, chain axes, found by trial."""
WITHIN = 0.05


@dataclass(frozen=True)
class OffsetFit:
    """What an offset makes of the table.

    Attributes:
        K0: N/mm, by posture.
        largest_miss: of K0, relative.
        within: so many figures that need no definition of the paper's meet it within 5 %, of
        compared: so many.
        sharp: postures with a bifurcation.
    """

    K0: dict[str, float]
    largest_miss: float
    within: int
    compared: int
    sharp: tuple[str, ...]


def with_offset(chain: Machine, offset: tuple[float, float, float]) -> Machine:
    """A chain with a rigid piece behind its first beam.

    Args:
        chain: the paper's.
        offset: mm, chain axes.
    """
    foot = next(i for i, part in enumerate(chain.parts) if isinstance(part, Beam))
    piece = RigidOffset("offset", translation(offset))
    return replace(chain, parts=(*chain.parts[: foot + 1], piece, *chain.parts[foot + 1 :]))


def offset_fit(chain: Machine, offset: tuple[float, float, float] = OFFSET_MM) -> OffsetFit:
    """Table II by the paper's model with an offset; without one it is the printed model.

    Args:
        chain: the paper's.
        offset: mm, chain axes.

    Raises:
        ValueError: see `vjm_validation.studies.table2.table_figures`.
    """
    moved = with_offset(chain, offset) if any(offset) else chain
    rows = {posture: table_figures(moved, posture) for posture in TABLE_II}
    misses = {
        (posture, name): row.values[name] / getattr(TABLE_II[posture], name) - 1.0
        for posture, row in rows.items()
        for name in row.values
    }
    return OffsetFit(
        K0={posture: row.values["K0"] for posture, row in rows.items()},
        largest_miss=max(abs(miss) for (_, name), miss in misses.items() if name == "K0"),
        within=sum(abs(miss) <= WITHIN for miss in misses.values()),
        compared=len(misses),
        sharp=tuple(posture for posture, row in rows.items() if row.sharp),
    )


def offset_finding(chain: Machine) -> str:
    """A sentence on what the offset does beside the printed model, and that it proves nothing.

    Raises:
        ValueError: see `offset_fit`.
    """
    printed, fitted = offset_fit(chain, (0.0, 0.0, 0.0)), offset_fit(chain)
    stiffnesses = ", ".join(f"{K0:.0f}" for K0 in fitted.K0.values())
    return (
        f"an offset of {OFFSET_MM[0]:g} mm between where (19) is read and the axes of q1 and q2 lowers the "
        f"largest miss of K0 from {100.0 * printed.largest_miss:.1f} to {100.0 * fitted.largest_miss:.1f} % (K0 = "
        f"{stiffnesses}). It brings {fitted.within} instead of {printed.within} of {fitted.compared} figures "
        "within 5 %. Its length was fitted to the table, so it is no evidence of the paper's geometry"
    )


# ------------------------------------------------------------------------------------------------------------------


TOLERANCES = (0.01, 0.02, 0.05, 0.1)
WIDER = (1.0, 2.0, 4.0)
"""Half units by which entries may move in the fit: one is the rounding, more shows what it holds up."""
BINDING = 0.999
"""Share of the largest miss from which a figure is one that keeps it from being smaller."""
AT_LIMIT = 0.999


class TableFigure(Row):
    """A published figure, and ours for the matrices as printed and for those fitted to the table."""

    posture: str
    quantity: str
    unit: str
    published: float
    printed: float
    """Ours for the matrices as printed."""
    fitted: float
    reach_low: float
    """Lowest value within the rounding of (19) and (20), each figure by itself."""
    reach_high: float
    inside: bool
    """Whether the published figure lies in the reach."""


class ImpliedEntry(Row):
    """A printed entry, and what the fit to the whole table makes of it within its rounding."""

    part: str
    entry: str
    printed: float
    implied: float
    moved: float
    """Half units of the last printed digit."""
    at_limit: bool


class RowsTogether(Row):
    """How well some rows can be met by one choice of the matrices within their rounding."""

    rows: list[str]
    largest_miss: float
    """Of any of their figures, relative, beyond the figure's own rounding; no choice makes it smaller."""
    binding: list[str]
    """Figures that have this miss."""


class FiguresTogether(Row):
    """The largest set of figures that one choice of the matrices meets."""

    tolerance: float
    """Relative, beyond the figures' own rounding."""
    met: list[str]
    not_met: list[str]


class WiderFit(Row):
    """The fit where entries may move by more than their rounding."""

    half_units: float
    rms: float
    largest_miss: float


class Table2Document(Row):
    """What ``validate identify MODEL --table2 --json`` prints."""

    version: str
    model: str
    sha256: str
    figures: list[TableFigure]
    entries: list[ImpliedEntry]
    rms_printed: float
    """Root mean square of the relative misses of all figures, the matrices as printed."""
    rms_fitted: float
    """The smallest that the rounding allows."""
    rows: list[RowsTogether]
    agreements: list[FiguresTogether]
    wider: list[WiderFit]
    findings: list[str]
    """The same in words."""


def table2_document(table: TableFit, progress: Callable[[str, int, int], None] | None = None) -> Table2Document:
    """Fit (19) and (20) to Table II within their rounding.

    Args:
        table: of the paper's chain.
        progress: called with a stage's name, how much of it is done, and of how much.

    Raises:
        ValueError: the paper's model has no critical point in some row.
    """
    chain = table.chain
    postures = list(dict.fromkeys(posture for posture, _ in table.figures))
    groups = [group for k in range(1, len(postures) + 1) for group in combinations(postures, k)]
    total, finished = len(groups) + len(TOLERANCES) + len(WIDER) + 1, 0

    def done() -> None:
        nonlocal finished
        finished += 1
        if progress is not None:
            progress("Table II", finished, total)

    rows = []
    for group in groups:
        found = table.level([figure for figure in table.figures if figure[0] in group])
        rows.append(_together(group, found))
        done()
    agreements = []
    for tolerance in TOLERANCES:
        met = table.most(tolerance).misses
        agreements.append(
            FiguresTogether(
                tolerance=tolerance,
                met=[_name(figure) for figure in table.figures if figure in met],
                not_met=[_name(figure) for figure in table.figures if figure not in met],
            )
        )
        done()
    fits = []
    for box in WIDER:
        fits.append(TableFit(chain, box).fit(table.figures) if box > 1.0 else table.fit(table.figures))
        done()
    document = Table2Document(
        version=__version__,
        model=chain.name,
        sha256=chain.sha256,
        figures=_figures(table, fits[0]),
        entries=_entries(table, fits[0]),
        rms_printed=table.printed.rms,
        rms_fitted=fits[0].rms,
        rows=rows,
        agreements=agreements,
        wider=[
            WiderFit(half_units=box, rms=fit.rms, largest_miss=fit.worst)
            for box, fit in zip(WIDER, fits, strict=True)
        ],
        findings=[],
    )
    done()
    return document.model_copy(update={"findings": [*findings(document), offset_finding(chain)]})


def _name(figure: Figure) -> str:
    return f"{figure[0]} {figure[1]}"


def _together(group: Sequence[str], found: RoundedMatrices) -> RowsTogether:
    binding = [_name(figure) for figure in found.misses if found.beyond(figure) >= BINDING * found.worst]
    return RowsTogether(rows=list(group), largest_miss=found.worst, binding=binding)


def _figures(table: TableFit, fit: RoundedMatrices) -> list[TableFigure]:
    spans = {posture: reach(table.chain, posture) for posture in {posture for posture, _ in table.figures}}
    rows = []
    for figure in table.figures:
        posture, quantity = figure
        published = float(getattr(TABLE_II[posture], quantity))
        low, high = spans[posture][quantity]
        rows.append(
            TableFigure(
                posture=posture,
                quantity=quantity,
                unit=QUANTITIES[quantity],
                published=published,
                printed=published * (1.0 + table.printed.misses[figure]),
                fitted=published * (1.0 + fit.misses[figure]),
                reach_low=low,
                reach_high=high,
                inside=low <= published <= high,
            )
        )
    return rows


def _entries(table: TableFit, fit: RoundedMatrices) -> list[ImpliedEntry]:
    compliances = {beam.name: beam.compliance for beam in table.chain.beams}
    rows = []
    for entry, moved in zip(table.entries, fit.amounts, strict=True):
        C = compliances[entry.part]
        assert C is not None
        value = float(C[entry.row, entry.column])
        rows.append(
            ImpliedEntry(
                part=entry.part,
                entry=entry_name(entry.row, entry.column),
                printed=value,
                implied=value + float(moved) * entry.half_unit,
                moved=float(moved),
                at_limit=bool(abs(moved) > AT_LIMIT),
            )
        )
    return rows


def findings(document: Table2Document) -> list[str]:
    """Sentences on what the table implies."""
    lines = []
    alone = {row.rows[0]: row for row in document.rows if len(row.rows) == 1}
    for label, row in alone.items():
        lines.append(
            f"row {label} by itself can be met to {_percent(row.largest_miss)}, held up by {', '.join(row.binding)}"
        )
    together = [row for row in document.rows if len(row.rows) > 1]
    worse = [
        row for row in together if BINDING * row.largest_miss > max(alone[one].largest_miss for one in row.rows)
    ]
    lines += [f"rows {', '.join(row.rows)} at once only to {_percent(row.largest_miss)}" for row in worse]
    if len(worse) < len(together):
        lines.append(("no other" if worse else "no") + " rows do worse at once than the worst of them does alone")
    for one in document.agreements:
        out = f"all but {', '.join(one.not_met)}" if one.not_met else "all"
        count = f"{len(one.met)} of {len(one.met) + len(one.not_met)}"
        lines.append(f"within {_percent(one.tolerance)} at most {count} figures can be met at once: {out}")
    outside = [f"{figure.posture} {figure.quantity}" for figure in document.figures if not figure.inside]
    if outside:
        lines.append(f"out of reach of the rounding even by themselves: {', '.join(outside)}")
    held = [f"{one.part} {one.entry}" for one in document.entries if one.at_limit]
    lines.append(
        f"the fit to the whole table lowers the root mean square miss from {_percent(document.rms_printed)} to "
        f"{_percent(document.rms_fitted)}. {len(held)} of {len(document.entries)} entries end at their rounding's "
        f"limit: {', '.join(held) or 'none'}"
    )
    for wide in document.wider[1:]:
        lines.append(
            f"entries free by {wide.half_units:g} half units, more than their rounding: {_percent(wide.rms)}"
        )
    return lines


def _percent(value: float) -> str:
    return f"{printed(100.0 * value, 3)} %"


def show(console: Console, document: Table2Document) -> None:
    """Print a document."""
    figures = TerminalTable(title="Table II and the rounding of (19), (20)", title_justify="left", box=SIMPLE)
    for name in ("", "published", "ours, as printed", "ours, fitted", "reach", ""):
        figures.add_column(name, justify="right")
    for one in document.figures:
        values = (printed(value, 5) for value in (one.published, one.printed, one.fitted))
        span = f"{printed(one.reach_low, 4)} to {printed(one.reach_high, 4)}"
        figures.add_row(f"{one.posture} {one.quantity}", *values, span, "inside" if one.inside else "outside")
    console.print(figures)
    entries = TerminalTable(title="Entries that the table implies", title_justify="left", box=SIMPLE)
    for name in ("", "printed", "implied", "moved, half units"):
        entries.add_column(name, justify="right")
    for row in document.entries:
        moved = printed(float(np.round(row.moved, 3)) + 0.0, 3)
        entries.add_row(f"{row.part} {row.entry}", printed(row.printed), printed(row.implied, 4), moved)
    console.print(entries)
    for line in document.findings:
        console.print(line, soft_wrap=True, highlight=False, markup=False)
