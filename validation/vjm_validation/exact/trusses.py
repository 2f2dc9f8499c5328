"""The shallow two-bar truss: whole load paths in algebra.

Any consistent units: mm, N, rad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class LimitPoint:
    """A point of a load path where load or displacement turns.

    Attributes:
        displacement: of the loaded or driven point, mm.
        load: N.
        apex: displacement of the truss's apex there, mm.
    """

    displacement: float
    load: float
    apex: float


@dataclass(frozen=True)
class TwoBarTruss:
    """Von Mises's truss: two equal bars from level supports to an apex, pinned at all three.

    The bars are linear in the engineering strain, N = EA (l − l₀)/l₀. With the apex lowered by v, y = h − v and
    l = √(b² + y²), the dead load on the apex is P = 2 EA y (1/l − 1/l₀) (von Mises, *ZAMM* 3, 1923). The bars
    do not buckle, and the apex stays on the axis of symmetry.

    Attributes:
        half_span: b, mm.
        height: h of the apex above its supports, mm.
        EA: axial stiffness of a bar, N.
    """

    half_span: float
    height: float
    EA: float

    def __post_init__(self) -> None:
        for name in ("half_span", "height", "EA"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"two-bar truss: {name} is {getattr(self, name)}: it must be above 0")

    @property
    def bar_length(self) -> float:
        """l₀, mm."""
        return float(np.hypot(self.half_span, self.height))

    def load(self, apex: float) -> float:
        """P in N, downwards, that holds the apex lowered by ``apex`` mm."""
        y = self.height - apex
        return float(2.0 * self.EA * y * (1.0 / np.hypot(self.half_span, y) - 1.0 / self.bar_length))

    def driven(self, apex: float, spring: float) -> float:
        """Displacement d = v + P(v)/k in mm of a drive that holds the apex, lowered by v, through a spring.

        Args:
            apex: v, mm.
            spring: k, N/mm.

        Raises:
            ValueError: the spring is not above 0.
        """
        if not spring > 0.0:
            raise ValueError(f"spring is {spring} N/mm: it must be above 0")
        return apex + self.load(apex) / spring

    def limit_points(self) -> tuple[LimitPoint, LimitPoint]:
        """Greatest and least load, in the order in which the sinking apex meets them.

        dP/dv = 0 where l³ = b² l₀.
        """
        first, second = self._turns(0.0)
        return first, second

    def snap_back_points(self, spring: float) -> tuple[LimitPoint, LimitPoint] | None:
        """Where the driven displacement d = v + P/k turns, with a spring between drive and apex.

        dd/dv = 0 where l³ = b²/(1/l₀ + k/2EA). Between the two points d falls while the apex sinks. None where the
        spring is stiff enough, k ≥ 2 EA (1/b − 1/l₀), that d always grows.

        Args:
            spring: k, N/mm.

        Raises:
            ValueError: the spring is not above 0.
        """
        if not spring > 0.0:
            raise ValueError(f"spring is {spring} N/mm: it must be above 0")
        if spring >= 2.0 * self.EA * (1.0 / self.half_span - 1.0 / self.bar_length):
            return None
        first, second = (
            LimitPoint(self.driven(point.apex, spring), point.load, point.apex) for point in self._turns(spring)
        )
        return first, second

    def sideways_load(self) -> float:
        """Least P in N, downwards, at which the apex is free to leave the axis of symmetry, l = √(b² + y²).

        With the spring b²/l² EA/l₀ of a bar's stretch and the pull N y²/l³ of its force the stiffness sideways is
        zero: b²/l₀ + (1/l₀ − 1/l) y² = 0.

        Raises:
            ValueError: the truss is too flat, and snaps through without.
        """

        def stiffness(y: float) -> float:
            length = np.hypot(self.half_span, y)
            return float(self.half_span**2 / self.bar_length + (1.0 / self.bar_length - 1.0 / length) * y**2)

        heights = np.linspace(self.height, 0.0, 1001)
        lost = [i for i, y in enumerate(heights) if stiffness(float(y)) < 0.0]
        if not lost:
            raise ValueError(f"{self}: the apex of so flat a truss is stiff sideways all the way down")
        y = brentq(stiffness, heights[lost[0]], heights[lost[0] - 1], xtol=1e-13)
        return self.load(self.height - float(y))

    def _turns(self, spring: float) -> tuple[LimitPoint, LimitPoint]:
        """Where the path's slope dP/dv is minus the spring's stiffness."""
        bar = (self.half_span**2 / (1.0 / self.bar_length + 0.5 * spring / self.EA)) ** (1.0 / 3.0)
        above = float(np.sqrt(bar**2 - self.half_span**2))
        first, second = (
            LimitPoint(self.height - y, self.load(self.height - y), self.height - y) for y in (above, -above)
        )
        return first, second
