"""An imposed displacement that does not point along the nominal axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import prior_scale
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene

USUAL = prior_scale(0.03, "rad")
"""rad; standard deviation of either angle: two degrees are seen by eye when a test is set up."""


@dataclass(frozen=True)
class LoadMisalignment(Effect):
    """The device that imposes the displacement is turned.

    Attributes:
        axis: unit vector of the driven axis.
        first: and of two directions across it
        second: the other.
    """

    axis: tuple[float, ...] = (1.0, 0.0, 0.0)
    first: tuple[float, ...] = (0.0, 1.0, 0.0)
    second: tuple[float, ...] = (0.0, 0.0, 1.0)
    cause = "load_misalignment"
    exact = True
    extent = 2
    title = "the imposed displacement does not point along the nominal axis"

    def quantities(self) -> tuple[Quantity, ...]:
        """Angles towards both directions across."""
        return tuple(
            Quantity(f"towards_{k}_rad", -0.5, 0.5, 0.01, neutral=0.0, spread=USUAL) for k in ("first", "second")
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Towards each and both; the force along the axis changes with the square."""
        return [(0.02, 0.0), (0.0, 0.02), (-0.02, 0.0), (0.0, -0.02), (0.1, 0.0), (0.0, 0.1)]

    def imposed(self, pose: Array, values: Sequence[float]) -> Array:
        """Shifts turned about the axis across."""
        a, b, c = np.array(self.axis), np.array(self.first), np.array(self.second)
        turn = np.cross(a, values[0] * b + values[1] * c)
        R = rotation_from_vector(turn)
        result = pose.copy()
        result[:, :3] = pose[:, :3] @ R.T
        return result

    def tilted(self, values: Sequence[float]) -> Array:
        """Unit vector ``(3,)`` along which the device really goes."""
        result: Array = self.imposed(np.array([[*self.axis, 0.0, 0.0, 0.0]]), values)[0, :3]
        return result

    def reported(self, values: Sequence[float], force: float) -> dict[str, float]:
        """Angle, and direction about the axis from the first direction across."""
        a, b = values
        return {
            f"{self.cause}.angle_rad": float(np.hypot(a, b)),
            f"{self.cause}.direction_rad": float(np.arctan2(b, a)),
        }


def effects(scene: Scene) -> list[Effect]:
    """About the axis along which the test goes."""
    x, y, z = (tuple(float(v) for v in np.roll(axis, scene.driven)) for axis in np.eye(3))
    return [LoadMisalignment(x, y, z)]
