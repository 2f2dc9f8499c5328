"""A machine in equilibrium, with the matrices of small motions about it.

Its tangent with what closures hold is one regular system of equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from vjm.continuation.one_path import END, foresee
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.errors import MechanismError, NoConvergenceError
from vjm.machine.equilibria import Equilibria, equilibria
from vjm.model.end_condition import held
from vjm.model.law_states import free_words, law_states
from vjm.model.load_case import COMPONENTS, LOAD, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import (
    NO_LOADS,
    AppliedLoads,
    Gravity,
    Kinematics,
    Mechanism,
    force_hessian_of,
    force_hessian_times,
    loading_of,
)
from vjm.model.parameters import Parameter
from vjm.model.springs import LawSpring
from vjm.plain_numbers import finite_numbers
from vjm.postures import Posture, check_machine, in_posture
from vjm.rank import SUM_ROUNDING, null_space, split
from vjm.rotations import Array, skew


class TangentSystem:
    """Solves for motions and multipliers, scaled.

    Attributes:
        matrix: ``(m + k, m + k)`` with its borders.
        borders: their number k.
    """

    def __init__(self, B: Array, right: Array, left: Array) -> None:
        """Border a matrix and factor it.

        Args:
            B: ``(m, m)`` tangent and rows, scaled.
            right: ``(m, k)`` forces W that are added in unknown amounts.
            left: ``(m, k)`` what solutions are perpendicular to, V.
        """
        k = self.borders = right.shape[1]
        self.matrix = np.block([[B, right], [left.T, np.zeros((k, k))]]) if k else B
        self._factors = lu_factor(self.matrix, check_finite=False)

    def solve(self, forces: Array, *, transposed: bool = False) -> tuple[Array, Array]:
        """Solution ``(m, …)`` for right sides ``(m, …)``, and the amounts ``(k, …)`` of W that they need."""
        return self._parts(np.concatenate([forces, np.zeros((self.borders, *forces.shape[1:]))]), transposed)

    def null(self, *, transposed: bool = False) -> tuple[Array, Array]:
        """Vectors ``(m, k)`` with unit products with V that the matrix takes to W times amounts ``(k, k)``."""
        m, k = len(self.matrix) - self.borders, self.borders
        return self._parts(np.vstack([np.zeros((m, k)), np.eye(k)]), transposed)

    def _parts(self, right: Array, transposed: bool) -> tuple[Array, Array]:
        A = self.matrix.T if transposed else self.matrix
        y = self._substituted(right, transposed)
        # one step of refinement brings back the digits that row exchanges of unequal rows cost
        y = y + self._substituted(right - A @ y, transposed)
        m = len(self.matrix) - self.borders
        return y[:m], y[m:]

    def _substituted(self, right: Array, transposed: bool) -> Array:
        return np.asarray(lu_solve(self._factors, right, 1 if transposed else 0, check_finite=False), dtype=float)


@dataclass(frozen=True, eq=False)
class Question:
    """A machine in a posture, and what is done to it. Two are equal where they are one.

    Attributes:
        machine: its beams not yet split; a platform as one machine with closures.
        posture: label.
        engine: that splits the beams.
        displacement: ``(6,)`` at which its end is held, mm and rad; None where the end is free.
        wrench: ``(6,)`` on the free end, N and N mm, world axes.
        gravity: m/s².
        loads: on parts, in full.
        end: name of the end frame; empty for the first, or the only one.
    """

    machine: Machine
    posture: str
    engine: VjmEngine
    displacement: tuple[float, ...] | None = None
    wrench: tuple[float, ...] = (0.0,) * 6
    gravity: Gravity | None = None
    loads: tuple[Load, ...] = ()
    end: str = ""

    @cached_property
    def unloaded(self) -> Question:
        """The same without loads; the end stays held where it is held."""
        held = None if self.displacement is None else (0.0,) * 6
        return replace(self, displacement=held, wrench=(0.0,) * 6, gravity=None, loads=())

    @cached_property
    def model(self) -> Mechanism:
        """The machine in the posture with the engine's springs."""
        return self.engine.model(self.machine.at(self.posture))

    @cached_property
    def drawn_end(self) -> Array:
        """Frame ``(4, 4)`` of the end frame as drawn, from which displacements count."""
        drawn = self.model.kinematics(self.model.configuration(self.model.chain.posture(self.posture)))
        return self.model.at_point(drawn, *self.model.find(self.end, 1.0)).end

    @property
    def acting(self) -> tuple[Load, ...]:
        """All wrenches but weight, that on the end among them."""
        loads = tuple(replace(load, ramped=False) for load in self.loads)
        if any(self.wrench):
            loads += (Load(self.wrench, self.end, ramped=False),)
        return loads


def loaded_posture(
    machine: Machine,
    posture: Posture = "",
    *,
    displacement: Sequence[float] | None = None,
    wrench: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    engine: VjmEngine | None = None,
) -> Question:
    """A machine in a posture under loads, checked.

    Args:
        machine: see `vjm.load`.
        posture: label or coordinates; the first one if left out.
        displacement: ``(6,)`` at which the end is held, mm and rad, world axes; the end is free if left out.
        wrench: ``(6,)`` on the free end, dead, N and N mm, world axes.
        gravity: ``(3,)`` m/s²: the parts have their weight.
        loads: on parts, in full.
        end: name of the end frame; the first if left out.
        engine: how its beams become springs; as `vjm` if left out.

    Raises:
        ValueError: not six finite numbers, a held end that is loaded, or no such posture or end frame.
    """
    held = None if displacement is None else finite_numbers("displacement", displacement, 6)
    on_end = (0.0,) * 6 if wrench is None else finite_numbers("wrench", wrench, 6)
    if gravity is not None:
        finite_numbers("gravity", gravity, 3)
    if displacement is not None and (wrench is not None or gravity is not None or loads or end):
        raise ValueError("displacement holds the end in its pose: leave out wrench, gravity, loads and end frame")
    check_machine(machine)
    label = posture or next(iter(machine.postures), "")
    chain, label = in_posture(machine, label)
    if end and end not in chain.ends:
        raise ValueError(f"{chain.name} has no end frame '{end}' (it has {', '.join(chain.ends) or 'none'})")
    if engine is None:
        link, foot = chain.usual_segments
        engine = VjmEngine(link, foot)
    if not end and displacement is None:
        end = next(iter(chain.ends), "")
    return Question(chain, label, engine, held, on_end, gravity, tuple(loads), end)


@dataclass(frozen=True, eq=False)
class LinearState:
    """A machine in an equilibrium, and its small motions about it.

    Attributes:
        question: what is done to it.
        model: its springs and joints, n coordinates.
        x: ``(size,)`` the coordinates, the closures' wrenches and the couplings' forces, see `Mechanism`.
        wrench: ``(6,)`` on the end: what holds it, or nothing beside ``loading``.
        loading: dead and follower wrenches, weight among them.
        moved: ``(6,)`` displacement of the end from the unloaded posture, mm and rad.
        stable: whether the equilibrium is stable with its end free; of a held end it is not examined.
        secants: in place of the tangents of springs' laws the slopes of chords, by the coordinates of those in
            joints and by the numbers of those between points.
    """

    question: Question
    model: Mechanism
    x: Array
    wrench: Array
    loading: AppliedLoads
    moved: Array
    stable: bool = True
    secants: tuple[Mapping[int, float], Mapping[int, float]] = ({}, {})

    @property
    def n(self) -> int:
        """Number of its coordinates."""
        return self.model.coordinates

    @cached_property
    def rates(self) -> dict[Parameter, Array]:
        """Derivatives by parameters that were asked for, which all quantities share; see `changes.state_rate`."""
        return {}

    @cached_property
    def kinematics(self) -> Kinematics:
        """Of the end-effector behind the last part."""
        return self.model.kinematics(self.x)

    def at(self, joint: int, offset: Array) -> Kinematics:
        """Of a point ``offset`` (3,) mm behind a joint, −1 for the ground."""
        return self.model.at_point(self.kinematics, joint, offset)

    def point_jacobians(self, joints: np.ndarray, offsets: Array) -> Array:
        """Motions ``(k, 6, n)`` by the coordinates of points ``(k, 3)`` mm behind joints ``(k,)``."""
        pairs = zip(joints.tolist(), offsets, strict=True)
        return np.stack([self.at(joint, offset).jacobian[:, : self.n] for joint, offset in pairs])

    @cached_property
    def end(self) -> Kinematics:
        """Of the end frame that is asked for."""
        return self.at(*self.model.find(self.question.end, 1.0))

    @cached_property
    def jacobian(self) -> Array:
        """``(6, n)`` of the end frame, mm and rad, world axes."""
        return self.end.jacobian[:, : self.n]

    @cached_property
    def unit(self) -> Array:
        """Of each coordinate ``(n,)``: mm or rad that a work of 1 N mm strains its own spring by.

        Of a coordinate without a spring it is what the machine's units of length and energy make of it. In these
        units the tangent's diagonal is one, and solutions lose few digits.
        """
        own = np.diag(self.spring_stiffness)
        free = self.model.coordinate_scale[: self.n] / np.sqrt(self.model.wrench_scale[3])
        return np.where(own > 0.0, 1.0 / np.sqrt(np.where(own > 0.0, own, 1.0)), free)

    # --- forces -------------------------------------------------------------------------------------------

    def load_forces(self, loading: AppliedLoads) -> Array:
        """Generalised forces ``(n,)`` of loads where the machine stands, N mm and N; sums of rounding are zero."""
        total, size, length = np.zeros(self.n), 0.0, self.model.characteristic_length
        for k, wrench, _ in self._acting(loading):
            total += k.jacobian[:, : self.n].T @ wrench
            size += float(np.linalg.norm(wrench[:3]) * length + np.linalg.norm(wrench[3:]))
        return np.where(np.abs(total) * self.model.coordinate_scale[: self.n] > SUM_ROUNDING * size, total, 0.0)

    def _acting(self, loading: AppliedLoads) -> list[tuple[Kinematics, Array, bool]]:
        wrenches = []
        for joint, offset, follows, wrench in zip(
            loading.joint, loading.offset, loading.follows, loading.constant, strict=True
        ):
            k = self.at(int(joint), offset)
            if follows:
                wrench = np.concatenate([k.end[:3, :3] @ wrench[:3], k.end[:3, :3] @ wrench[3:]])
            wrenches.append((k, wrench, bool(follows)))
        return wrenches

    @cached_property
    def _wrenches(self) -> list[tuple[Kinematics, Array, bool]]:
        """All wrenches on its bodies: loads, what holds its end, and its closures' on both their bodies."""
        wrenches = [*self._acting(self.loading), (self.end, self.wrench, False)]
        joints, frames = self.model.closure_joints, self.model.closure_frames
        row = self.n
        for closure, (first, second), own in zip(self.model.chain.closures, joints, frames, strict=True):
            force = np.zeros(6)
            force[: closure.rows] = self.x[row : row + closure.rows]
            row += closure.rows
            on_second = self.at(second, own[1][:3, 3])
            place = np.linalg.inv(self.kinematics.behind[first + 1]) @ on_second.end
            wrenches += [(on_second, force, False), (self.at(first, place[:3, 3]), -force, False)]
        return wrenches

    @cached_property
    def _point_springs(self) -> list[tuple[Kinematics, Kinematics, Array, float, float, float]]:
        """Both ends of each spring between points, its axis, length, tangent stiffness and pull."""
        spring_states = []
        springs, pulls = self.model.chain.point_springs, self.model.pulls(self.x)
        for joints, points, spring, pull in zip(
            *self.model.point_springs[:2], springs, pulls.tolist(), strict=True
        ):
            first, second = (self.at(int(j), p) for j, p in zip(joints, points, strict=True))
            apart = second.end[:3, 3] - first.end[:3, 3]
            length = float(np.linalg.norm(apart))
            if not length:
                raise ValueError(
                    f"{self.model.name}: the two points of a spring meet, so that its direction is not defined"
                )
            spring_states.append((first, second, apart / length, length, float(spring.tangent(length)), pull))
        return spring_states

    @cached_property
    def stretching(self) -> Array:
        """Derivative ``(s, n)`` of the lengths of the springs between points."""
        return self.model.stretching(self.kinematics)[:, : self.n]

    @cached_property
    def point_stiffness(self) -> Array:
        """Tangent stiffness ``(s,)`` of the springs between points, N/mm."""
        tangents = [spring[4] for spring in self._point_springs]
        return np.array([self.secants[1].get(k, own) for k, own in enumerate(tangents)], dtype=float)

    @cached_property
    def lengths(self) -> Array:
        """Lengths ``(s,)`` of the springs between points, mm."""
        return np.array([spring[3] for spring in self._point_springs], dtype=float)

    @cached_property
    def pulls(self) -> Array:
        """Forces ``(s,)`` of the springs between points, N, pulling positive."""
        return np.array([spring[-1] for spring in self._point_springs], dtype=float)

    @cached_property
    def reactions(self) -> Array:
        """Generalised forces ``(size,)`` of all wrenches on the coordinates: what the virtual springs bear."""
        total = sum((k.jacobian.T @ wrench for k, wrench, _ in self._wrenches), np.zeros(self.model.size))
        total = total - self.model.stretching(self.kinematics).T @ self.pulls
        couplings = len(self.model.chain.couplings)
        if couplings:
            total = total + self.model.closing(self.kinematics)[-couplings:].T @ self.x[-couplings:]
        return total

    # --- matrices -----------------------------------------------------------------------------------------

    @property
    def spring_stiffness(self) -> Array:
        """Tangent stiffness ``(n, n)`` of the virtual springs, zero on the passive joints."""
        K = self.model.stiffness_under(self.reactions)[: self.n, : self.n]
        for coordinate, secant in self.secants[0].items():
            K[coordinate, coordinate] = secant
        return K

    @property
    def elastic_stiffness(self) -> Array:
        """The same ``(n, n)`` with the springs between points along themselves."""
        S, K = self.stretching, self.spring_stiffness
        K += S.T @ (self.point_stiffness[:, None] * S)
        return K

    @cached_property
    def tangent(self) -> Array:
        """Derivative ``(n, n)`` of what the springs lack by the coordinates: ``K − H``, the loads turning with it.

        It is symmetric on what the closures leave, but under followers and moments.
        """
        result = self.elastic_stiffness
        result -= self.geometric
        return result

    @property
    def geometric(self) -> Array:
        """``H`` ``(n, n)``: what all forces add to as the machine moves."""
        acting, pairs = self._forces_on_way
        H = force_hessian_of(acting) if acting else np.zeros((self.model.size, self.model.size))
        for first, second in pairs:
            H += first.T @ second
        return H[: self.n, : self.n]

    @cached_property
    def _forces_on_way(self) -> tuple[list[tuple[Kinematics, Array]], list[tuple[Array, Array]]]:
        """Wrenches that points take along; pairs ``(3 or 6, size)`` whose products are what turning adds to H."""
        acting = [(k, wrench) for k, wrench, _ in self._wrenches if wrench.any()]
        pairs = [
            (k.jacobian, np.vstack([-skew(wrench[:3]), -skew(wrench[3:])]) @ k.jacobian[3:])
            for k, wrench, follows in self._wrenches
            if follows
        ]
        for first, second, along, length, _, pull in self._point_springs:
            force = np.concatenate([pull * along, np.zeros(3)])
            acting += [(first, force), (second, -force)]
            apart = (second.jacobian - first.jacobian)[:3]
            pairs.append((apart, -(pull / length * (np.eye(3) - np.outer(along, along))) @ apart))
        return acting, pairs

    def tangent_times(self, motions: Array) -> Array:
        """What `tangent` makes of motions ``(n, k)``, at a cost linear in n."""
        acting, pairs = self._forces_on_way
        padded = np.vstack([motions, np.zeros((self.model.size - self.n, motions.shape[1]))])
        result, S = self.springs_times(motions), self.stretching
        result += S.T @ (self.point_stiffness[:, None] * (S @ motions))
        for first, second in pairs:
            result -= (first.T @ (second @ padded))[: self.n]
        if acting:
            result -= force_hessian_times(acting, padded)[: self.n]
        return result

    def springs_times(self, motions: Array) -> Array:
        """What `spring_stiffness` makes of motions ``(n, k)``, likewise."""
        padded = np.vstack([motions, np.zeros((self.model.size - self.n, motions.shape[1]))])
        result: Array = self.model.stiffness_times(self.reactions, padded)[: self.n]
        for coordinate, secant in self.secants[0].items():
            result[coordinate] = secant * motions[coordinate]
        return result

    @cached_property
    def constraints(self) -> Array:
        """Derivative ``(c, n)`` of what closures, couplings and the holding of the end keep at zero."""
        rows = self.model.closing(self.kinematics)[:, : self.n]
        return rows if self.question.displacement is None else np.vstack([rows, self.jacobian])

    @cached_property
    def combinations(self) -> Array:
        """Combinations ``(c, r)`` of the constraints that are independent, see `vjm.rank`; 1/mm and 1/rad."""
        rows = self.model.closing_rows(self.kinematics)
        if self.question.displacement is not None:
            rows = np.vstack([rows, self.model.pose_rows(self.end)])
        return split(rows)[0] / self.constraint_unit[:, None]

    @cached_property
    def constraint_unit(self) -> Array:
        """Units ``(c,)`` of the constraints: lengths, turns."""
        unit = self.model.unit_of_closing
        if self.question.displacement is None:
            return unit
        return np.concatenate([unit, np.repeat([self.model.characteristic_length, 1.0], 3)])

    @cached_property
    def freed(self) -> LinearState:
        """The same with its end free, where it is held."""
        if self.question.displacement is None:
            return self
        return replace(self, question=replace(self.question, displacement=None))

    def rows(self, combinations: Array) -> Array:
        """The rows ``(r, n)`` that combinations ``(c, r)`` of the constraints are."""
        return combinations.T @ self.constraints

    @cached_property
    def scale(self) -> Array:
        """Units ``(n + r,)`` of the coordinates and of the independent constraints in `bordered`."""
        return np.concatenate([self.unit, _one_over(self.rows(self.combinations) * self.unit)])

    @cached_property
    def motions(self) -> Array:
        """Motions ``(n, m)`` that the closures leave, orthonormal in the coordinates' units."""
        rows = self.rows(self.combinations) * self.unit
        if not len(rows):
            return np.diag(self.unit)
        # the rows are independent: no small singular value has to be judged
        V = np.linalg.svd(rows * _one_over(rows)[:, None])[2]
        return self.unit[:, None] * V[len(rows) :].T

    def on_motions(self, A: Array) -> Array:
        """A matrix ``(n, n)`` of the coordinates on `motions` ``(m, m)``."""
        if not self.combinations.shape[1]:
            return A * self.unit[:, None] * self.unit
        return self.motions.T @ A @ self.motions

    def of_motions(self, amplitudes: Any) -> Any:  # noqa: ANN401
        """Motions ``(n, k)`` from their amplitudes ``(m, k)``, which may be complex."""
        alone = not self.combinations.shape[1]
        return self.unit[:, None] * amplitudes if alone else self.motions @ amplitudes

    @cached_property
    def strainless(self) -> Array:
        """Motions ``(n, z)`` that strain no spring, orthonormal in the coordinates' units; by geometry alone."""
        model, k = self.model, self.kinematics
        rows = [model.closing_rows(k), model.stretching_rows(k)]
        if self.question.displacement is not None:
            rows.append(model.pose_rows(self.end))
        Z = np.zeros((self.n, 0))
        if len(model.passive):
            own = null_space(np.vstack(rows)[:, model.passive])
            Z = np.zeros((self.n, own.shape[1]))
            Z[model.passive] = own * model.coordinate_scale[model.passive][:, None]
        return self.unit[:, None] * np.linalg.qr(Z / self.unit[:, None])[0]

    @cached_property
    def neutral(self) -> Array:
        """Those ``(n, z)`` to which the loads give no stiffness either, such as a rod's turn between two balls."""
        Z = self.strainless
        if not Z.size or not (geometric := np.linalg.norm(self.geometric * self.unit[:, None] * self.unit)):
            return Z
        return Z @ null_space(self.motions.T @ self.geometric @ Z / geometric)

    @cached_property
    def free(self) -> str:
        """Words for the laws without a slope here, where a motion has no stiffness; empty where all have one."""
        words, N = free_words(law_states(self.model, self.x)), self.felt
        if not words or not N.shape[1]:
            return ""
        K = np.linalg.eigvalsh(N.T @ (self.tangent + self.tangent.T) @ N)
        return words if K[0] <= SUM_ROUNDING * np.abs(K).max() else ""

    @property
    def in_contact(self) -> LinearState:
        """The same with the largest slopes of the laws that have none here, as if each were in contact."""
        own = np.diag(self.spring_stiffness)
        joints = {
            where.start: spring.law.largest_stiffness
            for spring, where in self.model.blocks
            if isinstance(spring, LawSpring) and own[where.start] == 0.0
        }
        return replace(self, secants=(joints, {}))

    @cached_property
    def felt(self) -> Array:
        """Motions ``(n, m − z)`` that the closures leave, but neutral ones."""
        N, Z = self.motions, self.neutral
        return N @ null_space((Z / self.unit[:, None]).T @ (N / self.unit[:, None])) if Z.size else N

    def bordered(self, A: Array, combinations: Array, scale: Array) -> Array:
        """A stiffness ``(n, n)`` with the closures' rows: ``(n + r, n + r)``, scaled."""
        n, total = self.n, len(scale)
        B = np.zeros((total, total))
        R = self.rows(combinations)
        B[:n, :n], B[:n, n:], B[n:, :n] = A, R.T, R
        B *= scale[:, None]
        B *= scale
        return B

    def system(self, A: Array, neutral: Array) -> TangentSystem:
        """`bordered` of a stiffness ``(n, n)`` with its neutral motions ``(n, z)``, solved."""
        border = np.zeros((len(self.scale), neutral.shape[1]))
        border[: self.n] = neutral / self.unit[:, None]
        return TangentSystem(self.bordered(A, self.combinations, self.scale), border, border)

    @cached_property
    def solver(self) -> TangentSystem:
        """`system` of the tangent."""
        return self.system(self.tangent, self.neutral)

    def respond(
        self, system: TangentSystem, forces: Array, gaps: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """What forces and gaps bring about.

        Args:
            system: see `system`.
            forces: generalised ``(n, k)``, N mm and N.
            gaps: what the constraints are to change by ``(c, k)``, mm and rad; nothing if left out.

        Returns:
            Motions ``(n, k)``, the constraints' forces ``(c, k)``, and of the forces what nothing carries
            ``(z, k)``, in units of `unit`.
        """
        n, k = self.n, forces.shape[1]
        behind = np.zeros((self.combinations.shape[1], k)) if gaps is None else self.combinations.T @ gaps
        right = self.scale[:, None] * np.vstack([forces, behind])
        y, left = system.solve(right)
        y = self.scale[:, None] * y
        return y[:n], self.combinations @ y[n:], left

    def incompatible(self, gaps: Array) -> Array:
        """What of gaps ``(c, k)``, mm and rad, no motion closes: dimensionless ``(c, k)``.

        Closures that hold a direction several times over take only gaps that agree in it.
        """
        unit = self.constraint_unit[:, None]
        U, own = self.combinations * unit, gaps / unit
        return own - U @ (U.T @ own)

    @property
    def conservative(self) -> bool:
        """Whether all loads on it have a potential."""
        return not len(self.loading.turning)


def _one_over(rows: Array) -> Array:
    """One over the largest entry of each row."""
    size = np.abs(rows).max(axis=1, initial=0.0)
    return 1.0 / np.where(size > 0.0, size, 1.0)


def state_of(asked: Question, near: LinearState | None = None) -> LinearState:
    """The equilibrium of a machine under loads, or held in a pose.

    The models of a state ``near``, of the same machine in the same posture under other loads, serve again.

    Raises:
        NoConvergenceError: there is none near.
        ValueError: a load stands on no point of the machine.
    """
    if asked.displacement is not None:
        return _held(asked, asked.displacement)
    model = asked.model if near is None else near.model
    chain = model.chain
    x0 = model.configuration(chain.posture(asked.posture))
    if not asked.acting and asked.gravity is None and not model.prestressed(x0):
        return LinearState(asked, model, x0, np.zeros(6), NO_LOADS, np.zeros(6))
    drawn = near if near is not None and near.loading is NO_LOADS and np.array_equal(near.x, x0) else None
    return state_in(asked, equilibrium_of(asked, model, drawn=drawn), 0, model)


def equilibrium_of(
    asked: Question, model: Mechanism, *, compliance: bool = False, drawn: LinearState | None = None
) -> Equilibria:
    """The equilibrium under loads to which the machine comes as they grow, as a batch of one.

    Newton's method finds one under the loads in one go. Where linear motion at either end does not foresee it, or
    it is unstable, the path from no load decides.

    Args:
        asked: the machine, and what is done to it.
        model: of the machine in the posture.
        compliance: whether it and the stiffness are wanted.
        drawn: the machine without loads, where it is known.

    Raises:
        NoConvergenceError: there is no equilibrium, only a stable one behind a loss of stability, or one that
            nothing holds, as laws of springs have no slope there.
        MechanismError: there is none, as the end moves without straining a spring.
    """
    chain = model.chain
    q = model.posture(asked.posture)

    def found(x: Array | None = None) -> Equilibria:
        start = None if x is None else (x - x0)[: model.coordinates]
        closures = None if x is None else x[model.coordinates :]
        return equilibria(
            model, q, gravity=asked.gravity, loads=asked.acting, compliance=compliance, start=start,
            start_closures=closures, gradual=x is None,
        )  # fmt: skip

    x0, equilibrium = model.configuration(chain.posture(asked.posture)), found()
    if (
        equilibrium.converged[0]
        and equilibrium.stable[0]
        and _foreseen(state_in(asked, equilibrium, 0, model), drawn)
    ):
        return equilibrium
    if equilibrium.undetermined[0]:
        state = np.concatenate([x0[: model.coordinates] + equilibrium.x[0], x0[model.coordinates :]])
        free = free_words(law_states(model, state))
        raise NoConvergenceError(
            f"{chain.name}, posture {asked.posture}: nothing determines where it stands: {free}. Give a load that "
            "brings contact, a preload, or a stiffness there"
        )
    x, mechanism = None, None
    try:
        x = _followed(asked, model)
    except MechanismError as error:
        mechanism = error
    except NoConvergenceError:
        if equilibrium.converged[0] and not equilibrium.stable[0]:
            # the path loses its stability before: this state, which is unstable, contradicts nothing
            return equilibrium
        raise
    equilibrium = equilibrium if x is None else found(x)
    if not equilibrium.converged[0]:
        loaded = "under these loads" if asked.acting or asked.gravity is not None else "without loads"
        said = f"{chain.name}, posture {asked.posture}: no equilibrium {loaded}"
        if mechanism is None:
            raise NoConvergenceError(said)
        held_instead = "with its end free it is a mechanism. Hold it in a pose instead"
        raise MechanismError(f"{said} that its springs hold: {held_instead}") from mechanism
    return equilibrium


def _foreseen(state: LinearState, drawn: LinearState | None) -> bool:
    """Whether linear motion, of the machine as drawn and as it stands, leads to where it stands under its loads.

    Laws of springs are chords there, from the one state to the other: how they bend leaves nothing in doubt.
    """
    model, n = state.model, state.n
    x0 = model.configuration(model.chain.posture(state.question.posture))
    moved = (state.x - x0)[:n] / model.coordinate_scale[:n]

    def way(base: LinearState) -> Array:
        motion, _, _ = base.respond(base.solver, base.load_forces(state.loading)[:, None])
        return motion[:, 0] / model.coordinate_scale[:n]

    # loads without what holds them would give stiffness to motions that nothing feels
    if drawn is None:
        drawn = replace(state, x=np.concatenate([x0[:n], np.zeros(model.size - n)]), loading=NO_LOADS)
    secants = _secants(drawn, state)
    return all(foresee(moved, way(replace(base, secants=secants))) for base in (drawn, state))


def _secants(a: LinearState, b: LinearState) -> tuple[dict[int, float], dict[int, float]]:
    """See `LinearState.secants`, between two states of one machine."""
    model, joints, springs = a.model, dict[int, float](), dict[int, float]()
    for spring, where in model.blocks:
        if isinstance(spring, LawSpring):
            c = where.start
            joints[c] = spring.law.secant(float((a.x - model.natural)[c]), float((b.x - model.natural)[c]))
    for k, (own, *lengths) in enumerate(zip(model.chain.point_springs, a.lengths, b.lengths, strict=True)):
        if own.law is not None:
            springs[k] = own.law.secant(*(float(length) - own.free_length for length in lengths))
    return joints, springs


def with_doubts(
    model: Mechanism, q: Array, *, gravity: Gravity | None, wrench: Array, loads: Sequence[Load], compliance: bool
) -> tuple[Equilibria, np.ndarray]:
    """Equilibria in many postures, and of which the path has to be followed to know that they are on it.

    These are the ones in which the second half of all loads moves the machine otherwise than the first, by more
    than where stiffness falls evenly to its half.

    Args:
        model: the machine.
        q: coordinates ``(g, n_joints)``.
        gravity: as `equilibria`, and so are the others.
        wrench: on the end frames.
        loads: on parts.
        compliance: whether it is wanted.

    Returns:
        The equilibria, and ``(g,)`` where one is in doubt.
    """
    if gravity is None and not loads and not np.any(wrench):
        states = equilibria(model, q, gravity=gravity, wrench=wrench, loads=loads, compliance=compliance)
        return states, np.zeros(len(q), dtype=bool)
    half = equilibria(model, q, gravity=gravity, wrench=wrench, loads=loads, compliance=False, share=0.5)
    states = equilibria(
        model, q, gravity=gravity, wrench=wrench, loads=loads, compliance=compliance, start=2.0 * half.x,
        start_closures=2.0 * half.closures,
    )  # fmt: skip
    first, second = (x / model.unit for x in (half.x, states.x - half.x))
    size = np.linalg.norm(first, axis=1)
    even = np.linalg.norm(second - first, axis=1) <= END * size
    return states, np.asarray(~(half.converged & states.converged & states.stable & even))


def _followed(asked: Question, model: Mechanism) -> Array | None:
    """The state ``(size,)`` at the end of the path on which the loads grow; None where nothing grows or moves.

    Without other loads it is the weight that grows.

    Raises:
        MechanismError: no springs hold what the loads move: there is no path.
        NoConvergenceError: the path turns back, or loses its stability, before they act in full.
    """
    where = f"{asked.machine.name}, posture {asked.posture}"
    acting = tuple(replace(load, ramped=True) for load in asked.acting)
    if not acting and asked.gravity is None:
        return None
    case = LoadCase(asked.posture, 1.0, LOAD, free=COMPONENTS, loads=acting, gravity=asked.gravity, steps=1)
    path = asked.engine.trace(asked.machine, case)
    for event in path.events:
        if event.kind in (EventKind.LIMIT, EventKind.BIFURCATION):
            raise NoConvergenceError(
                f"{where}: the equilibrium under these loads is unstable: stability is lost at {event.s:.6g} of "
                f"them ({event.kind}). A stable state under all of them is one that the machine jumps to: "
                f"`validate curve` with --control arc follows the path"
            )
    if not path.complete:
        raise NoConvergenceError(f"{where}: no equilibrium under these loads: {path.stopped}")
    end = held(model, case)
    return end.alone(path.points[-1].state[: end.model.size])


def state_in(asked: Question, states: Equilibria, row: int, model: Mechanism | None = None) -> LinearState:
    """The equilibrium of one row of a batch of them.

    Args:
        asked: the machine in the posture of that row, under the loads of the batch.
        states: the batch.
        row: in it, of an equilibrium that was found.
        model: of the machine in that posture, where it is known.
    """
    model = model or asked.model
    x0 = model.configuration(model.chain.posture(asked.posture))
    x = np.concatenate([x0[: model.coordinates] + states.x[row], states.closures[row]])
    moved = states.deflection[row, states.model.ends.index(asked.end)]
    return LinearState(asked, model, x, np.zeros(6), loading(asked, model, x0), moved, bool(states.stable[row]))


def loading(asked: Question, model: Mechanism, x0: Array) -> AppliedLoads:
    """The loads of a question on a model whose unloaded coordinates are ``x0`` (size,)."""
    if not asked.acting and asked.gravity is None:
        return NO_LOADS
    return loading_of(model, x0, LoadCase(asked.posture, 1.0, loads=asked.acting, gravity=asked.gravity))[0]


def _held(asked: Question, displacement: tuple[float, ...]) -> LinearState:
    if any(displacement):
        path = asked.engine.trace(asked.machine, LoadCase(asked.posture, 1.0, axis=displacement))
        if not path.complete:
            raise NoConvergenceError(f"the displacement is reached only to {path.points[-1].s:.1%}: {path.stopped}")
        x, wrench = path.points[-1].state, path.points[-1].wrench
    else:
        rest = asked.engine.problem(asked.machine, LoadCase(asked.posture, 1.0)).at_rest()
        x, wrench = rest.x, rest.wrench
    model = asked.model
    return LinearState(asked, model, x[: model.size], wrench, NO_LOADS, np.array(displacement))
