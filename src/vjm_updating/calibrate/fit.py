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
from vjm_updating.observation.noise import Memory

STAGES: tuple[tuple[Loss, int, float], ...] = ((SQUARES, 12, 0.3), (HUBER, 6, 0.1), (BIWEIGHT, 20, 1e-3))
"""Losses, the most steps of each, and the step in standard deviations that is small enough to end it."""
FROZEN = 0.3
"""Step in standard deviations up to which the slopes of where it began still serve; the last ones are fresh."""
LONGEST_STEP = 0.7
"""In the z of a parameter: a factor of two."""
OUTLYING = 0.2
"""Weight below which a reading counts as an outlier: 4.5 standard deviations."""
MOST_OUTLYING = 0.15
"""Share of outliers above which it is the model that is wrong."""
MISFIT = 3.0
"""Standard errors by which the residuals' variance must exceed the sheet's to be another one."""


@dataclass(frozen=True)
class Fit:
    """What was found.

    Attributes:
        problem: that was solved.
        at: the readings against the model there.
        loss: with which.
        factors: inverse Cholesky factors ``(n, 6, 6)`` of the readings' covariances.
        memory: of the noise.
        spread: standard deviation ``(6,)`` of each channel's whitened residuals; 1 where it is what the sheet says.
        residual: whitened ``(n, 6)``, over the spread.
        weight: of each reading ``(n, 6)``, 1 for a good one.
        jacobian: whitened ``(n, 6, n_z)``, over the spread, zero for outliers.
        covariance: of the unknowns' z ``(n_z, n_z)``, priors included.
        steps: that it took.
        step: last one, in standard deviations.
    """

    problem: Problem
    at: Trial
    loss: Loss
    factors: Array
    memory: Memory
    spread: Array
    residual: Array
    weight: Array
    jacobian: Array
    covariance: Array
    steps: int
    step: float

    @property
    def z(self) -> Array:
        """The unknowns ``(n_z,)``."""
        return self.at.z

    @property
    def information(self) -> Array:
        """What the data say of the unknowns ``(n_z, n_z)``, without the priors."""
        J = self.jacobian.reshape(-1, len(self.z))
        result: Array = self.loss.efficiency * (J.T @ J)
        return result

    @property
    def outliers(self) -> np.ndarray:
        """Readings ``(n,)`` with a channel that was hardly believed."""
        return np.asarray((self.problem.observed.present & (self.weight < OUTLYING)).any(axis=1))

    def objective(self, at: Trial) -> float:
        """Twice the negative logarithm of the posterior, covariances as they are at the solution."""
        r = self.memory.remove(np.einsum("kij,kj->ki", self.factors, at.residual)) / self.spread
        prior = np.sum((at.z / self.problem.unknowns.sigma) ** 2)
        return float(2.0 * np.sum(self.loss.rho(r)[self.problem.observed.present]) + prior)


def fit(problem: Problem) -> Fit:
    """Solve a calibration.

    Raises:
        NoConvergenceError: the nominal model does not reach the readings, or no step makes the fit better.
    """
    branches = Branches()
    at = problem.evaluate(problem.unknowns.start, branches)
    memory, spread, steps, step = problem.observed.memory, np.ones(6), 0, np.inf
    for loss, most, enough in STAGES:
        damping = 1e-6 if loss is SQUARES else 0.0
        for _ in range(most):
            state = _state(problem, at, loss, memory, spread)
            at, damping, step = _step(problem, state, damping)
            steps += 1
            if step < enough:
                break
        if loss is not BIWEIGHT:  # by then the side is known
            at = _best_branches(problem, at)
        # a first look at the noise only when the model is near
        if loss is not SQUARES:
            memory, spread = _noise(problem, at, memory)
            state = _state(problem, at, loss, memory, spread)
    for _ in range(3):
        before = memory.rho
        state = _state(problem, at, BIWEIGHT, memory, spread)
        at, damping, step = _step(problem, state, 0.0)
        memory, spread = _noise(problem, at, memory)
        steps += 1
        if step < STAGES[-1][2] and np.max(np.abs(memory.rho - before)) < 0.01:
            break
    loss = BIWEIGHT
    at = problem.evaluate(at.z, at.branches)
    final = _state(problem, at, loss, memory, spread)
    if (problem.observed.present & (final.weight < OUTLYING)).any(axis=1).mean() > MOST_OUTLYING:
        # so many are no outliers: they are what the model lacks
        loss = HUBER
        for _ in range(6):
            at, damping, step = _step(problem, _state(problem, at, loss, memory, spread), 0.0)
            steps += 1
            if step < 1e-2:
                break
        memory, spread = _noise(problem, at, memory)
        at = problem.evaluate(at.z, at.branches)
        final = _state(problem, at, loss, memory, spread)
    return Fit(problem, at, loss, final.factors, memory, spread, final.residual, final.weight, final.jacobian,
               final.covariance, steps, step)  # fmt: skip


@dataclass(frozen=True)
class _State:
    """A linearised fit at one evaluation."""

    at: Trial
    loss: Loss
    memory: Memory
    spread: Array
    factors: Array
    residual: Array
    weight: Array
    jacobian: Array
    covariance: Array
    normal: Array
    gradient: Array

    def cost(self, problem: Problem, at: Trial) -> float:
        """Weighted squares and priors of another evaluation, all else as here."""
        r = self.memory.remove(np.einsum("kij,kj->ki", self.factors, at.residual)) / self.spread
        prior = np.sum((at.z / problem.unknowns.sigma) ** 2)
        return float(2.0 * np.sum(self.loss.rho(r)[problem.observed.present]) + prior)


def _state(problem: Problem, at: Trial, loss: Loss, memory: Memory, spread: Array) -> _State:
    factors = problem.whitening(at)
    assert at.jacobian is not None
    r = memory.remove(np.einsum("kij,kj->ki", factors, at.residual)) / spread
    J = memory.remove(np.einsum("kij,kjm->kim", factors, at.jacobian)) / spread[:, None]
    weight = np.where(problem.observed.present, loss.weight(r), 0.0)
    believed = np.where(problem.observed.present & (weight >= OUTLYING * loss.factor), 1.0, 0.0)
    if loss is SQUARES:
        believed = problem.observed.present.astype(float)
    flat = J.reshape(-1, J.shape[2])
    prior = np.diag(problem.unknowns.sigma**-2.0)
    normal = flat.T @ (weight.reshape(-1, 1) * flat) + prior
    gradient = flat.T @ (weight * r).reshape(-1) + at.z * problem.unknowns.sigma**-2.0
    good = J * believed[:, :, None]
    data = good.reshape(-1, J.shape[2])
    covariance = np.asarray(np.linalg.inv(loss.efficiency * (data.T @ data) + prior), dtype=float)
    shares = weight / loss.factor
    return _State(at, loss, memory, spread, factors, r, shares, good, covariance, normal, gradient)


def _step(problem: Problem, state: _State, damping: float) -> tuple[Trial, float, float]:
    """One step downhill: where it leads, the damping that it took, and its size in standard deviations."""
    unknowns, here = problem.unknowns, state.cost(problem, state.at)
    deviation = np.sqrt(np.diag(state.covariance))
    parameters = np.arange(len(unknowns)) < unknowns.parameters
    for _ in range(12):
        A = state.normal + damping * np.diag(np.diag(state.normal))
        change = -np.linalg.solve(A, state.gradient)
        change *= min(1.0, LONGEST_STEP / max(float(np.abs(change[parameters]).max(initial=0.0)), 1e-300))
        z = np.maximum(state.at.z + change, unknowns.lowest)
        size = float(np.max(np.abs(z - state.at.z) / deviation))
        try:
            there = problem.evaluate(z, state.at.branches, derivatives=size > FROZEN)
        except (NoConvergenceError, np.linalg.LinAlgError, ValueError):
            damping = max(10.0 * damping, 1e-2)
            continue
        cost = state.cost(problem, there)
        # what rounding and interpolated slopes leave is no reason to go on looking
        if cost <= here * (1.0 + 1e-9) + 1e-6 or size < 1e-2:
            if there.jacobian is None:
                there = replace(there, jacobian=state.at.jacobian)
            return there, 0.1 * damping, size
        damping = max(10.0 * damping, 1e-3)
    return state.at, damping, 0.0


def _noise(problem: Problem, at: Trial, memory: Memory) -> tuple[Memory, Array]:
    """Autocorrelation and spread of the residuals."""
    whitened = np.einsum("kij,kj->ki", problem.whitening(at), at.residual)
    memory = memory.estimated(whitened, problem.observed.present)
    r, spread = memory.remove(whitened), np.ones(6)
    used = problem.unknowns.parameters / max(int(problem.observed.present.sum()), 1)
    for c in np.flatnonzero(problem.observed.present.any(axis=0)):
        size = np.abs(r[problem.observed.present[:, c], c])
        # of a Gaussian's middle: outliers do not count
        kept = size[size < 4.0 * max(1.4826 * float(np.median(size)), 1.0)]
        freedom = max(len(kept) * (1.0 - used), 1.0)
        variance = float(np.sum(kept**2)) / freedom
        if variance > 1.0 + MISFIT * np.sqrt(2.0 / freedom):
            spread[c] = np.sqrt(variance)
    return memory, spread


def _best_branches(problem: Problem, at: Trial) -> Trial:
    """Each half-ray on the one of its mirrored branches that is nearer to its readings."""
    branches, factors = at.branches, problem.whitening(at)
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
            costs = [
                float(np.sum(HUBER.rho(np.einsum("kij,kj->ki", factors[on], e.residual[on])))) for e in (at, there)
            ]
            branches = branches.turned(number, sign) if costs[1] < costs[0] else branches
    return at if branches == at.branches else problem.evaluate(at.z, branches)
