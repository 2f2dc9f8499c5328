"""Whether two halves of a test give the same members: halves drawn at random, and the first and the second.

Each half is fitted alone under the sizes of all readings. A member's difference over its own standard deviation has
the variance one where the model is right and the members stay; coverage is the share of members within 1.96 of it.
Where the two halves of the file differ by more than random ones do in four of 1,000 tests, the machine or the
tracker changed.
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
from vjm_updating.poses.fit import best_of, precision_of
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import Study

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
