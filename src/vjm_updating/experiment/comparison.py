"""Readings beside the nominal machine's prediction, and what a rule finds implausible about them."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, stated_level
from vjm_updating.experiment.channels import unit_of
from vjm_updating.experiment.joint_levers import NominalJoint
from vjm_updating.experiment.measurement import Measurement
from vjm_updating.experiment.nominal_curve import NominalCurves
from vjm_updating.experiment.nominal_loads import NominalLoads

FEW = numerical(5)
"""Readings on each side of a change."""
CLEAR = stated_level(20.0)
"""Root mean square of a prediction over its noise, see `Comparison.noise`, from which on its sign is judged."""


class Comparison:
    """Readings beside the nominal machine's prediction.

    Attributes:
        measurement: sheet, readings, machine.
        readings: its readings.
        labels: postures in the order of the file.
        curves: what the nominal machine would have shown.
        unit: ``(m,)`` what makes moments forces, or rotations displacements.
    """

    def __init__(self, measurement: Measurement) -> None:
        self.measurement, self.readings = measurement, measurement.readings
        self.labels: list[str] = list(dict.fromkeys(self.readings.posture.tolist()))
        self.curves: NominalJoint | NominalLoads | NominalCurves
        if self.of_joint:
            self.curves = NominalJoint(measurement)
        else:
            self.curves = NominalLoads(measurement) if measurement.loaded else NominalCurves(measurement)
        length = measurement.chain.characteristic_length
        lever = {"Nmm": 1.0 / length, "rad": length}
        self.unit = np.array([lever.get(unit_of(name), 1.0) for name in self.columns])

    @property
    def of_joint(self) -> bool:
        """Whether one joint was tested."""
        return self.measurement.sheet.kind == "joint"

    @property
    def given(self) -> tuple[str, ...]:
        """Columns of what was imposed: displacements, or loads."""
        return self.curves.given

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of what was read, m: the wrench, or displacements."""
        return self.curves.columns

    @property
    def read(self) -> Array:
        """What was read ``(n, m)``."""
        return self.curves.read

    @property
    def main(self) -> list[int]:
        """Which of what was read are forces, of a test by force displacements; all where none is."""
        found = [k for k, name in enumerate(self.columns) if unit_of(name) in ("N", "mm")]
        return found or list(range(len(self.columns)))

    @property
    def words(self) -> str:
        """What was read, in a word."""
        if self.of_joint:
            return "loads"
        return "displacements" if self.measurement.loaded else "forces"

    @property
    def comparable(self) -> bool:
        """Whether what was imposed is known, and something was read."""
        known = self.of_joint or self.measurement.loaded or self.measurement.imposed
        return known and any(name in self.readings.values for name in self.columns)

    def at(self, label: str) -> np.ndarray:
        """Indices of the readings of a posture of which it is known what was imposed."""
        return np.flatnonzero((self.readings.posture == label) & ~np.isnan(self.curves.imposed).any(axis=1))

    def predicted(self, label: str) -> Array:
        """What the nominal machine would show ``(k, m)`` at the readings of `at`; nan where it does not go."""
        result: Array = self.curves.predicted(only=label)[self.at(label)]
        return result

    def noise(self, name: str) -> float:
        """Of a channel beside its prediction, standard deviation: its own, and what is made of that of the given.

        A stiff machine feels that of a gauge on an axis which nobody drives. Of postures the largest counts.
        """
        k, sheet = self.columns.index(name), self.measurement.sheet
        given = np.array([sheet.instrument[n].noise if n in sheet.instrument else 0.0 for n in self.given])
        made = max(float(np.linalg.norm(self.curves.slope(label)[k] * given)) for label in self.labels)
        return float(np.hypot(sheet.sigma(name).noise, made))

    def expected(self, name: str) -> bool:
        """Whether the model predicts a change of a channel that was read far above its noise."""
        if not self.comparable:
            return False
        k, noise = self.columns.index(name), self.noise(name)
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
