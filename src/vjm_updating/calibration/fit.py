"""The problem of a calibration, its most probable unknowns and their covariance.

Also what the residuals say of the noise, and what the readings see of the parameters, what only together, and
what not at all.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.calibration.document import CombinationRow
from vjm_updating.calibration.parameters import OfUnknowns, Unknowns, default_parameters, unknowns
from vjm_updating.constants import numerical, stated_level
from vjm_updating.experiment import Kind, Measurement
from vjm_updating.frequencies.forward import FrequencyForward
from vjm_updating.inference.bounded_normal import inverse
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, Whitening, best_fit, whitening_of
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.joint_forward import JointForward
from vjm_updating.inference.load_forward import LoadForward
from vjm_updating.inference.observed import Observed, observe_loads
from vjm_updating.inference.parameters import Evaluation
from vjm_updating.inference.refit import choose_branches, leave_out, refit, standing_out
from vjm_updating.inference.significance import NORMAL_95


@dataclass
class CalibratedForward(OfUnknowns, Forward):
    """Predicts readings by a machine with other parameters."""


@dataclass
class CalibratedLoads(OfUnknowns, LoadForward):
    """Predicts what gauges read under loads on a machine with other parameters.

    A modulus acts on what of its beam is not looked for.
    """

    whole_beams: ClassVar[bool] = False


Calibrated = CalibratedForward | CalibratedLoads | FrequencyForward
"""What predicts the readings of a calibration, by its kind of test."""


@dataclass(frozen=True)
class CalibrationProblem:
    """What is to be fitted, to what.

    Attributes:
        unknowns: of the fit.
        observed: the readings, displacements as they were imposed.
        by_default: whether nobody said what to look for.
        promised: beams that are not looked for, because readings do not tell them from other parts: of them counts
            what the sheet promises.
    """

    unknowns: Unknowns
    observed: Observed
    by_default: bool = False
    promised: tuple[str, ...] = ()

    @property
    def engine(self) -> VjmEngine:
        """Of the lumped model."""
        return self.observed.measurement.engine

    def forward(self, observed: Observed) -> Calibrated:
        """The model at readings of this test, or at such as could be taken next."""
        if observed.measurement.loaded:
            return CalibratedLoads(observed, unknowns=self.unknowns)
        return CalibratedForward(observed, at_readings=True, unknowns=self.unknowns)


def problem_of(measurement: Measurement, names: Sequence[str] = ()) -> CalibrationProblem:
    """The calibration of a measurement.

    Args:
        measurement: sheet, readings and nominal machine.
        names: parameters to look for, see `vjm_updating.calibration.parameters.unknowns`; one factor for every
            elastic part by default.

    Raises:
        ValueError: the data are of a kind that cannot be calibrated with, or a parameter means nothing.
    """
    engine, chain = measurement.engine, measurement.chain
    observed = observe_loads(measurement) if measurement.loaded else observe_ramps(measurement)
    sought = unknowns(chain, engine, names or default_parameters(engine, chain), measurement.nuisances)
    count = int(observed.present.sum())
    if count <= sought.parameters:
        raise ValueError(
            f"{observed.readings.file}: {count} readings for {sought.parameters} parameters: "
            "look for fewer of them, or read more"
        )
    return CalibrationProblem(sought, observed, by_default=not names)


def with_promises(problem: CalibrationProblem) -> CalibrationProblem | None:
    """The same with each beam as the sheet promises it; None where the sheet promises none, or nothing is left.

    For readings that do not tell a beam from the joint or mount that carries it: of the beam more is known.
    """
    observed, engine = problem.observed, problem.engine
    measurement, chain = observed.measurement, observed.measurement.chain
    promised = {n.subject for n in measurement.nuisances if n.kind is Kind.MODULUS}
    names = [f"{beam.name}.factor" for beam in chain.beams if beam.name in promised]
    left = [name for name in default_parameters(engine, chain) if name not in names]
    if not problem.by_default or not names or not left:
        return None
    sought = unknowns(chain, engine, left, measurement.nuisances)
    return CalibrationProblem(sought, observed, promised=tuple(name.partition(".")[0] for name in names))


ROUNDING = numerical(1e-4)
"""Squares to which the last fits are made: a hundredth of a standard deviation, as `SETTLED`. Equilibria at the
readings themselves are not interpolated."""
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
    fitter: LeastSquaresProblem
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
        return self.fit.evaluation.z

    @property
    def deviation(self) -> Array:
        """Standard deviations ``(n_z,)`` of the unknowns' z."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=float)

    @cached_property
    def at(self) -> Evaluation:
        """All readings against the model."""
        return self.forward.evaluate(self.fit.parameters, self.z, self.fit.hypothesis)

    @cached_property
    def nominal(self) -> Evaluation:
        """All readings against the nominal model."""
        return self.forward.evaluate(self.fitter.nuisances, self.start, ())

    @property
    def branched(self) -> np.ndarray:
        """Whether each reading ``(n,)`` lies behind a bifurcation."""
        return self.forward.behind_bifurcation(self.fit.parameters, self.z, self.fit.hypothesis)

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
        raw = self.whitening.without_slow(self.fit.evaluation.residual)
        return np.where(self.whitening.present, self.whitening.independent(raw), 0.0)

    @cached_property
    def noises(self) -> Array:
        """Residuals ``(n, 6)`` of all readings in standard deviations of each on its own."""
        made = self.at.sensitivity * self.everything.pose_noise[:, None, :]
        noise = np.sqrt(self.everything.noise.wrench**2 + np.sum(made**2, axis=2))
        return self.whitening.without_slow(self.at.residual) / noise


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
        return self.z[own:] / self.problem.unknowns.sigma[own:]

    @cached_property
    def information(self) -> Array:
        """What the data say of the unknowns ``(n_z, n_z)``, without the priors."""
        J = self.whitening.flat(self.fit.jacobian)
        return J.T @ J

    @cached_property
    def normal(self) -> Array:
        """Inverse covariance of the unknowns ``(n_z, n_z)``, priors included."""
        return self.information + np.diag(self.problem.unknowns.sigma**-2.0)

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
        fit = _best(fitter, fit.evaluation.z)
    fit = refit(fitter, Observed.without, everything, fit)
    fitter.rounding = ROUNDING
    for _ in range(ROUNDS):
        before, deviation = fit.evaluation.z, deviations(fitter, fit)
        fitter.weigh(fit.evaluation)
        fitter.whitening = replace(fitter.whitening, spread=spread_of(fitter, fit, problem.unknowns.parameters))
        fit = _best(fitter, before, fitter.machine_slopes(fit))
        if np.max(np.abs(fit.evaluation.z - before) / deviation) < SETTLED:
            break
    fit = replace(fit, jacobian=fitter.slopes(fit.parameters, fit.evaluation, ()))
    assert isinstance(fitter.forward, Calibrated)
    return CalibrationSolution(everything, fitter.forward.reading(everything), fitter, fit, problem)


def deviations(fitter: LeastSquaresProblem, fit: Fit) -> Array:
    """Standard deviations ``(n_z,)`` of a fit's unknowns with the noise that its fitter has now."""
    return np.sqrt(np.diag(inverse(fitter.normal(fit), np.ones(len(fit.evaluation.z), dtype=bool))))


def fitter_of(problem: CalibrationProblem) -> tuple[LeastSquaresProblem, Evaluation]:
    """A fitter of all readings with the sheet's noise, and the readings against the nominal model.

    Raises:
        NoConvergenceError: the nominal model does not reach the readings.
    """
    forward = problem.forward(problem.observed)
    nominal = forward.evaluate(problem.unknowns.all, problem.unknowns.start, ())
    return LeastSquaresProblem(forward, problem.unknowns.all, whitening_of(problem.observed, nominal)), nominal


def _best(fitter: LeastSquaresProblem, start: Array, borrowed: Array | None = None) -> Fit:
    fit = best_fit(fitter, (), start, [], borrowed=borrowed)
    if fit is None:
        raise NoConvergenceError("the model does not reach the readings")
    return fit


def spread_of(fitter: LeastSquaresProblem, fit: Fit, parameters: int) -> Array:
    """Standard deviation ``(6,)`` of each channel's residuals over the sheet's, where it is told from that."""
    present = fitter.whitening.present
    spread = np.ones(present.shape[1])
    whitening = replace(fitter.whitening, spread=spread.copy())
    r = whitening.independent(whitening.without_slow(fit.evaluation.residual))
    used = parameters / max(int(present.sum()), 1)
    for c in np.flatnonzero(present.any(axis=0)):
        own = r[present[:, c], c]
        spread[c] = spread_by(float(np.sum(own**2)), max(len(own) * (1.0 - used), 1.0))
    return spread


def spread_by(squares: float, freedom: float) -> float:
    """Standard deviation over the sheet's by squares of so many residuals, where it is told from that; else 1."""
    variance = squares / freedom
    return float(np.sqrt(variance)) if variance > 1.0 + MISFIT * np.sqrt(2.0 / freedom) else 1.0


UNSEEN = stated_level(0.25)
"""Standard deviation in z from which on a direction counts as not seen: a factor of 1.6 is not excluded."""
SHARE = stated_level(0.5)
"""Part of a parameter's variance that may come from directions that are not seen: the readings say more of it."""
NEGLIGIBLE = numerical(0.05)
"""Coefficient of a combination, its largest being 1, that is left out of its name."""
TINY = numerical(1e-3)
"""Coefficient below which a combination is one parameter."""


@dataclass(frozen=True)
class Identifiability:
    """What a test can tell.

    Attributes:
        directions: of all parameters, the best seen first.
        separable: ``(p,)`` whether a parameter has a number of its own.
        combinations: of the parameters that are not separable, the best seen first.
        unseen: part ``(p, p)`` of the parameters' covariance along directions that are not seen.
    """

    directions: list[CombinationRow]
    separable: np.ndarray
    combinations: list[CombinationRow]
    unseen: Array

    def determined(self, gradient: Array, variance: float) -> bool:
        """Whether a function of the parameters is known from the readings, not from the weak prior.

        Args:
            gradient: by the parameters' z ``(p,)``.
            variance: of the function.
        """
        return bool(gradient @ self.unseen @ gradient <= SHARE * variance)


def identifiability(fit: CalibrationSolution) -> Identifiability:
    """What the readings of a fit can tell."""
    p = fit.problem.unknowns.parameters
    prior = fit.problem.unknowns.sigma**-2.0
    seen_of_all = _information(fit, np.arange(p))
    values, vectors = np.linalg.eigh(seen_of_all)
    dark = values < UNSEEN**-2.0
    hidden = vectors[:, dark]
    unseen = hidden / (prior[:1] + np.maximum(values[dark], 0.0)) @ hidden.T
    separable = np.diag(unseen) <= SHARE * np.diag(fit.covariance)[:p]
    group = np.flatnonzero(~separable)
    return Identifiability(
        _directions(fit, seen_of_all, np.arange(p)),
        separable,
        _directions(fit, _information(fit, group), group),
        unseen,
    )


def _information(fit: CalibrationSolution, which: np.ndarray) -> Array:
    """The readings' information on some unknowns ``(k, k)``, all others being free within their priors."""
    A = fit.normal
    rest = np.setdiff1d(np.arange(len(A)), which)
    kept = fit.information[np.ix_(which, which)]
    if not len(rest):
        return kept
    cross = A[np.ix_(which, rest)]
    result: Array = kept - cross @ np.linalg.solve(A[np.ix_(rest, rest)], cross.T)
    return 0.5 * (result + result.T)


def _directions(fit: CalibrationSolution, information: Array, which: np.ndarray) -> list[CombinationRow]:
    """Eigenvectors of an information on some parameters."""
    names = [unknown.name for unknown in fit.problem.unknowns.sought]
    p = len(names)
    values, vectors = np.linalg.eigh(information)
    rows = []
    for k in np.argsort(values)[::-1]:
        coefficients = np.zeros(p)
        coefficients[which] = vectors[:, k]
        coefficients /= coefficients[np.argmax(np.abs(coefficients))]
        value = float(coefficients @ fit.z[:p])
        variance = float(coefficients @ fit.covariance[:p, :p] @ coefficients)
        size = float(np.sqrt(max(values[k], 0.0)))
        std, seen = float(np.sqrt(variance)), size > 1.0 / UNSEEN
        half = NORMAL_95 * std
        rows.append(
            CombinationRow(
                name=in_words(coefficients, names),
                coefficients={n: float(c) for n, c in zip(names, coefficients, strict=True) if c},
                seen=seen,
                singular_value=size,
                value=value if seen else None,
                std=std if seen else None,
                interval95=[value - half, value + half] if seen else None,
            )
        )
    return rows


def in_words(coefficients: Array, names: list[str]) -> str:
    """Which parameters, by coefficients ``(p,)`` of their z."""
    text = ""
    # a combination of one parameter is none: its largest partner is named then, however small its part
    least = min(NEGLIGIBLE, max(float(np.sort(np.abs(coefficients))[-2:][0]), TINY))
    for name, value in zip(names, coefficients, strict=True):
        if abs(value) < least:
            continue
        sign = "- " if value < 0.0 else "+ " if text else ""
        size = "" if abs(abs(value) - 1.0) < 5e-3 else f"{abs(value):.2g} "
        text += f"{' ' if text else ''}{sign}{size}{name}"
    return text
