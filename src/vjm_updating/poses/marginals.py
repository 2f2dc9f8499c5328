"""Marginal intervals of a normal posterior that bounds truncate.

Where a member stands at its bound the others may still push it: its interval given the others' best values is that
of a conditional distribution, and far too narrow. The members with bounds are drawn from the truncated normal
distribution by Gibbs' sampler (Geweke, Computing Science and Statistics 23, 571, 1991), many chains at once, along
each member and along the principal axes of all; those without bounds follow by their regression on them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import log_ndtr, ndtri_exp

from vjm.rotations import Array
from vjm_updating.poses.fit import Blocks, Solution, precision_of

CHAINS, SWEEPS, SETTLING = 200, 60, 20
"""Chains, their sweeps, and those that are left away: 8,000 draws give the ends of a 95 % interval to 2 % of it."""
SEED = 11
FAR = 8.0
"""Standard deviations from its bounds beyond which a member is as good as free: it is left to the regression."""
LOW, HIGH, ONE_SIDED = 0.025, 0.975, 0.95


@dataclass(frozen=True)
class Marginal:
    """Marginal distributions of the p active unknowns, in their units.

    Attributes:
        std: ``(p,)`` standard deviations.
        low: ``(p,)`` and
        high: ``(p,)`` ends of the 95 % intervals; one-sided where the best value is no inner point of one.
        side: ``(p,)`` 1 where the interval says what a member is at most, −1 where at least, 0 where it has two
            ends.
        pull: ``(p,)`` standard deviations by which the best value without any bound lies beyond the bound; zero
            where it does not.
    """

    std: Array
    low: Array
    high: Array
    side: np.ndarray
    pull: Array


def marginals(blocks: Blocks, solution: Solution) -> Marginal:
    """The marginals of a fit, nuisances first.

    Args:
        blocks: normal equations.
        solution: the fit.
    """
    active, noise2 = solution.active, solution.noise**2
    precision = precision_of(blocks, blocks.family[active], solution.sizes)
    A = blocks.N[np.ix_(active, active)] / noise2 + np.diag(precision)
    scale = 1.0 / np.sqrt(np.diag(A))
    factor = cho_factor(A * np.outer(scale, scale), lower=True)
    C = cho_solve(factor, np.eye(len(A))) * np.outer(scale, scale)
    mean = C @ (blocks.b[active] / noise2)
    sd = np.sqrt(np.diag(C))
    low, high = blocks.lower[active], blocks.upper[active]
    pull = np.maximum(np.maximum((low - mean) / sd, (mean - high) / sd), 0.0)
    near = np.flatnonzero(((mean - low) < FAR * sd) | ((high - mean) < FAR * sd))
    if not len(near):
        return Marginal(sd, mean - 1.96 * sd, mean + 1.96 * sd, np.zeros(len(A), dtype=int), pull)
    x = truncated_draws(mean[near], C[np.ix_(near, near)], low[near], high[near], solution.z[active][near])
    G = np.linalg.solve(C[np.ix_(near, near)], C[near]).T
    rest = np.maximum(np.diag(C) - np.einsum("ij,ij->i", G, C[:, near]), 0.0)
    draws = mean + (x - mean[near]) @ G.T
    draws += np.random.default_rng(SEED).normal(size=draws.shape) * np.sqrt(rest)
    draws[:, near] = x
    z = solution.z[active]
    first, last = np.quantile(draws, [LOW, HIGH], axis=0)
    least, most = np.quantile(draws, [1.0 - ONE_SIDED, ONE_SIDED], axis=0)
    at_low, at_high = z <= low, z >= high
    # the best of all members together may lie beyond nearly all of one's own distribution: it is then the end
    side = np.where(at_low | (z >= last) & ~at_high, 1, np.where(at_high | (z <= first), -1, 0))
    first = np.where(at_low, low, np.where(at_high, least, np.minimum(first, z)))
    last = np.where(at_high, high, np.where(at_low, most, np.maximum(last, z)))
    return Marginal(draws.std(axis=0), first, last, side, pull)


def truncated_draws(mean: Array, C: Array, low: Array, high: Array, start: Array) -> Array:
    """Draws ``(n, d)`` from a normal distribution truncated to a box.

    Args:
        mean: ``(d,)`` of the distribution without bounds.
        C: ``(d, d)`` its covariance.
        low: ``(d,)`` and
        high: ``(d,)`` the box, infinite where there is none.
        start: ``(d,)`` in the box.
    """
    rng = np.random.default_rng(SEED)
    Q = np.linalg.inv(C)
    sd = np.sqrt(np.diag(C))
    # members that are nearly one move along their ridge, which no member alone follows
    ridges = sd[:, None] * np.linalg.eigh(C / np.outer(sd, sd))[1]
    directions = np.concatenate([np.diag(sd), ridges], axis=1).T
    x = np.tile(np.clip(start, low, high), (CHAINS, 1))
    kept = []
    for sweep in range(SWEEPS):
        for v in directions:
            curve = float(v @ Q @ v)
            centre, own = -(x - mean) @ (Q @ v) / curve, 1.0 / np.sqrt(curve)
            first, last = _reach(x, v, low, high)
            t = centre + own * _between((first - centre) / own, (last - centre) / own, rng)
            x = np.clip(x + t[:, None] * v, low, high)
        if sweep >= SETTLING:
            kept.append(x.copy())
    return np.concatenate(kept)


def _reach(x: Array, v: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """How far points ``(c, d)`` of a box may move back and forth along a direction ``(d,)``, ``(c,)`` each."""
    moves = np.abs(v) > 1e-12 * np.abs(v).max()
    ends = np.stack([(low - x)[:, moves] / v[moves], (high - x)[:, moves] / v[moves]])
    return np.minimum(ends.min(axis=0).max(axis=1), 0.0), np.maximum(ends.max(axis=0).min(axis=1), 0.0)


def _between(a: Array, b: Array, rng: np.random.Generator) -> Array:
    """Standard normal draws ``(n,)`` between two ends, by the inverse of the tail that keeps its digits."""
    flip = a > 0.0
    low, high = np.where(flip, -b, a), np.where(flip, -a, b)
    top, bottom = log_ndtr(high), log_ndtr(low)
    u = rng.uniform(size=len(a))
    found = ndtri_exp(top + np.log(u + (1.0 - u) * np.exp(np.minimum(bottom - top, 0.0))))
    result: Array = np.where(flip, -found, found)
    return result
