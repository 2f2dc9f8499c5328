"""A calibration as residuals of its unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_updating.calibrate.parameters import Unknowns, default_parameters, unknowns
from vjm_updating.calibrate.prediction import Branches, predict
from vjm_updating.experiment import Measurement
from vjm_updating.observation.coordinate import instrument_errors
from vjm_updating.observation.evaluation import Evaluation
from vjm_updating.observation.observed import Observed, observe


@dataclass(frozen=True)
class Trial(Evaluation):
    """The readings against the model at one set of unknowns.

    Attributes:
        branches: that the half-rays take.
        branched: ``(n,)`` whether a reading lies behind a bifurcation.
        jacobian: derivative of the residuals ``(n, 6, n_z)``; None where not asked for.
    """

    branches: Branches
    branched: np.ndarray
    jacobian: Array | None


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

    def evaluate(self, z: Array, branches: Branches, *, derivatives: bool = True) -> Trial:
        """Readings against the model.

        Raises:
            NoConvergenceError: the model does not reach a reading.
        """
        observed, unknowns = self.observed, self.unknowns
        errors = instrument_errors(unknowns.all, z, observed.slots)
        place = errors.true_displacement(observed.pose)
        found = predict(self.engine, unknowns, z, observed.rays, place, branches, derivatives=derivatives)
        residual = errors.residual(observed.wrench, found.wrench)
        at = Trial(z, residual, found.wrench, found.stiffness, place, errors, branches, found.branched, None)
        return at if found.derivative is None else replace(at, jacobian=self._jacobian(at, found.derivative))

    def _jacobian(self, at: Evaluation, derivative: Array) -> Array:
        """Of the residuals ``(n, 6, n_z)``, from the wrenches' by the unknowns that change the chain."""
        J = np.zeros((*at.wrench.shape, len(self.unknowns)))
        J[:, :, self.unknowns.on_chain] = -at.errors.gain[:, None] * derivative
        for i, c in enumerate(self.unknowns.all):
            if c.of_instrument:
                J[:, :, i] = c.scale * at.slope(c.kind, c.subject, self.observed.slots)
        return np.where(self.observed.present[:, :, None], np.nan_to_num(J), 0.0)


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
