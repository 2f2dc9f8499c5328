"""The best coordinates of a hypothesis: Gauss-Newton on whitened readings and priors.

Readings are whitened by the covariance of their channels, the displacement's share included, and freed of their
autocorrelation. How the machine's own nuisances act is differentiated once and used for all hypotheses near by: it
only steers, since at the optimum of a right model the residual is noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.diagnose.forward import Evaluation, Predictor, values_of
from vjm_updating.diagnose.normal_equations import bounded_step, inverse
from vjm_updating.diagnose.parameters import Coordinate, Hypothesis, coordinates, start
from vjm_updating.diagnose.whitening import Whitening, weighed
from vjm_updating.experiment.channels import WRENCH

STEPS = 20
"""Of Gauss-Newton at most."""
ENOUGH = 0.03
"""Expected fall of the objective at which it ends."""
LEARNT = 3.0
"""Fall of the objective from which a step tells more of the slopes than its noise hides."""
RENEWED = 3
"""Steps from one differentiation to the next; Broyden's updates do in between."""
PATIENT, HOPE = 2, 5.0
"""A fit is given up after so many steps where so many like the last would not reach its target."""
FAR = 1.0
"""Distance of a machine nuisance from where tables were made, in sigmas, at which they are made anew at once."""
MISSED, MISSED_ROUGHLY = 0.3, 3.0
"""Squares by which a fit may be worth less than slopes from its last tables said, to end there."""
FARTHER = 3.0
"""Sigmas of a machine's nuisance, where it is free, after which its slopes are made anew."""
RETREATS, SHORTER = 6, 4.0
"""Times that a fit goes back from where slopes have led it astray, and by what its damping then grows."""
POOR = 0.25
"""Share of the fall that slopes have promised below which they are made anew."""
DIFFERENCE = 0.03
"""Step of differences, in units of a coordinate."""


@dataclass(frozen=True)
class Fit:
    """A hypothesis at its best.

    Attributes:
        hypothesis: the causes.
        found: its coordinates.
        at: the readings there.
        jacobian: of the raw residuals ``(n, 6, n_z)``.
        objective: twice the negative logarithm of likelihood and prior, see `Fitter.objective`.
        converged: whether it ended by itself.
    """

    hypothesis: Hypothesis
    found: tuple[Coordinate, ...]
    at: Evaluation
    jacobian: Array
    objective: float
    converged: bool

    @property
    def values(self) -> list[list[float]]:
        """Each effect's values."""
        return values_of(self.found, self.at.z, self.hypothesis)

    @property
    def free(self) -> int:
        """Parameters that no prior of the sheet restrains."""
        return sum(c.kind == "effect" for c in self.found) + sum(
            c.kind != "effect" and not np.isfinite(c.sigma) for c in self.found
        )


@dataclass
class Fitter:
    """Fits hypotheses to one test.

    Attributes:
        forward: that predicts readings.
        nuisances: coordinates of the nuisances.
        whitening: in force.
        machine_slopes: derivatives ``(n, 6, m)`` of the residuals by the machine's nuisances, of the last base.
        anchor: those nuisances ``(m,)`` for which tables are made; from there the slopes lead on. None: exact.
    """

    forward: Predictor
    nuisances: tuple[Coordinate, ...]
    whitening: Whitening
    machine_slopes: Array | None = None
    anchor: Array | None = None

    @property
    def of_machine(self) -> list[int]:
        """Indices of the machine's nuisances, the same in every hypothesis."""
        return [i for i, c in enumerate(self.nuisances) if c.kind in ("modulus", "length")]

    def weigh(self, at: Evaluation) -> None:
        """Renew the covariances of the readings."""
        observed = self.forward.observed
        self.whitening = weighed(self.whitening, observed, at)

    def evaluate(
        self, found: Sequence[Coordinate], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation | None:
        """The readings, or None where the machine does not stand; see `Forward.evaluate`."""
        own, made = self.of_machine, z
        anchor, slopes = self.anchor, self.machine_slopes
        if anchor is not None and slopes is not None:
            made = z.copy()
            made[own] = anchor
        try:
            at = self.forward.evaluate(found, made, hypothesis, beside)
        except (NoConvergenceError, ValueError, np.linalg.LinAlgError):
            return None
        if anchor is not None and slopes is not None:
            change = np.nan_to_num(slopes) @ (z[own] - anchor)
            at = replace(at, z=z, residual=at.residual + np.where(self.whitening.present, change, 0.0))
        return at if np.isfinite(at.residual).all() else None

    def squares(self, found: Sequence[Coordinate], at: Evaluation) -> float:
        """Squares of whitened residuals and of what lies off the priors."""
        r = self.whitening.flat(at.residual)
        p, _ = prior(found, at.z)
        return float(r @ r + p @ p)

    def slopes(self, found: Sequence[Coordinate], at: Evaluation, hypothesis: Hypothesis, *, fresh: bool) -> Array:
        """Derivatives ``(n, 6, n_z)`` of the raw residuals."""
        n = len(at.place)
        J = np.zeros((n, 6, len(found)))
        own = self.of_machine
        if fresh or self.machine_slopes is None:
            for i in own:
                J[:, :, i] = self._difference(found, at, hypothesis, i)
            self.machine_slopes = J[:, :, own]
        J[:, :, own] = self.machine_slopes
        for i, c in enumerate(found):
            if c.kind in ("zero", "scale"):
                self._instrument(J, i, c, at)
            elif c.kind == "effect":
                J[:, :, i] = self._difference(found, at, hypothesis, i)
        present = self.forward.observed.present
        return np.where(present[:, :, None], np.nan_to_num(J), 0.0)

    def dragged(self, null: Fit) -> bool:
        """Whether a null needs nuisances of the machine far off the sheet's."""
        return float(np.abs(null.at.z[self.of_machine]).max(initial=0.0)) > FARTHER

    def near(self, null: Fit, most: float) -> Fit:
        """The same, or where it lacks a cause that drags nuisances along, one no further than ``most`` sigmas off.

        There hypotheses begin, by its slopes: those found far off lead astray.
        """
        if not self.dragged(null):
            return null
        self.anchor = None
        at = self.evaluate(null.found, np.clip(null.at.z, -most, most), null.hypothesis)
        if at is None:
            return null
        J = self.slopes(null.found, at, null.hypothesis, fresh=True)
        return replace(null, at=at, jacobian=J)

    def _instrument(self, J: Array, i: int, c: Coordinate, at: Evaluation) -> None:
        if c.subject in WRENCH:
            k = WRENCH.index(c.subject)
            J[:, k, i] = -c.scale * (1.0 if c.kind == "zero" else at.wrench[:, k])
            return
        k = self.forward.observed.slot(c.subject)
        moved = np.ones(len(at.place)) if c.kind == "zero" else at.place[:, k]
        J[:, :, i] = c.scale / at.gain_u[k] * at.gain * at.stiffness[:, :, k] * moved[:, None]

    def _difference(self, found: Sequence[Coordinate], at: Evaluation, hypothesis: Hypothesis, i: int) -> Array:
        for h in (DIFFERENCE, -DIFFERENCE):
            z = at.z.copy()
            step = h * max(1.0, abs(z[i]))
            z[i] += step
            if not found[i].low <= z[i] <= found[i].high:
                continue
            there = self.evaluate(found, z, hypothesis, at.z)
            if there is not None:
                result: Array = (there.residual - at.residual) / step
                return result
        return np.zeros_like(at.residual)

    def fit(
        self,
        hypothesis: Hypothesis,
        nuisances: Array,
        values: Sequence[Sequence[float]],
        *,
        fresh: bool = False,
        rough: bool = False,
        target: float = np.inf,
    ) -> Fit | None:
        """The best coordinates from a start; None where the machine does not stand there.

        Args:
            hypothesis: the causes.
            nuisances: to start from ``(m,)``.
            values: of each effect.
            fresh: differentiate by the machine's nuisances anew.
            rough: be content with what slopes by the machine's nuisances say.
            target: squares worth reaching; a fit that will hardly come so far is given up.
        """
        found = coordinates(self.nuisances, hypothesis)
        z = start(found, hypothesis, nuisances, values)
        own = self.of_machine
        self.anchor = None if fresh else z[own].copy()
        at = self.evaluate(found, z, hypothesis)
        if at is None:
            return None
        borrowed = not fresh and self.machine_slopes is not None
        J = self.slopes(found, at, hypothesis, fresh=fresh)
        self.anchor = z[own].copy()
        best, damping, converged, exact = self.squares(found, at), 1e-3, False, True
        retreats, sloped, usual = 0, z[own].copy(), self.machine_slopes
        tabled = at, best
        freed = any(not np.isfinite(found[i].sigma) for i in own)
        for count in range(STEPS):
            start_of_step = at, best
            there, damping = self._step(found, at, J, best, damping, hypothesis)
            value = best if there is None else self.squares(found, there)
            fall = best - value
            if there is not None:
                before, at, best = at, there, value
                if fall > LEARNT:
                    self._learn(J, found, before, at)
                    exact = False
            off = 0.0 if self.anchor is None else float(np.abs(at.z[own] - self.anchor).max(initial=0.0))
            ended = there is None or fall < ENOUGH
            if off > FAR or (ended and off > 0.0):
                self.anchor = at.z[own].copy()
                again = self.evaluate(found, at.z, hypothesis)
                if again is None:
                    break
                worth = self.squares(found, again)
                if fresh and worth > best + MISSED:
                    # the machine's slopes depend on the causes: from here on tables are made at every step
                    self.anchor, damping, exact = None, 1e-3, True
                    if worth >= start_of_step[1]:
                        again = self.evaluate(found, start_of_step[0].z, hypothesis) or again
                    at, best = again, self.squares(found, again)
                    self._renew(J, found, at, hypothesis)
                    continue
                if worth > tabled[1] + LEARNT and retreats < RETREATS:
                    # slopes have led astray: back, and on by that place's own, or if they were by shorter steps
                    (at, best), retreats, exact = tabled, retreats + 1, True
                    self.anchor = at.z[own].copy()
                    elsewhere = borrowed or bool((sloped != self.anchor).any())
                    damping = 1e-3 if elsewhere else max(10.0 * damping, SHORTER**retreats)
                    J, sloped, borrowed = self._slopes_anew(found, at, hypothesis), self.anchor, False
                    continue
                missed = worth > best + (MISSED_ROUGHLY if rough else MISSED)
                poor = missed and tabled[1] - worth < POOR * (tabled[1] - best)
                at, best = tabled = again, worth
                if off > FAR or missed:
                    ended, damping = False, 1e-3
                if poor or (freed and float(np.abs(at.z[own] - sloped).max()) > FARTHER):
                    J, sloped, borrowed = self._slopes_anew(found, at, hypothesis), self.anchor, False
            if ended and exact:
                converged = True
                break
            if count >= PATIENT and best - HOPE * fall > target and best - self._promise(found, at, J) > target:
                break
            exact = ended or count % RENEWED == 0
            if exact:
                self._renew(J, found, at, hypothesis)
        if self.anchor is not None and (at.z[own] != self.anchor).any():
            self.anchor = at.z[own].copy()
            at = self.evaluate(found, at.z, hypothesis) or at
            if self.squares(found, at) > tabled[1]:
                at, _ = tabled
                self.anchor = at.z[own].copy()
        if not rough and not fresh:
            self._renew(J, found, at, hypothesis)
        self.machine_slopes = usual
        return Fit(hypothesis, tuple(found), at, J, self.objective(found, at), converged)

    def _slopes_anew(self, found: Sequence[Coordinate], at: Evaluation, hypothesis: Hypothesis) -> Array:
        """Slopes where the machine's own have changed on the way."""
        here, self.anchor = self.anchor, None
        J = self.slopes(found, at, hypothesis, fresh=True)
        self.anchor = here
        return J

    def _promise(self, found: Sequence[Coordinate], at: Evaluation, J: Array) -> float:
        """Fall of the objective by a whole step, to first order, were no step too long."""
        A, b = self._system(found, at, J)
        return float(b @ inverse(A, np.array([c.sigma != 0.0 for c in found]), rcond=1e-10) @ b)

    def objective(self, found: Sequence[Coordinate], at: Evaluation) -> float:
        """Twice the negative logarithm of the likelihood and prior, but for a constant.

        The readings' covariances are as the hypothesis' own stiffness makes them. With another's, one that needs
        little of the displacement (a steady ramp, and a drift with the clock) would gain by the gauge's noise that
        it leaves out; without their determinants, one near a critical point would gain by the noise it has there.
        """
        observed = self.forward.observed
        own = weighed(self.whitening, observed, at)
        r = own.flat(at.residual)
        p, _ = prior(found, at.z)
        return float(r @ r + p @ p + own.determinant)

    def _step(
        self,
        found: Sequence[Coordinate],
        at: Evaluation,
        J: Array,
        best: float,
        damping: float,
        hypothesis: Hypothesis,
    ) -> tuple[Evaluation | None, float]:
        """A damped step that makes the objective smaller, if there is one, and the damping to go on with."""
        low, high = (np.array([getattr(c, end) for c in found]) for end in ("low", "high"))
        fixed = np.array([c.sigma == 0.0 for c in found])
        linear = np.array([c.kind in ("zero", "scale") for c in found])
        A, b = self._system(found, at, J)
        for _ in range(6):
            move = bounded_step(A, b, damping, fixed, linear, at.z, low, high)
            if float(move @ b) < 0.5 * ENOUGH:
                return None, damping
            there = self.evaluate(found, np.clip(at.z + move, low, high), hypothesis)
            if there is not None and self.squares(found, there) < best:
                return there, max(damping * 0.1, 1e-9)
            damping = max(damping * 10.0, 1e-3)
        return None, damping

    def _learn(self, J: Array, found: Sequence[Coordinate], before: Evaluation, at: Evaluation) -> None:
        """What a step tells of the effects' slopes: Broyden's update."""
        own = np.array([c.kind == "effect" for c in found])
        move = np.where(own, at.z - before.z, 0.0)
        size = float(move @ move)
        if size > 0.0:
            missed = at.residual - before.residual - J @ (at.z - before.z)
            J += np.where(self.whitening.present, missed, 0.0)[:, :, None] * (move / size)

    def _renew(self, J: Array, found: Sequence[Coordinate], at: Evaluation, hypothesis: Hypothesis) -> None:
        """The slopes that change on the way: without an anchor those by the machine's nuisances, too."""
        present = self.whitening.present
        own = self.of_machine if self.anchor is None else []
        for i, c in enumerate(found):
            if c.kind == "effect" or i in own:
                J[:, :, i] = self._difference(found, at, hypothesis, i)
            elif c.kind in ("zero", "scale"):
                self._instrument(J, i, c, at)
        J[...] = np.where(present[:, :, None], np.nan_to_num(J), 0.0)

    def _system(self, found: Sequence[Coordinate], at: Evaluation, J: Array) -> tuple[Array, Array]:
        """Normal matrix and right side of a step."""
        W, r = self.whitening.flat(J), self.whitening.flat(at.residual)
        p, weight = prior(found, at.z)
        A = W.T @ W + np.diag(weight**2)
        b = -(W.T @ r + weight * p)
        return A, b

    def normal(self, fit: Fit) -> Array:
        """Inverse covariance ``(n_z, n_z)`` of a fit's coordinates, priors included."""
        return self._system(fit.found, fit.at, fit.jacobian)[0]

    def pressure(self, fit: Fit) -> Array:
        """How strongly ``(n_z,)`` a fit's coordinates press against bounds that they lie at, else zero."""
        low, high = (np.array([getattr(c, end) for c in fit.found]) for end in ("low", "high"))
        b, z = self._system(fit.found, fit.at, fit.jacobian)[1], fit.at.z
        return np.where(z <= low, np.maximum(-b, 0.0), np.where(z >= high, np.maximum(b, 0.0), 0.0))


def prior(found: Sequence[Coordinate], z: Array) -> tuple[Array, Array]:
    """Distance of each coordinate from its prior over its sigma ``(n_z,)``, and one over sigma."""
    weight = np.array([0.0 if c.sigma == 0.0 or not np.isfinite(c.sigma) else 1.0 / c.sigma for c in found])
    mean = np.array([c.mean for c in found])
    return (z - mean) * weight, weight
