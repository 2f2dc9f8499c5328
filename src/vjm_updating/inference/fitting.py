"""Hypotheses and readings: what a hypothesis predicts, how well it fits, and its best coordinates.

Residuals are made independent ones of unit variance; the best coordinates are found by Gauss-Newton within a
trust region.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.inference.bounded_normal import bounded_step, inverse
from vjm_updating.inference.forward import Predictor, values_of
from vjm_updating.inference.noise import AutoregressiveNoise, whiten
from vjm_updating.inference.observed import Observed, RampRegression
from vjm_updating.inference.parameters import (
    Evaluation,
    FitParameter,
    Hypothesis,
    coordinates,
    of_effect,
    remakes,
    start,
    uncertain,
)
from vjm_updating.inference.significance import CUT, IMPROBABLE

SWEEPS, NEGLIGIBLE = numerical(100), numerical(1e-2)
"""By which errors of lines are found at most, and the change in a reading's standard deviations that ends them."""


@dataclass(frozen=True)
class Whitening:
    """How residuals become independent and of unit variance.

    Attributes:
        factors: inverse Cholesky factors ``(n, 6, 6)``.
        autoregression: autocorrelation of the whitened channels.
        present: ``(n, 6)`` which samples count.
        steady: how displacements were driven, by their index, where that is known.
        gauge_sensitivity: ``(n, 6, 6)`` what one sigma of each displacement's gauge makes of readings, raw.
        spread: standard deviation ``(6,)`` of each channel over what the sheet says, or ``(1,)`` of all.
    """

    factors: Array
    autoregression: AutoregressiveNoise
    present: np.ndarray
    steady: Mapping[int, RampRegression] = field(default_factory=dict)
    gauge_sensitivity: Array | None = None
    spread: Array = field(default_factory=lambda: np.ones(1))

    def reading(self, observed: Observed) -> Whitening:
        """The same noise of other readings; their covariances are still to be `weighed`."""
        autoregression = replace(
            observed.autoregression, rho=self.autoregression.rho, white=self.autoregression.white
        )
        return replace(self, autoregression=autoregression, present=observed.present)

    def instant(self, raw: Array) -> Array:
        """``(n, 6, …)`` of unit variance, still autocorrelated."""
        return np.einsum("nij,nj...->ni...", self.factors, raw)

    def independent(self, raw: Array) -> Array:
        """``(n, 6, …)`` of unit variance and white; errors of the straight lines are still shared."""
        return self.autoregression.remove(self.instant(raw)) / self.spread.reshape(-1, *[1] * (raw.ndim - 2))

    def flat(self, raw: Array) -> Array:
        """Raw residuals ``(n, 6, …)`` as independent ones ``(N, …)``."""
        return self.apart(self._each(raw))

    def apart(self, free: Array) -> Array:
        """Residuals ``(N, …)`` without autocorrelation and without what errors of the straight lines do to them."""
        U, sizes, _ = self._together
        share = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)
        return free - U @ (share.reshape(-1, *[1] * (free.ndim - 1)) * (U.T @ free))

    @property
    def determinant(self) -> float:
        """Logarithm of the determinant of the readings' covariance, but for their autocorrelation's."""
        diagonal = np.einsum("nii->ni", self.factors)
        own = np.where(self.present, diagonal / self.spread, 1.0)
        return float(np.log1p(self._together[1] ** 2).sum() - 2.0 * np.log(own).sum())

    @cached_property
    def slow(self) -> Array:
        """What the errors of the straight lines, of unit size each, make of the readings ``(n, 6, s)``, raw."""
        parts = [np.zeros((*self.present.shape, 0))]
        if self.gauge_sensitivity is not None:
            read = self.present.any(axis=0)
            rho = float(self.autoregression.neighbours[read].mean()) if read.any() else 0.0
            parts += [
                self.gauge_sensitivity[:, :, k, None] * own.errors(rho)[:, None, :]
                for k, own in self.steady.items()
            ]
        return np.concatenate(parts, axis=2)

    def without_slow(self, raw: Array) -> Array:
        """Raw residuals ``(n, 6)`` less the likeliest errors of the lines, by Huber's loss: no outlier says much.

        Each step is that of the quadratic loss, whose curvature is the larger one, so that none goes too far.
        """
        U, sizes, Vt = self._together
        free, likely = self._each(raw), np.zeros(len(sizes))
        for _ in range(SWEEPS):
            step = (sizes * (U.T @ np.clip(free - U @ (sizes * likely), -CUT, CUT)) - likely) / (1.0 + sizes**2)
            likely = likely + step
            # in standard deviations of a reading
            if np.abs(sizes * step).max(initial=0.0) < NEGLIGIBLE:
                break
        return raw - self.slow @ (Vt.T @ likely)

    @cached_property
    def _together(self) -> tuple[Array, Array, Array]:
        V = self._each(self.slow)
        if not V.shape[1]:
            return V, np.zeros(0), np.zeros((0, 0))
        U, sizes, Vt = np.linalg.svd(V, full_matrices=False)
        return U, sizes, Vt

    def _each(self, raw: Array) -> Array:
        """Raw residuals ``(n, 6, …)`` as white ones ``(N, …)``."""
        on, own = self._read
        return own.independent(raw[:, on])[own.present]

    @cached_property
    def _read(self) -> tuple[slice | np.ndarray, Whitening]:
        """Which channels were read at all, and the same noise of these alone: most tests read one of six."""
        on = np.flatnonzero(self.present.any(axis=0))
        if len(on) == self.present.shape[1]:
            return slice(None), self
        spread = self.spread[on] if len(self.spread) > 1 else self.spread
        alone = Whitening(
            self.factors[:, on][:, :, on], self.autoregression.of(on), self.present[:, on], spread=spread
        )
        return on, alone


def whitening_of(observed: Observed, evaluation: Evaluation) -> Whitening:
    """By the sheet's noise and a model's stiffness; no autocorrelation yet."""
    return weighed(Whitening(np.zeros(0), observed.autoregression, observed.present), observed, evaluation)


def weighed(whitening: Whitening, observed: Observed, evaluation: Evaluation) -> Whitening:
    """The same with the readings' covariances as a hypothesis' own stiffness makes them."""
    return replace(
        whitening,
        factors=whiten(observed.pose_noise, observed.noise.wrench, evaluation.sensitivity, observed.present),
        present=observed.present,
        steady=observed.steady,
        gauge_sensitivity=np.nan_to_num(evaluation.sensitivity * observed.noise.pose),
    )


def displaced(observed: Observed, evaluation: Evaluation) -> float:
    """What turns the forces' likelihood into that of displacements which they cause: twice its logarithm.

    Under force control displacements are what was read. The residuals are forces at these, so that their density is
    to be multiplied by the determinant of the stiffness that was gone along. Else a soft machine would gain by what
    little a gauge's noise makes of forces. It is 0 where displacements were imposed.
    """
    if observed.columns != WRENCH or not observed.measurement.sheet.test.by_force:
        return 0.0
    own = [k for k in observed.slots.values() if WRENCH[k] in observed.wrench_channels]
    on = observed.present[:, own]
    stiffness = evaluation.sensitivity[:, own][:, :, own]
    gone = np.where(on[:, :, None] & on[:, None, :], stiffness, np.eye(len(own)))
    return 2.0 * float(np.linalg.slogdet(gone)[1].sum())


FARTHER = numerical(3.0)
"""Sigmas of a machine's nuisance that change much of what others do."""
ROUNDING = numerical(0.3)
"""Squares by which the tables of two machines differ where they should not: they are interpolated."""
STEPS = numerical((1.0, 0.1, 0.01))
"""Shares of a coordinate's step by which readings are differentiated, the next where they have no value."""


@dataclass(frozen=True)
class Fit:
    """A hypothesis at its best.

    Attributes:
        jacobian: of the raw residuals ``(n, 6, n_z)``.
        objective: twice the negative logarithm of likelihood and prior, see `LeastSquaresProblem.objective`.
        converged: whether it ended by itself.
    """

    hypothesis: Hypothesis
    parameters: tuple[FitParameter, ...]
    evaluation: Evaluation
    jacobian: Array
    objective: float
    converged: bool

    @property
    def values(self) -> list[list[float]]:
        """Each effect's values."""
        return values_of(self.parameters, self.evaluation.z, self.hypothesis)

    @property
    def free(self) -> int:
        """Parameters that no prior of the sheet restrains."""
        return sum(c.kind == "effect" for c in self.parameters) + sum(
            c.kind != "effect" and not np.isfinite(c.sigma) for c in self.parameters
        )


@dataclass(frozen=True)
class HeldTables:
    """A machine whose tables serve for others near by.

    Attributes:
        own: indices of the coordinates that make it another one.
        values: their values ``(m,)``.
        slopes: derivatives ``(n, 6, m)`` of the raw residuals by them, which lead on to the others.
    """

    own: Sequence[int]
    values: Array
    slopes: Array


@dataclass
class LeastSquaresProblem:
    """Fits hypotheses to one test.

    Attributes:
        nuisances: coordinates of every hypothesis: the nuisances, and what a calibration looks for.
        rounding: squares by which predictions of two machines differ where they should not.
    """

    forward: Predictor
    nuisances: tuple[FitParameter, ...]
    whitening: Whitening
    rounding: float = ROUNDING

    @property
    def of_machine(self) -> list[int]:
        """Indices of the machine's nuisances, the same in every hypothesis."""
        return [i for i, c in enumerate(self.nuisances) if not c.of_instrument]

    def machine_slopes(self, fit: Fit) -> Array:
        """A fit's derivatives ``(n, 6, m)`` by the machine's nuisances."""
        return fit.jacobian[:, :, self.of_machine]

    def reading(self, observed: Observed) -> LeastSquaresProblem:
        """The same for other readings of the same test; their covariances are still to be `weighed`."""
        return replace(self, forward=self.forward.reading(observed), whitening=self.whitening.reading(observed))

    def weigh(self, evaluation: Evaluation) -> None:
        """Renew the covariances of the readings."""
        observed = self.forward.observed
        self.whitening = weighed(self.whitening, observed, evaluation)

    def evaluate(
        self,
        unknowns: Sequence[FitParameter],
        z: Array,
        hypothesis: Hypothesis,
        *,
        beside: Array | None = None,
        held: HeldTables | None = None,
    ) -> Evaluation | None:
        """The readings, or None where the machine does not stand.

        The tables of a machine near by that is ``held`` serve; without it is exact. For ``beside`` see
        `vjm_updating.inference.forward.Forward.evaluate`.
        """
        near = None if beside is None else _made(beside, held)
        try:
            evaluation = self.forward.evaluate(unknowns, _made(z, held), hypothesis, near)
        except (NoConvergenceError, ValueError, np.linalg.LinAlgError):
            return None
        if held is not None:
            change = np.nan_to_num(held.slopes) @ (z[held.own] - held.values)
            evaluation = replace(
                evaluation, z=z, residual=evaluation.residual + np.where(self.whitening.present, change, 0.0)
            )
        return evaluation if np.isfinite(evaluation.residual).all() else None

    def resolution(self, squares: float) -> float:
        """Squares by which two fits near ones of so many must differ to be more than alike.

        These are the predictions' rounding. Where a fit leaves more than the noise, what it leaves is the scatter
        (Birge 1932): its squares count in units of their mean.
        """
        return self.rounding * max(1.0, squares / max(int(self.whitening.present.sum()), 1))

    def squares(self, unknowns: Sequence[FitParameter], evaluation: Evaluation) -> float:
        """Squares of whitened residuals and of what lies off the priors."""
        r = self.whitening.flat(evaluation.residual)
        p, _ = prior(unknowns, evaluation.z)
        return float(r @ r + p @ p)

    def slopes(
        self,
        unknowns: Sequence[FitParameter],
        evaluation: Evaluation,
        hypothesis: Hypothesis,
        borrowed: Array | None = None,
    ) -> Array:
        """Derivatives ``(n, 6, n_z)`` of the raw residuals.

        Those by the machine's nuisances, but where the hypothesis frees them, are ``borrowed`` (n, 6, m) of a fit
        near by, where they are given.
        """
        J = np.zeros((*evaluation.residual.shape, len(unknowns)))
        machine = self.of_machine
        if borrowed is not None:
            J[:, :, machine] = borrowed
            machine = [i for i in machine if not np.isfinite(unknowns[i].sigma)]
        self.renew(J, unknowns, evaluation, hypothesis, machine)
        return J

    def renew(
        self,
        J: Array,
        unknowns: Sequence[FitParameter],
        evaluation: Evaluation,
        hypothesis: Hypothesis,
        machine: Sequence[int],
        held: HeldTables | None = None,
    ) -> None:
        """Make derivatives ``J`` (n, 6, n_z) anew: by instruments, effects, and those of the ``machine`` named.

        Those by what a machine ``held`` is made of stay.
        """
        for i, c in enumerate(unknowns):
            if c.kind in ("zero", "scale"):
                J[:, :, i] = c.scale * evaluation.slope(c.kind, c.subject, self.forward.observed.slots)
            elif i in machine or (c.kind == "effect" and (held is None or i not in held.own)):
                J[:, :, i] = self._difference(unknowns, evaluation, hypothesis, i, held)
        present = self.forward.observed.present
        J[...] = np.where(present[:, :, None], np.nan_to_num(J), 0.0)

    def beyond_tolerance(self, null: Fit) -> bool:
        """Whether a null needs nuisances of the machine far off the sheet's."""
        return float(np.abs(null.evaluation.z[self.of_machine]).max(initial=0.0)) > FARTHER

    def near(self, null: Fit, most: float) -> Fit:
        """The same, or where it lacks a cause that drags nuisances along, one no further than ``most`` sigmas off.

        There hypotheses begin, by its slopes: those found far off lead astray.
        """
        if not self.beyond_tolerance(null):
            return null
        evaluation = self.evaluate(null.parameters, np.clip(null.evaluation.z, -most, most), null.hypothesis)
        if evaluation is None:
            return null
        return replace(
            null, evaluation=evaluation, jacobian=self.slopes(null.parameters, evaluation, null.hypothesis)
        )

    def _difference(
        self,
        unknowns: Sequence[FitParameter],
        evaluation: Evaluation,
        hypothesis: Hypothesis,
        i: int,
        held: HeldTables | None,
    ) -> Array:
        exact = None if evaluation.exact is None else evaluation.exact(i)
        if exact is not None:
            return exact
        # where the machine stands at neither end of a step, a shorter one tells the slope
        for h in (sign * unknowns[i].difference * share for share in STEPS for sign in (1.0, -1.0)):
            z = evaluation.z.copy()
            step = h * max(1.0, abs(z[i]))
            z[i] += step
            if not unknowns[i].low <= z[i] <= unknowns[i].high:
                continue
            shifted = self.evaluate(unknowns, z, hypothesis, beside=evaluation.z, held=held)
            if shifted is not None:
                return (shifted.residual - evaluation.residual) / step
        return np.zeros_like(evaluation.residual)

    def objective(self, unknowns: Sequence[FitParameter], evaluation: Evaluation) -> float:
        """Twice the negative logarithm of the likelihood and prior, but for a constant.

        The readings' covariances are as the hypothesis' own stiffness makes them. With another's, one that needs
        little of the displacement (a steady ramp, and a drift with the clock) would gain by the gauge's noise that
        it leaves out. Without their determinants, one near a critical point would gain by the noise it has there.
        Where forces were imposed it is the likelihood of the displacements, see `displaced`.
        """
        observed = self.forward.observed
        own = weighed(self.whitening, observed, evaluation)
        r = own.flat(evaluation.residual)
        p, _ = prior(unknowns, evaluation.z)
        return float(r @ r + p @ p + own.determinant) - displaced(observed, evaluation)

    def system(self, unknowns: Sequence[FitParameter], evaluation: Evaluation, J: Array) -> tuple[Array, Array]:
        """Normal matrix ``(n_z, n_z)`` and right side ``(n_z,)`` of a step."""
        W, r = self.whitening.flat(J), self.whitening.flat(evaluation.residual)
        p, weight = prior(unknowns, evaluation.z)
        A = W.T @ W + np.diag(weight**2)
        b = -(W.T @ r + weight * p)
        return A, b

    def normal(self, fit: Fit) -> Array:
        """Inverse covariance ``(n_z, n_z)`` of a fit's coordinates, priors included."""
        return self.system(fit.parameters, fit.evaluation, fit.jacobian)[0]

    def pressure(self, fit: Fit) -> Array:
        """How strongly ``(n_z,)`` a fit's coordinates press against bounds that they lie at, else zero."""
        low, high = (np.array([getattr(c, end) for c in fit.parameters]) for end in ("low", "high"))
        b, z = self.system(fit.parameters, fit.evaluation, fit.jacobian)[1], fit.evaluation.z
        return np.where(z <= low, np.maximum(-b, 0.0), np.where(z >= high, np.maximum(b, 0.0), 0.0))


def _made(z: Array, held: HeldTables | None) -> Array:
    """The coordinates ``(n_z,)`` whose tables serve: those of the machine held, where one is."""
    if held is None:
        return z
    made = z.copy()
    made[held.own] = held.values
    return made


def shapes_cost(unknowns: Sequence[FitParameter], z: Array) -> float:
    """What it costs in the objective that shapes of laws are not the usual ones: all that these could save."""
    off, _ = prior(unknowns, z)
    own = [i for i, c in enumerate(unknowns) if c.kind == "effect" and np.isfinite(c.sigma)]
    return float(off[own] @ off[own])


def prior(unknowns: Sequence[FitParameter], z: Array) -> tuple[Array, Array]:
    """Root ``(n_z,)`` of what each coordinate costs in the objective, and its derivative.

    A sheet's tolerance is Gaussian. The shape of a law has an order of magnitude: its prior is Cauchy's, of which
    half lies within the spread, and what is far off is rare and not impossible (Gelman 2006).
    """
    weight = np.array([0.0 if c.sigma == 0.0 or not np.isfinite(c.sigma) else 1.0 / c.sigma for c in unknowns])
    off = (z - np.array([c.mean for c in unknowns])) * weight
    shape = np.array([c.kind == "effect" for c in unknowns])
    # at its middle 2 log(1 + x²) is 2 x²
    square = np.maximum(off**2, 1e-12)
    cost = np.sqrt(2.0 * np.log1p(square))
    slope = np.where(shape, 2.0 * np.sqrt(square) / ((1.0 + square) * cost), 1.0)
    return np.where(shape & (off != 0.0), np.copysign(cost, off), off), slope * weight


ROUNDS, MOST_STEPS, HALVINGS = numerical(25), numerical(20), numerical(6)
"""Rounds at most, steps of Gauss-Newton in each, and dampings that are tried for a step."""
ENOUGH = numerical(0.1)
"""Fall of the squares, to be expected, at which a fit ends; in units of what fits are resolved to."""
LEARNT = numerical(10.0)
"""Fall of the squares from which a step tells more of the slopes than its rounding hides; likewise."""
RENEWED = numerical(3)
"""Steps from one differentiation to the next; Broyden's updates do in between."""
PATIENT, HOPE, LOST = numerical(1), numerical(5.0), numerical(8)
"""A fit is given up after so many rounds where so many like the last would not reach its target; and where it has
not reached it after so many."""
POOR, GOOD = numerical(0.25), numerical(0.75)
"""Shares of the fall to be expected below which slopes are made anew, and from which the region grows."""
SHRINKS, GROWS, SMALLEST = numerical(0.25), numerical(2.0), numerical(1e-3)
"""What the region is multiplied by, and the size at which no descent is found."""


@dataclass
class Descent:
    """A fit on its way.

    Attributes:
        evaluation: the readings where it is, by tables of their own.
        J: derivatives ``(n, 6, n_z)`` of the raw residuals.
        worth: squares there.
        own: indices of the coordinates that make the machine another one.
    """

    fitter: LeastSquaresProblem
    hypothesis: Hypothesis
    parameters: Sequence[FitParameter]
    evaluation: Evaluation
    J: Array
    worth: float
    own: Sequence[int]

    def round(self, radius: float) -> tuple[Evaluation, Array, float]:
        """The best by this machine's tables, within a radius: where, with which slopes and squares."""
        fitter, own = self.fitter, self.own
        held = HeldTables(own, self.evaluation.z[own], self.J[:, :, own])
        low, high = (np.array([getattr(c, end) for c in self.parameters]) for end in ("low", "high"))
        far = radius * (1.0 + np.abs(held.values))
        low[own], high[own] = np.maximum(low[own], held.values - far), np.minimum(high[own], held.values + far)
        evaluation, J, best, damping, exact = self.evaluation, self.J.copy(), self.worth, 1e-3, True
        effects = [i for i, c in enumerate(self.parameters) if c.kind == "effect" and i not in own]
        for count in range(MOST_STEPS):
            trial, damping = self._step(evaluation, J, best, damping, held, low, high)
            fall = 0.0
            if trial is not None:
                value = fitter.squares(self.parameters, trial)
                fall = best - value
                if fall > LEARNT * fitter.resolution(value):
                    self.learn(J, evaluation, trial, effects)
                    exact = False
                evaluation, best = trial, value
            ended = fall < ENOUGH * fitter.resolution(best)
            if ended and exact:
                break
            exact = ended or count % RENEWED == 0
            if exact:
                fitter.renew(J, self.parameters, evaluation, self.hypothesis, [], held)
        return evaluation, J, best

    def predicted_criterion(self) -> float:
        """Fall of the squares by a whole step, to first order, were no step too long."""
        A, b = self.fitter.system(self.parameters, self.evaluation, self.J)
        return float(b @ inverse(A, uncertain(self.parameters), rcond=1e-10) @ b)

    def _step(
        self,
        evaluation: Evaluation,
        J: Array,
        best: float,
        damping: float,
        held: HeldTables,
        low: Array,
        high: Array,
    ) -> tuple[Evaluation | None, float]:
        """A damped step that makes the squares smaller, if there is one, and the damping to go on with."""
        unknowns = self.parameters
        fixed = np.array([c.sigma == 0.0 for c in unknowns])
        linear = np.array([c.kind in ("zero", "scale") for c in unknowns])
        A, b = self.fitter.system(unknowns, evaluation, J)
        least = 0.5 * ENOUGH * self.fitter.resolution(best)
        for _ in range(HALVINGS):
            z = bounded_step(A, b, damping, fixed, linear, evaluation.z, low, high)
            if float((z - evaluation.z) @ b) < least:
                break
            trial = self.fitter.evaluate(unknowns, z, self.hypothesis, held=held)
            if trial is not None and self.fitter.squares(unknowns, trial) < best:
                return trial, max(damping * 0.1, 1e-9)
            damping = max(damping * 10.0, 1e-3)
        return None, damping

    def learn(self, J: Array, before: Evaluation, after: Evaluation, learning: Sequence[int]) -> None:
        """What a step tells of the slopes by the coordinates ``learning``: Broyden's update."""
        move = np.zeros(len(after.z))
        move[learning] = (after.z - before.z)[learning]
        size = float(move @ move)
        if size > 0.0:
            missed = after.residual - before.residual - J @ (after.z - before.z)
            J += np.where(self.fitter.whitening.present, missed, 0.0)[:, :, None] * (move / size)


def best_fit(
    fitter: LeastSquaresProblem,
    hypothesis: Hypothesis,
    nuisances: Array,
    values: Sequence[Sequence[float]],
    *,
    borrowed: Array | None = None,
    target: float = np.inf,
) -> Fit | None:
    """The best coordinates from a start; None where the machine does not stand there.

    Slopes by the machine's nuisances may be ``borrowed`` (n, 6, m) of a fit near by, and are made anew only where
    they lead astray. They only choose a direction, since at the best of a right model the residual is noise. A fit
    that will hardly come down to ``target`` squares is given up.
    """
    unknowns = coordinates(fitter.nuisances, hypothesis)
    # what a hypothesis frees is its parameter, and no slope of another fit tells what it does
    freed = [i for i in fitter.of_machine if not np.isfinite(unknowns[i].sigma)]
    made = [i for k, e in enumerate(hypothesis) if remakes(e) for i in of_effect(unknowns, k)]
    own = [*fitter.of_machine, *made]
    evaluation = fitter.evaluate(unknowns, start(unknowns, hypothesis, nuisances, values), hypothesis)
    if evaluation is None:
        return None
    J = fitter.slopes(unknowns, evaluation, hypothesis, borrowed)
    now = Descent(fitter, hypothesis, unknowns, evaluation, J, fitter.squares(unknowns, evaluation), own)
    # whether all slopes are of this very place
    current, radius, converged = borrowed is None, 1.0, False
    fall = promised = 0.0
    for count in range(ROUNDS):
        if now.worth > target and count > PATIENT:
            out_of_reach = (
                now.worth - HOPE * max(fall, 0.0) > target and now.worth - now.predicted_criterion() > target
            )
            if out_of_reach or count > LOST:
                break
        rounding = fitter.resolution(now.worth)
        by_current, enough = current, ENOUGH * rounding
        trial, J, expected = now.round(radius)
        moved = bool((trial.z[own] != now.evaluation.z[own]).any())
        expected = now.worth - expected
        exact = fitter.evaluate(unknowns, trial.z, hypothesis) if moved else trial
        value = np.inf if exact is None else fitter.squares(unknowns, exact)
        fall = now.worth - value
        if exact is not None and fall > 0.0 and (fall >= 0.1 * expected or expected < rounding):
            # borrowed slopes are of another place: with a step added they would foresee too little
            if moved and borrowed is None and fall > LEARNT * rounding:
                now.learn(J, now.evaluation, exact, own)
            now.evaluation, now.J, now.worth, promised = exact, J, value, 0.0
            radius = radius * GROWS if fall >= GOOD * expected else radius
            if expected >= enough and fall < POOR * expected:
                fitter.renew(now.J, unknowns, exact, hypothesis, fitter.of_machine)
                current = True
            elif moved:
                fitter.renew(now.J, unknowns, exact, hypothesis, freed)
                current = False
        elif expected >= rounding and current:
            radius, promised = radius * SHRINKS, max(promised, expected)
            if radius < SMALLEST:
                # near a critical load predictions have kinks, and a least value is at one
                converged = promised < IMPROBABLE
                break
            continue
        elif expected >= rounding:
            fitter.renew(now.J, unknowns, now.evaluation, hypothesis, fitter.of_machine)
            current = True
            continue
        if expected < (enough if fall > 0.0 else rounding):
            if by_current or borrowed is not None:
                converged = True
                break
            fitter.renew(now.J, unknowns, now.evaluation, hypothesis, fitter.of_machine)
            current = True
            continue
    if borrowed is None and not current:
        fitter.renew(now.J, unknowns, now.evaluation, hypothesis, fitter.of_machine)
    return Fit(
        hypothesis, tuple(unknowns), now.evaluation, now.J, fitter.objective(unknowns, now.evaluation), converged
    )
