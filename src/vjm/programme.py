"""What is done to a chain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Components of the end-effector's displacement from its unloaded pose, world axes; mm and rad."""


@dataclass(frozen=True)
class Programme:
    """A ramp of one component of the end-effector's displacement, the rest of the pose held.

    Attributes:
        posture: label of the posture to start from, unloaded.
        to: end of the ramp, signed, in mm or rad.
        axis: the driven component, one of `COMPONENTS`.
        steps: number of equal steps; None where the engine chooses, finer around critical points.
        branch: +1 or −1: which of two mirrored branches to take at a bifurcation. On +1 the largest component
            of the buckling mode's deflection is positive.
    """

    posture: str
    to: float
    axis: str = "x"
    steps: int | None = None
    branch: int = 1

    def __post_init__(self) -> None:
        if self.axis not in COMPONENTS:
            raise ValueError(f"axis '{self.axis}' is none of {', '.join(COMPONENTS)}")
        if not np.isfinite(self.to) or self.to == 0.0:
            raise ValueError(f"the ramp must end at a finite displacement other than zero, not {self.to}")
        if self.steps is not None and self.steps < 1:
            raise ValueError(f"a ramp needs at least one step, not {self.steps}")
        if self.branch not in (1, -1):
            raise ValueError(f"branch is +1 or -1, not {self.branch}")

    @property
    def component(self) -> int:
        """Index of the driven component in a displacement or wrench."""
        return COMPONENTS.index(self.axis)

    @property
    def direction(self) -> Array:
        """Displacement ``(6,)`` per unit of the path parameter, which runs from 0 to ``abs(to)``."""
        d = np.zeros(6)
        d[self.component] = np.sign(self.to)
        return d

    @property
    def length(self) -> float:
        """End of the path parameter, positive."""
        return abs(self.to)
