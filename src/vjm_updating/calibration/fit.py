"""The most probable unknowns, their covariance, and what the residuals say of the noise.

Generalised least squares of the readings with the sheet's Gaussian priors, by the fit and the treatment of outliers
that a diagnosis has (`vjm_updating.inference`). Where more is left than the sheet's noise, that noise is taken for
larger, and the uncertainties grow with it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.calibration.problem import Calibrated, CalibrationProblem
from vjm_updating.constants import numerical, stated_level
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.joint_forward import JointForward
from vjm_updating.inference.normal_equations import inverse
from vjm_updating.inference.outliers import standing_out
from vjm_updating.inference.refit import choose_branches, leave_out, refit
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.observation.coordinate import Evaluation
from vjm_updating.observation.observed import Observed
from vjm_updating.observation.whitening import Whitening, whitening_of

ROUNDING = numerical(1e-6)
"""Squares that a prediction is good for: equilibria at the readings themselves are not interpolated."""
ROUNDS, SETTLED = numerical(5), numerical(1e-2)
"""In which spread and covariances of the readings are found again about a fit, and the change of an unknown, in its
standard deviations, at which that ends."""
MISFIT = stated_level(3.0)
"""Standard errors by which the residuals' variance must exceed the sheet's to be another one."""


@dataclass(frozen=True)
class Solution(ABC):
    """A fit to a test, and what it leaves of the readings.

    Attributes:
        everything: all readings.
        forward: model of them, outliers included, on the branches that were found.
        fitter: of the readings that are no outliers, with the noise that was found.
        fit: the best.
    """

    everything: Observed
    forward: Calibrated | JointForward
    fitter: Fitter
    fit: Fit

    @property
    @abstractmethod
    def spread(self) -> Array:
        """Standard deviation ``(6,)`` of each channel's residuals over the sheet's; 1 where it is not larger."""

    @property
    @abstractmethod
    def covariance(self) -> Array:
        """Of the fit's z ``(n_z, n_z)``."""

    @property
    def start(self) -> Array:
        """The nominal machine and instruments ``(m,)``."""
        return np.zeros(len(self.fitter.nuisances))

    @property
    def z(self) -> Array:
        """The unknowns ``(n_z,)``."""
        return self.fit.at.z

    @property
    def deviation(self) -> Array:
        """Standard deviations ``(n_z,)`` of the unknowns' z."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=float)

    @cached_property
    def at(self) -> Evaluation:
        """All readings against the model."""
        return self.forward.evaluate(self.fit.found, self.z, self.fit.hypothesis)

    @cached_property
    def nominal(self) -> Evaluation:
        """All readings against the nominal model."""
        return self.forward.evaluate(self.fitter.nuisances, self.start, ())

    @property
    def branched(self) -> np.ndarray:
        """Whether each reading ``(n,)`` lies behind a bifurcation."""
        return self.forward.behind_bifurcation(self.fit.found, self.z, self.fit.hypothesis)

    @property
    def whitening(self) -> Whitening:
        """Of the residuals."""
        return self.fitter.whitening

    @property
    def outliers(self) -> np.ndarray:
        """Samples ``(n, 6)`` that were left out."""
        return self.everything.present & ~self.fitter.forward.observed.present

    @cached_property
    def residual(self) -> Array:
        """Whitened ``(n, 6)``, less the likeliest errors of straight lines and means; zero for outliers."""
        raw = self.whitening.without_slow(self.fit.at.residual)
        return np.where(self.whitening.present, self.whitening.independent(raw), 0.0)

    @cached_property
    def noises(self) -> Array:
        """Residuals ``(n, 6)`` of all readings in standard deviations of each on its own."""
        made = self.at.sensitivity * self.everything.pose_noise[:, None, :]
        noise = np.sqrt(self.everything.noise.wrench**2 + np.sum(made**2, axis=2))
        result: Array = self.whitening.without_slow(self.at.residual) / noise
        return result


@dataclass(frozen=True)
class CalibrationSolution(Solution):
    """The unknowns of a machine that were found.

    Attributes:
        problem: that is solved.
        refuted: beams that the readings tell from nothing else, though not as the sheet promises them.
    """

    problem: CalibrationProblem
    refuted: tuple[str, ...] = ()

    @property
    def spread(self) -> Array:
        """Those that count in the fit."""
        return self.whitening.spread

    @property
    def start(self) -> Array:
        """Nominal, and a drive a little off its bound."""
        return self.problem.unknowns.start

    @property
    def pulls(self) -> Array:
        """The nuisances ``(n_z − n_parameters,)`` in the sheet's standard deviations of each."""
        own = self.problem.unknowns.parameters
        result: Array = self.z[own:] / self.problem.unknowns.sigma[own:]
        return result

    @cached_property
    def information(self) -> Array:
        """What the data say of the unknowns ``(n_z, n_z)``, without the priors."""
        J = self.whitening.flat(self.fit.jacobian)
        result: Array = J.T @ J
        return result

    @cached_property
    def normal(self) -> Array:
        """Inverse covariance of the unknowns ``(n_z, n_z)``, priors included."""
        result: Array = self.information + np.diag(self.problem.unknowns.sigma**-2.0)
        return result

    @cached_property
    def covariance(self) -> Array:
        """Of the unknowns' z ``(n_z, n_z)``."""
        return np.asarray(np.linalg.inv(self.normal), dtype=float)


def solve(problem: CalibrationProblem) -> CalibrationSolution:
    """Solve a calibration.

    Raises:
        NoConvergenceError: the nominal model does not reach the readings.
    """
    everything, start = problem.observed, problem.unknowns.start
    fitter, nominal = fitter_of(problem)
    outliers = standing_out(everything, nominal.residual, fitter.whitening.factors)
    leave_out(fitter, Observed.without, everything, outliers, nominal)
    first = _best(fitter, start)
    fit = choose_branches(fitter, first)
    if fit is not first:
        fit = _best(fitter, fit.at.z)
    fit = refit(fitter, Observed.without, everything, fit)
    for _ in range(ROUNDS):
        before, deviation = fit.at.z, deviations(fitter, fit)
        fitter.weigh(fit.at)
        fitter.whitening = replace(fitter.whitening, spread=spread_of(fitter, fit, problem.unknowns.parameters))
        fit = _best(fitter, before, fitter.machine_slopes(fit))
        if np.max(np.abs(fit.at.z - before) / deviation) < SETTLED:
            break
    fit = replace(fit, jacobian=fitter.slopes(fit.found, fit.at, ()))
    assert isinstance(fitter.forward, Calibrated)
    return CalibrationSolution(everything, fitter.forward.reading(everything), fitter, fit, problem)


def deviations(fitter: Fitter, fit: Fit) -> Array:
    """Standard deviations ``(n_z,)`` of a fit's unknowns with the noise that its fitter has now."""
    result: Array = np.sqrt(np.diag(inverse(fitter.normal(fit), np.ones(len(fit.at.z), dtype=bool))))
    return result


def fitter_of(problem: CalibrationProblem) -> tuple[Fitter, Evaluation]:
    """A fitter of all readings with the sheet's noise, and the readings against the nominal model.

    Raises:
        NoConvergenceError: the nominal model does not reach the readings.
    """
    forward = problem.forward(problem.observed)
    nominal = forward.evaluate(problem.unknowns.all, problem.unknowns.start, ())
    return Fitter(forward, problem.unknowns.all, whitening_of(problem.observed, nominal), ROUNDING), nominal


def _best(fitter: Fitter, start: Array, borrowed: Array | None = None) -> Fit:
    found = best_fit(fitter, (), start, [], borrowed=borrowed)
    if found is None:
        raise NoConvergenceError("the model does not reach the readings")
    return found


def spread_of(fitter: Fitter, fit: Fit, parameters: int) -> Array:
    """Standard deviation ``(6,)`` of each channel's residuals over the sheet's, where it is told from that."""
    present = fitter.whitening.present
    spread = np.ones(present.shape[1])
    whitening = replace(fitter.whitening, spread=spread.copy())
    r = whitening.independent(whitening.without_slow(fit.at.residual))
    used = parameters / max(int(present.sum()), 1)
    for c in np.flatnonzero(present.any(axis=0)):
        own = r[present[:, c], c]
        freedom = max(len(own) * (1.0 - used), 1.0)
        variance = float(np.sum(own**2)) / freedom
        if variance > 1.0 + MISFIT * np.sqrt(2.0 / freedom):
            spread[c] = np.sqrt(variance)
    return spread
