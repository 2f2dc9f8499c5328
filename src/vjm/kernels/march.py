"""What a march along a grid of displacements finds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.rotations import Array


class March(NamedTuple):
    """What a march along a grid found.

    Attributes:
        good: number of points that are stable equilibria.
        why: it ended there: ``unstable`` where the next point, which is given too, is an unstable equilibrium;
            empty at the grid's end.
        x: coordinates ``(g, n)``.
        wrench: ``(g, 6)``.
        stiffness: K^F ``(g, 6, 6)``.
        residual: scaled ``(g,)``.
        iterations: ``(g,)``.
    """

    good: int
    why: str
    x: Array
    wrench: Array
    stiffness: Array
    residual: Array
    iterations: np.ndarray
