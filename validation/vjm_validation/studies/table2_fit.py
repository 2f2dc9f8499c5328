"""Table II as data: what the published figures imply for the matrices (19) and (20) within their rounding.

The figures are taken as measurements of the paper's model, and the printed entries as its parameters, each free
within its rounding interval and all together within the cone of positive definite matrices. A figure's *miss* is
ours over the published one, less one. What the published figure's own rounding explains of it is not held against
us where matrices are sought that meet many figures. Figures are linearised, the linear problem is solved exactly
within box and cone, and where its solution does not do what it promised the step is shortened.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp

from vjm.errors import NoConvergenceError
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.identify.constrained import smallest
from vjm_updating.identify.matrix_file import half_unit
from vjm_updating.identify.rounding import DIFFERENCE_STEP, AdmissibleRoundings, perturbed, printed_entries
from vjm_validation.studies.table2 import TABLE_II, table_figures

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
            found = self.level(chosen, amounts)
            met = {figure: miss for figure, miss in found.misses.items() if found.beyond(figure) <= tolerance}
            if len(met) > len(best.misses):
                best = RoundedMatrices(found.amounts, met)
            if len(met) == len(chosen):
                break
            amounts = found.amounts
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
            found = milp(
                np.append(np.zeros(n), np.ones(m)),
                integrality=np.append(np.zeros(n), np.ones(m)),
                bounds=Bounds(
                    np.append(-self.box - amounts, np.zeros(m)), np.append(self.box - amounts, np.ones(m))
                ),
                constraints=LinearConstraint(A, -np.inf, b),
            )
            x = _solved(found.x)
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
        here = self.point(np.zeros(len(self.entries)) if start is None else start, figures)
        if here is None:
            raise ValueError("the paper's model has no figures to begin with")
        radius, linear = 2.0 * self.box, self._linear(here.amounts, figures)
        for _ in range(ROUNDS):
            step = self._step(solve, *linear, here.amounts, radius)
            there = self.point(here.amounts + step, figures)
            gain = measure(here) - measure(there) if there is not None else -1.0
            if there is None or gain <= 0.0:
                radius *= 0.25
                if radius < ENOUGH * self.box:
                    break
                continue
            here, radius = there, 2.0 * radius
            if gain < ENOUGH * measure(here):
                break
            linear = self._linear(here.amounts, figures)
        return here

    def _step(self, solve: Solver, r: Array, J: Array, amounts: Array, radius: float) -> Array:
        """Best step ``(n,)`` of the linear problem within box, cone and radius."""
        low = np.maximum(-self.box - amounts, -radius)
        high = np.minimum(self.box - amounts, radius)

        def solved(cuts: Array, limits: Array) -> Array:
            return amounts + solve(r, J, low, high, cuts, limits - cuts @ amounts)

        return self._cone.within(solved) - amounts

    def _linear(self, amounts: Array, figures: Sequence[Figure]) -> tuple[Array, Array]:
        """Misses ``(m,)`` of figures and their derivative ``(m, n)`` by the amounts."""

        def misses(at: Array) -> Array:
            point = self.point(at, figures)
            return np.full(len(figures), np.nan) if point is None else np.array(list(point.misses.values()))

        J = np.empty((len(figures), len(amounts)))
        here = misses(amounts)
        for k, unit in enumerate(np.eye(len(amounts))):
            step = DIFFERENCE_STEP * unit
            before, after = misses(amounts - step), misses(amounts + step)
            # beside the cone's surface one of the two may lie outside
            J[:, k] = np.where(
                np.isfinite(before) & np.isfinite(after),
                (after - before) / (2.0 * DIFFERENCE_STEP),
                np.where(np.isfinite(after), after - here, here - before) / DIFFERENCE_STEP,
            )
        return here, J

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
