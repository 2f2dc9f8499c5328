"""A machine with another value of a parameter at a state, and what the state then lacks to be an equilibrium."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from vjm.design.linear_state import LinearState, Question, loading
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.postures import in_posture_of
from vjm.rank import NEGLIGIBLE
from vjm.rotations import Array, displaced, displacement_between

STEP = 1e-3
"""Change of a parameter, over its scale, of the wider of two central differences: errors of its fourth power,
1e-12, and of rounding over it, 1e-13."""
CORRECTIONS = 2
"""Of a rate where a change opens loops: the first one closes them, the second one finds what the closures bear."""

KEPT = 64
"""Changed machines that are remembered: four for each of a dozen parameters, with some to spare."""


def difference(function: Callable[[float], Array], h: float) -> Array:
    """Derivative at zero of what a function gives, by two central differences; zero for no step.

    Example:
        >>> float(difference(lambda x: np.array([x**3 + 2.0 * x]), 0.1)[0])
        2.0
    """
    if not h:
        return np.zeros_like(function(0.0))
    wide, narrow = ((function(s) - function(-s)) / (2.0 * s) for s in (h, 0.5 * h))
    result: Array = (4.0 * narrow - wide) / 3.0
    return result


def response(
    missing: Callable[[Array], Array], solve: Callable[[Array], Array], coordinates: int, size: int
) -> Array:
    """The rate of a state that stays an equilibrium while something changes.

    The tangent is the derivative of the forces along motions that keep loops closed. Where a change opens them,
    what is missing to an equilibrium along the rate that was found is asked for again.

    Args:
        missing: forces and gaps ``(m,)`` that a rate leaves.
        solve: rate that brings forces and gaps about.
        coordinates: number of forces, before the gaps.
        size: of a rate.
    """
    first = missing(np.zeros(size))
    rate = solve(first)
    for _ in range(CORRECTIONS if np.any(first[coordinates:]) else 0):
        rate = rate + solve(missing(rate))
    return rate


def placed(asked: Question, x: Array, moved: Array | None = None) -> LinearState:
    """A machine at a state, in equilibrium or not.

    Args:
        asked: the machine, and what is done to it.
        x: ``(size,)``; where its end is held, the wrench ``(6,)`` that holds it stands behind.
        moved: ``(6,)`` displacement at which its end is held.
    """
    model = asked.model
    x0 = model.configuration(model.chain.posture(asked.posture))
    x, wrench = x[: model.size], np.zeros(6) if moved is None else x[model.size :]
    moved = np.full(6, np.nan) if moved is None else moved
    return LinearState(asked, model, x, wrench, loading(asked, model, x0), moved)


def changed(base: LinearState, parameter: Parameter, value: float, x: Array) -> LinearState:
    """The machine with another value of a parameter, at a state as `placed` takes it, held alike.

    Raises:
        ValueError: it has other springs or joints then.
    """
    asked = asked_with(base.question, parameter, value)
    if asked.model.size != base.model.size:
        raise ValueError(f"parameter '{parameter.name}' adds or takes away a spring: it has no derivative")
    return placed(asked, x, None if asked.displacement is None else base.moved)


@lru_cache(maxsize=KEPT)
def asked_with(asked: Question, parameter: Parameter, value: float) -> Question:
    """The question to the machine with another value of a parameter, which is made once for all quantities."""
    return replace(asked, machine=posed(asked, parameter, value))


def posed(asked: Question, parameter: Parameter, value: float) -> Machine:
    """The machine with another value of a parameter, with the posture that is asked for."""
    return in_posture_of(parameter.apply(asked.machine, value), asked.posture, asked.machine)


def residual_forces(state: LinearState) -> Array:
    """Generalised forces ``(n,)`` that a state lacks to be an equilibrium."""
    model, reactions = state.model, state.reactions
    sprung = model.strain(reactions) - state.x
    sprung[model.passive] = 0.0
    result: Array = state.spring_stiffness @ sprung[: state.n]
    result[model.passive] = reactions[model.passive]
    return result


def gaps(state: LinearState) -> Array:
    """What closures, couplings and a held end miss ``(c,)``, in the order of `LinearState.constraints`; mm, rad."""
    chain, residuals = state.model.chain, []
    sites = zip(chain.closures, state.model.closure_joints, state.model.closure_frames, strict=True)
    for closure, on, own in sites:
        first, second = (state.kinematics.behind[j + 1] @ T for j, T in zip(on, own, strict=True))
        residuals.append(displacement_between(first, second)[: closure.rows])
    for coupling in chain.couplings:
        terms = (weight * state.x[state.model.built.spans[joint].start] for joint, weight in coupling.terms)
        residuals.append(np.array([sum(terms) - coupling.total]))
    if state.question.displacement is not None:
        residuals.append(displacement_between(displaced(state.question.drawn_end, state.moved), state.end.end))
    return np.concatenate(residuals) if residuals else np.zeros(0)


def state_rate(base: LinearState, parameter: Parameter) -> Array:
    """Derivative ``(size,)`` of a state that stays an equilibrium, by a parameter.

    Raises:
        ValueError: the parameter changes which springs the machine has.
    """
    if parameter in base.rates:
        return base.rates[parameter]

    def missing(rate: Array) -> Array:
        def lacks(step: float) -> Array:
            moved = changed(base, parameter, parameter.value + step, base.x + step * rate)
            return np.concatenate([residual_forces(moved), -gaps(moved)])

        lacking = difference(lacks, STEP * parameter.scale)
        refuse_incompatible(base, parameter, -lacking[base.n :])
        return lacking

    base.rates[parameter] = response(missing, partial(_rate, base), base.n, len(base.x))
    return base.rates[parameter]


def refuse_incompatible(base: LinearState, parameter: Parameter, gaps: Array) -> None:
    """Refuse a parameter that opens closed loops which no motion closes.

    Args:
        base: a state of the machine.
        parameter: of it.
        gaps: derivative ``(c,)`` of what the closures miss by it.

    Raises:
        ValueError: naming the parameter.
    """
    if np.abs(base.incompatible(gaps[:, None])).max(initial=0.0) * parameter.scale > NEGLIGIBLE:
        raise ValueError(
            f"parameter '{parameter.name}' opens closed loops that hold some directions more than once: with "
            f"another value of it alone the machine cannot be assembled"
        )


def _rate(base: LinearState, right: Array) -> Array:
    """Change ``(size,)`` of the coordinates and the closures' wrenches, from the right side ``(size,)``."""
    n = base.n
    motion, held_by, _ = base.respond(base.solver, right[:n, None], right[n:, None])
    return np.concatenate([motion[:, 0], -held_by[:, 0]])
