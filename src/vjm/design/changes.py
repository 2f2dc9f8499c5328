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
from vjm.rotations import Array, displacement_between

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


def response(missing: Callable[[Array], Array], solve: Callable[[Array], Array], coordinates: int) -> Array:
    """The rate of a state that stays an equilibrium while something changes.

    The tangent is the derivative of the forces along motions that keep loops closed. Where a change opens them,
    what is missing to an equilibrium along the rate that was found is asked for again.

    Args:
        missing: forces and gaps ``(m,)`` that a rate leaves; of zero at first.
        solve: rate that brings forces and gaps about.
        coordinates: number of forces, before the gaps.
    """
    first = missing(np.zeros(0))
    rate = solve(first)
    for _ in range(CORRECTIONS if np.any(first[coordinates:]) else 0):
        rate = rate + solve(missing(rate))
    return rate


def placed(asked: Question, x: Array) -> LinearState:
    """A machine at a state ``(size,)``, in equilibrium or not."""
    x0 = asked.model.configuration(asked.model.chain.posture(asked.posture))
    return LinearState(asked, asked.model, x, np.zeros(6), loading(asked, asked.model, x0), np.full(6, np.nan))


def changed(base: LinearState, parameter: Parameter, value: float, x: Array) -> LinearState:
    """The machine with another value of a parameter, at a state ``(size,)``.

    Raises:
        ValueError: it has other springs or joints then.
    """
    asked = asked_with(base.question, parameter, value)
    if asked.model.size != base.model.size:
        raise ValueError(f"parameter '{parameter.name}' adds or takes away a spring: it has no derivative")
    return placed(asked, x)


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
    """What closures and couplings miss ``(c,)``, in the order of `LinearState.constraints`; mm and rad."""
    chain, residuals = state.model.chain, []
    sites = zip(chain.closures, state.model.closure_joints, state.model.closure_frames, strict=True)
    for closure, on, own in sites:
        first, second = (state.kinematics.behind[j + 1] @ T for j, T in zip(on, own, strict=True))
        residuals.append(displacement_between(first, second)[: closure.rows])
    for coupling in chain.couplings:
        terms = (weight * state.x[state.model.built.spans[joint].start] for joint, weight in coupling.terms)
        residuals.append(np.array([sum(terms) - coupling.total]))
    return np.concatenate(residuals) if residuals else np.zeros(0)


def state_rate(
    base: LinearState, parameter: Parameter, machine: Callable[[float, Array], LinearState] | None = None
) -> Array:
    """Derivative ``(size,)`` of a state that stays an equilibrium, by a parameter.

    Args:
        base: the equilibrium.
        parameter: of its machine.
        machine: the machine with the parameter's value changed by a step, at a state ``(size,)``; `changed` if left
            out.

    Raises:
        ValueError: the parameter changes which springs the machine has.
    """
    if machine is not None:
        return _state_rate(base, parameter, machine)
    if parameter not in base.rates:
        base.rates[parameter] = _state_rate(
            base, parameter, lambda step, x: changed(base, parameter, parameter.value + step, x)
        )
    return base.rates[parameter]


def _state_rate(base: LinearState, parameter: Parameter, machine: Callable[[float, Array], LinearState]) -> Array:
    h = STEP * parameter.scale

    def missing(rate: Array) -> Array:
        def lacks(step: float) -> Array:
            moved = machine(step, base.x + step * rate if len(rate) else base.x)
            return np.concatenate([residual_forces(moved), -gaps(moved)])

        lacking = difference(lacks, h)
        refuse_incompatible(base, parameter, -lacking[base.n :])
        return lacking

    return response(missing, partial(_rate, base), base.n)


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
