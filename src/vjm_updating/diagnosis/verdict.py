"""From a search to a verdict: none, named, class or unknown, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit

from vjm_updating.diagnosis.equivalence_classes import best_verdict
from vjm_updating.diagnosis.evidence import RARER
from vjm_updating.diagnosis.model_adequacy import Misfit
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.search import RIVAL, Search
from vjm_updating.diagnosis.unmodelled import unmodelled
from vjm_updating.observation.distributions import normal_sf
from vjm_updating.observation.significance import NORMAL_95

RIVALS = 12
"""Hypotheses that are compared with the best at most."""
OFFSET, SLOPE = 0.8, 0.13
"""Of the logarithm of the odds that a verdict is right over that of its posterior's (docs/hidden-effects.md)."""


@dataclass(frozen=True)
class Verdict:
    """What a search says.

    Attributes:
        kind: none, named, class or unknown.
        members: hypotheses that remain possible, the most probable first.
        probabilities: of each.
        confidence: that kind and set are right.
        others: less likely ones with their probabilities.
        rest: what the best leaves.
        places: of each member the hypotheses that have its causes elsewhere: the likeliest, see
            `credible_places`.
        doubt: why causes that fit are not named, in words; empty where that is not so.
    """

    kind: str
    members: tuple[Ranked, ...]
    probabilities: tuple[float, ...]
    confidence: float
    others: tuple[tuple[Ranked, float], ...]
    rest: Misfit
    places: tuple[tuple[Ranked, ...], ...] = ()
    doubt: str = ""


def judge(search: Search, best: Ranked) -> Verdict:
    """The verdict on a search's best hypothesis."""
    fitter = search.fitter
    # among as many causes as the catalogue has
    choice = 2.0 * float(np.log(len({effect.cause for effect in search.effects}) or 1))
    strange = search.null.objective + unmodelled(fitter, search.null) + choice
    best = _settled(search, best, strange)
    rest = search.rest(best.fit)
    if best.labels:
        for near in [r for r in search.tried.values() if r.criterion < best.criterion + RIVAL]:
            search.settled(near)
    weights = _weights(search, best)
    if best.labels:
        # or one acts beside the causes found
        further = unmodelled(fitter, best.fit, search.costs.law_error) + choice + RARER
        strange = min(strange, best.criterion + further)
    unknown = float(expit(0.5 * (best.criterion - strange)))
    if unknown > 0.5 or (best.labels and not best.fit.converged):
        return Verdict("unknown", (), (), confidence(max(0.5, unknown)), _others(weights, []), rest)
    if not best.labels:
        return Verdict("none", (), (), confidence(surely_nothing(search, strange)), _others(weights, [best]), rest)
    rivals: list[Ranked] = []
    for rival in sorted(weights, key=lambda r: r.criterion):
        if not rival.labels or rival.criterion > best.criterion + RIVAL or len(rivals) == RIVALS:
            continue
        # of a cause that can sit in several places the likeliest
        if (
            rival.fit.converged
            and all(rival.causes != m.causes for m in rivals)
            and not any(needless(other, rival) for other in (best, *rivals))
        ):
            rivals.append(rival)
    # and in whichever place it is, it is that cause
    total = {r: sum(w for other, w in weights.items() if other.causes == r.causes) for r in rivals}
    chosen, sure = best_verdict(fitter, [r.fit for r in rivals], np.array([total[r] for r in rivals]))
    members = [rivals[i] for i in chosen]
    own = np.array([total[m] for m in members])
    share = own / own.sum()
    kind = "class" if len(members) > 1 else "named"
    return Verdict(
        kind,
        tuple(members),
        tuple(float(v) for v in share),
        confidence(sure * (1.0 - unknown)),
        _others(weights, members),
        rest,
        tuple(credible_places(weights, member) for member in members),
    )


def _settled(search: Search, best: Ranked, strange: float) -> Ranked:
    """The best hypothesis whose fit has come to an end, for of another there is no evidence; else the best."""
    found = search.settled(best)
    if found.fit.converged or not found.labels:
        return found
    for other in sorted(search.tried.values(), key=lambda r: r.criterion):
        if other.labels and other.labels != best.labels and other.criterion < strange:
            other = search.settled(other)
            if other.fit.converged:
                return other
    return found


def proved(verdict: Verdict, before: float, after: float, expected: float) -> Verdict:
    """What the prediction of readings held out makes of a verdict.

    Causes that predict them worse than none are an accident of the readings fitted. But where what was held out
    lies so far from the rest that a right model could hardly do better, it proves nothing: readings held out
    together are wrong together, by one error of a normal distribution.

    Args:
        verdict: on all readings.
        before: error held out of the sheet's tolerances alone.
        after: of the likeliest member.
        expected: of a right model.
    """
    if after > before and after > NORMAL_95 * expected:
        return _unknown(verdict, "predicts what was held out worse than no cause does")
    return verdict


def confidence(posterior: float) -> float:
    """How often a verdict of such a posterior probability is right: laws are wrong as no prior says."""
    return float(expit(OFFSET + SLOPE * logit(np.clip(posterior, 1e-3, 1.0 - 1e-3))))


def _unknown(verdict: Verdict, why: str) -> Verdict:
    """Instead of a verdict that names causes; they stay among what is less likely."""
    named = tuple(zip(verdict.members, verdict.probabilities, strict=True))
    doubt = f"{' + '.join(sorted(verdict.members[0].causes))} fits, but {why}"
    sure = max(0.5, 1.0 - verdict.confidence)
    return Verdict("unknown", (), (), sure, (*named, *verdict.others), verdict.rest, doubt=doubt)


def needless(best: Ranked, rival: Ranked) -> bool:
    """Whether a rival that is no better says the same with more causes, or with a parameter more."""
    if len(rival.labels) > len(best.labels) or rival.labels > best.labels:
        return True
    others = (best.causes - rival.causes) | (best.labels - rival.labels)
    return any(others.intersection(effect.contains) for effect in rival.fit.hypothesis)


def _weights(search: Search, best: Ranked) -> dict[Ranked, float]:
    """Probability of every hypothesis tried, by its criterion; supersets of the best, a rejected null have none."""
    ranked = [r for r in search.tried.values() if not r.labels > best.labels and (r.labels or not best.labels)]
    criteria = np.array([r.criterion for r in ranked])
    w = np.exp(-0.5 * np.minimum(criteria - criteria.min(), 1400.0))
    return {r: float(v) for r, v in zip(ranked, w / w.sum(), strict=True)}


def surely_nothing(search: Search, strange: float) -> float:
    """Posterior probability that there is nothing, beside single causes and unknown ones.

    Args:
        search: that found nothing.
        strange: criterion of an unknown cause.
    """
    others = np.array([*search.singles(), strange])
    null = search.tried[frozenset()].criterion
    return float(1.0 / (1.0 + np.sum(np.exp(-0.5 * (others - null)))))


def credible_places(weights: Mapping[Ranked, float], member: Ranked) -> tuple[Ranked, ...]:
    """The likeliest hypotheses that have a member's causes elsewhere: with it, a credible set of 95 %.

    So intervals of parameters hold what they say also where it is not known which place it is.

    Args:
        weights: of all hypotheses, their probabilities.
        member: the likeliest with its causes.
    """
    elsewhere = sorted((r for r in weights if in_other_places(r, member)), key=lambda r: -weights[r])
    w = np.array([weights[member], *(weights[r] for r in elsewhere)])
    before = np.cumsum(w)[:-1] / w.sum()
    enough = 1.0 - 2.0 * float(normal_sf(NORMAL_95))
    return tuple(r for r, held in zip(elsewhere, before, strict=True) if held < enough)


def in_other_places(ranked: Ranked, member: Ranked) -> bool:
    """Whether a hypothesis has a member's causes in other places."""
    same = ranked.causes == member.causes and len(ranked.labels) == len(member.labels)
    return same and ranked.labels != member.labels and ranked.fit.converged


def _others(weights: dict[Ranked, float], members: list[Ranked]) -> tuple[tuple[Ranked, float], ...]:
    inside = {m.causes for m in members}
    left = [(r, w) for r, w in weights.items() if r.causes not in inside and r.labels]
    return tuple(sorted(left, key=lambda pair: -pair[1])[:5])
