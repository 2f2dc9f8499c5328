"""Kinds of joints between two markers, and the markers' axes."""

from __future__ import annotations

import numpy as np

from vjm.model.parts import PassiveJoint
from vjm.rotations import Array

REVOLUTE = (1, 1, 1, 1, 1, 0)
"""Turns about z of the markers."""
UNIVERSAL = (1, 1, 1, 1, 0, 0)
"""Keeps y of the first marker at right angles to z of the second: two revolute joints that cross."""
PRISMATIC = (0, 1, 1, 1, 1, 1)
"""Slides along x of the markers."""

PERPENDICULAR = 1e-9
"""Cosine below which two revolute axes in a row make a universal joint."""


def crossing(a: PassiveJoint, b: PassiveJoint) -> bool:
    """Whether two revolute axes in a row are at right angles, so that they make a universal joint."""
    return not (a.slides or b.slides) and abs(float(np.dot(a.axis, b.axis))) < PERPENDICULAR


def axes_with(axis: Array, column: int) -> Array:
    """A rotation ``(3, 3)`` with the unit vector ``axis`` as one of its columns."""
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    cyclic = [np.asarray(axis, dtype=float), side, np.cross(axis, side)]
    return np.column_stack([cyclic[(i - column) % 3] for i in range(3)])
