"""The linear fit at a state: members under one size a family by the evidence, nuisances under wide priors.

In units of the members the readings less the prediction are ``y = J z + F f + noise``. A family's members are drawn
from one normal distribution about zero whose standard deviation s, the family's *size*, maximises the evidence
(MacKay, Neural Computation 4, 415, 1992): ``s² = |z|² / γ`` with the effective number of members
``γ = n − tr Σ / s²``. So a family costs what it says, not its length. What bounds forbid, such as negative
compliances, is held at the bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vjm.rotations import Array

ROUNDS = 60
"""Of the sizes' updates."""
SETTLED = 1e-3
"""Relative change of the sizes below which they have settled."""
SMALLEST_SIZE, LARGEST_SIZE = 1e-5, 1e4
ATTEMPTS = 20
"""Rounds of the search for what stands at its bounds."""


@dataclass(frozen=True)
class Blocks:
    """Normal equations of readings, whole and by the parts that are held out.

    The first ``n_f`` of the P unknowns are the nuisances.

    Attributes:
        N: ``(P, P)`` and
        b: ``(P,)`` of all readings, whitened.
        c: squared norm of the whitened readings.
        count: how many readings.
        J: ``(rows, P)`` whitened derivatives.
        y: ``(rows,)`` whitened readings less the prediction at zero.
        posture: ``(rows,)``.
        nuisances: n_f.
        prior: ``(n_f,)`` standard deviations of the nuisances.
        family: ``(P,)`` number of each unknown's family, −1 for nuisances.
        lower: ``(P,)`` bounds.
        largest: sizes of families beyond which they are not physical, by number.
        parts: for both ways of holding out, normal equations of each part.
        fold: both ways' numbers of the part ``(g,)``.
    """

    N: Array
    b: Array
    c: float
    count: int
    J: Array
    y: Array
    posture: np.ndarray
    nuisances: int
    prior: Array
    family: np.ndarray
    lower: Array
    largest: dict[int, float]
    parts: tuple[list[tuple[Array, Array]], ...]
    fold: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Solution:
    """Members and nuisances at their best.

    Attributes:
        z: ``(P,)`` all unknowns, zero for what is not in the hypothesis.
        sizes: of the families by number.
        log_evidence: up to a constant of the data.
        covariance: ``(p, p)`` of
        active: the unknowns in the hypothesis, nuisances first.
        at_bound: unknowns that stand at a bound.
        effective: effective number of members by family.
        noise: factor on the whitened readings' standard deviation.
    """

    z: Array
    sizes: dict[int, float]
    log_evidence: float
    covariance: Array
    active: np.ndarray
    at_bound: np.ndarray
    effective: dict[int, float]
    noise: float


def blocks_of(
    residual: Array, J: Array, sigma: Array, folds: Sequence[np.ndarray], nuisances: int, prior: Array,
    family: np.ndarray, lower: Array, largest: dict[int, float],
) -> Blocks:  # fmt: skip
    """Normal equations of readings.

    Args:
        residual: ``(g, k, 6)`` readings less the prediction with the unknowns at zero; nan where there is none.
        J: ``(g, k, 6, P)`` derivatives.
        sigma: ``(g, k, 6)`` standard deviations, robust weights in them.
        folds: ways of holding out, each ``(g,)``.
        nuisances: n_f.
        prior: ``(n_f,)``.
        family: ``(P,)``.
        lower: ``(P,)``.
        largest: by number of the family.
    """
    present = np.isfinite(residual)
    y = residual[present] / sigma[present]
    rows = J[present] / sigma[present][:, None]
    posture = np.broadcast_to(np.arange(len(residual))[:, None, None], residual.shape)[present]
    parts = tuple(
        [
            (
                rows[fold[posture] == k].T @ rows[fold[posture] == k],
                rows[fold[posture] == k].T @ y[fold[posture] == k],
            )
            for k in range(int(fold.max()) + 1)
        ]
        for fold in folds
    )
    N: Array = np.sum([part[0] for part in parts[0]], axis=0)
    b: Array = np.sum([part[1] for part in parts[0]], axis=0)
    return Blocks(
        N, b, float(y @ y), len(y), rows, y, posture, nuisances, prior, family, lower, largest, parts, tuple(folds)
    )


def solve(blocks: Blocks, families: Sequence[int], start: dict[int, float] | None = None) -> Solution:
    """The fit of some families with their sizes by the evidence.

    Args:
        blocks: the normal equations.
        families: numbers of the families in the hypothesis.
        start: sizes to begin with.
    """
    active = np.flatnonzero((blocks.family < 0) | np.isin(blocks.family, list(families)))
    N, b, family = blocks.N[np.ix_(active, active)], blocks.b[active], blocks.family[active]
    lower = blocks.lower[active]
    sizes = {f: (start or {}).get(f, 1.0) for f in families}
    noise2, gamma = 1.0, dict.fromkeys(families, 0.0)
    z = np.zeros(len(active))
    free = np.ones(len(active), dtype=bool)
    covariance, log_det = np.zeros_like(N), 0.0
    for _ in range(ROUNDS):
        precision = _precision(blocks, family, sizes)
        z, free, covariance, log_det = _bounded(N / noise2, b / noise2, precision, lower)
        before = dict(sizes)
        used = float(blocks.nuisances)
        for f in families:
            own = free & (family == f)
            count = int(own.sum())
            size2 = sizes[f] ** 2
            gamma[f] = max(count - float(np.diag(covariance)[own].sum()) / size2, 1e-3)
            used += gamma[f]
            # members at a bound count as zeros: they tell that the family is small
            best = float(z[family == f] @ z[family == f]) / gamma[f]
            sizes[f] = float(np.clip(np.sqrt(best), SMALLEST_SIZE, blocks.largest.get(f, LARGEST_SIZE)))
        chi2 = max(blocks.c - 2.0 * float(z @ b) + float(z @ N @ z), 1e-12)
        noise2 = chi2 / max(blocks.count - used, 0.1 * blocks.count, 1.0)
        if all(abs(sizes[f] - before[f]) <= SETTLED * before[f] or sizes[f] <= SMALLEST_SIZE for f in families):
            break
    precision = _precision(blocks, family, sizes)
    penalty = float(z**2 @ precision)
    log_prior = float(np.sum(np.log(precision[free])))
    evidence = -0.5 * (blocks.count * np.log(noise2) + chi2 / noise2 + penalty + log_det - log_prior)
    whole = np.zeros(len(blocks.b))
    whole[active] = z
    return Solution(whole, sizes, float(evidence), covariance, active, active[~free], gamma, float(np.sqrt(noise2)))


def _precision(blocks: Blocks, family: np.ndarray, sizes: dict[int, float]) -> Array:
    result = np.empty(len(family))
    result[: blocks.nuisances] = 1.0 / blocks.prior**2
    for f, size in sizes.items():
        result[family == f] = 1.0 / size**2
    return result


def _bounded(N: Array, b: Array, precision: Array, lower: Array) -> tuple[Array, np.ndarray, Array, float]:
    """Minimum of ``½ zᵀ(N + D)z − bᵀz`` at ``z ≥ lower``: it, what is free, covariance, log determinant."""
    A = N + np.diag(precision)
    scale = 1.0 / np.sqrt(np.diag(A))
    A = A * np.outer(scale, scale)
    right, bound = b * scale, lower / scale
    free = np.ones(len(b), dtype=bool)
    z = np.zeros(len(b))
    for _ in range(ATTEMPTS):
        index = np.flatnonzero(free)
        fixed = np.flatnonzero(~free)
        z[fixed] = bound[fixed]
        known = right[index] - A[np.ix_(index, fixed)] @ z[fixed]
        factor = cho_factor(A[np.ix_(index, index)], lower=True)
        z[index] = cho_solve(factor, known)
        below = free & (z < bound)
        slope = right - A @ z
        released = ~free & (slope > 1e-9 * np.abs(right).max(initial=1e-300))
        if not below.any() and not released.any():
            break
        free = (free & ~below) | (released if not below.any() else np.zeros_like(free))
    index = np.flatnonzero(free)
    factor = cho_factor(A[np.ix_(index, index)], lower=True)
    z = np.maximum(z, bound) * scale
    covariance = np.zeros_like(A)
    covariance[np.ix_(index, index)] = cho_solve(factor, np.eye(len(index)))
    covariance *= np.outer(scale, scale)
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor[0])))) - 2.0 * float(np.sum(np.log(scale[index])))
    return z, free, covariance, log_det


def held_out(blocks: Blocks, solution: Solution, way: int) -> Array:
    """Whitened residuals ``(rows,)`` of readings, each predicted without the part that it belongs to.

    The sizes are those of all readings.
    """
    active, fold = solution.active, blocks.fold[way]
    families = blocks.family[active]
    precision = _precision(blocks, families, solution.sizes)
    result = np.empty(len(blocks.y))
    noise2 = solution.noise**2
    for k, (N, b) in enumerate(blocks.parts[way]):
        rest = (blocks.N - N)[np.ix_(active, active)] / noise2
        z = _bounded(rest, (blocks.b - b)[active] / noise2, precision, blocks.lower[active])[0]
        rows = fold[blocks.posture] == k
        result[rows] = blocks.y[rows] - blocks.J[np.ix_(rows, active)] @ z
    return result
