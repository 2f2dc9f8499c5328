"""Errors of the instruments, as nuisances within the sheet's tolerances and as causes.

A reading is ``(1 + scale) · true + zero + noise``; a cause may also drift with the clock or the temperature.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import prior_scale
from vjm_updating.experiment import Kind
from vjm_updating.experiment.data_file import POSE, WRENCH, unit_of
from vjm_updating.mechanisms.effect import Effect, Quantity

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

        ``values`` are zeros in the channel's unit and relative scale errors; ``slots`` has the displacement's
        component by channel.
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
        return (read - self.zero_u) / self.gain_u

    def reading(self, wrench: Array) -> Array:
        """Readings ``(n, m)`` of true wrenches, noise aside."""
        return self.gain * wrench + self.zero

    def residual(self, read: Array, wrench: Array) -> Array:
        """Readings ``(n, m)`` less those of a model's wrenches; zero where there is no reading, nan."""
        return np.where(np.isnan(read), 0.0, read - self.reading(wrench))


UNIT = {"mm": 0.01, "rad": 1e-4, "N": 10.0, "Nmm": 1000.0}
"""Sizes that matter by unit."""
MOST_DRIFT, LEVER = prior_scale(0.02), prior_scale(100.0)
"""Standard deviation of a drift over a test as a share of the largest reading, ten times what data sheets say of
transducers; and the lever, mm, that makes a range of moments of one of forces."""
USUAL_LAG = prior_scale(30.0)
"""Time constant, s, that a gauge's temperature has behind the room's, in order of magnitude."""


def size_of(channel: str) -> float:
    """A zero error that matters."""
    return UNIT[unit_of(channel)]


@dataclass(frozen=True)
class InstrumentZero(Effect):
    """A constant error of a channel beyond its sheet value."""

    part: str = "fx_N"
    cause = "instrument_zero"
    exact = True
    title = "a constant error of a channel beyond its sheet value"


@dataclass(frozen=True)
class InstrumentScale(Effect):
    """A scale error of a channel beyond its sheet value."""

    part: str = "fx_N"
    cause = "instrument_scale"
    exact = True
    title = "a scale error of a channel beyond its sheet value"


@dataclass(frozen=True)
class ThermalDrift(Effect):
    """A reading that follows the clock or the temperature.

    Attributes:
        by: ``K`` or ``s``.
        span: of the temperature or the clock during the test.
        since: what the clock shows at the first reading, in spans.
        duration: of the test, s; zero where no clock says how far a reading may lag behind the temperature.
        largest: reading that the gauge is made for, in the channel's unit.
    """

    part: str = "fx_N"
    by: str = "s"
    span: float = 1.0
    since: float = 0.0
    duration: float = 0.0
    largest: float = float("inf")
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
        """Change of the reading; since when, in spans, for it may have gone on before the test; its lag.

        A clock ran from the first reading at the latest. A gauge may be right at a temperature within the test's,
        and grows as warm as the room only after a time of its own.
        """
        size = size_of(self.part) / self.span
        usual = MOST_DRIFT * self.largest / self.span
        low, half = 0.0 if self.by == "s" else -4.0, 0.5 * self.since
        without_lag = (
            Quantity(f"{self.part}.per_{self.by}", -1e4 * size, 1e4 * size, size, neutral=0.0, spread=usual),
            # somewhere between the clock's zero and the first reading
            Quantity("before_share", low, 4.0 + self.since, 1.0, usual=half, spread=1.0 + half),
        )
        if not self._lags:
            return without_lag
        return (*without_lag, Quantity("lag_s", 0.0, self.duration, 5.0, usual=0.0, spread=USUAL_LAG))

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Upwards, from the first reading on and from before; downwards is the same but for the sign."""
        size = size_of(self.part) / self.span
        at_once = (0.0,) if self._lags else ()
        return [(size, 0.0, *at_once), (size, max(self.since, 1.0), *at_once)]

    def course(self, warmth: Array | None, clock: Array | None, values: Sequence[float]) -> Array:
        """What drift adds to the reading ``(n,)``.

        ``warmth`` (n,) is the room's since the first reading, K, ``clock`` (n,) likewise, s; None where no drift
        follows it, and none lags.
        """
        by = warmth if self.by == "K" else clock
        assert by is not None
        if self._lags:
            assert clock is not None
            by = lagging(by, clock, values[2])
        return values[0] * (by + values[1] * self.span)

    @property
    def _lags(self) -> bool:
        return self.by == "K" and self.duration > 0.0


def lagging(warmth: Array, clock: Array, lag: float) -> Array:
    """The temperature ``(n,)`` of what warms with a time constant, in equilibrium at first.

    The room's temperature goes straight from one reading to the next; θ' = (T − θ)/τ has then the exact solution
    that is summed here. ``warmth`` (n,) is the room's, K, ``clock`` (n,) is in s; the time constant τ is ``lag``,
    s, not negative.
    """
    if lag <= 0.0:
        return warmth
    felt = np.empty_like(warmth)
    behind = 0.0
    steps, rises = (np.diff(values, prepend=values[0]) for values in (clock, warmth))
    for k, (step, rise) in enumerate(zip(steps, rises, strict=True)):
        # what it is behind decays, and grows by what the room warms meanwhile
        left = np.exp(-step / lag)
        gained = rise * lag / step * -np.expm1(-step / lag) if step > 0.0 else rise
        behind = behind * left + gained
        felt[k] = warmth[k] - behind
    return felt
