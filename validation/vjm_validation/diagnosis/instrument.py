"""Causes that lie in the instruments: zero errors, scale errors, drift with the clock or the temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm.effects.effect import Effect, Quantity
from vjm_validation.measurement.channels import split_point

UNIT = {"mm": 0.01, "rad": 1e-4, "N": 10.0, "Nmm": 1000.0}
"""Sizes that matter by unit."""


def size_of(channel: str) -> float:
    """A zero error that matters."""
    return UNIT[split_point(channel)[1].rpartition("_")[2]]


@dataclass(frozen=True)
class InstrumentZero(Effect):
    """A constant error of a channel beyond its sheet value.

    Attributes:
        part: the channel.
    """

    part: str = "fx_N"
    cause = "instrument_zero"
    title = "a constant error of a channel beyond its sheet value"


@dataclass(frozen=True)
class InstrumentScale(Effect):
    """A scale error of a channel beyond its sheet value.

    Attributes:
        part: the channel.
    """

    part: str = "fx_N"
    cause = "instrument_scale"
    title = "a scale error of a channel beyond its sheet value"


@dataclass(frozen=True)
class ThermalDrift(Effect):
    """A reading that follows the clock or the temperature.

    Attributes:
        part: the channel.
        by: ``K`` or ``s``.
        span: of the temperature or the clock during the test.
        since: what the clock shows at the first reading, in spans.
    """

    part: str = "fx_N"
    by: str = "s"
    span: float = 1.0
    since: float = 0.0
    cause = "thermal_drift"
    title = "the reading follows the clock or the temperature, not the load"

    @property
    def label(self) -> str:
        """Cause, channel and what it follows."""
        return f"{self.cause}.{self.part}.per_{self.by}"

    @property
    def contains(self) -> tuple[str, ...]:
        """A drift that ended before the test began."""
        return ("instrument_zero",)

    def quantities(self) -> tuple[Quantity, ...]:
        """Change of the reading; and since when, in spans, for it may have gone on before the test.

        A clock ran from the first reading at the latest; a gauge may be right at a temperature within the test's.
        """
        size = size_of(self.part) / self.span
        low, half = 0.0 if self.by == "s" else -4.0, 0.5 * self.since
        return (
            Quantity(f"{self.part}.per_{self.by}", -1e4 * size, 1e4 * size, size, neutral=0.0),
            # somewhere between the clock's zero and the first reading
            Quantity("before_share", low, 4.0 + self.since, 1.0, usual=half, spread=1.0 + half),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Upwards, from the first reading on and from before; downwards is the same but for the sign."""
        size = size_of(self.part) / self.span
        return [(size, 0.0), (size, max(self.since, 1.0))]
