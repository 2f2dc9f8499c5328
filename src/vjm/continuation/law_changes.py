"""Where along a path a spring passes from one region of its law to the next: a cable slackens, a stop is met."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol, runtime_checkable

from vjm.continuation.critical_points import EVENT_TOLERANCE, locate
from vjm.continuation.path import Equilibrium, Event, LawChange, Path, driven_force
from vjm.continuation.problem import Problem
from vjm.errors import NoConvergenceError
from vjm.model.law_states import LawState
from vjm.model.load_case import LoadCase


@runtime_checkable
class WithLaws(Protocol):
    """A problem that tells where the laws of its springs are."""

    def law_states(self, point: Equilibrium) -> list[LawState]:
        """All laws at a point of a path, always in the same order."""


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
    states = [problem.law_states(point) for point in points]
    found, known = list[LawChange](), list(points)
    for k, (a, b) in enumerate(pairwise(points)):
        for i, (before, behind) in enumerate(zip(states[k], states[k + 1], strict=True)):
            low, high = sorted((before.place, behind.place))
            for kink in range(low, high):

                def beyond(point: Equilibrium, i: int = i, at: float = before.law.kinks[kink]) -> float:
                    return problem.law_states(point)[i].deflection - at

                try:
                    there = locate(problem, a, b, beyond)
                except NoConvergenceError:
                    # no equilibrium between the two was found: it is seen at the second
                    there = b
                near = (p for p in known if abs(p.s - there.s) <= EVENT_TOLERANCE * abs(there.s))
                if (same := next(near, None)) is None:
                    known.append(there)
                there = same or there
                region = behind.words(kink + (behind.place > before.place))
                force = driven_force(load_case, there)
                found.append(LawChange(before.what, before.name, region, there.s, force, there))
    return sorted(known, key=lambda point: point.s), sorted(found, key=lambda change: change.s)


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
    points, changes = with_law_changes(problem, load_case, points)
    return Path(
        engine=problem.label,
        model="",
        load_case=load_case,
        points=tuple(points),
        events=tuple(events),
        stations=problem.stations,
        stopped=stopped,
        seconds=time.perf_counter() - started,
        law_changes=tuple(changes),
    )
