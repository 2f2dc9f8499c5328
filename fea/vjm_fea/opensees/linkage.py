"""Rigid pieces and joints in a row between two bodies, at finite rotation.

Everything is given in the reference configuration in world axes: a joint is a point and an axis there, and turns or
slides what lies behind it by its coordinate (product of exponentials). So nothing but the joints is left of rigid
pieces, however they are made up.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vjm.rotations import Array, rotation_from_vector, skew


@dataclass(frozen=True)
class LinkageJoint:
    """One coordinate of a linkage.

    Attributes:
        coordinate: its number in the chain.
        position: a point ``(3,)`` on the axis in the reference configuration, mm.
        axis: unit vector ``(3,)`` in the reference configuration.
        slides: along the axis; else it turns about it.
    """

    coordinate: int
    position: Array
    axis: Array
    slides: bool = False


@dataclass(frozen=True)
class Linkage:
    """What leads from a body to a rigid piece behind joints, and to a node where that carries one.

    Attributes:
        near: number of the body; None for the ground.
        near_position: its reference position ``(3,)``, mm.
        joints: from the body to the piece.
        node: number of the node at the far end; None where there is none.
        node_position: its reference position ``(3,)``, mm.
    """

    near: int | None
    near_position: Array
    joints: tuple[LinkageJoint, ...]
    node: int | None = None
    node_position: Array = field(default_factory=lambda: np.zeros(3))

    def posed(self, position: Array, rotation: Array, q: Array) -> Posed:
        """The linkage with its near body at a place.

        Args:
            position: of the near body ``(3,)``, mm.
            rotation: of the near body from the reference ``(3, 3)``.
            q: coordinates of all joints of the chain, from the reference.
        """
        points, axes, turns, anchors = [], [], [rotation], [(self.near_position, position)]
        for joint in self.joints:
            X, x = anchors[-1]
            R = turns[-1]
            point, axis = x + R @ (joint.position - X), R @ joint.axis
            amount = float(q[joint.coordinate])
            points.append(point)
            axes.append(axis)
            turns.append(R if joint.slides else rotation_from_vector(axis * amount) @ R)
            anchors.append((joint.position, point + axis * amount if joint.slides else point))
        return Posed(self, position, tuple(points), tuple(axes), tuple(turns), tuple(anchors))


@dataclass(frozen=True)
class Posed:
    """A linkage at a place.

    Its motions are the near body's shift and turn, then its joints' rates: ``6 + k``; without the six where the
    near body is the ground.

    Attributes:
        linkage: which.
        position: of the near body ``(3,)``, mm.
        points: of the joints, each ``(3,)``.
        axes: of the joints, each ``(3,)``.
        turns: rotation ``(3, 3)`` from the reference of every rigid piece, from the near body to the node.
        anchors: reference and present position of a point of every rigid piece.
    """

    linkage: Linkage
    position: Array
    points: tuple[Array, ...]
    axes: tuple[Array, ...]
    turns: tuple[Array, ...]
    anchors: tuple[tuple[Array, Array], ...]

    def place(self, reference: Array, piece: int = -1) -> Array:
        """Present position ``(3,)`` of a point of a rigid piece, by default of the one with the node."""
        X, x = self.anchors[piece]
        result: Array = x + self.turns[piece] @ (reference - X)
        return result

    @property
    def node_position(self) -> Array:
        """Of the node ``(3,)``, mm."""
        return self.place(self.linkage.node_position)

    def _motion(self, point: Array, piece: int) -> tuple[Array, Array]:
        """Shift and turn ``(3, 6 + k)`` of a rigid piece at a point of it, by the linkage's motions."""
        shift, turn = np.zeros((2, 3, 6 + len(self.axes)))
        shift[:, :3] = turn[:, 3:6] = np.eye(3)
        shift[:, 3:6] = -skew(point - self.position)
        for j in range(piece):
            slides = self.linkage.joints[j].slides
            shift[:, 6 + j] = self.axes[j] if slides else np.cross(self.axes[j], point - self.points[j])
            if not slides:
                turn[:, 6 + j] = self.axes[j]
        return shift, turn

    def jacobian(self, point: Array, piece: int) -> Array:
        """Shift and turn ``(6, 6 + k)`` of a rigid piece at a point ``(3,)`` of it, by the linkage's motions."""
        return self._moving(np.vstack(self._motion(point, piece)))

    def geometric_stiffness(self, wrench: Array, point: Array, piece: int) -> Array:
        """How the motions' share of a wrench ``(6,)`` on a rigid piece changes with them, ``(6 + k, 6 + k)``.

        The wrench stays as it is in world axes; what changes are arms and axes: ``∂(Jᵀ w)/∂x`` at constant ``w``.

        Args:
            wrench: force and moment.
            point: on which it acts ``(3,)``.
            piece: of which the point is.
        """
        k = len(self.axes)
        force, moment = wrench[:3], wrench[3:]
        end_shift = self._motion(point, piece)[0]
        G = np.zeros((6 + k, 6 + k))
        G[3:6] = -skew(force) @ (end_shift - np.eye(3, 6 + k))
        for j in range(piece):
            axis = self.axes[j]
            shift, turn = self._motion(self.points[j], j)
            if self.linkage.joints[j].slides:
                G[6 + j] = -force @ skew(axis) @ turn
            else:
                about = moment + np.cross(point - self.points[j], force)
                G[6 + j] = -about @ skew(axis) @ turn - axis @ skew(force) @ (end_shift - shift)
        return self._moving(self._moving(G).T).T

    def _moving(self, columns: Array) -> Array:
        return columns if self.linkage.near is not None else columns[:, 6:]
