"""Where along a path a spring passes from one region of its law to the next: a cable slackens, a stop is met."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from vjm.continuation.critical_points import EVENT_TOLERANCE, locate
from vjm.continuation.path import Equilibrium, Event, LawChange, Path, driven_force
from vjm.continuation.problem import Problem, WithLaws
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase


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
    points = _with_turns(problem, points)
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


def _with_turns(problem: Problem, points: Sequence[Equilibrium]) -> list[Equilibrium]:
    """The points of a path, and between two of them those at which a deflection turns back in another region.

    Such a kink is passed twice between the two. The cubic through a deflection's values and rates at both foresees
    where it turns. Its error falls with the fourth power of the step, and how far the turn goes beyond both points
    with its square. The turn is looked into where twice as far is beyond a kink.
    """
    found, waiting = [points[0]], list(reversed(points[1:]))
    while waiting:
        a, b = found[-1], waiting[-1]
        turn = _turn_beyond_a_kink(problem, a, b)
        if turn is not None and min(turn - a.s, b.s - turn) > EVENT_TOLERANCE * abs(b.s):
            try:
                waiting.append(problem.solve(turn, a, (b.state - a.state) / (b.s - a.s)))
                continue
            except NoConvergenceError:
                # it is not found there, and no more is said of it
                pass
        found.append(waiting.pop())
    return found


def _turn_beyond_a_kink(problem: Problem, a: Equilibrium, b: Equilibrium) -> float | None:
    """Path parameter between two points where a deflection is foreseen to turn, maybe in a region of neither."""
    assert isinstance(problem, WithLaws)
    try:
        rates = [problem.law_rates(point, b.state - a.state) for point in (a, b)]
    except NoConvergenceError:
        # a critical point has no one direction
        return None
    h = b.s - a.s
    for i, (before, behind) in enumerate(zip(problem.law_states(a), problem.law_states(b), strict=True)):
        low, high = sorted((before.place, behind.place))
        u, v, p, q = before.deflection, behind.deflection, h * rates[0][i], h * rates[1][i]
        cubic = np.polynomial.Polynomial([u, p, 3.0 * (v - u) - 2.0 * p - q, 2.0 * (u - v) + p + q])
        for root in map(complex, cubic.deriv().roots()):
            if root.imag == 0.0 and 0.0 < root.real < 1.0:
                turn = float(cubic(root.real))
                beyond = turn - min((u, v), key=lambda end: abs(end - turn))
                if not low <= before.law.place(turn + beyond) <= high:
                    return a.s + h * root.real
    return None


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
