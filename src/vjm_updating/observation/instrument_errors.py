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
        zero: zeros of the channels that were read ``(m,)``, of a wrench N, N mm.
        gain: one plus their scale errors ``(m,)``.
        columns: names of the channels that were read, m.
    """

    zero_u: Array
    gain_u: Array
    zero: Array
    gain: Array
    columns: tuple[str, ...] = WRENCH

    @classmethod
    def of(
        cls,
        values: Mapping[tuple[str, str], float],
        slots: Mapping[str, int] = SLOTS,
        columns: tuple[str, ...] = WRENCH,
    ) -> InstrumentErrors:
        """From errors by kind and channel; whatever else there is of other kinds or channels has no say.

        Args:
            values: zeros in the channel's unit and relative scale errors, by (kind, channel).
            slots: component of the displacement by channel.
            columns: names of the channels that were read, m.
        """

        def errors(kind: Kind, channels: Mapping[str, int], count: int) -> Array:
            result = np.zeros(count)
            for channel, k in channels.items():
                result[k] = values.get((kind, channel), 0.0)
            return result

        read = {name: k for k, name in enumerate(columns)}
        return cls(
            errors(Kind.ZERO, slots, 6),
            1.0 + errors(Kind.SCALE, slots, 6),
            errors(Kind.ZERO, read, len(columns)),
            1.0 + errors(Kind.SCALE, read, len(columns)),
            columns,
        )

    def true_displacement(self, read: Array) -> Array:
        """Displacements ``(n, 6)`` from their readings, noise aside."""
        result: Array = (read - self.zero_u) / self.gain_u
        return result

    def reading(self, wrench: Array) -> Array:
        """Readings ``(n, m)`` of true wrenches, noise aside."""
        result: Array = self.gain * wrench + self.zero
        return result

    def residual(self, read: Array, wrench: Array) -> Array:
        """Readings ``(n, m)`` less those of a model's wrenches; zero where there is no reading, nan."""
        return np.where(np.isnan(read), 0.0, read - self.reading(wrench))
