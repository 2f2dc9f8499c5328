"""Tests of marks, one load each: a further cause beside those that a search ends with, and the gain held out.

Bow and yield explain nearly all that the nominal column gets wrong. Beside that, an error of zero or a few per cent
of stiffness are less than what `vjm_updating.diagnose.search` takes a slightly wrong law to leave; but on tens
of marks they decide what the parameters are. So every further cause is tried once more without that rule.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from vjm.rotations import Array
from vjm_updating.diagnose.fitting import Fit, Fitter
from vjm_updating.diagnose.holdout import Gain, Split, refitted_without, unsure
from vjm_updating.diagnose.holdout_folds import Fold
from vjm_updating.diagnose.scored_hypothesis import Ranked
from vjm_updating.diagnose.search import Search

THIRD = 3
"""Every so many marks one is held out; in turn each but the first and the last."""
DRAWS, SEED = 2000, 5


def with_one_more(search: Search, best: Ranked) -> Ranked:
    """The best hypothesis of a search, or that with one more cause where this is significant.

    Those that were tried join the search's, so that a verdict knows of rivals.
    """
    if not best.labels:
        return best
    fitter, base = search.fitter, best.fit
    m = len(fitter.nuisances)
    for effect in search.effects:
        if effect.label in best.labels:
            continue
        hypothesis = (*base.hypothesis, effect)
        found = [
            fitter.fit(hypothesis, begin, [*base.values, list(trial)])
            for trial in effect.trials()
            for begin in (base.at.z[:m], np.zeros(m))
        ]
        fits = [fit for fit in found if fit is not None]
        if fits:
            fit = min(fits, key=lambda one: one.objective)
            labels = frozenset(e.label for e in hypothesis)
            search.tried[labels] = search.ranked(fit)
    more = [r for labels, r in search.tried.items() if labels > best.labels and len(labels) == len(best.labels) + 1]
    top = min(more, key=lambda r: r.criterion, default=best)
    explained = base.objective - top.fit.objective
    freedom = max(len(top.fit.found) - len(base.found) + sum(_freed(top.fit)) - sum(_freed(base)), 1)
    significant = float(chi2.sf(max(explained, 0.0), freedom)) < search.alarm
    return top if significant and top.criterion < best.criterion else best


def _freed(fit: Fit) -> list[bool]:
    return [c.kind != "effect" and not np.isfinite(c.sigma) for c in fit.found]


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
