"""Tails of the distributions that tests of significance ask for, by `scipy.special` alone.

`scipy.stats` has them too and more, but takes a third of a second to import, and far longer for one number.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import chdtrc, chdtri, fdtrc, ndtr, ndtri, stdtrit

from vjm.rotations import Array


def chi2_sf(x: Any, freedom: Any) -> Any:  # noqa: ANN401
    """Chance that a chi-squared number of so many degrees of freedom is above ``x``; nan where there are none."""
    return np.where(np.greater(freedom, 0.0), chdtrc(freedom, np.maximum(x, 0.0)), np.nan)


def chi2_isf(chance: float, freedom: float) -> float:
    """What a chi-squared number of so many degrees of freedom is above with this chance."""
    return float(chdtri(freedom, chance))


def normal_sf(x: Any) -> Any:  # noqa: ANN401
    """Chance that a standard normal number is above ``x``; of numpy's shape."""
    return ndtr(np.negative(x))


def normal_isf(chance: float) -> float:
    """What a standard normal number is above with this chance."""
    return -float(ndtri(chance))


def normal_quantile(chances: Array) -> Array:
    """What a standard normal number is below with these chances; of their shape."""
    result: Array = ndtri(chances)
    return result


def student_isf(chance: float, freedom: float) -> float:
    """What a number of Student's distribution is above with this chance."""
    return -float(stdtrit(freedom, chance))


def f_logsf(x: float, above: float, below: float) -> float:
    """Logarithm of the chance that a number of the F distribution is above ``x``; -inf where it underflows.

    Args:
        x: at least 0.
        above: degrees of freedom of the numerator.
        below: of the denominator.
    """
    chance = float(fdtrc(above, below, x))
    return float(np.log(chance)) if chance > 0.0 else -np.inf


def rare_share_sf(count: int, samples: int, b: float) -> float:
    """Chance of at least ``count`` of ``samples`` whose share is distributed as ``b (1 − q)^(b − 1)``.

    The beta-binomial distribution with a = 1. Each further one has the chance ``(n − i) / (n − i + b)`` after i of
    them: the sum of its terms telescopes.
    """
    left = samples - np.arange(min(count, samples + 1))
    return float(np.prod(left / (left + b)))


def drawn_sf(count: np.ndarray, total: int, marked: int, drawn: np.ndarray) -> Array:
    """Chances of at least ``count (m,)`` marked ones among ``drawn (m,)`` of ``total``, of which ``marked`` are so.

    The hypergeometric distribution. Its terms follow from the ratios of neighbours, whose products keep digits.
    """
    N = np.asarray(drawn, dtype=float)[:, None]
    least = np.maximum(N - (total - marked), 0.0)
    x = least + np.arange(marked + 1)
    ratio = np.maximum((marked - x) * (N - x), 0.0) / ((x + 1.0) * (total - marked - N + x + 1.0))
    with np.errstate(divide="ignore"):
        log = np.cumsum(np.log(ratio[:, :-1]), axis=1)
    log = np.concatenate([np.zeros_like(N), log], axis=1)
    weight = np.exp(log - log.max(axis=1, keepdims=True))
    tail = np.where(x >= np.asarray(count)[:, None], weight, 0.0)
    result: Array = tail.sum(axis=1) / weight.sum(axis=1)
    return result


def latin_hypercube(points: int, dimensions: int, seed: int) -> Array:
    """Points ``(n, d)`` in the unit cube, in every coordinate one in each n-th part (McKay et al. 1979).

    The same ones as of `scipy.stats.qmc.LatinHypercube`.
    """
    rng = np.random.default_rng(seed).spawn(1)[0]
    within = rng.uniform(size=(points, dimensions))
    place = np.tile(np.arange(1, points + 1), (dimensions, 1))
    for row in place:
        rng.shuffle(row)
    result: Array = (place.T - within) / points
    return result
