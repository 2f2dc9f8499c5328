"""The temperature of a test from a thermometer that has noise of its own."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from vjm.rotations import Array
from vjm_updating.constants import numerical

SLOWEST, FASTEST = numerical(-18.0), numerical(6.0)
"""Logarithm of the walk's variance per reading over the noise's, between which it is looked for: below, hundreds of
readings have one temperature; above, the noise does not count."""


def smoothed(temperature: Array, noise: float) -> Array:
    """The most probable temperatures behind noisy readings: a random walk seen with noise.

    The walk's variance per reading is the most likely one. The smoother is that of Rauch, Tung and Striebel
    (AIAA J. 3 (1965) 1445) for the local level model.

    Args:
        temperature: readings ``(n,)`` in the order in which they were taken, °C.
        noise: standard deviation of one reading, K; zero leaves the readings as they are.

    Returns:
        ``(n,)`` °C.
    """
    if noise <= 0.0 or len(temperature) < 2:
        return temperature
    seen = temperature / noise
    best = minimize_scalar(lambda ratio: _filtered(seen, np.exp(ratio))[2], bounds=(SLOWEST, FASTEST))
    walk = float(np.exp(best.x))
    level, variance, _ = _filtered(seen, walk)
    for k in range(len(level) - 2, -1, -1):
        level[k] += variance[k] / (variance[k] + walk) * (level[k + 1] - level[k])
    result: Array = noise * level
    return result


def _filtered(seen: Array, walk: float) -> tuple[Array, Array, float]:
    """Kalman's filter for noise of unit variance: levels ``(n,)``, variances, minus twice the log likelihood."""
    level, variance, misfit = seen.copy(), np.ones(len(seen)), 0.0
    for k in range(1, len(seen)):
        ahead = variance[k - 1] + walk
        innovation = seen[k] - level[k - 1]
        misfit += float(np.log(ahead + 1.0) + innovation**2 / (ahead + 1.0))
        level[k] = level[k - 1] + ahead / (ahead + 1.0) * innovation
        variance[k] = ahead / (ahead + 1.0)
    return level, variance, misfit
