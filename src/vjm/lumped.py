"""The virtual joint model of a chain: one-degree joints between rigid links, equations (1), (2) and (22).

Every joint, passive or virtual, is a shift along or a turn about an axis. A six-dimensional spring is six of them
in the order of (22), Tx Ty Tz Rx Ry Rz, or, symmetric about its middle, nine: Rx Ry Rz Tx Ty Tz Rz Ry Rx, where
each turn is half of the spring's coordinate. So a coordinate drives one joint or two, with a factor. All kinematics
follow from the joints' axes in the world frame, and one code path serves every chain.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vjm.chain import Chain
from vjm.compiled import Compiled
from vjm.parts import Actuator, Beam, Part, PassiveJoint, Placement, RigidOffset
from vjm.rotations import AXES, Array, frame, skew, translation
from vjm.springs import BeamColumnSpring, LinearSpring, Spring


@dataclass(frozen=True)
class Station:
    """A point of the machine that moves with the rigid link behind a joint.

    Attributes:
        part: name of the part that the point belongs to.
        fraction: where along the part's elastic length, 0 at the root; above 1 on its end offset.
        joint: index of the last joint before the point, −1 for the base.
        position: ``(3,)`` mm in the frame behind that joint.
    """

    part: str
    fraction: float
    joint: int
    position: Array


@dataclass(frozen=True)
class Kinematics:
    """The chain's geometry at one configuration.

    Attributes:
        end: frame ``(4, 4)`` of the end-effector, world, mm.
        behind: frames ``(m + 1, 4, 4)`` behind the base and behind each joint.
        axes: joint axes ``(m, 3)`` in the world.
        rotary: ``(m,)``, true where the joint turns.
        joint_jacobian: ``(6, m)``: linear, angular velocity of the end-effector by the joints' velocities.
        drive: ``(m, n)`` joint velocities by those of the coordinates.
        jacobian: geometric Jacobian ``(6, n)`` by the coordinates.
    """

    end: Array
    behind: Array
    axes: Array
    rotary: np.ndarray
    joint_jacobian: Array
    drive: Array
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
        force, moment = wrench[:3], wrench[3:]
        turning = np.where(self.rotary[:, None], self.axes, 0.0)
        # f · (w_i × J_j) = (f × w_i) · J_j, i at or before j
        linear = np.cross(force, turning) @ self.joint_jacobian[:3]
        H: Array = np.triu(linear, 1).T + np.triu(linear)
        angular = np.cross(moment, turning) @ turning.T
        result: Array = self.drive.T @ (H + np.triu(angular, 1).T) @ self.drive
        return result


class LumpedModel:
    """A chain as rigid links, passive joints and virtual springs.

    Attributes:
        chain: the machine.
        passive: indices ``(n_q,)`` of the passive joints' coordinates among all coordinates.
        elastic: indices ``(n_θ,)`` of the virtual springs' coordinates.
        springs: the springs' laws, base to tool.
        stations: points along the chain that show its shape.
    """

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self._rotary: list[bool] = []
        self._axis: list[Array] = []
        self._before: list[Array] = []
        self._rigid = chain.base.copy()
        self._coordinate: list[int] = []
        self._factor: list[float] = []
        self.size = 0
        self.springs: list[Spring] = []
        self.stations: list[Station] = []
        passive: list[int] = []
        elastic: list[int] = []
        for part in chain.parts:
            first = self.size
            self._add(part)
            (passive if isinstance(part, PassiveJoint) else elastic).extend(range(first, self.size))
        self.passive = np.array(passive, dtype=int)
        self.elastic = np.array(elastic, dtype=int)
        self.joint_rotary = np.array(self._rotary, dtype=bool)
        self.drive = np.zeros((len(self._rotary), self.size))
        self.drive[np.arange(len(self._rotary)), self._coordinate] = self._factor
        # a spring's shifts are driven by sliding joints, its turns by turning ones
        self.rotary = self.drive[self.joint_rotary].any(axis=0)
        self.axis = np.array(self._axis).reshape(-1, 3)
        self.before = np.array(self._before).reshape(-1, 4, 4)
        self.tail = self._rigid
        self._skew: Array = np.array([skew(a) for a in self.axis]).reshape(-1, 3, 3)
        self._skew2 = self._skew @ self._skew

    def reactions(self, kinematics: Kinematics, wrench: Array) -> Array:
        """Generalised forces ``(n,)`` of a wrench ``(6,)`` on the coordinates: ``Jᵀ F`` (8)."""
        result: Array = kinematics.jacobian.T @ wrench
        return result

    def strain(self, reactions: Array) -> Array:
        """Coordinates ``(n,)`` of the springs under reactions ``(n,)``, zero on the passive joints."""
        result = np.zeros(self.size)
        for spring, where in self.blocks:
            result[where] = spring.strain(reactions[where])
        return result

    def stiffness_under(self, reactions: Array) -> Array:
        """Tangent stiffness ``(n, n)`` of the springs under reactions ``(n,)``, zero on the passive joints."""
        K = np.zeros((self.size, self.size))
        for spring, where in self.blocks:
            K[where, where] = np.linalg.inv(spring.compliance(reactions[where]))
        return K

    @cached_property
    def stiffness(self) -> Array:
        """``K_θ`` of (3) among all coordinates ``(n, n)``, without load, zero on the passive joints."""
        K = np.zeros((self.size, self.size))
        for spring, where in self.blocks:
            K[where, where] = np.linalg.inv(spring.unloaded)
        return K

    @cached_property
    def compliance(self) -> Array:
        """``k_θ = K_θ⁻¹`` without load, block diagonal ``(n_θ, n_θ)``."""
        k = np.zeros((self.size, self.size))
        for spring, where in self.blocks:
            k[where, where] = spring.unloaded
        return k[np.ix_(self.elastic, self.elastic)]

    @cached_property
    def compiled(self) -> Compiled:
        """The model in compiled form."""
        return Compiled(self)

    @cached_property
    def linear(self) -> bool:
        """Whether every spring is linear, as the paper's are."""
        return all(isinstance(spring, LinearSpring) for spring in self.springs)

    @cached_property
    def blocks(self) -> list[tuple[Spring, slice]]:
        """The springs with the range of their coordinates, base to tool."""
        starts = np.cumsum([0, *(len(spring.unloaded) for spring in self.springs)])[:-1]
        return [
            (s, slice(self.elastic[i], self.elastic[i] + len(s.unloaded)))
            for s, i in zip(self.springs, starts, strict=True)
        ]

    @cached_property
    def coordinate_scale(self) -> Array:
        """Unit of each coordinate ``(n,)``: the characteristic length for shifts, one radian for turns."""
        return np.where(self.rotary, 1.0, self.chain.characteristic_length)

    @cached_property
    def wrench_scale(self) -> Array:
        """Unit of each wrench component ``(6,)``.

        From the springs' geometric mean rotational stiffness, so that scaled stiffnesses are of order one.
        """
        diagonal = np.diag(self.stiffness)[self.rotary & (np.diag(self.stiffness) > 0.0)]
        energy = float(np.exp(np.mean(np.log(diagonal)))) if diagonal.size else 1.0
        length = self.chain.characteristic_length
        return np.repeat([energy / length, energy], 3)

    def configuration(self, q: Array, theta: Array | None = None) -> Array:
        """All coordinates ``(n,)`` from the passive ``(n_q,)`` and the virtual ``(n_θ,)`` or zero."""
        x = np.zeros(self.size)
        x[self.passive] = q
        if theta is not None:
            x[self.elastic] = theta
        return x

    def kinematics(self, x: Array) -> Kinematics:
        """Geometry (1), (2) and its first derivatives at the joint coordinates ``x`` (m,), mm and rad."""
        m = len(self.joint_rotary)
        local = np.zeros((m, 4, 4))
        local[:, 3, 3] = 1.0
        joints = self.drive @ x
        angle = np.where(self.joint_rotary, joints, 0.0)[:, None, None]
        local[:, :3, :3] = np.eye(3) + np.sin(angle) * self._skew + (1.0 - np.cos(angle)) * self._skew2
        local[:, :3, 3] = np.where(self.joint_rotary, 0.0, joints)[:, None] * self.axis
        step = self.before @ local
        behind = np.empty((m + 1, 4, 4))
        behind[0] = np.eye(4)
        for j in range(m):
            np.matmul(behind[j], step[j], out=behind[j + 1])
        end = behind[-1] @ self.tail
        # an axis is not moved by its own joint
        axes = np.einsum("jab,jb->ja", behind[1:, :3, :3], self.axis)
        lever = end[:3, 3] - behind[1:, :3, 3]
        J = np.zeros((6, m))
        J[:3] = np.where(self.joint_rotary[:, None], np.cross(axes, lever), axes).T
        J[3:, self.joint_rotary] = axes[self.joint_rotary].T
        return Kinematics(end, behind, axes, self.joint_rotary, J, self.drive, J @ self.drive)

    def shape(self, kinematics: Kinematics) -> Array:
        """Positions ``(k, 3)`` of the stations in the world, mm."""
        T = kinematics.behind[self._station_joint + 1]
        result: Array = np.einsum("kab,kb->ka", T[:, :3, :3], self._station_position) + T[:, :3, 3]
        return result

    def shape_rate(self, kinematics: Kinematics, velocity: Array) -> Array:
        """Velocities ``(k, 3)`` of the stations for velocities ``(n,)`` of the coordinates."""
        points = self.shape(kinematics)
        joints = (self.drive @ velocity)[:, None]
        turning = np.where(self.joint_rotary[:, None], kinematics.axes * joints, 0.0)
        sliding = np.where(self.joint_rotary[:, None], 0.0, kinematics.axes * joints)
        # v_k = Σ_{j ≤ k} slide_j + turn_j × (p_k − o_j)
        linear = np.vstack([np.zeros(3), np.cumsum(sliding - np.cross(turning, kinematics.behind[1:, :3, 3]), 0)])
        angular = np.vstack([np.zeros(3), np.cumsum(turning, 0)])
        upto = self._station_joint + 1
        result: Array = linear[upto] + np.cross(angular[upto], points)
        return result

    @cached_property
    def _station_joint(self) -> np.ndarray:
        return np.array([s.joint for s in self.stations], dtype=int)

    @cached_property
    def _station_position(self) -> Array:
        return np.array([s.position for s in self.stations]).reshape(-1, 3)

    # --- building -----------------------------------------------------------------------------------------

    def _add(self, part: Part) -> None:
        match part:
            case RigidOffset():
                self._mark(part.name, 0.0)
                self._move(part.transform)
            case PassiveJoint():
                self._coordinate_joint(part.axis, rotary=True)
            case Actuator():
                if part.compliance > 0.0:
                    self._coordinate_joint(part.axis, rotary=False)
                    self.springs.append(LinearSpring(np.array([[part.compliance]])))
            case Beam():
                self._add_beam(part)

    def _add_beam(self, beam: Beam) -> None:
        own = frame(beam.own_frame)
        if beam.segments is None:
            self._mark(beam.name, 0.0)
            self._move(translation(beam.tip) @ own)
            self._spring_of_22(beam.tip_compliance())
            self._mark(beam.name, 1.0)
            self._move(own.T)
            return
        h = beam.length / beam.segments
        at = beam.placement.fraction
        section = beam.effective_section()
        self._move(beam.section_in_chain)
        self._mark(beam.name, 0.0)
        for i in range(beam.segments):
            self._move(translation([at * h, 0.0, 0.0]))
            if beam.placement is Placement.BEST:
                self._symmetric_spring(BeamColumnSpring(section, h))
            else:
                self._spring_of_22(section.compliance(h, at))
            self._move(translation([(1.0 - at) * h, 0.0, 0.0]))
            self._mark(beam.name, (i + 1) / beam.segments)
        self._move(frame(beam.section_frame.T) @ translation(beam.end_offset))
        if np.any(beam.end_offset):
            self._mark(beam.name, 1.0 + float(np.linalg.norm(beam.end_offset)) / beam.length)
        self._move(own.T)

    def _move(self, transform: Array) -> None:
        self._rigid = self._rigid @ transform

    def _coordinate_joint(self, axis: Array, *, rotary: bool) -> None:
        """A joint with a coordinate of its own."""
        self._joint(axis, self.size, 1.0, rotary=rotary)
        self.size += 1

    def _joint(self, axis: Array, coordinate: int, factor: float, *, rotary: bool) -> None:
        self._before.append(self._rigid)
        self._axis.append(np.asarray(axis, dtype=float))
        self._rotary.append(rotary)
        self._coordinate.append(coordinate)
        self._factor.append(factor)
        self._rigid = np.eye(4)

    def _spring_of_22(self, compliance: Array) -> None:
        """Shifts, then turns, as (22) has them."""
        for rotary in (False, True):
            for name in "xyz":
                self._coordinate_joint(AXES[name], rotary=rotary)
        self.springs.append(LinearSpring(compliance))

    def _symmetric_spring(self, law: Spring) -> None:
        """Half of the turns, the shifts, and the other half in reverse: the same seen from either end."""
        first = self.size
        for k, name in enumerate("xyz"):
            self._joint(AXES[name], first + 3 + k, 0.5, rotary=True)
        for k, name in enumerate("xyz"):
            self._joint(AXES[name], first + k, 1.0, rotary=False)
        for k, name in reversed(list(enumerate("xyz"))):
            self._joint(AXES[name], first + 3 + k, 0.5, rotary=True)
        self.size += 6
        self.springs.append(law)

    def _mark(self, part: str, fraction: float) -> None:
        self.stations.append(Station(part, fraction, len(self._rotary) - 1, self._rigid[:3, 3].copy()))
