"""The geometry of a machine at one configuration, with its first derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vjm.rotations import Array, cross


@dataclass(frozen=True)
class Drive:
    """Which coordinate drives each joint, and how much of it.

    Attributes:
        coordinate: ``(m,)`` of each joint, −1 where none does.
        factor: ``(m,)`` the joint's value over that of the coordinate.
        size: number n of the coordinates.
    """

    coordinate: np.ndarray
    factor: Array
    size: int

    def joints(self, x: Array) -> Array:
        """Values ``(m,)`` of the joints, or their velocities, from those of the coordinates ``(n,)``."""
        result: Array = self.factor * x[self.coordinate] if self.size else np.zeros(len(self.factor))
        return result

    def gathered(self, rows: Array) -> Array:
        """Derivatives ``(r, n)`` by the coordinates from those ``(r, m)`` by the joints."""
        result = np.zeros((self.size, len(rows)))
        joints, own, begins = self._driven
        moved = (rows * self.factor)[:, joints].T
        result[own] = moved if len(joints) == len(own) else np.add.reduceat(moved, begins, axis=0)
        return result.T

    @cached_property
    def _driven(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The joints that coordinates drive, those of one in a row; these coordinates, and where each begins."""
        driven = np.flatnonzero(self.coordinate >= 0)
        joints = driven[np.argsort(self.coordinate[driven], kind="stable")]
        own, begins = np.unique(self.coordinate[joints], return_index=True)
        return joints, own, begins


@dataclass(frozen=True)
class Kinematics:
    """The chain's geometry at one configuration.

    Attributes:
        end: frame ``(4, 4)`` of the end-effector, world, mm.
        behind: frames ``(m + 1, 4, 4)`` behind the base and behind each joint.
        axes: joint axes ``(m, 3)`` in the world.
        rotary: ``(m,)``, true where the joint turns.
        joint_jacobian: ``(6, m)``: linear, angular velocity of the end-effector by the joints' velocities.
        drive: which coordinates drive the joints.
        jacobian: geometric Jacobian ``(6, n)`` by the coordinates.
    """

    end: Array
    behind: Array
    axes: Array
    rotary: np.ndarray
    joint_jacobian: Array
    drive: Drive
    jacobian: Array

    def force_hessian(self, wrench: Array) -> Array:
        """Derivative ``(n, n)`` of ``Jᵀ F`` at constant wrench: ``H[j, i] = ∂(J_jᵀ F)/∂x_i``, for (17).

        When joint i turns by dx, everything behind it turns about its axis w_i. For i before j the column J_j
        turns as a whole, ``∂J_j/∂x_i = w_i × J_j`` in both halves; for i behind j only the lever changes,
        ``∂(w_j × r_j)/∂x_i = w_j × J_i``, and the axis stays. So the force part is symmetric, the moment part
        is not: a moment fixed in the world is not conservative. The difference vanishes on the null space of
        J, where stability is decided.

        Args:
            wrench: ``(6,)`` force in N and moment in N mm on the end-effector, world axes.
        """
        return force_hessian_of([(self, wrench)])


def force_hessian_of(acting: Sequence[tuple[Kinematics, Array]]) -> Array:
    """Sum ``(n, n)`` of `Kinematics.force_hessian` over wrenches on points of one machine at one configuration.

    Args:
        acting: one point and more, each with its wrench ``(6,)``, N and N mm.
    """
    machine, _ = acting[0]
    turning = [np.where(k.rotary[:, None], k.axes, 0.0) for k, _ in acting]
    # f · (w_i × J_j) = (f × w_i) · J_j, i at or before j
    linear = np.hstack([cross(wrench[:3], turns) for (_, wrench), turns in zip(acting, turning, strict=True)])
    linear = linear @ np.vstack([k.joint_jacobian[:3] for k, _ in acting])
    angular = np.hstack([cross(wrench[3:], turns) for (_, wrench), turns in zip(acting, turning, strict=True)])
    angular = angular @ np.hstack(turning).T
    H = np.triu(linear, 1).T + np.triu(linear) + np.triu(angular, 1).T
    return machine.drive.gathered(machine.drive.gathered(H).T).T
