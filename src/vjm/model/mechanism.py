"""The mechanism that a machine is: one-degree joints between rigid links, equations (1), (2) and (22).

It gives the geometry at a configuration, and the loads on the bodies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vjm.kernels.arrays import MachineArrays
from vjm.kernels.machine_solver import MachineSolver
from vjm.model.assembly import Assembly, BodyFrame, LinkSegment, Marker
from vjm.model.joint_limits import JointLimits, joint_limits
from vjm.model.load_case import Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.packing import Loads, closure_sites, coupling_rows, machine_arrays, packed, point_springs
from vjm.model.springs import BeamColumnSpring, LawSpring, Spring
from vjm.rank import null_space, rank_of
from vjm.rotations import Array, cross, rotations_from_vectors, translation


@dataclass(frozen=True)
class AppliedLoads:
    """Wrenches on l points of a model's bodies; all of them ``constant + factor · ramped``.

    Attributes:
        joint: ``(l,)`` last joint before each point, increasing.
        offset: ``(l, 3)`` position behind that joint, mm.
        follows: ``(l,)`` whether the wrench turns with the body.
        constant: ``(l, 6)`` N, N mm; in the axes of the frame behind the joint where it follows, else world.
        ramped: ``(l, 6)`` likewise, per unit of the load factor.
    """

    joint: np.ndarray
    offset: Array
    follows: np.ndarray
    constant: Array
    ramped: Array

    def __len__(self) -> int:
        return len(self.joint)

    @cached_property
    def turning(self) -> np.ndarray:
        """Indices of the points whose wrench is not conservative: it follows, or it is a moment."""
        wrench = np.abs(self.constant) + np.abs(self.ramped)
        result: np.ndarray = np.flatnonzero(
            (self.follows & wrench.any(axis=1)) | wrench[:, 3:].any(axis=1),
        )
        return result

    def gradual(self) -> AppliedLoads:
        """The constant loads alone, to be put on by the load factor."""
        return AppliedLoads(self.joint, self.offset, self.follows, np.zeros_like(self.constant), self.constant)


NO_LOADS = AppliedLoads(
    np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros(0, dtype=bool), np.zeros((0, 6)), np.zeros((0, 6))
)
"""Of a chain that is held at its end-effector and nowhere else."""


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
        """Values ``(…, m)`` of the joints, or their velocities, from those of the coordinates ``(…, n)``."""
        none = np.zeros((*x.shape[:-1], len(self.factor)))
        return self.factor * x[..., self.coordinate] if self.size else none

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


def force_hessian_times(acting: Sequence[tuple[Kinematics, Array]], motions: Array) -> Array:
    """What `force_hessian_of` makes of motions ``(n, k)``, at a cost linear in n.

    Its entries are products of what joint i and what joint j alone have, so that their sums are cumulative.
    """
    drive = acting[0][0].drive
    rates = drive.joints(motions.T).T[:, None]
    turning = [np.where(k.rotary[:, None], k.axes, 0.0) for k, _ in acting]
    linear, angular = (
        np.hstack([cross(wrench[half], turns) for (_, wrench), turns in zip(acting, turning, strict=True)])
        for half in (slice(0, 3), slice(3, 6))
    )
    shifts, turns = np.vstack([k.joint_jacobian[:3] for k, _ in acting]).T, np.hstack(turning)

    def passed(rows: Array) -> Array:
        """Sums ``(m, c, k)`` of the rates of all joints so far."""
        return np.cumsum(rows[:, :, None] * rates, axis=0)

    def before(rows: Array) -> Array:
        return passed(rows) - rows[:, :, None] * rates

    onwards = passed(shifts)[-1] - before(shifts)
    on_joints = np.einsum("mc,mck->km", shifts, before(linear)) + np.einsum("mc,mck->km", linear, onwards)
    return drive.gathered(on_joints + np.einsum("mc,mck->km", turns, before(angular))).T


Gravity = tuple[float, float, float]


class Mechanism:
    """A machine as rigid links, joints and virtual springs. Its beams are split before, see `Machine.split`.

    Attributes:
        chain: the machine.
        joints: names of the joints whose coordinates the data give: actuated, sprung and passive ones in the order
            of the parts; coupled ones follow from them.
        ends: names of the end frames; one empty name where the machine names none.
        coordinates: number n of its joints' coordinates.
        size: number of a state's components: the coordinates, the wrenches of closures between its bodies, and the
            forces of its couplings.
        passive: indices ``(n_q,)`` of the passive joints' coordinates among all coordinates.
        elastic: indices ``(n_θ,)`` of the virtual springs' coordinates.
        springs: the springs' laws, base to tool.
        stations: points along the chain that show its shape.
        pieces: the straight stretches of its rigid bodies, base to tool.
        closure_joints: last joints ``(c, 2)`` before the two frames of each closure, −1 for the base.
        closure_frames: those frames ``(c, 2, 4, 4)``, mm, behind these joints.
        applied_loads: the loads on its bodies.
        built: its joints and bodies, with each part's own coordinates.
    """

    def __init__(self, chain: Machine) -> None:
        self.chain = chain
        self.applied_loads = NO_LOADS
        self.built = built = Assembly(chain)
        self.joints, self.ends = built.joints, tuple(chain.ends) or ("",)
        self.coordinates = built.size
        self.size = built.size + sum(closure.rows for closure in chain.closures) + len(chain.couplings)
        self.parent = built.parent
        self.springs: list[Spring] = built.springs
        self.stations: list[Marker] = built.stations
        self.pieces: list[LinkSegment] = built.pieces
        self.passive = np.array(built.passive, dtype=int)
        self.elastic = np.array(built.elastic, dtype=int)
        self.joint_rotary = np.array(built.rotary, dtype=bool)
        self.drive = Drive(np.array(built.coordinate, dtype=np.int64), np.array(built.factor), self.size)
        # a spring's shifts are driven by sliding joints, its turns by turning ones
        self.rotary = np.zeros(built.size, dtype=bool)
        self.rotary[self.drive.coordinate[self.joint_rotary & (self.drive.factor != 0.0)]] = True
        self.axis = np.array(built.axis).reshape(-1, 3)
        self.before = np.array(built.before).reshape(-1, 4, 4)
        self.last, self.tail = built.last, built.rigid
        self.point_springs = point_springs(built)
        self._ways: dict[int, np.ndarray] = {}
        self.closure_joints, self.closure_frames = closure_sites(built)

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
        return kinematics.jacobian.T @ wrench

    def strain(self, reactions: Array) -> Array:
        """Coordinates ``(n,)`` of the springs under reactions ``(n,)``, zero on the passive joints."""
        result = np.zeros(self.size)
        for spring, where in self.blocks:
            result[where] = self.natural[where] + spring.strain(reactions[where])
        return result

    def under(self, applied_loads: AppliedLoads) -> Mechanism:
        """The same model with loads on its bodies."""
        return self if applied_loads is self.applied_loads else self._changed(applied_loads=applied_loads)

    def with_rest_shape(self, natural: Array) -> Mechanism:
        """The same model with springs that are free of stress at the coordinates ``natural`` (n,)."""
        return self._changed(natural=natural)

    def prestressed(self, x: Array) -> bool:
        """Whether a spring, between points or not, is under stress at the coordinates ``x`` (n,)."""
        return bool(np.any((self.natural - x)[self.elastic])) or bool(np.any(self.pulls(x)))

    def partially_unloaded(self, x: Array, share: float) -> Mechanism:
        """The same model with springs under a share of the stress that they have at the coordinates ``x`` (n,)."""
        natural, laws = self.natural.copy(), self.point_springs[2].copy()
        natural[self.elastic] -= (1.0 - share) * (self.natural - x)[self.elastic]
        laws[:, 2] -= (1.0 - share) * self.pulls(x)
        return self._changed(natural=natural, point_springs=(*self.point_springs[:2], laws))

    def pulls(self, x: Array) -> Array:
        """Forces ``(s,)`` of the springs between points, N, pulling positive."""
        springs = self.chain.point_springs
        own = [float(spring.pull(length)) for spring, length in zip(springs, self.spring_lengths(x), strict=True)]
        # of a model that is partially unloaded the preloads are not the machine's
        return np.array(own) + self.point_springs[2][:, 2] - [spring.preload for spring in springs]

    def spring_lengths(self, x: Array) -> Array:
        """Lengths ``(s,)`` of the springs between points, mm."""
        if not self.chain.point_springs:
            return np.zeros(0)
        ends = self._spring_ends(self.kinematics(x))
        return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)

    def _spring_ends(self, kinematics: Kinematics) -> Array:
        """Where the springs between points are fixed, ``(s, 2, 3)`` mm, world."""
        T = kinematics.behind[self.point_springs[0] + 1]
        return np.einsum("skab,skb->ska", T[..., :3, :3], self.point_springs[1]) + T[..., :3, 3]

    def _changed(self, **attributes: object) -> Mechanism:
        model = copy(self)
        model.__dict__.pop("compiled", None)
        model.__dict__.update(attributes)
        return model

    def span(self, part: str) -> range:
        """The coordinates of a part."""
        return self.built.spans[part]

    def end_of(self, part: str) -> BodyFrame:
        """Where a part ends."""
        return self.built.ends[part]

    def find(self, part: str, fraction: float) -> tuple[int, Array]:
        """The body that carries a point of a part, and where it is on it.

        Args:
            part: name of a part or an end frame; empty for the end-effector.
            fraction: fraction of the part's elastic length.

        Returns:
            Index of the last joint before the point, and its position ``(3,)`` mm in the frame behind that joint.

        Raises:
            ValueError: the part has no such point.
        """
        if not part:
            return self.last, self.tail[:3, 3]
        if part in self.chain.ends:
            site = self.built.ends[self.chain.ends[part]]
            return site.joint, site.frame[:3, 3]
        own = [piece for piece in self.pieces if piece.part == part]
        if not own:
            known = ", ".join(dict.fromkeys(piece.part for piece in self.pieces))
            raise ValueError(f"{self.chain.name}: no part '{part}' with points on it (there are {known})")
        # of two bodies that meet in a point the further one: what is applied there is beyond the spring
        near = 1e-9
        for piece in reversed(own):
            if piece.start - near <= fraction <= piece.stop + near:
                return piece.joint, piece.at(fraction)
        raise ValueError(
            f"{self.chain.name}: part '{part}' has points from 0 to 1 of its length, not at {fraction:g}"
        )

    def stiffness_under(self, reactions: Array) -> Array:
        """Tangent stiffness ``(n, n)`` of the springs under reactions ``(n,)``, zero on the passive joints."""
        K = np.zeros((self.size, self.size))
        for spring, where in self._alike:
            alone = len(where) == 1
            K[where[:, :, None], where[:, None, :]] = spring.tangent(reactions[where[0] if alone else where])
        return K

    def stiffness_times(self, reactions: Array, motions: Array) -> Array:
        """What that stiffness makes of motions ``(n, k)``, at a cost linear in n."""
        result = np.zeros_like(motions)
        for spring, where in self._alike:
            alone = len(where) == 1
            result[where] = spring.tangent(reactions[where[0] if alone else where]) @ motions[where]
        return result

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
    def compiled(self) -> MachineSolver:
        """What solves for its states: the model in compiled form, its end-effector held by a closure."""
        loads = self.applied_loads
        ground = np.array([[-1, self.last]]), np.stack([np.eye(4), self.tail])[None]
        machine = machine_arrays(
            self.built, self.coordinate_scale[: self.coordinates], float(self.wrench_scale[3]),
            self.characteristic_length,
            springs=self.point_springs,
            closures=(
                np.concatenate([ground[0], self.closure_joints]),
                np.concatenate([ground[1], self.closure_frames]),
                [6, *(closure.rows for closure in self.chain.closures)],
            ),
            spare=self.spare(held=True),
        )  # fmt: skip
        nothing = np.zeros((len(loads), 6))
        rows = [*zip(loads.joint.tolist(), loads.offset, nothing, loads.follows.tolist(), strict=True)]
        return MachineSolver(
            packed(machine, Loads.of(rows, loads.turning.tolist())), self.command,
            self.natural[: self.coordinates], loads.constant, loads.ramped,
            self.coordinate_scale, (self._station_joint, self._station_position),
        )  # fmt: skip

    def spare(self, *, held: bool) -> tuple[int, int]:
        """Number of what closures hold that others hold too, and of idle motions: those that nothing feels.

        Args:
            held: whether the end-effector's pose is imposed: it is one closure more then.
        """
        if not self.chain.closures and not self.chain.couplings:
            return 0, 0
        k = self._first_posture
        pose, stretched, loops = self.pose_rows(k), self.stretching_rows(k), self.closing_rows(k)
        holding = np.vstack([loops, pose]) if held else loops
        idle = null_space(np.vstack([loops, pose, stretched])[:, self.passive])
        return len(holding) - rank_of(holding).rank, idle.shape[1]

    @property
    def plain(self) -> bool:
        """Whether no spring of a joint has a law of its own."""
        return not any(isinstance(spring, LawSpring) for spring in self.springs)

    @cached_property
    def blocks(self) -> list[tuple[Spring, slice]]:
        """The springs with the range of their coordinates, base to tool."""
        starts = np.cumsum([0, *(len(spring.unloaded) for spring in self.springs)])[:-1]
        return [
            (s, slice(self.elastic[i], self.elastic[i] + len(s.unloaded)))
            for s, i in zip(self.springs, starts, strict=True)
        ]

    @cached_property
    def _alike(self) -> list[tuple[Spring, np.ndarray]]:
        """The springs with the coordinates ``(k, w)`` of all that are alike: of the segments of a beam."""
        rows: dict[int, tuple[Spring, list[range]]] = {}
        for number, (spring, where) in enumerate(self.blocks):
            key = id(spring) if isinstance(spring, BeamColumnSpring) else -1 - number
            rows.setdefault(key, (spring, []))[1].append(range(where.start, where.stop))
        return [(spring, np.array(where)) for spring, where in rows.values()]

    @cached_property
    def coordinate_scale(self) -> Array:
        """Unit of each component ``(size,)``: the characteristic length for shifts, one radian for turns.

        It is infinite for the closures' wrenches, which are no motion.
        """
        scale = np.full(self.size, np.inf)
        scale[: self.coordinates] = np.where(self.rotary, 1.0, self.characteristic_length)
        return scale

    @cached_property
    def wrench_scale(self) -> Array:
        """Unit of each wrench component ``(6,)``.

        From the springs' geometric mean rotational stiffness, so that scaled stiffnesses are of order one; where
        none turns, from that of shifts and of springs between points over the characteristic length.
        """
        own, length = np.zeros(self.coordinates), self.characteristic_length
        for spring, where in self.blocks:
            own[where] = spring.stiffness.diagonal()
        turns = own[self.rotary & (own > 0.0)]
        shifts = np.concatenate([own[~self.rotary & (own > 0.0)], np.abs(self.point_springs[2][:, 0])]) * length**2
        diagonal = turns if turns.size else shifts[shifts > 0.0]
        energy = float(np.exp(np.mean(np.log(diagonal)))) if diagonal.size else 1.0
        return np.repeat([energy / length, energy], 3)

    def configuration(self, q: Array, theta: Array | None = None) -> Array:
        """All coordinates ``(n,)`` from the passive ``(n_q,)`` and the virtual ``(n_θ,)`` or zero."""
        x = np.zeros(self.size)
        x[self.passive] = q
        if theta is not None:
            x[self.elastic] = theta
        return x

    def kinematics(self, x: Array) -> Kinematics:
        """Geometry and first derivatives at ``x`` (n,); joints beside the end-effector's way do not move it."""
        return self._kinematics(self.command + self.drive.joints(x))

    def _kinematics(self, joints: Array) -> Kinematics:
        """The same at the joints' values ``(m,)``."""
        behind, axes = self._placed(joints)
        end = behind[self.last + 1] @ self.tail
        on_way = self.way(self.last)
        J = self._joint_jacobian(behind, axes, end[:3, 3], on_way)
        return Kinematics(end, behind, axes, self.joint_rotary & on_way, J, self.drive, self.drive.gathered(J))

    def _placed(self, joints: Array) -> tuple[Array, Array]:
        """Frames ``(…, m + 1, 4, 4)`` behind the base and each joint, and axes, at joints' values ``(…, m)``."""
        local = np.zeros((*joints.shape, 4, 4))
        local[..., 3, 3] = 1.0
        local[..., :3, :3] = rotations_from_vectors(np.where(self.joint_rotary, joints, 0.0)[..., None] * self.axis)
        local[..., :3, 3] = np.where(self.joint_rotary, 0.0, joints)[..., None] * self.axis
        behind = np.empty((*joints.shape[:-1], joints.shape[-1] + 1, 4, 4))
        behind[..., 0, :, :], behind[..., 1:, :, :] = np.eye(4), self.before @ local
        for ancestor in self._ancestors:
            behind = behind[..., ancestor, :, :] @ behind
        return behind, np.einsum("...jab,jb->...ja", behind[..., 1:, :3, :3], self.axis)

    def end_reactions(self, x: Array, wrench: Array) -> Array:
        """`reactions` ``(k, n)`` of wrenches ``(k, 6)`` at as many configurations ``(k, n)``."""
        behind, axes = self._placed(self.command + self.drive.joints(x))
        end = behind[:, self.last + 1] @ self.tail
        force, arms = wrench[:, None, :3], end[:, None, :3, 3] - behind[:, 1:, :3, 3]
        push = np.where(self.joint_rotary[:, None], cross(arms, force) + wrench[:, None, 3:], force)
        return self.drive.gathered(np.einsum("kja,kja->kj", axes, push) * self.way(self.last))

    @cached_property
    def _ancestors(self) -> list[np.ndarray]:
        """The joint ``(m + 1,)`` one before each, two before, four before and so on, the base's being the base.

        Products from all joints to the base are made in as many steps as the longest row has binary digits (Hillis
        and Steele 1986, Communications of the ACM 29).
        """
        ancestor, result = np.concatenate([[0], np.asarray(self.parent) + 1]), list[np.ndarray]()
        while ancestor.any():
            result.append(ancestor)
            ancestor = ancestor[ancestor]
        return result

    def way(self, joint: int) -> np.ndarray:
        """Which joints ``(m,)`` lie before what is behind a joint, itself included; of the base, −1, none."""
        way = self._ways.get(joint)
        if way is None:
            way = self._ways[joint] = np.zeros(len(self.parent), dtype=bool)
            while joint >= 0:
                way[joint] = True
                joint = self.parent[joint]
        return way

    def _joint_jacobian(self, behind: Array, axes: Array, point: Array, moving: np.ndarray) -> Array:
        """Velocity ``(6, m)`` of a point by the joints, those that do not move it being zero."""
        turning = self.joint_rotary[:, None]
        shifts = np.where(turning, cross(axes, point - behind[1:, :3, 3]), axes)
        turns = np.where(turning, axes, 0.0)
        return (np.concatenate([shifts, turns], axis=1) * moving[:, None]).T

    def motion(self, kinematics: Kinematics, joint: int, point: Array) -> Array:
        """Velocity and angular velocity ``(6, size)`` of a point ``(3,)`` behind a joint by the coordinates'."""
        moving = self._joint_jacobian(kinematics.behind, kinematics.axes, point, self.way(joint))
        return self.drive.gathered(moving)

    def at_point(self, kinematics: Kinematics, joint: int, offset: Array) -> Kinematics:
        """The same geometry seen by a point ``offset`` (3,) mm behind a joint, −1 for the ground, as its end."""
        end = kinematics.behind[joint + 1] @ translation(offset)
        on_way = self.way(joint)
        J = self._joint_jacobian(kinematics.behind, kinematics.axes, end[:3, 3], on_way)
        turning = self.joint_rotary & on_way
        return replace(kinematics, end=end, rotary=turning, joint_jacobian=J, jacobian=self.drive.gathered(J))

    def stretching(self, kinematics: Kinematics) -> Array:
        """Derivative ``(s, n)`` of the lengths of the springs between points; zero where the two points meet."""
        rows = []
        for joints, ends in zip(self.point_springs[0], self._spring_ends(kinematics), strict=True):
            first, second = (self.motion(kinematics, j, end)[:3] for j, end in zip(joints, ends, strict=True))
            length = float(np.linalg.norm(ends[1] - ends[0]))
            along = (ends[1] - ends[0]) / length if length > 0.0 else np.zeros(3)
            rows.append(along @ (second - first))
        return np.array(rows).reshape(-1, self.size)

    def closing(self, kinematics: Kinematics) -> Array:
        """Derivative ``(f + k, size)`` of what closures and couplings hold by the coordinates; mm and rad."""
        rows = []
        for closure, joints, frames in zip(
            self.chain.closures, self.closure_joints, self.closure_frames, strict=True
        ):
            point = (kinematics.behind[joints[1] + 1] @ frames[1])[:3, 3]
            first, second = (
                self._joint_jacobian(kinematics.behind, kinematics.axes, point, self.way(j)) for j in joints
            )
            rows.append((second - first)[: closure.rows])
        couplings = np.zeros((len(self.chain.couplings), self.size))
        couplings[:, : self.coordinates] = coupling_rows(self.built)
        closed = [self.drive.gathered(np.concatenate(rows))] if rows else []
        return np.concatenate([*closed, couplings])

    def pose_rows(self, kinematics: Kinematics) -> Array:
        """Derivative ``(6, n)`` of the end-effector's pose by the coordinates, dimensionless, see `vjm.rank`."""
        return self._dimensionless(kinematics.jacobian, np.repeat([self.characteristic_length, 1.0], 3))

    def stretching_rows(self, kinematics: Kinematics) -> Array:
        """The same ``(s, n)`` of the lengths of springs between points."""
        return self._dimensionless(self.stretching(kinematics), np.full(1, self.characteristic_length))

    def closing_rows(self, kinematics: Kinematics) -> Array:
        """The same ``(f + k, n)`` of what closures and couplings hold."""
        return self._dimensionless(self.closing(kinematics), self.unit_of_closing)

    def _dimensionless(self, rows: Array, unit: Array) -> Array:
        return rows[:, : self.coordinates] * self.coordinate_scale[: self.coordinates] / unit[:, None]

    @cached_property
    def unit_of_closing(self) -> Array:
        """Units ``(f + k,)`` of what closures and couplings hold: lengths, turns."""
        own = [np.repeat([self.characteristic_length, 1.0], 3)[: closure.rows] for closure in self.chain.closures]
        return np.concatenate([*own, np.ones(len(self.chain.couplings))])

    @cached_property
    def _first_posture(self) -> Kinematics:
        stands = {joint.name: joint.value for joint in self.chain.held_joints if joint.value is not None}
        labels = [*self.chain.postures]
        own = (label for label in labels if stands.items() <= self.chain.held.get(label, {}).items())
        label = next(own, labels[0] if labels else None)
        q = np.zeros((1, len(self.joints))) if label is None else self.posture(label)[None]
        return self._kinematics(self.values(q)[0])

    @cached_property
    def free(self) -> int:
        """Number of motions that are left where the end-effector and all closures hold what they can.

        What closures hold that others hold too takes no motion away. Idle motions are left out: nothing feels them.
        """
        redundant, idle = self.spare(held=True)
        return self.coordinates - 6 - (self.size - self.coordinates) + redundant - idle

    def shape(self, kinematics: Kinematics) -> Array:
        """Positions ``(k, 3)`` of the stations in the world, mm."""
        T = kinematics.behind[self._station_joint + 1]
        return np.einsum("kab,kb->ka", T[:, :3, :3], self._station_position) + T[:, :3, 3]

    def velocities(self, x: Array, motion: Array) -> Array:
        """Velocities ``(k, 3)`` of the stations at ``x`` (n,), the coordinates moving by ``motion`` (n,)."""
        return self.shape_rate(self.kinematics(x), motion)

    def shape_rate(self, kinematics: Kinematics, velocity: Array) -> Array:
        """Velocities ``(k, 3)`` of the stations for velocities ``(n,)`` of the coordinates."""
        joints, turning = self.drive.joints(velocity)[:, None], self.joint_rotary[:, None]
        axes, places = kinematics.axes, kinematics.behind[1:, :3, 3]
        turns = np.where(turning, axes, 0.0) * joints
        # of what is carried, where it passes the world's origin
        shifts = np.where(turning, cross(places, axes), axes) * joints
        moved = np.concatenate([np.zeros((1, 6)), np.hstack([turns, shifts])])
        for ancestor in self._ancestors:
            moved = moved[ancestor] + moved
        moved = moved[self._station_joint + 1]
        return cross(moved[:, :3], self.shape(kinematics)) + moved[:, 3:]

    @cached_property
    def _station_joint(self) -> np.ndarray:
        return np.array([s.joint for s in self.stations], dtype=np.int64)

    @cached_property
    def _station_position(self) -> Array:
        return np.array([s.position for s in self.stations]).reshape(-1, 3)

    # --- what the data give -------------------------------------------------------------------------------

    def command_rows(self, q: Array | Mapping[str, float]) -> Array:
        """Rows ``(g, n_joints)`` of joint coordinates from such rows, one row, or values by name.

        Raises:
            ValueError: another number of columns, an unknown or missing name, or no finite number.
        """
        if isinstance(q, Mapping):
            unknown = set(q) - set(self.joints)
            if unknown:
                raise ValueError(f"{self.name}: no joint '{min(unknown)}'; its joints are {', '.join(self.joints)}")
            q = self.built.coordinates(q)
        rows = np.atleast_2d(np.asarray(q, dtype=float))
        if rows.ndim != 2 or rows.shape[1] != len(self.joints):
            raise ValueError(
                f"{self.chain.name}: q has the shape {rows.shape}; give a column for each of its "
                f"{len(self.joints)} joints: {', '.join(self.joints)}"
            )
        if not np.all(np.isfinite(rows)):
            raise ValueError(
                f"{self.chain.name}: row {int(np.argmin(np.isfinite(rows).all(axis=1)))} of q is not finite"
            )
        if self.chain.pushing or self.chain.riders:
            # a beam beyond its length is no machine, whatever a batch does with limits
            self.limits.refuse(rows)
        return rows

    @cached_property
    def limits(self) -> JointLimits:
        """Of the joints whose coordinates the data give, and of those that follow."""
        return joint_limits(self.chain, self.joints)

    def posture(self, label: str) -> Array:
        """Coordinates ``(n_joints,)`` of a posture; of a machine that is in one its held joints stay."""
        return self.command_rows(self.built.posture(label))[0]

    def values(self, q: Array) -> Array:
        """Values ``(g, m)`` of all one-degree joints that stand at rows of coordinates ``(g, n_joints)``."""
        return self.built.values(q)

    @cached_property
    def command(self) -> Array:
        """Values ``(m,)`` at which the joints stand in the machine's posture, passive ones at zero.

        Raises:
            ValueError: the machine is in none, see `Machine.at`.
        """
        return self.values(self.built.stands[None])[0]

    @cached_property
    def natural(self) -> Array:
        """Components ``(size,)`` of the state at which the springs are free of stress in the machine's posture."""
        natural = np.zeros(self.size)
        natural[: self.coordinates] = self.naturals(self.built.stands[None])[0]
        return natural

    def naturals(self, q: Array) -> Array:
        """Coordinates ``(g, n)`` at which the springs are free of stress."""
        natural = np.zeros((len(q), self.coordinates))
        for coordinate, value in self.built.natural.items():
            natural[:, coordinate] = value
        for coordinate, (name, rest) in self.built.rests.items():
            natural[:, coordinate] = rest - q[:, self.joints.index(name)]
        return natural

    def torques(self, forces: Array) -> Array:
        """What holds each joint ``(g, n_joints)``, N mm or N, from the loads' forces ``(g, m)`` on all joints.

        A joint to which others are coupled under load bears its share of theirs.
        """
        return -forces @ self._carried.T

    @cached_property
    def _carried(self) -> Array:
        share = {name: np.eye(len(self.joints))[i] for i, name in enumerate(self.joints)}
        for joint in self.chain.moving:
            if joint.coupling is not None:
                own = [ratio * share[name] for name, ratio in joint.passes_on]
                share[joint.name] = sum(own, np.zeros(len(self.joints)))
        result = np.zeros((len(self.joints), len(self.built.parent)))
        for i, name in self.built.held.items():
            # what pushes a beam out bears what its end does, and each of the beam's joints but a share of that
            result[:, i] = self.built.bears.get(i, self.built.share.get(i, 1.0)) * share[name]
        return result

    def weighed(self) -> tuple[str, ...]:
        """The part of each weight in `arrays`, in their order."""
        return tuple(piece.part for piece in self.built.pieces if piece.mass > 0.0 and piece.joint >= 0)

    def driven_by(self, part: str) -> int:
        """The one-degree joint that stands at the value of a held joint; the first where they are many."""
        return next(joint for joint, name in self.built.held.items() if name == part)

    def shares(self, part: str) -> dict[int, float]:
        """All one-degree joints that stand at the value of a held joint, and at which share of it."""
        return {joint: self.built.share.get(joint, 1.0) for joint, name in self.built.held.items() if name == part}

    def refuse_rigid(self) -> None:
        """Refuse a machine in which nothing deflects.

        Raises:
            ValueError: saying what to add.
        """
        if not self.coordinates:
            raise ValueError(
                f"{self.name}: nothing deflects: give a joint a compliance, or add a beam (kind = 'beam')"
            )

    # --- end frames free ----------------------------------------------------------------------------------

    def _end(self, name: str) -> BodyFrame:
        last = self.chain.parts[-1].name if self.chain.parts else ""
        return self.built.ends[self.chain.ends.get(name, last)]

    def arrays(
        self, gravity: Gravity | None = None, loads: Sequence[Load] = (), *, moments: bool = False
    ) -> MachineArrays:
        """The machine under weight, m/s², and loads, all in full.

        With ``moments`` the wrenches on the end frames may have moments: they stand among the loads then, last.

        Raises:
            ValueError: a load stands on no point of the machine, or nothing in it deflects.
        """
        rows: list[tuple[int, Array, Array, bool, int]] = []
        if gravity is not None:
            for piece in self.built.pieces:
                if piece.mass > 0.0:
                    weight = np.concatenate([piece.mass * np.asarray(gravity, dtype=float), np.zeros(3)])
                    rows.append((piece.joint, piece.centre_of_mass, weight, False, piece.grows))
        for load in loads:
            rows.append((*self.find(load.part, load.at), np.array(load.wrench), load.follower, -1))
        # what stands on the base moves nothing
        rows = [row for row in rows if row[0] >= 0]
        turning = [k for k, (_, _, wrench, follows, _) in enumerate(rows) if follows or np.any(wrench[3:])]
        ends = [-1] * len(rows)
        for k, site in enumerate(self._end(name) for name in self.ends):
            if moments and site.joint >= 0:
                turning.append(len(rows))
                rows.append((site.joint, site.frame[:3, 3], np.zeros(6), False, -1))
                ends.append(k)
        acting = Loads.of([row[:4] for row in rows], turning, [row[4] for row in rows], ends)
        return packed(self._free, acting)

    @cached_property
    def _free(self) -> MachineArrays:
        """What it consists of, its end frames free."""
        self.refuse_rigid()
        return machine_arrays(
            self.built, self.unit, None, self.reach,
            springs=self.point_springs,
            closures=(self.closure_joints, self.closure_frames, [closure.rows for closure in self.chain.closures]),
            ends=[self._end(name) for name in self.ends], spare=self.spare(held=False),
        )  # fmt: skip

    @cached_property
    def reach(self) -> float:
        """Length of all links in mm: more than the machine can reach."""
        links = [*self.built.before, *(self._end(name).frame for name in self.ends)]
        grown = sum(beam.length for beam in self.chain.beams if beam.name in self.built.growing)
        return max(1.0, grown + sum(float(np.linalg.norm(T[:3, 3])) for T in links))

    @cached_property
    def unit(self) -> Array:
        """1 for turns, the machine's reach in mm for shifts ``(n,)``."""
        return np.where(self.rotary, 1.0, self.reach)


def loading_of(model: Mechanism, x: Array, load_case: LoadCase) -> tuple[AppliedLoads, np.ndarray, int]:
    """The loads of a load case on a model whose unloaded coordinates are ``x`` (n,).

    Returns:
        The loading; which of its points ``(l,)`` bear what acts on the end-effector; and the index of the point
        that a `PointControl` watches, −1 where there is none.

    Raises:
        ValueError: a load stands on a point that the model does not have.
    """
    rows: list[tuple[int, Array, bool, Array, Array, bool, bool]] = []
    nothing = np.zeros(6)
    for load in load_case.loads:
        joint, offset = model.find(load.part, load.at)
        wrench = np.array(load.wrench)
        if load.follower:
            R = model.kinematics(x).behind[joint + 1][:3, :3]
            wrench = np.concatenate([R.T @ wrench[:3], R.T @ wrench[3:]])
        constant, ramped = (nothing, load_case.sign * wrench) if load.ramped else (wrench, nothing)
        rows.append((joint, offset, load.follower, constant, ramped, not load.part, False))
    if load_case.gravity is not None:
        for piece in model.pieces:
            if piece.mass > 0.0:
                weight = np.concatenate([piece.mass * np.array(load_case.gravity), np.zeros(3)])
                parts = (nothing, load_case.sign * weight) if load_case.weight_ramped else (weight, nothing)
                rows.append((piece.joint, piece.centre_of_mass, False, *parts, False, False))
    if isinstance(load_case.control, PointControl):
        joint, offset = model.find(load_case.control.part, load_case.control.at)
        if joint < 0:
            raise ValueError(
                f"part '{load_case.control.part}' is fixed to the base: its displacement cannot control a path"
            )
        rows.append((joint, offset, False, nothing, nothing, False, True))
    # what stands on the base moves nothing
    rows = sorted((row for row in rows if row[0] >= 0), key=lambda row: row[0])
    if not rows:
        return NO_LOADS, np.zeros(0, dtype=bool), -1
    joints, offsets, follows, constant, ramped, tool, watched = (np.array(c) for c in zip(*rows, strict=True))
    where = int(np.argmax(watched)) if watched.any() else -1
    return AppliedLoads(joints, offsets, follows, constant, ramped), tool, where
