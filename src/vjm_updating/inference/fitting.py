"""Hypotheses and readings: what a hypothesis predicts, how that changes with its coordinates, how well it fits.

Readings are whitened by the covariance of their channels, the displacement's share included, and freed of their
autocorrelation. `vjm_updating.inference.trust_region` finds the best coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.forward import Predictor, values_of
from vjm_updating.inference.parameters import Hypothesis
from vjm_updating.observation.coordinate import Coordinate, Evaluation
from vjm_updating.observation.whitening import Whitening, displaced, weighed

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


@dataclass(frozen=True)
class HeldTables:
    """A machine whose tables serve for others near by.

    Attributes:
        own: indices of the coordinates that make it another one.
        at: their values ``(m,)``.
        slopes: derivatives ``(n, 6, m)`` of the raw residuals by them, which lead on to the others.
    """

    own: Sequence[int]
    at: Array
    slopes: Array


@dataclass
class Fitter:
    """Fits hypotheses to one test.

    Attributes:
        forward: that predicts readings.
        nuisances: coordinates of every hypothesis: the nuisances, and what a calibration looks for.
        whitening: in force.
        rounding: squares by which predictions of two machines differ where they should not.
    """

    forward: Predictor
    nuisances: tuple[Coordinate, ...]
    whitening: Whitening
    rounding: float = ROUNDING

    @property
    def of_machine(self) -> list[int]:
        """Indices of the machine's nuisances, the same in every hypothesis."""
        return [i for i, c in enumerate(self.nuisances) if not c.of_instrument]

    def machine_slopes(self, fit: Fit) -> Array:
        """A fit's derivatives ``(n, 6, m)`` by the machine's nuisances."""
        return fit.jacobian[:, :, self.of_machine]

    def weigh(self, at: Evaluation) -> None:
        """Renew the covariances of the readings."""
        observed = self.forward.observed
        self.whitening = weighed(self.whitening, observed, at)

    def evaluate(
        self,
        found: Sequence[Coordinate],
        z: Array,
        hypothesis: Hypothesis,
        *,
        beside: Array | None = None,
        held: HeldTables | None = None,
    ) -> Evaluation | None:
        """The readings, or None where the machine does not stand.

        Args:
            found: the hypothesis' coordinates.
            z: their values ``(n_z,)``.
            hypothesis: its causes.
            beside: see `vjm_updating.inference.forward.Forward.evaluate`.
            held: a machine near by whose tables are to serve; exact without.
        """
        near = None if beside is None else _made(beside, held)
        try:
            at = self.forward.evaluate(found, _made(z, held), hypothesis, near)
        except (NoConvergenceError, ValueError, np.linalg.LinAlgError):
            return None
        if held is not None:
            change = np.nan_to_num(held.slopes) @ (z[held.own] - held.at)
            at = replace(at, z=z, residual=at.residual + np.where(self.whitening.present, change, 0.0))
        return at if np.isfinite(at.residual).all() else None

    def squares(self, found: Sequence[Coordinate], at: Evaluation) -> float:
        """Squares of whitened residuals and of what lies off the priors."""
        r = self.whitening.flat(at.residual)
        p, _ = prior(found, at.z)
        return float(r @ r + p @ p)

    def slopes(
        self, found: Sequence[Coordinate], at: Evaluation, hypothesis: Hypothesis, borrowed: Array | None = None
    ) -> Array:
        """Derivatives ``(n, 6, n_z)`` of the raw residuals.

        Args:
            found: the hypothesis' coordinates.
            at: the readings there.
            hypothesis: its causes.
            borrowed: those by the machine's nuisances ``(n, 6, m)``, of a fit near by; differentiated without, and
                where the hypothesis frees them.
        """
        J = np.zeros((*at.residual.shape, len(found)))
        machine = self.of_machine
        if borrowed is not None:
            J[:, :, machine] = borrowed
            machine = [i for i in machine if not np.isfinite(found[i].sigma)]
        self.renew(J, found, at, hypothesis, machine)
        return J

    def renew(
        self,
        J: Array,
        found: Sequence[Coordinate],
        at: Evaluation,
        hypothesis: Hypothesis,
        machine: Sequence[int],
        held: HeldTables | None = None,
    ) -> None:
        """Make derivatives ``J`` (n, 6, n_z) anew: by instruments, effects, and those of the ``machine`` named.

        Those by what a machine ``held`` is made of stay.
        """
        for i, c in enumerate(found):
            if c.kind in ("zero", "scale"):
                J[:, :, i] = c.scale * at.slope(c.kind, c.subject, self.forward.observed.slots)
            elif i in machine or (c.kind == "effect" and (held is None or i not in held.own)):
                J[:, :, i] = self._difference(found, at, hypothesis, i, held)
        present = self.forward.observed.present
        J[...] = np.where(present[:, :, None], np.nan_to_num(J), 0.0)

    def beyond_tolerance(self, null: Fit) -> bool:
        """Whether a null needs nuisances of the machine far off the sheet's."""
        return float(np.abs(null.at.z[self.of_machine]).max(initial=0.0)) > FARTHER

    def near(self, null: Fit, most: float) -> Fit:
        """The same, or where it lacks a cause that drags nuisances along, one no further than ``most`` sigmas off.

        There hypotheses begin, by its slopes: those found far off lead astray.
        """
        if not self.beyond_tolerance(null):
            return null
        at = self.evaluate(null.found, np.clip(null.at.z, -most, most), null.hypothesis)
        if at is None:
            return null
        return replace(null, at=at, jacobian=self.slopes(null.found, at, null.hypothesis))

    def _difference(
        self, found: Sequence[Coordinate], at: Evaluation, hypothesis: Hypothesis, i: int, held: HeldTables | None
    ) -> Array:
        exact = None if at.exact is None else at.exact(i)
        if exact is not None:
            return exact
        # where the machine stands at neither end of a step, a shorter one tells the slope
        for h in (sign * found[i].difference * share for share in STEPS for sign in (1.0, -1.0)):
            z = at.z.copy()
            step = h * max(1.0, abs(z[i]))
            z[i] += step
            if not found[i].low <= z[i] <= found[i].high:
                continue
            there = self.evaluate(found, z, hypothesis, beside=at.z, held=held)
            if there is not None:
                result: Array = (there.residual - at.residual) / step
                return result
        return np.zeros_like(at.residual)

    def objective(self, found: Sequence[Coordinate], at: Evaluation) -> float:
        """Twice the negative logarithm of the likelihood and prior, but for a constant.

        The readings' covariances are as the hypothesis' own stiffness makes them. With another's, one that needs
        little of the displacement (a steady ramp, and a drift with the clock) would gain by the gauge's noise that
        it leaves out. Without their determinants, one near a critical point would gain by the noise it has there.
        Where forces were imposed it is the likelihood of the displacements, see `displaced`.
        """
        observed = self.forward.observed
        own = weighed(self.whitening, observed, at)
        r = own.flat(at.residual)
        p, _ = prior(found, at.z)
        return float(r @ r + p @ p + own.determinant) - displaced(observed, at)

    def system(self, found: Sequence[Coordinate], at: Evaluation, J: Array) -> tuple[Array, Array]:
        """Normal matrix ``(n_z, n_z)`` and right side ``(n_z,)`` of a step."""
        W, r = self.whitening.flat(J), self.whitening.flat(at.residual)
        p, weight = prior(found, at.z)
        A = W.T @ W + np.diag(weight**2)
        b = -(W.T @ r + weight * p)
        return A, b

    def normal(self, fit: Fit) -> Array:
        """Inverse covariance ``(n_z, n_z)`` of a fit's coordinates, priors included."""
        return self.system(fit.found, fit.at, fit.jacobian)[0]

    def pressure(self, fit: Fit) -> Array:
        """How strongly ``(n_z,)`` a fit's coordinates press against bounds that they lie at, else zero."""
        low, high = (np.array([getattr(c, end) for c in fit.found]) for end in ("low", "high"))
        b, z = self.system(fit.found, fit.at, fit.jacobian)[1], fit.at.z
        return np.where(z <= low, np.maximum(-b, 0.0), np.where(z >= high, np.maximum(b, 0.0), 0.0))


def _made(z: Array, held: HeldTables | None) -> Array:
    """The coordinates ``(n_z,)`` whose tables serve: those of the machine held, where one is."""
    if held is None:
        return z
    made = z.copy()
    made[held.own] = held.at
    return made


def shapes_cost(found: Sequence[Coordinate], z: Array) -> float:
    """What it costs in the objective that shapes of laws are not the usual ones: all that these could save."""
    off, _ = prior(found, z)
    own = [i for i, c in enumerate(found) if c.kind == "effect" and np.isfinite(c.sigma)]
    return float(off[own] @ off[own])


def prior(found: Sequence[Coordinate], z: Array) -> tuple[Array, Array]:
    """Root ``(n_z,)`` of what each coordinate costs in the objective, and its derivative.

    A sheet's tolerance is Gaussian. The shape of a law has an order of magnitude: its prior is Cauchy's, of which
    half lies within the spread, and what is far off is rare and not impossible (Gelman 2006).
    """
    weight = np.array([0.0 if c.sigma == 0.0 or not np.isfinite(c.sigma) else 1.0 / c.sigma for c in found])
    off = (z - np.array([c.mean for c in found])) * weight
    shape = np.array([c.kind == "effect" for c in found])
    # at its middle 2 log(1 + x²) is 2 x²
    square = np.maximum(off**2, 1e-12)
    cost = np.sqrt(2.0 * np.log1p(square))
    slope = np.where(shape, 2.0 * np.sqrt(square) / ((1.0 + square) * cost), 1.0)
    return np.where(shape & (off != 0.0), np.copysign(cost, off), off), slope * weight
