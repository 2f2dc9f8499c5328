"""Readings beside the nominal machine's prediction, and what a rule finds implausible about them."""

from __future__ import annotations

import numpy as np

from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.experiment.measurement import Measurement

FEW = 5
"""Readings on each side of a change."""
LEAST_SIGNAL = 5.0
"""Prediction over noise from which on one reading's ratio counts."""
CLEAR = 20.0
"""Root mean square of a prediction over the noise of its channel from which on its sign is judged."""


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

    def steps(self, label: str) -> tuple[np.ndarray, Array]:
        """Indices and ratios as `ratios`, of every reading whose prediction and measurement exceed the noise."""
        at = self.at(label)
        f, g = self.readings.wrench[at, :3], self.predicted(at, label)[:, :3]
        known = ~np.isnan(f)
        along, size = np.sum(np.where(known, f * g, 0.0), axis=1), np.sum(np.where(known, g * g, 0.0), axis=1)
        noise = [self.measurement.sheet.sigma(name).noise for name in WRENCH[:3] if name in self.readings.values]
        least = max(LEAST_SIGNAL * max(noise, default=0.0), 1e-3 * float(np.sqrt(size.max(initial=0.0))))
        large = (size > least**2) & (np.linalg.norm(np.where(known, f, 0.0), axis=1) > 0.2 * least)
        return at[large], along[large] / size[large]

    def agreement(self, label: str, name: str) -> float:
        """Correlation about zero of a channel with its prediction, 0 where one of them is small, ±1 at most.

        It is 0, too, where their sizes differ by more than a factor 2.
        """
        at, k = self.at(label), WRENCH.index(name)
        f, g = self.readings.wrench[at, k], self.predicted(at, label)[:, k]
        known = ~np.isnan(f)
        a, b = (float(np.linalg.norm(v[known])) for v in (f, g))
        rms = b / np.sqrt(max(int(known.sum()), 1))
        if int(known.sum()) < 2 * FEW or not 0.5 < a / max(b, 1e-300) < 2.0:
            return 0.0
        if rms < CLEAR * self.measurement.sheet.sigma(name).noise:
            return 0.0
        return float(f[known] @ g[known]) / (a * b)

    def expected(self, name: str) -> bool:
        """Whether the model predicts a change of a channel of the wrench far above its noise."""
        if not self.comparable:
            return False
        k, noise = WRENCH.index(name), self.measurement.sheet.sigma(name).noise
        spans = [
            float(np.ptp(self.predicted(self.at(label), label)[:, k]))
            for label in self.labels
            if len(self.at(label))
        ]
        return max(spans, default=0.0) > CLEAR * max(noise, 1e-12)

    def error(self, at: np.ndarray, predicted: Array) -> float:
        """Norm of what is measured less what is predicted ``(k, 6)``, over the prediction's; forces only."""
        f, g = self.readings.wrench[at, :3], predicted[:, :3]
        known = ~np.isnan(f)
        size = float(np.linalg.norm(g[known]))
        return float(np.linalg.norm((f - g)[known])) / size if size > 0.0 else float("inf")
