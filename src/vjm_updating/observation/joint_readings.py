"""Readings of a test of one joint: its turn or shift is what was imposed, its load what was read.

Errors of both are in the covariance, so that it does not matter which of the two was imposed.
"""

from __future__ import annotations

import numpy as np

from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import EFFORT, MOTION, TIME
from vjm_updating.experiment.rays import Ray
from vjm_updating.observation.noise import noise_of
from vjm_updating.observation.observed import Observed, since_first, temperature_of


def channels_of(measurement: Measurement) -> tuple[str, str]:
    """Columns of the motion and of the load."""
    motion, effort = (
        next(name for name in names if name in measurement.readings.values) for names in (MOTION, EFFORT)
    )
    return motion, effort


def levers_of(measurement: Measurement) -> tuple[float, float, float]:
    """The lever L in mm at which the joint's laws are told, and what makes readings of its motion and load.

    Returns:
        L, 1 where the joint slides; motion at L, mm, per unit of the motion's column; the load's column per N at L.
    """
    motion, effort = channels_of(measurement)
    if measurement.drive.slides:
        return 1.0, 1.0, 1.0
    length, lever = measurement.chain.characteristic_length, measurement.sheet.lever
    of_motion = length if motion == MOTION[0] else length / (lever.gauge_mm or np.nan)
    of_load = length if effort == EFFORT[0] else length / (lever.force_mm or np.nan)
    return length, of_motion, of_load


def stiffness_of(measurement: Measurement) -> float:
    """Of the joint in the model at its lever, N/mm."""
    length, _, _ = levers_of(measurement)
    return 1.0 / measurement.joint_compliance / length**2


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
