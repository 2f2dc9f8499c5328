"""Tests of marks, one load each: further causes with the noise that each leaves.

How well a hand stops at a mark is not known beforehand, so the noise is a part of each hypothesis. What a few
causes leave would else count as noise, and hide the next one.
"""

from __future__ import annotations

import numpy as np

from vjm_updating.diagnosis.column import noise_found, with_noise_found
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.search import RIVAL, Search
from vjm_updating.inference.fitting import prior
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.mechanisms.effect import Effect


def completed(search: Search, best: Ranked) -> Ranked:
    """The best hypothesis of a search with further causes, as long as each pays with the noise that it leaves.

    Those that then are as likely are refitted with that noise and make the search's hypotheses.
    """
    if not best.labels:
        return best
    fitter = search.fitter
    while True:
        for effect in search.effects:
            if effect.label not in best.labels:
                _with(search, best, effect)
        more = [r for labels, r in search.tried.items() if labels > best.labels]
        top = min(more, key=lambda r: _worth(search, r), default=best)
        if _worth(search, top) >= _worth(search, best):
            break
        best = top
    near = [r for r in search.tried.values() if r.labels and _worth(search, r) < _worth(search, best) + RIVAL]
    fitter.forward.observed = with_noise_found(fitter.forward.observed, best.fit)
    fitter.weigh(best.fit.at)
    m = len(fitter.nuisances)
    search.null = best_fit(fitter, (), search.null.at.z[:m], []) or search.null
    again = [best_fit(fitter, r.fit.hypothesis, r.fit.at.z[:m], r.fit.values) for r in near]
    found = [search.ranked(fit) for fit in (search.null, *again) if fit is not None]
    search.tried = {r.labels: r for r in found}
    return min((r for r in found if r.labels), key=lambda r: r.criterion)


def _with(search: Search, base: Ranked, effect: Effect) -> None:
    """Fit a hypothesis with one cause more."""
    fitter, fit = search.fitter, base.fit
    m = len(fitter.nuisances)
    hypothesis = (*fit.hypothesis, effect)
    found = [
        best_fit(fitter, hypothesis, begin, [*fit.values, list(trial)])
        for trial in effect.trials()
        for begin in (fit.at.z[:m], np.zeros(m))
    ]
    fits = [one for one in found if one is not None]
    if fits:
        ranked = search.ranked(min(fits, key=lambda one: one.objective))
        search.tried[ranked.labels] = ranked


def _worth(search: Search, ranked: Ranked) -> float:
    """The criterion with the noise that the hypothesis leaves in the place of that in force."""
    fit = ranked.fit
    likelihood, _ = noise_found(search.fitter.forward.observed, fit)
    off, _ = prior(fit.found, fit.at.z)
    return likelihood + float(off @ off) + ranked.criterion - fit.objective
