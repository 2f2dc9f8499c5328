"""Readings of ramps as a calibration and a diagnosis take them: displacements as they were imposed."""

from __future__ import annotations

import numpy as np

from vjm_updating.experiment import Measurement
from vjm_updating.inference.forward import Forward
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates
from vjm_updating.observation.idle_axes import at_their_means
from vjm_updating.observation.observed import Observed, observe, straightened


def observe_ramps(measurement: Measurement) -> Observed:
    """What there is to be explained, displacements as commanded where that was steadily, idle axes at their means.

    At what a gauge of an idle axis reads, the slopes of the forces by a stiffness have that gauge's noise in them.
    They would explain the very noise that they are made of.

    Raises:
        ValueError: no displacement of the end-effector was read, or it cannot be used; see `observe`.
        vjm.errors.NoConvergenceError: the nominal machine has no equilibrium at the readings.
    """
    observed = straightened(observe(measurement))
    if len(observed.slots) < 2 or measurement.sheet.test.control != "displacement":
        return observed
    nuisances = nuisance_coordinates(observed)
    at = Forward(observed).evaluate(coordinates(nuisances, ()), np.zeros(len(nuisances)), ())
    return at_their_means(observed, at)
