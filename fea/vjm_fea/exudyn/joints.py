"""Joints and springs between two markers of Exudyn.

Here are kinds of joints, their axes, what deflects in them, and a 6×6 spring.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from vjm.model.laws import Law
from vjm.model.parts import Joint
from vjm.rotations import Array
from vjm_fea.common.states import rotation_matrices

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
        return self._coordinates(*self._at(places))[0]

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
