"""Damped least squares within bounds, for many starts at once (Levenberg and Marquardt's method).

A step that does not make the residual smaller is not taken: the damping grows until one does. It shrinks with the
square of the residual, so that near a solution the steps are Newton's (Yamashita and Fukushima, "On the rate of
convergence of the Levenberg-Marquardt method", 2001). At a singular solution, such as an arm that is stretched out,
these go half the way only: there every other one is doubled (Griewank, "On solving nonlinear equations with simple
singularities or nearly singular solutions", 1985).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vjm.rotations import Array

ITERATIONS = 100
STEP = 1e-6
"""Of a coordinate's unit: of the differences that make the Jacobian, good to 1e-10."""
LARGEST_MOVE = 0.4
"""Of a unit, in one iteration: within it a rotation's sine and its angle are alike."""
SETTLED = 1e-14
"""Residual that is rounding."""
DAMPING, SOFTER, HARDER = 1e-3, 0.1, 30.0
"""Times the square of the residual; and its factors after a step that was taken, and one that was not."""
FLOOR = 1e-7
"""Of the largest singular value, and at least of one: smaller ones are rounding, a thousand times what differences
of J are good to, and lead nowhere."""
DOUBLE, LIKE = 0.25, 0.05
"""What Newton's step leaves of the residual at a double root, within what: each step goes half the way there."""
REFUSED = 12
"""Steps in a row that were not taken, after which a start rests: the damping is 1e17 times as large then."""
CLOSE = 1e-8
"""Residual below which steps are doubled: of two roots apart by more than 1e-4, its square root, none is passed."""
IDLE = 1e-9
"""Share of the residual that a step takes away, below which a start rests: there it is least, and not zero."""

Residual = Callable[[Array, np.ndarray], Array]
"""Of rows ``(s, n)`` and the numbers ``(s,)`` of their starts: ``(s, m)``, nan where there is none."""


def damped_search(residual: Residual, q: Array, low: Array, high: Array, unit: Array) -> tuple[Array, Array]:
    """Coordinates of the least residual near each start, within bounds.

    Args:
        residual: dimensionless, of size 1 for a change of a unit.
        q: starts ``(s, n)``.
        low: bounds ``(n,)``.
        high: likewise.
        unit: of the coordinates ``(n,)``.

    Returns:
        Coordinates ``(s, n)`` and the sizes of their residuals ``(s,)``, inf where it is not defined at the start.

    Example:
        >>> ones = np.ones(1)
        >>> q, left = damped_search(lambda q, at: q**2 - 2.0, np.array([[1.0]]), 0 * ones, 9 * ones, ones)
        >>> float(q[0, 0])
        1.4142135623730951
    """
    q = np.clip(q, low, high)
    everyone = np.arange(len(q))
    r = residual(q, everyone)
    size = _sizes(r)
    damping, refused = np.full(len(q), DAMPING), np.zeros(len(q), dtype=int)
    factor = np.ones(len(q))
    J = np.zeros((len(q), r.shape[1], q.shape[1]))
    stale = np.ones(len(q), dtype=bool)
    for _ in range(ITERATIONS):
        at = np.flatnonzero((size > SETTLED) & np.isfinite(size) & (refused < REFUSED))
        if not len(at):
            break
        new = at[stale[at]]
        if len(new):
            J[new] = _jacobian(residual, r[new], new, (q[new], low, high), unit)
            stale[new] = False
        move = _moves(J[at], r[at], size[at], damping[at], (q[at], low, high))
        there = np.clip(q[at] + factor[at, None] * move * unit, low, high)
        after = residual(there, at)
        smaller = _sizes(after) < size[at]
        good, bad = at[smaller], at[~smaller & (factor[at] == 1.0)]
        gained = 1.0 - _sizes(after)[smaller] / size[good]
        halved = np.zeros(len(q), dtype=bool)
        halved[good] = (np.abs(1.0 - gained - DOUBLE) < LIKE) & (factor[good] == 1.0)
        q[good], r[good], size[good] = there[smaller], after[smaller], _sizes(after)[smaller]
        factor[at] = np.where(halved[at] & (size[at] < CLOSE), 2.0, 1.0)
        stale[good], refused[good] = True, np.where(gained > IDLE, 0, REFUSED)
        refused[bad] += 1
        damping[good] = np.maximum(SOFTER * damping[good], DAMPING)
        damping[bad] *= HARDER
    return q, size


def _sizes(r: Array) -> Array:
    size = np.linalg.norm(r, axis=1)
    return np.where(np.isfinite(size), size, np.inf)


def _moves(
    J: Array, r: Array, size: Array, damping: Array, place: tuple[Array, Array, Array]
) -> Array:  # fmt: skip
    """Damped steps ``(s, n)`` in units; a coordinate at a bound that it is pushed against stays."""
    q, low, high = place
    down = -np.einsum("smn,sm->sn", J, r)
    held = ((q <= low) & (down < 0.0)) | ((q >= high) & (down > 0.0))
    J = np.where(held[:, None, :], 0.0, J)
    # by singular values: J Jᵀ is singular where J has less rank than rows, however small the damping is
    U, values, V = np.linalg.svd(J, full_matrices=False)
    shares = values / (values**2 + (damping * size**2)[:, None] + (FLOOR * np.maximum(values[:, :1], 1.0)) ** 2)
    move: Array = -np.einsum("skn,sk->sn", V, shares * np.einsum("smk,sm->sk", U, r))
    move *= np.minimum(1.0, LARGEST_MOVE / np.maximum(np.abs(move).max(axis=1, initial=0.0), 1e-300))[:, None]
    return move


def _jacobian(
    residual: Residual, r: Array, at: np.ndarray, place: tuple[Array, Array, Array], unit: Array
) -> Array:
    """Derivative ``(s, m, n)`` by coordinates in their units, by differences; zero where there is none.

    At a bound they are one-sided, of second order too: beyond an end of its beam a carriage has no posture.
    """
    q, low, high = place
    s, n = q.shape
    h = STEP * unit
    side = np.where(q + h > high, -1.0, np.where(q - h < low, 1.0, 0.0))
    first, second = np.where(side, side, 1.0), np.where(side, 2.0 * side, -1.0)
    shifts = np.stack([first, second], axis=1)[..., None] * (np.eye(n) * h)
    rows = np.clip(q[:, None, None] + shifts, low, high).reshape(-1, n)
    near, far = np.moveaxis(residual(rows, np.repeat(at, 2 * n)).reshape(s, 2, n, -1), 1, 0)
    inward = side[..., None] * (4.0 * near - far - 3.0 * r[:, None])
    J: Array = np.where(side[..., None], inward, near - far).swapaxes(1, 2) / (2.0 * STEP)
    return np.nan_to_num(J)
