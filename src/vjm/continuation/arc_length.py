"""Following a path by the length of its arc: through limit points, folds, unstable stretches and back.

Each point lies on the plane across the tangent at the one before it, at the step's distance; the ramp is one more
unknown (Riks 1979, Crisfield 1981). The arc is measured in turns, in lengths over the chain's own, and in the ramp
over its end; forces do not count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vjm.continuation.events import (
    EVENT_TOLERANCE,
    VANISHED,
    Problem,
    Tracer,
    WithoutPairs,
    bifurcation,
    hidden_change,
    locate,
    only_a_pair,
)
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import Equilibrium, Event, EventKind, Path, driven_force
from vjm.errors import NoConvergenceError
from vjm.model.load_case import TO_LIMIT, LoadCase
from vjm.rotations import Array


class ArcProblem(Problem, Protocol):
    """What an engine must be able to do beside a `Problem` for its path to be followed by its arc.

    Where a load case is followed by its arc, the slope given to ``solve`` is the direction across which the plane
    lies.
    """

    def distance(self, change: Array) -> float:
        """Length of a change of state."""

    def enter(self, critical: Equilibrium, sign: int) -> Equilibrium:
        """A state a little way along the branch that crosses at a bifurcation, wherever it leads.

        Raises:
            NoConvergenceError: the branch was not found.
        """


class ArcWithoutPairs(WithoutPairs):
    """A problem followed by its arc, pairs left out, see `WithoutPairs`."""

    _problem: ArcProblem

    def distance(self, change: Array) -> float:
        """See `ArcProblem.distance`."""
        return self._problem.distance(change)

    def enter(self, critical: Equilibrium, sign: int) -> Equilibrium:
        """See `ArcProblem.enter`."""
        return self.counted(self._problem.enter(critical, sign))


@dataclass(frozen=True)
class ArcControl:
    """How far apart an arc's points lie.

    Attributes:
        first: first step.
        largest: largest step.
        smallest: step at which the path is given up.
        bend: distance of a point from the tangent at the one before it, over the step.
        points: number at which the path is given up.
        last: end at the first event of this kind.
        closed: distance between two turning points of the ramp that are one: of the shapes over their extent, and
            of the ramps over its end. Joints may have turned full circles in between.
    """

    first: float = 0.01
    largest: float = 0.05
    smallest: float = 1e-7
    bend: float = 0.05
    points: int = 5000
    last: EventKind | None = None
    closed: float = 1e-5


def trace(
    problem: ArcProblem,
    load_case: LoadCase,
    control: ArcControl = ArcControl(),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Follow a path by its ramp or, under step control, by its arc, as the load case says."""
    if load_case.by_arc:
        return follow_arc(problem, load_case, control, progress)
    return follow(problem, load_case, progress=progress)


def follow_arc(
    problem: ArcProblem,
    load_case: LoadCase,
    control: ArcControl = ArcControl(),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Trace a path by its arc until the ramp reaches its end.

    Folds of the ramp are limit points where loads are driven. Behind them the path goes on, unstable where it is,
    and each point says so. At a bifurcation of a stable path it goes on along the branch that the load case asks
    for, also where that leads backwards; other bifurcations are recorded and passed. A path that comes back to
    where it has been ends there and says so.

    Args:
        problem: the engine at work on a chain in a posture.
        load_case: the ramp.
        control: step control.
        progress: called with the fraction of the ramp that was reached.
    """
    return _ArcTrace(problem, load_case, control, progress).run()


class _ArcTrace(Tracer[ArcProblem]):
    """The state while one path is traced."""

    def __init__(
        self,
        problem: ArcProblem,
        load_case: LoadCase,
        control: ArcControl,
        progress: Callable[[float], None] | None,
    ) -> None:
        super().__init__(problem, load_case, progress)
        self.control = control
        self.seen = 0
        """Number of events before the present step."""
        self.forwards: Array | None = None
        """A change of state along the path, up to the last point."""
        self.turn = EventKind.LIMIT if load_case.load_driven else EventKind.FOLD
        """What the ramp does where it turns back."""

    def march(self) -> str:
        step, end = self.control.first, self.load_case.length
        why = ""
        while len(self.points) < self.control.points:
            last_point = self.points[-1]
            if step < self.control.smallest:
                return f"the path cannot be followed beyond the ramp {last_point.ramp:.6g}: {why}"
            try:
                slope = self.problem.tangent(last_point, self.forwards)
                next_point = self.problem.solve(last_point.s + step, last_point, slope)
                bend = self.problem.distance(next_point.state - last_point.state - step * slope) / step
                if bend > self.control.bend:
                    why, step = "it bends too sharply", 0.5 * step
                    continue
                ended = abs(next_point.ramp) > end
                if ended:
                    next_point = self._at_end(last_point, next_point, end)
                hidden = self._pass_hidden(last_point, next_point)
                if hidden is None:
                    entered = self._pass(last_point, next_point, slope)
                else:
                    last_point, next_point, entered = hidden
                    ended, bend, step = False, self.control.bend, next_point.s - last_point.s
                if isinstance(self.problem, ArcWithoutPairs):
                    next_point = self.problem.counted(next_point)
            except NoConvergenceError as failure:
                why, step = str(failure), 0.5 * step
                continue
            if self.control.last is not None and any(e.kind is self.control.last for e in self.events):
                return ""
            if (turned := self._turned()) is not None:
                again = self._been_at(turned)
                if again is not None:
                    self.events.pop()
                    return f"the path is closed: it comes back to the {again.kind} at the ramp {turned.ramp:.6g}"
                if self.load_case.control == TO_LIMIT:
                    self.points.append(turned)
                    return ""
            self.seen = len(self.events)
            if entered is not None:
                crossed = self.events[-1].point
                assert crossed is not None  # it was entered from there
                self.forwards = entered.state - crossed.state
                self.points.append(entered)
                self.branch_start = len(self.points) - 1
                if abs(entered.ramp) >= end:
                    return ""
                step = min(self.control.first, 10.0 * (entered.s - self.events[-1].s))
                continue
            self.forwards = next_point.state - last_point.state
            self.points.append(next_point)
            if self.progress is not None:
                self.progress(min(1.0, abs(next_point.ramp) / end))
            if ended:
                back = f"the path leads back to {next_point.ramp:.6g}, beyond the ramp's beginning"
                return "" if next_point.ramp > 0.0 else back
            step = min(self.control.largest, step * (1.5 if bend < 0.3 * self.control.bend else 1.0))
        return (
            f"the ramp had not reached its end after {len(self.points)} points: it is at {self.points[-1].ramp:.6g}"
        )

    def _turned(self) -> Equilibrium | None:
        """Where the ramp turned back in the last step."""
        new = self.events[self.seen :]
        return new[-1].point if new and new[-1].kind is self.turn else None

    def _been_at(self, point: Equilibrium) -> Event | None:
        """An earlier turning point or bifurcation that is the path's last one."""
        extent = float(np.ptp(point.shape, axis=0).max())
        for event in self.events[:-1]:
            if event.kind in (self.turn, EventKind.BIFURCATION) and event.point is not None:
                # of a machine with one station the extent is zero: it is there where that is
                apart = float(np.abs(point.shape - event.point.shape).max())
                risen = abs(point.ramp - event.point.ramp) / self.load_case.length
                if apart <= self.control.closed * extent and risen < self.control.closed:
                    return event
        return None

    def _at_end(self, last_point: Equilibrium, next_point: Equilibrium, end: float) -> Equilibrium:
        side = 1.0 if next_point.ramp > 0.0 else -1.0
        return locate(self.problem, last_point, next_point, lambda p: p.ramp - side * end)

    def _pass_hidden(
        self, last_point: Equilibrium, next_point: Equilibrium
    ) -> tuple[Equilibrium, Equilibrium, Equilibrium | None] | None:
        """Go back to where the stability changes and changes back between the last points, and pass that.

        Returns:
            The points before and behind the change, and what `_pass` returns; None where nothing is hidden.
        """
        row = [*self.points[self.branch_start :][-2:], next_point]
        change = hidden_change(self.problem, row, self.points[0].eigenvalue, self.control.smallest)
        if change is None:
            return None
        before, behind = change
        slope = (behind.state - before.state) / (behind.s - before.s)
        points, events, seen = self.points, self.events, self.seen
        self.points = [p for p in points if p.s < before.s] + [before]
        self.events = [e for e in events if e.s <= before.s]
        self.seen = len(self.events)
        try:
            return before, behind, self._pass(before, behind, self.problem.tangent(before, slope))
        except NoConvergenceError:
            self.points, self.events, self.seen = points, events, seen
            return None

    def _pass(self, last_point: Equilibrium, next_point: Equilibrium, slope: Array) -> Equilibrium | None:
        """Locate what happens between two points; a state on another branch where the path changes to it.

        Raises:
            NoConvergenceError: two things happen at once, or one of them was not located.
        """
        grows = self.problem.tangent(next_point, next_point.state - last_point.state)[-1] > 0.0
        folds, change = (slope[-1] > 0.0) != grows, next_point.unstable - last_point.unstable
        if folds and abs(change) > 1:
            raise NoConvergenceError("a limit point and a bifurcation are too close to be distinguished")
        if folds:
            self._record(self.turn, self._fold(last_point, next_point))
            return None
        if change:
            return self._bifurcate(last_point, next_point)
        self._smooth(last_point, next_point)
        return None

    def _fold(self, last_point: Equilibrium, next_point: Equilibrium) -> Equilibrium:
        chord = next_point.state - last_point.state

        def growth(point: Equilibrium) -> float:
            try:
                return float(self.problem.tangent(point, chord)[-1])
            except NoConvergenceError:
                # singular to the last digit: the fold itself
                return 0.0

        return locate(self.problem, last_point, next_point, growth)

    def _bifurcate(self, last_point: Equilibrium, next_point: Equilibrium) -> Equilibrium | None:
        first = last_point.unstable == 0
        try:
            critical = (
                bifurcation(self.problem, last_point, next_point)
                if first
                else self._change_of_count(last_point, next_point)
            )
        except NoConvergenceError:
            if not only_a_pair(self.problem, last_point, next_point):
                raise
            if next_point.unstable > last_point.unstable:
                self.problem = ArcWithoutPairs(self.problem, next_point.unstable - last_point.unstable)
            return None
        self._smooth(last_point, next_point, before=critical.s)
        entered = self.problem.enter(critical, self.load_case.branch) if first and self.load_case.branch else None
        self._record(
            EventKind.BIFURCATION,
            critical,
            abs(next_point.unstable - last_point.unstable),
            switched=entered is not None,
        )
        return entered

    def _change_of_count(self, a: Equilibrium, b: Equilibrium) -> Equilibrium:
        """The point between two where the number of unstable modes changes, by bisection.

        Raises:
            NoConvergenceError: the eigenvalue that changes its sign there does not pass zero.
        """
        sides = max(abs(a.eigenvalue), abs(b.eigenvalue))
        slope = (b.state - a.state) / (b.s - a.s)
        while b.s - a.s > EVENT_TOLERANCE * b.s:
            middle = self.problem.solve(0.5 * (a.s + b.s), a, slope)
            a, b = (middle, b) if middle.unstable == a.unstable else (a, middle)
        if not self.problem.conservative and abs(b.eigenvalue) > VANISHED * sides:
            raise NoConvergenceError("the smallest eigenvalue jumps")
        return b

    def _smooth(self, last_point: Equilibrium, next_point: Equilibrium, before: float = float("inf")) -> None:
        """Limit points and the stiffness knee of a driven displacement's force."""
        if self.load_case.load_driven:
            return
        half = 0.5 * self.points[0].tangent
        levels = [(EventKind.LIMIT, 0.0)] + ([] if self.events else [(EventKind.STIFFNESS_KNEE, half)])
        for kind, level in levels:
            if last_point.tangent > level >= next_point.tangent:
                value = _tangent_above(level)
                point = locate(self.problem, last_point, next_point, value)
                if point.s < before:
                    self._record(kind, point)

    def _record(
        self, kind: EventKind, point: Equilibrium, multiplicity: int = 1, *, switched: bool = False
    ) -> None:
        force = driven_force(self.load_case, point)
        self.events.append(Event(kind, point.s, force, multiplicity=multiplicity, point=point, switched=switched))


def _tangent_above(level: float) -> Callable[[Equilibrium], float]:
    return lambda point: point.tangent - level
