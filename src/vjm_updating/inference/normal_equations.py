"""Normal equations: one damped step of Gauss and Newton within bounds, and the inverse."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.truncated_normal import mode

LONGEST = numerical(1.0)
"""Of one step, in units of one and the coordinate itself, where readings are not linear in it."""


def bounded_step(
    A: Array, b: Array, damping: float, fixed: np.ndarray, linear: np.ndarray, z: Array, low: Array, high: Array
) -> Array:
    """A damped step within the bounds and the trusted range of each coordinate.

    What would go further stops there, and the others do what is best beside it: a bow, say, acts by its square,
    and the slope at a small one says little of a large one. Readings are linear in an instrument's zero and scale,
    and their slope holds as far as the bounds.

    Args:
        A: normal matrix ``(k, k)``.
        b: right side ``(k,)``.
        damping: share of the diagonal that is added to it.
        fixed: ``(k,)`` coordinates that stay.
        linear: ``(k,)`` those in which readings are linear.
        z: where they are ``(k,)``.
        low: bounds ``(k,)``.
        high: likewise.
    """
    most = np.where(linear, np.inf, LONGEST * (1.0 + np.abs(z)))
    floor, roof = np.maximum(low - z, -most), np.minimum(high - z, most)
    step = np.zeros(len(b))
    on = ~fixed
    M = A[np.ix_(on, on)] + damping * np.diag(np.diag(A)[on])
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    best, _ = mode(M / size[:, None] / size, b[on] / size, floor[on] * size, roof[on] * size)
    step[on] = np.clip(best / size, floor[on], roof[on])
    return step


def inverse(A: Array, free: np.ndarray, rcond: float = 1e-12) -> Array:
    """Pseudo-inverse ``(k, k)`` of a normal matrix whose coordinates differ in size.

    Zero for those that are not free ``(k,)``, and where nothing is known.
    """
    on = free & (np.diag(A) > 0.0)
    size = np.sqrt(np.diag(A)[on])
    result = np.zeros_like(A)
    own = np.linalg.pinv(A[np.ix_(on, on)] / size[:, None] / size, rcond=rcond, hermitian=True)
    result[np.ix_(on, on)] = own / size[:, None] / size
    return result
