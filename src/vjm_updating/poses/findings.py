"""Of each family of causes the probability that it acts: how much better it predicts postures held out.

A family acts where all the rest without it predicts worse. The probability is the posterior of that against no
difference at all (`acting`), by the paired differences of the postures held out, at random and by region. Their
mean over its standard error is taken, the smaller of the two. It asks of the laws that they predict, and no more.
Families that explain the readings as well in the place of one another share the probability by their evidence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import expit, log_ndtr

from vjm_updating.findings import SURE, FindingsRow, GroupRow, findings_of
from vjm_updating.poses.selection import Step, savings
from vjm_updating.poses.state import Errors, FittedState
from vjm_updating.poses.study import Study
from vjm_updating.poses.verdict import SPRING, PoseVerdict


def pose_findings(study: Study, steps: Sequence[Step], verdict: PoseVerdict) -> FindingsRow:
    """What acts, what may act, and the residual.

    Args:
        study: the test.
        steps: of the stepwise selection.
        verdict: on the last of them.
    """
    state = steps[-1].state
    families = len({*verdict.causes, *(trial.name for trial in steps[-1].trials)})
    probability: dict[str, float] = {}
    missed: dict[str, float] = {}
    groups = []
    for name in verdict.causes:
        errors = study.tried(state, state.hypothesis.minus(name))[1]
        together = predicts(errors, state.errors, state, families)
        missed[name] = max(sum(errors.means[1:]) - sum(state.errors.means[1:]), 0.0)
        others = _exchanged(verdict, name)
        weights = _by_evidence(study, state, name, others)
        for one, w in zip([name, *others], weights, strict=True):
            probability[one] = max(probability.get(one, 0.0), together * w)
        if others and together >= SURE:
            groups.append(GroupRow(causes=[name, *others], probability=together))
    for trial in steps[-1].trials:
        probability.setdefault(trial.name, predicts(state.errors, trial.errors, state, families))
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


def predicts(without: Errors, with_it: Errors, state: FittedState, families: int) -> float:
    """Probability that a family acts, by readings held out at random and by region, without it and with it."""
    postures = int(np.isfinite(without.random).any(axis=1).sum())
    return acting(min(one.sure for one in savings(without, with_it, state.sigma)), postures, families)


def acting(deviate: float, postures: int, families: int) -> float:
    """Posterior probability that the mean of paired differences is above zero, against that it is zero.

    Where it is, its prior is half a normal distribution with the standard deviation of one difference (the unit
    information of Kass and Wasserman, J. Am. Stat. Assoc. 90, 1995). Of so many families one acts in the mean.

    Args:
        deviate: the mean over its standard error.
        postures: number of differences.
        families: among which it is one.
    """
    share = postures / (postures + 1.0)
    factor = float(np.log(2.0) + log_ndtr(deviate * share**0.5) + 0.5 * deviate**2 * share)
    return float(expit(factor - 0.5 * np.log1p(postures) - np.log(families)))


def _exchanged(verdict: PoseVerdict, name: str) -> list[str]:
    """Families that stand in the place of one in a set that is as good."""
    rest = set(verdict.causes) - {name}
    found = [set(other) - rest for other in verdict.alternatives if rest <= set(other) and name not in other]
    return sorted({one for names in found for one in names})


def _by_evidence(study: Study, state: FittedState, name: str, others: Sequence[str]) -> list[float]:
    """Weights of a family and of those in its place, by the evidence of the fits with them."""
    evidence = [state.solution.log_evidence]
    for other in others:
        if other.partition(".")[0] == SPRING:
            evidence.append(evidence[0])  # it does what the waves of its joint do
            continue
        solution, _ = study.tried(state, state.hypothesis.minus(name).plus(other))
        evidence.append(solution.log_evidence)
    w = np.exp(np.array(evidence) - max(evidence))
    return [float(v) for v in w / w.sum()]
