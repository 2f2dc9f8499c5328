"""The virtual joint model of a chain: one-degree joints between rigid links, equations (1), (2) and (22).

Every joint, passive or virtual, is a shift along or a turn about an axis; a coordinate drives one joint or two, see
`vjm.model.assembly`. All kinematics follow from the joints' axes in the world frame, and one code path serves every
chain.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vjm.kernels.compiled_model import CompiledModel
from vjm.kernels.packed_model import PackedModel
from vjm.kernels.recursion import frames_behind
from vjm.kernels.state_solver import BodySolver
from vjm.model.applied_loads import NO_LOADS, AppliedLoads
from vjm.model.assembly import Assembly, Piece, Station
from vjm.model.chain import Chain
from vjm.model.pack import loaded_points, packed
from vjm.model.springs import LinearSpring, Spring
from vjm.rotations import Array


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
        pieces: the straight stretches of its rigid bodies, base to tool.
        natural: coordinates ``(n,)`` at which the springs are free of stress.
        applied_loads: the loads on its bodies.
    """

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self.applied_loads = NO_LOADS
        built = self._assembled()
        self.size = built.size
        self.springs: list[Spring] = built.springs
        self.stations: list[Station] = built.stations
        self.pieces: list[Piece] = built.pieces
        self.natural = np.zeros(self.size)
        self.natural[list(built.natural)] = list(built.natural.values())
        self.passive = np.array(built.passive, dtype=int)
        self.elastic = np.array(built.elastic, dtype=int)
        self.joint_rotary = np.array(built.rotary, dtype=bool)
        self.drive = np.zeros((len(built.rotary), self.size))
        self.drive[np.arange(len(built.rotary)), built.coordinate] = built.factor
        # a spring's shifts are driven by sliding joints, its turns by turning ones
        self.rotary = self.drive[self.joint_rotary].any(axis=0)
        self.axis = np.array(built.axis).reshape(-1, 3)
        self.before = np.array(built.before).reshape(-1, 4, 4)
        self.tail = built.rigid
        self._skew: Array = np.cross(self.axis[:, None, :], np.eye(3)).transpose(0, 2, 1)
        self._skew2 = self._skew @ self._skew

    def _assembled(self) -> Assembly:
        """The chain's joints and bodies."""
        self.chain.refuse_tree("this engine")
        return Assembly(self.chain)

    @property
    def name(self) -> str:
        """Of the machine."""
        return self.chain.name

    @property
    def characteristic_length(self) -> float:
        """Of the chain, mm: the unit of translations."""
        return self.chain.characteristic_length

    def reactions(self, kinematics: Kinematics, wrench: Array) -> Array:
        """Generalised forces ``(n,)`` of a wrench ``(6,)`` on the coordinates: ``Jᵀ F`` (8)."""
        result: Array = kinematics.jacobian.T @ wrench
        return result

    def strain(self, reactions: Array) -> Array:
        """Coordinates ``(n,)`` of the springs under reactions ``(n,)``, zero on the passive joints."""
        result = np.zeros(self.size)
        for spring, where in self.blocks:
            result[where] = self.natural[where] + spring.strain(reactions[where])
        return result

    def under(self, applied_loads: AppliedLoads) -> LumpedModel:
        """The same model with loads on its bodies."""
        if applied_loads is self.applied_loads:
            return self
        points = loaded_points(applied_loads, self.characteristic_length)
        return self._changed(applied_loads=applied_loads, arrays=self.arrays._replace(**points))

    def bent(self, natural: Array) -> LumpedModel:
        """The same model with springs that are free of stress at the coordinates ``natural`` (n,)."""
        return self._changed(natural=natural, arrays=self.arrays._replace(natural=natural / self.coordinate_scale))

    def strained(self, x: Array) -> bool:
        """Whether a spring is under stress at the coordinates ``x`` (n,)."""
        return bool(np.any((self.natural - x)[self.elastic]))

    def eased(self, x: Array, share: float) -> LumpedModel:
        """The same model with springs under a share of the stress that they have at the coordinates ``x`` (n,)."""
        natural = self.natural.copy()
        natural[self.elastic] -= (1.0 - share) * (self.natural - x)[self.elastic]
        return self.bent(natural)

    def _changed(self, **attributes: object) -> LumpedModel:
        model = copy(self)
        model.__dict__.pop("compiled", None)
        model.__dict__.update(attributes)
        return model

    def find(self, part: str, at: float) -> tuple[int, Array]:
        """The body that carries a point of a part, and where it is on it.

        Args:
            part: name of a part; empty for the end-effector.
            at: fraction of the part's elastic length.

        Returns:
            Index of the last joint before the point, and its position ``(3,)`` mm in the frame behind that joint.

        Raises:
            ValueError: the part has no such point.
        """
        if not part:
            return len(self.joint_rotary) - 1, self.tail[:3, 3]
        own = [piece for piece in self.pieces if piece.part == part]
        if not own:
            known = ", ".join(dict.fromkeys(piece.part for piece in self.pieces))
            raise ValueError(f"{self.chain.name}: no part '{part}' with points on it (there are {known})")
        # of two bodies that meet in a point the further one: what is applied there is beyond the spring
        near = 1e-9
        for piece in reversed(own):
            if piece.start - near <= at <= piece.stop + near:
                return piece.joint, piece.at(at)
        raise ValueError(f"{self.chain.name}: part '{part}' has points from 0 to 1 of its length, not at {at:g}")

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
            K[where, where] = spring.stiffness
        return K

    @cached_property
    def compliance(self) -> Array:
        """``k_θ = K_θ⁻¹`` without load, block diagonal ``(n_θ, n_θ)``."""
        k = np.zeros((self.size, self.size))
        for spring, where in self.blocks:
            k[where, where] = spring.unloaded
        return k[np.ix_(self.elastic, self.elastic)]

    @cached_property
    def arrays(self) -> PackedModel:
        """The model as the kernels take it."""
        return packed(self)

    @cached_property
    def compiled(self) -> BodySolver:
        """What solves for its states: the model in compiled form."""
        loads = self.applied_loads
        return CompiledModel(
            self.arrays, loads.constant, loads.ramped, (self.coordinate_scale, self.wrench_scale),
            self.characteristic_length, (self._station_joint, self._station_position),
        )  # fmt: skip

    @property
    def compiled_series(self) -> CompiledModel:
        """`compiled` of parts in series, with what only that has: marches along a grid, and packed buffers.

        Raises:
            ValueError: the joints form a tree.
        """
        solver = self.compiled
        if isinstance(solver, CompiledModel):
            return solver
        chain = self.chain
        why = (
            "branches" if chain.after else "springs between two parts" if chain.point_springs else "a wide coupling"
        )
        raise ValueError(
            f"{chain.name} has {why}: readings along a ramp are computed for parts in series only; "
            f"take curve, buckling, stiffness or compensate"
        )

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
        return np.where(self.rotary, 1.0, self.characteristic_length)

    @cached_property
    def wrench_scale(self) -> Array:
        """Unit of each wrench component ``(6,)``.

        From the springs' geometric mean rotational stiffness, so that scaled stiffnesses are of order one.
        """
        diagonal = np.diag(self.stiffness)[self.rotary & (np.diag(self.stiffness) > 0.0)]
        energy = float(np.exp(np.mean(np.log(diagonal)))) if diagonal.size else 1.0
        length = self.characteristic_length
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
        frames_behind(step, behind)
        end = behind[-1] @ self.tail
        # an axis is not moved by its own joint
        axes = np.einsum("jab,jb->ja", behind[1:, :3, :3], self.axis)
        lever = end[:3, 3] - behind[1:, :3, 3]
        J = np.zeros((6, m))
        J[:3] = np.where(self.joint_rotary[:, None], np.cross(axes, lever), axes).T
        J[3:, self.joint_rotary] = axes[self.joint_rotary].T
        return Kinematics(end, behind, axes, self.joint_rotary, J, self.drive, J @ self.drive)

    def stretching(self, kinematics: Kinematics) -> Array:
        """Derivative ``(s, n)`` of the lengths of springs between points: a chain has none."""
        return np.zeros((0, self.size))

    def shape(self, kinematics: Kinematics) -> Array:
        """Positions ``(k, 3)`` of the stations in the world, mm."""
        T = kinematics.behind[self._station_joint + 1]
        result: Array = np.einsum("kab,kb->ka", T[:, :3, :3], self._station_position) + T[:, :3, 3]
        return result

    def velocities(self, x: Array, motion: Array) -> Array:
        """Velocities ``(k, 3)`` of the stations at ``x`` (n,), the coordinates moving by ``motion`` (n,)."""
        return self.shape_rate(self.kinematics(x), motion)

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
        return np.array([s.joint for s in self.stations], dtype=np.int64)

    @cached_property
    def _station_position(self) -> Array:
        return np.array([s.position for s in self.stations]).reshape(-1, 3)
