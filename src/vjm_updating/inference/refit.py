"""A fit with its own outliers, noise and branches: found about it and fitted again, until none of them changes.

The autocorrelation of the noise is estimated from residuals of a model that may be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import betaincinv, logsumexp, ndtri

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale, tuned
from vjm_updating.inference.bounded_normal import bounded_step
from vjm_updating.inference.fitting import Fit, HeldTables, LeastSquaresProblem, Whitening, best_fit
from vjm_updating.inference.forward import values_of
from vjm_updating.inference.model_error import driven_place, smooth_shapes
from vjm_updating.inference.noise import AutoregressiveNoise
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.parameters import Evaluation, FitParameter, Hypothesis
from vjm_updating.inference.significance import FALSE_ALARMS, NOISE_KNOWN, drawn_sf, level, median_sigma, too_many

LONELY, APART = tuned(1.5), tuned(3.0)
"""Times a load by which the next larger one is more where a threshold may well lie between them, and by which a
load is more than what zeros make of none. Of 1600 tests without a cause one had an outlier at its smallest such
load, or the second (docs/hidden-effects.md)."""


def standing_out(observed: Observed, residual: Array, factors: Array) -> np.ndarray:
    """Samples ``(n, 6)`` that stand out of their neighbours, whatever the model gets wrong.

    Each channel is judged by what it is given the others of its reading: an error of the displacement shows in all.
    ``residual`` (n, 6) is reading minus model; ``factors`` (n, 6, 6) are inverse Cholesky factors of the readings'
    covariances.
    """
    inverse = np.einsum("nki,nkj->nij", factors, factors)
    given = np.einsum("nij,nj->ni", inverse, residual) / np.sqrt(np.einsum("nii->ni", inverse))
    outliers = np.zeros_like(residual)
    sequence = observed.readings.sequence
    # a sample less the median of six neighbours, whose variance is π/12 of one
    spike = level(int(observed.present.sum())) * float(np.sqrt(1.0 + np.pi / 12.0))
    for c in range(observed.present.shape[1]):
        rows = np.flatnonzero(observed.present[:, c])
        for number in np.unique(sequence[rows]):
            own = rows[sequence[rows] == number]
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
            outliers[own, c] = np.where((np.abs(off) > most) & alone, off, 0.0)
    # one channel that is off spoils what the others are expected to be: of several the worst
    size = np.abs(outliers)
    way = np.where(size == size.max(axis=1, keepdims=True), np.sign(outliers), 0.0)
    return _few(observed, way, loads(observed, residual)) != 0.0


def deleted(whitening: Whitening, residual: Array) -> Array:
    """Each sample's distance ``(n, 6)`` from what the others let expect of it, in standard deviations.

    With P the inverse covariance of all residuals r it is ``(P r)_i / √P_ii``; P is factored into the readings' own
    covariances and their autocorrelation. The likeliest errors of straight lines are taken from r before.
    ``residual`` (n, 6) is reading minus model.
    """
    autoregression, F = whitening.autoregression, whitening.factors
    back, diagonal = autoregression.back(autoregression.remove(whitening.instant(whitening.without_slow(residual))))
    pull = np.einsum("nki,nk->ni", F, back)
    size = np.sqrt(np.einsum("nki,nk->ni", F**2, diagonal))
    return np.where(whitening.present, pull / size, 0.0)


def loads(observed: Observed, residual: Array) -> Array:
    """What should have been read ``(n, 6)``, over its noise.

    ``residual`` (n, 6) is reading minus model, of every reading.
    """
    return (observed.measured - residual) / observed.noise.wrench


def outlying(observed: Observed, whitening: Whitening, residual: Array, known: Array, load: Array) -> Array:
    """Samples ``(n, 6)`` that are not what the others let expect, the worst among neighbours only: which way, or 0.

    ``residual`` (n, 6) is reading minus model, ``load`` as of `loads`. Outliers ``known`` (n, 6) from before are
    left out of the ``whitening``; they count where it is asked whether outliers are accidents.
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
    ``way`` (n, 6) is 1 or -1 for a sample that is too large or small, else 0; ``load`` is as of `loads`.
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

    ``load`` (m,) is what should have been read, where it would show; ``way`` (m,) is as of `_few`.
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

    It may be the second, far above the first: zeros make a small load of what an unloaded machine shows. ``load``
    (n,) is as of `loads`, ``way`` (n,) as of `_few`.
    """
    indices = np.flatnonzero(shows)
    rising = indices[np.argsort(np.abs(load[indices]))]
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


STATIONARY = numerical(0.98)
"""Largest autocorrelation of neighbouring readings; at 1 a sequence would have no mean."""
GRID = numerical((0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.78, 0.85, 0.91, 0.96, 0.98))
"""Autocorrelations that are tried."""
SHARES = numerical((0.0, 0.2, 0.4, 0.6, 0.8))
"""Of the variance that are white: those that are tried."""
SLOW = numerical(0.75)
"""Least autocorrelation of what is slow beside a white share: with a weaker one it is not distinguishable from one
autocorrelation alone, and with hardly any not from white noise."""
SIZES = numerical((0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 1e3, 1e4, 1e5))
"""Of the shapes, in standard deviations of a reading times the root of their number."""
ALIKE = prior_scale(0.15)
"""Spread of the channels' memories about their common one."""
USUAL, WIDE = prior_scale(0.4), prior_scale(0.3)
"""The common one, where nothing is known but that neighbours are correlated."""
FEWEST = numerical(12)
"""Samples of a channel below which it takes the others' autocorrelation."""
RANK = numerical(0.02)
"""Of singular values over the largest, below which shapes are one: what sets them apart is the gauge's noise."""


def estimate_autocorrelation(
    autoregression: AutoregressiveNoise,
    instant: Array,
    shapes: Array,
    present: np.ndarray,
    nuisances: Array | None = None,
) -> AutoregressiveNoise:
    """The order of readings with its autocorrelations, by marginal likelihood.

    ``instant`` (n, 6) are whitened readings less the model at its nominal nuisances, still autocorrelated. A wrong
    model may leave ``shapes`` (n, 6, k); one sigma of each nuisance does ``nuisances`` (n, 6, m). Both are
    whitened.
    """
    known = np.zeros((*instant.shape, 0)) if nuisances is None else nuisances
    channels = [c for c in range(present.shape[1]) if present[:, c].sum() >= FEWEST]
    uncorrelated = replace(autoregression, rho=np.zeros(present.shape[1]), white=np.zeros(present.shape[1]))
    if not channels:
        return uncorrelated
    by_share = np.array([_costs(autoregression, c, instant, shapes, known, present) for c in channels])
    # readings with hardly any of the noise that the sheet says tell nothing of its autocorrelation
    quiet = np.array([silent(np.diff(instant[present[:, c], c], n=2)) for c in channels])
    # twice the negative logarithm of the priors: of a channel's value (rows) beside the common one, and of that
    grid = np.array(GRID)
    apart, off = ((grid[:, None] - grid) / ALIKE) ** 2, ((grid - USUAL) / WIDE) ** 2
    # of the shares none is as probable as any other, of which all are alike
    cells = np.gradient(SHARES)[1:]
    of_share = by_share - 2.0 * np.log(0.5 * np.concatenate([[1.0], cells / cells.sum()]))
    if not quiet.all() and _white(-2.0 * logsumexp(-0.5 * of_share[~quiet], axis=2), apart, off):
        return uncorrelated
    shares = np.where(quiet, 0, [_white_share(cost, off) for cost in of_share])
    costs = np.take_along_axis(by_share, shares[:, None, None], axis=2)[:, :, 0]
    white = np.zeros(present.shape[1])
    white[channels] = np.array(SHARES)[shares]
    # by the common autocorrelation (columns): the least that each channel costs beside it
    total = (costs[:, :, None] + apart).min(axis=1).sum(axis=0) + off
    common = int(np.argmin(total))
    rho = np.where(present.any(axis=0), grid[common], 0.0)
    for c, cost, nothing in zip(channels, costs + apart[:, common], quiet, strict=True):
        rho[c] = USUAL if nothing else _least(grid, cost)
    return replace(autoregression, rho=rho, white=white)


def _white_share(costs: Array, off: Array) -> int:
    """The number among `SHARES` of a channel's white share: none, where any other is not more probable.

    ``costs`` (g, w) are twice the negative logarithm of likelihood and prior by autocorrelation and share, ``off``
    (g,) that of the autocorrelation's prior.
    """
    each = logsumexp(-0.5 * costs + (np.log(np.gradient(GRID)) - 0.5 * off)[:, None], axis=0)
    return 1 + int(np.argmax(each[1:])) if logsumexp(each[1:]) > each[0] else 0


def _white(costs: Array, apart: Array, off: Array) -> bool:
    """Whether white noise is more probable than an autocorrelated one; both are as probable before any reading.

    Twice negative logarithms are ``costs`` (c, g) of each channel's likelihood by autocorrelation, ``apart`` (g, g)
    of the prior of a channel's (rows) beside the common one, ``off`` (g,) of the common one's.
    """
    share = np.log(np.gradient(GRID))[:, None]
    each = logsumexp(-0.5 * (costs[:, :, None] + apart) + share, axis=1)
    own = each - logsumexp(-0.5 * apart + share, axis=0)
    prior = share[:, 0] - 0.5 * off
    with_autocorrelation = logsumexp(own.sum(axis=0) + prior) - logsumexp(prior)
    return bool(-0.5 * costs[:, 0].sum() > with_autocorrelation)


def silent(bends: Array) -> bool:
    """Whether second differences are so small that the readings have not the noise that their sheet says.

    Noise of unit variance and of autocorrelation ρ has second differences of variance 2 (1 − ρ) (3 − ρ), the least
    for the strongest autocorrelation. Their median is the middle one of an ordered sample (of whose shares the
    distribution is a beta one). It may be smaller than `FALSE_ALARMS` allows, though the sheet says as much too
    much of the standard deviation as it may. Then no autocorrelation is the reason. Of ``bends`` (m,), second
    differences of whitened readings, those three apart share no reading.
    """
    half = 0.5 * (len(bends) // 3 + 1)
    least = np.sqrt(2.0 * (1.0 - STATIONARY) * (3.0 - STATIONARY) / NOISE_KNOWN)
    quantile = ndtri(0.5 * (1.0 + betaincinv(half, half, FALSE_ALARMS)))
    return float(np.median(np.abs(bends))) < least * float(quantile)


def _least(grid: Array, cost: Array) -> float:
    """Where the parabola through the least of a grid's values and its neighbours is least."""
    k = int(np.argmin(cost))
    if not 0 < k < len(grid) - 1 or np.isinf(cost[k - 1]):
        return float(grid[k])
    a, b, d = grid[k - 1 : k + 2]
    fa, fb, fd = cost[k - 1 : k + 2]
    top = (b - a) ** 2 * (fb - fd) - (b - d) ** 2 * (fb - fa)
    low = (b - a) * (fb - fd) - (b - d) * (fb - fa)
    return float(np.clip(b - 0.5 * top / low, a, d)) if low != 0.0 else float(b)


def _costs(
    autoregression: AutoregressiveNoise,
    c: int,
    instant: Array,
    shapes: Array,
    nuisances: Array,
    present: np.ndarray,
) -> Array:
    """Twice the negative logarithm of a channel's marginal likelihood ``(g, w)``, but for a constant.

    By autocorrelation, and by the share of the variance that is white.
    """
    on = present[:, c]
    X = shapes[:, c][on]
    X = X[:, np.any(X != 0.0, axis=0)]
    X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    U, values, _ = np.linalg.svd(X, full_matrices=False)
    U = U[:, values > RANK * values[0]] if len(values) else U
    # the coefficient of a column of unit norm grows with the root of the number of readings
    U = U * np.sqrt(len(X))
    known = nuisances[:, c][on]
    m, k = known.shape[1], U.shape[1]
    table = np.zeros((len(on), 1, m + k + 1))
    table[on, 0] = np.column_stack([known, U, instant[on, c]])
    before, gap = autoregression.before[:, [c]], autoregression.gap[:, [c]]
    result = np.full((len(GRID), len(SHARES)), np.inf)
    # for each size of the wrong model: standard deviations of the coefficients, and one row for the readings
    sizes = np.array(SIZES if k else [0.0])
    scale = np.ones((len(sizes), m + k + 1))
    scale[:, m : m + k] = sizes[:, None]
    for (i, rho), (j, white) in product(enumerate(GRID), enumerate(SHARES)):
        if white > 0.0 and rho < SLOW:
            continue
        own = AutoregressiveNoise(np.array([rho]), np.array([white]), before, gap)
        free = own.remove(table)[on, 0]
        # the last pivot is what the coefficients leave of the readings' squares, and the one that was added
        M = np.eye(m + k + 1) + scale[:, :, None] * (free.T @ free) * scale[:, None, :]
        pivots = np.diagonal(np.linalg.cholesky(M), axis1=1, axis2=2)
        left = pivots[:, -1] ** 2 - 1.0
        least = float((left + 2.0 * np.log(pivots[:, :-1]).sum(axis=1)).min())
        result[i, j] = own.determinant[0] + least
    return result


WORSE = numerical(6)
"""Rounds in which outliers are looked for, the worst first."""

Without = Callable[[Observed, np.ndarray], Observed]
"""The readings that count, where samples ``(n, 6)`` stand out."""


def leave_out(
    fitter: LeastSquaresProblem,
    without: Without,
    everything: Observed,
    outliers: np.ndarray,
    evaluation: Evaluation,
) -> None:
    """Go on without outliers ``(n, 6)``, where the kind of test leaves any out."""
    kept = without(everything, outliers)
    fitter.forward.observed = kept
    fitter.whitening = fitter.whitening.reading(kept)
    fitter.weigh(evaluation)


def refit(fitter: LeastSquaresProblem, without: Without, everything: Observed, best: Fit) -> Fit:
    """The best fit of the same causes without its outliers; autocorrelation and branches are found about it.

    The fitter goes on with them.
    """
    leave_out(fitter, without, everything, np.zeros_like(everything.present), best.evaluation)
    whole = fitter.evaluate(best.parameters, best.evaluation.z, best.hypothesis)
    # of samples left out a fit does not say what should have been read
    load = np.zeros(everything.present.shape) if whole is None else loads(everything, whole.residual)
    evaluation = whole or best.evaluation
    m = len(fitter.nuisances)
    fit: Fit | None = None
    flagged, accidents = np.zeros(everything.present.shape), np.ones(everything.present.shape[1], dtype=bool)
    for _ in range(WORSE):
        outliers = outlying(everything, fitter.whitening, evaluation.residual, flagged, load)
        # what with others turns out to be none is not looked for again
        accidents &= outliers.any(axis=0) | ~flagged.any(axis=0)
        outliers = np.where(accidents, outliers, 0.0)
        if fit is not None and np.array_equal(outliers, flagged):
            break
        flagged = outliers
        leave_out(fitter, without, everything, flagged != 0.0, evaluation)
        # outliers pull a fit and hide the noise's autocorrelation, and then their neighbours look like outliers
        fit = choose_branches(fitter, best_fit(fitter, best.hypothesis, evaluation.z[:m], best.values) or best)
        update_autocorrelation(fitter, fit, ())
        evaluation = fit.evaluation
    return fit or best


def update_autocorrelation(fitter: LeastSquaresProblem, base: Fit, changes: Sequence[Array]) -> None:
    """Estimate the noise's autocorrelation; what effects or smooth shapes could explain does not count as noise.

    ``changes`` are what effects do to the readings (n, 6).
    """
    observed, whitening = fitter.forward.observed, fitter.whitening
    smooth, _ = smooth_shapes(observed)
    sigma = np.array([c.sigma for c in base.parameters])
    off = base.evaluation.z - np.array([c.mean for c in base.parameters])
    known = (sigma > 0.0) & np.isfinite(sigma)
    J = whitening.instant(base.jacobian)
    shapes = [J[:, :, ~known], np.repeat(smooth[:, None, :], observed.present.shape[1], axis=1)]
    if changes:
        shapes.append(whitening.instant(np.stack(changes, axis=-1)))
    sheet = J[:, :, known] * sigma[known]
    # as it were at the sheet's own values
    instant = whitening.instant(base.evaluation.residual) - J[:, :, known] @ off[known]
    sheet = np.concatenate([sheet, whitening.instant(whitening.slow)], axis=2)
    autoregression = estimate_autocorrelation(
        observed.autoregression, instant, np.concatenate(shapes, axis=2), observed.present, sheet
    )
    fitter.whitening = replace(whitening, autoregression=autoregression)


def choose_branches(fitter: LeastSquaresProblem, base: Fit) -> Fit:
    """Turn each half-ray to the branch that its readings are on, where the model has a bifurcation there."""
    forward = fitter.forward
    best = base
    for number, ray in enumerate(forward.observed.rays):
        s = forward.observed.imposed[ray.index] @ ray.measure
        for sign in (1, -1):
            if not forward.branched(ray, sign, float((sign * s).max())):
                continue
            before = dict(forward.branches)
            forward.branches[number, sign] = -forward.branches.get((number, sign), 1)
            evaluation = fitter.evaluate(best.parameters, best.evaluation.z, best.hypothesis)
            if evaluation is None or fitter.objective(best.parameters, evaluation) >= best.objective:
                forward.branches = before
            else:
                best = replace(best, evaluation=evaluation, objective=fitter.objective(best.parameters, evaluation))
    return best


# --- Starts of a fit by a coarse profile over the shapes of laws: each over the decades that its prior allows -----
#
# How far a joint turns before it slips, or at which load a gear's slope changes, moves readings only near one place
# of the path. From another place no step of a fit leads there. So each shape is set to places over its prior in
# turn, the other coordinates follow by one step, and a fit begins at the best place.

SPREADS, PLACES = numerical(4.0), numerical(9)
"""Of a shape's prior to either side of its middle within which it is tried, and at how many places."""
DAMPING = numerical(1e-3)
"""Of the step by which other coordinates follow."""


def begun_anew(fitter: LeastSquaresProblem, fit: Fit) -> Fit:
    """A fit, or a better one of the same causes that begins elsewhere."""
    best, m = fit, len(fitter.nuisances)
    for i, c in enumerate(fit.parameters):
        if c.kind != "effect" or not np.isfinite(c.sigma):
            continue
        z = _elsewhere(fitter, best, i)
        if z is None:
            continue
        values, borrowed = values_of(best.parameters, z, best.hypothesis), fitter.machine_slopes(best)
        squares = fitter.squares(best.parameters, best.evaluation)
        other = best_fit(fitter, best.hypothesis, z[:m], values, borrowed=borrowed, target=squares)
        if other is not None and other.objective < best.objective - fitter.resolution(squares):
            best = best_fit(fitter, best.hypothesis, other.evaluation.z[:m], other.values) or other
    return best


def _elsewhere(fitter: LeastSquaresProblem, fit: Fit, index: int) -> Array | None:
    """Coordinates ``(n_z,)`` with a shape at its best place that is not next to its own; None where none stands."""
    c, current = fit.parameters[index], float(fit.evaluation.z[index])
    machine = fitter.of_machine
    held = HeldTables(machine, fit.evaluation.z[machine], fitter.machine_slopes(fit))
    ends = max(c.low, c.mean - SPREADS * c.sigma), min(c.high, c.mean + SPREADS * c.sigma)
    places, apart = np.linspace(*ends, PLACES, retstep=True)
    least, best = np.inf, None
    for place in places[np.abs(places - current) > apart]:
        z = fit.evaluation.z.copy()
        z[index] = place
        squares, followed = after_a_step(fitter, fit.hypothesis, fit.parameters, z, [index], held)
        if squares < least:
            least, best = squares, followed
    return best


def after_a_step(
    fitter: LeastSquaresProblem,
    hypothesis: Hypothesis,
    unknowns: Sequence[FitParameter],
    z: Array,
    staying: Sequence[int] = (),
    held: HeldTables | None = None,
) -> tuple[float, Array]:
    """Squares one step from a place, infinite where the machine does not stand, and where ``(n_z,)`` that leads.

    Coordinates whose indices are ``staying`` stay. The tables of a machine near by that is ``held`` serve.
    """
    evaluation = fitter.evaluate(unknowns, z, hypothesis, held=held)
    if evaluation is None:
        return np.inf, z
    if held is None:
        J = fitter.slopes(unknowns, evaluation, hypothesis)
    else:
        J = np.zeros((*evaluation.residual.shape, len(unknowns)))
        J[:, :, held.own] = held.slopes
        fitter.renew(J, unknowns, evaluation, hypothesis, [], held)
    low, high = (np.array([getattr(one, end) for one in unknowns]) for end in ("low", "high"))
    fixed = np.array([one.sigma == 0.0 for one in unknowns])
    fixed[list(staying)] = True
    linear = np.array([one.of_instrument for one in unknowns])
    A, b = fitter.system(unknowns, evaluation, J)
    after = bounded_step(A, b, DAMPING, fixed, linear, z, low, high)
    moved = fitter.evaluate(unknowns, after, hypothesis, held=held)
    # what is no better than where it begins stays
    ends = [
        (fitter.squares(unknowns, one), where)
        for one, where in ((evaluation, z), (moved, after))
        if one is not None
    ]
    return min(ends, key=lambda pair: pair[0])
