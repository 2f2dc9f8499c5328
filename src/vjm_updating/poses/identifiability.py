"""Which members the data fix, and which only together with others or with the frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, shown, stated_level
from vjm_updating.inference.truncated_normal import truncated_draws
from vjm_updating.observation.significance import NORMAL_95
from vjm_updating.poses.between import between
from vjm_updating.poses.document import MemberRow
from vjm_updating.poses.fit import Blocks, PoseSolution, precision_of, scaled
from vjm_updating.poses.posture_noise import PostureNoise
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import Study

# --- Marginal intervals of a normal posterior that bounds truncate ------------------------------------------------
#
# Where a member stands at its bound the others may still push it. Its interval given the others' best values is
# that of a conditional distribution, and far too narrow. The members with bounds are drawn from the truncated
# normal distribution; those without follow by their regression on them.

LOW, HIGH, ONE_SIDED = stated_level(0.025), stated_level(0.975), stated_level(0.95)


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
        draws: ``(d, p)`` of the distributions.
    """

    std: Array
    low: Array
    high: Array
    side: np.ndarray
    pull: Array
    draws: Array

    def of_new_series(self, place: int, deviation: Array, bounds: tuple[float, float]) -> tuple[float, float]:
        """Ends of the 95 % interval of an unknown in a new series.

        Args:
            place: of the unknown.
            deviation: ``(d,)`` draws of what it is off there.
            bounds: least and largest value.
        """
        if not deviation.any():
            return float(self.low[place]), float(self.high[place])
        drawn = np.clip(self.draws[:, place] + deviation, *bounds)
        side, low, high = int(self.side[place]), float(self.low[place]), float(self.high[place])
        levels = [LOW, HIGH] if side == 0 else [1.0 - ONE_SIDED, ONE_SIDED]
        first, last = np.quantile(drawn, levels).tolist()
        return low if side > 0 else min(first, low), high if side < 0 else max(last, high)


def marginals(blocks: Blocks, solution: PoseSolution, noise: PostureNoise) -> Marginal:
    """The marginals of a fit, nuisances first.

    The fit takes readings as independent. What it errs by counts their correlation.

    Args:
        blocks: normal equations.
        solution: the fit.
        noise: how readings of like postures are correlated.
    """
    active, noise2 = solution.active, solution.noise**2
    precision = precision_of(blocks, blocks.family[active], solution.sizes)
    A, scale = scaled(blocks.N[np.ix_(active, active)] / noise2 + np.diag(precision))
    C = cho_solve(cho_factor(A, lower=True), np.eye(len(A))) * np.outer(scale, scale)
    mean = C @ (blocks.b[active] / noise2)
    # of the estimate C (Jᵀy + ...) with the covariance K of y, the prior's part as before: the sandwich formula
    C = C @ (noise.spread(blocks)[np.ix_(active, active)] / noise2 + np.diag(precision)) @ C
    sd = np.sqrt(np.diag(C))
    low, high = blocks.lower[active], blocks.upper[active]
    pull = np.maximum(np.maximum((low - mean) / sd, (mean - high) / sd), 0.0)
    draws = truncated_draws(mean, C, low, high, solution.z[active])
    if draws is None:
        normal = mean + sd * np.random.default_rng(SEED).standard_normal((DRAWS, len(A)))
        ends = mean - NORMAL_95 * sd, mean + NORMAL_95 * sd
        return Marginal(sd, *ends, np.zeros(len(A), dtype=int), pull, normal)
    z = solution.z[active]
    first, last = np.quantile(draws, [LOW, HIGH], axis=0)
    least, most = np.quantile(draws, [1.0 - ONE_SIDED, ONE_SIDED], axis=0)
    # a bound that the readings do not exclude is the end, whether the best value stands at it or beside it
    at_low, at_high = mean - low < NORMAL_95 * sd, high - mean < NORMAL_95 * sd
    at_low, at_high = (z <= low) | at_low & ~at_high, (z >= high) | at_high & ~at_low
    # the best of all members together may lie beyond nearly all of one's own distribution: it is then the end
    side = np.where(at_low | (z >= last) & ~at_high, 1, np.where(at_high | (z <= first), -1, 0))
    first = np.where(at_low, low, np.minimum(np.where(at_high, least, first), z))
    last = np.where(at_high, high, np.maximum(np.where(at_low, most, last), z))
    return Marginal(draws.std(axis=0), first, last, side, pull, draws)


# ------------------------------------------------------------------------------------------------------------------


DRAWS, SEED = numerical(8000), numerical(17)
LEARNT = stated_level(0.9)
"""Posterior over prior standard deviation above which the data say nothing of a member."""
ONE = numerical(1.0 - 1e-5)
"""Share of a member's column in those of others from which on they are one."""
TAKES_PART = shown(0.2)
"""Part in the combination, over the largest, from which on another member is named."""
MOST_NAMED = shown(4)
SIDES: dict[int, Literal["", "at most", "at least"]] = {1: "at most", -1: "at least", 0: ""}
"""Words for what a one-sided interval says."""
HALF_NORMAL = definition(float(np.sqrt(1.0 - 2.0 / np.pi)))
"""Standard deviation of a normal distribution about a bound over that of the whole one."""


def estimates(study: Study, state: FittedState) -> list[MemberRow]:
    """Every member of a state's hypothesis, in the order of the members, with intervals of a new series."""
    state, scatter = between(study, state)
    solution, n = state.solution, state.blocks.nuisances
    marginal = marginals(state.blocks, solution, state.noise)
    result = []
    together = combinations(study, state)
    bound = set(solution.at_bound.tolist())
    for place, unknown in enumerate(solution.active):
        if unknown < n:
            continue
        member = study.members[unknown - n]
        size = solution.sizes[study.number(member.family)]
        # a compliance of zero halves its prior
        prior = size * (HALF_NORMAL if state.blocks.lower[unknown] > -size else 1.0)
        sd = float(marginal.std[place])
        deviation = scatter.draws(member.family, int(unknown) - n, len(marginal.draws))
        bounds = float(state.blocks.lower[unknown]), float(state.blocks.upper[unknown])
        ends = marginal.of_new_series(place, deviation, bounds)
        side = int(marginal.side[place])
        # an interval from bound to bound says nothing
        says = (side >= 0 and ends[1] < bounds[1]) or (side <= 0 and ends[0] > bounds[0])
        value, low, high, first, last = (
            member.value(float(v)) for v in (solution.z[unknown], marginal.low[place], marginal.high[place], *ends)
        )
        result.append(
            MemberRow(
                name=member.name,
                value=value,
                std=sd * member.scale,
                interval95=[first, last],
                within_series95=[low, high],
                scatter=float(scatter.tau[unknown - n]) * member.scale,
                one_sided=SIDES[side],
                unit=member.unit,
                learnt=max(1.0 - (sd / prior) ** 2, 0.0),
                identifiable=says and sd < LEARNT * prior,
                one_with=together.get(member.name, []),
                at_bound=int(unknown) in bound,
                in_file=None,
                beyond_bound=float(marginal.pull[place]),
            )
        )
    return result


def combinations(study: Study, state: FittedState) -> dict[str, list[str]]:
    """Members whose effect others can make up wholly, and which those are."""
    active, n = state.solution.active, state.blocks.nuisances
    N = state.blocks.N[np.ix_(active, active)]
    scale = np.sqrt(np.maximum(np.diag(N), 1e-300))
    C = N / np.outer(scale, scale)
    inverse = np.linalg.inv(C + 1e-9 * np.eye(len(C)))
    frames = study.forward().nuisance_names()
    names = [*frames, *(study.members[u - n].name for u in active[n:])]
    result = {}
    for i in range(n, len(active)):
        if np.diag(N)[i] <= 0.0 or 1.0 - 1.0 / inverse[i, i] < ONE:
            continue
        part = np.abs(inverse[i] / inverse[i, i])
        part[i] = 0.0
        order = np.argsort(-part)
        named = [names[j] for j in order if part[j] > TAKES_PART * part.max()]
        result[names[i]] = list(dict.fromkeys(named))[:MOST_NAMED]
    return result
