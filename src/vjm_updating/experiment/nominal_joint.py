"""Loads that a joint's spring in the model would take at the motions: what a test of one joint is compared with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment.joint_levers import channels_of, expected, slope_of
from vjm_updating.experiment.measurement import Measurement


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
