"""Short stretches of other stability between points of a path, which no point shows.

Between points of equal stability the eigenvalue nearest zero can pass zero twice only where its magnitude has an
inner minimum. Where three points show one, the two intervals beside it are halved. The parabola through the three
says what is to be expected in their middles, and its error there how far it may be wrong elsewhere: two modes that
change places leave a kink, which no polynomial follows. This goes on with the points beside the least value, until
the parabola's least value, less its error, is above zero, or a point of other stability is found.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from vjm.continuation.critical_points import NEUTRAL
from vjm.continuation.path import Equilibrium
from vjm.continuation.problem import Problem
from vjm.errors import NoConvergenceError

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
    if len(row) < 3:
        return None
    a, m, b = row
    neutral = NEUTRAL * abs(unloaded)
    while _is_minimum(a, m, b) and min(abs(a.eigenvalue), abs(b.eigenvalue)) > neutral and b.s - a.s > smallest:
        before, behind = _halfway(problem, a, m), _halfway(problem, m, b)
        points = [p for p in (a, before, m, behind, b) if p is not None]
        for start, new in pairwise(points):
            if new.unstable != m.unstable:
                return start, new
        if before is None or behind is None:
            return None
        wrong = max(abs(abs(p.eigenvalue) - _parabola(a, m, b, p.s)) for p in (before, behind))
        k = min(range(1, 4), key=lambda i: abs(points[i].eigenvalue))
        a, m, b = points[k - 1 : k + 2]
        if _least(a, m, b) > wrong:
            return None
    return None


def on_one_path(problem: Problem, a: Equilibrium, b: Equilibrium) -> bool:
    """Whether two stable points lie on one path: it is near their chord's middle, and stable there.

    Behind a fold a stable state may be near, with the unstable one that ends at the fold between the two.
    """
    middle = _halfway(problem, a, b)
    return middle is not None and middle.unstable == b.unstable


def _is_minimum(a: Equilibrium, m: Equilibrium, b: Equilibrium) -> bool:
    return abs(m.eigenvalue) < min(abs(a.eigenvalue), abs(b.eigenvalue)) and a.unstable == m.unstable == b.unstable


def _parabola(a: Equilibrium, m: Equilibrium, b: Equilibrium, s: float) -> float:
    """At ``s``, through the magnitudes of three points' eigenvalues."""
    slope, curvature = _coefficients(a, m, b)
    return abs(m.eigenvalue) + slope * (s - m.s) + curvature * (s - m.s) ** 2


def _least(a: Equilibrium, m: Equilibrium, b: Equilibrium) -> float:
    """Least value of the parabola through three points, of which the one in the middle is the lowest."""
    slope, curvature = _coefficients(a, m, b)
    return abs(m.eigenvalue) - slope**2 / (4.0 * curvature)


def _coefficients(a: Equilibrium, m: Equilibrium, b: Equilibrium) -> tuple[float, float]:
    """Slope and half the curvature, at the middle point, of the parabola."""
    back, ahead = a.s - m.s, b.s - m.s
    left, right = ((abs(p.eigenvalue) - abs(m.eigenvalue)) / (p.s - m.s) for p in (a, b))
    curvature = (right - left) / (ahead - back)
    return right - curvature * ahead, curvature


def _halfway(problem: Problem, start: Equilibrium, end: Equilibrium) -> Equilibrium | None:
    """The point in the middle of two, if it is found on their path."""
    try:
        new = problem.solve(0.5 * (start.s + end.s), start, (end.state - start.state) / (end.s - start.s))
    except NoConvergenceError:
        return None
    off = float(np.linalg.norm(new.shape - 0.5 * (start.shape + end.shape)))
    return new if off <= MIDDLE * float(np.linalg.norm(end.shape - start.shape)) else None
