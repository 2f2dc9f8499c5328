"""Which members the data fix, and which only together with others or with the frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm_updating.observation.significance import NORMAL_95
from vjm_updating.poses.study import State, Study

LEARNT = 0.9
"""Posterior over prior standard deviation above which the data say nothing of a member."""
ONE = 1.0 - 1e-5
"""Share of a member's column in those of others from which on they are one."""
TAKES_PART = 0.2
"""Part in the combination, over the largest, from which on another member is named."""
MOST_NAMED = 4


@dataclass(frozen=True)
class MemberEstimate:
    """A member's value.

    Attributes:
        name: of the member.
        value: in ``unit``, the model's own included.
        std: standard deviation.
        low: and
        high: ends of the 95 % interval, within the bounds.
        unit: for people.
        learnt: share of its prior variance that the data took away.
        identifiable: whether they say anything of it.
        one_with: members and frames with which it is one.
        at_bound: whether it stands at its physical bound.
    """

    name: str
    value: float
    std: float
    low: float
    high: float
    unit: str
    learnt: float
    identifiable: bool
    one_with: tuple[str, ...]
    at_bound: bool


def estimates(study: Study, state: State) -> list[MemberEstimate]:
    """Every member of a state's hypothesis, in the order of the members."""
    solution, n = state.solution, state.blocks.nuisances
    std = np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))
    result = []
    together = combinations(study, state)
    bound = set(solution.at_bound.tolist())
    for place, unknown in enumerate(solution.active):
        if unknown < n:
            continue
        member = study.members[unknown - n]
        size = solution.sizes[study.number(member.family)]
        value = member.nominal + float(solution.z[unknown]) * member.unit
        held = int(unknown) in bound
        # at a bound the other side is what the prior and the data leave
        sd = (min(size, _one_sided(state, int(unknown), size)) if held else float(std[place])) * member.unit
        learnt = 1.0 - (sd / (size * member.unit)) ** 2
        low = max(value - NORMAL_95 * sd, member.nominal + member.lower)
        result.append(
            MemberEstimate(
                member.name,
                value,
                sd,
                low,
                value + NORMAL_95 * sd,
                member.of,
                max(learnt, 0.0),
                sd < LEARNT * size * member.unit,
                together.get(member.name, ()),
                held,
            )
        )
    return result


def _one_sided(state: State, unknown: int, size: float) -> float:
    """Standard deviation of a member that stands at its bound, the others at their best, in its unit."""
    own = float(state.blocks.N[unknown, unknown]) / state.solution.noise**2
    return float(1.0 / np.sqrt(own + 1.0 / size**2))


def combinations(study: Study, state: State) -> dict[str, tuple[str, ...]]:
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
        result[names[i]] = tuple(dict.fromkeys(named))[:MOST_NAMED]
    return result
