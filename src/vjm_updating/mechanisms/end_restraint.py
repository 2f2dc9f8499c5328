"""Pins of a column that resist turning: knife edges that bind, fixtures that clamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm_updating.constants import physical_bound
from vjm_updating.mechanisms.effect import Effect, Quantity

CLAMPED = physical_bound(100.0)
"""Stiffness over EI/L from which a pin is as good as clamped: the critical load is then 4 % below."""


@dataclass(frozen=True)
class EndRestraint(Effect):
    """A rotational spring at each pin, from free to clamped.

    Attributes:
        flexural: EI/L of the column, N mm per rad.
    """

    flexural: float = 1.0
    cause = "end_restraint"
    title = "the column's pins resist turning"

    def quantities(self) -> tuple[Quantity, ...]:
        """Its stiffness."""
        unit = 0.1 * self.flexural
        return (Quantity("stiffness_Nmm_per_rad", 0.0, CLAMPED * self.flexural, unit, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Those that raise the critical load by some 8 and 60 per cent."""
        return [(share * self.flexural,) for share in (0.2, 2.0)]
