"""A calibration as residuals of its unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_updating.calibrate.parameters import Unknowns, default_parameters, unknowns
from vjm_updating.calibrate.prediction import Branches, Prediction, predict
from vjm_updating.experiment import Kind, Measurement
from vjm_updating.experiment.channels import POSE, WRENCH
from vjm_updating.observation.noise import whiten
from vjm_updating.observation.observed import Observed, observe


@dataclass(frozen=True)
class Evaluation:
    """The readings against the model at one set of unknowns.

    Attributes:
        z: the unknowns ``(n_z,)``.
        branches: that the half-rays take.
        residual: reading minus model ``(n, 6)``, N, N mm; zero where there is no reading.
        jacobian: its derivative ``(n, 6, n_z)``; None where not asked for.
        prediction: the model itself at the true displacements.
        place: true displacements ``(n, 6)``.
    """

    z: Array
    branches: Branches
    residual: Array
    jacobian: Array | None
    prediction: Prediction
    place: Array


@dataclass(frozen=True)
class Problem:
    """What is to be fitted, to what.

    Attributes:
        engine: of the lumped model.
        unknowns: of the fit.
        observed: the readings, displacements as read.
    """

    engine: VjmEngine
    unknowns: Unknowns
    observed: Observed

    def evaluate(self, z: Array, branches: Branches, *, derivatives: bool = True) -> Evaluation:
        """Readings against the model.

        Raises:
            NoConvergenceError: the model does not reach a reading.
        """
        zero_u, scale_u, zero_f, scale_f = (
            self._nuisance(z, kind, names)
            for names in (POSE, WRENCH)
            for kind in (Kind.ZERO, Kind.SCALE)
        )  # fmt: skip
        observed = self.observed
        place = (observed.pose - zero_u) / (1.0 + scale_u)
        found = predict(self.engine, self.unknowns, z, observed.rays, place, branches, derivatives=derivatives)
        gain = 1.0 + scale_f
        residual = np.where(observed.present, observed.wrench - gain * found.wrench - zero_f, 0.0)
        jacobian = self._jacobian(found, gain, place, 1.0 + scale_u) if derivatives else None
        return Evaluation(z, branches, residual, jacobian, found, place)

    def whitening(self, at: Evaluation) -> Array:
        """Inverse Cholesky factors ``(n, 6, 6)`` of the readings' covariances."""
        gain = 1.0 + self._nuisance(at.z, Kind.SCALE, WRENCH)
        return whiten(self.observed.noise, at.prediction.stiffness, gain, self.observed.present)

    def _jacobian(self, found: Prediction, gain: Array, place: Array, gain_u: Array) -> Array:
        J = np.zeros((*found.wrench.shape, len(self.unknowns)))
        assert found.derivative is not None
        J[:, :, self.unknowns.on_chain] = -gain[:, None] * found.derivative
        for i, unknown in enumerate(self.unknowns.all):
            if unknown.of_chain or unknown.nuisance is None:
                continue
            kind, channel = unknown.nuisance.kind, unknown.nuisance.subject
            if channel in WRENCH:
                c = WRENCH.index(channel)
                J[:, c, i] = -unknown.step * (1.0 if kind is Kind.ZERO else found.wrench[:, c])
            elif channel in POSE:
                c = POSE.index(channel)
                moved = 1.0 if kind is Kind.ZERO else place[:, c, None]
                J[:, :, i] = unknown.step * gain * found.stiffness[:, :, c] * moved / gain_u[c]
        return np.where(self.observed.present[:, :, None], np.nan_to_num(J), 0.0)

    def _nuisance(self, z: Array, kind: Kind, names: Sequence[str]) -> Array:
        """Zeros or scales ``(6,)`` of channels."""
        result = np.zeros(6)
        for unknown, value in zip(self.unknowns.all, z, strict=True):
            own = unknown.nuisance
            if own is not None and own.kind is kind and own.subject in names:
                result[names.index(own.subject)] = unknown.value(value)
        return result


def problem_of(measurement: Measurement, names: Sequence[str] = ()) -> Problem:
    """The calibration of a measurement.

    Args:
        measurement: sheet, readings and nominal machine.
        names: parameters to look for, see `vjm_updating.calibrate.parameters.unknowns`; one factor for every
            elastic part by default.

    Raises:
        ValueError: the data are of a kind that cannot be calibrated with, or a parameter means nothing.
    """
    engine, chain = measurement.engine, measurement.chain
    observed = observe(measurement)
    found = unknowns(chain, engine, names or default_parameters(engine, chain), measurement.nuisances)
    count = int(observed.present.sum())
    if count <= found.parameters:
        raise ValueError(
            f"{observed.readings.file}: {count} readings for {found.parameters} parameters: "
            "look for fewer of them, or read more"
        )
    return Problem(engine, found, observed)
