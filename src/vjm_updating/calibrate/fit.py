"""The most probable unknowns, their covariance, and what the residuals say of the noise.

Gauss-Newton with Levenberg's damping on the posterior: generalised least squares of the readings with the sheet's
Gaussian priors. Covariances of readings and weights of outliers are renewed at every step. It begins with squares,
goes on with Huber's loss, whose minimum is unique, and ends with Tukey's biweight, which outliers do not move.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.calibrate.prediction import Branches
from vjm_updating.calibrate.problem import Problem, Trial
from vjm_updating.calibrate.robust import BIWEIGHT, HUBER, SQUARES, Loss
from vjm_updating.observation.autocorrelation import memory_of_residuals
from vjm_updating.observation.significance import too_many
from vjm_updating.observation.whitening import Whitening, weighed, whitening_of

STAGES: tuple[tuple[Loss, int, float], ...] = ((SQUARES, 12, 0.3), (HUBER, 6, 0.1), (BIWEIGHT, 20, 1e-3))
"""Losses, the most steps of each, and the step in standard deviations that is small enough to end it."""
FROZEN = 0.3
"""Step in standard deviations up to which the slopes of where it began still serve; the last ones are fresh."""
LONGEST_STEP = 0.7
"""In the z of a parameter: a factor of two."""
OUTLYING = 0.2
"""Weight below which a reading counts as an outlier: 4.5 standard deviations."""
MISFIT = 3.0
"""Standard errors by which the residuals' variance must exceed the sheet's to be another one."""


@dataclass(frozen=True)
class Linearised:
    """The posterior about one set of unknowns.

    Attributes:
        problem: that is solved.
        at: the readings against the model there.
        loss: with which.
        whitening: of the residuals.
        residual: whitened ``(n, 6)``.
        weight: of each reading ``(n, 6)``, 1 for a good one.
        jacobian: whitened ``(n, 6, n_z)``, zero for outliers.
        covariance: of the unknowns' z ``(n_z, n_z)``, priors included.
        normal: matrix of a step ``(n_z, n_z)``.
        gradient: half of the objective's ``(n_z,)``.
    """

    problem: Problem
    at: Trial
    loss: Loss
    whitening: Whitening
    residual: Array
    weight: Array
    jacobian: Array
    covariance: Array
    normal: Array
    gradient: Array

    @property
    def z(self) -> Array:
        """The unknowns ``(n_z,)``."""
        return self.at.z

    @property
    def outliers(self) -> np.ndarray:
        """Readings ``(n,)`` with a channel that was hardly believed."""
        return np.asarray((self.whitening.present & (self.weight < OUTLYING)).any(axis=1))

    def objective(self, at: Trial) -> float:
        """Twice the negative logarithm of the posterior of other unknowns, covariances as they are here."""
        r = self.whitening.independent(at.residual)
        prior = np.sum((at.z / self.problem.unknowns.sigma) ** 2)
        return float(2.0 * np.sum(self.loss.rho(r)[self.whitening.present]) + prior)


@dataclass(frozen=True)
class Fit(Linearised):
    """What was found.

    Attributes:
        steps: that it took.
        step: last one, in standard deviations.
    """

    steps: int
    step: float

    @property
    def information(self) -> Array:
        """What the data say of the unknowns ``(n_z, n_z)``, without the priors."""
        J = self.jacobian.reshape(-1, len(self.z))
        result: Array = self.loss.efficiency * (J.T @ J)
        return result


def fit(problem: Problem) -> Fit:
    """Solve a calibration.

    Raises:
        NoConvergenceError: the nominal model does not reach the readings, or no step makes the fit better.
    """
    at = problem.evaluate(problem.unknowns.start, Branches())
    whitening, steps, step = whitening_of(problem.observed, at), 0, np.inf
    for loss, most, enough in STAGES:
        damping = 1e-6 if loss is SQUARES else 0.0
        for _ in range(most):
            at, damping, step = _step(_linearised(problem, at, loss, whitening), damping)
            steps += 1
            if step < enough:
                break
        if loss is not BIWEIGHT:  # by then the side is known
            at = _best_branches(problem, at)
        # a first look at the noise only when the model is near
        if loss is not SQUARES:
            whitening = _with_noise_of(problem, at, whitening)
    for _ in range(3):
        before = whitening.memory.rho
        at, damping, step = _step(_linearised(problem, at, BIWEIGHT, whitening), 0.0)
        whitening = _with_noise_of(problem, at, whitening)
        steps += 1
        if step < STAGES[-1][2] and np.max(np.abs(whitening.memory.rho - before)) < 0.01:
            break
    final = _linearised(problem, problem.evaluate(at.z, at.branches), BIWEIGHT, whitening)
    if too_many(int(final.outliers.sum()), len(final.outliers)):
        # so many are no outliers: they are what the model lacks
        at = final.at
        for _ in range(6):
            at, damping, step = _step(_linearised(problem, at, HUBER, whitening), 0.0)
            steps += 1
            if step < 1e-2:
                break
        whitening = _with_noise_of(problem, at, whitening)
        final = _linearised(problem, problem.evaluate(at.z, at.branches), HUBER, whitening)
    return Fit(**vars(final), steps=steps, step=step)


def _linearised(problem: Problem, at: Trial, loss: Loss, whitening: Whitening) -> Linearised:
    """By the noise of a whitening, with the covariances that the model's own stiffness makes."""
    assert at.jacobian is not None
    whitening = weighed(whitening, problem.observed, at)
    present, sigma = whitening.present, problem.unknowns.sigma
    r, J = whitening.independent(at.residual), whitening.independent(at.jacobian)
    weight = np.where(present, loss.weight(r), 0.0)
    believed = np.where(present & (weight >= OUTLYING * loss.factor), 1.0, 0.0)
    if loss is SQUARES:
        believed = present.astype(float)
    flat = J.reshape(-1, J.shape[2])
    prior = np.diag(sigma**-2.0)
    normal = flat.T @ (weight.reshape(-1, 1) * flat) + prior
    gradient = flat.T @ (weight * r).reshape(-1) + at.z * sigma**-2.0
    good = J * believed[:, :, None]
    data = good.reshape(-1, J.shape[2])
    covariance = np.asarray(np.linalg.inv(loss.efficiency * (data.T @ data) + prior), dtype=float)
    return Linearised(problem, at, loss, whitening, r, weight / loss.factor, good, covariance, normal, gradient)


def _step(state: Linearised, damping: float) -> tuple[Trial, float, float]:
    """One step downhill: where it leads, the damping that it took, and its size in standard deviations."""
    unknowns, here = state.problem.unknowns, state.objective(state.at)
    deviation = np.sqrt(np.diag(state.covariance))
    parameters = np.arange(len(unknowns)) < unknowns.parameters
    for _ in range(12):
        A = state.normal + damping * np.diag(np.diag(state.normal))
        change = -np.linalg.solve(A, state.gradient)
        change *= min(1.0, LONGEST_STEP / max(float(np.abs(change[parameters]).max(initial=0.0)), 1e-300))
        z = np.maximum(state.at.z + change, unknowns.lowest)
        size = float(np.max(np.abs(z - state.at.z) / deviation))
        try:
            there = state.problem.evaluate(z, state.at.branches, derivatives=size > FROZEN)
        except (NoConvergenceError, np.linalg.LinAlgError, ValueError):
            damping = max(10.0 * damping, 1e-2)
            continue
        cost = state.objective(there)
        # what rounding and interpolated slopes leave is no reason to go on looking
        if cost <= here * (1.0 + 1e-9) + 1e-6 or size < 1e-2:
            if there.jacobian is None:
                there = replace(there, jacobian=state.at.jacobian)
            return there, 0.1 * damping, size
        damping = max(10.0 * damping, 1e-3)
    return state.at, damping, 0.0


def _with_noise_of(problem: Problem, at: Trial, whitening: Whitening) -> Whitening:
    """With the autocorrelation and the spread of an evaluation's residuals."""
    whitening = weighed(whitening, problem.observed, at)
    instant, present = whitening.instant(at.residual), whitening.present
    memory = memory_of_residuals(whitening.memory, instant, present)
    r, spread = memory.remove(instant), np.ones(6)
    used = problem.unknowns.parameters / max(int(present.sum()), 1)
    for c in np.flatnonzero(present.any(axis=0)):
        size = np.abs(r[present[:, c], c])
        # of a Gaussian's middle: outliers do not count
        kept = size[size < 4.0 * max(1.4826 * float(np.median(size)), 1.0)]
        freedom = max(len(kept) * (1.0 - used), 1.0)
        variance = float(np.sum(kept**2)) / freedom
        if variance > 1.0 + MISFIT * np.sqrt(2.0 / freedom):
            spread[c] = np.sqrt(variance)
    return replace(whitening, memory=memory, spread=spread)


def _best_branches(problem: Problem, at: Trial) -> Trial:
    """Each half-ray on the one of its mirrored branches that is nearer to its readings."""
    branches, whitening = at.branches, whitening_of(problem.observed, at)
    for number, ray in enumerate(problem.observed.rays):
        place = at.place[ray.index] @ ray.measure
        alone = replace(problem, observed=replace(problem.observed, rays=(ray,)))
        for sign in (1, -1):
            on = ray.index[(place * sign > 0.0) & at.branched[ray.index]]
            if not len(on):
                continue
            other = -branches.of(number, sign)
            try:
                there = alone.evaluate(at.z, Branches(((0, sign, other),)), derivatives=False)
            except NoConvergenceError:
                continue
            costs = [float(np.sum(HUBER.rho(whitening.instant(e.residual)[on]))) for e in (at, there)]
            branches = branches.turned(number, sign) if costs[1] < costs[0] else branches
    return at if branches == at.branches else problem.evaluate(at.z, branches)
