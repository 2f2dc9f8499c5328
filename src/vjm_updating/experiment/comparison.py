"""Readings beside the nominal machine's prediction: what rules of plausibility look at."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale, stated_level
from vjm_updating.experiment.channels import unit_of
from vjm_updating.experiment.measured import Measurement
from vjm_updating.experiment.mistaken_as import RIGHT, MistakenAs
from vjm_updating.observation.significance import level

FEW = numerical(5)
"""Readings on each side of a change."""
CLEAR = stated_level(20.0)
"""Size of a prediction over its noise, see `Comparison.noise`, from which on a ratio or a sign is judged."""

MISSED = prior_scale(0.35)
"""Logarithm of a machine's forces over those of its model, where it is not as its sheet promises."""
DIFFERS = stated_level(level(1) * MISSED)
"""Logarithm of a factor beyond which forces are not those of a machine that differs from its model."""


class Comparison(ABC):
    """Readings beside the prediction by the unloaded machine's slope; a kind of test may know a better one.

    Attributes:
        words: what was read, in a word.
        measurement: sheet, readings, machine.
        readings: its readings.
        labels: postures in the order of the file.
        given: columns of what was imposed, i: displacements, or loads.
        columns: of what was read, m: the wrench, or displacements.
        imposed: what was ``(n, i)``.
        read: what was ``(n, m)``; nan where there is no reading.
        unit: ``(m,)`` what makes moments forces, or rotations displacements.
    """

    words = "forces"

    def __init__(
        self,
        measurement: Measurement,
        given: tuple[str, ...],
        columns: tuple[str, ...],
        imposed: Array,
        read: Array,
    ) -> None:
        self.measurement, self.readings = measurement, measurement.readings
        self.labels: list[str] = list(dict.fromkeys(self.readings.posture.tolist()))
        self.given, self.columns, self.imposed, self.read = given, columns, imposed, read
        length = measurement.chain.characteristic_length
        lever = {"Nmm": 1.0 / length, "rad": length}
        self.unit = np.array([lever.get(unit_of(name), 1.0) for name in columns])
        self.slope = lru_cache(maxsize=None)(self._slope)

    @abstractmethod
    def _slope(self, posture: str) -> Array:
        """Derivative ``(m, i)`` of what is read by what is imposed, unloaded.

        Raises:
            NoConvergenceError: the nominal machine does not stand in the posture.
            ValueError: what is free makes it a mechanism.
        """

    def linear(self, way: MistakenAs = RIGHT, only: str = "") -> Array:
        """What the nominal machine would show ``(n, m)`` by its slope; nan where it is not known what was imposed.

        Args:
            way: in which readings may be mistaken: what was imposed is put right before.
            only: label of the posture that is wanted; all by default.
        """
        imposed, result = way.put_right(self.imposed, self.given), np.full(self.read.shape, np.nan)
        for label in self.labels if not only else [only]:
            at = self.readings.posture == label
            result[at] = imposed[at] @ self.slope(way.postures.get(label, label)).T
        return result

    def predicted(self, way: MistakenAs = RIGHT, only: str = "") -> Array:
        """The best prediction of this kind of test; see `linear`."""
        return self.linear(way, only)

    @property
    def of_joint(self) -> bool:
        """Whether one joint was tested."""
        return self.measurement.sheet.kind == "joint"

    @property
    def main(self) -> list[int]:
        """Which of what was read are forces, of a test by force displacements; all where none is."""
        found = [k for k, name in enumerate(self.columns) if unit_of(name) in ("N", "mm")]
        return found or list(range(len(self.columns)))

    @property
    def comparable(self) -> bool:
        """Whether what was imposed is known, and something was read."""
        known = self.of_joint or self.measurement.loaded or self.measurement.imposed
        return known and any(name in self.readings.values for name in self.columns)

    def at(self, label: str) -> np.ndarray:
        """Indices of the readings of a posture of which it is known what was imposed."""
        return np.flatnonzero((self.readings.posture == label) & ~np.isnan(self.imposed).any(axis=1))

    def pairs(self, predicted: Array) -> Iterator[tuple[str, Array, Array]]:
        """By the name of its column what was read beside a prediction ``(n, m)``, where both are known."""
        for k, name in enumerate(self.columns):
            known = ~np.isnan(self.read[:, k]) & ~np.isnan(predicted[:, k])
            if known.any():
                yield name, self.read[known, k], predicted[known, k]

    def noise(self, name: str) -> float:
        """Of a channel beside its prediction, standard deviation: its own, and what is made of that of the given.

        A stiff machine feels that of a gauge on an axis which nobody drives. Of postures the largest counts.
        """
        sheet = self.measurement.sheet
        return float(
            np.hypot(sheet.sigma(name).noise, self._made(name, [sheet.errors(n).noise for n in self.given]))
        )

    def zero(self, name: str) -> float:
        """Likewise of the constant errors of a channel and of the given."""
        sheet = self.measurement.sheet
        return float(
            np.hypot(sheet.errors(name).zero, self._made(name, [sheet.errors(n).zero for n in self.given]))
        )

    def _made(self, name: str, errors: Sequence[float]) -> float:
        """The largest error of a channel's prediction by those of what was given."""
        k = self.columns.index(name)
        return max(float(np.linalg.norm(self.slope(label)[k] * np.array(errors))) for label in self.labels)

    def expected(self, name: str) -> bool:
        """Whether the model predicts a change of a channel that was read far above its noise."""
        if not self.comparable:
            return False
        predicted = self.predicted()[:, self.columns.index(name)]
        of_postures = (predicted[self.at(label)] for label in self.labels)
        spans = [float(np.nanmax(g) - np.nanmin(g)) for g in of_postures if not np.isnan(g).all()]
        return max(spans, default=0.0) > CLEAR * max(self.noise(name), 1e-12)


def machines(factor: float) -> bool:
    """Whether a machine may show so many times what its model predicts."""
    return factor > 0.0 and abs(np.log(factor)) < DIFFERS


def ratio_of(f: Array, g: Array) -> tuple[float, float, float]:
    """Quartiles of measured to predicted in the large half, which a few outliers do not move; all 1 without it."""
    large = (np.abs(g) >= np.median(np.abs(g))) & (g != 0.0)
    if not large.any():
        return 1.0, 1.0, 1.0
    low, middle, high = np.percentile(f[large] / g[large], [25.0, 50.0, 75.0])
    return float(low), float(middle), float(high)


def correlation(a: Array, b: Array) -> float:
    """Correlation about zero of what is known of both; 0 where there is none."""
    known = ~np.isnan(a) & ~np.isnan(b)
    size = float(np.linalg.norm(a[known]) * np.linalg.norm(b[known]))
    return float(a[known] @ b[known]) / size if size > 0.0 else 0.0
