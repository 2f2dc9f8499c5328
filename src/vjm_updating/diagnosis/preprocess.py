"""A test made ready for a search: nominal fit, outliers, branches, noise, catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.errors import did_you_mean
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.document import CriticalPointRow
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.diagnosis.screening import STRONG, SignatureSet, signed
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, best_fit, weighed, whitening_of
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates
from vjm_updating.inference.refit import choose_branches, leave_out, refit, standing_out, update_autocorrelation
from vjm_updating.inference.significance import level
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.mechanisms.effect import Effect

SAME_AUTOCORRELATION = numerical(0.05)
"""Change of the noise's autocorrelation that is none."""
SAME_NOISE = numerical(0.03)
"""Relative change of a fit's squares by which its own covariances are those in force."""


@dataclass(frozen=True)
class Prepared:
    """A test before any cause is tried.

    Attributes:
        fitter: with its noise known.
        all: every reading, outliers included.
        critical: readings ``(n,)`` near a critical point or behind it, see `RampTest.critical`.
        aside: those of them that the fitter goes without.
        held_against: whether those aside were held against what explains the others; else nothing explains these.
        signed: what each effect does to the readings about a null.
    """

    fitter: LeastSquaresProblem
    null: Fit
    effects: tuple[Effect, ...]
    all: Observed
    critical: np.ndarray
    aside: np.ndarray
    signed: SignatureSet
    held_against: bool = False


def prepare(
    observed: Observed, more: Sequence[Maker] = (), *, only: Sequence[str] = (), without: Sequence[str] = ()
) -> Prepared:
    """Fit the nominal model, find outliers and the noise's autocorrelation.

    ``only`` are the causes that are thought possible, all where none is given; ``without`` are those that are not.

    Raises:
        ValueError: no effect of this test has such a cause.
        NoConvergenceError: the nominal machine has no equilibrium at the readings.
    """
    kind = kind_of(observed.measurement)
    forward = kind.forward(observed)
    nuisances = tuple(nuisance_coordinates(observed))
    unknowns = coordinates(nuisances, ())
    zero = np.zeros(len(unknowns))
    evaluation = forward.evaluate(unknowns, zero, ())
    fitter = LeastSquaresProblem(forward, nuisances, whitening_of(observed, evaluation))
    flagged = standing_out(observed, evaluation.residual, fitter.whitening.factors)
    critical = kind.critical(observed, evaluation)
    leave_out(fitter, kind.without_outliers, _less(observed, critical), flagged & ~critical[:, None], evaluation)
    null = _fitted(fitter)
    null = choose_branches(fitter, null)
    effects = possible(kind.effects(forward.observed, more), only, without)
    known = signed(fitter, null, effects)
    update_autocorrelation(fitter, null, [s.change for s in known.signatures if s.change is not None])
    null = _fitted(fitter, null.evaluation.z, *_beside_kinks(fitter))
    return Prepared(fitter, null, effects, observed, critical, critical, known)


def _less(observed: Observed, aside: np.ndarray) -> Observed:
    """The same without some readings ``(n,)``."""
    return observed.without(np.broadcast_to(aside[:, None], observed.present.shape)) if aside.any() else observed


def possible(effects: Sequence[Effect], only: Sequence[str], without: Sequence[str]) -> tuple[Effect, ...]:
    """The effects that are thought possible.

    Raises:
        ValueError: one of the causes named is not among them.
    """
    causes = {effect.cause for effect in effects}
    for cause in (*only, *without):
        if cause not in causes:
            known = ", ".join(sorted(causes))
            raise ValueError(f"no cause '{cause}' in this test{did_you_mean(cause, causes)}; there are {known}")
    return tuple(e for e in effects if e.cause not in without and (not only or e.cause in only))


def unpredicted(prepared: Prepared, fits: Sequence[Fit]) -> np.ndarray:
    """Readings ``(n,)`` near a critical point that none of some fits predicts as well as noise allows."""
    everything, result = prepared.all, prepared.critical.copy()
    fitter = prepared.fitter.reading(everything)
    for fit in fits:
        fitter.weigh(fit.evaluation)
        evaluation = fitter.evaluate(fit.parameters, fit.evaluation.z, fit.hypothesis)
        if evaluation is not None:
            off = fitter.whitening.instant(np.where(everything.present, evaluation.residual, 0.0))
            result &= np.abs(off).max(axis=1) > level(int(everything.present.sum()))
    return result


def critical_points(prepared: Prepared, fit: Fit) -> list[CriticalPointRow]:
    """What the kind of test says of its critical points, also by the readings that are left out near one."""
    fitter, kind = prepared.fitter, kind_of(prepared.all.measurement)
    if not prepared.aside.any():
        return kind.critical_points(fitter, prepared.null, fit)
    outliers = prepared.all.present & ~fitter.forward.observed.present & ~prepared.aside[:, None]
    fitter = fitter.reading(prepared.all.without(outliers))

    def everywhere(one: Fit) -> Fit:
        evaluation = fitter.evaluate(one.parameters, one.evaluation.z, one.hypothesis)
        if evaluation is None:
            # where the model does not stand it predicts nothing
            residual = np.where(prepared.aside[:, None], np.nan, one.evaluation.residual)
            evaluation = replace(one.evaluation, residual=residual)
        return replace(one, evaluation=evaluation)

    return kind.critical_points(fitter, everywhere(prepared.null), everywhere(fit))


def refresh(prepared: Prepared, best: Fit, aside: np.ndarray) -> Prepared | None:
    """Find outliers, the readings' covariances and the noise's autocorrelation again, about a better model.

    Readings ``aside`` (n,) are left out. None where nothing changes by it, so that objectives can still be
    compared, or where the model is so far off that it tells nothing of the noise.
    """
    readings, whitening = prepared.fitter.forward.observed, prepared.fitter.whitening
    fitter = replace(prepared.fitter, forward=prepared.fitter.forward.reading(readings))
    kind = kind_of(prepared.all.measurement)
    whole = kind.reweighted(fitter, prepared.all, best)
    if whole is None:
        return None
    everything = _less(whole, aside)
    refit(fitter, kind.without_outliers, everything, best)
    same = everything.noise is prepared.all.noise
    same &= np.array_equal(readings.present, fitter.forward.observed.present)
    before, now = whitening.autoregression, fitter.whitening.autoregression
    change = max(np.abs(before.rho - now.rho).max(), np.abs(before.white - now.white).max())
    close = float(change) < SAME_AUTOCORRELATION
    # near a critical point the stiffness, and what the gauge's noise makes of forces, may be another altogether
    squares, own = (
        float(np.sum(w.flat(best.evaluation.residual) ** 2))
        for w in (whitening, weighed(whitening, readings, best.evaluation))
    )
    alike = abs(own - squares) < SAME_NOISE * squares
    if same and close and alike and prepared.null.objective - best.objective < STRONG:
        return None
    # where no reading near a critical point is new, the least value is the same one
    kinks = _beside_kinks(fitter) if (prepared.aside & ~aside).any() else []
    null = _fitted(fitter, prepared.null.evaluation.z, *kinks)
    return replace(prepared, fitter=fitter, null=null, all=whole, aside=aside)


def _fitted(fitter: LeastSquaresProblem, *near: Array) -> Fit:
    """The sheet's tolerances alone: the best from nuisances ``(m,)`` near by, from nominal where there are none.

    Where readings lie on both sides of a bifurcation there are several minima: nominal is tried besides.

    Raises:
        NoConvergenceError: the nominal machine has no equilibrium at the readings.
    """
    if len(near) == 1 and (null := best_fit(fitter, (), near[0], [])) is not None:
        return null
    null = best_fit(fitter, (), np.zeros(len(fitter.nuisances)), [])
    if null is None:
        raise NoConvergenceError("the nominal machine has no equilibrium at the readings")
    for start in near:
        other = best_fit(fitter, (), start, [], borrowed=fitter.machine_slopes(null))
        if other is not None and other.objective < null.objective - 0.5:
            null = best_fit(fitter, (), other.evaluation.z, []) or other
    return null


def _beside_kinks(fitter: LeastSquaresProblem) -> list[Array]:
    """Nuisances ``(m,)`` to begin from where a critical point may move over readings: there are several minima."""
    forward = fitter.forward
    for ray in forward.observed.rays:
        s = forward.observed.imposed[ray.index] @ ray.measure
        if any(forward.branched(ray, sign, float((sign * s).max())) for sign in (1, -1)):
            return [sign * np.eye(len(fitter.nuisances))[i] for i in fitter.of_machine for sign in (1.0, -1.0)]
    return []
