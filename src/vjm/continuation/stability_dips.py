"""Short stretches of other stability between points of a path, which no point shows.

Between points of equal stability an eigenvalue can pass zero twice only where its magnitude has an inner minimum.
So has the smallest eigenvalue or, behind another mode's, the product of the two nearest zero. Where three
points show one, the two intervals beside it are halved. The parabola through the three says what to expect in their
middles, and its error there how far it may be wrong elsewhere: two modes that change places leave a kink in the
smallest eigenvalue, which no polynomial follows. This goes on with the points beside the least value, until the
parabola's least value, less its error, is above zero, or a point of other stability is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from vjm.continuation.critical_points import NEUTRAL, only_a_pair
from vjm.continuation.path import Equilibrium
from vjm.continuation.problem import Problem
from vjm.errors import NoConvergenceError

WIDE = 0.02
"""Change of the shape between three points, over its extent, from which a second mode is looked at: eigenvalues
change with the angles between parts, and those by as much."""
MIDDLE = 0.25
"""Distance of a step's middle from its chord's, over the chord, from which its ends are not on one path: of a jump
it is a half, of a root, as beside a fold, a fifth."""


def hidden_change(
    problem: Problem, row: Sequence[Equilibrium], unloaded: float, smallest: float
) -> tuple[Equilibrium, Equilibrium] | None:
    """A point of other stability between three points of one path that have the same.

    Args:
        problem: whose path it is.
        row: three points in order; fewer show no minimum.
        unloaded: the smallest eigenvalue without load. What is neutral beside it is rounding.
        smallest: distance of points below which nothing is looked for.

    Returns:
        The point, after its last known neighbour before it; None where the eigenvalue's inner minimum, if it has
        one, does not pass zero, or the path is not found there.
    """
    if len(row) < 3 or not row[0].unstable == row[1].unstable == row[2].unstable:
        return None
    if min(abs(row[0].eigenvalue), abs(row[-1].eigenvalue)) < NEUTRAL * abs(unloaded):
        return None
    found = _change_at_minimum(problem, row, _nearest, smallest)
    if found is not None or not _is_wide(row):
        return found
    known: dict[float, float] = {}

    def product(point: Equilibrium) -> float:
        if point.s not in known:
            known[point.s] = problem.nearest_product(point)
        return known[point.s]

    return _change_at_minimum(problem, row, product, smallest)


def _nearest(point: Equilibrium) -> float:
    return abs(point.eigenvalue)


def _is_wide(row: Sequence[Equilibrium]) -> bool:
    """Whether the shape changes so much between three points that a mode may come and go again."""
    spread, moved = row[0].shape - row[0].shape[0], row[2].shape - row[0].shape
    return bool(np.vdot(moved, moved) > WIDE**2 * np.vdot(spread, spread))


def _change_at_minimum(
    problem: Problem, row: Sequence[Equilibrium], value: Callable[[Equilibrium], float], smallest: float
) -> tuple[Equilibrium, Equilibrium] | None:
    """See `hidden_change`, of a value that is zero where the stability changes and else positive."""
    a, m, b = row
    while value(m) < min(value(a), value(b)) and b.s - a.s > smallest:
        before, behind = _halfway(problem, a, m), _halfway(problem, m, b)
        points = [p for p in (a, before, m, behind, b) if p is not None]
        for start, new in pairwise(points):
            if new.unstable != m.unstable:
                return start, new
        if before is None or behind is None:
            return None
        parabola = _Parabola(a, m, b, value)
        wrong = max(abs(value(p) - parabola.at(p.s)) for p in (before, behind))
        k = min(range(1, 4), key=lambda i: value(points[i]))
        a, m, b = points[k - 1 : k + 2]
        if _Parabola(a, m, b, value).least > wrong:
            return None
    return None


def on_one_path(problem: Problem, a: Equilibrium, b: Equilibrium) -> bool:
    """Whether two stable points lie on one path: it is near their chord's middle, and stable there.

    For paths on which a motion costs nothing: the tangents of these say nothing of the chord, see
    `vjm.continuation.one_path`.
    """
    middle = _halfway(problem, a, b)
    return middle is not None and (middle.unstable == b.unstable or only_a_pair(problem, middle, b))


class _Parabola:
    """Through the values of three points, of which the one in the middle is the lowest."""

    def __init__(
        self, a: Equilibrium, m: Equilibrium, b: Equilibrium, value: Callable[[Equilibrium], float]
    ) -> None:
        back, ahead = a.s - m.s, b.s - m.s
        left, right = ((value(p) - value(m)) / (p.s - m.s) for p in (a, b))
        self.centre, self.lowest = m.s, value(m)
        self.curvature = (right - left) / (ahead - back)
        self.slope = right - self.curvature * ahead

    def at(self, s: float) -> float:
        return self.lowest + self.slope * (s - self.centre) + self.curvature * (s - self.centre) ** 2

    @property
    def least(self) -> float:
        return self.lowest - self.slope**2 / (4.0 * self.curvature) if self.curvature else self.lowest


def _halfway(problem: Problem, start: Equilibrium, end: Equilibrium) -> Equilibrium | None:
    """The point in the middle of two, if it is found on their path."""
    try:
        new = problem.solve(0.5 * (start.s + end.s), start, (end.state - start.state) / (end.s - start.s))
    except NoConvergenceError:
        return None
    off = float(np.linalg.norm(new.shape - 0.5 * (start.shape + end.shape)))
    return new if off <= MIDDLE * float(np.linalg.norm(end.shape - start.shape)) else None
