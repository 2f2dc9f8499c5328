"""A curved or straight cantilever in space under a dead tip force, by shooting.

The geometrically exact rod of Simo and Vu-Quoc, *CMAME* 58 (1986), as a differential equation in the arc length S
of the undeformed rod. Let r be the position, R the rotation of the section (its first axis along the undeformed
rod), n the internal force, which is the tip's, and m the moment about the section's own point. The equations are

    N = Rᵀ n,   r' = R (e₁ + (N₁/EA, N₂/GA_y, N₃/GA_z)),
    M = Rᵀ m,   R' = R [κ₀ + (M₁/GJ, M₂/EI_y, M₃/EI_z)]×,   m' = −r' × n.

The three unknowns are the moment at the clamp; at the tip m = 0. R is carried as a unit quaternion, whose length
the equation keeps. N, mm, rad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

LOAD_STEPS = 8
"""In which the force is put on; each shot starts from the moment extrapolated from those before it."""


@dataclass(frozen=True)
class SpaceTip:
    """Where the tip is.

    Attributes:
        x: from the clamp along the undeformed tangent there, mm.
        y: across it in the plane of the unloaded rod, mm.
        z: across that plane, mm.
    """

    x: float
    y: float
    z: float


def dead_force(
    length: float,
    force: tuple[float, float, float],
    bending: tuple[float, float],
    torsion: float,
    axial: float = float("inf"),
    shear: tuple[float, float] = (float("inf"), float("inf")),
    curvature: float = 0.0,
    twist: float = 0.0,
) -> SpaceTip:
    """Tip of a cantilever that is clamped at the origin along x.

    Args:
        length: undeformed, mm.
        force: on the tip, N, fixed axes.
        bending: EI_y and EI_z, N mm²; about z the rod deflects along y.
        torsion: GJ, N mm².
        axial: EA, N.
        shear: GA_y and GA_z, N.
        curvature: of the unloaded rod about z, 1/mm: a positive one turns its tangent from x towards y.
        twist: of the unloaded rod about its axis, 1/mm; with a curvature it is a helix about (twist, 0, curvature).

    Raises:
        RuntimeError: Newton's method or the integration failed.
    """
    scale = max(bending) / length
    stiffness = np.array([torsion, *bending])
    soft = np.array([1.0 / axial, 1.0 / shear[0], 1.0 / shear[1]])
    natural = np.array([twist, 0.0, curvature])
    whole = np.array(force, dtype=float)
    moments = [np.zeros(3)]
    for step in range(1, LOAD_STEPS + 1):
        n = whole * step / LOAD_STEPS
        guess = 2.0 * moments[-1] - moments[-2] if len(moments) > 1 else moments[-1]
        moments.append(_shot(length, n, soft, stiffness, natural, guess, scale))
    r = _tip(length, whole, soft, stiffness, natural, moments[-1])[:3]
    return SpaceTip(float(r[0]), float(r[1]), float(r[2]))


def _shot(
    length: float, n: Array, soft: Array, stiffness: Array, natural: Array, guess: Array, scale: float
) -> Array:
    """Moment ``(3,)`` at the clamp with which the tip's vanishes."""
    moment = guess
    for _ in range(20):
        missing = _tip(length, n, soft, stiffness, natural, moment)[7:]
        if np.abs(missing).max() < 1e-10 * scale:
            return moment
        h = 1e-6 * scale
        J = np.column_stack(
            [(_tip(length, n, soft, stiffness, natural, moment + h * unit)[7:] - missing) / h for unit in np.eye(3)]
        )
        moment = moment - np.linalg.solve(J, missing)
    raise RuntimeError("cantilever in space: no equilibrium found by shooting")


def _tip(length: float, n: Array, soft: Array, stiffness: Array, natural: Array, moment: Array) -> Array:
    """State ``(10,)`` at the tip: position, quaternion and moment."""

    def slope(_: float, state: Array) -> Array:
        q, m = state[3:7], state[7:]
        R = _rotation(q)
        along = R @ (np.array([1.0, 0.0, 0.0]) + soft * (R.T @ n))
        turning = natural + (R.T @ m) / stiffness
        w, v = q[0], q[1:]
        dq = 0.5 * np.concatenate([[-v @ turning], w * turning + np.cross(v, turning)])
        return np.concatenate([along, dq, -np.cross(along, n)])

    start = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], moment])
    solution = solve_ivp(slope, (0.0, length), start, method="DOP853", rtol=1e-11, atol=1e-11)
    if not solution.success:
        raise RuntimeError(f"cantilever in space: {solution.message}")
    return solution.y[:, -1]


def _rotation(q: Array) -> Array:
    """Rotation ``(3, 3)`` of a quaternion, of unit length but for rounding."""
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
