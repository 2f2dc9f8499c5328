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
    """Whether a compliance ``(6, 6)`` couples some of its directions."""
    return compliance is not None and bool(np.any(compliance - np.diag(np.diag(compliance))))


def _angle(y: Any, x: Any) -> Any:  # noqa: ANN401  real, or complex for exact derivatives
    """Polar angle of a point, up to half a turn either way."""
    return 2.0 * np.arctan(y / (np.sqrt(x * x + y * y) + x))


@dataclass(frozen=True)
class RelativeMotion:
    """How far two nodes have moved from one another since the reference configuration, as (22) counts it.

    Attributes:
        nodes: before and behind, −1 for the ground.
        frames: one frame ``(2, 4, 4)`` in each node's axes, the same in the reference configuration.
    """

    nodes: tuple[int, int]
    frames: Array

    def coordinates(self, places: Array) -> Array:
        """Shifts along and turns about x, y, z ``(6,)``, mm and rad.

        Args:
            places: positions and quaternions ``(n + 1, 7)`` of the nodes, the ground last.
        """
        result: Array = self._coordinates(*self._at(places))[0]
        return result

    def gradient(self, places: Array, forces: Array | None = None) -> Array:
        """Derivative ``(2, 6)`` of forces times coordinates by shifts and small turns of both nodes, world axes.

        Args:
            places: as above.
            forces: on the coordinates ``(6,)``; the springs' own where none are given.
        """
        return self._gradient(*self._at(places), forces).real

    def second(self, places: Array, forces: Array | None = None) -> Array:
        """Derivative ``(12, 12)`` of `gradient` by those motions, exact to rounding."""
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
            result[:, k] = self._gradient(turned, moved, forces).ravel().imag / TINY
        return result

    def own_forces(self, coordinates: Any) -> Any:  # noqa: ANN401  real, or complex for exact derivatives
        """Forces ``(6,)`` of a spring on the coordinates: none here."""
        return 0.0 * coordinates

    def _at(self, places: Array) -> tuple[Array, Array]:
        """Rotations ``(2, 3, 3)`` of the nodes, and where the spring's frames are ``(2, 3)``."""
        own = places[list(self.nodes)]
        R = rotation_matrices(own[:, 3:])
        return R, own[:, :3] + np.einsum("nab,nb->na", R, self.frames[:, :3, 3])

    def _coordinates(self, R: Any, p: Any) -> Any:  # noqa: ANN401
        """The coordinates ``(6,)``, and how the angles ``(3,)`` turn the frame ``(3, 3)``, in the axes before."""
        before, behind = (turn @ T[:3, :3] for turn, T in zip(R, self.frames, strict=True))
        turn, way = before.T @ behind, p[1] - p[0]
        b = np.arcsin(turn[0, 2])
        a, c = _angle(-turn[1, 2], turn[2, 2]), _angle(-turn[0, 1], turn[0, 0])
        rates = np.array(
            [
                [1.0, 0.0, np.sin(b)],
                [0.0, np.cos(a), -np.sin(a) * np.cos(b)],
                [0.0, np.sin(a), np.cos(a) * np.cos(b)],
            ]
        )
        return np.concatenate([before.T @ way, [a, b, c]]), rates

    def _gradient(self, R: Any, p: Any, forces: Array | None) -> Any:  # noqa: ANN401
        coordinates, rates = self._coordinates(R, p)
        tension = self.own_forces(coordinates) if forces is None else forces
        before, way = R[0] @ self.frames[0, :3, :3], p[1] - p[0]
        force, moment = before @ tension[:3], before @ np.linalg.solve(rates.T, tension[3:])
        arms = [R[k] @ self.frames[k, :3, 3] for k in (0, 1)]
        first = np.concatenate([-force, -moment - np.cross(way + arms[0], force)])
        second = np.concatenate([force, moment + np.cross(arms[1], force)])
        return np.array([first, second])


@dataclass(frozen=True)
class MatrixSpring(RelativeMotion):
    """A spring on all six coordinates, free of stress in the reference configuration.

    Attributes:
        stiffness: ``(6, 6)`` N/mm, N, N mm.
    """

    stiffness: Array

    def own_forces(self, coordinates: Any) -> Any:  # noqa: ANN401
        """Forces ``(6,)`` on the coordinates."""
        return self.stiffness @ coordinates


@dataclass(frozen=True)
class LinearConstraint:
    """A weighted sum of relative coordinates and a number that is zero: a rigid direction, or coupled joints.

    Attributes:
        terms: relative motions, the coordinate of each that counts, and its weight.
        offset: the number, mm or rad.
    """

    terms: tuple[tuple[RelativeMotion, int, float], ...]
    offset: float = 0.0

    def error(self, places: Array) -> float:
        """By which the sum is not zero, mm or rad."""
        return self.offset + sum(weight * float(motion.coordinates(places)[k]) for motion, k, weight in self.terms)


def held_by(
    nodes: tuple[int, int], frames: Array, compliance: Array
) -> tuple[MatrixSpring, list[LinearConstraint]]:
    """A spring with a compliance ``(6, 6)``, and constraints where that has zeros in a row and column: rigid."""
    gives = compliance.any(axis=0)
    stiffness = np.zeros((6, 6))
    stiffness[np.ix_(gives, gives)] = np.linalg.inv(compliance[np.ix_(gives, gives)])
    spring = MatrixSpring(nodes, frames, stiffness)
    return spring, [LinearConstraint(((spring, int(k), 1.0),)) for k in np.flatnonzero(~gives)]
