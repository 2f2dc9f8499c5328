"""Table II of the paper beside what its own model and data give.

It also says what its printed matrices (19) and (20) are as beams.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from scipy.optimize import Bounds, LinearConstraint, linprog, milp

from vjm import __version__
from vjm.continuation.load_stepping import StepControl, follow
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium, EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.io.errors import printed
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import Array, translation
from vjm_output.documents import Row
from vjm_output.terminal import TerminalTable
from vjm_updating.identify.command import identify_matrix
from vjm_updating.identify.matrix_file import entry_name, half_unit
from vjm_updating.identify.report import IdentificationDocument
from vjm_updating.identify.rounding import (
    DIFFERENCE_STEP,
    AdmissibleRoundings,
    perturbed,
    printed_entries,
    smallest,
)


@dataclass(frozen=True)
class PublishedRow:
    """One row of Table II; N, mm. The table's header says N/m, its numbers are N/mm: 2661 N / 0.82 mm = 3245."""

    K0: float
    K1: float
    F_cr: float
    d_cr: float
    K2: float
    F1: float
    d1: float
    K3: float


TABLE_II = {
    "A": PublishedRow(K0=3228, K1=3228, F_cr=2661, d_cr=0.82, K2=8.56, F1=2672, d1=2.00, K3=8.56),
    "B": PublishedRow(K0=1130, K1=1105, F_cr=1920, d_cr=1.7, K2=159, F1=2494, d1=4.00, K3=27.7),
    "C": PublishedRow(K0=13056, K1=13090, F_cr=2300, d_cr=0.18, K2=8.56, F1=2305, d1=0.30, K3=8.56),
    "D": PublishedRow(K0=1260, K1=1170, F_cr=2000, d_cr=1.61, K2=52.73, F1=2191, d1=3.00, K3=20.6),
}
"""Pashkevich, Klimchik and Chablat, Table II."""

QUANTITIES = {"K0": "N/mm", "K1": "N/mm", "F_cr": "N", "d_cr": "mm", "K2": "N/mm", "F1": "N", "K3": "N/mm"}
"""The figures that are compared, with their units; d1 is where F1 and K3 are read."""


class PublishedFigure(Row):
    """One figure of Table II with ours beside it."""

    posture: str
    quantity: str
    unit: str
    published: float
    ours: float
    ratio: float
    """Ours over the published one."""
    reach_low: float | None
    """Lowest value found within the rounding of (19) and (20); null where it was not sought."""
    reach_high: float | None
    inside: bool | None
    """Whether the published figure lies in the reach."""
    definition_differs: bool
    """Whether ours is read off at the paper's own displacement, for want of a sharp critical point."""
    note: str


@dataclass(frozen=True)
class TableFigures:
    """What the paper's model gives for one row of Table II.

    Attributes:
        values: by quantity, N and mm.
        sharp: whether the path has a bifurcation.
    """

    values: dict[str, float]
    sharp: bool


COARSE = StepControl(first=0.02, largest=0.1)
"""Events are located and points solved whatever the steps between them: larger ones serve for single figures."""


def table_figures(chain: Machine, posture: str, control: StepControl = COARSE) -> TableFigures:
    """Compute a row of Table II with the paper's model, in tension.

    Where the path has a bifurcation, K1 and K2 are the stiffnesses at 0.99 and 1.01 of its displacement.
    Where it has none (B and D) force and stiffness are read at 1, 0.99 and 1.01 of the paper's own Δ_cr, and
    ours for Δ_cr is where the stiffness falls through half of K0.

    Raises:
        ValueError: the path ends before the paper's Δ1, or has neither a bifurcation nor a stiffness knee.
    """
    row = TABLE_II[posture]
    load_case = LoadCase(posture, row.d1)
    engine = VjmEngine()
    problem = LumpedProblem(engine.model(chain), load_case, engine.label)
    path = follow(problem, load_case, control)
    event = path.critical
    if event is None or not path.complete:
        raise ValueError(f"posture {posture}: no critical point up to {row.d1} mm {path.stopped}")

    def at(s: float) -> Equilibrium:
        return problem.solve(s, min(path.points, key=lambda p: abs(p.s - s)))

    last = path.points[-1]
    values = {"K0": path.points[0].tangent, "F1": float(path.force[-1]), "K3": last.tangent, "d_cr": event.s}
    sharp = event.kind is EventKind.BIFURCATION
    if sharp:
        if event.stiffness_before is None or event.stiffness_after is None:
            raise ValueError(f"posture {posture}: no stiffness beside the critical point")
        values |= {"F_cr": event.force, "K1": event.stiffness_before, "K2": event.stiffness_after}
    else:
        values |= {
            "F_cr": float(load_case.direction @ at(row.d_cr).wrench),
            "K1": at(0.99 * row.d_cr).tangent,
            "K2": at(1.01 * row.d_cr).tangent,
        }
    return TableFigures(values, sharp)


def published_figures(
    chain: Machine, reach: dict[str, dict[str, tuple[float, float]]] | None = None
) -> list[PublishedFigure]:
    """Every figure of Table II with ours, their ratio, and whether the inputs' rounding can reach it.

    Args:
        chain: the paper's chain.
        reach: intervals by posture and quantity, from `vjm_validation.studies.table2`; None where not sought.
    """
    rows = []
    for posture, published in TABLE_II.items():
        if posture not in chain.postures:
            continue
        figures = table_figures(chain, posture)
        for quantity, unit in QUANTITIES.items():
            theirs, ours = getattr(published, quantity), figures.values[quantity]
            low, high = (reach or {}).get(posture, {}).get(quantity, (None, None))
            differs = not figures.sharp and quantity in ("K1", "F_cr", "d_cr", "K2")
            rows.append(
                PublishedFigure(
                    posture=posture,
                    quantity=quantity,
                    unit=unit,
                    published=theirs,
                    ours=ours,
                    ratio=ours / theirs,
                    reach_low=low,
                    reach_high=high,
                    inside=None if low is None or high is None else low <= theirs <= high,
                    definition_differs=differs,
                    note=_note(quantity, published, differs=differs),
                )
            )
    return rows


def _note(quantity: str, row: PublishedRow, *, differs: bool) -> str:
    if not differs:
        return ""
    if quantity == "d_cr":
        return "no sharp point: ours is where the stiffness falls through half of K0"
    factor = {"K1": "0.99 of ", "F_cr": "", "K2": "1.01 of "}[quantity]
    return f"no sharp point: read at {factor}the paper's own {row.d_cr} mm"


# --- What the figures of Table II can be within the rounding of the printed matrices (19) and (20) ----------------
#
# A figure is linearised over the box of roundings, see `vjm_updating.identify.rounding`, and computed at the point
# of the box where the linear model is furthest, so that what is reported can be reached for certain. (Linearising
# again at that point does not move it for any figure of Table II.)


def reach(chain: Machine, posture: str) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each figure of a row of Table II within the rounding.

    Args:
        chain: the paper's chain.
        posture: its row.

    Returns:
        By quantity, the interval in N and mm.
    """
    entries = printed_entries(chain)
    names = list(QUANTITIES)

    def figures(amounts: Array) -> Array:
        try:
            values = table_figures(perturbed(chain, entries, amounts), posture).values
        except (ValueError, NoConvergenceError, np.linalg.LinAlgError):
            return np.full(len(names), np.nan)
        return np.array([values[name] for name in names])

    cone = AdmissibleRoundings(chain, entries)
    nominal = figures(np.zeros(len(entries)))
    steps = DIFFERENCE_STEP * np.eye(len(entries))
    slopes = np.array([(figures(step) - figures(-step)) / (2.0 * DIFFERENCE_STEP) for step in steps]).T
    result = {}
    for k, name in enumerate(names):
        ends = [figures(cone.furthest(sign * slopes[k]))[k] for sign in (-1.0, 1.0)]
        result[name] = (float(np.nanmin([*ends, nominal[k]])), float(np.nanmax([*ends, nominal[k]])))
    return result


# --- Table II as data: what the published figures imply for the matrices (19) and (20) within their rounding ------
#
# The figures are taken as measurements of the paper's model, and the printed entries as its parameters, each free
# within its rounding interval and all together within the cone of positive definite matrices. A figure's *miss* is
# ours over the published one, less one. What the published figure's own rounding explains of it is not held against
# us where matrices are sought that meet many figures. Figures are linearised, the linear problem is solved exactly
# within box and cone, and where its solution does not do what it promised the step is shortened.

SHARP = ("K0", "K1", "F_cr", "d_cr", "K2", "F1", "K3")
"""Figures of a row with a bifurcation."""
SMOOTH = ("K0", "K1", "F_cr", "F1", "K3")
"""Figures of a row without one, all read at the paper's own displacements; its Δ_cr and K2 have no counterpart."""
ROUNDS = 15
ENOUGH = 1e-4
"""Relative gain at which a search ends, and share of the box below which its steps do."""
Figure = tuple[str, str]
"""Posture and quantity."""
Solver = Callable[[Array, Array, Array, Array, Array, Array], Array]
"""Gives the best step for misses and their derivative, lowest and highest step, cuts and their limits."""


def own_rounding(figure: Figure) -> float:
    """Half a unit of a published figure's last digit over the figure."""
    posture, name = figure
    value = getattr(TABLE_II[posture], name)
    return half_unit(str(value)) / float(value)


@dataclass(frozen=True)
class RoundedMatrices:
    """Matrices within their rounding, and what they make of some figures.

    Attributes:
        amounts: ``(n,)`` by which each printed entry is moved, half units of its last digit.
        misses: relative, by figure.
    """

    amounts: Array
    misses: dict[Figure, float]

    def beyond(self, figure: Figure) -> float:
        """Size of a miss beyond what the published figure's own rounding explains."""
        return max(0.0, abs(self.misses[figure]) - own_rounding(figure))

    @property
    def worst(self) -> float:
        """Largest miss beyond the published figures' own rounding."""
        return max(self.beyond(figure) for figure in self.misses)

    @property
    def rms(self) -> float:
        """Root mean square of the misses."""
        return float(np.sqrt(np.mean(np.square(list(self.misses.values())))))


@dataclass
class TableFit:
    """The paper's chain with its printed entries as parameters.

    Attributes:
        chain: with the matrices as printed.
        box: half units by which each entry may move; one is the rounding itself.

    Raises:
        ValueError: no row of the table is a posture of the chain, or a beam has no printed matrix.
    """

    chain: Machine
    box: float = 1.0
    _known: dict[tuple[str, bytes], dict[str, float] | None] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self.entries = printed_entries(self.chain)
        self._cone = AdmissibleRoundings(self.chain, self.entries)
        if len({entry.part for entry in self.entries}) < len(self.chain.beams):
            raise ValueError(
                f"{self.chain.name}: Table II is of beams with printed compliance matrices, all of them"
            )
        self.figures: list[Figure] = []
        for posture in TABLE_II:
            if posture in self.chain.postures:
                names = SHARP if table_figures(self.chain, posture).sharp else SMOOTH
                self.figures += [(posture, name) for name in names]
        if not self.figures:
            raise ValueError(f"{self.chain.name}: no posture is named as a row of Table II: {', '.join(TABLE_II)}")

    @cached_property
    def printed(self) -> RoundedMatrices:
        """The matrices as printed.

        Raises:
            ValueError: the paper's model has no figures there.
        """
        point = self.point(np.zeros(len(self.entries)), self.figures)
        if point is None:
            raise ValueError(f"{self.chain.name}: no critical point in some row of Table II")
        return point

    def point(self, amounts: Array, figures: Sequence[Figure]) -> RoundedMatrices | None:
        """Figures at some matrices; None where the paper's model has no such figures there."""
        misses = {}
        for posture, name in figures:
            values = self._values(posture, amounts)
            if values is None:
                return None
            misses[posture, name] = values[name] / getattr(TABLE_II[posture], name) - 1.0
        return RoundedMatrices(amounts, misses)

    def level(self, figures: Sequence[Figure], start: Array | None = None) -> RoundedMatrices:
        """The matrices whose largest miss over some figures is smallest."""

        def solve(r: Array, J: Array, low: Array, high: Array, cuts: Array, limits: Array) -> Array:
            # unknowns: steps and the largest miss
            one, own = np.ones((len(r), 1)), np.array([own_rounding(figure) for figure in figures])
            A = np.vstack([np.hstack([J, -one]), np.hstack([-J, -one]), np.pad(cuts, ((0, 0), (0, 1)))])
            b = np.concatenate([own - r, own + r, limits])
            bounds = [*zip(low.tolist(), high.tolist(), strict=True), (0.0, np.inf)]
            goal = np.append(np.zeros(len(low)), 1.0)
            return _solved(linprog(goal, A_ub=A, b_ub=b, bounds=bounds).x)[:-1]

        return self._search(figures, solve, lambda point: point.worst, start)

    def fit(self, figures: Sequence[Figure], start: Array | None = None) -> RoundedMatrices:
        """The matrices whose root mean square miss over some figures is smallest."""

        def solve(r: Array, J: Array, low: Array, high: Array, cuts: Array, limits: Array) -> Array:
            def squares(step: Array) -> tuple[float, Array]:
                left = r + J @ step
                return float(left @ left), 2.0 * J.T @ left

            return smallest(
                squares, np.clip(np.zeros(len(low)), low, high), (low, high),
                lambda step: (limits - cuts @ step, -cuts), iterations=200, tolerance=1e-12,
            )  # fmt: skip

        return self._search(figures, solve, lambda point: point.rms, start)

    def most(self, tolerance: float) -> RoundedMatrices:
        """The matrices that meet as many figures as possible within a relative tolerance.

        Returns:
            Their misses over the figures that are met at once, whose largest one is as small as it can be.
        """
        amounts = np.zeros(len(self.entries))
        best = RoundedMatrices(amounts, {})
        for _ in range(3):
            r, J = self._linear(amounts, self.figures)
            chosen = self._largest_set(r, J, amounts, tolerance)
            matrices = self.level(chosen, amounts)
            met = {figure: miss for figure, miss in matrices.misses.items() if matrices.beyond(figure) <= tolerance}
            if len(met) > len(best.misses):
                best = RoundedMatrices(matrices.amounts, met)
            if len(met) == len(chosen):
                break
            amounts = matrices.amounts
        return best

    def _largest_set(self, r: Array, J: Array, amounts: Array, tolerance: float) -> list[Figure]:
        """Figures of which, by the linear model, most are within a tolerance at once."""
        n, m = len(amounts), len(r)
        given_up = 10.0 * (1.0 + float(np.max(np.abs(r))) + float(np.max(np.abs(J) @ np.full(n, 2.0 * self.box))))
        allowed = tolerance + np.array([own_rounding(figure) for figure in self.figures])
        kept: list[Figure] = []

        def solve(cuts: Array, limits: Array) -> Array:
            # unknowns: steps, and for each figure whether it is given up
            slack = given_up * np.eye(m)
            A = np.vstack([np.hstack([J, -slack]), np.hstack([-J, -slack]), np.pad(cuts, ((0, 0), (0, m)))])
            b = np.concatenate([allowed - r, allowed + r, limits - cuts @ amounts])
            solution = milp(
                np.append(np.zeros(n), np.ones(m)),
                integrality=np.append(np.zeros(n), np.ones(m)),
                bounds=Bounds(
                    np.append(-self.box - amounts, np.zeros(m)), np.append(self.box - amounts, np.ones(m))
                ),
                constraints=LinearConstraint(A, -np.inf, b),
            )
            x = _solved(solution.x)
            kept[:] = [figure for figure, out in zip(self.figures, x[n:], strict=True) if out < 0.5]
            return amounts + x[:n]

        self._cone.within(solve)
        return kept

    def _search(
        self,
        figures: Sequence[Figure],
        solve: Solver,
        measure: Callable[[RoundedMatrices], float],
        start: Array | None,
    ) -> RoundedMatrices:
        """Matrices of a locally smallest measure.

        Args:
            figures: that count.
            solve: the linear problem.
            measure: of a point.
            start: where to begin; the printed matrices by default.
        """
        current = self.point(np.zeros(len(self.entries)) if start is None else start, figures)
        if current is None:
            raise ValueError("the paper's model has no figures to begin with")
        radius, linear = 2.0 * self.box, self._linear(current.amounts, figures)
        for _ in range(ROUNDS):
            step = self._step(solve, *linear, current.amounts, radius)
            trial = self.point(current.amounts + step, figures)
            gain = measure(current) - measure(trial) if trial is not None else -1.0
            if trial is None or gain <= 0.0:
                radius *= 0.25
                if radius < ENOUGH * self.box:
                    break
                continue
            current, radius = trial, 2.0 * radius
            if gain < ENOUGH * measure(current):
                break
            linear = self._linear(current.amounts, figures)
        return current

    def _step(self, solve: Solver, r: Array, J: Array, amounts: Array, radius: float) -> Array:
        """Best step ``(n,)`` of the linear problem within box, cone and radius."""
        low = np.maximum(-self.box - amounts, -radius)
        high = np.minimum(self.box - amounts, radius)

        def solved(cuts: Array, limits: Array) -> Array:
            return amounts + solve(r, J, low, high, cuts, limits - cuts @ amounts)

        return self._cone.within(solved) - amounts

    def _linear(self, amounts: Array, figures: Sequence[Figure]) -> tuple[Array, Array]:
        """Misses ``(m,)`` of figures and their derivative ``(m, n)`` by the amounts."""

        def misses(trial_amounts: Array) -> Array:
            point = self.point(trial_amounts, figures)
            return np.full(len(figures), np.nan) if point is None else np.array(list(point.misses.values()))

        J = np.empty((len(figures), len(amounts)))
        centre = misses(amounts)
        for k, unit in enumerate(np.eye(len(amounts))):
            step = DIFFERENCE_STEP * unit
            before, after = misses(amounts - step), misses(amounts + step)
            # beside the cone's surface one of the two may lie outside
            J[:, k] = np.where(
                np.isfinite(before) & np.isfinite(after),
                (after - before) / (2.0 * DIFFERENCE_STEP),
                np.where(np.isfinite(after), after - centre, centre - before) / DIFFERENCE_STEP,
            )
        return centre, J

    def _values(self, posture: str, amounts: Array) -> dict[str, float] | None:
        key = (posture, amounts.tobytes())
        if key not in self._known:
            try:
                row = table_figures(perturbed(self.chain, self.entries, amounts), posture)
                self._known[key] = row.values
            except (ValueError, NoConvergenceError, np.linalg.LinAlgError):
                self._known[key] = None
        return self._known[key]


def _solved(x: Array | None) -> Array:
    if x is None:
        raise ValueError("no matrices within the rounding and the cone")
    return np.asarray(x, dtype=float)


# --- What Table II implies for the matrices (19) and (20): a JSON document, and tables and sentences for people----

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
        matrices = table.level([figure for figure in table.figures if figure[0] in group])
        rows.append(_together(group, matrices))
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


def _together(group: Sequence[str], matrices: RoundedMatrices) -> RowsTogether:
    binding = [_name(figure) for figure in matrices.misses if matrices.beyond(figure) >= BINDING * matrices.worst]
    return RowsTogether(rows=list(group), largest_miss=matrices.worst, binding=binding)


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


class PrintedMatrices(Row):
    """The study of the printed matrices."""

    foot: IdentificationDocument
    """(19), examined as a beam's compliance."""
    bar: IdentificationDocument
    """(20), with its misprint, likewise."""
    table2: Table2Document
    """What the published table implies for the entries within their rounding."""


def printed_matrices(chain: Machine) -> PrintedMatrices:
    """Examine (19) and (20) of the paper's chain, and fit them to Table II within their rounding."""
    return PrintedMatrices(
        foot=identify_matrix("foot-19"),
        bar=identify_matrix("bar-20-as-printed"),
        table2=table2_document(TableFit(chain)),
    )
