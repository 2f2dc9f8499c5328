"""Following the stable path of any engine: step control, critical points, change of branch.

An engine shows itself as a `Problem`: it finds the equilibrium at a given displacement, and the neighbouring
branch at a bifurcation. The rest is here, once for all engines.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.critical_points import WithoutPairs, bifurcation, locate, only_a_pair
from vjm.continuation.path import Equilibrium, Event, EventKind, Path, driven_force
from vjm.continuation.problem import Problem
from vjm.continuation.stability_dips import hidden_change, on_one_path
from vjm.errors import NoConvergenceError, UndecidedError
from vjm.model.load_case import LoadCase, PointControl
from vjm.rotations import Array

EVENT_TOLERANCE = 1e-9
"""Events are located to this fraction of the path's length; INTERFACES promise 1e-4 of the event's value."""
TIE = 1e-6
"""Events closer than this, relative, are one, which goes by the name of the first in `EventKind`'s order."""
NEARLY_LOST = 0.05
"""Stability eigenvalue, over its unloaded value, with which a path ends at a fold: it falls there as a square
root."""
POLE = 1e-3
"""Tangent stiffness where it is said to pass a level, over those at both sides: more is a jump from one infinity to
the other."""
TOGETHER = 1e-3
"""Share of the step behind a bifurcation within which other modes count as losing their stability with it."""
SMALL = 1e3
"""Steps of so many times the smallest may bend as they like, short of a jump."""
JUMPED = 0.9
"""Distance from the prolongation, over that from the last point, of a state that is no neighbour."""
SHRINKS = 0.6
"""Way to a refused state over that of a step twice as long: of a smooth path it is a half, beside a fold or a
bifurcation the root of that, of a jump one."""
SHRUNK = 4
"""So many in a row tell that the path is smooth, and that the last chord was no prolongation of it."""
JUMP = 1.0
"""Of a fixed step one that ends further from the prolongation than it is long is not believed."""


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


def finished_path(
    problem: Problem,
    load_case: LoadCase,
    points: Sequence[Equilibrium],
    events: Sequence[Event],
    stopped: str,
    started: float,
) -> Path:
    """What was traced as a path of a model that the engine names.

    Args:
        problem: whose path it is.
        load_case: the ramp.
        points: in order.
        events: in order.
        stopped: why it ended early; empty where it did not.
        started: reading of `time.perf_counter` at its beginning.
    """
    return Path(
        engine=problem.label,
        model="",
        load_case=load_case,
        points=tuple(points),
        events=tuple(events),
        stations=problem.stations,
        stopped=stopped,
        seconds=time.perf_counter() - started,
    )


class _Trace:
    """The state while one path is traced."""

    def __init__(
        self,
        problem: Problem,
        load_case: LoadCase,
        control: StepControl,
        progress: Callable[[float], None] | None,
    ) -> None:
        self.problem: Problem = problem
        self.load_case, self.control, self.progress = load_case, control, progress
        self.length = load_case.length
        self.points: list[Equilibrium] = [problem.unloaded()]
        self.events: list[Event] = []
        self.branch_start = 0
        """Index of the first point on the present branch: no prolongation reaches across it."""
        self.origin: Equilibrium | None = None
        """The bifurcation where the present branch begins."""

    def run(self) -> Path:
        started = time.perf_counter()
        stopped = self._march()
        self._add_neighbour_stiffness()
        return finished_path(self.problem, self.load_case, self.points, self.events, stopped, started)

    def _march(self) -> str:
        grid = None
        if self.load_case.steps is not None:
            grid = np.linspace(0.0, self.length, self.load_case.steps + 1)[1:]
        step = self.length if grid is not None else self.control.first * self.length
        refused, shrunk = 0.0, 0
        while self.points[-1].s < self.length * (1.0 - 1e-12):
            here = self.points[-1]
            if grid is not None:
                wanted = float(grid[np.searchsorted(grid, here.s * (1.0 + 1e-12) + 1e-300, side="right")])
                target = wanted if step >= wanted - here.s else here.s + step
            else:
                target = min(here.s + step, self.length)
                if self.length - target < 0.3 * step:
                    target = self.length
            try:
                there = self.problem.solve(target, here, self._slope(target))
            except NoConvergenceError as failure:
                step = 0.5 * (target - here.s)
                if step < self.control.smallest * self.length:
                    return f"no equilibrium found beyond {here.s:.6g}: {failure}{self._ahead(here)}"
                continue
            way = float(np.linalg.norm(there.shape - here.shape))
            shrunk = shrunk + 1 if way < SHRINKS * refused else 0
            bend = 0.0 if shrunk >= SHRUNK else self._bend(there)
            allowed = self.control.bend if grid is None else JUMP
            small = target - here.s <= SMALL * self.control.smallest * self.length
            jumps = bend > (max(allowed, JUMPED) if small else allowed)
            doubtful = bend > self.control.bend or self._nears_fold(there.s)
            if jumps or (doubtful and not there.unstable > 0 and not on_one_path(self.problem, here, there)):
                step = 0.5 * (target - here.s)
                refused = way
                if step < self.control.smallest * self.length:
                    return f"no equilibrium beyond {here.s:.6g} but one that is a jump away{self._ahead(here)}"
                continue
            if there.unstable == here.unstable:
                here, there = self._unhidden(here, there)
            if there.unstable > 0 and here.unstable <= 0:
                try:
                    critical = bifurcation(self.problem, here, there, EVENT_TOLERANCE * self.length)
                except UndecidedError as failure:
                    return f"whether stability is lost beyond {here.s:.6g} is undecided: {failure}"
                except NoConvergenceError as failure:
                    if only_a_pair(self.problem, here, there):
                        critical = None
                    else:
                        # the step led to another, unstable branch, which no bifurcation connects with this one
                        step = 0.25 * (target - here.s)
                        if step < self.control.smallest * self.length:
                            return f"stability is lost beyond {here.s:.6g} without a bifurcation: {failure}"
                        continue
                if critical is not None:
                    # the stiffness at the critical point itself is singular: look across it on the primary path
                    self._find_smooth_events(here, there, before=critical.s)
                    if self._turns(here, critical, there):
                        force = self._force(critical)
                        self.events.append(Event(EventKind.LIMIT, critical.s, force, point=critical))
                        return (
                            f"the load is greatest at {critical.s:.6g}, and stability is lost there, as the "
                            "controlled displacement is not held. Control the loaded point along its load, or 'arc'"
                        )
                    reason = self._leave_at(critical, self._multiplicity(here, critical, there))
                    if reason:
                        return reason
                    step = self.length if grid is not None else 2.0 * (self.points[-1].s - critical.s)
                    continue
                self.problem = WithoutPairs(self.problem, there.unstable)
                there = self.problem.counted(there)
            self._find_smooth_events(here, there)
            self.points.append(there)
            refused, shrunk = 0.0, 0
            if self.progress is not None:
                self.progress(there.s / self.length)
            done = target - here.s
            largest = self.length if grid is not None else self.control.largest * self.length
            step = min(largest, done * (2.0 if bend < 0.5 * self.control.bend else 1.2))
        return ""

    def _unhidden(self, here: Equilibrium, there: Equilibrium) -> tuple[Equilibrium, Equilibrium]:
        """The last point and the new one, or, where stability is lost and won back before, those at the loss."""
        row = [*self.points[self.branch_start :][-2:], there]
        smallest = self.control.smallest * self.length
        found = hidden_change(self.problem, row, self.points[0].eigenvalue, smallest)
        if found is None:
            return here, there
        before, lost = found
        try:
            bifurcation(self.problem, before, lost, EVENT_TOLERANCE * self.length)
        except UndecidedError:
            pass  # which is said where the path ends
        except NoConvergenceError:
            return here, there
        self.points = [p for p in self.points if p.s < before.s] + [before]
        self.events = [e for e in self.events if e.s <= before.s]
        return before, lost

    def _ahead(self, here: Equilibrium) -> str:
        """What a path that ends close to a critical point has before it."""
        if not abs(here.eigenvalue) < NEARLY_LOST * abs(self.points[0].eigenvalue):
            return ""
        return "; its stability is nearly lost: if the ramp turns back here, control 'arc' follows it"

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
        nodes, at = [self._along(p.s) for p in known], self._along(target)
        change = -known[-1].state
        for i, point in enumerate(known):
            weight = 1.0
            for k, node in enumerate(nodes):
                if k != i:
                    weight *= (at - node) / (nodes[i] - node)
            change += weight * point.state
        slope: Array = change / (target - known[-1].s)
        return slope

    def _bend(self, there: Equilibrium) -> float:
        """How far the new shape lies from the prolongation of the last two, over the way to it.

        Behind a bifurcation some of it goes with the root of the distance and some with the distance itself: the
        nearer prolongation counts.
        """
        known = self._known()[-2:]
        if len(known) < 2:
            return 0.0
        a, b = known
        way = float(np.linalg.norm(there.shape - b.shape)) + 1e-6 * self.length
        ratios = [(there.s - b.s) / (b.s - a.s)]
        if self.origin is not None:
            start, last, at = (self._along(p.s) for p in (a, b, there))
            ratios.append((at - last) / (last - start))
        missed = [there.shape - b.shape - (b.shape - a.shape) * ratio for ratio in ratios]
        return min(math.sqrt(np.vdot(distance, distance)) for distance in missed) / way

    def _nears_fold(self, s: float) -> bool:
        """Whether the smallest eigenvalue, which falls like a root before a fold, is to vanish before ``s``."""
        if len(self.points) - self.branch_start < 2:
            return False
        a, b = self.points[-2:]
        fallen = a.eigenvalue**2 - b.eigenvalue**2
        return b.eigenvalue**2 * (b.s - a.s) < fallen * (s - b.s)

    def _between(self, a: Equilibrium, b: Equilibrium, value: Callable[[Equilibrium], float]) -> Equilibrium:
        """The point between a and b, on their path, where a value that differs in sign there is zero."""
        return locate(self.problem, a, b, value, EVENT_TOLERANCE * self.length)

    def _force(self, p: Equilibrium) -> float:
        return driven_force(self.load_case, p)

    def _find_smooth_events(self, a: Equilibrium, b: Equilibrium, before: float = np.inf) -> None:
        """Locate limit points and the stiffness knee between two points of a path, as far as ``before``."""
        half = 0.5 * self.points[0].tangent
        wanted: list[tuple[EventKind, float]] = []
        if a.tangent > 0.0 >= b.tangent:
            wanted.append((EventKind.LIMIT, 0.0))
        if a.tangent > half >= b.tangent and half > 0.0 and not self.events:
            wanted.append((EventKind.STIFFNESS_KNEE, half))
        found = []
        for kind, level in wanted:
            point = self._between(a, b, lambda p, level=level: p.tangent - level)  # type: ignore[misc]
            if abs(point.tangent - level) > POLE * max(abs(a.tangent - level), abs(b.tangent - level)):
                continue
            found.append(Event(kind, point.s, self._force(point), point=point))
        # at a tie the bifurcation is the event, then the limit point
        found = [event for event in found if event.s < before * (1.0 - TIE)]
        self.events.extend(sorted(found, key=lambda event: event.s))

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

    def _turns(self, here: Equilibrium, critical: Equilibrium, there: Equilibrium) -> bool:
        """Whether stability is lost because the ramp of loads, which a gauge controls, turns back."""
        if not (isinstance(self.load_case.control, PointControl) and self.load_case.load_driven):
            return False
        if self.load_case.held_by_device or not here.tangent > 0.0:
            return False
        slope = (there.state - critical.state) / (there.s - critical.s)
        try:
            near = self.problem.solve(critical.s + TOGETHER * (there.s - critical.s), critical, slope)
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
            there = self.problem.switch(critical, behind, self.load_case.branch)
        except NoConvergenceError as failure:
            return f"bifurcation at {critical.s:.6g}, beyond which no stable branch was found: {failure}"
        if there.unstable != 0:
            return f"bifurcation at {critical.s:.6g}, but the branch that leads on is unstable"
        self.events[-1] = replace(event, switched=True)
        # the critical state belongs to both branches, and lies on neither side of stability
        self.points.append(there)
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
