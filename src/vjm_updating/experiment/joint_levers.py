"""A test of one joint: its columns, the lever at which its laws are told, and what the model predicts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment.channels import EFFORT, MOTION
from vjm_updating.experiment.measurement import Measurement


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


def slope_of(measurement: Measurement) -> float:
    """Derivative of the load by the motion of the joint in the model, in the units of their columns."""
    _, of_motion, of_load = levers_of(measurement)
    return of_load * stiffness_of(measurement) * of_motion


def expected(measurement: Measurement) -> Array:
    """Loads ``(n,)`` that the joint in the model would take at the motions, in the unit of their column."""
    motion, _ = channels_of(measurement)
    result: Array = slope_of(measurement) * measurement.readings.values[motion]
    return result


class NominalJoint:
    """The load by the compliance of one joint in the model.

    Attributes:
        given: column of the motion, which was imposed or not.
        columns: of the load.
        imposed: motions ``(n, 1)``, rad or mm.
        read: loads ``(n, 1)``, N mm or N.
    """

    def __init__(self, measurement: Measurement) -> None:
        motion, effort = channels_of(measurement)
        self.given, self.columns = (motion,), (effort,)
        values = measurement.readings.values
        self.imposed, self.read = values[motion][:, None], values[effort][:, None]
        self._expected = expected(measurement)[:, None]
        self._slope = slope_of(measurement)

    def predicted(
        self,
        factors: Array | None = None,
        order: tuple[int, ...] = (0,),
        postures: Mapping[str, str] | None = None,
        only: str = "",
    ) -> Array:
        """Loads ``(n, 1)`` at the motions; see `vjm_updating.experiment.nominal_curve.NominalCurves.predicted`.

        Args:
            factors: by which motions are multiplied ``(1,)``.
            order: of no meaning: there is one column.
            postures: of no meaning: the joint has one.
            only: of no meaning.
        """
        result: Array = self._expected * (np.ones(1) if factors is None else factors)
        return result

    def slope(self, posture: str) -> Array:
        """Derivative ``(1, 1)`` of the load by the motion, the same in every posture."""
        return np.full((1, 1), self._slope)
