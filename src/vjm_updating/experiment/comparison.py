"""Readings beside the nominal machine's prediction, and what a rule finds implausible about them."""

from __future__ import annotations

import numpy as np

from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.experiment.measurement import Measurement


class Comparison:
    """Readings beside the nominal machine's prediction.

    Attributes:
        measurement: sheet, readings, machine.
        readings: its readings.
        labels: postures in the order of the file.
        stiffness: unloaded ``(6, 6)`` by posture.
    """

    def __init__(self, measurement: Measurement) -> None:
        self.measurement, self.readings = measurement, measurement.readings
        self.labels: list[str] = list(dict.fromkeys(self.readings.posture.tolist()))
        engine, chain = measurement.engine, measurement.chain
        self.stiffness = {
            label: np.asarray(engine.problem(chain, LoadCase(label, 1.0)).unloaded().stiffness)
            for label in self.labels
        }

    @property
    def comparable(self) -> bool:
        """Whether displacements of the end-effector and wrenches were read."""
        return self.measurement.imposed and any(name in self.readings.values for name in WRENCH)

    def at(self, label: str) -> np.ndarray:
        """Indices of the readings of a posture whose displacement is known."""
        return np.flatnonzero((self.readings.posture == label) & ~np.isnan(self.readings.pose).any(axis=1))

    def predicted(self, at: np.ndarray, label: str, order: tuple[int, ...] = (0, 1, 2, 3, 4, 5)) -> Array:
        """Wrenches ``(k, 6)`` by a posture's stiffness, the columns of the displacement in another order."""
        result: Array = self.readings.pose[at][:, list(order)] @ self.stiffness[label].T
        return result

    def ratios(self, label: str) -> tuple[np.ndarray, Array]:
        """Forces along the prediction over it, at the larger half of the displacements: indices, ratios."""
        at = self.at(label)
        f, g = self.readings.wrench[at, :3], self.predicted(at, label)[:, :3]
        known = ~np.isnan(f)
        along, size = np.sum(np.where(known, f * g, 0.0), axis=1), np.sum(np.where(known, g * g, 0.0), axis=1)
        large = (size > 0.0) & (size >= np.median(size))
        return at[large], along[large] / size[large]

    def error(self, at: np.ndarray, predicted: Array) -> float:
        """Norm of what is measured less what is predicted ``(k, 6)``, over the prediction's; forces only."""
        f, g = self.readings.wrench[at, :3], predicted[:, :3]
        known = ~np.isnan(f)
        size = float(np.linalg.norm(g[known]))
        return float(np.linalg.norm((f - g)[known])) / size if size > 0.0 else float("inf")
