"""Moments of inertia in files: six numbers, checked to be those of a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from vjm.rotations import Array

ROUNDED = 1e-3
"""Of the largest moment, by which rounded numbers of a file may miss what bodies can have."""


def inertia_matrix(values: Sequence[float]) -> Array:
    """Moments of inertia ``(3, 3)`` of the numbers ``ixx, iyy, izz, ixy, ixz, iyz``.

    Example:
        >>> inertia_matrix([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]).tolist()
        [[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]]
    """
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)


def inertia_values(matrix: Array) -> list[float]:
    """The numbers of moments of inertia ``(3, 3)``; the inverse of `inertia_matrix`."""
    return [float(matrix[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def is_of_a_body(values: Sequence[float]) -> bool:
    """Whether a body can have such moments: none is negative, and none is larger than the sum of the two others.

    Example:
        >>> is_of_a_body([1.0, 1.0, 2.0, 0.0, 0.0, 0.0]), is_of_a_body([1.0, 1.0, 2.1, 0.0, 0.0, 0.0])
        (True, False)
    """
    if not np.all(np.isfinite(values)):
        return False
    least, middle, most = np.linalg.eigvalsh(inertia_matrix(values))
    return bool(least >= -ROUNDED * most and most <= least + middle + ROUNDED * most)


def _of_a_body(values: list[float]) -> list[float]:
    if not is_of_a_body(values):
        raise ValueError(
            f"= {values} are the moments of no body (ixx, iyy, izz, ixy, ixz, iyz). No principal moment may be "
            "negative or larger than the sum of the two others"
        )
    return values


InertiaKgMM2 = Annotated[
    list[float],
    Field(
        min_length=6,
        max_length=6,
        description="ixx, iyy, izz, ixy, ixz, iyz about the centre of mass, axes of the frame of the centre",
    ),
    AfterValidator(_of_a_body),
]
"""Key of a part with a mass; natural frequencies need it, statics does not."""
