"""The autocorrelation of the noise, from residuals of a model that may be wrong.

It is found by marginal likelihood. In each channel the whitened readings less the nominal model are a sum of
autocorrelated noise, the effects of the nuisances (of unit variance in units of their sigmas), and a mixture of
given shapes. The size of these is found along with the autocorrelation. Where the model is right that size comes
out as nothing, and all of the residual tells of the autocorrelation. Where it is wrong the shapes are as free as
in a restricted likelihood (Patterson and Thompson 1971).

Noise may have more than one time scale: a share of a channel's variance is white and the rest has the
autocorrelation. That there is no such share is as probable before any reading as that there is one of any size.

The sheet's standard deviation is believed. The channels of one rig have similar autocorrelations, so each is drawn
to their common one. That there is none at all is as probable before any reading as that there is one.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import betaincinv, logsumexp, ndtri

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.observation.noise import AutoregressiveNoise
from vjm_updating.observation.significance import FALSE_ALARMS, NOISE_KNOWN

STATIONARY = numerical(0.98)
"""Largest autocorrelation of neighbouring readings; at 1 a sequence would have no mean."""
GRID = numerical((0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.78, 0.85, 0.91, 0.96, 0.98))
"""Autocorrelations that are tried."""
SHARES = numerical((0.0, 0.2, 0.4, 0.6, 0.8))
"""Of the variance that are white: those that are tried."""
SLOW = numerical(0.75)
"""Least autocorrelation of what is slow beside a white share: with a weaker one it is not distinguishable from one
autocorrelation alone, and with hardly any not from white noise."""
SIZES = numerical((0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 1e3, 1e4, 1e5))
"""Of the shapes, in standard deviations of a reading times the root of their number."""
ALIKE = prior_scale(0.15)
"""Spread of the channels' memories about their common one."""
USUAL, WIDE = prior_scale(0.4), prior_scale(0.3)
"""The common one, where nothing is known but that neighbours are correlated."""
FEWEST = numerical(12)
"""Samples of a channel below which it takes the others' autocorrelation."""
RANK = numerical(0.02)
"""Of singular values over the largest, below which shapes are one: what sets them apart is the gauge's noise."""


def estimate_autocorrelation(
    autoregression: AutoregressiveNoise,
    instant: Array,
    shapes: Array,
    present: np.ndarray,
    nuisances: Array | None = None,
) -> AutoregressiveNoise:
    """The order of readings with its autocorrelations, by marginal likelihood.

    Args:
        autoregression: who precedes whom.
        instant: whitened readings less the model at its nominal nuisances ``(n, 6)``, still autocorrelated.
        shapes: whitened ``(n, 6, k)`` that a wrong model may leave.
        present: ``(n, 6)``.
        nuisances: whitened ``(n, 6, m)``, what one sigma of each nuisance does.
    """
    known = np.zeros((*instant.shape, 0)) if nuisances is None else nuisances
    channels = [c for c in range(present.shape[1]) if present[:, c].sum() >= FEWEST]
    uncorrelated = replace(autoregression, rho=np.zeros(present.shape[1]), white=np.zeros(present.shape[1]))
    if not channels:
        return uncorrelated
    by_share = np.array([_costs(autoregression, c, instant, shapes, known, present) for c in channels])
    # readings with hardly any of the noise that the sheet says tell nothing of its autocorrelation
    quiet = np.array([silent(np.diff(instant[present[:, c], c], n=2)) for c in channels])
    # twice the negative logarithm of the priors: of a channel's value (rows) beside the common one, and of that
    grid = np.array(GRID)
    apart, off = ((grid[:, None] - grid) / ALIKE) ** 2, ((grid - USUAL) / WIDE) ** 2
    of_share = by_share - 2.0 * _log_prior_of_shares()
    if not quiet.all() and _white(-2.0 * logsumexp(-0.5 * of_share[~quiet], axis=2), apart, off):
        return uncorrelated
    shares = np.where(quiet, 0, [_white_share(cost, off) for cost in of_share])
    costs = np.take_along_axis(by_share, shares[:, None, None], axis=2)[:, :, 0]
    white = np.zeros(present.shape[1])
    white[channels] = np.array(SHARES)[shares]
    # by the common autocorrelation (columns): the least that each channel costs beside it
    total = (costs[:, :, None] + apart).min(axis=1).sum(axis=0) + off
    common = int(np.argmin(total))
    rho = np.where(present.any(axis=0), grid[common], 0.0)
    for c, cost, nothing in zip(channels, costs + apart[:, common], quiet, strict=True):
        rho[c] = USUAL if nothing else _least(grid, cost)
    return replace(autoregression, rho=rho, white=white)


def _log_prior_of_shares() -> Array:
    """Logarithm of the prior ``(w,)`` of `SHARES`: none as probable as any other, of which all are alike."""
    cells = np.gradient(SHARES)[1:]
    return np.log(0.5 * np.concatenate([[1.0], cells / cells.sum()]))


def _white_share(costs: Array, off: Array) -> int:
    """The number among `SHARES` of a channel's white share: none, where any other is not more probable.

    Args:
        costs: twice the negative logarithm of likelihood and prior ``(g, w)`` by autocorrelation and share.
        off: of the prior ``(g,)`` of the autocorrelation.
    """
    each = logsumexp(-0.5 * costs + (np.log(np.gradient(GRID)) - 0.5 * off)[:, None], axis=0)
    return 1 + int(np.argmax(each[1:])) if logsumexp(each[1:]) > each[0] else 0


def _white(costs: Array, apart: Array, off: Array) -> bool:
    """Whether white noise is more probable than an autocorrelated one; both are as probable before any reading.

    Args:
        costs: twice the negative logarithm of each channel's likelihood ``(c, g)`` by autocorrelation.
        apart: of the prior ``(g, g)`` of a channel's autocorrelation (rows) beside the common one.
        off: of the prior ``(g,)`` of the common one.
    """
    share = np.log(np.gradient(GRID))[:, None]
    each = logsumexp(-0.5 * (costs[:, :, None] + apart) + share, axis=1)
    own = each - logsumexp(-0.5 * apart + share, axis=0)
    prior = share[:, 0] - 0.5 * off
    with_autocorrelation = logsumexp(own.sum(axis=0) + prior) - logsumexp(prior)
    return bool(-0.5 * costs[:, 0].sum() > with_autocorrelation)


def silent(bends: Array) -> bool:
    """Whether second differences are so small that the readings have not the noise that their sheet says.

    Noise of unit variance and of autocorrelation ρ has second differences of variance 2 (1 − ρ) (3 − ρ), the least
    for the strongest autocorrelation. Their median is the middle one of an ordered sample (of whose shares the
    distribution is a beta one). It may be smaller than `FALSE_ALARMS` allows, though the sheet says as much too
    much of the standard deviation as it may. Then no autocorrelation is the reason.

    Args:
        bends: second differences ``(m,)`` of whitened readings; those three apart share no reading.
    """
    half = 0.5 * (len(bends) // 3 + 1)
    least = np.sqrt(2.0 * (1.0 - STATIONARY) * (3.0 - STATIONARY) / NOISE_KNOWN)
    quantile = ndtri(0.5 * (1.0 + betaincinv(half, half, FALSE_ALARMS)))
    return float(np.median(np.abs(bends))) < least * float(quantile)


def _least(grid: Array, cost: Array) -> float:
    """Where the parabola through the least of a grid's values and its neighbours is least."""
    k = int(np.argmin(cost))
    if not 0 < k < len(grid) - 1 or np.isinf(cost[k - 1]):
        return float(grid[k])
    a, b, d = grid[k - 1 : k + 2]
    fa, fb, fd = cost[k - 1 : k + 2]
    top = (b - a) ** 2 * (fb - fd) - (b - d) ** 2 * (fb - fa)
    low = (b - a) * (fb - fd) - (b - d) * (fb - fa)
    return float(np.clip(b - 0.5 * top / low, a, d)) if low != 0.0 else float(b)


def _costs(
    autoregression: AutoregressiveNoise,
    c: int,
    instant: Array,
    shapes: Array,
    nuisances: Array,
    present: np.ndarray,
) -> Array:
    """Twice the negative logarithm of a channel's marginal likelihood ``(g, w)``, but for a constant.

    By autocorrelation, and by the share of the variance that is white.
    """
    on = present[:, c]
    X = shapes[:, c][on]
    X = X[:, np.any(X != 0.0, axis=0)]
    X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    U, values, _ = np.linalg.svd(X, full_matrices=False)
    U = U[:, values > RANK * values[0]] if len(values) else U
    # the coefficient of a column of unit norm grows with the root of the number of readings
    U = U * np.sqrt(len(X))
    known = nuisances[:, c][on]
    m, k = known.shape[1], U.shape[1]
    table = np.zeros((len(on), 1, m + k + 1))
    table[on, 0] = np.column_stack([known, U, instant[on, c]])
    before, gap = autoregression.before[:, [c]], autoregression.gap[:, [c]]
    result = np.full((len(GRID), len(SHARES)), np.inf)
    for (i, rho), (j, white) in product(enumerate(GRID), enumerate(SHARES)):
        if white > 0.0 and rho < SLOW:
            continue
        own = AutoregressiveNoise(np.array([rho]), np.array([white]), before, gap)
        free = own.remove(table)[on, 0]
        G, y = free.T @ free, m + k
        least = np.inf
        for size in SIZES if k else (0.0,):
            scale = np.concatenate([np.ones(m), np.full(k, size)])
            M = np.eye(m + k) + scale[:, None] * G[:y, :y] * scale
            factor = cho_factor(M, lower=True)
            g = scale * G[:y, y]
            fit = float(G[y, y] - g @ cho_solve(factor, g))
            least = min(least, fit + 2.0 * float(np.sum(np.log(np.diag(factor[0])))))
        result[i, j] = own.determinant[0] + least
    return result
