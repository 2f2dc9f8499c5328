"""A machine with another value of a parameter at a state, and what the state then lacks to be an equilibrium."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TypeAlias

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

Solve: TypeAlias = Callable[[Array], tuple[Array, Array]]


def difference(function: Callable[[float], Array], h: float) -> Array:
    """Derivative at zero of what a function gives, by two central differences; zero for no step.

    Example:
        >>> float(difference(lambda x: np.array([x**3 + 2.0 * x]), 0.1)[0])
        2.0
    """
    if not h:
        return np.zeros_like(function(0.0))
    wide, narrow = ((function(s) - function(-s)) / (2.0 * s) for s in (h, 0.5 * h))
    return (4.0 * narrow - wide) / 3.0


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
    result: Array = state.springs_times(sprung[: state.n, None])[:, 0]
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


@dataclass(frozen=True)
class Directions:
    """Directions ``(n + r,)`` in which states near one of a machine move, scaled as its solver's answers are.

    Attributes:
        base: the state, of n coordinates, whose closures hold r independent rows.
    """

    base: LinearState

    @property
    def zero(self) -> Array:
        """No motion ``(n + r,)``."""
        return np.zeros(len(self.base.scale))

    def moved(self, x: Array, way: Array) -> Array:
        """The state moved along a direction; what the closures bear has the other sign in it."""
        step = self.base.scale * way
        return x + np.concatenate([step[: self.base.n], -self.base.combinations @ step[self.base.n :]])

    def scaled(self, forces: Array, missed: Array) -> Array:
        """What a state lacks ``(n + r,)``, from forces ``(n,)`` and what its closures miss ``(c,)``."""
        return self.base.scale * np.concatenate([forces, -self.base.combinations.T @ missed])

    def lacks(self, state: LinearState) -> Array:
        """What a state lacks to be an equilibrium ``(n + r,)``, scaled."""
        return self.scaled(residual_forces(state), gaps(state))

    def stiffness(self, W: Array, V: Array) -> Callable[[LinearState], Array]:
        """Mean ``(1,)`` of ``wᵀ B v`` over directions ``(n + r, k)``, of a state."""
        n, (w, v) = self.base.n, (self.base.scale[:, None] * each for each in (W, V))

        def mean(state: LinearState) -> Array:
            rows = state.rows(self.base.combinations)
            held = np.sum((rows @ w[:n]) * v[n:]) + np.sum(w[n:] * (rows @ v[:n]))
            return np.array([np.sum(w[:n] * state.tangent_times(v[:n])) + held]) / V.shape[1]

        return mean

    def followed(self, solve: Solve, missing: Callable[[Array], Array], first: Array) -> Array:
        """The direction in which a state stays an equilibrium while something changes.

        The tangent is the derivative of the forces along motions that keep loops closed. Where a change opens them,
        what is missing to an equilibrium along the direction that was found is asked for again.

        Args:
            solve: direction that brings about what is missing, and what of that the tangent does not reach.
            missing: what a direction leaves missing ``(n + r,)``.
            first: what no motion leaves missing.
        """
        base, way = self.base, solve(first)[0]
        for _ in range(CORRECTIONS if base.model.size > base.n and np.any(first[base.n :]) else 0):
            way = way + solve(missing(way))[0]
        return way


@dataclass(frozen=True)
class ByParameter:
    """Derivatives by a parameter at a state.

    Attributes:
        directions: of states near it.
        state: what is differentiated at.
        x: its vector, see `placed`.
        parameter: of its machine.
    """

    directions: Directions
    state: LinearState
    x: Array
    parameter: Parameter

    def along(self, of: Callable[[LinearState], Array], way: Array) -> Array:
        """Of something, the state moving along a direction ``(n + r,)`` per unit of the parameter."""
        value, moved = self.parameter.value, self.directions.moved
        return difference(
            lambda h: of(changed(self.state, self.parameter, value + h, moved(self.x, h * way))),
            STEP * self.parameter.scale,
        )

    def missing(self, way: Array) -> Array:
        """What the parameter leaves missing ``(n + r,)`` along a direction.

        Raises:
            ValueError: it opens closed loops that no motion closes.
        """
        both = self.along(lambda state: np.concatenate([residual_forces(state), gaps(state)]), way)
        forces, missed = both[: self.state.n], both[self.state.n :]
        refuse_incompatible(self.directions.base, self.parameter, missed)
        return self.directions.scaled(forces, missed)

    @cached_property
    def first(self) -> Array:
        """What it leaves missing where the state does not move."""
        return self.missing(self.directions.zero)

    def way(self, solve: Solve) -> Array:
        """Direction ``(n + r,)`` in which the state follows."""
        return self.directions.followed(solve, self.missing, self.first)


def state_rate(base: LinearState, parameter: Parameter) -> Array:
    """Derivative ``(size,)`` of a state that stays an equilibrium, by a parameter.

    Raises:
        ValueError: the parameter changes which springs the machine has, or opens its loops.
    """
    if parameter not in base.rates:
        directions = Directions(base)
        way = ByParameter(directions, base, base.x, parameter).way(base.solver.solve)
        base.rates[parameter] = directions.moved(np.zeros_like(base.x), way)
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
