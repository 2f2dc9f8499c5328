"""The linear fit at a state, and the noise of postures.

Members are under one size a family by the evidence, nuisances under wide priors. The noise is the scatter of
each reading, and what the model lacks, which is the same in like postures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular

from vjm.rotations import Array
from vjm_updating.constants import numerical, physical_bound
from vjm_updating.inference.bounded_normal import log_beyond, log_share, mode

ROUNDS = numerical(60)
"""Of the sizes' updates."""
SETTLED = numerical(1e-3)
"""Relative change of the sizes below which they have settled."""
SMALLEST_SIZE, LARGEST_SIZE = physical_bound(1e-5), physical_bound(1e4)
ROUNDING = numerical(1e-13)
"""Of a normal matrix with a diagonal of one: some hundred times that of a sum."""
NO_FAMILY = numerical(1_000_000)
"""Number of members that are left out of a fit."""


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of readings, whole and by the parts that are held out.

    The first ``n_f`` of the P unknowns are the nuisances.

    Attributes:
        N: ``(P, P)`` and
        b: ``(P,)`` of all readings, whitened.
        c: squared norm of the whitened readings.
        count: how many readings.
        J: ``(rows, P)`` whitened derivatives.
        y: ``(rows,)`` whitened readings less the prediction at zero.
        posture: ``(rows,)`` and
        channel: ``(rows,)`` numbers of the posture, and of the marker's coordinate.
        nuisances: n_f.
        prior: ``(n_f,)`` standard deviations of the nuisances.
        family: ``(P,)`` number of each unknown's family, −1 for nuisances, `NO_FAMILY` for what is held out.
        lower: ``(P,)`` and
        upper: ``(P,)`` bounds.
        largest: sizes of families beyond which they are not physical, by number.
        parts: for both kinds of holding out, normal equations of each part.
        fold: both kinds' numbers of the part ``(g,)``.
        least: smallest variance of the whitened readings: they scatter no less than the sheet says.
        refit: share of a nuisance's information. Where less is left, it is fitted to the readings that are held
            out, as the frames of a whole series have to be.
    """

    N: Array
    b: Array
    c: float
    count: int
    J: Array
    y: Array
    posture: np.ndarray
    channel: np.ndarray
    nuisances: int
    prior: Array
    family: np.ndarray
    lower: Array
    upper: Array
    largest: dict[int, float]
    parts: tuple[list[tuple[Array, Array]], ...]
    fold: tuple[np.ndarray, ...]
    least: float = 0.0
    refit: float = 0.0

    def less(self, rows: np.ndarray) -> tuple[Array, Array]:
        """Normal equations ``(P, P)`` and ``(P,)`` without some of the readings, a mask ``(rows,)``."""
        J, y = self.J[rows], self.y[rows]
        return self.N - J.T @ J, self.b - J.T @ y

    def spread(self, correlated: Array, common: Array) -> Array:
        """Covariance ``(P, P)`` of ``Jᵀ y`` under the correlation of the readings, ``K + D Dᵀ``.

        Args:
            correlated: ``(rows, P)`` a root of K times J.
            common: ``(rows, w)`` D.
        """
        by_common = self.J.T @ common
        return correlated.T @ correlated + by_common @ by_common.T


@dataclass(frozen=True)
class PoseSolution:
    """Members and nuisances at their best.

    Attributes:
        z: ``(P,)`` all unknowns, zero for what is not in the hypothesis.
        sizes: of the families by number.
        log_evidence: up to a constant of the data, at the sizes and the noise below.
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

    @property
    def evidence(self) -> float:
        """The same over all sizes that families may have, of which `log_evidence` has the best ones.

        A size of one, in the members' units, is usual; its prior is half of Cauchy's distribution (Gelman 2006). To
        second order in its logarithm the evidence falls by the effective number of members (Laplace).
        """
        s = np.array([self.sizes[f] for f in self.sizes])
        members = np.array([self.effective[f] for f in self.sizes])
        log_prior = np.log(2.0 * s / (np.pi * (1.0 + s**2)))
        return self.log_evidence + float(np.sum(log_prior + 0.5 * np.log(np.pi / members)))


def blocks_of(
    residual: Array, J: Array, sigma: Array, folds: Sequence[np.ndarray], nuisances: int, prior: Array,
    family: np.ndarray, lower: Array, largest: dict[int, float], upper: Array | None = None,
    least: float = 0.0,
) -> NormalEquations:  # fmt: skip
    """Normal equations of readings.

    Args:
        residual: ``(g, k, 6)`` readings less the prediction with the unknowns at zero; nan where there is none.
        J: ``(g, k, 6, P)`` derivatives.
        sigma: ``(g, k, 6)`` standard deviations, robust weights in them.
        folds: kinds of holding out, each ``(g,)``.
        nuisances: as all that follows, see `NormalEquations`.
        prior: of these.
        family: of the unknowns.
        lower: of these.
        largest: sizes.
        upper: of the unknowns; None: there are none.
        least: variance.
    """
    present = np.isfinite(residual)
    y = residual[present] / sigma[present]
    rows = J[present] / sigma[present][:, None]
    g, k, numbers = residual.shape
    posture = np.broadcast_to(np.arange(g)[:, None, None], residual.shape)[present]
    channel = np.broadcast_to(np.arange(k * numbers).reshape(k, numbers), residual.shape)[present]
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
    above = np.full(len(lower), np.inf) if upper is None else upper
    return NormalEquations(
        N, b, float(y @ y), len(y), rows, y, posture, channel, nuisances, prior, family, lower, above, largest,
        parts, tuple(folds), least,
    )  # fmt: skip


def solve(blocks: NormalEquations, families: Sequence[int], start: dict[int, float] | None = None) -> PoseSolution:
    """The fit of some families, by their numbers, with their sizes by the evidence, from those of ``start`` on."""
    active = np.flatnonzero((blocks.family < 0) | np.isin(blocks.family, list(families)))
    N, b, family = blocks.N[np.ix_(active, active)], blocks.b[active], blocks.family[active]
    bounds = blocks.lower[active], blocks.upper[active]
    sizes = {f: (start or {}).get(f, 1.0) for f in families}
    noise2, gamma = 1.0, dict.fromkeys(families, 0.0)
    for _ in range(ROUNDS):
        z, free, covariance, _ = _bounded(N / noise2, b / noise2, precision_of(blocks, family, sizes), *bounds)
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
        noise2 = max(chi2 / max(blocks.count - used, 0.1 * blocks.count, 1.0), blocks.least)
        if all(abs(sizes[f] - before[f]) <= SETTLED * before[f] or sizes[f] <= SMALLEST_SIZE for f in families):
            break
    precision = precision_of(blocks, family, sizes)
    z, free, covariance, log_det = _bounded(N / noise2, b / noise2, precision, *bounds)
    chi2 = max(blocks.c - 2.0 * float(z @ b) + float(z @ N @ z), 1e-12)
    penalty = float(z**2 @ precision)
    log_prior = float(np.sum(np.log(precision[free])))
    evidence = -0.5 * (blocks.count * np.log(noise2) + chi2 / noise2 + penalty + log_det - log_prior)
    evidence += _within(z, N / noise2 + np.diag(precision), b / noise2, precision, free, covariance, *bounds)
    whole = np.zeros(len(blocks.b))
    whole[active] = z
    return PoseSolution(
        whole, sizes, float(evidence), covariance, active, active[~free], gamma, float(np.sqrt(noise2))
    )


def _within(
    z: Array, A: Array, b: Array, precision: Array, free: np.ndarray, covariance: Array, lower: Array, upper: Array
) -> float:
    """Logarithm of what bounds take from the integral of the posterior over that of the prior, member by member.

    A free one: the share of its normal distribution within the bounds, prior and posterior. One at a bound, with
    the slope g into the bound and the curvature a, adds ``∫ exp(−g t − a t²/2) dt`` from there on inwards.
    """
    bounded = np.isfinite(lower) | np.isfinite(upper)
    if not bounded.any():
        return 0.0
    root = np.sqrt(precision)
    total = -float(np.sum(log_share(lower * root, upper * root)[bounded]))
    inside = bounded & free
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    total += float(np.sum(log_share((lower - z) / sd, (upper - z) / sd)[inside]))
    held = np.flatnonzero(~free)
    slope = np.abs(b - A @ z)[held]
    curve = np.diag(A)[held]
    beyond = log_beyond(slope / np.sqrt(curve))
    return total + float(np.sum(0.5 * np.log(precision[held] / curve) + beyond))


def precision_of(blocks: NormalEquations, family: np.ndarray, sizes: dict[int, float]) -> Array:
    """Prior precision of unknowns whose families are given, ``(p,)``, nuisances first."""
    result = np.empty(len(family))
    result[: blocks.nuisances] = 1.0 / blocks.prior**2
    for f, size in sizes.items():
        result[family == f] = 1.0 / size**2
    return result


def _bounded(
    N: Array, b: Array, precision: Array, lower: Array, upper: Array
) -> tuple[Array, np.ndarray, Array, float]:
    """Minimum of ``½ zᵀ(N + D)z − bᵀz`` within bounds: it, what is free, covariance, log determinant."""
    A, scale = scaled(N + np.diag(precision))
    z, free = mode(A, b * scale, lower / scale, upper / scale)
    index = np.flatnonzero(free)
    factor = cho_factor(A[np.ix_(index, index)], lower=True)
    covariance = np.zeros_like(A)
    covariance[np.ix_(index, index)] = cho_solve(factor, np.eye(len(index)))
    covariance *= np.outer(scale, scale)
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor[0])))) - 2.0 * float(np.sum(np.log(scale[index])))
    return z * scale, free, covariance, log_det


def scaled(A: Array) -> tuple[Array, Array]:
    """A normal matrix ``(p, p)`` in units ``(p,)`` in which its diagonal is one, positive definite by `ROUNDING`.

    Of readings without noise it has directions that only the prior knows, below the rounding of the others.
    """
    scale = 1.0 / np.sqrt(np.diag(A))
    return A * np.outer(scale, scale) + ROUNDING * np.eye(len(A)), scale


def best_of(blocks: NormalEquations, solution: PoseSolution, N: Array, b: Array) -> Array:
    """Active unknowns ``(p,)`` that fit normal equations of a part, under the sizes and the noise of a solution."""
    active = solution.active
    A, scale = scaled(N / solution.noise**2 + np.diag(precision_of(blocks, blocks.family[active], solution.sizes)))
    low, high = blocks.lower[active] / scale, blocks.upper[active] / scale
    return mode(A, b / solution.noise**2 * scale, low, high)[0] * scale


def without(blocks: NormalEquations, solution: PoseSolution, rows: np.ndarray, N: Array, b: Array) -> Array:
    """Members and nuisances ``(p,)`` of the active unknowns fitted without the readings ``(rows,)`` held out.

    N ``(P, P)`` and b ``(P,)`` are the normal equations without these. The sizes are those of all readings.
    """
    active, n = solution.active, blocks.nuisances
    z = best_of(blocks, solution, N[np.ix_(active, active)], b[active])
    own = np.flatnonzero(np.diag(N)[:n] < blocks.refit * np.diag(blocks.N)[:n])
    if len(own):
        F, noise2 = blocks.J[np.ix_(rows, own)], solution.noise**2
        others = z.copy()
        others[own] = 0.0
        left = blocks.y[rows] - blocks.J[np.ix_(rows, active)] @ others
        A, scale = scaled(F.T @ F / noise2 + np.diag(1.0 / blocks.prior[own] ** 2))
        z[own] = cho_solve(cho_factor(A, lower=True), F.T @ left / noise2 * scale) * scale
    return z


def held_out(blocks: NormalEquations, solution: PoseSolution, way: int) -> Array:
    """Whitened residuals ``(rows,)`` of readings, each predicted without the part that it belongs to; nan of none.

    The sizes are those of all readings.
    """
    active, fold = solution.active, blocks.fold[way]
    result = np.full(len(blocks.y), np.nan)
    for k, (N, b) in enumerate(blocks.parts[way]):
        rows = fold[blocks.posture] == k
        z = without(blocks, solution, rows, blocks.N - N, blocks.b - b)
        result[rows] = blocks.y[rows] - blocks.J[rows][:, active] @ z
    return result


REACHES = numerical((0.1, 0.2, 0.4, 0.8, 1.6), "rad")
"""That are tried. A larger one is a constant over the postures of most tests, which the frames take up."""
SHARES = numerical(tuple(float(v) for v in np.linspace(0.0, 0.95, 20)))
WAVE_SIZES = numerical(tuple(float(v) for v in np.geomspace(1e-3, 3.0, 40)), "mrad")
"""Standard deviations of a gear's waves that are tried."""
MOST = numerical(400)
"""Postures from which share and reach are taken; of more, so many are drawn."""
SEED = numerical(0)
METRE = numerical(1000.0, "mm/rad")
"""mm of a sliding joint that count as a radian."""
NUGGET = numerical(1e-10)


@dataclass(frozen=True, eq=False)
class PostureNoise:
    """Correlation of readings.

    Attributes:
        share: of the variance, that is correlated.
        reach: of the correlation, rad.
        factors: of channels that were read in the same postures their rows ``(c, m)``, and Cholesky's factor
            ``(m, m)`` of their correlation.
        waves: ``(rows, w)`` what errors of the gears do to the whitened readings, at their standard deviation.
            A diagnosis asks for gears' errors as a family, and only its intervals count them.
    """

    share: float = 0.0
    reach: float = REACHES[0]
    factors: tuple[tuple[np.ndarray, Array], ...] = ()
    waves: Array | None = None

    def whitened(self, blocks: NormalEquations) -> NormalEquations:
        """Normal equations of the readings made independent; those of parts held out are of the readings as is."""
        if not self.factors and self.waves is None:
            return blocks
        both = self.independent(np.concatenate([blocks.J, blocks.y[:, None]], axis=1))
        J, y = both[:, :-1], both[:, -1]
        return replace(blocks, N=J.T @ J, b=J.T @ y, c=float(y @ y), J=J, y=y)

    def independent(self, columns: Array) -> Array:
        """Columns ``(rows, n)`` of whitened readings, made independent."""
        result = columns.copy()
        for rows, L in self.factors:
            flat = np.moveaxis(columns[rows], 1, 0).reshape(len(L), -1)  # (m, c n)
            free = solve_triangular(L, flat, lower=True).reshape(len(L), len(rows), -1)
            result[rows] = np.moveaxis(free, 1, 0)
        if self.waves is not None:
            U, s, _ = np.linalg.svd(replace(self, waves=None).independent(self.waves), full_matrices=False)
            result -= U @ ((1.0 - 1.0 / np.sqrt(1.0 + s**2))[:, None] * (U.T @ result))
        return result

    def spread(self, blocks: NormalEquations) -> Array:
        """``JᵀKJ`` (P, P) with the derivatives J of the readings and their correlation K."""
        J = blocks.J.copy()
        for rows, L in self.factors:
            J[rows] = L.T @ blocks.J[rows]
        return blocks.spread(J, np.zeros((len(J), 0)) if self.waves is None else self.waves)


def noise_of(blocks: NormalEquations, solution: PoseSolution, place: Array) -> PostureNoise:
    """The noise that the residuals of a fit to independent readings show.

    ``place`` (g, n) has the coordinates of the postures in rad, see `places`.
    """
    residual = blocks.y - blocks.J[:, solution.active] @ solution.z[solution.active]
    groups = [(rows, place[blocks.posture[rows[0]]]) for rows in _alike(blocks)]
    share, reach = likeliest([(residual[rows], x) for rows, x in groups])
    if not share:
        return PostureNoise()
    factors = [(rows, factor_of(x, share, reach)) for rows, x in groups]
    return PostureNoise(share, reach, tuple(factors))


def likeliest(groups: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """Share and reach of the correlation of like postures; a share of zero where none is seen.

    The groups are of channels that were read in the same postures: residuals ``(c, m)`` and places ``(m, n)``.
    """
    best, share, reach = 0.0, 0.0, REACHES[0]
    for tried in REACHES:
        gain = np.zeros(len(SHARES))
        square, count = np.zeros(len(SHARES)), 0
        for residual, x in groups:
            few = np.sort(np.random.default_rng(SEED).permutation(len(x))[:MOST])
            size, axes = np.linalg.eigh(_correlation(x[few], tried))
            power = np.sum((residual[:, few] @ axes) ** 2, axis=0)
            variance = 1.0 + np.outer(SHARES, np.maximum(size, 0.0) - 1.0)
            gain -= 0.5 * len(residual) * np.log(variance).sum(axis=1)
            square += (power / variance).sum(axis=1)
            count += residual.shape[0] * len(few)
        # the size of the noise is that of each share's own largest likelihood
        gain -= 0.5 * count * np.log(square)
        gain -= gain[0]
        k = int(np.argmax(gain))
        if gain[k] > best:
            best, share, reach = float(gain[k]), SHARES[k], tried
    return (share, reach) if best > np.log(len(REACHES)) else (0.0, REACHES[0])


def gear_waves(blocks: NormalEquations, solution: PoseSolution, columns: Array) -> Array | None:
    """What errors of the gears do to the readings, of the size that the residuals of a fit show; None of none.

    A gear errs by many waves a turn, which are the same wherever a joint takes the same angle, whatever the others
    do. Waves of all joints are taken to be of one standard deviation: that of the largest likelihood, the unknowns
    fitted beside them. ``columns`` (rows, w) has what waves of one milliradian do to the whitened readings.
    """
    J, noise = blocks.J[:, solution.active], solution.noise
    left = (blocks.y - J @ solution.z[solution.active]) / noise
    Q = np.linalg.qr(J)[0]
    D = (columns - Q @ (Q.T @ columns)) / noise
    size2, axes = np.linalg.eigh(D.T @ D)
    power, size2 = ((D @ axes).T @ left) ** 2, np.maximum(size2, 0.0)
    a2 = np.array(WAVE_SIZES)[:, None] ** 2
    gain = 0.5 * np.sum(a2 * power / (1.0 + a2 * size2) - np.log1p(a2 * size2), axis=1)
    best = int(np.argmax(gain))
    if gain[best] <= np.log(len(WAVE_SIZES)):
        return None
    return columns * WAVE_SIZES[best]


def places(q: Array, turning: np.ndarray) -> Array:
    """Postures ``(g, n)`` in rad; of coordinates that do not turn, by a mask ``(n,)``, a metre is one."""
    return np.where(turning, q, q / METRE)


def factor_of(x: Array, share: float, reach: float) -> Array:
    """Cholesky's factor ``(m, m)`` of the correlation of readings in postures ``(m, n)``, rad."""
    return cholesky((1.0 - share + NUGGET) * np.eye(len(x)) + share * _correlation(x, reach), lower=True)


def _correlation(x: Array, reach: float) -> Array:
    square = np.sum(x**2, axis=1)
    distance2 = np.maximum(square[:, None] + square - 2.0 * x @ x.T, 0.0)
    return np.exp(-0.5 * distance2 / reach**2)


def _alike(blocks: NormalEquations) -> list[np.ndarray]:
    """Rows ``(c, m)`` of the channels that were read in the same postures, for each such set of postures."""
    by_postures: dict[bytes, list[np.ndarray]] = {}
    for channel in np.unique(blocks.channel):
        rows = np.flatnonzero(blocks.channel == channel)
        by_postures.setdefault(blocks.posture[rows].tobytes(), []).append(rows)
    return [np.array(rows) for rows in by_postures.values()]
