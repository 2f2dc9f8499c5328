"""What postures tell: which members the data fix, how far they support a model, and the next readings to take.

Support is asked over the joints' whole range; the next readings make the members (D) or the predictions (I)
most certain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vjm.errors import NoConvergenceError
from vjm.machine.equilibria import unloaded_frames
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, shown, stated_level
from vjm_updating.inference.bounded_normal import truncated_draws
from vjm_updating.inference.significance import NORMAL_95
from vjm_updating.poses.document import MemberRow, NextRow, RangeRow
from vjm_updating.poses.fit import NormalEquations, PoseSolution, PostureNoise, best_of, precision_of, scaled, solve
from vjm_updating.poses.pooled import between
from vjm_updating.poses.state import Candidates, FittedState
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
        """Ends of the 95 % interval of an unknown in a new series, by draws ``(d,)`` of what it is off there."""
        if not deviation.any():
            return float(self.low[place]), float(self.high[place])
        drawn = np.clip(self.draws[:, place] + deviation, *bounds)
        side, low, high = int(self.side[place]), float(self.low[place]), float(self.high[place])
        levels = [LOW, HIGH] if side == 0 else [1.0 - ONE_SIDED, ONE_SIDED]
        first, last = np.quantile(drawn, levels).tolist()
        return low if side > 0 else min(first, low), high if side < 0 else max(last, high)


def marginals(blocks: NormalEquations, solution: PoseSolution, noise: PostureNoise) -> Marginal:
    """The marginals of a fit, nuisances first.

    The fit takes readings as independent. What it errs by counts their correlation, the noise.
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
                name=member.name, value=value, std=sd * member.scale, interval95=[first, last],
                within_series95=[low, high], scatter=float(scatter.tau[unknown - n]) * member.scale,
                one_sided=SIDES[side], unit=member.unit, learnt=max(1.0 - (sd / prior) ** 2, 0.0),
                identifiable=says and sd < LEARNT * prior, one_with=together.get(member.name, []),
                at_bound=int(unknown) in bound, in_file=None, beyond_bound=float(marginal.pull[place]),
            )
        )  # fmt: skip
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


DRAWN = numerical(300)
"""Postures drawn over the joints' whole range."""
SUPPORT_SEED = numerical(11)
TURN = definition(2.0 * np.pi, "rad")
"""Of a joint, after which its postures are the same."""
DEPENDENT = numerical(1e-9)
"""Singular value over the largest, below which a direction is none."""
BY_REGION = definition(1)
"""Number of the regions among the kinds of folds, see `vjm_updating.poses.state.Folds.parts`."""


@dataclass(frozen=True)
class RangeSupport:
    """What the postures support.

    Attributes:
        place: ``(c, 3)`` mm of the first marker by the rigid model, in the postures drawn, and
        error: ``(c,)`` mm predicted there of the file: root mean square of its markers.
        row: what is said of it in the document.
    """

    place: Array
    error: Array
    row: RangeRow


def whole_range(study: Study) -> list[tuple[float, float]]:
    """The whole range of each joint, rad or mm: its limits, or a turn. Without either what was measured."""
    ranges = []
    for i, name in enumerate(study.data.joints):
        own = (float(study.data.q[:, i].min()), float(study.data.q[:, i].max()))
        limits = study.machine.limits[i]
        if name in study.machine.turning and (limits is None or limits[1] - limits[0] >= TURN):
            middle = 0.5 * (own[0] + own[1])
            ranges.append((middle - 0.5 * TURN, middle + 0.5 * TURN))
        else:
            ranges.append(own if limits is None or not np.isfinite(limits).all() else limits)
    return ranges


def missed2(state: FittedState) -> float:
    """Mean square of what a fit misses where regions were held out, mm²; infinite where nothing was."""
    seen = np.isfinite(state.errors.region)
    return float(np.average(state.errors.region[seen] ** 2, weights=state.weight[seen])) if seen.any() else np.inf


def lack_of(study: Study, state: FittedState) -> float:
    """What the model lacks, mm: what regions that were held out missed beyond the noise; 0 where nothing was."""
    missed, noise = missed2(state), 3.0 * float(np.nanmedian(study.data.sigma**2))
    return float(np.sqrt(max(missed - noise, 0.0))) if missed < np.inf else 0.0


def supported(study: Study, state: FittedState, model: float) -> tuple[FittedState, RangeSupport | None]:
    """The fit with the prior over the joints' whole range, and what it says there.

    Args:
        study: the test.
        state: the fit.
        model: root mean square that the model before it misses, held out by region, mm.

    Returns:
        The fit as it was, and None, where nothing was fitted or can be held out, or a posture has no equilibrium.
    """
    n, active = state.blocks.nuisances, state.solution.active
    if len(active) <= n or not study.folds.several or not 0.0 < model < np.inf:
        return state, None
    rng = np.random.default_rng(SUPPORT_SEED)
    drawn = study.drawn(rng, DRAWN, whole_range(study))
    try:
        J = effects(study, state, drawn)[..., active[n:] - n]
    except NoConvergenceError:
        return state, None
    members = [study.members[u - n] for u in active[n:]]
    W = np.einsum("gkap,gkaq->pq", J, J) / (J.shape[0] * J.shape[1])
    scale = np.sqrt(np.maximum(np.diag(W), np.finfo(float).tiny))
    rank = np.linalg.matrix_rank(W / np.outer(scale, scale), tol=DEPENDENT, hermitian=True)
    before = state.solution.z[active[n:]]
    fit = _with_prior(study, state, W * rank / model**2)
    after = fit.solution.z[active[n:]]
    nearer = np.abs(after) < np.abs(after - before)
    place = unloaded_frames(study.machine.tree, study.machine.rows(drawn.q))[1][:, 0]
    asked, changed = (float(np.sqrt(z @ W @ z)) for z in (before, after))
    error = np.hypot(_errors(fit, J), lack_of(study, fit))
    row = RangeRow(
        model_mm=model, asked_mm=asked, changed_mm=changed, error_mm=float(np.sqrt(np.mean(error**2))),
        unsupported=[m.name for m, near in zip(members, nearer, strict=True) if near],
    )  # fmt: skip
    return fit, RangeSupport(place, error, row)


def _with_prior(study: Study, state: FittedState, precision: Array) -> FittedState:
    """A fit with one more normal prior of its members ``(p, p)``, as a reading of zeros that no part holds out."""
    blocks, members = state.blocks, state.solution.active[state.blocks.nuisances :]
    N = blocks.N.copy()
    N[np.ix_(members, members)] += state.solution.noise**2 * precision
    held = replace(blocks, N=N)
    solution = solve(held, study.numbers(state.hypothesis), state.solution.sizes)
    errors = study.errors(held, solution, state.sigma)
    return replace(state, z=solution.z[blocks.nuisances :], blocks=held, solution=solution, errors=errors)


def effects(study: Study, state: FittedState, drawn: Candidates) -> Array:
    """Motions ``(c, k, 3, P)`` of the markers by the members, mm per unit, without what the frames take up."""
    linearised = study.at_candidates(state, drawn)
    J, F = linearised.member[..., :3, :], linearised.nuisance[..., :3, :].reshape(-1, linearised.nuisance.shape[-1])
    U, s, _ = np.linalg.svd(F, full_matrices=False)
    U = U[:, s > DEPENDENT * float(s.max(initial=0.0))]
    flat = J.reshape(-1, J.shape[-1])
    return (flat - U @ (U.T @ flat)).reshape(J.shape)


def _errors(state: FittedState, J: Array) -> Array:
    """Predicted errors ``(c,)`` mm by fits without one region each; J ``(c, k, 3, p)`` are the members' motions."""
    blocks, active = state.blocks, state.solution.active
    z = np.array(
        [
            best_of(blocks, state.solution, (blocks.N - N)[np.ix_(active, active)], (blocks.b - b)[active])
            for N, b in blocks.parts[BY_REGION]
        ]
    )[:, blocks.nuisances :]
    moved = np.einsum("gkap,rp->rgka", J, z - z.mean(axis=0))
    return np.sqrt(np.mean(np.sum(moved**2, axis=3), axis=2).sum(axis=0) * (len(z) - 1) / len(z))


CRITERIA: tuple[Literal["D", "I"], ...] = ("D", "I")
CANDIDATES = numerical(200)
NEXT_COUNT = numerical(6)
NEXT_SEED = numerical(7)
SAMPLE = numerical(60)
"""Measured postures whose predictions are looked at."""


def next_postures(study: Study, state: FittedState, listed: Candidates | None = None) -> list[NextRow]:
    """Next postures by both criteria; empty where nothing was fitted but frames."""
    if not state.hypothesis.families:
        return []
    possible = study.drawn(np.random.default_rng(NEXT_SEED), CANDIDATES) if listed is None else listed
    try:
        linearised = study.at_candidates(state, possible)
    except NoConvergenceError:
        return []
    J = np.concatenate([linearised.nuisance, linearised.member], axis=3)
    active = state.solution.active
    # of one reading
    sigma = np.nanmedian(state.sigma, axis=0)
    sigma = np.where(np.isfinite(state.linearised.residual).any(axis=0), sigma, np.inf).reshape(-1, 1)
    rows = np.nan_to_num(J.reshape(len(possible), len(sigma), -1)[..., active] / sigma)
    keep = np.linspace(0, len(study.data) - 1, min(SAMPLE, len(study.data))).astype(int)
    seen = np.concatenate([state.linearised.nuisance, state.linearised.member], axis=3)[keep][..., :3, :]
    view = seen.reshape(-1, seen.shape[-1])[:, active]
    return [_chosen(study, criterion, state, rows, view, possible) for criterion in CRITERIA]


def _chosen(
    study: Study, criterion: Literal["D", "I"], state: FittedState, rows: Array, view: Array, possible: Candidates
) -> NextRow:
    n = state.blocks.nuisances
    before = state.solution.covariance
    free = np.diag(before) > 0.0
    C = before.copy()
    taken: list[int] = []
    for _ in range(min(NEXT_COUNT, len(possible))):
        best, best_gain = -1, -np.inf
        for i, J in enumerate(rows):
            if i in taken:
                continue
            S = np.eye(len(J)) + J @ C @ J.T
            if criterion == "D":
                gain = float(np.linalg.slogdet(S)[1])
            else:
                G = view @ C @ J.T
                gain = float(np.sum(G * np.linalg.solve(S, G.T).T))
            if gain > best_gain:
                best, best_gain = i, gain
        taken.append(best)
        J = rows[best]
        CJ = C @ J.T
        C = C - CJ @ np.linalg.solve(np.eye(len(J)) + J @ CJ, CJ.T)
    members = free.copy()
    members[:n] = False
    ratio = np.sqrt(np.maximum(np.diag(C)[members], 1e-300) / np.diag(before)[members])
    seen_before = np.einsum("ri,ij,rj->r", view, before, view)
    seen_after = np.einsum("ri,ij,rj->r", view, C, view)
    promised = float(np.exp(np.mean(np.log(ratio)))) if len(ratio) else 1.0
    loads = [dict(zip(study.points, load.tolist(), strict=True)) for load in possible.load[taken]]
    prediction = float(np.sqrt(seen_after.sum() / max(seen_before.sum(), 1e-300)))
    return NextRow(
        criterion=criterion, joints=list(study.data.joints), q=possible.q[taken].tolist(), loads=loads,
        members=promised, prediction=prediction,
    )  # fmt: skip
