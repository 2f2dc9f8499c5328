"""Of each family of causes the probability that with it the postures held out are predicted better.

A family acts where all the rest without it predicts worse. The probability follows from the paired differences of
the postures held out, at random and by region. Their mean over its standard error, the smaller of the two, is
taken as a normal deviate (pseudo-BMA+ of Yao, Vehtari, Simpson and Gelman 2018, for two models at a time). It asks
of the laws that they predict, and no more. Families that explain the readings as well in the place of one another
share the probability by their evidence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm_updating.findings import SURE, FindingsRow, GroupRow, findings_of
from vjm_updating.observation.distributions import normal_sf
from vjm_updating.poses.selection import Step, paired
from vjm_updating.poses.study import Errors, FittedState, Study
from vjm_updating.poses.verdict import PoseVerdict


def pose_findings(study: Study, steps: Sequence[Step], verdict: PoseVerdict) -> FindingsRow:
    """What acts, what may act, and the residual.

    Args:
        study: the test.
        steps: of the stepwise selection.
        verdict: on the last of them.
    """
    state = steps[-1].state
    probability: dict[str, float] = {}
    missed: dict[str, float] = {}
    groups = []
    for name in verdict.causes:
        errors = study.tried(state, state.hypothesis.minus(name))[1]
        together = better(errors, state.errors, state)
        missed[name] = max(sum(errors.means[1:]) - sum(state.errors.means[1:]), 0.0)
        others = _exchanged(verdict, name)
        weights = _by_evidence(study, state, name, others)
        for one, w in zip([name, *others], weights, strict=True):
            probability[one] = max(probability.get(one, 0.0), together * w)
        if others and together >= SURE:
            groups.append(GroupRow(causes=[name, *others], probability=together))
    for trial in steps[-1].trials:
        probability.setdefault(trial.name, better(state.errors, trial.errors, state))
    all_missed = sum(missed.values())
    shares = {
        name: max(verdict.explained, 0.0) * m / all_missed if all_missed else 0.0 for name, m in missed.items()
    }
    # what was not added may act: it saves too little, or does not hold where it was held out
    capped = {
        name: p if name in verdict.causes or name in {c for g in groups for c in g.causes} else min(p, SURE)
        for name, p in probability.items()
    }
    return findings_of(
        capped,
        shares,
        groups,
        explained=max(verdict.explained, 0.0),
        left=verdict.remainder.over_noise,
        more_than_noise=verdict.remainder.significant,
        trusted=verdict.kind != "unknown",
    )


def better(without: Errors, with_it: Errors, state: FittedState) -> float:
    """Probability that readings held out at random, and by region, are predicted better by one of two fits."""
    at_random = paired(without.random, with_it.random, state.sigma)[1]
    by_region = paired(without.region, with_it.region, state.sigma)[1]
    return 1.0 - float(normal_sf(min(at_random, by_region)))


def _exchanged(verdict: PoseVerdict, name: str) -> list[str]:
    """Families that stand in the place of one in a set that is as good."""
    rest = set(verdict.causes) - {name}
    found = [set(other) - rest for other in verdict.alternatives if rest <= set(other) and name not in other]
    return sorted({one for names in found for one in names})


def _by_evidence(study: Study, state: FittedState, name: str, others: Sequence[str]) -> list[float]:
    """Weights of a family and of those in its place, by the evidence of the fits with them."""
    evidence = [state.solution.log_evidence]
    for other in others:
        solution, _ = study.tried(state, state.hypothesis.minus(name).plus(other))
        evidence.append(solution.log_evidence)
    w = np.exp(np.array(evidence) - max(evidence))
    return [float(v) for v in w / w.sum()]
