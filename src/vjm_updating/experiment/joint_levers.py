"""A test of one joint: its columns, the lever at which its laws are told, and what the model predicts."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment.channels import EFFORT, MOTION
from vjm_updating.experiment.comparison import Comparison
from vjm_updating.experiment.measured import Measurement


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


def one_sided(measurement: Measurement) -> bool:
    """Whether the joint was loaded to one side only, so that nothing shows the other end of its backlash.

    A side counts where a load and a motion of its sign were read together. Friction alone turns the load's sign on
    the way back, while the motion keeps its own.
    """
    sides = []
    for name in channels_of(measurement):
        read, own = measurement.readings.values[name], measurement.sheet.sigma(name)
        # the largest of n standard normal deviations is near the root of 2 ln n
        clear = np.hypot(own.noise, own.zero) * np.sqrt(2.0 * np.log(max(len(read), 2)))
        sides.append(np.where(np.abs(read) > clear, np.sign(read), 0.0))
    motion, load = sides
    return not all(np.any((motion == side) & (load == side)) for side in (1.0, -1.0))


def stiffness_of(measurement: Measurement) -> float:
    """Of the joint in the model at its lever, N/mm."""
    length, _, _ = levers_of(measurement)
    return 1.0 / measurement.joint_compliance / length**2


class OfJoint(Comparison):
    """The load beside the compliance of one joint in the model."""

    words = "loads"

    def __init__(self, measurement: Measurement) -> None:
        motion, effort = channels_of(measurement)
        imposed, read = (measurement.readings.values[name][:, None] for name in (motion, effort))
        super().__init__(measurement, (motion,), (effort,), imposed, read)

    def _slope(self, posture: str) -> Array:
        """Stiffness ``(1, 1)`` in the units of the columns, the same in every posture."""
        _, of_motion, of_load = levers_of(self.measurement)
        return np.full((1, 1), of_load * stiffness_of(self.measurement) * of_motion)
