"""The gain of a hypothesis on readings that its fit had not seen.

Postures are held out one at a time, else directions, cycles, or every third reading: the first that the data allow.
Each part is predicted by a refit in full without it, which begins where the fit to all readings ended.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.normal_equations import inverse
from vjm_updating.inference.residual_basis import driven_place
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.observation.evaluation import Evaluation
from vjm_updating.observation.observed import Observed

BLOCK = numerical(12)
"""Neighbouring readings that a bootstrap draws together."""
DRAWS = numerical(400)
SEED = numerical(5)


@dataclass(frozen=True)
class Split:
    """How readings are held out.

    Attributes:
        name: postures, directions, cycles or marks.
        fold: number ``(n,)`` of the part in which each reading is held out.
    """

    name: str
    fold: np.ndarray


@dataclass(frozen=True)
class Gain:
    """Error of readings held out, before and after: of forces where these were read, see `Observed.scored`.

    Attributes:
        before: root mean square.
        after: likewise.
        interval: of the reduction, 95 %.
        before_in_sigma: over each reading's noise.
        after_in_sigma: likewise.
        split: how they were held out.
        expected_in_sigma: what a right model's error would be, over each reading's noise.
        unit: of before, after and interval.
    """

    before: float
    after: float
    interval: tuple[float, float]
    before_in_sigma: float
    after_in_sigma: float
    split: str
    expected_in_sigma: float
    unit: str = "N"


def split_of(observed: Observed) -> Split:
    """The first way to hold out that the data allow."""
    readings = observed.readings
    labels = list(dict.fromkeys(readings.posture.tolist()))
    if len(labels) > 1:
        return Split("postures", np.array([labels.index(p) for p in readings.posture.tolist()]))
    place = driven_place(observed)
    if (place > 0.2).sum() > 8 and (place < -0.2).sum() > 8:
        return Split("directions", (place < 0.0).astype(int))
    runs = np.unique(readings.run)
    if len(runs) > 1:
        return Split("cycles", np.searchsorted(runs, readings.run))
    return Split("marks", np.arange(len(place)) % 3)


def refitted_without(fitter: Fitter, fit: Fit, own: np.ndarray) -> Evaluation | None:
    """All readings under a refit in full that has not seen those of ``own`` (n,); None where the machine fails."""
    less = _without(fitter, own)
    found = best_fit(less, fit.hypothesis, fit.at.z[: len(fitter.nuisances)], fit.values)
    return None if found is None else fitter.evaluate(found.found, found.at.z, fit.hypothesis)


def _without(fitter: Fitter, own: np.ndarray) -> Fitter:
    observed = fitter.forward.observed
    kept = observed.without(observed.present & own[:, None])
    return Fitter(fitter.forward.reading(kept), fitter.nuisances, fitter.whitening.reading(kept))


def _as_drawn(fitter: Fitter, fit: Fit) -> Array:
    """Residual ``(n, 6)`` of the machine as drawn."""
    at = fitter.evaluate(fitter.nuisances, np.zeros(len(fitter.nuisances)), ())
    return fit.at.residual if at is None else at.residual


def held_out_residual(fitter: Fitter, fit: Fit, split: Split, otherwise: Array | None = None) -> Array:
    """Raw residual ``(n, 6)`` of each reading under a refit without its part.

    Args:
        fitter: of the test.
        fit: to all readings.
        split: how they are held out.
        otherwise: ``(n, 6)``, counts where a refit finds no machine that stands; the nominal one's by default.
    """
    result = (_as_drawn(fitter, fit) if otherwise is None else otherwise).copy()
    for number in np.unique(split.fold):
        own = split.fold == number
        at = refitted_without(fitter, fit, own)
        if at is not None:
            result[own] = at.residual[own]
    return np.where(fitter.whitening.present, result, 0.0)


def unsure(fitter: Fitter, fit: Fit, split: Split) -> Array:
    """Standard deviation ``(n, 6)`` of each reading's prediction by a right model fitted without its part.

    What the rest leaves open of the parameters, the sheet's tolerances among them, to first order. No model can be
    expected to predict better than this and the reading's own noise.
    """
    steep = fitter.slopes(fit.found, fit.at, fit.hypothesis)
    free = np.array([c.sigma != 0.0 for c in fit.found])
    result = np.zeros_like(fit.at.residual)
    for number in np.unique(split.fold):
        own = split.fold == number
        A = _without(fitter, own).normal(replace(fit, jacobian=steep))
        C, J = inverse(A, free), steep[own]
        result[own] = np.sqrt(np.maximum(np.einsum("nij,jk,nik->ni", J, C, J), 0.0))
    return result


def gain(fitter: Fitter, fit: Fit, split: Split, before: Array, after: Array, open_: Array) -> Gain:
    """The gain of a fit over the sheet's tolerances alone.

    Args:
        fitter: of the test.
        fit: whose stiffness says what the displacement's noise makes of a force.
        split: how readings were held out.
        before: residuals ``(n, 6)`` held out, of the sheet's tolerances alone.
        after: of the fit.
        open_: standard deviations ``(n, 6)`` of its predictions.
    """
    observed = fitter.forward.observed
    own, unit = observed.scored
    before, after = before[:, own], after[:, own]
    on = fitter.whitening.present[:, own]
    K = fit.at.stiffness
    # a reading's own noise, and its displacement's
    sigma = np.sqrt(np.einsum("nij,j->ni", K**2, observed.noise.pose**2) + observed.noise.wrench**2)[:, own]
    squares = [np.where(on, e**2, 0.0).sum(axis=1) for e in (before, after)]
    scaled = [np.where(on, (e / sigma) ** 2, 0.0).sum(axis=1) for e in (before, after)]
    count = on.sum(axis=1)
    expected = float(np.sqrt(np.mean(1.0 + (open_[:, own] / sigma)[on] ** 2)))
    rmse = [float(np.sqrt(s.sum() / max(count.sum(), 1))) for s in squares]
    relative = [float(np.sqrt(s.sum() / max(count.sum(), 1))) for s in scaled]
    blocks = np.arange(len(count)) // BLOCK
    sums = np.array([np.bincount(blocks, v) for v in (*squares, count)])
    rng = np.random.default_rng(SEED)
    picks = rng.integers(0, sums.shape[1], (DRAWS, sums.shape[1]))
    drawn = sums[:, picks].sum(axis=2)
    fall = np.sqrt(drawn[0] / np.maximum(drawn[2], 1)) - np.sqrt(drawn[1] / np.maximum(drawn[2], 1))
    low, high = np.quantile(fall, [0.025, 0.975])
    return Gain(rmse[0], rmse[1], (float(low), float(high)), relative[0], relative[1], split.name, expected, unit)
