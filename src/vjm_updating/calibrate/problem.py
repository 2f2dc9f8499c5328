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
from vjm_updating.experiment.rays import Ray, rays
from vjm_updating.observation.noise import Memory, Noise, memory_of, noise_of, whiten


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
        pose: displacements as read ``(n, 6)``.
        wrench: as read ``(n, 6)``; nan where there is no reading.
        noise: of one reading.
        rays: of the readings.
        memory: who precedes whom.
        row: line of the file of each reading ``(n,)``.
    """

    engine: VjmEngine
    unknowns: Unknowns
    pose: Array
    wrench: Array
    noise: Noise
    rays: tuple[Ray, ...]
    memory: Memory
    row: np.ndarray

    @property
    def present(self) -> np.ndarray:
        """Which channels were read ``(n, 6)``."""
        result: np.ndarray = ~np.isnan(self.wrench)
        return result

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
        place = (self.pose - zero_u) / (1.0 + scale_u)
        found = predict(self.engine, self.unknowns, z, self.rays, place, branches, derivatives=derivatives)
        gain = 1.0 + scale_f
        residual = np.where(self.present, self.wrench - gain * found.wrench - zero_f, 0.0)
        jacobian = self._jacobian(found, gain, place, 1.0 + scale_u) if derivatives else None
        return Evaluation(z, branches, residual, jacobian, found, place)

    def whitening(self, at: Evaluation) -> Array:
        """Inverse Cholesky factors ``(n, 6, 6)`` of the readings' covariances."""
        gain = 1.0 + self._nuisance(at.z, Kind.SCALE, WRENCH)
        return whiten(self.noise, at.prediction.stiffness, gain, self.present)

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
        return np.where(self.present[:, :, None], np.nan_to_num(J), 0.0)

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
    readings, sheet = measurement.readings, measurement.sheet
    if not measurement.imposed:
        raise ValueError(
            f"{readings.file}: no displacement of the end-effector was read ({', '.join(POSE)}): a calibration "
            "needs it beside the forces; `validate diagnose` takes tests that are steered by another point"
        )
    held = next((n for n in readings.channels if n in sheet.instrument and sheet.instrument[n].held), None)
    if held is not None:
        readings = readings.settled(held)
    pose, wrench = readings.pose, readings.wrench
    usable = np.asarray(~(np.isnan(pose).any(axis=1) | np.isnan(wrench).all(axis=1)))
    readings, pose, wrench = readings.only(usable), pose[usable], wrench[usable]
    noise = noise_of(measurement)
    machine = measurement.chain
    found = unknowns(
        machine, measurement.engine, names or default_parameters(measurement.engine, machine), measurement.nuisances
    )
    zero = [max((u.step for u in found.all if u.name == f"zero {name}"), default=0.0) for name in POSE]
    # repeats may leave a bifurcation on different sides, so each has rays of its own
    groups = np.array([f"{p} {r}" for p, r in zip(readings.posture, readings.run, strict=True)])
    sorted_ = rays(groups, pose, np.hypot(noise.pose, zero), machine.characteristic_length)
    own = tuple(Ray(r.posture.rpartition(" ")[0], r.direction, r.measure, r.index) for r in sorted_)
    problem = Problem(
        measurement.engine,
        found,
        pose,
        wrench,
        noise,
        own,
        memory_of(readings.sequence, ~np.isnan(wrench)),
        readings.row,
    )
    if problem.present.sum() <= found.parameters:
        raise ValueError(
            f"{readings.file}: {int(problem.present.sum())} readings for {found.parameters} parameters: "
            "look for fewer of them, or read more"
        )
    return problem
