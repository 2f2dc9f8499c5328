"""What fits predict of postures held out, and what findings are worth on other series of the same machine.

Postures are held out at random, by region, and at the ends of what was measured. On other series nothing is
refitted but frames and zeros.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import gammaincc

from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.inference.significance import FALSE_ALARMS, NORMAL_95
from vjm_updating.poses.document import HalvesRow, MemberRow
from vjm_updating.poses.families import DRIFT
from vjm_updating.poses.fit import best_of, precision_of, without
from vjm_updating.poses.forward import ReadingsForward
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.pooled import PooledStudy
from vjm_updating.poses.state import MOST, Errors, FittedState
from vjm_updating.poses.study import SeriesStudy, Study, check_same_machine

SHARE = numerical(0.2)
"""Of the postures, that an end has."""


def ends_of(study: Study) -> list[np.ndarray]:
    """Which postures ``(g,)`` each end has; those of a coordinate that does not change are left away."""
    data = study.data
    courses = [data.q[:, i] for i in range(data.q.shape[1])]
    if study.ordered:
        courses.append(np.arange(len(data), dtype=float))
    courses += [course for course in (data.time, data.temperature) if course is not None]
    result = []
    for course in courses:
        if not np.ptp(course) > 0.0:
            continue
        low, high = np.quantile(course, [SHARE, 1.0 - SHARE])
        result += [own for own in (course <= low, course >= high) if own.mean() <= MOST]
    return result


def errors_at_ends(study: Study, state: FittedState) -> Array:
    """Distances ``(g, k)`` mm of postures at ends, each predicted without its end; nan at none.

    A posture at several ends counts by its mean.
    """
    blocks, solution, sigma = state.blocks, state.solution, state.sigma
    active = solution.active
    total, count = np.zeros(sigma.shape[:2]), np.zeros(sigma.shape[:2])
    for own in ends_of(study):
        rows = own[blocks.posture]
        whitened = np.full(len(blocks.y), np.nan)
        z = without(blocks, solution, rows, *blocks.less(rows))
        whitened[rows] = blocks.y[rows] - blocks.J[rows][:, active] @ z
        distance = study.distance(study.unwhitened(whitened, sigma))
        seen = np.isfinite(distance)
        total[seen] += distance[seen]
        count += seen
    return np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan)


def saved(before: Array, after: Array) -> float:
    """Share saved of mean distances ``(g, k)`` mm."""
    mean = float(np.nanmean(before))
    return 1.0 - float(np.nanmean(after)) / mean if mean > 0.0 else 0.0


def surely_saved(before: Array, after: Array, sigma: Array) -> float:
    """By how many standard errors distances ``(g, k)`` are smaller than others in the mean.

    The standard error is of distances over the readings' standard deviations ``sigma`` (g, k, 3 or 6): a reading
    that scatters more, by its load or as an outlier, says less.
    """
    difference = (before - after) / np.sqrt(np.mean(sigma[..., :3] ** 2, axis=2))
    difference = np.nanmean(difference[np.isfinite(difference).any(axis=1)], axis=1)
    if len(difference) < 2:
        return 0.0
    spread = float(difference.std(ddof=1)) / np.sqrt(len(difference))
    less = float(difference.mean())
    if spread > 0.0:
        return less / spread
    return float(np.copysign(np.inf, less)) if less else 0.0


def as_good(one: Errors, other: Errors, sigma: Array) -> bool:
    """Whether a fit predicts postures held out as well as another, but for its noise."""
    pairs = zip(one.ways().values(), other.ways().values(), strict=True)
    return all(surely_saved(own, its, sigma) < NORMAL_95 for own, its in pairs)


def worse_with(study: Study, state: FittedState, ends: Array, name: str) -> str:
    """Where a hypothesis predicts surely worse with a family than without it, in words; empty where it does not.

    The linear fit at the state only says whether to fit anew. There a family borrows effects of the one left out,
    as masses do of compliances, which are gone once the fit has settled. The state's distances at the ends, held
    out, are ``ends`` (g, k).
    """
    less = state.hypothesis.minus(name)
    solution, errors = study.tried(state, less)
    near_ends = errors_at_ends(study, replace(state, blocks=study.blocks_for(state, less), solution=solution))
    if not _worse(state, ends, errors, near_ends):
        return ""
    settled = study.gauss_newton(less, state)
    its_ends = errors_at_ends(study, replace(settled, sigma=state.sigma))
    return _worse(state, ends, settled.errors, its_ends)


def _worse(state: FittedState, ends: Array, less: Errors, its_ends: Array) -> str:
    """Where a state predicts surely worse than another fit of the same readings, in words."""
    pairs = zip(state.errors.ways(ends).items(), less.ways(its_ends).values(), strict=True)
    for (words, with_it), without_it in pairs:
        if surely_saved(with_it, without_it, state.sigma) >= NORMAL_95:
            return f"postures {words} are predicted worse with it, by {-saved(without_it, with_it):.1%}"
    return ""


# --- Whether two halves of a test give the same members: halves drawn at random, and the first and the second -----
#
# Each half is fitted alone under the sizes of all readings. A member's difference over its own standard deviation
# has the variance one where the model is right and the members stay; coverage is the share of members within 1.96
# of it. Where the two halves of the file differ by more than random ones do in four of 1,000 tests, the machine or
# the tracker changed.

SPLITS = numerical(60)
"""Random halvings, which give the mean and the variance of the mean square of the differences."""
FEWEST = numerical(40)
"""Postures below which halves tell nothing."""
SEED = numerical(5)
NAMED = numerical(3)


def halves(study: Study, state: FittedState, members: Sequence[MemberRow]) -> HalvesRow | None:
    """Compare halves of a test; none where nothing was learnt or the postures are few."""
    learnt = {row.name for row in members if row.identifiable}
    n = state.blocks.nuisances
    places = [i for i, u in enumerate(state.solution.active) if u >= n and study.members[int(u) - n].name in learnt]
    if not places or len(study.data) < FEWEST:
        return None
    rng = np.random.default_rng(SEED)
    posture = study.folds.posture
    count = int(posture.max()) + 1
    drawn = [_differences(state, (rng.permutation(count) < count // 2)[posture])[places] for _ in range(SPLITS)]
    squares = [float(np.mean(d**2)) for d in drawn]
    covered = float(np.mean([np.mean(np.abs(d) < NORMAL_95) for d in drawn]))
    if not study.ordered:
        return HalvesRow(random=covered, file=None, differ=False)
    d = _differences(state, np.arange(len(study.data)) < len(study.data) // 2)[places]
    own = float(np.mean(d**2))
    differ = chance(own, squares) < FALSE_ALARMS
    worst = np.argsort(-np.abs(d))[:NAMED]
    farthest = {
        study.members[int(state.solution.active[places[i]]) - n].name: float(d[i])
        for i in worst
        if abs(d[i]) > NORMAL_95
    }
    inside = float(np.mean(np.abs(d) < NORMAL_95))
    return HalvesRow(random=covered, file=inside, differ=differ, members=farthest)


def chance(square: float, squares: Sequence[float]) -> float:
    """Probability that random halves differ by as much.

    A mean square of normal numbers that are not independent is nearly distributed as chi² of the mean and the
    variance that it has (Satterthwaite, Biometrics Bulletin 2, 110, 1946).
    """
    mean, variance = float(np.mean(squares)), max(float(np.var(squares, ddof=1)), 1e-300)
    return float(gammaincc(mean**2 / variance, square * mean / variance))


def _differences(state: FittedState, first: np.ndarray) -> Array:
    """Differences ``(p,)`` of the active unknowns of two parts over their standard deviations."""
    blocks, solution = state.blocks, state.solution
    active, noise2 = solution.active, solution.noise**2
    rows = first[blocks.posture]
    J = blocks.J[rows][:, active]
    N, b = J.T @ J, J.T @ blocks.y[rows]
    prior = np.diag(precision_of(blocks, blocks.family[active], solution.sizes))
    parts = (N, b), (blocks.N[np.ix_(active, active)] - N, blocks.b[active] - b)
    z = [best_of(blocks, solution, *part) for part in parts]
    variance = [np.diag(np.linalg.inv(part[0] / noise2 + prior)) for part in parts]
    return (z[1] - z[0]) / np.sqrt(np.maximum(variance[0] + variance[1], 1e-300))


ROUNDS = numerical(8)
SETTLED = numerical(1e-4)
"""Relative change of the mean distance that ends the rounds."""
ZERO = prior_scale(10.0)
"""Of their units, 10 mrad, 1 mm or a tenth of the largest load: how well zeros of another series are known
beforehand."""


def series_beside(tests: Iterable[Study], of: Study) -> list[SeriesStudy]:
    """Other series of the machine of a test.

    Raises:
        SheetError: one is of another machine.
    """
    series = [one for test in tests for one in test.groups]
    for one in series:
        check_same_machine(one, of, "--beside takes series")
    return series


def distances_of(one: SeriesStudy, study: Study, state: FittedState) -> Array:
    """Distances ``(g, k)`` mm of another series' markers by the members of a state of the test."""
    families = state.hypothesis.families
    pairs = zip(study.members, state.z.tolist(), strict=True)
    values = {m.name: z * m.scale for m, z in pairs if m.family in families}
    forward = one.forward_of(one.machine, one.data)
    # a drift is of the series in which it was seen
    forward.members = [m for m in one.all_members if m.kind != DRIFT and (m.name in values or m.set_anew)]
    z = np.array([values.get(m.name, 0.0) / m.scale for m in forward.members])
    zeros = [i for i, m in enumerate(forward.members) if m.set_anew]
    if state.hypothesis.as_deflected:
        forward = forward.with_machine(one.machine_of(state.hypothesis.as_deflected))
    return refitted(one, forward, z, zeros)[0]


def refitted(study: SeriesStudy, forward: ReadingsForward, z: Array, free: list[int]) -> tuple[Array, Array]:
    """Distances ``(g, k)`` mm of a test by given members, its frames and some of the members fitted, and weights.

    The weights ``(g, k)`` are those of outliers. Members have sizes z ``(P,)`` in their units; those that are free
    are fitted from there, known to `ZERO` units.
    """
    frames, last = study.frames, np.inf
    start = z[free].copy()
    z = z.copy()
    n = forward.nuisances
    root = np.concatenate([1.0 / study.prior, np.full(len(free), 1.0 / ZERO)])
    for _ in range(ROUNDS):
        linearised = forward.evaluate(z, frames)
        mean = float(np.nanmean(study.distance(linearised.residual)))
        if abs(last - mean) <= SETTLED * mean:
            break
        last = mean
        sigma, _ = study.noise(linearised)
        seen = np.isfinite(linearised.residual)
        J = np.concatenate([linearised.nuisance, linearised.member[..., free]], axis=3)[seen] / sigma[seen][:, None]
        y = linearised.residual[seen] / sigma[seen]
        held = np.concatenate([-linearised.off / study.prior, (start - z[free]) / ZERO])
        step = np.linalg.lstsq(np.vstack([J, np.diag(root)]), np.concatenate([y, held]), rcond=None)[0]
        frames = forward.moved(frames, step[:n])
        z[free] += step[n:]
    linearised = forward.evaluate(z, frames)
    return study.distance(linearised.residual), study.noise(linearised)[1]


def by_machine(study: Study, chain: Machine | None = None, *, zeros: bool = False) -> tuple[Array, Array]:
    """Distances ``(g, k)`` mm of a test by a machine, and the weights of outliers.

    It is the machine of a model file, or None: the test's own, extended. Zeros may be fitted beside the frames.
    """
    if isinstance(study, PooledStudy):
        pairs = []
        for one in study.groups:
            if chain is not None and one.machine.chain.sha256 != study.machine.chain.sha256:
                # the file is of the first one's model: another load, or another base, is not in it
                pairs.append((np.full(one.aligned.shape, np.nan), np.ones(one.aligned.shape)))
            else:
                pairs.append(by_machine(one, chain, zeros=True))
        return study.joined_up([one[0] for one in pairs]), study.joined_up([one[1] for one in pairs])
    assert isinstance(study, SeriesStudy)
    machine, data = study.machine, study.data
    if chain is not None:
        machine = PoseMachine(chain, study.ends(), at_output=study.sheet.at_output)
    # joints that the file has more are of the base, whose coordinates are zero
    q = np.zeros((len(data), len(machine.joints)))
    for i, name in enumerate(machine.joints):
        if name in data.joints:
            q[:, i] = data.q[:, data.joints.index(name)]
    extended = replace(data, joints=machine.joints, q=q, torque=np.full(q.shape, np.nan))
    forward = study.forward_of(machine, extended)
    if zeros:
        forward.members = [m for m in study.all_members if m.set_anew]
    free = list(range(len(forward.members)))
    return refitted(study, forward, np.zeros(len(free)), free)
