"""Readings beside the nominal machine's prediction, and what a rule finds implausible about them."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.experiment.measurement import Measurement
from vjm_updating.experiment.nominal_curve import NominalCurves

FEW = 5
"""Readings on each side of a change."""
CLEAR = 20.0
"""Root mean square of a prediction over the noise of its channel from which on its sign is judged."""

FOLLOWS = 0.95
"""Correlation about zero of a channel with its prediction from which on it follows it."""


class Comparison:
    """Readings beside the nominal machine's prediction.

    Attributes:
        measurement: sheet, readings, machine.
        readings: its readings.
        labels: postures in the order of the file.
        curves: wrenches of the nominal machine.
    """

    def __init__(self, measurement: Measurement) -> None:
        self.measurement, self.readings = measurement, measurement.readings
        self.labels: list[str] = list(dict.fromkeys(self.readings.posture.tolist()))
        self.curves = NominalCurves(measurement)

    @property
    def comparable(self) -> bool:
        """Whether displacements of the end-effector and wrenches were read."""
        return self.measurement.imposed and any(name in self.readings.values for name in WRENCH)

    def at(self, label: str) -> np.ndarray:
        """Indices of the readings of a posture whose displacement is known."""
        return np.flatnonzero((self.readings.posture == label) & ~np.isnan(self.readings.pose).any(axis=1))

    def predicted(self, label: str) -> Array:
        """Wrenches ``(k, 6)`` of the nominal machine at the readings of `at`; nan where it does not go."""
        result: Array = self.curves.wrench(only=label)[self.at(label)]
        return result

    def agreement(self, label: str, name: str) -> float:
        """Correlation about zero of a channel with its prediction, 0 where one of them is small, ±1 at most.

        It is 0, too, where their sizes differ by more than a factor 2.
        """
        at, k = self.at(label), WRENCH.index(name)
        f, g = self.readings.wrench[at, k], self.predicted(label)[:, k]
        known = ~np.isnan(f) & ~np.isnan(g)
        a, b = (float(np.linalg.norm(v[known])) for v in (f, g))
        rms = b / np.sqrt(max(int(known.sum()), 1))
        if int(known.sum()) < 2 * FEW or not 0.5 < a / max(b, 1e-300) < 2.0:
            return 0.0
        if rms < CLEAR * self.measurement.sheet.sigma(name).noise:
            return 0.0
        return correlation(f, g)

    def slopes(self, name: str) -> list[float]:
        """A channel over its prediction in every posture where that is large and the channel follows it."""
        k, noise, found = WRENCH.index(name), self.measurement.sheet.sigma(name).noise, []
        for label in self.labels:
            f, g = self.readings.wrench[self.at(label), k], self.predicted(label)[:, k]
            known = ~np.isnan(f) & ~np.isnan(g)
            square = float(g[known] @ g[known])
            large = square > 0.0 and np.sqrt(square / known.sum()) > CLEAR * noise
            if large and known.sum() >= 2 * FEW and correlation(f, g) > FOLLOWS:
                found.append(float(f[known] @ g[known]) / square)
        return found

    def expected(self, name: str) -> bool:
        """Whether the model predicts a change of a channel of the wrench far above its noise."""
        if not self.comparable:
            return False
        k, noise = WRENCH.index(name), self.measurement.sheet.sigma(name).noise
        spans = [
            float(np.nanmax(g) - np.nanmin(g))
            for label in self.labels
            if len(g := self.predicted(label)[:, k]) and not np.isnan(g).all()
        ]
        return max(spans, default=0.0) > CLEAR * max(noise, 1e-12)


def correlation(a: Array, b: Array) -> float:
    """Correlation about zero of what is known of both; 0 where there is none."""
    known = ~np.isnan(a) & ~np.isnan(b)
    size = float(np.linalg.norm(a[known]) * np.linalg.norm(b[known]))
    return float(a[known] @ b[known]) / size if size > 0.0 else 0.0
