"""From a search to a verdict: none, named, class or unknown, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_validation.diagnosis.classes import best_verdict
from vjm_validation.diagnosis.criterion import size_covariance, would_not_show
from vjm_validation.diagnosis.fitting import Fit, Fitter
from vjm_validation.diagnosis.forward import values_of
from vjm_validation.diagnosis.misfit import Misfit, misfit
from vjm_validation.diagnosis.normal_equations import inverse
from vjm_validation.diagnosis.search import WRONG_LAW, Ranked, Search
from vjm_validation.diagnosis.unknowns import release_key

MISFIT, DOUBTFUL = 0.001, 0.01
"""Chance of calling a right model wrong: the sheet's, and one with causes, since what no catalogue has may be as
likely as they are and is often half explained by one."""
STRAINED = 1e-6
"""Chance of nuisances so far from the sheet's below which the model is wrong, however well it then fits."""
RIVAL = 16.0
"""Criterion within which of the best a hypothesis may belong to its class."""
PAYS = 6.6
"""Fall of the objective for which a law with a parameter more is preferred: one in a hundred does so by chance."""
RIVALS = 12
"""Hypotheses that are compared with the best at most."""
FURTHER = 0.6
"""How sure a further cause is beside a first one: several explain what no catalogue has, too (docs/blind.md)."""
UNPROVED, ACCIDENT = 0.5, 0.7
"""How sure a cause is that predicts what was held out worse than none, and that several such are an accident."""
BY_CHANCE = 2.0
"""Times a right model's expected error that its error may be: readings held out together are wrong together."""
UNSEEN = 0.65
"""How sure it is that there is nothing where nothing is seen: the rest hides what is too faint (docs/blind.md)."""
SUREST, SUREST_CAUSE = 0.99, 0.88
"""No verdict is surer, and none that names causes: what no catalogue has may look just like one of them
(docs/blind.md)."""
NORMAL_95 = 1.959963984540054


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
    """

    kind: str
    members: tuple[Ranked, ...]
    probabilities: tuple[float, ...]
    confidence: float
    others: tuple[tuple[Ranked, float], ...]
    rest: Misfit


def judge(search: Search, best: Ranked) -> Verdict:
    """The verdict on a search's best hypothesis."""
    fitter = search.fitter
    best = search.settled(best)
    rest = misfit(fitter, best.fit)
    explained = search.null.objective - best.fit.objective
    misses = rest.p < DOUBTFUL and rest.left > WRONG_LAW * explained
    wrong = misses or rest.strained < STRAINED
    if best.labels and not wrong:
        search.alike(best)
        for near in [r for r in search.tried.values() if r.criterion < best.criterion + RIVAL]:
            search.settled(near)
    weights = _weights(search, best)
    if not best.labels:
        if rest.p < MISFIT or rest.strained < STRAINED:
            sure = min(SUREST, 1.0 - min(rest.p, rest.strained))
            return Verdict("unknown", (), (), sure, _others(weights, []), rest)
        return Verdict("none", (), (), _quiet(search, rest), _others(weights, [best]), rest)
    if wrong or not best.fit.converged:
        return Verdict("unknown", (), (), min(SUREST, 1.0 - min(rest.p, rest.strained)), _others(weights, []), rest)
    rivals: list[Ranked] = []
    for rival in sorted(weights, key=lambda r: r.criterion):
        if not rival.labels or rival.criterion > best.criterion + RIVAL or len(rivals) == RIVALS:
            continue
        # of a cause that can sit in several places the likeliest
        if (
            rival.fit.converged
            and all(rival.causes != m.causes for m in rivals)
            and not needless(fitter, best, rival)
        ):
            rivals.append(rival)
    # and in whichever place it is, it is that cause
    total = {r: sum(w for other, w in weights.items() if other.causes == r.causes) for r in rivals}
    chosen, sure = best_verdict(fitter, [r.fit for r in rivals], np.array([total[r] for r in rivals]))
    members = [rivals[i] for i in chosen]
    own = np.array([total[m] for m in members])
    share = own / own.sum()
    # what the misfit test nearly rejects is less sure
    sure *= float(np.clip(rest.p / 0.02, 0.3, 1.0)) * FURTHER ** (len(members[0].labels) - 1)
    kind = "class" if len(members) > 1 else "named"
    return Verdict(
        kind,
        tuple(members),
        tuple(float(v) for v in share),
        min(SUREST_CAUSE, sure),
        _others(weights, members),
        rest,
    )


def proved(verdict: Verdict, before: float, after: float, expected: float) -> Verdict:
    """What the prediction of readings held out makes of a verdict.

    Several causes that predict them worse than none are an accident of the readings fitted; one such is unsure. But
    where what was held out lies so far from the rest that a right model could hardly do better, it proves nothing.

    Args:
        verdict: on all readings.
        before: error held out of the sheet's tolerances alone.
        after: of the likeliest member.
        expected: of a right model.
    """
    if after <= before or after <= BY_CHANCE * expected:
        return verdict
    if len(verdict.members[0].labels) > 1:
        words = replace(verdict.rest, worst="what no causes predict")
        return replace(verdict, kind="unknown", members=(), probabilities=(), confidence=ACCIDENT, rest=words)
    return replace(verdict, confidence=verdict.confidence * UNPROVED)


def needless(fitter: Fitter, best: Ranked, rival: Ranked) -> bool:
    """Whether a rival says the same with more causes, or with a parameter more that would show and does not pay."""
    if len(rival.labels) > len(best.labels) or rival.labels > best.labels:
        return True
    if rival.fit.objective <= best.fit.objective - PAYS:
        return False
    others, A = best.causes - rival.causes, fitter.normal(rival.fit)
    return any(
        others.intersection(effect.contains) and not would_not_show(effect, size_covariance(A, rival.fit, i))
        for i, effect in enumerate(rival.fit.hypothesis)
    )


def _weights(search: Search, best: Ranked) -> dict[Ranked, float]:
    """Probability of every hypothesis tried, by its criterion; supersets of the best, a rejected null have none."""
    ranked = [r for r in search.tried.values() if not r.labels > best.labels and (r.labels or not best.labels)]
    criteria = np.array([r.criterion for r in ranked])
    w = np.exp(-0.5 * np.minimum(criteria - criteria.min(), 1400.0))
    return {r: float(v) for r, v in zip(ranked, w / w.sum(), strict=True)}


def _quiet(search: Search, rest: Misfit) -> float:
    least = min((s.p for s in search.first), default=1.0)
    # an alarm that nearly came, or a misfit, makes it less sure
    return UNSEEN * min(
        float(1.0 / (1.0 + 0.05 * search.alarm / max(least, search.alarm))), 0.5 + 0.5 * min(1.0, rest.p / 0.05)
    )


def _others(weights: dict[Ranked, float], members: list[Ranked]) -> tuple[tuple[Ranked, float], ...]:
    inside = {m.causes for m in members}
    left = [(r, w) for r, w in weights.items() if r.causes not in inside and r.labels]
    return tuple(sorted(left, key=lambda pair: -pair[1])[:5])


@dataclass(frozen=True)
class Estimate:
    """A parameter.

    Attributes:
        value: in its unit.
        std: standard deviation.
        low: end of the 95 % interval.
        high: end of the 95 % interval.
    """

    value: float
    std: float
    low: float
    high: float


def estimates(fitter: Fitter, fit: Fit, force: float) -> dict[str, Estimate]:
    """The parameters of a fit under docs/measured-data.md's names, with their uncertainty to first order."""
    covariance = _covariance(fitter, fit)
    result: dict[str, Estimate] = {}
    for i, effect in enumerate(fit.hypothesis):
        key = release_key(effect)
        here = _reported(fit, fit.at.z, i, force)
        own = (
            [k for k, c in enumerate(fit.found) if c.kind == "effect" and c.subject == str(i)]
            if key is None
            else [k for k, c in enumerate(fit.found) if (c.kind, c.subject) == key]
        )
        slopes = {name: np.zeros(len(fit.found)) for name in here}
        for k in own:
            h = 1e-5 * max(1.0, abs(float(fit.at.z[k])))
            z = fit.at.z.copy()
            z[k] += h
            for name, value in _reported(fit, z, i, force).items():
                slopes[name][k] = (value - here[name]) / h
        for name, value in here.items():
            std = max(float(slopes[name] @ covariance @ slopes[name]), 0.0) ** 0.5
            result[name] = Estimate(value, std, value - NORMAL_95 * std, value + NORMAL_95 * std)
    return result


def _reported(fit: Fit, z: Array, index: int, force: float) -> dict[str, float]:
    effect = fit.hypothesis[index]
    values = values_of(fit.found, z, fit.hypothesis)[index]
    key = release_key(effect)
    if key is None:
        return effect.reported(values, force)
    name = {"modulus": "factor", "length": "delta_mm"}.get(key[0], effect.part)
    return {f"{effect.cause}.{name}": float(values[0])}


def _covariance(fitter: Fitter, fit: Fit) -> Array:
    A = fitter.normal(fit)
    covariance = inverse(A, np.array([c.sigma != 0.0 for c in fit.found]))
    rows = int(fitter.whitening.present.sum())
    inflation = max(1.0, fitter.squares(fit.found, fit.at) / max(rows - fit.free, 1))
    result: Array = covariance * inflation
    return result


def nuisance_estimates(fitter: Fitter, fit: Fit) -> dict[str, Estimate]:
    """The nuisances of a fit."""
    covariance = _covariance(fitter, fit)
    result = {}
    for i, c in enumerate(fit.found):
        if c.kind == "effect" or c.sigma == 0.0:
            continue
        value, std = c.value(float(fit.at.z[i])), float(np.sqrt(covariance[i, i])) * c.scale
        result[c.name] = Estimate(value, std, value - NORMAL_95 * std, value + NORMAL_95 * std)
    return result
