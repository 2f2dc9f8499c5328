"""What is done to a chain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Components of the end-effector's displacement from its unloaded pose, world axes; mm and rad."""


@dataclass(frozen=True)
class Programme:
    """A straight ramp of the end-effector's displacement, the rest of the pose held.

    Attributes:
        posture: label of the posture to start from, unloaded.
        to: end of the ramp, signed, in mm or rad.
        axis: the driven component, one of `COMPONENTS`, or a displacement ``(6,)`` per unit of ``to``.
        steps: number of equal steps; None where the engine chooses, finer around critical points. Behind a
            bifurcation there is a point besides, where the new branch begins, and more where a step fails.
        branch: +1 or −1: which of two mirrored branches to take at a bifurcation. On +1 the largest component
            of the buckling mode's deflection is positive.
    """

    posture: str
    to: float
    axis: str | tuple[float, ...] = "x"
    steps: int | None = None
    branch: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.axis, str):
            object.__setattr__(self, "axis", tuple(self.axis))
        if isinstance(self.axis, str):
            if self.axis not in COMPONENTS:
                raise ValueError(f"axis '{self.axis}' is none of {', '.join(COMPONENTS)}")
        elif len(self.axis) != 6 or not np.all(np.isfinite(self.axis)) or not any(self.axis):
            raise ValueError("a ramp's direction is six finite numbers, not all zero")
        if not np.isfinite(self.to) or self.to == 0.0:
            raise ValueError(f"the ramp must end at a finite displacement other than zero, not {self.to}")
        if self.steps is not None and self.steps < 1:
            raise ValueError(f"a ramp needs at least one step, not {self.steps}")
        if self.branch not in (1, -1):
            raise ValueError(f"branch is +1 or -1, not {self.branch}")

    @property
    def direction(self) -> Array:
        """Displacement ``(6,)`` per unit of the path parameter, which runs from 0 to ``abs(to)``.

        Its product with the wrench is the driven force, positive where the chain resists the ramp.
        """
        d = np.eye(6)[COMPONENTS.index(self.axis)] if isinstance(self.axis, str) else np.array(self.axis)
        return np.sign(self.to) * d

    def displacement(self, s: float) -> Array:
        """Displacement ``(6,)`` of the end-effector at the path parameter ``s``, mm, rad, world axes."""
        return s * self.direction + 0.0  # no negative zeros

    @property
    def length(self) -> float:
        """End of the path parameter, positive."""
        return abs(self.to)
