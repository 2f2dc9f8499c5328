"""What lies between two points of a path.

Here are critical points, short stretches of other stability, and changes of a spring's law.

The engine shows of itself what `Problem` says; a root between two points of different sign
places each event.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from vjm.continuation.path import Equilibrium, Event, LawChange, Path, StationLabel, driven_force
from vjm.errors import NoConvergenceError, UndecidedError
from vjm.model.law_states import LawState
from vjm.model.load_case import LoadCase
from vjm.rank import ROUNDING
from vjm.rotations import Array


class Problem(Protocol):
    """What an engine must be able to do for its path to be followed, by its arc where its ramp turns."""

    label: str
    stations: tuple[StationLabel, ...]

    @property
    def conservative(self) -> bool:
        """Whether all loads have a potential: the tangent is symmetric and its eigenvalues are real."""

    def unloaded(self) -> Equilibrium:
        """The state at zero displacement."""

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at the path parameter ``s``, from the state of ``start``.

        Args:
            s: path parameter, at which the driven displacement is imposed.
            start: a converged neighbour.
            slope: derivative of the state by s, for a first guess; the engine may ignore it.

        Raises:
            NoConvergenceError: none was found.
        """

    def tangent(self, point: Equilibrium, along: Array | None = None) -> Array:
        """Derivative of the state by the arc's length; its last component is the ramp's.

        Args:
            point: an equilibrium.
            along: a change of state that tells forwards from backwards; else the ramp grows.

        Raises:
            NoConvergenceError: the point is critical.
        """

    def growth(self, point: Equilibrium, change: Array) -> float:
        """Change of the path parameter of a ramp by a small change of state at a point."""

    def scaled(self, change: Array) -> Array:
        """A change of state in the units of an arc; its last component is the ramp's."""

    def across(self, start: Equilibrium, slope: Array, step: float) -> Equilibrium:
        """Equilibrium whose coordinates lie on the plane across a direction, so far from a point.

        Args:
            start: the point.
            slope: change of state along which the plane is found, its scaled coordinates of length one.
            step: distance of the plane, in the units of an arc.

        Raises:
            NoConvergenceError: none was found.
        """

    def nearest_product(self, point: Equilibrium) -> float:
        """Magnitude of the product of the two eigenvalues nearest zero at a point; nan where it is not known.

        Unlike the smallest one it has no kink where two modes change places.
        """

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A state on the branch that crosses at a bifurcation, at the path parameter ``s`` just behind it.

        Args:
            critical: the state at the bifurcation.
            s: a little more than ``critical.s``.
            sign: which of the two mirrored branches, see `LoadCase.branch`.

        Raises:
            NoConvergenceError: the branch was not found, or none leads onwards from here.
        """


@runtime_checkable
class WithLaws(Protocol):
    """A problem that tells where the laws of its springs are."""

    def law_states(self, point: Equilibrium) -> list[LawState]:
        """All laws at a point of a path, always in the same order."""

    def law_rates(self, point: Equilibrium, along: Array) -> Array:
        """Derivatives ``(l,)`` of their deflections by the path parameter.

        Args:
            point: of the path.
            along: a change of state that tells forwards from backwards.

        Raises:
            NoConvergenceError: the point is critical.
        """


LARGEST = 200
"""Evaluations; bisection alone takes 60 to come from 1 to 1e-18."""


def root_between(
    function: Callable[[float], float], a: float, b: float, tolerance: float, relative: float = 1e-12
) -> float:
    """Where a continuous function is zero, by Brent's method: interpolation where it converges, else bisection.

    SciPy has it too, but importing its search for roots takes a fifth of the time of a whole command.

    Args:
        function: of one variable.
        a: one end.
        b: the other; the function's signs differ there.
        tolerance: of the variable.
        relative: what is added to it for each unit of the variable.

    Returns:
        The point with the smallest value that was seen; it lies within the tolerance of a root.

    Raises:
        ValueError: the signs do not differ.

    Source:
        R. P. Brent, Algorithms for Minimization Without Derivatives (1973), chapter 4.

    Example:
        >>> root_between(lambda x: x**2 - 2.0, 0.0, 2.0, 1e-12)  # doctest: +ELLIPSIS
        1.414213562373...
    """
    before, at_before, x, at_x = a, function(a), b, function(b)
    if at_before == 0.0 or at_x == 0.0:
        return before if at_before == 0.0 else x
    if (at_before > 0.0) == (at_x > 0.0):
        raise ValueError(f"no change of sign between {a:.6g} and {b:.6g}: {at_before:.3g} and {at_x:.3g}")
    # the root lies between x, the best point, and the other
    other, at_other = before, at_before
    step = last = x - before
    for _ in range(LARGEST):
        if (at_before > 0.0) != (at_x > 0.0):
            other, at_other = before, at_before
            step = last = x - before
        if abs(at_other) < abs(at_x):
            before, x, other = x, other, x
            at_before, at_x, at_other = at_x, at_other, at_x
        least = 0.5 * (tolerance + relative * abs(x))
        half = 0.5 * (other - x)
        if at_x == 0.0 or abs(half) < least:
            return x
        trial = _interpolated(before, x, other, at_before, at_x, at_other) if abs(at_x) < abs(at_before) else None
        if trial is not None and abs(last) > least and 2.0 * abs(trial) < min(abs(last), 3.0 * abs(half) - least):
            last, step = step, trial
        else:
            last = step = half
        before, at_before = x, at_x
        x += step if abs(step) > least else (least if half > 0.0 else -least)
        at_x = function(x)
    return x


def _interpolated(before: float, x: float, other: float, at_before: float, at_x: float, at_other: float) -> float:
    """Step from the best point by the secant, or by the inverse parabola where three points differ."""
    if before == other:
        return -at_x * (x - before) / (at_x - at_before)
    back, ahead = (at_before - at_x) / (before - x), (at_other - at_x) / (other - x)
    return -at_x * (at_other * ahead - at_before * back) / (ahead * back * (at_other - at_before))


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
        """See `vjm.continuation.events.WithLaws`."""
        return self._problem.law_states(point) if isinstance(self._problem, WithLaws) else []

    def law_rates(self, point: Equilibrium, along: Array) -> Array:
        """See `vjm.continuation.events.WithLaws`."""
        return self._problem.law_rates(point, along) if isinstance(self._problem, WithLaws) else np.zeros(0)


States = Callable[[Equilibrium], list[LawState]]
Rates = dict[Equilibrium, Array]


def with_law_changes(
    problem: Problem, load_case: LoadCase, points: Sequence[Equilibrium]
) -> tuple[list[Equilibrium], list[LawChange]]:
    """The points of a path with those at which springs pass from region to region, located as other events are.

    Args:
        problem: whose path it is.
        load_case: the ramp.
        points: in order.
    """
    if not isinstance(problem, WithLaws) or not points or not problem.law_states(points[0]):
        return list(points), []
    states = cache(problem.law_states)
    points = _with_turns(problem, points, states)
    changes, known = list[LawChange](), list(points)
    for a, b in pairwise(points):
        for i, (before, behind) in enumerate(zip(states(a), states(b), strict=True)):
            low, high = sorted((before.place, behind.place))
            for kink in range(low, high):

                def beyond(point: Equilibrium, i: int = i, threshold: float = before.law.kinks[kink]) -> float:
                    return problem.law_states(point)[i].deflection - threshold

                try:
                    crossing = locate(problem, a, b, beyond)
                except NoConvergenceError:
                    # no equilibrium between the two was found: it is seen at the second
                    crossing = b
                near = (p for p in known if abs(p.s - crossing.s) <= EVENT_TOLERANCE * abs(crossing.s))
                if (same := next(near, None)) is None:
                    known.append(crossing)
                crossing = same or crossing
                region = behind.words(kink + (behind.place > before.place))
                force = driven_force(load_case, crossing)
                changes.append(LawChange(before.what, before.name, region, crossing.s, force, crossing))
    return sorted(known, key=lambda point: point.s), sorted(changes, key=lambda change: change.s)


def _with_turns(problem: Problem, points: Sequence[Equilibrium], states: States) -> list[Equilibrium]:
    """The points of a path, and between two of them those at which a deflection turns back in another region.

    Such a kink is passed twice between the two. The cubic through a deflection's values and rates at both foresees
    where it turns. Its error falls with the fourth power of the step, and how far the turn goes beyond both points
    with its square. The turn is looked into where twice as far is beyond a kink.
    """
    path, waiting, rates = [points[0]], list(reversed(points[1:])), Rates()
    while waiting:
        a, b = path[-1], waiting[-1]
        turn = _turn_beyond_a_kink(problem, a, b, states, rates)
        if turn is not None and min(turn - a.s, b.s - turn) > EVENT_TOLERANCE * abs(b.s):
            try:
                waiting.append(problem.solve(turn, a, (b.state - a.state) / (b.s - a.s)))
                continue
            except NoConvergenceError:
                # it is not found there, and no more is said of it
                pass
        path.append(waiting.pop())
    return path


def _turn_beyond_a_kink(
    problem: Problem, a: Equilibrium, b: Equilibrium, states: States, rates: Rates
) -> float | None:
    """Path parameter between two points where a deflection is foreseen to turn, maybe in a region of neither.

    Rates of deflections that are known from other steps are not found again; those of the two points are added.
    """
    assert isinstance(problem, WithLaws)
    try:
        for point in (a, b):
            if point not in rates:
                rates[point] = problem.law_rates(point, b.state - a.state)
    except NoConvergenceError:
        # a critical point has no one direction
        return None
    h = b.s - a.s
    for i, (before, behind) in enumerate(zip(states(a), states(b), strict=True)):
        low, high = sorted((before.place, behind.place))
        u, v, p, q = before.deflection, behind.deflection, h * rates[a][i], h * rates[b][i]
        cubic = np.polynomial.Polynomial([u, p, 3.0 * (v - u) - 2.0 * p - q, 2.0 * (u - v) + p + q])
        for root in map(complex, cubic.deriv().roots()):
            if root.imag == 0.0 and 0.0 < root.real < 1.0:
                turn = float(cubic(root.real))
                beyond = turn - min((u, v), key=lambda end: abs(end - turn))
                if not low <= before.law.place(turn + beyond) <= high:
                    return a.s + h * root.real
    return None


Followed = TypeVar("Followed", bound=Problem)


class Tracer(ABC, Generic[Followed]):
    """The state while one path is traced."""

    def __init__(
        self, problem: Followed, load_case: LoadCase, progress: Callable[[float], None] | None = None
    ) -> None:  # fmt: skip
        self.problem, self.load_case, self.progress = problem, load_case, progress
        self.points: list[Equilibrium] = [problem.unloaded()]
        self.events: list[Event] = []
        self.branch_start = 0
        """Index of the first point on the present branch: no prolongation reaches across it."""

    @abstractmethod
    def march(self) -> str:
        """Trace the path; why it ended early, and nothing where it did not."""

    def run(self) -> Path:
        """The path, of a model that the engine names."""
        started = time.perf_counter()
        stopped = self.march()
        points, changes = with_law_changes(self.problem, self.load_case, self.points)
        return Path(
            engine=self.problem.label,
            model="",
            load_case=self.load_case,
            points=tuple(points),
            events=tuple(self.events),
            stations=self.problem.stations,
            stopped=stopped,
            seconds=time.perf_counter() - started,
            law_changes=tuple(changes),
        )


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
    change = _change_at_minimum(problem, row, _nearest, smallest)
    if change is not None or not _is_wide(row):
        return change
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
