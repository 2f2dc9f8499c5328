"""Following the stable path of any engine: step control, critical points, change of branch.

An engine shows itself as a `Problem`: it finds the equilibrium at a given displacement, and the neighbouring
branch at a bifurcation. The rest is here, once for all engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, runtime_checkable

import numpy as np

from vjm.continuation.events import (
    NEUTRAL,
    WIDE,
    Problem,
    Tracer,
    WithoutPairs,
    bifurcation,
    hidden_change,
    locate,
    on_one_path,
    only_a_pair,
)
from vjm.continuation.one_path import END, HALF, MEAN, NOTHING, SLIGHT, OnePath, Rates
from vjm.continuation.path import Equilibrium, Event, EventKind, Path, driven_force
from vjm.errors import NoConvergenceError, UndecidedError
from vjm.kernels.entry_points import ROWS, Limits
from vjm.model.load_case import LoadCase, PointControl
from vjm.rank import NEGLIGIBLE
from vjm.rotations import Array
from vjm.statics import MAX_ITERATIONS, TOLERANCE

TIE = 1e-6
"""Events closer than this, relative, are one, which goes by the name of the first in `EventKind`'s order."""
POLE = 1e-3
"""Tangent stiffness where it is said to pass a level, over those at both sides: more is a jump from one infinity to
the other."""
TOGETHER = 1e-3
"""Share of the step behind a bifurcation within which other modes count as losing their stability with it."""
SMALL = 1e3
"""Steps of so many times the smallest may bend as they like. Where none of them leads on, the arc tells why."""


@runtime_checkable
class Marching(Protocol):
    """An engine that takes the steps of a path that leave nothing to look into by itself, in compiled code."""

    def plain_steps(
        self, known: Sequence[Equilibrium], limits: Limits, origin: float, step: float
    ) -> tuple[list[Equilibrium], float]:
        """Points behind the last three, or as many as there are, and the next step.

        Args:
            known: the last points; behind a bifurcation, that is the first of the branch's.
            limits: of the steps.
            origin: path parameter of that bifurcation; −inf where there is none.
            step: to begin with.
        """


@dataclass(frozen=True)
class StepControl:
    """How far apart an adaptive path's points lie.

    Attributes:
        first: first step over the path's length.
        largest: largest step over the path's length.
        smallest: step at which the path is given up, over its length.
        bend: how far a point may lie from the prolongation of the last two, over their distance.
        behind: distance from a bifurcation to the first point on the new branch, over the bifurcation's s.
    """

    first: float = 0.005
    largest: float = 0.02
    smallest: float = 1e-6
    bend: float = 0.25
    behind: float = 2e-4


def follow(
    problem: Problem,
    load_case: LoadCase,
    control: StepControl = StepControl(),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Trace the stable path from the unloaded state.

    Bifurcations are located on the primary path, where the smallest eigenvalue passes zero, and left on the
    branch that the load case asks for; limit points and stiffness knees are located between stable points. A path
    that cannot go on ends there and says why; what was found is kept.

    Args:
        problem: the engine at work on a chain in a posture.
        load_case: the ramp.
        control: step control, for a load case without fixed steps.
        progress: called with the fraction done.
    """
    return _Trace(problem, load_case, control, progress).run()


class _Trace(Tracer[Problem]):
    """The state while one path is traced."""

    def __init__(
        self,
        problem: Problem,
        load_case: LoadCase,
        control: StepControl,
        progress: Callable[[float], None] | None,
    ) -> None:
        super().__init__(problem, load_case, progress)
        self.control, self.length = control, load_case.length
        self.origin: Equilibrium | None = None
        """The bifurcation where the present branch begins."""
        self._rates = Rates()
        self._given_up: Equilibrium | None = None
        """The last point from which the arc was tried."""

    def march(self) -> str:
        stopped = self._march()
        self._add_neighbour_stiffness()
        return stopped

    def _march(self) -> str:
        grid = None
        if self.load_case.steps is not None:
            grid = np.linspace(0.0, self.length, self.load_case.steps + 1)[1:]
        step = self.length if grid is not None else self.control.first * self.length
        small = SMALL * self.control.smallest * self.length
        ahead: list[Equilibrium] = []
        turn: Equilibrium | None = None
        while not self._ended:
            if grid is None and not ahead and turn is None:
                step = self._plain_steps(step)
                if self._ended:
                    break
            last_point = self.points[-1]
            if turn is not None and not ahead:
                return self._turned(last_point, turn)
            if not ahead:
                if grid is not None:
                    wanted = float(grid[np.searchsorted(grid, last_point.s * (1.0 + 1e-12) + 1e-300, side="right")])
                    target = wanted if step >= wanted - last_point.s else last_point.s + step
                else:
                    target = min(last_point.s + step, self.length)
                    if self.length - target < 0.3 * step:
                        target = self.length
                try:
                    ahead, turn = self._ahead(last_point, target, small, fixed=grid is not None)
                except NoConvergenceError as failure:
                    step = 0.5 * (target - last_point.s)
                    if step < self.control.smallest * self.length:
                        return f"no equilibrium found beyond {last_point.s:.6g}: {failure}"
                    continue
                if not ahead:
                    continue
            next_point = ahead.pop(0)
            bend = self._bend(next_point)
            if next_point.unstable == last_point.unstable:
                last_point, next_point = self._unhidden(last_point, next_point)
            if next_point.unstable > 0 and last_point.unstable <= 0:
                ahead, turn = [], None
                try:
                    critical = bifurcation(self.problem, last_point, next_point)
                except UndecidedError as failure:
                    return f"whether stability is lost beyond {last_point.s:.6g} is undecided: {failure}"
                except NoConvergenceError as failure:
                    if only_a_pair(self.problem, last_point, next_point):
                        critical = None
                    else:
                        # the step led to another, unstable branch, which no bifurcation connects with this one
                        step = 0.25 * (next_point.s - last_point.s)
                        if step < self.control.smallest * self.length:
                            return f"stability is lost beyond {last_point.s:.6g} without a bifurcation: {failure}"
                        continue
                if critical is not None:
                    # the stiffness at the critical point itself is singular: look across it on the primary path
                    self._find_smooth_events(last_point, next_point, before=critical.s)
                    if self._turns(last_point, critical, next_point):
                        force = self._force(critical)
                        self.events.append(Event(EventKind.LIMIT, critical.s, force, point=critical))
                        return (
                            f"the load is greatest at {critical.s:.6g}, and stability is lost there, as the "
                            "controlled displacement is not held. Control the loaded point along its load, or 'arc'"
                        )
                    reason = self._leave_at(critical, self._multiplicity(last_point, critical, next_point))
                    if reason:
                        return reason
                    step = self.length if grid is not None else 2.0 * (self.points[-1].s - critical.s)
                    continue
                self.problem = WithoutPairs(self.problem, next_point.unstable)
                next_point = self.problem.counted(next_point)
            self._find_smooth_events(last_point, next_point)
            self.points.append(next_point)
            if self.progress is not None:
                self.progress(next_point.s / self.length)
            largest = self.length if grid is not None else self.control.largest * self.length
            step = min(largest, (next_point.s - last_point.s) * (2.0 if bend < 0.5 * self.control.bend else 1.2))
        return ""

    @property
    def _ended(self) -> bool:
        return not self.points[-1].s < self.length * (1.0 - 1e-12)

    def _plain_steps(self, step: float) -> float:
        """Take the steps that an engine takes by itself; the next one."""
        if not isinstance(self.problem, Marching) or self.points[-1].unstable != 0:
            return step
        half, still = 0.5 * self.points[0].tangent, NEUTRAL * abs(self.points[0].eigenvalue)
        limits = Limits(
            self.length, self.control.largest * self.length, SMALL * self.control.smallest * self.length,
            self.control.bend, HALF, END, MEAN, NOTHING, SLIGHT, NEGLIGIBLE, still, WIDE,
            half if half > 0.0 and not self.events else -np.inf, TOLERANCE, MAX_ITERATIONS,
        )  # fmt: skip
        origin = -np.inf if self.origin is None else self.origin.s
        while not self._ended:
            known = self._known()
            points, step = self.problem.plain_steps(known, limits, origin, step)
            self.points += points
            if points and self.progress is not None:
                self.progress(points[-1].s / self.length)
            if len(known) + len(points) < ROWS:
                # with room for more points: the next step is not plain
                break
        return step

    def _ahead(
        self, last_point: Equilibrium, target: float, small: float, *, fixed: bool
    ) -> tuple[list[Equilibrium], Equilibrium | None]:
        """The path from its last point as far as a target, or to where the ramp turns back before.

        Raises:
            NoConvergenceError: it is to be tried with a shorter step.
        """
        path = OnePath(self.problem, self._rates)
        slope = self._slope(target)
        try:
            next_point = self.problem.solve(target, last_point, slope)
        except NoConvergenceError:
            if target - last_point.s > small or self._given_up is last_point:
                raise
            self._given_up = last_point
            return path.arc(last_point, target, path.way(last_point, target))
        bend = self._bend(next_point)
        if bend > self.control.bend and not fixed and target - last_point.s > small:
            raise NoConvergenceError("the path bends too sharply")
        still = NEUTRAL * abs(self.points[0].eigenvalue)
        if next_point.unstable >= 0 and min(abs(last_point.eigenvalue), abs(next_point.eigenvalue)) > still:
            try:
                return path.passage(last_point, next_point, by_root=self.origin is not None)
            except NoConvergenceError:
                if len(self._known()) < 2:
                    raise
        # where a motion costs next to nothing, tangents and arcs go along it
        if not on_one_path(self.problem, last_point, next_point):
            raise NoConvergenceError("no equilibrium is near but one that is a jump away")
        return [next_point], None

    def _turned(self, last_point: Equilibrium, turn: Equilibrium) -> str:
        """Record where the ramp turns back, and say so."""
        if turn.s > last_point.s:
            self._find_smooth_events(last_point, turn, before=turn.s)
        loads = self.load_case.load_driven and not isinstance(self.load_case.control, PointControl)
        kind = EventKind.LIMIT if loads else EventKind.FOLD
        self.events.append(Event(kind, turn.s, self._force(turn), point=turn))
        what = "the load is greatest" if loads else "the controlled displacement turns back"
        return (
            f"{what} at {turn.s:.6g}: beyond it the machine snaps to a state that no path leads to. Control 'arc' "
            "follows the path"
        )

    def _unhidden(self, last_point: Equilibrium, next_point: Equilibrium) -> tuple[Equilibrium, Equilibrium]:
        """The last point and the new one, or, where stability is lost and won back before, those at the loss."""
        row = [*self.points[self.branch_start :][-2:], next_point]
        smallest = self.control.smallest * self.length
        change = hidden_change(self.problem, row, self.points[0].eigenvalue, smallest)
        if change is None:
            return last_point, next_point
        before, lost = change
        try:
            bifurcation(self.problem, before, lost)
        except UndecidedError:
            pass  # which is said where the path ends
        except NoConvergenceError:
            return last_point, next_point
        self.points = [p for p in self.points if p.s < before.s] + [before]
        self.events = [e for e in self.events if e.s <= before.s]
        return before, lost

    def _known(self) -> list[Equilibrium]:
        """The last points of the present branch, at most three; the bifurcation where it begins is one of them."""
        own = self.points[self.branch_start :][-3:]
        return own if self.origin is None else [self.origin, *own][-3:]

    def _along(self, s: float) -> float:
        """What states are smooth in: the path parameter; behind a bifurcation the root of the distance from it."""
        return s if self.origin is None else math.sqrt(s - self.origin.s)

    def _slope(self, target: float) -> Array | None:
        """Of the chord from the last point to where the parabola through the last three is at the target."""
        known = self._known()
        if len(known) < 2:
            return None
        nodes, target_node = [self._along(p.s) for p in known], self._along(target)
        change = -known[-1].state
        for i, point in enumerate(known):
            weight = 1.0
            for k, node in enumerate(nodes):
                if k != i:
                    weight *= (target_node - node) / (nodes[i] - node)
            change += weight * point.state
        return change / (target - known[-1].s)

    def _bend(self, next_point: Equilibrium) -> float:
        """How far the new shape lies from the prolongation of the last two, over the way to it.

        Behind a bifurcation some of it goes with the root of the distance and some with the distance itself: the
        nearer prolongation counts.
        """
        known = self._known()[-2:]
        if len(known) < 2:
            return 0.0
        a, b = known
        way = float(np.linalg.norm(next_point.shape - b.shape)) + 1e-6 * self.length
        ratios = [(next_point.s - b.s) / (b.s - a.s)]
        if self.origin is not None:
            start, last, newest = (self._along(p.s) for p in (a, b, next_point))
            ratios.append((newest - last) / (last - start))
        missed = [next_point.shape - b.shape - (b.shape - a.shape) * ratio for ratio in ratios]
        return min(math.sqrt(np.vdot(distance, distance)) for distance in missed) / way

    def _force(self, p: Equilibrium) -> float:
        return driven_force(self.load_case, p)

    def _find_smooth_events(self, a: Equilibrium, b: Equilibrium, before: float = np.inf) -> None:
        """Locate limit points and the stiffness knee between two points of a path, as far as ``before``."""
        half = 0.5 * self.points[0].tangent
        wanted: list[tuple[EventKind, float]] = []
        # stable under dead loads, a machine yields to them: a stiffness below zero is rounding of one that does not
        dead = self.load_case.load_driven and self.problem.conservative
        if a.tangent > 0.0 >= b.tangent and not (dead and not isinstance(self.load_case.control, PointControl)):
            wanted.append((EventKind.LIMIT, 0.0))
        if a.tangent > half >= b.tangent and half > 0.0 and not self.events:
            wanted.append((EventKind.STIFFNESS_KNEE, half))
        events = []
        for kind, level in wanted:
            value = partial(_above, level)
            point = locate(self.problem, a, b, value)
            if abs(point.tangent - level) > POLE * max(abs(a.tangent - level), abs(b.tangent - level)):
                continue
            events.append(Event(kind, point.s, self._force(point), point=point))
        # at a tie the bifurcation is the event, then the limit point
        events = [event for event in events if event.s < before * (1.0 - TIE)]
        self.events.extend(sorted(events, key=lambda event: event.s))

    def _multiplicity(self, before: Equilibrium, critical: Equilibrium, behind: Equilibrium) -> int:
        """How many modes lose their stability together: not those that a large step passes later."""
        if behind.unstable - max(before.unstable, 0) > 1:
            near = critical.s + TOGETHER * (behind.s - critical.s)
            try:
                behind = self.problem.solve(
                    near, critical, (behind.state - critical.state) / (behind.s - critical.s)
                )
            except NoConvergenceError:
                return 1
        return max(behind.unstable - max(before.unstable, 0), 1)

    def _turns(self, last_point: Equilibrium, critical: Equilibrium, next_point: Equilibrium) -> bool:
        """Whether stability is lost because the ramp of loads, which a gauge controls, turns back."""
        if not (isinstance(self.load_case.control, PointControl) and self.load_case.load_driven):
            return False
        if self.load_case.held_by_device or not last_point.tangent > 0.0:
            return False
        slope = (next_point.state - critical.state) / (next_point.s - critical.s)
        try:
            near = self.problem.solve(critical.s + TOGETHER * (next_point.s - critical.s), critical, slope)
        except NoConvergenceError:
            return False
        return near.tangent < 0.0

    def _leave_at(self, critical: Equilibrium, multiplicity: int) -> str:
        """Record a bifurcation and go on along the branch that crosses there; returns why not, if not."""
        event = Event(
            EventKind.BIFURCATION, critical.s, self._force(critical), multiplicity=multiplicity, point=critical
        )
        self.events.append(event)
        behind = min(critical.s * (1.0 + self.control.behind), self.length)
        try:
            point = self.problem.switch(critical, behind, self.load_case.branch)
        except NoConvergenceError as failure:
            return f"bifurcation at {critical.s:.6g}, beyond which no stable branch was found: {failure}"
        if point.unstable != 0:
            return f"bifurcation at {critical.s:.6g}, but the branch that leads on is unstable"
        self.events[-1] = replace(event, switched=True)
        # the critical state belongs to both branches, and lies on neither side of stability
        self.points.append(point)
        self.branch_start, self.origin = len(self.points) - 1, critical
        return ""

    def _add_neighbour_stiffness(self) -> None:
        """Fill in the tangents at 0.99 and 1.01 of each bifurcation's and limit's displacement."""
        for i, event in enumerate(self.events):
            if event.kind is EventKind.STIFFNESS_KNEE:
                continue
            self.events[i] = replace(
                event,
                stiffness_before=self._tangent_at(0.99 * event.s, below=event.s),
                stiffness_after=self._tangent_at(1.01 * event.s, above=event.s),
            )

    def _tangent_at(self, s: float, *, below: float = np.inf, above: float = 0.0) -> float | None:
        near = [p for p in self.points if above < p.s < below or (above == 0.0 and p.s < below)]
        if not near or s > self.points[-1].s * (1.0 + 1e-12):
            return None
        start = min(near, key=lambda p: abs(p.s - s))
        try:
            point = self.problem.solve(s, start, None)
        except NoConvergenceError:
            return None
        return point.tangent if point.unstable <= 0 else None


def _above(level: float, point: Equilibrium) -> float:
    return point.tangent - level
