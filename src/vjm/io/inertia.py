"""Moments of inertia in files: six numbers, checked to be those of a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from vjm.io.errors import printed
from vjm.rotations import Array

NO_BODYS = "moments of inertia that no body has"
ROUNDED = 1e-3
"""Of the largest moment, by which rounded numbers of a file may miss what bodies can have."""
PLATE = 1e-12
"""Of the largest moment: far above its rounding, by which a plate's is more than the sum of the two others."""


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


def is_of_a_body(values: Sequence[float], rounded: float = ROUNDED) -> bool:
    """Whether a body can have such moments: none is negative, and none is larger than the sum of the two others.

    Args:
        values: ``ixx, iyy, izz, ixy, ixz, iyz``.
        rounded: share of the largest moment by which they may miss that.

    Example:
        >>> is_of_a_body([1.0, 1.0, 2.0, 0.0, 0.0, 0.0]), is_of_a_body([1.0, 1.0, 2.1, 0.0, 0.0, 0.0])
        (True, False)
    """
    if not np.all(np.isfinite(values)):
        return False
    least, middle, most = np.linalg.eigvalsh(inertia_matrix(values))
    return bool(least >= -rounded * most and most <= least + middle + rounded * most)


def nearest_of_a_body(matrix: Array) -> Array:
    """The moments of inertia ``(3, 3)`` nearest to given ones that a body can have; these where it can have them.

    Nearest in the Frobenius norm: principal axes stay, and principal moments are those of masses ``s`` on the
    axes, ``λ_i = Σ_{j≠i} s_j``, with ``s ≥ 0`` and the least squares of the change. A metric on possible tensors,
    such as the log-Cholesky one, tells nothing of impossible ones, which are no points of it.

    Args:
        matrix: symmetric ``(3, 3)``, of any unit.

    Example:
        >>> nearest_of_a_body(np.diag([1.0, 1.0, 3.0])).diagonal().round(3).tolist()
        [1.333, 1.333, 2.667]
    """
    # ascending, so that masses become zero from the last axis on
    moments, axes = np.linalg.eigh(matrix)
    of_masses, masses = np.ones((3, 3)) - np.eye(3), np.zeros(3)
    for count in (3, 2, 1, 0):
        masses = np.zeros(3)
        masses[:count] = np.linalg.lstsq(of_masses[:, :count], moments, rcond=None)[0]
        if (masses >= 0.0).all():
            break
    return (axes * (of_masses @ masses)) @ axes.T


def said_repair(old: Array, new: Array) -> str:
    """Principal moments before and after a repair, kg m² from kg mm² ``(3, 3)``."""
    before, after = (
        ", ".join(printed(1e-6 * value, 4) for value in np.linalg.eigvalsh(matrix)) for matrix in (old, new)
    )
    return f"principal moments of inertia {before} kg m², which no body has, became {after}, the nearest ones"


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
