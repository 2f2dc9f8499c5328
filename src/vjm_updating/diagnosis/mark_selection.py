"""Tests of marks, one load each: further causes with the noise that each leaves, and the gain held out.

How well a hand stops at a mark is not known beforehand, so the noise is a part of each hypothesis. What a few
causes leave would else count as noise, and hide the next one.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.column import noise_found, with_noise_found
from vjm_updating.diagnosis.holdout import Gain, Split, refitted_without, unsure
from vjm_updating.diagnosis.holdout_folds import Fold
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.search import RIVAL, Search
from vjm_updating.inference.fitting import Fit, Fitter, prior
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.mechanisms.effect import Effect

THIRD = numerical(3)
"""Every so many marks one is held out; in turn each but the first and the last."""
DRAWS, SEED = numerical(2000), numerical(5)


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


def marks_gain(fitter: Fitter, null: Fit, fit: Fit) -> tuple[Gain, list[Fold]]:
    """Error of loads at marks held out, every third one in turn, each time with refits in full.

    The first and the last mark are always kept: beyond them there is nothing to predict them from.
    """
    observed = fitter.forward.observed
    known = np.flatnonzero(observed.present[:, 0])
    inner = known[1:-1]
    turn = np.full(len(observed.pose), -1)
    turn[inner] = np.arange(len(inner)) % THIRD
    before, after = (_held_out(fitter, one, turn) for one in (null, fit))
    slope = fit.at.stiffness[:, 0, 0]
    sigma = np.hypot(observed.noise.wrench[0], slope * observed.noise.pose[0])
    rmse = [_rms(e[inner]) for e in (before, after)]
    scaled = [_rms(e[inner] / sigma[inner]) for e in (before, after)]
    open_ = unsure(fitter, fit, Split("marks", turn))[:, 0]
    expected = float(np.sqrt(np.mean(1.0 + (open_ / sigma)[inner] ** 2)))
    picks = np.random.default_rng(SEED).integers(0, len(inner), (DRAWS, len(inner)))
    fall = [np.sqrt(np.mean(e[inner][picks] ** 2, axis=1)) for e in (before, after)]
    low, high = np.quantile(fall[0] - fall[1], [0.025, 0.975])
    parts = []
    for k in range(THIRD):
        own = np.flatnonzero(turn == k)
        if len(own):
            name = "marks " + ", ".join(str(1 + i) for i in own[:3]) + (", …" if len(own) > 3 else "")
            load = observed.wrench[own, 0]
            parts.append(Fold(name, len(own), _rms(load), _rms(before[own]), _rms(after[own])))
    gain = Gain(rmse[0], rmse[1], (float(low), float(high)), scaled[0], scaled[1], "marks", expected)
    return gain, parts


def _held_out(fitter: Fitter, fit: Fit, turn: np.ndarray) -> Array:
    """Reading minus model ``(n,)`` of every mark by the fit that had not seen it."""
    result: Array = fit.at.residual[:, 0].copy()
    for k in range(THIRD):
        own = turn == k
        at = refitted_without(fitter, fit, own)
        result[own] = np.inf if at is None else at.residual[own, 0]
    return result


def _rms(e: Array) -> float:
    return float(np.sqrt(np.mean(e**2))) if len(e) else 0.0
