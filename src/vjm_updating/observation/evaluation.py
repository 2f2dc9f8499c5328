"""A model at the readings of a test, and how its residuals change with the errors of the instruments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment import Kind
from vjm_updating.observation.instrument_errors import InstrumentErrors


@dataclass(frozen=True)
class Evaluation:
    """A model at n readings.

    Attributes:
        z: unknowns ``(n_z,)``.
        residual: reading minus prediction ``(n, 6)``, N, N mm; zero where there is no reading.
        wrench: of the machine ``(n, 6)``, N, N mm.
        stiffness: its derivative by the displacement ``(n, 6, 6)``.
        place: true displacements ``(n, 6)``, mm, rad.
        errors: of the instruments.
        exact: derivative ``(n, 6)`` of the residuals by the coordinate of an index, where a model knows it; None
            where it is to be differentiated.
    """

    z: Array
    residual: Array
    wrench: Array
    stiffness: Array
    place: Array
    errors: InstrumentErrors
    exact: Callable[[int], Array | None] | None = None

    @property
    def sensitivity(self) -> Array:
        """By how much residuals grow ``(n, 6, 6)`` with what the displacement's gauges read too much."""
        result: Array = self.errors.gain[:, None] * self.stiffness / self.errors.gain_u
        return result

    def slope(self, kind: str, channel: str, slots: Mapping[str, int]) -> Array:
        """Derivative ``(n, 6)`` of the residuals by a zero, in its unit, or by a scale error.

        Args:
            kind: `Kind.ZERO` or `Kind.SCALE`.
            channel: of the wrench or the displacement; residuals do not depend on others.
            slots: component of the displacement by channel.
        """
        result = np.zeros(self.wrench.shape)
        if channel in self.errors.columns:
            k = self.errors.columns.index(channel)
            result[:, k] = -1.0 if kind == Kind.ZERO else -self.wrench[:, k]
        elif channel in slots:
            k = slots[channel]
            result = self.sensitivity[:, :, k] * (1.0 if kind == Kind.ZERO else self.place[:, [k]])
        return result
