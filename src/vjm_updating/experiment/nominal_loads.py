"""What gauges read of the nominal machine under loads: what readings of a test by force are compared with."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment.channels import POSE, WRENCH, split_point
from vjm_updating.experiment.measurement import Measurement
from vjm_updating.experiment.nominal_curve import ONE, UNCHANGED
from vjm_updating.mechanisms.load_table import Gauge, load_table
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.path_table import HalfRay

SMALL = numerical(1e-6, "N")
"""N: the load at which the unloaded machine's compliance is taken."""


def gauges_of(measurement: Measurement) -> tuple[Gauge, ...]:
    """The gauges that read displacements, in the order of the file's columns."""
    found = []
    for name in measurement.readings.channels:
        label, channel = split_point(name)
        if channel in POSE:
            point = measurement.sheet.points.get(label)
            where = ("", 1.0) if point is None else (point.body, point.at)
            found.append(Gauge(name, POSE.index(channel), *where))
    return tuple(found)


class NominalLoads:
    """Readings of the nominal machine's gauges by its unloaded compliance.

    Attributes:
        measurement: sheet, readings, machine.
        given: columns of what was imposed.
        columns: of what was read.
        imposed: loads ``(n, 6)``; an absent one is zero.
        read: displacements ``(n, m)``.
    """

    given = WRENCH

    def __init__(self, measurement: Measurement) -> None:
        self.measurement = measurement
        readings = measurement.readings
        self.gauges = gauges_of(measurement)
        self.columns = tuple(gauge.channel for gauge in self.gauges)
        self.imposed = np.column_stack([readings.values.get(name, np.zeros(len(readings))) for name in WRENCH])
        self.read = np.column_stack([readings.values[name] for name in self.columns])
        self._compliance = lru_cache(maxsize=None)(self._unloaded)

    def predicted(
        self,
        factors: Array = ONE,
        order: tuple[int, ...] = UNCHANGED,
        postures: Mapping[str, str] | None = None,
        only: str = "",
    ) -> Array:
        """Displacements ``(n, m)`` under the loads; nan where none is known.

        Args:
            factors: by which loads are multiplied ``(6,)``.
            order: in which their columns are taken, before they are multiplied.
            postures: in which others the machine stands instead, by label.
            only: label of the posture that is wanted; all by default.
        """
        readings, other = self.measurement.readings, postures or {}
        load = self.imposed[:, list(order)] * factors
        result = np.full(self.read.shape, np.nan)
        for label in dict.fromkeys(readings.posture.tolist()):
            if not only or label == only:
                at = readings.posture == label
                result[at] = load[at] @ self._compliance(other.get(label, label)).T
        return result

    def slope(self, posture: str) -> Array:
        """Derivative ``(m, 6)`` of the readings by the loads, unloaded."""
        return self._compliance(posture)

    def _unloaded(self, posture: str) -> Array:
        """Derivative ``(m, 6)`` of the readings by the loads.

        Raises:
            NoConvergenceError: the nominal machine does not stand in the posture.
            ValueError: what is free makes it a mechanism.
        """
        m = self.measurement
        half = HalfRay.of(posture, np.eye(6)[0], SMALL)
        table = load_table(ModifiedChain(m.chain, m.engine), half, (), m.free, self.gauges)
        result: Array = table.compliance[0]
        return result
