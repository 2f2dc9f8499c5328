"""A disc spring in the drive snaps through at a force, and back again."""

from dataclasses import dataclass

import numpy as np

from vjm_updating.mechanisms.effect import Effect, Quantity, drive
from vjm_updating.mechanisms.series_elements import SeriesElement, memoryless


@dataclass(frozen=True)
class SnapThrough(Effect):
    """Around a force the drive slips by a distance; below and above it is stiff."""

    cause = "snap_through"
    title = "a disc spring in the drive snaps through"

    def quantities(self):
        return (
            Quantity("distance_mm", 0.0, 1.0, 0.02, neutral=0.0),
            Quantity("force_N", 100.0, 1e4, 500.0),
            Quantity("width_N", 10.0, 1e3, 50.0),
        )

    def trials(self):
        return [(0.02, force, 100.0) for force in (500.0, 1000.0, 2000.0, 4000.0)]

    def elements(self, machine, values):
        distance, force, width = values

        def law(N):
            way = np.tanh((np.abs(N) - force) / width)
            start = np.tanh(-force / width)
            return np.sign(N) * distance / 2 * (way - start), distance / (2 * width) * (1 - way**2)

        return (SeriesElement(drive(machine), memoryless(law)),)


def effects(scene):
    """What the file offers."""
    return [SnapThrough()]
