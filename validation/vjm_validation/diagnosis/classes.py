"""Which hypotheses a test cannot tell apart: each refitted to the other's noise-free readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.rotations import Array
from vjm_validation.calibration.noise import memory_of
from vjm_validation.diagnosis.fitting import Fit, Fitter
from vjm_validation.diagnosis.unknowns import Coordinate, release_key

APART = 2.0
"""Strength within which two causes are one class."""


def distance(fitter: Fitter, truth: Fit, other: Fit) -> float:
    """Strength that remains when a hypothesis is refitted to another's noise-free readings.

    Args:
        fitter: of the test.
        truth: whose readings are taken, its nuisances at zero.
        other: that is refitted to them, nuisances and all.
    """
    z = truth.at.z.copy()
    freed = {release_key(effect) for effect in truth.hypothesis}
    still = [i for i, c in enumerate(truth.found) if c.kind != "effect" and (c.kind, c.subject) not in freed]
    z[still] = 0.0
    fitter.anchor = None
    at = fitter.evaluate(truth.found, z, truth.hypothesis)
    if at is None:
        return float("inf")
    return _refitted(fitter, fitter.forward.observed.wrench - at.residual, other)


def _refitted(fitter: Fitter, wrench: Array, other: Fit) -> float:
    observed = fitter.forward.observed
    clean = np.where(observed.present, wrench, np.nan)
    made = replace(observed, wrench=clean, memory=memory_of(observed.readings.sequence, ~np.isnan(clean)))
    forward = fitter.forward.reading(made)
    own = Fitter(forward, fitter.nuisances, fitter.whitening, fitter.machine_slopes)
    freed = {release_key(effect) for effect in other.hypothesis}
    m = len(fitter.nuisances)
    start = np.array([_kept(c, v, freed) for c, v in zip(other.found[:m], other.at.z[:m], strict=True)])
    fit = own.fit(other.hypothesis, start, other.values)
    return float("inf") if fit is None else float(np.sqrt(max(fit.objective - _prior_of_effects(fit), 0.0)))


def _kept(c: Coordinate, z: float, freed: set[tuple[str, str] | None]) -> float:
    return z if (c.kind, c.subject) in freed else 0.0


def _prior_of_effects(fit: Fit) -> float:
    """What the effects' own usual shapes cost: no part of the strength."""
    return float(
        sum(
            ((z - c.mean) / c.sigma) ** 2
            for c, z in zip(fit.found, fit.at.z, strict=True)
            if c.kind == "effect" and np.isfinite(c.sigma)
        )
    )


def together(fitter: Fitter, one: Fit, other: Fit) -> bool:
    """Whether two hypotheses are one class on a test."""
    return distance(fitter, one, other) <= APART and distance(fitter, other, one) <= APART
