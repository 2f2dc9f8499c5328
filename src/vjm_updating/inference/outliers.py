"""Single samples that are no readings of the machine: outliers.

There are two methods to see them. Far from a right model only neighbours can tell (`standing_out`). About a model
that fits, each sample is compared with what all others let expect of it, in time and across channels (`deleted`).
Where too many differ it is the model that is wrong, and none of them is an outlier.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import tuned
from vjm_updating.inference.residual_basis import driven_place
from vjm_updating.observation.observed import Observed
from vjm_updating.observation.significance import FALSE_ALARMS, drawn_sf, level, median_sigma, too_many
from vjm_updating.observation.whitening import Whitening

LONELY, APART = tuned(1.5), tuned(3.0)
"""Times a load by which the next larger one is more where a threshold may well lie between them, and by which a
load is more than what zeros make of none. Of 1600 tests without a cause one had an outlier at its smallest such
load, or the second (docs/hidden-effects.md)."""


def standing_out(observed: Observed, residual: Array, factors: Array) -> np.ndarray:
    """Samples ``(n, 6)`` that stand out of their neighbours, whatever the model gets wrong.

    Each channel is judged by what it is given the others of its reading: an error of the displacement shows in all.

    Args:
        observed: the readings.
        residual: reading minus model ``(n, 6)``.
        factors: inverse Cholesky factors ``(n, 6, 6)`` of the readings' covariances.
    """
    inverse = np.einsum("nki,nkj->nij", factors, factors)
    given = np.einsum("nij,nj->ni", inverse, residual) / np.sqrt(np.einsum("nii->ni", inverse))
    found = np.zeros_like(residual)
    sequence = observed.readings.sequence
    # a sample less the median of six neighbours, whose variance is π/12 of one
    spike = level(int(observed.present.sum())) * float(np.sqrt(1.0 + np.pi / 12.0))
    for c in range(observed.present.shape[1]):
        at = np.flatnonzero(observed.present[:, c])
        for number in np.unique(sequence[at]):
            own = at[sequence[at] == number]
            if len(own) < 7:
                continue
            r = given[own, c]
            padded = np.pad(r, 3, mode="reflect")
            n = len(r)
            near = np.stack([padded[k : k + n] for k in (0, 1, 2, 4, 5, 6)])
            off = r - np.median(near, axis=0)
            usual = median_sigma(off)
            most = spike * max(usual, 1.0)
            # one or two outliers have better neighbours on both sides, a step has not
            way = np.sign(off)
            left, right = (way * (r - near[k : k + 2]) for k in (1, 3))
            alone = (left.max(axis=0) > 0.7 * most) & (right.max(axis=0) > 0.7 * most)
            # and where a model is off, turns and ends lie on the lines that lead there
            for first, second, third in (near[2::-1], near[3:]):
                beyond = way * (r - np.array([2.0 * first - second, 3.0 * second - 2.0 * third]))
                alone &= beyond.max(axis=0) > 0.7 * most
            found[own, c] = np.where((np.abs(off) > most) & alone, off, 0.0)
    # one channel that is off spoils what the others are expected to be: of several the worst
    size = np.abs(found)
    way = np.where(size == size.max(axis=1, keepdims=True), np.sign(found), 0.0)
    result: np.ndarray = _few(observed, way, loads(observed, residual)) != 0.0
    return result


def deleted(whitening: Whitening, residual: Array) -> Array:
    """Each sample's distance ``(n, 6)`` from what the others let expect of it, in standard deviations.

    With P the inverse covariance of all residuals r it is ``(P r)_i / √P_ii``; P is factored into the readings'
    own covariances and their autocorrelation. The likeliest errors of straight lines are taken from r before.

    Args:
        whitening: of the residuals.
        residual: reading minus model ``(n, 6)``.
    """
    autoregression, F = whitening.autoregression, whitening.factors
    back, diagonal = autoregression.back(autoregression.remove(whitening.instant(whitening.without_slow(residual))))
    pull = np.einsum("nki,nk->ni", F, back)
    size = np.sqrt(np.einsum("nki,nk->ni", F**2, diagonal))
    return np.where(whitening.present, pull / size, 0.0)


def loads(observed: Observed, residual: Array) -> Array:
    """What should have been read ``(n, 6)``, over its noise.

    Args:
        observed: the readings.
        residual: reading minus model ``(n, 6)``, of every reading.
    """
    result: Array = (observed.wrench - residual) / observed.noise.wrench
    return result


def outlying(observed: Observed, whitening: Whitening, residual: Array, known: Array, load: Array) -> Array:
    """Samples ``(n, 6)`` that are not what the others let expect, the worst among neighbours only: which way, or 0.

    Args:
        observed: the readings.
        whitening: of the residuals, those known left out.
        residual: reading minus model ``(n, 6)``.
        known: outliers ``(n, 6)`` found before, which count where it is asked whether they are accidents.
        load: what should have been read ``(n, 6)``, over its noise.
    """
    off = deleted(whitening, residual)
    size = np.abs(off)
    top = size == size.max(axis=1, keepdims=True)
    for c in range(observed.present.shape[1]):
        # an outlier makes its neighbours look wrong
        later = np.flatnonzero(whitening.autoregression.before[:, c] >= 0)
        earlier = whitening.autoregression.before[later, c]
        top[later, c] &= size[later, c] >= size[earlier, c]
        top[earlier, c] &= size[earlier, c] >= size[later, c]
    return _few(observed, np.where((size > level(int(whitening.present.sum()))) & top, np.sign(off), known), load)


def _few(observed: Observed, way: Array, load: Array) -> Array:
    """None in a channel that has too many, or whose all lie together: then they are no accidents.

    Nor is a single one of the force driven where it is first felt: backlashes and dead zones may hide no more.

    Args:
        observed: the readings.
        way: 1 or -1 for a sample ``(n, 6)`` that is too large or small, else 0.
        load: what should have been read ``(n, 6)``, over its noise.
    """
    place = driven_place(observed)
    kept = way.copy()
    # so that none of all channels gives a false alarm
    rare = FALSE_ALARMS / max(int(observed.present.any(axis=0).sum()), 1)
    # a load whose gauge sees nothing of it stands out, even where noise hides as much as it may
    shows = np.abs(load) > 2.0 * level(int(observed.present.sum()))
    driven = int(np.argmax(np.where(observed.present[:, :3], np.abs(load[:, :3]), 0.0).max(axis=0)))
    kept[_first_felt(load[:, driven], way[:, driven], (observed.present & shows)[:, driven]), driven] = 0.0
    for c in range(observed.present.shape[1]):
        own = observed.present[:, c]
        flagged = way[own, c] != 0.0
        together = any(_gathered(where[own], flagged) < rare for where in (place, np.abs(place)))
        unseen = _smallest(load[own & shows[:, c], c], way[own & shows[:, c], c]) < rare
        if too_many(int(flagged.sum()), int(own.sum())) or together or unseen or _in_a_row(way[own, c]):
            kept[:, c] = 0.0
    return kept


def _in_a_row(way: Array) -> bool:
    """Whether three of four neighbours are off the same way ``(m,)``; outliers are so either way."""
    if len(way) < 4:
        return False
    return any(bool((np.convolve(way == sign, np.ones(4), mode="valid") >= 3).any()) for sign in (1.0, -1.0))


def _smallest(load: Array, way: Array) -> float:
    """Chance that, of as many samples at random, so many of those read too small have loads among the smallest.

    Args:
        load: what should have been read ``(m,)``, where it would show.
        way: 1 or -1 where a sample is too large or small, else 0 ``(m,)``.
    """
    rising = np.argsort(np.abs(load))
    short = (way * load < 0.0)[rising]
    many = int(short.sum())
    if many < 2:
        return 1.0
    upto, count = np.flatnonzero(short) + 1, np.arange(1, many + 1)
    # up to each of them: at least so many of them within the first; one alone says nothing
    chance = drawn_sf(count, len(short), many, upto)
    return float(chance[1:].min())


def _first_felt(load: Array, way: Array, shows: np.ndarray) -> np.ndarray:
    """The sample of the smallest load that shows ``(n,)``, where it is read too small and no other load is near.

    It may be the second, far above the first: zeros make a small load of what an unloaded machine shows.

    Args:
        load: what should have been read, over its noise.
        way: 1 or -1 where a sample is too large or small, else 0.
        shows: samples of a load that would show ``(n,)``.
    """
    at = np.flatnonzero(shows)
    rising = at[np.argsort(np.abs(load[at]))]
    short = way[rising] * load[rising] < 0.0
    times = np.abs(load[rising[1:]] / load[rising[:-1]])
    result = np.zeros(len(load), dtype=bool)
    if len(times) > 0 and short[0] and times[0] > LONELY:
        result[rising[0]] = True
    elif len(times) > 1 and short[1] and times[1] > LONELY and times[0] > APART:
        result[rising[1]] = True
    return result


def _gathered(place: Array, flagged: np.ndarray) -> float:
    """Chance that so many samples, drawn at random, lie within so narrow a range of places."""
    k = int(flagged.sum())
    if k < 3:
        return 1.0
    ends = np.sort(place[flagged])
    chances = [_within(place, ends[0], ends[-1], k)]
    if k > 3:
        # one may be an outlier indeed, and far from the others
        chances += [k * _within(place, a, b, k - 1) for a, b in ((ends[0], ends[-2]), (ends[1], ends[-1]))]
    return min(chances)


def _within(place: Array, low: float, high: float, k: int) -> float:
    """Chance that k samples lie within so narrow a range as from ``low`` to ``high``; one if many others do."""
    inside = (place >= low) & (place <= high)
    if not too_many(k, int(inside.sum())):
        return 1.0
    share = float(inside.mean())
    return k * share ** (k - 1) - (k - 1) * share**k
