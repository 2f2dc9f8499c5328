"""Which members the data fix, and which only together with others or with the frames."""

from __future__ import annotations

from typing import Literal

import numpy as np

from vjm_updating.constants import definition, numerical, shown, stated_level
from vjm_updating.poses.document import MemberRow
from vjm_updating.poses.marginals import marginals
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import Study

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
    """Every member of a state's hypothesis, in the order of the members."""
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
        value, low, high = (
            member.value(float(v)) for v in (solution.z[unknown], marginal.low[place], marginal.high[place])
        )
        result.append(
            MemberRow(
                name=member.name,
                value=value,
                std=sd * member.scale,
                interval95=[low, high],
                one_sided=SIDES[int(marginal.side[place])],
                unit=member.unit,
                learnt=max(1.0 - (sd / prior) ** 2, 0.0),
                identifiable=sd < LEARNT * prior,
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
