"""A machine with branches or springs between points as a lumped model: its paths are followed as a chain's are.

What is imposed is the pose of the end-effector behind the last part; other ends are free.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from vjm.model.applied_loads import AppliedLoads
from vjm.model.assembly import Assembly
from vjm.model.lumped import Kinematics, LumpedModel
from vjm.rotations import Array
from vjm.tree.arrays import TreeArrays
from vjm.tree.assembly import BranchedAssembly
from vjm.tree.model import point_springs, spring_blocks
from vjm.tree.state_solver import TreeSolver


class LumpedTree(LumpedModel):
    """A `LumpedModel` whose joints form a tree; point springs store energy beside those of its coordinates.

    Its solver is dense: a state costs the third power of the number of coordinates.
    """

    def _assembled(self) -> Assembly:
        self._built = BranchedAssembly(self.chain)
        self._spring_joints, self._spring_points, self._spring_laws = point_springs(self.chain, self._built)
        return self._built

    def find(self, part: str, at: float) -> tuple[int, Array]:
        """The body that carries a point of a part or an end frame, see `LumpedModel.find`."""
        if not part:
            return self._built.last, self.tail[:3, 3]
        if part in self.chain.ends:
            site = self._built.ends[self.chain.ends[part]]
            return site.joint, site.frame[:3, 3]
        return super().find(part, at)

    def under(self, applied_loads: AppliedLoads) -> LumpedTree:
        """The same model with loads on its bodies."""
        result = self._changed(applied_loads=applied_loads)
        assert isinstance(result, LumpedTree)
        return result

    def strained(self, x: Array) -> bool:
        """Whether a spring, between points or not, is under stress at the coordinates ``x`` (n,)."""
        return super().strained(x) or bool(np.any(self._pulls(x)))

    def eased(self, x: Array, share: float) -> LumpedTree:
        """The same model with springs under a share of the stress that they have at the coordinates ``x`` (n,)."""
        laws = self._spring_laws.copy()
        laws[:, 2] -= (1.0 - share) * self._pulls(x)
        result = super().eased(x, share)._changed(_spring_laws=laws)
        assert isinstance(result, LumpedTree)
        return result

    def _pulls(self, x: Array) -> Array:
        """Forces ``(s,)`` of the springs between points, N, pulling positive."""
        stiffness, free, preload = self._spring_laws.T
        ends = self._spring_ends(self.kinematics(x))
        result: Array = stiffness * (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - free) + preload
        return result

    def _spring_ends(self, kinematics: Kinematics) -> Array:
        """Where the springs between points are fixed, ``(s, 2, 3)`` mm, world."""
        T = kinematics.behind[self._spring_joints + 1]
        result: Array = np.einsum("skab,skb->ska", T[..., :3, :3], self._spring_points) + T[..., :3, 3]
        return result

    def bent(self, natural: Array) -> LumpedTree:
        """The same model with springs that are free of stress at the coordinates ``natural`` (n,)."""
        result = self._changed(natural=natural)
        assert isinstance(result, LumpedTree)
        return result

    @cached_property
    def compiled(self) -> TreeSolver:
        """What solves for its states, dense."""
        loads = self.applied_loads
        return TreeSolver(
            self._arrays, self.natural, loads.constant, loads.ramped, (self.coordinate_scale, self.wrench_scale),
            (self._station_joint, self._station_position),
        )  # fmt: skip

    @property
    def _arrays(self) -> TreeArrays:
        built, loads = self._built, self.applied_loads
        kind, first, K, beam = spring_blocks(built)
        count = len(loads)
        return TreeArrays(
            parent=np.array(built.parent, dtype=np.int64),
            rotary=np.array(built.rotary, dtype=np.int64),
            axis=self.axis,
            R0=np.ascontiguousarray(self.before[:, :3, :3]),
            p0=np.ascontiguousarray(self.before[:, :3, 3]),
            coordinate=np.array(built.coordinate, dtype=np.int64),
            factor=np.array(built.factor, dtype=float),
            kind=kind, first=first, K=K, beam=beam, grows=np.full(len(kind), -1),
            unit=self.coordinate_scale.copy(),
            load_joint=loads.joint.astype(np.int64),
            load_offset=np.ascontiguousarray(loads.offset, dtype=float),
            load=np.zeros((count, 6)),
            follows=loads.follows.astype(np.int64),
            load_grows=np.full(count, -1),
            spring_joint=self._spring_joints, spring_point=self._spring_points, spring=self._spring_laws,
            end_joint=np.array([built.last], dtype=np.int64),
            end_R=self.tail[None, :3, :3].copy(),
            end_p=self.tail[None, :3, 3].copy(),
        )  # fmt: skip

    # --- kinematics ---------------------------------------------------------------------------------------

    def kinematics(self, x: Array) -> Kinematics:
        """Geometry and first derivatives at ``x`` (n,); joints beside the end-effector's way do not move it."""
        m = len(self.joint_rotary)
        behind = np.empty((m + 1, 4, 4))
        behind[0] = np.eye(4)
        joints = self.drive @ x
        angle = np.where(self.joint_rotary, joints, 0.0)[:, None, None]
        local = np.zeros((m, 4, 4))
        local[:, 3, 3] = 1.0
        local[:, :3, :3] = np.eye(3) + np.sin(angle) * self._skew + (1.0 - np.cos(angle)) * self._skew2
        local[:, :3, 3] = np.where(self.joint_rotary, 0.0, joints)[:, None] * self.axis
        for j, parent in enumerate(self._built.parent):
            behind[j + 1] = behind[parent + 1] @ self.before[j] @ local[j]
        axes = np.einsum("jab,jb->ja", behind[1:, :3, :3], self.axis)
        end = behind[self._built.last + 1] @ self.tail
        on_way = self._before[self._built.last + 1]
        J = self._joint_jacobian(behind, axes, end[:3, 3], on_way)
        return Kinematics(end, behind, axes, self.joint_rotary & on_way, J, self.drive, J @ self.drive)

    @cached_property
    def _before(self) -> np.ndarray:
        """Which joints ``(m + 1, m)`` lie before what is behind each, itself included; first, of the base, none."""
        m = len(self._built.parent)
        result = np.zeros((m + 1, m), dtype=bool)
        for j, parent in enumerate(self._built.parent):
            result[j + 1] = result[parent + 1]
            result[j + 1, j] = True
        return result

    def _joint_jacobian(self, behind: Array, axes: Array, point: Array, moving: np.ndarray) -> Array:
        """Velocity ``(6, m)`` of a point by the joints, those that do not move it being zero."""
        turning = self.joint_rotary[:, None]
        shifts = np.where(turning, np.cross(axes, point - behind[1:, :3, 3]), axes)
        turns = np.where(turning, axes, 0.0)
        result: Array = (np.concatenate([shifts, turns], axis=1) * moving[:, None]).T
        return result

    def shape_rate(self, kinematics: Kinematics, velocity: Array) -> Array:
        """Velocities ``(k, 3)`` of the stations for velocities ``(n,)`` of the coordinates."""
        joints, behind = self.drive @ velocity, kinematics.behind
        return np.array(
            [
                (self._joint_jacobian(behind, kinematics.axes, point, self._before[joint + 1]) @ joints)[:3]
                for joint, point in zip(self._station_joint, self.shape(kinematics), strict=True)
            ]
        ).reshape(-1, 3)

    def stretching(self, kinematics: Kinematics) -> Array:
        """Derivative ``(s, n)`` of the lengths of the springs between points; zero where the two points meet."""
        rows, behind = [], kinematics.behind
        for joints, ends in zip(self._spring_joints, self._spring_ends(kinematics), strict=True):
            first, second = (
                self._joint_jacobian(behind, kinematics.axes, end, self._before[j + 1])[:3]
                for j, end in zip(joints, ends, strict=True)
            )
            length = float(np.linalg.norm(ends[1] - ends[0]))
            along = (ends[1] - ends[0]) / length if length > 0.0 else np.zeros(3)
            rows.append(along @ (second - first) @ self.drive)
        return np.array(rows).reshape(-1, self.size)
