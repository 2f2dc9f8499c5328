"""Whether two equilibria lie on one path, and the path between them where that is not plain.

A step of a ramp may end on another stable path, behind a fold. Newton's method does not tell. The path between two
points is one where the tangent stiffness changes by less than half of itself between them. Newton's method with the
tangent held is then a contraction by a half at every load of the step (Banach; Kantorovich asks for the same of a
bound of the curvature). So there is one equilibrium for each load near the first, and it moves without a jump.

What the ends show of that change is the chord c beside the steps p₀ and p₁ that the tangents at the two ends
foresee. Where the stiffness falls evenly to its half, c is 4/3 of p₀ and 2/3 of p₁, and it misses their mean by a
twelfth of p₁. So a step is taken where the chord is as near as that to both and to the mean. This is asked of each
coordinate by itself, for a part that jumps may be small beside what the whole machine moves. The smallest
eigenvalue, too, is at least half and at most twice the one before.

A step that is not so is halved, and its halves are looked at likewise. What stays in doubt is followed by its arc,
which is measured in the coordinates alone: where the ramp is to end does not count. It comes to the step's end, or
to where the ramp turns back.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from vjm.continuation.events import Problem, root_between
from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError
from vjm.rank import NEGLIGIBLE
from vjm.rotations import Array

HALF = 0.5
"""Of the tangent stiffness, and of its smallest eigenvalue: what a step may change."""
END = 1.0 / 3.0
"""Distance of the chord from what an end's tangent foresees, over that, where the stiffness falls to its half."""
MEAN = 1.0 / 12.0
"""Distance of the chord from the mean of the two, over the larger, likewise."""
NOTHING = 1e-6
"""Motion of a coordinate over the largest of a step that is none."""
SLIGHT = 1e-3
"""Likewise, of which the mean alone is asked: what begins with the square of the load is near neither end."""
HALVINGS = 2
"""Of a step in doubt, before its arc is followed: along a smooth path each leaves a quarter of the doubt."""
BEND = 0.05
"""Distance of an arc's point from the tangent at the one before it, over the step, as along any arc."""
CHORD = 0.25
"""First step along an arc, over the chord: four see its middle."""
SMALLEST = 1e-6
"""Step along an arc over the first one at which it is given up."""
POINTS = 1000
"""Of one arc, after which it is given up."""
LOCATED = 1e-9
"""A turn of the ramp is located to this share of a step of the arc."""


class Passage(NamedTuple):
    """The path behind a point.

    Attributes:
        points: in order behind the first one, which is left out. The last is at the step's end, or the first of
            another stability, or the last before a turn.
        turn: where the ramp turns back; None where it does not.
    """

    points: list[Equilibrium]
    turn: Equilibrium | None = None


Rates = dict[Equilibrium, Array | None]
"""Derivatives of the scaled coordinates by the path's parameter at the last points, which two steps ask for."""


class OnePath:
    """Looks at the steps of one path."""

    def __init__(self, problem: Problem, rates: Rates) -> None:
        """Take a problem's steps.

        Args:
            problem: whose path it is.
            rates: what is known from steps before.
        """
        self.problem, self._rates = problem, rates

    def way(self, point: Equilibrium, end: float) -> Array:
        """Change of state that the tangent at a point foresees up to a path parameter.

        Raises:
            NoConvergenceError: the point is critical.
        """
        tangent = self.problem.tangent(point)
        growth = self.problem.growth(point, tangent)
        if not growth:
            raise NoConvergenceError("the path turns back here")
        return (end - point.s) / growth * tangent

    def passage(self, a: Equilibrium, b: Equilibrium, *, by_root: bool = False) -> Passage:
        """The path from one point to the path parameter of another.

        Args:
            a: a point of the path.
            b: an equilibrium at a larger path parameter, which Newton's method found from there.
            by_root: the path began at a bifurcation near by, and its smallest eigenvalue with it.

        Returns:
            ``[b]`` where the two are on one path.

        Raises:
            NoConvergenceError: the path could not be followed so far.
        """
        row = [a]
        if self._halved(row, b, HALVINGS, by_root):
            odd = next((k for k, p in enumerate(row) if p.unstable != a.unstable), None)
            return Passage([b] if odd is None else row[1 : odd + 1])
        arc = self.arc(row[-1], b.s, b.state - row[-1].state)
        if arc.turn is None and all(p.unstable == a.unstable for p in (*row, *arc.points)):
            return Passage(arc.points[-1:])
        return Passage(row[1:] + arc.points, arc.turn)

    def _halved(
        self, row: list[Equilibrium], b: Equilibrium, halvings: int, by_root: bool, *, part: bool = False
    ) -> bool:
        """Whether the last of a row and ``b`` are on one path; what is known to be on it is added to the row.

        ``part`` says that the two are half of a step that was even itself.
        """
        a = row[-1]
        even = self._is_even(a, b, by_root)
        if even and (part or self._is_near(a, b)):
            row.append(b)
            return True
        if not halvings:
            return False
        try:
            middle = self.problem.solve(0.5 * (a.s + b.s), a, (b.state - a.state) / (b.s - a.s))
        except NoConvergenceError:
            return False
        ends = self._halved(row, middle, halvings - 1, by_root, part=even)
        return ends and self._halved(row, b, halvings - 1, by_root, part=even)

    def _is_even(self, a: Equilibrium, b: Equilibrium, by_root: bool) -> bool:
        foreseen = self._foreseen(a, b)
        if foreseen is None:
            return False
        chord, first, last = foreseen
        if not (foresee(chord, first, last) and _even(chord, first, last)):
            return False
        if by_root or a.unstable != b.unstable or not a.eigenvalue:
            return True
        ratio = b.eigenvalue / a.eigenvalue
        return not (ratio < HALF or ratio > 1.0 / HALF)

    def _is_near(self, a: Equilibrium, b: Equilibrium) -> bool:
        foreseen = self._foreseen(a, b)
        return foreseen is not None and _near(*foreseen)

    def _foreseen(self, a: Equilibrium, b: Equilibrium) -> tuple[Array, Array, Array] | None:
        """Chord of the coordinates, and what the tangents at the two ends foresee of it."""
        # the last one first: it has just been solved for
        last, first = self._rate(b), self._rate(a)
        if first is None or last is None:
            return None
        h = b.s - a.s
        chord, first, last = self._coordinates(b.state - a.state), h * first, h * last
        if max(float(np.linalg.norm(way)) for way in (chord, first, last)) < NEGLIGIBLE:
            # the load moves nothing: all three are rounding
            chord, first, last = (np.zeros_like(chord) for _ in range(3))
        return chord, first, last

    def _rate(self, point: Equilibrium) -> Array | None:
        """Derivative of the scaled coordinates by the path's parameter; None at a critical point."""
        if point in self._rates:
            return self._rates[point]
        rate = None
        with suppress(NoConvergenceError):
            rate = self._coordinates(self.way(point, point.s + 1.0))
        # with the middles of a step, and its two ends
        while len(self._rates) > 2 ** (HALVINGS + 1):
            del self._rates[next(iter(self._rates))]
        self._rates[point] = rate
        return rate

    def arc(self, begin: Equilibrium, end: float, way: Array) -> Passage:
        """The path by its arc from a point towards a path parameter.

        Args:
            begin: the point.
            end: the path parameter.
            way: a change of state about as long as the path's.

        Raises:
            NoConvergenceError: it could not be followed so far.
        """
        longest = step = CHORD * self._length(way)
        points: list[Equilibrium] = []
        point, slope = begin, self._slope(begin, None)
        rise = stiffest = self.problem.growth(begin, slope)
        # what other loads deflect before the ramp begins is called zero: steps are counted from where it is
        place = begin.s
        with suppress(NoConvergenceError):
            place = self.problem.across(begin, slope, 0.0).s
        while len(points) < POINTS and step > SMALLEST * longest:
            try:
                next_point = self.problem.across(point, slope, step)
                onwards = self._slope(next_point, next_point.state - point.state)
            except NoConvergenceError:
                step *= 0.5
                continue
            chord = self._coordinates(next_point.state - point.state)
            first, last = (step * self._coordinates(way) for way in (slope, onwards))
            bend = float(np.linalg.norm(chord - first)) / step
            risen = self.problem.growth(next_point, onwards)
            off = abs((next_point.s - place) / step - 0.5 * (rise + risen))
            if (
                bend > BEND
                or abs(risen - rise) > HALF * stiffest
                or off > MEAN * stiffest
                or not _even(chord, first, last)
                or not (_near(chord, first, last) or self._even_halves(point, next_point, slope, onwards, step))
            ):
                step *= 0.5
                continue
            if risen < 0.0:
                next_point = self._place(point, slope, step, self._growth(slope))
                # an end on the turn itself is one
                if next_point.s <= end * (1.0 + LOCATED):
                    return Passage(points, next_point)
            if next_point.s >= end * (1.0 - LOCATED):
                if next_point.s > end * (1.0 + LOCATED):
                    next_point = self._place(
                        point, slope, self._progress(point, slope, next_point), lambda p: end - p.s
                    )
                return Passage([*points, self.problem.solve(end, next_point)])
            points.append(next_point)
            if next_point.unstable != begin.unstable:
                return Passage(points)
            point, place, slope, rise, stiffest = next_point, next_point.s, onwards, risen, max(stiffest, risen)
            step = min(longest, step * (1.5 if bend < 0.3 * BEND else 1.0))
        raise NoConvergenceError("its arc could not be followed")

    def _even_halves(
        self, point: Equilibrium, next_point: Equilibrium, slope: Array, onwards: Array, step: float
    ) -> bool:
        """Whether a step of the arc in which the slope of a coordinate changes much is even in its halves too."""
        try:
            middle = self.problem.across(point, slope, 0.5 * step)
            between = self._slope(middle, slope)
        except NoConvergenceError:
            return False
        halves = ((point, slope, middle, between), (middle, between, next_point, onwards))
        return all(
            _even(
                self._coordinates(b.state - a.state),
                *(0.5 * step * self._coordinates(way) for way in (at_a, at_b)),
            )
            for a, at_a, b, at_b in halves
        )

    def _coordinates(self, change: Array) -> Array:
        return self.problem.scaled(change)[:-1]

    def _length(self, change: Array) -> float:
        return float(np.linalg.norm(self._coordinates(change)))

    def _slope(self, point: Equilibrium, forwards: Array | None) -> Array:
        """Derivative of the state by the coordinates' arc, forwards along the path."""
        tangent = self.problem.tangent(point)
        if forwards is None:
            ahead = self.problem.growth(point, tangent)
        else:
            # the ramp, which may turn back, does not tell
            ahead = float(self._coordinates(tangent) @ self._coordinates(forwards))
        if ahead < 0.0:
            tangent = -tangent
        length = self._length(tangent)
        if not length:
            raise NoConvergenceError("the ramp moves nothing")
        return np.asarray(tangent / length, dtype=float)

    def _progress(self, point: Equilibrium, slope: Array, next_point: Equilibrium) -> float:
        return float(self._coordinates(slope) @ self._coordinates(next_point.state - point.state))

    def _growth(self, forwards: Array) -> Callable[[Equilibrium], float]:
        def growth(point: Equilibrium) -> float:
            try:
                return self.problem.growth(point, self._slope(point, forwards))
            except NoConvergenceError:
                # singular to the last digit: the turn itself
                return 0.0

        return growth

    def _place(
        self, point: Equilibrium, slope: Array, step: float, value: Callable[[Equilibrium], float]
    ) -> Equilibrium:
        """The point between one and another so far along its arc at which a value, positive before, is zero."""
        seen: dict[float, Equilibrium] = {0.0: point}

        def at(way: float) -> float:
            if way not in seen:
                seen[way] = self.problem.across(point, slope, way)
            return value(seen[way])

        # a value that vanishes at the step's end has the sign of rounding there
        return seen[step] if at(step) >= 0.0 else seen[root_between(at, 0.0, step, LOCATED * step)]


def foresee(chord: Array, *ways: Array) -> bool:
    """Whether what tangents at the ends of a step foresee ``(n,)`` is near the motion between these, see `END`."""
    return all(bool(np.linalg.norm(chord - way) <= END * np.linalg.norm(way)) for way in ways)


def _even(chord: Array, first: Array, last: Array) -> bool:
    """Whether in each coordinate the steps that the ends' tangents foresee have the chord as their mean."""
    largest = _largest(chord, first, last, NOTHING)
    return bool(np.all(np.abs(chord - 0.5 * (first + last)) <= MEAN * largest))


def _near(chord: Array, first: Array, last: Array) -> bool:
    """Whether in each coordinate the chord is near what either end's tangent foresees."""
    largest = END * _largest(chord, first, last, SLIGHT)
    return bool(np.all(np.abs(chord - first) <= largest) and np.all(np.abs(chord - last) <= largest))


def _largest(chord: Array, first: Array, last: Array, least: float) -> Array:
    return np.asarray(np.maximum(np.abs(first), np.abs(last)) + least * np.abs(chord).max(initial=0.0))
