"""Readings of a test of one joint: its turn or shift is what was imposed, its load what was read.

Errors of both are in the covariance, so that it does not matter which of the two was imposed.
"""

from __future__ import annotations

import numpy as np

from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import TIME
from vjm_updating.experiment.joint_levers import channels_of
from vjm_updating.experiment.rays import Ray
from vjm_updating.observation.noise import noise_of
from vjm_updating.observation.observed import Observed, since_first, temperature_of


def observe_joint(measurement: Measurement) -> Observed:
    """Readings that have a motion and a load.

    Raises:
        ValueError: the load's channel has no noise.
    """
    readings = measurement.readings
    motion, effort = channels_of(measurement)
    usable = np.flatnonzero(~np.isnan(readings.values[motion]) & ~np.isnan(readings.values[effort]))
    readings = readings.only(usable)
    pose = np.zeros((len(readings), 6))
    pose[:, 0] = readings.values[motion]
    x = np.eye(6)[0]
    return Observed(
        measurement,
        readings,
        pose,
        readings.values[effort][:, None],
        noise_of(measurement, (motion, *[""] * 5), (effort,)),
        (Ray(measurement.drive.name, x, x, np.arange(len(readings))),),
        since_first(readings.values.get(TIME)),
        since_first(temperature_of(measurement, readings)),
        {motion: 0},
        (effort,),
    )
