"""Rotations and rigid transforms, as plain arrays.

A *frame* is a homogeneous 4×4 matrix; a *twist* or pose difference is a 6-vector (linear mm, angular rad),
both in world axes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
"""A real array; its shape stands in the docstring of whatever takes or returns it."""

AXES: dict[str, Array] = {"x": np.eye(3)[0], "y": np.eye(3)[1], "z": np.eye(3)[2]}
"""The unit vectors by name."""


def cross(a: Array, b: Array) -> Array:
    """Cross products ``(…, 3)`` of vectors, to the same digits as `numpy.cross`, whose calls take twice as long.

    Example:
        >>> cross(np.array([1.0, 0.0, 0.0]), np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])).tolist()
        [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    """
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def skew(v: ArrayLike) -> Array:
    """Cross-product matrix: ``skew(a) @ b == cross(a, b)``; ``(3,)`` to ``(3, 3)``."""
    x, y, z = np.asarray(v, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_from_vector(v: ArrayLike) -> Array:
    """Rotation matrix ``(3, 3)`` of a rotation vector ``(3,)`` in rad (Rodrigues' formula)."""
    v = np.asarray(v, dtype=float)
    angle = float(np.sqrt(v @ v))
    S = skew(v)
    # sinc forms stay exact through angle = 0
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.eye(3) + a * S + b * (S @ S)


def rotations_from_vectors(v: Array) -> Array:
    """Rotation matrices ``(..., 3, 3)`` of rotation vectors ``(..., 3)`` in rad.

    Example:
        >>> rotations_from_vectors(np.zeros((2, 3))).shape
        (2, 3, 3)
    """
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    S = cross(v[..., None, :], np.eye(3)).swapaxes(-1, -2)
    a, b = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.eye(3) + a * S + b * (S @ S)


def roll_pitch_yaw(R: Array) -> tuple[float, float, float]:
    """Angles in rad about the fixed axes x, y and z, one after another, of a rotation ``(3, 3)``.

    Example:
        >>> [round(angle, 9) for angle in roll_pitch_yaw(turn([0.0, 1.0, 0.0], 0.5)[:3, :3])]
        [0.0, 0.5, 0.0]
    """
    # near a pitch of a quarter turn the yaw is anything; the roll that goes with it is not
    pitch, yaw = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0])), math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    return math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]), pitch, yaw


def rotation_vector(R: Array) -> Array:
    """Rotation vector ``(3,)`` in rad of a rotation matrix, for angles below π."""
    w = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.sqrt(w @ w))
    cosine = 0.5 * (float(np.trace(R)) - 1.0)
    if sine < 1e-9 and cosine > 0.0:
        return w
    if sine < 1e-9:
        raise ValueError("rotation by a half turn has no unique rotation vector")
    return w * (np.arctan2(sine, cosine) / sine)


def unit_quaternion(R: Array) -> tuple[float, float, float, float]:
    """Unit quaternion of a rotation matrix ``(3, 3)``, scalar first.

    Example:
        >>> unit_quaternion(np.diag([1.0, -1.0, -1.0]))
        (0.0, 1.0, 0.0, 0.0)
    """
    # four times the outer product of the quaternion with itself; its largest column loses no digits
    trace, outer = float(np.trace(R)), np.empty((4, 4))
    outer[1:, 1:] = R + R.T - np.eye(3) * (trace - 1.0)
    outer[0, 0] = 1.0 + trace
    outer[0, 1:] = outer[1:, 0] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    column = outer[:, np.argmax(np.diag(outer))]
    w, x, y, z = (float(value) for value in column / np.copysign(np.linalg.norm(column), column[0]))
    return w, x, y, z


def rotation_vectors(R: Array) -> Array:
    """Rotation vectors ``(..., 3)`` in rad of rotation matrices ``(..., 3, 3)``; nan for half a turn.

    Example:
        >>> rotation_vectors(np.array([np.eye(3), turn([0.0, 0.0, 1.0], 0.5)[:3, :3]])).round(9).tolist()
        [[0.0, 0.0, 0.0], [0.0, 0.0, 0.5]]
    """
    w = 0.5 * np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1)
    sine, cosine = np.linalg.norm(w, axis=-1), 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)
    small = sine < 1e-9
    few = np.where(cosine > 0.0, 1.0, np.nan)
    return w * np.where(small, few, np.arctan2(sine, cosine) / np.where(small, 1.0, sine))[..., None]


_IDENTITY = np.eye(4)
"""Copied, for that is faster than to make one."""


def frame(R: Array | None = None, p: ArrayLike | None = None) -> Array:
    """Homogeneous matrix ``(4, 4)`` from a rotation ``(3, 3)`` and a position ``(3,)`` in mm."""
    T = _IDENTITY.copy()
    if R is not None:
        T[:3, :3] = R
    if p is not None:
        T[:3, 3] = p
    return T


def translation(p: ArrayLike) -> Array:
    """Frame ``(4, 4)`` shifted by ``p`` (3,) in mm.

    Example:
        >>> translation((1.0, 2.0, 3.0))[:3, 3].tolist()
        [1.0, 2.0, 3.0]
    """
    return frame(p=p)


def turn(axis: ArrayLike, angle: float) -> Array:
    """Frame ``(4, 4)`` turned by ``angle`` rad about the unit vector ``axis`` (3,).

    Example:
        >>> import vjm
        >>> vjm.turn(vjm.axis("z"), np.pi / 2).round(6)[:2, :2].tolist()
        [[0.0, -1.0], [1.0, 0.0]]
    """
    return frame(rotation_from_vector(np.asarray(axis, dtype=float) * angle))


def inverse_frame(T: Array) -> Array:
    """Inverse of a homogeneous matrix ``(4, 4)``."""
    R = T[:3, :3].T
    return frame(R, -R @ T[:3, 3])


def displaced(T: Array, displacement: ArrayLike) -> Array:
    """Frame ``(4, 4)`` moved by a displacement ``(6,)``: shift in mm and rotation vector in rad, world axes."""
    d = np.asarray(displacement, dtype=float)
    R = rotation_from_vector(d[3:]) @ T[:3, :3] if d[3:].any() else T[:3, :3]
    return frame(R, T[:3, 3] + d[:3])


def displacement_between(T_from: Array, T_to: Array) -> Array:
    """Displacement ``(6,)`` that takes one frame to another; the inverse of `displaced`."""
    return np.concatenate([T_to[:3, 3] - T_from[:3, 3], rotation_vector(T_to[:3, :3] @ T_from[:3, :3].T)])


def shift_compliance(compliance: Array, offset: ArrayLike) -> Array:
    """Compliance ``(6, 6)`` of the same elastic body read at a point shifted by ``offset`` (3,) mm.

    A rigid arm is welded between the old point and the new one: the new point moves by
    ``u + φ × offset``, and a force there brings the moment ``offset × f`` to the old point.
    """
    A = np.eye(6)
    A[:3, 3:] = -skew(offset)
    return A @ compliance @ A.T


def rotate_matrix6(matrix: Array, R: Array) -> Array:
    """A 6×6 compliance or stiffness ``(6, 6)`` given in a frame, expressed in the frame's parent."""
    B: Any = np.zeros((6, 6))
    B[:3, :3] = B[3:, 3:] = R
    return B @ matrix @ B.T
