"""How a path begins that the displacement of a point controls."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vjm.continuation.bordered_newton import STILL
from vjm.errors import NoConvergenceError
from vjm.rotations import Array

TRIALS = 40
"""Ramps that are tried: each halves or doubles the one before."""


def begun(
    s: float,
    rate: Array,
    row: Array,
    at_ramp: Callable[[float], Array],
    gone: Callable[[Array], float],
    otherwise: Array,
) -> Array:
    """A state near the first ``s``, on the side of the beginning to which the path leads.

    Where the displacement soon goes with the square of the ramp, both signs of the ramp bring as much of it, and
    Newton's method controlled by the displacement may take either.

    Args:
        s: displacement of the point that is wanted, mm.
        rate: derivative ``(f,)`` of the free coordinates by the ramp where the path begins.
        row: derivative ``(f,)`` of the displacement by the free coordinates there.
        at_ramp: the equilibrium at a ramp; it may raise `NoConvergenceError`.
        gone: displacement of the point at a state.
        otherwise: what to begin with where no ramp brings half to twice the displacement.

    Raises:
        NoConvergenceError: the point does not move with the ramp.
    """
    moves = float(row @ rate)
    if abs(moves) <= STILL * float(np.abs(row) @ np.abs(rate)):
        raise NoConvergenceError(
            "the controlled displacement does not change along the path: control another point or direction"
        )
    ramp = s / moves
    for _ in range(TRIALS):
        try:
            state = at_ramp(ramp)
        except NoConvergenceError:
            ramp *= 0.5
            continue
        share = gone(state) / s
        if 0.5 <= share <= 2.0:
            return state
        ramp *= 2.0 if 0.0 < share < 0.5 else 0.5
    return otherwise
