"""How readings' residuals become independent ones of unit variance.

Each reading's channels share its displacement's noise, a channel's readings remember the one before, and where the
displacement was driven steadily (`steady`) the errors of its lines are shared by all readings between two turns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.observation.coordinate import Evaluation
from vjm_updating.observation.noise import AutoregressiveNoise, whiten
from vjm_updating.observation.observed import Observed
from vjm_updating.observation.ramp_regression import RampRegression
from vjm_updating.observation.significance import CUT

STEPS, NEGLIGIBLE = numerical(100), numerical(1e-2)
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
        result: Array = np.einsum("nij,nj...->ni...", self.factors, raw)
        return result

    def independent(self, raw: Array) -> Array:
        """``(n, 6, …)`` of unit variance and white; errors of the straight lines are still shared."""
        result: Array = self.autoregression.remove(self.instant(raw)) / self.spread.reshape(
            -1, *[1] * (raw.ndim - 2)
        )
        return result

    def flat(self, raw: Array) -> Array:
        """Raw residuals ``(n, 6, …)`` as independent ones ``(N, …)``."""
        return self.apart(self._each(raw))

    def apart(self, free: Array) -> Array:
        """Residuals ``(N, …)`` without autocorrelation and without what errors of the straight lines do to them."""
        U, sizes, _ = self._together
        share = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)
        result: Array = free - U @ (share.reshape(-1, *[1] * (free.ndim - 1)) * (U.T @ free))
        return result

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
        for _ in range(STEPS):
            step = (sizes * (U.T @ np.clip(free - U @ (sizes * likely), -CUT, CUT)) - likely) / (1.0 + sizes**2)
            likely = likely + step
            # in standard deviations of a reading
            if np.abs(sizes * step).max(initial=0.0) < NEGLIGIBLE:
                break
        result: Array = raw - self.slow @ (Vt.T @ likely)
        return result

    @cached_property
    def _together(self) -> tuple[Array, Array, Array]:
        V = self._each(self.slow)
        if not V.shape[1]:
            return V, np.zeros(0), np.zeros((0, 0))
        U, sizes, Vt = np.linalg.svd(V, full_matrices=False)
        return U, sizes, Vt

    def _each(self, raw: Array) -> Array:
        """Raw residuals ``(n, 6, …)`` as white ones ``(N, …)``."""
        result: Array = self.independent(raw)[self.present]
        return result


def whitening_of(observed: Observed, at: Evaluation) -> Whitening:
    """By the sheet's noise and a model's stiffness; no autocorrelation yet."""
    return weighed(Whitening(np.zeros(0), observed.autoregression, observed.present), observed, at)


def weighed(whitening: Whitening, observed: Observed, at: Evaluation) -> Whitening:
    """The same with the readings' covariances as a hypothesis' own stiffness makes them."""
    return replace(
        whitening,
        factors=whiten(observed.pose_noise, observed.noise.wrench, at.sensitivity, observed.present),
        present=observed.present,
        steady=observed.steady,
        gauge_sensitivity=np.nan_to_num(at.sensitivity * observed.noise.pose),
    )


def displaced(observed: Observed, at: Evaluation) -> float:
    """What turns the forces' likelihood into that of displacements which they cause: twice its logarithm.

    Under force control displacements are what was read. The residuals are forces at these, so that their density is
    to be multiplied by the determinant of the stiffness that was gone along. Else a soft machine would gain by what
    little a gauge's noise makes of forces. It is 0 where displacements were imposed.

    Args:
        observed: the readings.
        at: a model at them.
    """
    if observed.columns != WRENCH or not observed.measurement.sheet.test.by_force:
        return 0.0
    own = [k for k in observed.slots.values() if WRENCH[k] in observed.wrench_channels]
    on = observed.present[:, own]
    stiffness = at.sensitivity[:, own][:, :, own]
    gone = np.where(on[:, :, None] & on[:, None, :], stiffness, np.eye(len(own)))
    return 2.0 * float(np.linalg.slogdet(gone)[1].sum())
