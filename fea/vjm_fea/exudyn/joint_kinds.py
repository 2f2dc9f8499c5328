"""Kinds of joints between two markers, and the markers' axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.model.joints import Joint
from vjm.model.laws import Law
from vjm.rotations import Array
from vjm_fea.exudyn.matrix_spring import is_coupled

REVOLUTE = (1, 1, 1, 1, 1, 0)
"""Turns about z of the markers."""
UNIVERSAL = (1, 1, 1, 1, 0, 0)
"""Keeps y of the first marker at right angles to z of the second: two revolute joints that cross."""
PRISMATIC = (0, 1, 1, 1, 1, 1)
"""Slides along x of the markers."""

PERPENDICULAR = 1e-9
"""Cosine below which two revolute axes in a row make a universal joint."""


@dataclass(frozen=True)
class ElementarySpring:
    """One direction in which a joint deflects, behind those before it.

    Attributes:
        axis: unit vector ``(3,)`` in the chain frame.
        slides: along it; else it turns about it.
        compliance: mm/N or rad/(N mm).
        stretch: coordinate at which it is free of stress.
        law: of its force, in place of the compliance.
    """

    axis: Array
    slides: bool
    compliance: float
    stretch: float = 0.0
    law: Law | None = None


def elementary_springs(joint: Joint) -> list[ElementarySpring]:
    """What deflects in a joint one direction after the other, its own last.

    Of a 6×6 compliance it is the diagonal; one that couples directions is a `MatrixSpring` before these.
    """
    across = [ElementarySpring(axis, False, compliance) for axis, compliance in joint.bearings]
    if joint.matrix is not None and not is_coupled(joint.matrix):
        diagonal = enumerate(np.diag(joint.matrix))
        across = [ElementarySpring(np.eye(3)[k % 3], k < 3, float(c)) for k, c in diagonal if c > 0.0]
    own = [ElementarySpring(joint.axis, joint.slides, joint.compliance, joint.stretch, joint.law)]
    own = own if joint.sprung else []
    return across + own


def crossing(a: Joint, b: Joint) -> bool:
    """Whether two revolute axes in a row are at right angles, so that they make a universal joint."""
    return not (a.slides or b.slides) and abs(float(np.dot(a.axis, b.axis))) < PERPENDICULAR


def axes_with(axis: Array, column: int) -> Array:
    """A rotation ``(3, 3)`` with the unit vector ``axis`` as one of its columns."""
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    cyclic = [np.asarray(axis, dtype=float), side, np.cross(axis, side)]
    return np.column_stack([cyclic[(i - column) % 3] for i in range(3)])
