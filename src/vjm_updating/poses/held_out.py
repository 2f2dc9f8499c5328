"""What fits predict of postures held out: at random, by region, and at the ends of what was measured.

Regions inside the data do not extrapolate. So the fifth of the postures with the smallest, and that with the
largest coordinate of each joint are predicted by the others, too. So are the first and the last fifth of the clock,
and of the temperature, where they are known.

Fits are compared by the differences of their distances posture by posture, over their standard error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincc

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.observation.significance import FALSE_ALARMS, NORMAL_95
from vjm_updating.poses.document import MemberRow
from vjm_updating.poses.fit import Blocks, PoseSolution, best_of, precision_of, without
from vjm_updating.poses.folds import MOST
from vjm_updating.poses.state import BY_SERIES, Errors, FittedState
from vjm_updating.poses.study import Study

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


def errors_at_ends(study: Study, blocks: Blocks, solution: PoseSolution, sigma: Array) -> Array:
    """Distances ``(g, k)`` mm of postures at ends, each predicted without its end; nan at none.

    A posture at several ends counts by its mean.
    """
    active = solution.active
    total, count = np.zeros(sigma.shape[:2]), np.zeros(sigma.shape[:2])
    for own in ends_of(study):
        rows = own[blocks.posture]
        whitened = np.full(len(blocks.y), np.nan)
        z = without(blocks, solution, rows)
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
    pairs = [(one.between, other.between), (one.region, other.region)]
    if one.series is not None and other.series is not None:
        pairs.append((one.series, other.series))
    return all(surely_saved(own, its, sigma) < NORMAL_95 for own, its in pairs)


def worse_with(study: Study, state: FittedState, ends: Array, name: str) -> str:
    """Where a hypothesis predicts surely worse with a family than without it, in words; empty where it does not.

    The linear fit at the state only says whether to fit anew. There a family borrows effects of the one left out,
    as masses do of compliances, which are gone once the fit has settled.

    Args:
        study: the test.
        state: the hypothesis with its fit.
        ends: ``(g, k)`` its distances at the ends, held out.
        name: of the family.
    """
    less = state.hypothesis.minus(name)
    solution, errors = study.tried(state, less)
    near_ends = errors_at_ends(study, study.blocks_for(state, less), solution, state.sigma)
    if not _worse(state, ends, errors, near_ends):
        return ""
    settled = study.settle(less, state)
    its_ends = errors_at_ends(study, settled.blocks, settled.solution, state.sigma)
    return _worse(state, ends, settled.errors, its_ends)


def _worse(state: FittedState, ends: Array, less: Errors, its_ends: Array) -> str:
    """Where a state predicts surely worse than another fit of the same readings, in words."""
    held = {
        state.errors.way: (state.errors.between, less.between),
        "of regions held out": (state.errors.region, less.region),
        "at the ends of what was measured": (ends, its_ends),
    }
    if state.errors.series is not None and less.series is not None:
        held[BY_SERIES] = (state.errors.series, less.series)
    for words, (with_it, without_it) in held.items():
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


@dataclass(frozen=True)
class Halves:
    """How well halves agree.

    Attributes:
        random: mean coverage of 95 % intervals by random halves.
        file: coverage by the first and the second half of the file; None where their order is not known.
        differ: whether the halves of the file differ by more than random ones.
        members: the members that differ most, with the number of standard deviations.
    """

    random: float
    file: float | None
    differ: bool
    members: tuple[tuple[str, float], ...]


def halves(study: Study, state: FittedState, members: Sequence[MemberRow]) -> Halves | None:
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
        return Halves(covered, None, False, ())
    d = _differences(state, np.arange(len(study.data)) < len(study.data) // 2)[places]
    own = float(np.mean(d**2))
    differ = chance(own, squares) < FALSE_ALARMS
    worst = np.argsort(-np.abs(d))[:NAMED]
    names = tuple(
        (study.members[int(state.solution.active[places[i]]) - n].name, float(d[i]))
        for i in worst
        if abs(d[i]) > NORMAL_95
    )
    return Halves(covered, float(np.mean(np.abs(d) < NORMAL_95)), differ, names)


def chance(square: float, squares: Sequence[float]) -> float:
    """Probability that random halves differ by as much.

    A mean square of normal numbers that are not independent is nearly distributed as chi² of the mean and the
    variance that it has (Satterthwaite, Biometrics Bulletin 2, 110, 1946).

    Args:
        square: mean square of the differences of two halves.
        squares: the same of random halves.
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
    result: Array = (z[1] - z[0]) / np.sqrt(np.maximum(variance[0] + variance[1], 1e-300))
    return result
