"""Critical points between two points of a path, and what is none: a pair of modes that no load brings to rest.

A potential's tangent is symmetric: its eigenvalues are real, and one more is negative only where one has passed
zero. Without a potential two eigenvalues can meet, become complex and come back as two negative ones. None of them
has passed zero: no equilibrium branches off, and statics has nothing to say about it. In time it is flutter, which
depends on the masses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vjm.continuation.path import Equilibrium
from vjm.continuation.problem import Problem, WithLaws
from vjm.continuation.roots import root_between
from vjm.errors import NoConvergenceError, UndecidedError
from vjm.model.law_states import LawState
from vjm.rank import ROUNDING
from vjm.rotations import Array

EVENT_TOLERANCE = 1e-9
"""Share of the path parameter to which an event is located.

Of a whole path it would be 4e-6 of a critical load that is a 4000th of it."""
NEUTRAL = 1e-6
"""Eigenvalue over the smallest unloaded one up to which a motion costs nothing. A bowed bar that bends alike in all
planes turns freely about its chord; that the springs' order of turns prefers one plane is not instability."""
KNOWN = 1e-4
"""Share of its value to which a critical point is promised to be located."""
GROWN = 3
"""Halvings in a row towards the point where it appears at which a negative eigenvalue has grown."""
HALVINGS = 12
"""At most, to tell: one appears between two points of a path, and not at the very end of the way between them."""
VANISHED = 1e-4
"""Eigenvalue at a critical point, over those at both sides: more has not passed zero."""


def locate(problem: Problem, a: Equilibrium, b: Equilibrium, value: Callable[[Equilibrium], float]) -> Equilibrium:
    """The point between two of one path where a value that differs in sign at them is zero.

    Its path parameter is found to `EVENT_TOLERANCE` of itself.

    Args:
        problem: whose path it is.
        a: the nearer end.
        b: the further end.
        value: of a point.

    Raises:
        NoConvergenceError: an equilibrium between them was not found.
    """
    slope = (b.state - a.state) / (b.s - a.s)
    seen: dict[float, Equilibrium] = {a.s: a, b.s: b}

    def at(s: float) -> float:
        if s not in seen:
            near = min(seen.values(), key=lambda p: abs(p.s - s))
            try:
                seen[s] = problem.solve(s, near, slope)
            except NoConvergenceError:
                # a curved path may lie far from its chord: in steps half as long
                if abs(s - near.s) < EVENT_TOLERANCE * abs(s):
                    raise
                at(0.5 * (near.s + s))
                return at(s)
        return value(seen[s])

    root = root_between(at, a.s, b.s, ROUNDING * abs(b.s), EVENT_TOLERANCE)
    at(root)
    return seen[root]


def bifurcation(problem: Problem, a: Equilibrium, b: Equilibrium) -> Equilibrium:
    """The point between a stable and an unstable one where the smallest eigenvalue passes zero.

    Raises:
        UndecidedError: rounding leaves its place open, or the law of a spring ends.
        NoConvergenceError: it does not pass zero but jumps: the two are not on one path, or none passes zero at
            all, see `only_a_pair`.
    """
    if abs(b.eigenvalue) > abs(a.eigenvalue) and _passes_infinity(problem, a, b):
        raise UndecidedError(
            "an eigenvalue changes its sign through infinity, not through zero. There the compliance of one of the "
            "springs vanishes, and the beam's own does not: take more springs"
        )
    vanished = VANISHED * max(abs(a.eigenvalue), abs(b.eigenvalue))
    if problem.conservative:
        if a.eigenvalue <= 0.0:
            return a

        def value(p: Equilibrium) -> float:
            return p.eigenvalue
    else:

        def value(p: Equilibrium) -> float:
            # the one nearest zero, complex or not, changes without a jump, but behind zero another may be nearer;
            # counts leave out what is negative by a rounding only
            lost = p.unstable > a.unstable or -vanished < p.eigenvalue < 0.0
            return math.copysign(p.eigenvalue, -1.0 if lost else 1.0)

        if value(a) <= vanished:
            # zero, or negative by rounding, before already: only a single one can have passed zero
            if (b.unstable - a.unstable) % 2:
                return a
            raise NoConvergenceError("the smallest eigenvalue jumps")

    critical = locate(problem, a, b, value)
    uncertain, sharp = critical.rounding * (b.s - a.s), abs(b.eigenvalue - a.eigenvalue) * critical.s
    if uncertain > KNOWN * sharp:
        share = uncertain / max(sharp, uncertain)
        raise UndecidedError(
            f"rounding leaves the critical value uncertain by {share:.1g} of it, for some elements are very short. "
            "Take fewer elements, or joints with springs instead of very short beams"
        )
    if abs(critical.eigenvalue) > vanished:
        raise NoConvergenceError("the smallest eigenvalue jumps")
    return critical


def _passes_infinity(problem: Problem, a: Equilibrium, b: Equilibrium) -> bool:
    """Whether the negative eigenvalue grows without bound towards where it appears.

    A beam lumped into few springs does so under a large load: the compliance of one of them passes zero. One that
    passes zero itself is smaller the nearer the point.
    """
    grown = 0
    for _ in range(HALVINGS):
        if grown == GROWN:
            return True
        try:
            middle = problem.solve(0.5 * (a.s + b.s), a, (b.state - a.state) / (b.s - a.s))
        except NoConvergenceError:
            return False
        if middle.unstable == a.unstable:
            if abs(middle.eigenvalue) < abs(a.eigenvalue):
                return False
            a = middle
        elif abs(middle.eigenvalue) < abs(b.eigenvalue):
            return False
        else:
            b, grown = middle, grown + 1
    return False


def only_a_pair(problem: Problem, a: Equilibrium, b: Equilibrium) -> bool:
    """Whether between two points, where none has passed zero, eigenvalues have changed their signs in pairs."""
    return not problem.conservative and b.unstable != a.unstable and (b.unstable - a.unstable) % 2 == 0


class WithoutPairs:
    """A problem whose count of unstable modes leaves out the pairs that did not pass zero."""

    def __init__(self, problem: Problem, pairs: int) -> None:
        """Leave out as many.

        Args:
            problem: the engine at work.
            pairs: how many negative eigenvalues have become so in pairs.
        """
        self.label, self.stations, self.conservative = problem.label, problem.stations, problem.conservative
        self._problem, self._pairs = problem, pairs

    def counted(self, point: Equilibrium) -> Equilibrium:
        """The point with its count corrected. A pair that is complex again is none that is left out."""
        self._pairs = min(self._pairs, max(point.unstable, 0))
        return replace(point, unstable=point.unstable - self._pairs)

    def unloaded(self) -> Equilibrium:
        """See `Problem.unloaded`."""
        return self.counted(self._problem.unloaded())

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """See `Problem.solve`."""
        return self.counted(self._problem.solve(s, start, slope))

    def tangent(self, point: Equilibrium, along: Array | None = None) -> Array:
        """See `Problem.tangent`."""
        return self._problem.tangent(point, along)

    def growth(self, point: Equilibrium, change: Array) -> float:
        """See `Problem.growth`."""
        return self._problem.growth(point, change)

    def scaled(self, change: Array) -> Array:
        """See `Problem.scaled`."""
        return self._problem.scaled(change)

    def across(self, start: Equilibrium, slope: Array, step: float) -> Equilibrium:
        """See `Problem.across`."""
        return self.counted(self._problem.across(start, slope, step))

    def nearest_product(self, point: Equilibrium) -> float:
        """See `Problem.nearest_product`."""
        return self._problem.nearest_product(point)

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """See `Problem.switch`."""
        return self.counted(self._problem.switch(critical, s, sign))

    def law_states(self, point: Equilibrium) -> list[LawState]:
        """See `vjm.continuation.problem.WithLaws`."""
        return self._problem.law_states(point) if isinstance(self._problem, WithLaws) else []

    def law_rates(self, point: Equilibrium, along: Array) -> Array:
        """See `vjm.continuation.problem.WithLaws`."""
        return self._problem.law_rates(point, along) if isinstance(self._problem, WithLaws) else np.zeros(0)
