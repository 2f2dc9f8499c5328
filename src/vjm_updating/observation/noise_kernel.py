"""Noise of two parts, one white and one autocorrelated, made white: Kalman's filter, compiled.

Of a channel's samples ``y`` the autocorrelated part is expected at ``m = p x`` from its estimate ``x`` at the
sample before, ``p`` being the autocorrelation over the gap. What is new is ``(y − m) / s``, of unit variance. The
estimate goes on to ``m + g (y − m)``. Without a white part it is the sample itself (Anderson and Moore 1979,
Optimal filtering, section 4.1).
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry
from vjm.rotations import Array


@entry
def gains(before: np.ndarray, power: Array, share: Array) -> tuple[Array, Array]:
    """Standard deviations ``(n, m)`` of what is new, and gains ``(n, m)``.

    Args:
        before: index ``(n, m)`` of the sample before, −1 where there is none.
        power: autocorrelation ``(n, m)`` over the gap to it.
        share: of each channel's variance ``(m,)`` that is autocorrelated.
    """
    n, m = before.shape
    size, gain = np.empty((n, m)), np.empty((n, m))
    left = np.empty((n, m))
    for c in range(m):
        for k in range(n):
            b = before[k, c]
            unsure = share[c]
            if b >= 0:
                unsure = power[k, c] ** 2 * left[b, c] + share[c] * (1.0 - power[k, c] ** 2)
            total = unsure + 1.0 - share[c]
            size[k, c] = np.sqrt(total)
            gain[k, c] = unsure / total
            left[k, c] = unsure * (1.0 - share[c]) / total
    return size, gain


@entry
def innovations(y: Array, before: np.ndarray, power: Array, size: Array, gain: Array) -> Array:
    """What is new ``(n, m, t)`` in samples ``(n, m, t)``, white and of unit variance."""
    n, m, t = y.shape
    result, estimate = np.empty((n, m, t)), np.empty((n, m, t))
    for k in range(n):
        for c in range(m):
            b = before[k, c]
            for j in range(t):
                expected = power[k, c] * estimate[b, c, j] if b >= 0 else 0.0
                new = y[k, c, j] - expected
                estimate[k, c, j] = expected + gain[k, c] * new
                result[k, c, j] = new / size[k, c]
    return result


@entry
def transposed(new: Array, before: np.ndarray, power: Array, size: Array, gain: Array) -> tuple[Array, Array]:
    """The transposed filter applied to ``(n, m)``, and squares ``(n, m)`` of the filter's columns."""
    n, m = new.shape
    result, squares = np.empty((n, m)), np.empty((n, m))
    back, later = np.zeros((n, m)), np.zeros((n, m))
    for k in range(n - 1, -1, -1):
        for c in range(m):
            result[k, c] = gain[k, c] * back[k, c] + new[k, c] / size[k, c]
            squares[k, c] = gain[k, c] ** 2 * later[k, c] + 1.0 / size[k, c] ** 2
            b = before[k, c]
            if b >= 0:
                kept = 1.0 - gain[k, c]
                back[b, c] += power[k, c] * (kept * back[k, c] - new[k, c] / size[k, c])
                later[b, c] += power[k, c] ** 2 * (kept**2 * later[k, c] + 1.0 / size[k, c] ** 2)
    return result, squares
