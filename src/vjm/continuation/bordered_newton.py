"""Newton-Raphson on equilibrium and one condition more, for which the ramp is free: regular at critical points."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm.statics.equilibrium import TOLERANCE, Configuration

MAX_ITERATIONS = 30
DIVERGED = 1e6
"""Scaled residual from which Newton's method does not come back."""
NUDGE = 1e-9
"""Change of the ramp, over its end, that leaves a state which is singular to the last digit."""
STILL = 1e-13
"""Motion that controls a path, over the sum of its terms' sizes: rounding."""


class Border(NamedTuple):
    """A condition on the state beside equilibrium, linearised: ``row · δx + at_ramp δramp = missing``."""

    missing: float
    row: Array
    at_ramp: float


class Ramped(Protocol):
    """A loaded model under a ramp."""

    model: Mechanism
    load_case: LoadCase

    def target(self, ramp: float) -> Array:
        """Frame ``(4, 4)`` of the support at a ramp."""

    def load(self, ramp: float) -> float:
        """Factor on the ramped loads at a ramp."""

    def rate(self, at: Configuration) -> tuple[Array, Array]:
        """Derivatives of coordinates ``(n,)`` and wrench ``(6,)`` by the ramp."""


def solve_bordered(
    problem: Ramped,
    x: Array,
    wrench: Array,
    ramp: float,
    border: Callable[[Configuration, float], Border],
) -> tuple[float, Configuration]:
    """Equilibrium with one more condition, and the ramp that it takes.

    Two solutions with the factored tangent, for the residual and for the ramp, and a scalar equation for the ramp.

    Args:
        problem: the model under its ramp.
        x: coordinates ``(n,)`` to start from.
        wrench: ``(6,)`` to start from.
        ramp: to start from.
        border: the condition at a state and a ramp.

    Raises:
        NoConvergenceError: none was found.
    """
    compiled = problem.model.compiled
    error = before = np.inf
    for iteration in range(MAX_ITERATIONS):
        load = problem.load(ramp)
        statics, gap, error = compiled.residual(x, wrench, problem.target(ramp), load)
        at = Configuration(problem.model, x, wrench, error, iteration, load)
        if not error < DIVERGED:
            break
        try:
            missing, row, at_ramp = border(at, ramp)
            # a Newton iteration at least quarters the residual, at a double root too, until it is rounding
            ended = error < TOLERANCE or (0.5 * before <= error and compiled.rounded(x, statics, gap))
            if ended and abs(missing) < TOLERANCE:
                return ramp, at
            before = error
            dx, dF = compiled.response(x, wrench, statics, gap, load)
            dx_by, dF_by = problem.rate(at)
        except np.linalg.LinAlgError:
            ramp += NUDGE * problem.load_case.length
            continue
        moves = float(row @ dx_by + at_ramp)
        if abs(moves) <= STILL * float(np.abs(row) @ np.abs(dx_by) + abs(at_ramp)):
            raise NoConvergenceError(
                "the controlled displacement does not change along the path: control another point or direction"
            )
        change = float(missing - row @ dx) / moves
        x, wrench, ramp = x + dx + change * dx_by, wrench + dF + change * dF_by, ramp + change
    raise NoConvergenceError(f"Newton did not meet the path's condition (scaled residual {error:.1e})")
