"""A test by force, beside what gauges read of the nominal machine under the loads."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment.channels import POSE, WRENCH, split_point
from vjm_updating.experiment.comparison import Comparison
from vjm_updating.experiment.measured import Measurement
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


def imposed_loads(measurement: Measurement) -> Array:
    """Loads ``(n, 6)`` of a test by force, N, N mm; an absent one is zero."""
    readings = measurement.readings
    return np.column_stack([readings.values.get(name, np.zeros(len(readings))) for name in WRENCH])


class ByLoads(Comparison):
    """Readings of gauges beside the unloaded machine's compliance."""

    words = "displacements"

    def __init__(self, measurement: Measurement) -> None:
        self.gauges = gauges_of(measurement)
        columns = tuple(gauge.channel for gauge in self.gauges)
        read = np.column_stack([measurement.readings.values[name] for name in columns])
        super().__init__(measurement, WRENCH, columns, imposed_loads(measurement), read)

    def _slope(self, posture: str) -> Array:
        """Compliance ``(m, 6)``; see `Comparison`."""
        m = self.measurement
        table = load_table(
            ModifiedChain(m.chain, m.engine), HalfRay.of(posture, np.eye(6)[0], SMALL), (), m.free, self.gauges
        )
        result: Array = table.compliance[0]
        return result
