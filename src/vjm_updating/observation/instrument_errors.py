"""Zero and scale errors of the instruments: a reading is ``(1 + scale) · true + zero + noise``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment import Kind
from vjm_updating.experiment.channels import POSE, WRENCH

SLOTS: Mapping[str, int] = {name: k for k, name in enumerate(POSE)}
"""Which component of the displacement each of the end-effector's channels reads."""


@dataclass(frozen=True)
class InstrumentErrors:
    """Errors of the displacement's and the wrench's channels, constant through a test.

    Attributes:
        zero_u: zeros of the displacement's channels ``(6,)``, mm, rad.
        gain_u: one plus their scale errors ``(6,)``.
        zero: zeros of the wrench's channels ``(6,)``, N, N mm.
        gain: one plus their scale errors ``(6,)``.
    """

    zero_u: Array
    gain_u: Array
    zero: Array
    gain: Array

    @classmethod
    def of(cls, values: Mapping[tuple[str, str], float], slots: Mapping[str, int] = SLOTS) -> InstrumentErrors:
        """From errors by kind and channel; whatever else there is of other kinds or channels has no say.

        Args:
            values: zeros in the channel's unit and relative scale errors, by (kind, channel).
            slots: component of the displacement by channel.
        """

        def errors(kind: Kind, channels: Mapping[str, int]) -> Array:
            result = np.zeros(6)
            for channel, k in channels.items():
                result[k] = values.get((kind, channel), 0.0)
            return result

        forces = {name: k for k, name in enumerate(WRENCH)}
        return cls(
            errors(Kind.ZERO, slots),
            1.0 + errors(Kind.SCALE, slots),
            errors(Kind.ZERO, forces),
            1.0 + errors(Kind.SCALE, forces),
        )

    def true_displacement(self, read: Array) -> Array:
        """Displacements ``(n, 6)`` from their readings, noise aside."""
        result: Array = (read - self.zero_u) / self.gain_u
        return result

    def reading(self, wrench: Array) -> Array:
        """Readings ``(n, 6)`` of true wrenches, noise aside."""
        result: Array = self.gain * wrench + self.zero
        return result

    def residual(self, read: Array, wrench: Array) -> Array:
        """Readings ``(n, 6)`` less those of a model's wrenches; zero where there is no reading, nan."""
        return np.where(np.isnan(read), 0.0, read - self.reading(wrench))
