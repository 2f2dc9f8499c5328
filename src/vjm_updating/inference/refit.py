"""A fit with its own outliers, noise and branches: found about it and fitted again, until none of them changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.forward import values_of
from vjm_updating.inference.normal_equations import bounded_step
from vjm_updating.inference.outliers import loads, outlying
from vjm_updating.inference.parameters import Hypothesis
from vjm_updating.inference.residual_basis import smooth_shapes
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.observation.autocorrelation import estimate_autocorrelation
from vjm_updating.observation.coordinate import Coordinate, Evaluation
from vjm_updating.observation.observed import Observed

WORSE = numerical(6)
"""Rounds in which outliers are looked for, the worst first."""

Without = Callable[[Observed, np.ndarray], Observed]
"""The readings that count, where samples ``(n, 6)`` stand out."""


def leave_out(fitter: Fitter, without: Without, everything: Observed, outliers: np.ndarray, at: Evaluation) -> None:
    """Go on without outliers ``(n, 6)``, where the kind of test leaves any out."""
    kept = without(everything, outliers)
    fitter.forward.observed = kept
    fitter.whitening = fitter.whitening.reading(kept)
    fitter.weigh(at)


def refit(fitter: Fitter, without: Without, everything: Observed, best: Fit) -> Fit:
    """The best fit of the same causes without its outliers; autocorrelation and branches are found about it.

    The fitter goes on with them.

    Args:
        fitter: of the test.
        without: leaves outliers out.
        everything: all readings.
        best: where to begin.
    """
    leave_out(fitter, without, everything, np.zeros_like(everything.present), best.at)
    whole = fitter.evaluate(best.found, best.at.z, best.hypothesis)
    # of samples left out a fit does not say what should have been read
    load = np.zeros(everything.present.shape) if whole is None else loads(everything, whole.residual)
    at = whole or best.at
    m = len(fitter.nuisances)
    fit: Fit | None = None
    flagged, accidents = np.zeros(everything.present.shape), np.ones(everything.present.shape[1], dtype=bool)
    for _ in range(WORSE):
        found = outlying(everything, fitter.whitening, at.residual, flagged, load)
        # what with others turns out to be none is not looked for again
        accidents &= found.any(axis=0) | ~flagged.any(axis=0)
        found = np.where(accidents, found, 0.0)
        if fit is not None and np.array_equal(found, flagged):
            break
        flagged = found
        leave_out(fitter, without, everything, flagged != 0.0, at)
        # outliers pull a fit and hide the noise's autocorrelation, and then their neighbours look like outliers
        fit = choose_branches(fitter, best_fit(fitter, best.hypothesis, at.z[:m], best.values) or best)
        update_autocorrelation(fitter, fit, ())
        at = fit.at
    return fit or best


def update_autocorrelation(fitter: Fitter, base: Fit, changes: Sequence[Array]) -> None:
    """Estimate the noise's autocorrelation; what effects or smooth shapes could explain does not count as noise.

    Args:
        fitter: of the test.
        base: a fit.
        changes: what effects do to the readings ``(n, 6)``.
    """
    observed, whitening = fitter.forward.observed, fitter.whitening
    smooth, _ = smooth_shapes(observed)
    sigma = np.array([c.sigma for c in base.found])
    off = base.at.z - np.array([c.mean for c in base.found])
    known = (sigma > 0.0) & np.isfinite(sigma)
    J = whitening.instant(base.jacobian)
    shapes = [J[:, :, ~known], np.repeat(smooth[:, None, :], observed.present.shape[1], axis=1)]
    if changes:
        shapes.append(whitening.instant(np.stack(changes, axis=-1)))
    sheet = J[:, :, known] * sigma[known]
    # as it were at the sheet's own values
    instant = whitening.instant(base.at.residual) - J[:, :, known] @ off[known]
    sheet = np.concatenate([sheet, whitening.instant(whitening.slow)], axis=2)
    autoregression = estimate_autocorrelation(
        observed.autoregression, instant, np.concatenate(shapes, axis=2), observed.present, sheet
    )
    fitter.whitening = replace(whitening, autoregression=autoregression)


def choose_branches(fitter: Fitter, base: Fit) -> Fit:
    """Turn each half-ray to the branch that its readings are on, where the model has a bifurcation there."""
    forward = fitter.forward
    best = base
    for number, ray in enumerate(forward.observed.rays):
        s = forward.observed.pose[ray.index] @ ray.measure
        for sign in (1, -1):
            if not forward.branched(ray, sign, float((sign * s).max())):
                continue
            before = dict(forward.branches)
            forward.branches[number, sign] = -forward.branches.get((number, sign), 1)
            at = fitter.evaluate(best.found, best.at.z, best.hypothesis)
            if at is None or fitter.objective(best.found, at) >= best.objective:
                forward.branches = before
            else:
                best = replace(best, at=at, objective=fitter.objective(best.found, at))
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


def begun_anew(fitter: Fitter, fit: Fit) -> Fit:
    """A fit, or a better one of the same causes that begins elsewhere.

    Args:
        fitter: of the test.
        fit: where the search for its causes ended.
    """
    best = fit
    for i, c in enumerate(fit.found):
        if c.kind != "effect" or not np.isfinite(c.sigma):
            continue
        z = _elsewhere(fitter, best, i)
        if z is None:
            continue
        values = values_of(best.found, z, best.hypothesis)
        other = best_fit(fitter, best.hypothesis, z[: len(fitter.nuisances)], values)
        if other is not None and other.objective < best.objective - fitter.rounding:
            best = other
    return best


def _elsewhere(fitter: Fitter, fit: Fit, index: int) -> Array | None:
    """Coordinates ``(n_z,)`` with a shape at its best place that is not next to its own; None where none stands."""
    c, here = fit.found[index], float(fit.at.z[index])
    ends = max(c.low, c.mean - SPREADS * c.sigma), min(c.high, c.mean + SPREADS * c.sigma)
    places, apart = np.linspace(*ends, PLACES, retstep=True)
    least, found = np.inf, None
    for place in places[np.abs(places - here) > apart]:
        z = fit.at.z.copy()
        z[index] = place
        squares, followed = after_a_step(fitter, fit.hypothesis, fit.found, z, [index])
        if squares < least:
            least, found = squares, followed
    return found


def after_a_step(
    fitter: Fitter, hypothesis: Hypothesis, found: Sequence[Coordinate], z: Array, held: Sequence[int] = ()
) -> tuple[float, Array]:
    """Squares one step from a place, infinite where the machine does not stand, and where ``(n_z,)`` that leads.

    Args:
        fitter: of the test.
        hypothesis: the causes.
        found: its coordinates.
        z: the place ``(n_z,)``.
        held: indices of coordinates that stay.
    """
    at = fitter.evaluate(found, z, hypothesis)
    if at is None:
        return np.inf, z
    low, high = (np.array([getattr(one, end) for one in found]) for end in ("low", "high"))
    fixed = np.array([one.sigma == 0.0 for one in found])
    fixed[list(held)] = True
    linear = np.array([one.of_instrument for one in found])
    A, b = fitter.system(found, at, fitter.slopes(found, at, hypothesis))
    there = z + bounded_step(A, b, DAMPING, fixed, linear, z, low, high)
    moved = fitter.evaluate(found, there, hypothesis)
    # what is no better than where it begins stays
    ends = [(fitter.squares(found, one), where) for one, where in ((at, z), (moved, there)) if one is not None]
    return min(ends, key=lambda pair: pair[0])
