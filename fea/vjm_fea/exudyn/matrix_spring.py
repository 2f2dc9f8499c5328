"""Springs of a whole 6×6 stiffness between two nodes, by the law of (22): shifted first, then turned about x, y, z.

Exudyn's own spring of six directions takes the logarithm of the motion between its sides, which differs from (22)
by the square of the turn. This one stands beside Exudyn: its forces and their derivatives are added to Exudyn's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from vjm.rotations import Array
from vjm_fea.common.quaternions import rotation_matrices

TINY = 1e-30
"""Complex step: its square is lost in rounding."""


def is_coupled(compliance: Array | None) -> TypeGuard[Array]:
    """Whether a compliance ``(6, 6)`` gives way in all directions and couples some of them."""
    if compliance is None or not np.diag(compliance).all():
        return False
    return bool(np.any(compliance - np.diag(np.diag(compliance))))


@dataclass(frozen=True)
class MatrixSpring:
    """A spring between two nodes, free of stress in the reference configuration.

    Attributes:
        nodes: before and behind it, −1 for the ground.
        frames: its frame ``(2, 4, 4)`` in each node's axes, which is one in the reference configuration.
        stiffness: ``(6, 6)`` N/mm, N, N mm, in that frame.
    """

    nodes: tuple[int, int]
    frames: Array
    stiffness: Array

    def forces(self, places: Array) -> Array:
        """Derivative ``(2, 6)`` of its energy by shifts and small turns of both nodes, world axes; N, N mm.

        Args:
            places: positions and quaternions ``(n + 1, 7)`` of the nodes, the ground last.
        """
        return self._gradient(*self._at(places)).real

    def tangent(self, places: Array) -> Array:
        """Derivative ``(12, 12)`` of `forces` by those motions, exact to rounding."""
        R, p = self._at(places)
        result = np.empty((12, 12))
        for k in range(12):
            node, direction = divmod(k, 6)
            turned, moved = R.astype(complex), p.astype(complex)
            if direction < 3:
                moved[node, direction] += 1j * TINY
            else:
                axis = np.eye(3)[direction - 3]
                turned[node] += 1j * TINY * np.cross(axis, R[node], axisb=0, axisc=0)
            moved += np.einsum("nab,nb->na", turned - R, self.frames[:, :3, 3])
            result[:, k] = self._gradient(turned, moved).ravel().imag / TINY
        return result

    def _at(self, places: Array) -> tuple[Array, Array]:
        """Rotations ``(2, 3, 3)`` of the nodes, and where the spring's frames are ``(2, 3)``."""
        own = places[list(self.nodes)]
        R = rotation_matrices(own[:, 3:])
        return R, own[:, :3] + np.einsum("nab,nb->na", R, self.frames[:, :3, 3])

    def _gradient(self, R: Any, p: Any) -> Any:  # noqa: ANN401  real, or complex for exact derivatives
        before, behind = (turn @ T[:3, :3] for turn, T in zip(R, self.frames, strict=True))
        turn, way = before.T @ behind, p[1] - p[0]
        b = np.arcsin(turn[0, 2])
        a, c = np.arctan(-turn[1, 2] / turn[2, 2]), np.arctan(-turn[0, 1] / turn[0, 0])
        tension = self.stiffness @ np.concatenate([before.T @ way, [a, b, c]])
        # rates of the angles by the relative turn, in the axes before
        axes = np.array(
            [
                [1.0, 0.0, np.sin(b)],
                [0.0, np.cos(a), -np.sin(a) * np.cos(b)],
                [0.0, np.sin(a), np.cos(a) * np.cos(b)],
            ]
        )
        force, moment = before @ tension[:3], before @ np.linalg.solve(axes.T, tension[3:])
        arms = [R[k] @ self.frames[k, :3, 3] for k in (0, 1)]
        first = np.concatenate([-force, -moment - np.cross(way + arms[0], force)])
        second = np.concatenate([force, moment + np.cross(arms[1], force)])
        return np.array([first, second])
