"""Normal distributions within bounds, and normal equations whose step is bounded.

Of a distribution: its most probable point, what lies beyond a bound, draws. Of the equations: one damped step
of Gauss and Newton within bounds, and the inverse.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.special import erfcx, log_ndtr, ndtri_exp

from vjm.rotations import Array
from vjm_updating.constants import numerical

CHAINS, SWEEPS, SETTLING = numerical(200), numerical(60), numerical(20)
"""Chains, their sweeps, and those that are left away: 8,000 draws give the ends of a 95 % interval to 2 % of it."""
SEED = numerical(11)
FAR = numerical(8.0)
"""Standard deviations from its bounds beyond which a coordinate is as good as free."""
PIVOTS, BLOCKS = numerical(1000), numerical(3)
"""Of block pivoting: rounds at most, and those without progress before single coordinates are changed."""
ROUNDING = numerical(1e-9)
"""Of a slope, relative to the largest: one that points off a bound by less is none."""


def mode(A: Array, b: Array, low: Array, high: Array) -> tuple[Array, np.ndarray]:
    """Where ``½ zᵀAz − bᵀz`` is smallest within bounds, and which coordinates are free there.

    ``A`` (n, n) is positive definite, its coordinates so scaled that its diagonal is of one order; bounds (n,) are
    infinite where there is none.

    Returns:
        z ``(n,)``, and ``(n,)`` whether each stands at no bound.

    Example:
        >>> A, b = np.array([[1.0, 0.5], [0.5, 1.0]]), np.array([1.0, -1.0])
        >>> z, free = mode(A, b, np.zeros(2), np.full(2, np.inf))
        >>> z.tolist(), free.tolist()
        ([1.0, 0.0], [True, False])
    """
    side = np.zeros(len(b), dtype=int)
    z = np.zeros(len(b))
    tiny = ROUNDING * np.abs(b).max(initial=1e-300)
    fewest, left = len(b) + 1, BLOCKS
    for _ in range(PIVOTS):
        index, fixed = np.flatnonzero(side == 0), np.flatnonzero(side)
        z[fixed] = np.where(side[fixed] < 0, low[fixed], high[fixed])
        z[index] = _solution(A[np.ix_(index, index)], b[index] - A[np.ix_(index, fixed)] @ z[fixed])
        beyond = np.where(side == 0, (z > high).astype(int) - (z < low), 0)
        wrong = np.flatnonzero((beyond != 0) | ((side != 0) & (side * (b - A @ z) < -tiny)))
        if not len(wrong):
            break
        if len(wrong) < fewest:
            fewest, left = len(wrong), BLOCKS
        elif left:
            left -= 1
        else:
            wrong = wrong[-1:]
        side[wrong] = beyond[wrong]
    return np.clip(z, low, high), side == 0


def _solution(A: Array, b: Array) -> Array:
    """Of ``A x = b``; the shortest where the matrix is singular to rounding."""
    if not len(b):
        return b
    # by Cholesky's method; LAPACK itself, as what SciPy checks of a small matrix takes longer than to solve it
    _, x, singular = dposv(A, b, lower=True)
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-12)[0] if singular else x, dtype=float)


def log_beyond(slope: Array) -> Array:
    """Logarithm of ``∫₀^∞ exp(−g t − t²/2) dt / √(2π)``: Mills' ratio of g over √(2π).

    The integral within its bound of a normal distribution of variance one, as a share of the whole one, in units of
    the density at the bound, which falls inwards by g per standard deviation. ``slope`` is g (n,), not negative.

    Example:
        >>> round(float(np.exp(log_beyond(np.zeros(1)))[0]), 3)
        0.5
    """
    return np.asarray(np.log(0.5 * erfcx(slope / np.sqrt(2.0))))


def log_share(low: Array, high: Array) -> Array:
    """Logarithm of the normal distribution's share ``(n,)`` between two ends in standard deviations."""
    # of the two tails the smaller keeps its digits
    flip = low > 0.0
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    upper, lower = log_ndtr(b), log_ndtr(a)
    return upper + np.log1p(-np.exp(np.minimum(lower - upper, -1e-16)))


def truncated_draws(mean: Array, C: Array, low: Array, high: Array, start: Array) -> Array | None:
    """Draws ``(n, d)`` from a normal distribution truncated to a box; None where no bound is near.

    Coordinates far from their bounds follow by their regression on the others. Without bounds it has ``mean`` (d,)
    and covariance ``C`` (d, d), where a coordinate without variance stays. The box is infinite where there is no
    bound; ``start`` (d,) lies in it.
    """
    sd = np.sqrt(np.maximum(np.diag(C), 0.0))
    cut = np.flatnonzero((sd > 0.0) & ((mean - low < FAR * sd) | (high - mean < FAR * sd)))
    if not len(cut):
        return None
    s = sd[cut]
    own = C[np.ix_(cut, cut)] / np.outer(s, s)
    x = _gibbs(mean[cut] / s, own, low[cut] / s, high[cut] / s, start[cut] / s)
    G = np.linalg.solve(own, C[cut] / s[:, None]).T
    left = np.maximum(np.diag(C) - np.einsum("ij,ij->i", G, C[:, cut] / s), 0.0)
    draws: Array = mean + (x - mean[cut] / s) @ G.T
    draws += np.random.default_rng(SEED).normal(size=draws.shape) * np.sqrt(left)
    draws[:, cut] = x * s
    return draws


def _gibbs(mean: Array, C: Array, low: Array, high: Array, start: Array) -> Array:
    """Draws ``(n, d)`` from a normal distribution of variances one, truncated to a box."""
    rng = np.random.default_rng(SEED)
    Q = np.linalg.inv(C)
    # members that are nearly one move along their ridge, which no member alone follows
    directions = np.concatenate([np.eye(len(C)), np.linalg.eigh(C)[1]], axis=1).T
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
    draws = ndtri_exp(top + np.log(u + (1.0 - u) * np.exp(np.minimum(bottom - top, 0.0))))
    return np.where(flip, -draws, draws)


LONGEST = numerical(1.0)
"""Of one step, in units of one and the coordinate itself, where readings are not linear in it."""


def bounded_step(
    A: Array, b: Array, damping: float, fixed: np.ndarray, linear: np.ndarray, z: Array, low: Array, high: Array
) -> Array:
    """Where a damped step leads ``(k,)`` within the bounds and the trusted range of each coordinate.

    What would go further stops there, and the others do what is best beside it: a bow, say, acts by its square, and
    the slope at a small one says little of a large one. Readings are linear in an instrument's zero and scale, and
    their slope holds as far as the bounds. A step to a bound ends at its very value: what a coordinate at a bound
    costs is another thing than that of one inside. ``A`` (k, k) and ``b`` (k,) are the normal equations, ``z``
    (k,) is where the coordinates are, ``damping`` the share of the diagonal that is added. Those that are ``fixed``
    (k,) stay.
    """
    most = np.where(linear, np.inf, LONGEST * (1.0 + np.abs(z)))
    first, last = np.maximum(low, z - most), np.minimum(high, z + most)
    after = z.copy()
    on = ~fixed
    M = A[np.ix_(on, on)] + damping * np.diag(np.diag(A)[on])
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    floor, roof = (first - z)[on] * size, (last - z)[on] * size
    best, _ = mode(M / size[:, None] / size, b[on] / size, floor, roof)
    moved = np.clip(z[on] + best / size, first[on], last[on])
    after[on] = np.where(best <= floor, first[on], np.where(best >= roof, last[on], moved))
    return after


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
