"""A test made ready for a search: nominal fit, wild samples, branches, noise, catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.errors import did_you_mean
from vjm.rotations import Array
from vjm_updating.diagnose.fitting import Fit, Fitter
from vjm_updating.diagnose.kind_of_test import KindOfTest
from vjm_updating.diagnose.kinds import kind_of
from vjm_updating.diagnose.outliers import loads, outlying, standing_out
from vjm_updating.diagnose.parameters import coordinates, nuisance_coordinates
from vjm_updating.diagnose.residual_basis import smooth_shapes
from vjm_updating.diagnose.screening import STRONG, Signature, Signed, signed
from vjm_updating.diagnose.trust_region import best_fit
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.observation.autocorrelation import estimate_memory
from vjm_updating.observation.evaluation import Evaluation
from vjm_updating.observation.observed import Observed
from vjm_updating.observation.whitening import weighed, whitening_of

SAME_MEMORY = 0.05
"""Change of the noise's autocorrelation that is none."""
SAME_NOISE = 0.03
"""Relative change of a fit's squares by which its own covariances are those in force."""
WORSE = 6
"""Rounds in which wild samples are looked for, the worst first."""


@dataclass(frozen=True)
class Prepared:
    """A test before any cause is tried.

    Attributes:
        fitter: with its noise known.
        null: fit of the sheet's tolerances alone.
        effects: the catalogue.
        all: every reading, wild ones included.
        signed: what each effect does to the readings about a null.
    """

    fitter: Fitter
    null: Fit
    effects: tuple[Effect, ...]
    all: Observed
    signed: Signed


def prepare(
    observed: Observed, more: Sequence[Maker] = (), *, only: Sequence[str] = (), without: Sequence[str] = ()
) -> Prepared:
    """Fit the nominal model, find wild samples and the noise's memory.

    Args:
        observed: the test.
        more: effects beyond the catalogue's.
        only: the causes that are thought possible; all where none is given.
        without: causes that are not.

    Raises:
        ValueError: no effect of this test has such a cause.
        NoConvergenceError: the nominal machine has no equilibrium at the readings.
    """
    kind = kind_of(observed.measurement)
    forward = kind.forward(observed)
    nuisances = tuple(nuisance_coordinates(observed))
    found = coordinates(nuisances, ())
    zero = np.zeros(len(found))
    at = forward.evaluate(found, zero, ())
    fitter = Fitter(forward, nuisances, whitening_of(observed, at))
    _leave_out(fitter, kind, observed, standing_out(observed, at.residual, fitter.whitening.factors), at)
    null = _fitted(fitter)
    null = choose_branches(fitter, null)
    effects = possible(kind.effects(forward.observed, more), only, without)
    known = signed(fitter, null, effects)
    remember(fitter, null, known.found)
    null = _fitted(fitter, null.at.z, *_beside_kinks(fitter))
    return Prepared(fitter, null, effects, observed, known)


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


def _leave_out(fitter: Fitter, kind: KindOfTest, observed: Observed, wild: np.ndarray, at: Evaluation) -> None:
    """Go on without wild samples ``(n, 6)``, where the kind of test leaves any out."""
    kept = kind.without_outliers(observed, wild)
    fitter.forward.observed = kept
    fitter.whitening = fitter.whitening.reading(kept)
    fitter.weigh(at)


def refresh(prepared: Prepared, best: Fit) -> Prepared | None:
    """Find wild samples, the readings' covariances and the noise's memory again, about a better model.

    None where nothing changes by it, or the model is so far off that it tells nothing of the noise; the fitter is
    then as it was, so that objectives found with it can still be compared.
    """
    fitter, kind = prepared.fitter, kind_of(prepared.all.measurement)
    everything = kind.reweighted(fitter, prepared.all, best)
    if everything is None:
        return None
    readings, whitening, branches = fitter.forward.observed, fitter.whitening, dict(fitter.forward.branches)
    _leave_out(fitter, kind, everything, np.zeros_like(everything.present), best.at)
    whole = fitter.evaluate(best.found, best.at.z, best.hypothesis)
    # of samples left out a fit does not say what should have been read
    load = np.zeros(everything.present.shape) if whole is None else loads(everything, whole.residual)
    at = whole or best.at
    m = len(fitter.nuisances)
    fit: Fit | None = None
    wild, accidents = np.zeros(everything.present.shape), np.ones(6, dtype=bool)
    for _ in range(WORSE):
        found = outlying(everything, fitter.whitening, at.residual, wild, load)
        # what with others turns out to be none is not looked for again
        accidents &= found.any(axis=0) | ~wild.any(axis=0)
        found = np.where(accidents, found, 0.0)
        if fit is not None and np.array_equal(found, wild):
            break
        wild = found
        _leave_out(fitter, kind, everything, wild != 0.0, at)
        # wild samples bend a fit and hide the noise's memory, and then their neighbours look wild
        fit = choose_branches(fitter, best_fit(fitter, best.hypothesis, at.z[:m], best.values) or best)
        remember(fitter, fit, ())
        at = fit.at
    same = everything.noise is prepared.all.noise
    same &= np.array_equal(readings.present, fitter.forward.observed.present)
    close = float(np.abs(whitening.memory.rho - fitter.whitening.memory.rho).max()) < SAME_MEMORY
    # near a critical point the stiffness, and what the gauge's noise makes of forces, may be another altogether
    squares, own = (
        float(np.sum(w.flat(best.at.residual) ** 2)) for w in (whitening, weighed(whitening, readings, best.at))
    )
    alike = abs(own - squares) < SAME_NOISE * squares
    if same and close and alike and prepared.null.objective - best.objective < STRONG:
        fitter.forward.observed, fitter.whitening, fitter.forward.branches = readings, whitening, branches
        return None
    return replace(prepared, null=_fitted(fitter, prepared.null.at.z, *_beside_kinks(fitter)), all=everything)


def _fitted(fitter: Fitter, *near: Array) -> Fit:
    """The sheet's tolerances alone: the best from nominal, and from nuisances ``(m,)`` near by.

    Raises:
        NoConvergenceError: the nominal machine has no equilibrium at the readings.
    """
    null = best_fit(fitter, (), np.zeros(len(fitter.nuisances)), [])
    if null is None:
        raise NoConvergenceError("the nominal machine has no equilibrium at the readings")
    for start in near:
        other = best_fit(fitter, (), start, [], borrowed=fitter.machine_slopes(null))
        if other is not None and other.objective < null.objective - 0.5:
            null = best_fit(fitter, (), other.at.z, []) or other
    return null


def _beside_kinks(fitter: Fitter) -> list[Array]:
    """Nuisances ``(m,)`` to begin from where a critical point may move over readings: there are several minima."""
    if not _kinked(fitter):
        return []
    return [sign * np.eye(len(fitter.nuisances))[i] for i in fitter.of_machine for sign in (1.0, -1.0)]


def _kinked(fitter: Fitter) -> bool:
    """Whether readings lie on both sides of a bifurcation."""
    forward = fitter.forward
    for ray in forward.observed.rays:
        s = forward.observed.pose[ray.index] @ ray.measure
        if any(forward.branched(ray, sign, float((sign * s).max())) for sign in (1, -1)):
            return True
    return False


def remember(fitter: Fitter, base: Fit, shown: Sequence[Signature]) -> None:
    """Estimate the noise's memory; what effects or smooth shapes could explain does not count as noise."""
    observed, whitening = fitter.forward.observed, fitter.whitening
    smooth, _ = smooth_shapes(observed)
    own = [s.change for s in shown if s.change is not None]
    sigma = np.array([c.sigma for c in base.found])
    off = base.at.z - np.array([c.mean for c in base.found])
    known = (sigma > 0.0) & np.isfinite(sigma)
    J = whitening.instant(base.jacobian)
    shapes = [J[:, :, ~known], np.repeat(smooth[:, None, :], 6, axis=1)]
    if own:
        shapes.append(whitening.instant(np.stack(own, axis=-1)))
    sheet = J[:, :, known] * sigma[known]
    # as it were at the sheet's own values
    instant = whitening.instant(base.at.residual) - J[:, :, known] @ off[known]
    sheet = np.concatenate([sheet, whitening.instant(whitening.slow)], axis=2)
    memory = estimate_memory(observed.memory, instant, np.concatenate(shapes, axis=2), observed.present, sheet)
    fitter.whitening = replace(whitening, memory=memory)


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
