"""What a sequence of meshes says of the limit: observed order, extrapolated value, interval.

After Roache, *Verification and Validation in Computational Science and Engineering* (1998), chapter 5: three
meshes with a common ratio r give the order ``p = ln((c1 − c2)/(c2 − c3))/ln r``, the limit
``c3 + (c3 − c2)/(rᵖ − 1)``, and an interval of `SAFE` times what the extrapolation changed. Where no order can be
seen, the interval is `UNSEEN` times what the last meshes differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vjm.rotations import Array

SAFE, UNSEEN = 1.25, 3.0
LOWEST, HIGHEST = 0.7, 4.0
"""Orders that meshes have: a re-entrant corner makes twice its exponent (1.09 at 90°, a clamped edge about
1.4), smooth solutions of quadratic elements 4."""
CHANCE = 4.5
"""Order from which on two meshes agree by chance: irregular meshes come and go by some change."""
FLOOR = 1e-7
"""Scaled difference of meshes below which they agree."""


@dataclass(frozen=True)
class MeshLimit:
    """A compliance beyond the last mesh; scaled means over √(c_ii c_jj).

    Attributes:
        compliance: ``(6, 6)``.
        interval: half of it, ``(6, 6)``.
        order: observed ``(6, 6)``, NaN where none could be seen.
    """

    compliance: Array
    interval: Array
    order: Array

    @property
    def relative(self) -> float:
        """The largest half-width, scaled."""
        d = np.sqrt(np.diag(self.compliance))
        return float(np.max(self.interval / np.outer(d, d)))


def limit(sizes: Sequence[float], compliances: Sequence[Array]) -> MeshLimit:
    """Extrapolate from the last three meshes.

    Args:
        sizes: of the elements, mm, falling.
        compliances: ``(6, 6)`` on each mesh; three or more.
    """
    h = np.asarray(sizes[-3:], dtype=float)
    c1, c2, c3 = (np.asarray(one) for one in compliances[-3:])
    d = np.sqrt(np.diag(c3))
    scale = np.outer(d, d)
    near, far = (c3 - c2) / scale, (c2 - c1) / scale
    value, interval, order = c3.copy(), np.zeros((6, 6)), np.full((6, 6), np.nan)
    for i in range(6):
        for j in range(i, 6):
            v, half, p = _entry(near[i, j], far[i, j], h)
            value[i, j] = value[j, i] = c3[i, j] + v * scale[i, j]
            interval[i, j] = interval[j, i] = half * scale[i, j]
            order[i, j] = order[j, i] = p
    return MeshLimit(value, interval, order)


def _entry(near: float, far: float, h: NDArray[np.float64]) -> tuple[float, float, float]:
    """Change beyond the last mesh, half-width and order of one scaled entry."""
    size = max(abs(near), abs(far))
    if size < FLOOR:
        return 0.0, FLOOR, np.nan
    p = _order(near, far, h)
    if not LOWEST <= p <= CHANCE:
        # rising and falling by turns, slower or faster than anything known: the meshes only say how far apart
        return 0.0, UNSEEN * size, np.nan
    p = min(p, HIGHEST)
    change = near / ((h[1] / h[2]) ** p - 1.0)
    return change, max(SAFE * abs(change), FLOOR), p


def _order(near: float, far: float, h: NDArray[np.float64]) -> float:
    """Observed order of three meshes, whose ratios may differ a little; NaN where the changes have two signs."""
    if near == 0.0 or far / near <= 1.0:
        return np.nan
    p = np.log(far / near) / np.log(h[1] / h[2])
    for _ in range(30):
        q = np.log(((h[0] / h[1]) ** p - 1.0) / ((h[1] / h[2]) ** p - 1.0))
        p = max(0.1, (np.log(far / near) - q) / np.log(h[1] / h[2]))
    return float(p)
