"""The gain of a hypothesis on readings that its fit had not seen.

Postures are held out one at a time, else directions, cycles, or every third reading: the first that the data allow.
Of a column's marks it is always every third one. Each part is predicted by a refit in full without it, which begins
where the fit to all readings ended.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.document import FoldRow, GainRow
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.inference.bounded_normal import inverse
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, best_fit
from vjm_updating.inference.model_error import driven_place
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.parameters import uncertain
from vjm_updating.inference.significance import NORMAL_95

THIRD = numerical(3)
"""Every so many marks one is held out, in turn."""
BLOCK, DRAWS = numerical(12), numerical(400)
"""Neighbouring readings that a bootstrap draws together, and how often it draws."""
MARKS_DRAWS = numerical(2000)
"""The same of a column's marks, which are few, and each of which is drawn by itself."""
SEED = numerical(5)
SINGULAR = numerical(1e-12)
"""Share of the largest variance below which a direction is rounding."""

HoldOut = Callable[[Fit], GainRow]
"""Gain of a fit on readings held out."""


@dataclass(frozen=True)
class Split:
    """How readings are held out.

    Attributes:
        name: postures, directions, cycles or marks.
        fold: number ``(n,)`` of the part in which each reading is held out; negative where it never is.
        block: neighbouring readings that a bootstrap draws together.
    """

    name: str
    fold: np.ndarray
    block: int = BLOCK
    draws: int = DRAWS

    def parts(self) -> list[np.ndarray]:
        """Whether each reading ``(n,)`` is of a part, part by part."""
        return [self.fold == number for number in np.unique(self.fold[self.fold >= 0])]


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
    return Split("marks", np.arange(len(place)) % THIRD)


def split_of_marks(observed: Observed) -> Split:
    """A column's marks, every third one in turn; beyond the first and the last nothing predicts them."""
    inner = np.flatnonzero(observed.present[:, 0])[1:-1]
    fold = np.full(len(observed.imposed), -1)
    fold[inner] = np.arange(len(inner)) % THIRD
    return Split("marks", fold, block=1, draws=MARKS_DRAWS)


def hold_out(fitter: LeastSquaresProblem, null: Fit, split: Split) -> HoldOut:
    """What fits gain over the sheet's tolerances alone, on readings held out."""
    before = held_out_residual(fitter, null, split)

    def gained(fit: Fit) -> GainRow:
        after = held_out_residual(fitter, fit, split, before)
        # no model predicts better than the rest leaves its parameters open, and the reading's own noise
        steep = fitter.slopes(fit.parameters, fit.evaluation, fit.hypothesis)
        parts = _left_open(fitter, fit, split, steep)
        open_ = np.zeros_like(fit.evaluation.residual)
        for own, C in parts:
            J = steep[own]
            open_[own] = np.sqrt(np.maximum(np.einsum("nij,jk,nik->ni", J, C, J), 0.0))
        gain = _gain(fitter, fit, split, before, after, open_)
        if gain.after_in_sigma > NORMAL_95 * gain.expected_in_sigma:
            # near a critical load the first order expects too much
            for own, C in parts:
                open_[own] = _deviation(fitter, fit, C)[own]
            gain = _gain(fitter, fit, split, before, after, open_)
        return gain

    return gained


def _without(fitter: LeastSquaresProblem, own: np.ndarray) -> LeastSquaresProblem:
    observed = fitter.forward.observed
    kept = observed.without(observed.present & own[:, None])
    return fitter.reading(kept)


def held_out_residual(fitter: LeastSquaresProblem, fit: Fit, split: Split, otherwise: Array | None = None) -> Array:
    """Raw residual ``(n, 6)`` of each reading under a refit without its part.

    Where a refit finds no machine that stands, ``otherwise`` (n, 6) counts, by default the nominal one's.
    """
    m = len(fitter.nuisances)
    if otherwise is None:
        drawn = fitter.evaluate(fitter.nuisances, np.zeros(m), ())
        otherwise = fit.evaluation.residual if drawn is None else drawn.residual
    result = otherwise.copy()
    for own in split.parts():
        # begun with the fit's slopes by the machine's nuisances, which are made anew where they lead astray
        less, near = _without(fitter, own), fitter.machine_slopes(fit)
        refitted = best_fit(less, fit.hypothesis, fit.evaluation.z[:m], fit.values, borrowed=near)
        evaluation = (
            None
            if refitted is None
            else fitter.evaluate(refitted.parameters, refitted.evaluation.z, fit.hypothesis)
        )
        if evaluation is not None:
            result[own] = evaluation.residual[own]
    return np.where(fitter.whitening.present, result, 0.0)


def _left_open(fitter: LeastSquaresProblem, fit: Fit, split: Split, steep: Array) -> list[tuple[np.ndarray, Array]]:
    """Of each part its readings ``(n,)``, and the covariance ``(n_z, n_z)`` that the rest leaves a fit's z.

    ``steep`` (n, 6, n_z) are the slopes of the fit's readings; the sheet's tolerances are among the z.
    """
    known = replace(fit, jacobian=steep)
    free = uncertain(fit.parameters)
    return [(own, inverse(_without(fitter, own).normal(known), free)) for own in split.parts()]


def _deviation(fitter: LeastSquaresProblem, fit: Fit, covariance: Array) -> Array:
    """Standard deviation ``(n, 6)`` of predictions about a fit whose z have a ``covariance`` (n_z, n_z).

    By the cubature of third degree (Arasaratnam and Haykin, IEEE Trans. Autom. Control 54 (2009) 1254): by points
    along its principal axes, at the root of their number. Those where no machine stands are left out.
    """
    low, high = (np.array([getattr(c, end) for c in fit.parameters]) for end in ("low", "high"))
    sizes, axes = np.linalg.eigh(covariance)
    known = sizes > SINGULAR * sizes.max(initial=0.0)
    steps = axes[:, known] * np.sqrt(sizes[known] * known.sum())
    squares = [
        (evaluation.residual - fit.evaluation.residual) ** 2
        for step in np.concatenate([steps.T, -steps.T])
        if (evaluation := fitter.evaluate(
            fit.parameters, np.clip(fit.evaluation.z + step, low, high), fit.hypothesis
        )) is not None
    ]  # fmt: skip
    return np.sqrt(np.mean(squares, axis=0)) if squares else np.full_like(fit.evaluation.residual, np.inf)


def _gain(
    fitter: LeastSquaresProblem, fit: Fit, split: Split, before: Array, after: Array, open_: Array
) -> GainRow:
    """The gain of a fit, as a whole and part by part.

    Residuals held out are ``before`` (n, 6) those of the sheet's tolerances alone, ``after`` those of the fit,
    whose predictions have standard deviations ``open_`` (n, 6).
    """
    observed = fitter.forward.observed
    own, unit = observed.scored
    held = split.fold >= 0
    on = fitter.whitening.present[held][:, own]
    # a reading's own noise, and its displacement's
    K = fit.evaluation.stiffness[held]
    sigma = np.sqrt(np.einsum("nij,j->ni", K**2, observed.noise.pose**2) + observed.noise.wrench**2)[:, own]
    errors = [np.where(on, e[held][:, own], 0.0) for e in (before, after)]
    rmse, relative = ([_rms(e, on) for e in some] for some in (errors, [e / sigma for e in errors]))
    blocks = np.arange(len(on)) // split.block
    sums = np.array([np.bincount(blocks, v.sum(axis=1)) for v in (*(e**2 for e in errors), on)])
    picks = np.random.default_rng(SEED).integers(0, sums.shape[1], (split.draws, sums.shape[1]))
    drawn = sums[:, picks].sum(axis=2)
    fall = np.sqrt(drawn[0] / np.maximum(drawn[2], 1)) - np.sqrt(drawn[1] / np.maximum(drawn[2], 1))
    read = np.where(on, np.nan_to_num(observed.measured[held][:, own]), 0.0)
    return GainRow(
        rmse_before=rmse[0],
        rmse_after=rmse[1],
        interval95=np.quantile(fall, [0.025, 0.975]).tolist(),
        before_in_sigma=relative[0],
        after_in_sigma=relative[1],
        expected_in_sigma=float(np.sqrt(np.mean(1.0 + (open_[held][:, own] / sigma)[on] ** 2))),
        unit=unit,
        split=split.name,
        folds=[
            FoldRow(
                name=_name(observed, split, part),
                readings=int(on[part[held]].sum()),
                force=_rms(read[part[held]], on[part[held]]),
                rmse_before=_rms(errors[0][part[held]], on[part[held]]),
                rmse_after=_rms(errors[1][part[held]], on[part[held]]),
            )
            for part in split.parts()
            if on[part[held]].any()
        ],
    )


def _rms(e: Array, on: np.ndarray) -> float:
    """Root mean square of errors ``(n, c)``, zero where nothing was read, over what was read."""
    return float(np.sqrt(np.sum(e**2) / max(int(on.sum()), 1)))


def _name(observed: Observed, split: Split, part: np.ndarray) -> str:
    """Of a part ``(n,)``: posture, direction, cycle, or the first of the marks."""
    own = np.flatnonzero(part)
    first = int(own[0])
    if split.name == "postures":
        return f"posture {observed.readings.posture[first]}"
    if split.name == "directions":
        if observed.columns != WRENCH:
            return "one way" if split.fold[first] == 0 else "the other way"
        return "compression" if observed.imposed[first, 0] < 0.0 else "tension"
    if split.name == "cycles":
        return f"cycle {observed.readings.run[first]}"
    return "marks " + ", ".join(str(int(k) + 1) for k in own[:3]) + (", …" if len(own) > 3 else "")
