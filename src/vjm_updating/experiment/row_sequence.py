"""The most probable mistake of each row of a test, of rows that follow one another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale, stated_level

MISTAKES = prior_scale(0.02)
"""Probability that a posture's readings are mistaken in some way."""
ODDS = stated_level(20.0)
"""Of the most probable mistake to one that is not named beside it."""
LEAST_ROWS = numerical(2)
"""Of a stretch that say something: a single one is an outlier."""

Step = Callable[[int, int | slice, int | slice], Array]
"""What a change costs from a row's mistake to the next row's; given the next row and both mistakes."""


def rarity(ways: int) -> float:
    """Negative logarithm of the probability of each of so many mistakes, before the readings."""
    return float(np.log(max(ways, 1) / MISTAKES))


def most_probable(level: Array, rare: float, whole: np.ndarray, step: Step | None = None) -> np.ndarray:
    """The most probable mistake of each row ``(k,)``, by number; between two mistakes there are right rows.

    The most probable sequence is Viterbi's (IEEE Trans. Inf. Theory 13 (1967) 260). Where a stretch begins and ends
    is as probable in every row.

    Args:
        level: ``(w, k)`` negative logarithms of each row's probability under each mistake; number 0: it is right.
        rare: see `rarity`.
        whole: ``(w,)`` which mistakes concern all rows or none.
        step: what else a change costs; None: nothing.

    Example:
        >>> level = np.array([[0.0, 9.0, 9.0, 9.0, 0.0], [9.0, 0.0, 0.0, 0.0, 9.0]])
        >>> most_probable(level, rarity(1), np.zeros(2, dtype=bool)).tolist()
        [0, 1, 1, 1, 0]
    """
    n, each, every = level.shape[1], np.arange(len(level)), slice(None)
    none = np.zeros(len(level))
    change = np.where(whole, np.inf, np.log(max(n, 2)))
    cost, came = level[:, 0] + np.where(each > 0, rare, 0.0), np.zeros((n, len(each)), dtype=int)
    for k in range(1, n):
        changes = ((every, every), (0, every), (every, 0))
        same, into, out = (none if step is None else step(k, before, after) for before, after in changes)
        stay = cost + same
        enter = cost[0] + into + rare + change
        leave = cost + out + change
        leave[0], enter[0] = stay[0], np.inf
        came[k] = np.where(enter < stay, 0, each)
        came[k, 0] = np.argmin(leave)
        cost = level[:, k] + np.concatenate([[leave.min()], np.minimum(stay, enter)[1:]])
    path = np.zeros(n, dtype=int)
    path[-1] = int(np.argmin(cost))
    for k in range(n - 1, 0, -1):
        path[k - 1] = came[k, path[k]]
    return path
