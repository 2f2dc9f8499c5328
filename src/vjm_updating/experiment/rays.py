"""Readings as points on rays from the unloaded pose, along which the model is solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, physical_bound

NEAR = numerical(1e-3)
"""Distance of a reading from its ray, over the ray's length, that the loaded stiffness bridges; its error is the
square of that."""
MOST_RAYS = physical_bound(60)
"""In one posture; more is no set of ramps."""


@dataclass(frozen=True)
class Ray:
    """Readings of one posture whose displacements lie on one line through the unloaded pose.

    Attributes:
        posture: label.
        direction: ``(6,)`` displacement per unit of the ramp, mm or rad.
        measure: ``(6,)`` whose product with a displacement is its place on the ray.
        index: of its readings ``(k,)``.
    """

    posture: str
    direction: Array
    measure: Array
    index: np.ndarray


def rays(posture: np.ndarray, pose: Array, noise: Array, length: float) -> list[Ray]:
    """Sort readings by rays, those furthest out first.

    Args:
        posture: labels ``(n,)``.
        pose: displacements ``(n, 6)``, mm, rad.
        noise: of one reading ``(6,)``, zeros and noise alike.
        length: mm that a rad counts for.

    Raises:
        ValueError: there are more than `MOST_RAYS`.
    """
    unit = np.repeat([1.0, length], 3)
    scaled, sigma = pose * unit, noise * unit
    near = 6.0 * float(np.linalg.norm(sigma))
    found: list[Ray] = []
    for label in dict.fromkeys(posture.tolist()):
        left = np.flatnonzero(posture == label)
        mine = 0
        while len(left):
            here = scaled[left]
            furthest = here[np.argmax(np.linalg.norm(here, axis=1))]
            d = _clean(furthest, sigma)
            along = here @ d
            off = np.linalg.norm(here - along[:, None] * d, axis=1)
            on = off <= np.maximum(near, NEAR * np.abs(along))
            on[np.argmax(np.linalg.norm(here, axis=1))] = True
            # one coordinate alone counts in its own unit: a ramp about z is in rad
            size = unit[np.argmax(np.abs(d))] if np.count_nonzero(d) == 1 else 1.0
            found.append(Ray(label, d * size / unit, d * unit / size, left[on]))
            left = left[~on]
            mine += 1
            if mine > MOST_RAYS:
                raise ValueError(
                    f"posture {label}: its displacements go in more than {MOST_RAYS} directions from the unloaded "
                    "pose: a calibration takes ramps; diagnose such data or leave rows out"
                )
    return found


def _clean(furthest: Array, sigma: Array) -> Array:
    """Unit vector ``(6,)`` along a displacement, without the components that are noise."""
    real = np.where(np.abs(furthest) > 6.0 * sigma, furthest, 0.0)
    chosen = real if real.any() else furthest
    size = float(np.linalg.norm(chosen))
    result: Array = chosen / size if size > 0.0 else np.eye(6)[0]
    return result
