"""Which computed mode each measured frequency is.

Frequencies are read in ascending order, and a mode that the hammer did not excite or the sensor did not see is
missing. So a pairing is an ascending list of modes. Of the pairings that the sheet allows, each as likely as the
others beforehand, the one of the largest likelihood is taken; what the others are worth says how sure it is.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from vjm.rotations import Array


def pairings(read: np.ndarray, missing: int) -> np.ndarray:
    """Every pairing ``(a, k)`` of a row's columns with modes, counted from 0; −1 where none was read.

    Args:
        read: ``(k,)`` which columns have a frequency.
        missing: modes below the highest one read that may not have been seen; none: a column is its own mode.

    Example:
        >>> pairings(np.array([True, True]), 1).tolist()
        [[0, 1], [0, 2], [1, 2]]
    """
    at = np.flatnonzero(read)
    ways = list(combinations(range(len(at) + missing), len(at))) if missing else [tuple(at.tolist())]
    result = np.full((len(ways), len(read)), -1)
    result[:, at] = ways
    return result


def unlikeliness(
    frequency: Array, sigma: Array, computed: Array, ways: np.ndarray, shared: Array | None = None
) -> Array:
    """Twice the negative logarithm ``(a,)`` of the likelihood of pairings of a row, but for a constant.

    Args:
        frequency: ``(k,)`` Hz; nan where none was read.
        sigma: ``(k,)`` Hz.
        computed: ``(m,)`` Hz, ascending; nan where the machine has no such mode.
        ways: ``(a, k)``, see `pairings`.
        shared: ``(m, p)`` Hz, what p independent errors of the machine, of unit variance, make of the modes.
    """
    at = np.flatnonzero(ways[0] >= 0)
    own = ways[:, at]
    off = frequency[at] - computed[own]
    C = np.eye(len(at)) * sigma[at] ** 2
    if shared is not None:
        G = np.nan_to_num(shared)[own]
        C = C + G @ np.swapaxes(G, 1, 2)
    else:
        C = np.broadcast_to(C, (len(own), *C.shape))
    there = np.isfinite(off).all(axis=1)
    clean = np.where(there[:, None], off, 0.0)
    cost = np.einsum("ak,ak->a", clean, np.linalg.solve(C, clean[..., None])[..., 0])
    result: Array = np.where(there, cost + np.linalg.slogdet(C)[1], np.inf)
    return result


def probability(cost: Array, way: int) -> float:
    """Of one of a row's pairings among all that are allowed, by their `unlikeliness` ``(a,)``."""
    return float(1.0 / np.sum(np.exp(-0.5 * (cost - cost[way]))))


def skipping(read: np.ndarray, mode: int) -> np.ndarray:
    """The pairing ``(k,)`` of a row in which one mode, counted from 0, was not seen and all others were."""
    at = np.flatnonzero(read)
    result = np.full(len(read), -1)
    result[at] = [k + (k >= mode) for k in range(len(at))]
    return result
