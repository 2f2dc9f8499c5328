"""How far the numbers of a machine scatter between series, and what is known of a new one.

Each series s has numbers of its own, ``θ_s = θ + δ_s``. The deviations δ are normal. Their standard deviation is
one share τ, for all of a family, of a reach: of a spring its own compliance, of other members the family's size.
The prior of τ is half of Student's distribution (Gelman, Bayesian Analysis 1, 515, 2006), with the degrees of
freedom of the readings. Under half of Cauchy's a single series would say that springs may double. See `CHANGES`
for its scale.

With G the derivatives of a series' whitened readings by the members, the deviations are integrated out: ``N − JᵀG
(T⁻¹ + GᵀG)⁻¹ GᵀJ`` in place of ``N = JᵀJ``. So a series with many readings says no more of θ than its own scatter
allows.

τ is taken at its posterior mode for θ; for the interval of a new series it is drawn from its posterior, family by
family. One series says nothing of τ, and the prior stands alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.poses.families import COMPLIANCE, ZEROS
from vjm_updating.poses.fit import Blocks, scaled, solve
from vjm_updating.poses.pooled import ZERO, ZERO_BETWEEN, PooledStudy
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import EXACT, TAIL, Study

CHANGES, STAYS = prior_scale(0.1), prior_scale(0.003)
"""Scales of τ. Springs and gears change with temperature, wear and load. A strain wave gear is 1.6 times as stiff
under its full torque as under a small one (makers' catalogues). So a linear spring that was fitted under another
tool is another one by a tenth. Geometry and weights change as lengths do with temperature. 10 K stretch a metre of
steel by 0.1 mm, where frames err by millimetres."""
RATIOS = numerical(tuple(float(v) for v in np.geomspace(1e-3, 3.0, 16)))
"""Of τ, that are tried."""
SWEEPS = numerical(2)
"""Of the families, each with the others' τ held."""
SEED = numerical(13)
TOLD = numerical(1e-6)
"""Of the prior's information, that the data add: less is rounding."""


def scale_of(family: str) -> float:
    """Scale of the prior of τ."""
    return STAYS if family in EXACT else CHANGES


@dataclass(frozen=True)
class Scatter:
    """Scatter between series.

    Attributes:
        tau: of each member ``(P,)`` the standard deviation at the posterior mode of τ, in its units.
        chance: by family the probabilities ``(r,)`` of τ at `RATIOS`.
        reach: ``(P,)`` what τ is a share of, in the members' units.
    """

    tau: Array
    chance: Mapping[str, Array]
    reach: Array

    def draws(self, family: str, place: int, count: int) -> Array:
        """Deviations ``(count,)`` of a member in a new series, in its units.

        Args:
            family: of the member, and
            place: its number.
            count: how many.
        """
        if family not in self.chance:
            return np.zeros(count)
        rng = np.random.default_rng(SEED)
        ratio = rng.choice(RATIOS, count, p=self.chance[family])
        result: Array = ratio * self.reach[place] * rng.standard_normal(count)
        return result


@dataclass(frozen=True)
class ScatteredBlocks(Blocks):
    """Normal equations with the deviations of series integrated out.

    Attributes:
        series: ``(rows,)`` of each reading.
        variance: ``(P,)`` of the unknowns' deviations over that of the whitened readings; zero where there is none.
        without_prior: normal matrix ``(P, P)`` without what was added to it since.
    """

    series: np.ndarray | None = None
    variance: Array | None = None
    without_prior: Array | None = None

    def less(self, rows: np.ndarray) -> tuple[Array, Array]:
        """Normal equations without some of the readings."""
        assert self.without_prior is not None
        N, b, _ = self.integrated(rows)
        return self.N - self.without_prior + N, b

    @cached_property
    def _sums(self) -> dict[int, tuple[Array, Array]]:
        """Normal equations of each series."""
        assert self.series is not None
        found = {}
        for s in np.unique(self.series):
            J, y = self.J[self.series == s], self.y[self.series == s]
            found[int(s)] = J.T @ J, J.T @ y
        return found

    def integrated(self, without: np.ndarray) -> tuple[Array, Array, float]:
        """Normal equations without some of the readings, the deviations integrated out; what these take of c."""
        assert self.series is not None
        assert self.variance is not None
        own = np.flatnonzero(self.variance)
        N, b, c = np.zeros_like(self.N), np.zeros_like(self.b), 0.0
        for s, (N_s, b_s) in self._sums.items():
            J, y = self.J[without & (self.series == s)], self.y[without & (self.series == s)]
            N_s, b_s = N_s - J.T @ J, b_s - J.T @ y
            less = cho_factor(np.diag(1.0 / self.variance[own]) + N_s[np.ix_(own, own)], lower=True)
            N += N_s - N_s[:, own] @ cho_solve(less, N_s[own])
            deviation = cho_solve(less, b_s[own])
            b += b_s - N_s[:, own] @ deviation
            c += float(b_s[own] @ deviation)
        return N, b, c

    def spread(self, correlated: Array, common: Array) -> Array:
        """``JᵀW (K + D Dᵀ + G T Gᵀ) W J`` with the weights W that the deviations leave, the derivatives J.

        Args:
            correlated: ``(rows, P)`` a root of the correlation K of the readings, times J.
            common: ``(rows, w)`` D.
        """
        assert self.series is not None
        assert self.variance is not None
        own = np.flatnonzero(self.variance)
        total, by_common = np.zeros_like(self.N), np.zeros((len(self.N), common.shape[1]))
        for s in np.unique(self.series):
            rows = self.series == s
            J = self.J[rows]
            N_s, K_s = J.T @ J, correlated[rows].T @ correlated[rows]
            less = cho_factor(np.diag(1.0 / self.variance[own]) + N_s[np.ix_(own, own)], lower=True)
            # W J = J − G A with A below, so that JᵀW K W J is made of JᵀKJ alone
            A = cho_solve(less, N_s[own])
            cut = np.eye(len(N_s))
            cut[own] -= A
            total += cut.T @ K_s @ cut
            by_common += cut.T @ (J.T @ common[rows])
            by = (N_s @ cut)[own]
            total += by.T @ (self.variance[own, None] * by)
        result: Array = total + by_common @ by_common.T
        return result


def between(study: Study, state: FittedState) -> tuple[FittedState, Scatter]:
    """The fit with the deviations of series integrated out, and their scatter.

    Args:
        study: the test. Of one series the fit stays.
        state: its fit.
    """
    families, n = state.hypothesis.families, state.blocks.nuisances
    reach = _reach(study, state)
    if isinstance(state.blocks, ScatteredBlocks):
        return state, Scatter(reach * 0.0, {}, reach)
    if not isinstance(study, PooledStudy) or study.folds.series is None:
        # the prior alone, and nothing of what is geometry
        asked = [name for name in families if name not in EXACT]
        chance = {name: _chance(np.zeros(len(RATIOS)), scale_of(name)) for name in asked}
        own = np.array([scale_of(m.family) if m.family in asked else 0.0 for m in study.members])
        return state, Scatter(own * reach, chance, reach)
    series = study.of_series[state.blocks.posture]
    ratio, chance = _ScatterSearch(study, state, series, reach).run()
    tau = np.array([ratio.get(m.family, 0.0) for m in study.members]) * reach
    own = np.array([m.family not in ZEROS for m in study.members])
    variance = np.zeros(len(state.blocks.b))
    variance[n:] = np.where(own, (tau / state.solution.noise) ** 2, 0.0)
    variance[np.setdiff1d(np.arange(len(variance)), state.solution.active)] = 0.0
    made = _scattered(state.blocks, series, variance)
    solution = solve(made, study.numbers(state.hypothesis), state.solution.sizes)
    errors = study.errors(made, solution, state.sigma)
    found = replace(state, z=solution.z[n:], blocks=made, solution=solution, errors=errors)
    return found, Scatter(tau, chance, reach)


def _reach(study: Study, state: FittedState) -> Array:
    """What τ is a share of ``(P,)``: of a spring its compliance, root mean square; of others the family's size."""
    solution, n = state.solution, state.blocks.nuisances
    variance = np.zeros(len(state.blocks.b))
    variance[solution.active] = np.diag(solution.covariance)
    result = np.zeros(len(study.members))
    for i, m in enumerate(study.members):
        if m.kind == COMPLIANCE:
            result[i] = np.hypot(m.value(float(solution.z[n + i])) / m.scale, np.sqrt(variance[n + i]))
        elif m.family in state.hypothesis.families:
            result[i] = max(solution.sizes[study.number(m.family)], RATIOS[0])
    return result


def _scattered(blocks: Blocks, series: np.ndarray, variance: Array) -> ScatteredBlocks:
    made = ScatteredBlocks(**vars(blocks), series=series, variance=variance)
    N, b, c = made.integrated(np.zeros(len(series), dtype=bool))
    parts = []
    for fold in blocks.fold:
        of_row, own = fold[blocks.posture], []
        for k in range(int(fold.max()) + 1):
            N_k, b_k, _ = made.integrated(of_row == k)
            own.append((N - N_k, b - b_k))
        parts.append(own)
    return replace(made, N=N, b=b, c=blocks.c - c, parts=tuple(parts), without_prior=N)


class _ScatterSearch:
    """Evidence of τ, family by family, from what each series says of the members."""

    def __init__(self, study: PooledStudy, state: FittedState, series: np.ndarray, reach: Array) -> None:
        n, solution = state.blocks.nuisances, state.solution
        free = np.setdiff1d(solution.active[n:], solution.at_bound)
        self.family = np.array([study.members[int(u) - n].family for u in free])
        self.reach = reach[free - n]
        self.size = {name: max(solution.sizes[study.number(name)], RATIOS[0]) for name in state.hypothesis.families}
        self.precision = 1.0 / np.array([self.size[name] for name in self.family]) ** 2
        self.information: list[tuple[Array, Array]] = []
        J, y = state.whitened.J / solution.noise, state.whitened.y / solution.noise
        bound = solution.at_bound
        y = y - J[:, bound] @ solution.z[bound]
        prior = np.diag(1.0 / state.blocks.prior**2)
        for s in np.unique(series):
            rows = series == s
            F, G, r = J[rows, :n], J[np.ix_(rows, free)], y[rows]
            A, scale = scaled(F.T @ F + prior)
            factor = cho_factor(A, lower=True)
            X = cho_solve(factor, (F.T @ np.column_stack([G, r])) * scale[:, None]) * scale[:, None]
            left = np.column_stack([G, r]) - F @ X
            M = left.T @ np.column_stack([G, r])
            self.information.append((0.5 * (M[:-1, :-1] + M[:-1, :-1].T), M[:-1, -1]))
        self.zeros = self._zeros(study, state)

    @staticmethod
    def _zeros(study: PooledStudy, state: FittedState) -> dict[str, tuple[Array, Array]]:
        """What zeros of the groups are off the shared ones by the readings alone, and variances, by family."""
        solution = state.solution
        names = study.forward(state.hypothesis.as_deflected).nuisance_names()
        found: dict[str, tuple[list[float], list[float]]] = {}
        for u, name in enumerate(names):
            if not name.startswith(ZERO):
                continue
            family = name.removeprefix(ZERO).partition(".")[0]
            variance = float(solution.covariance[u, u])
            # less what the prior said
            told = 1.0 / max(variance, 1e-12) - 1.0 / ZERO_BETWEEN**2
            if told > TOLD:
                values, variances = found.setdefault(family, ([], []))
                values.append(float(solution.z[u]) / (variance * told))
                variances.append(1.0 / told)
        return {name: (np.array(a), np.array(b)) for name, (a, b) in found.items()}

    def run(self) -> tuple[dict[str, float], dict[str, Array]]:
        """Posterior modes of τ by family, and probabilities at the ratios."""
        names = list(dict.fromkeys(self.family.tolist()))
        ratio = {name: scale_of(name) for name in names}
        chance: dict[str, Array] = {}
        for _ in range(SWEEPS):
            for name in names:
                if name in ZEROS:
                    continue
                tried = np.array([self._evidence(ratio | {name: r}) for r in RATIOS])
                chance[name] = _chance(tried, scale_of(name))
                ratio[name] = RATIOS[int(np.argmax(chance[name]))]
        for name, (values, variances) in self.zeros.items():
            if name not in self.size:
                continue
            total = variances + (np.array(RATIOS)[:, None] * self.size[name]) ** 2
            tried = -0.5 * np.sum(np.log(total) + values**2 / total, axis=1)
            chance[name] = _chance(tried, min(ZERO_BETWEEN / self.size[name], RATIOS[-1]))
            ratio[name] = RATIOS[int(np.argmax(chance[name]))]
        return ratio, chance

    def _evidence(self, ratio: Mapping[str, float]) -> float:
        tau = np.array([0.0 if f in ZEROS else ratio[f] for f in self.family]) * self.reach
        own = np.flatnonzero(tau)
        root = tau[own]
        A, b, total = np.diag(self.precision), np.zeros(len(tau)), 0.0
        for M, v in self.information:
            inner = np.eye(len(own)) + root[:, None] * M[np.ix_(own, own)] * root
            factor = cho_factor(inner, lower=True)
            X = root[:, None] * M[own]
            A = A + M - X.T @ cho_solve(factor, X)
            w = root * v[own]
            solved = cho_solve(factor, w)
            b = b + v - X.T @ solved
            total += 0.5 * float(w @ solved) - float(np.sum(np.log(np.diag(factor[0]))))
        B, scale = scaled(A)
        factor = cho_factor(B, lower=True)
        total += 0.5 * float((b * scale) @ cho_solve(factor, b * scale))
        return total - float(np.sum(np.log(np.diag(factor[0])))) + float(np.sum(np.log(scale)))


def _chance(log_evidence: Array, scale: float) -> Array:
    """Probabilities of τ at `RATIOS`, which are even in its logarithm, under half of Student's distribution."""
    ratio = np.array(RATIOS)
    log = log_evidence + np.log(ratio) - 0.5 * (TAIL + 1.0) * np.log1p((ratio / scale) ** 2 / TAIL)
    w = np.exp(log - log.max())
    result: Array = w / w.sum()
    return result
