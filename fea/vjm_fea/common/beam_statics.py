"""Residual and tangent of a machine meshed by whatever engine.

It is scaled, with dead and follower loads and weight, its end held by a support.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.analysis import rigid_wrenches
from vjm.baselines.linear import independent_rows
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.rotations import Array, rotation_from_vector, skew
from vjm_fea.common.linearized_statics import Tangent
from vjm_fea.common.mesh import Moving, Piece, Place
from vjm_fea.common.states import States, quaternion


@dataclass(frozen=True)
class AppliedLoads:
    """Wrenches on l points; all of them ``share · constant + factor · ramped``.

    Attributes:
        places: the points.
        follows: ``(l,)`` whether the wrench turns with the body.
        on_tool: ``(l,)`` whether it counts to what acts on the end-effector.
        constant: ``(l, 6)`` N, N mm, world axes in the reference configuration.
        ramped: ``(l, 6)`` likewise, per unit of the load factor.
    """

    places: tuple[Place, ...]
    follows: np.ndarray
    on_tool: np.ndarray
    constant: Array
    ramped: Array

    @property
    def conservative(self) -> bool:
        """Whether there is neither a follower nor a moment."""
        return not (self.follows.any() or self.constant[:, 3:].any() or self.ramped[:, 3:].any())

    def acting(self, points: Sequence[Moving], share: float, factor: float) -> Array:
        """The wrenches ``(l, 6)`` in world axes.

        Args:
            points: the places at a state.
            share: of the constant loads.
            factor: on the ramped ones.
        """
        wrench = share * self.constant + factor * self.ramped
        for i in np.flatnonzero(self.follows).tolist():
            R = points[i].rotation
            wrench[i] = np.concatenate([R @ wrench[i, :3], R @ wrench[i, 3:]])
        return wrench

    def stiffness(self, i: int, point: Moving, wrench: Array) -> Array:
        """Derivative ``(k, k)`` of a load's generalised forces ``Jᵀ w`` by the motions of its point."""
        H = point.hessian(wrench)
        if self.follows[i]:
            turned = -np.vstack([skew(wrench[:3]), skew(wrench[3:])])
            H = H + point.jacobian.T @ turned @ point.jacobian[3:]
        return H


def loading_of(load_case: LoadCase, find: Callable[[str, float], Place], pieces: Sequence[Piece]) -> AppliedLoads:
    """The loads of a load case.

    Args:
        load_case: what is done.
        find: the point of a part at a fraction.
        pieces: of the chain, with their masses.

    Raises:
        ValueError: a load stands on a point that the chain does not have.
    """
    rows: list[tuple[Place, bool, bool, Array, Array]] = []
    nothing = np.zeros(6)
    for load in load_case.loads:
        wrench = np.array(load.wrench)
        parts = (nothing, load_case.sign * wrench) if load.ramped else (wrench, nothing)
        rows.append((find(load.part, load.at), load.follower, not load.part, *parts))
    if load_case.gravity is not None:
        for piece in pieces:
            if piece.mass > 0.0:
                assert piece.centre is not None
                weight = np.concatenate([piece.mass * np.array(load_case.gravity), np.zeros(3)])
                parts = (nothing, load_case.sign * weight) if load_case.weight_ramped else (weight, nothing)
                rows.append((Place(piece.body, piece.centre), False, False, *parts))
    # what stands on the ground moves nothing
    rows = [row for row in rows if row[0].body is not None]
    return AppliedLoads(
        tuple(row[0] for row in rows),
        np.array([row[1] for row in rows], dtype=bool),
        np.array([row[2] for row in rows], dtype=bool),
        np.array([row[3] for row in rows]).reshape(-1, 6),
        np.array([row[4] for row in rows]).reshape(-1, 6),
    )


NEGLIGIBLE = 1e-6
"""Share of the typical stiffness below which a motion gets a unit by its kind instead of by its stiffness."""


class BeamStatics(ABC):
    """A meshed chain, evaluated at any state, see `States`.

    The support holds the end-effector; its pose is imposed. Where components of the pose are free, joints lie
    between the two, else they are one body.

    Attributes:
        states: how states are laid out.
        motions: number of motions that are not multipliers.
        initial: the reference configuration, without load.
        unit: ``(m + c,)`` of motions and multipliers: mm, rad, N, N mm.
        energy: N mm, by which forces times lengths are scaled.
        held: indices ``(6,)`` of the support's motions.
        free: indices of all other motions and of the multipliers.
        loading: what acts on the chain's bodies.
        share: of the constant loads that acts; all of them, but while they are put on.
        end_condition: its number among the bodies.
        hand_reference: what its state ``(3,)`` is in the reference configuration.
        tool: the end-effector's reference point.
    """

    states: States
    motions: int
    initial: Array
    unit: Array
    energy: float
    held: np.ndarray
    free: np.ndarray
    applied_loads: AppliedLoads
    share: float
    end_condition: int
    hand_reference: Array
    tool: Place

    def _scale(
        self, stiffness: Array, turns: np.ndarray, length: float, energy: float | None = None
    ) -> tuple[Array, float]:
        """Units ``(m,)`` of the motions in which every one's own stiffness is one, and the energy.

        Rounding leaves some thousand times more of the stability eigenvalue than in plain lengths and radians.

        Args:
            stiffness: of the motions alone ``(m,)``.
            turns: which of them are turns.
            length: unit of shifts that nothing but joints holds, mm.
            energy: N mm; the turns' typical stiffness where it is not given.
        """
        if energy is None:
            turning, sliding = stiffness[turns], stiffness[~turns] * length**2
            if np.max(turning, initial=0.0) <= NEGLIGIBLE**2 * np.max(sliding, initial=0.0):
                # nothing bends or twists but by rounding: what slides on springs
                turning = sliding
            energy = float(np.exp(np.mean(np.log(turning[turning > NEGLIGIBLE * np.max(turning)]))))
        plain = energy / np.where(turns, 1.0, length**2)
        return np.sqrt(energy / np.where(stiffness > NEGLIGIBLE * plain, stiffness, plain)), energy

    def _add_multipliers(self, J: Array) -> None:
        """Units of the multipliers, and which of them are solved for.

        Conditions may follow from others: loops of rigid links in a plane have such. What the links bear by them is
        not determined, and here it is nothing.

        Args:
            J: ``(m + c, m + c)`` derivative of `_inner` in the reference configuration.
        """
        scaled = J[: self.motions, self.motions :] * self.unit[: self.motions, None]
        size = np.linalg.norm(scaled, axis=0)
        # a joint's free axis may have a multiplier without reach that an equation of its own sets to zero
        set_to_zero = np.flatnonzero((size == 0.0) & (np.diag(J)[self.motions :] != 0.0))
        force = np.where(size > 0.0, self.energy / np.where(size > 0.0, size, 1.0), np.sqrt(self.energy))
        self.unit = np.concatenate([self.unit, force])
        felt = np.flatnonzero(size)
        solved = np.union1d(felt[independent_rows(scaled[:, felt].T)], set_to_zero)
        dependent = np.setdiff1d(np.arange(len(size)), solved)
        self.free = np.setdiff1d(self.free, self.motions + dependent)

    # --- an engine's own ----------------------------------------------------------------------------------

    @abstractmethod
    def _inner(self, state: Array) -> Array:
        """Forces and moments ``(m,)`` that the chain puts up, world axes, and joint errors ``(c,)``."""

    @abstractmethod
    def _stiffness(self, state: Array, like: Tangent | None) -> tuple[Array, Array | None]:
        """Derivative ``(m + c, m + c)`` of `_inner`, and what the tangent keeps as ``added``."""

    @abstractmethod
    def points(self, state: Array, places: Sequence[Place]) -> list[Moving]:
        """Points at a state."""

    @abstractmethod
    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""

    def number_unit(self, length: float) -> Array:
        """Units ``(k,)`` in which an arc measures the state's further numbers; infinite where it does not.

        Args:
            length: unit of shifts, mm.
        """
        return np.full(self.states.others, np.inf)

    def extent(self, length: float) -> Array:
        """Size ``(m + c,)``, scaled, of what the state holds of the motions: a length, and one for turns.

        Args:
            length: of the chain, mm.
        """
        size = np.zeros(len(self.unit))
        size[: 6 * self.states.bodies] = np.tile(np.repeat([length, 1.0], 3), self.states.bodies)
        return size / self.unit

    # --- states -------------------------------------------------------------------------------------------

    def moved(self, state: Array, motion: Array, ramp: float = 0.0) -> Array:
        """The state after a scaled motion ``(m + c,)`` and a change of the ramp."""
        return self.states.moved(state, motion * self.unit, ramp)

    def moved_freely(self, state: Array, free: Array, held: Array | float = 0.0, ramp: float = 0.0) -> Array:
        """The state after scaled motions ``(f,)`` of what is free and ``(6,)`` of the support."""
        motion = np.zeros(len(self.unit))
        motion[self.free], motion[self.held] = free, held
        return self.moved(state, motion, ramp)

    def change(self, state: Array, free: Array, held: Array | float, ramp: float) -> Array:
        """Derivative of the state along such a motion."""
        motion = np.zeros(len(self.unit))
        motion[self.free], motion[self.held] = free, held
        return self.states.change(state, motion * self.unit, ramp)

    def gradient(self, state: Array, row: Array) -> tuple[Array, float]:
        """Derivative ``(m + c,)`` by scaled motions, and by the ramp, of a function with that by the state."""
        by_motion, by_ramp = self.states.gradient(state, row)
        return by_motion * self.unit, by_ramp

    def with_hand(self, state: Array, displacement: Array) -> Array:
        """The state with the support displaced ``(6,)`` from its reference: shift in mm, rotation vector in rad."""
        position = self.hand_reference + displacement[:3]
        return self.states.put(
            state, self.end_condition, position, quaternion(rotation_from_vector(displacement[3:]))
        )

    # --- forces -------------------------------------------------------------------------------------------

    def residual(self, state: Array) -> Array:
        """Scaled forces and moments ``(m,)`` in world axes that nothing balances, and joint errors ``(c,)``.

        Zero in equilibrium but for the support's six, the wrench with which it holds the chain.
        """
        r = self._inner(state)
        points, wrenches = self._loads(state)
        for point, wrench in zip(points, wrenches, strict=True):
            r[point.motions] -= point.jacobian.T @ wrench
        return r * self.unit / self.energy

    def tangent(self, state: Array, like: Tangent | None = None) -> Tangent:
        """Exact derivative of `residual` by the scaled motions and multipliers.

        Args:
            state: where.
            like: tangent at a state nearby, of which the engine may use again what is dear: for Newton's method.
        """
        K, added = self._stiffness(state, like)
        for i, (point, wrench) in enumerate(zip(*self._loads(state), strict=True)):
            K[np.ix_(point.motions, point.motions)] -= self.applied_loads.stiffness(i, point, wrench)
        K *= self.unit[:, None] * self.unit / self.energy
        return Tangent(K, self.free, self.held, self.motions, self.applied_loads.conservative, added)

    def ramped(self, state: Array) -> Array:
        """Scaled generalised forces ``(m + c,)`` of the ramped loads, per unit of the load factor."""
        result = np.zeros(len(self.unit))
        if self.applied_loads.ramped.any():
            points = self.points(state, self.applied_loads.places)
            for point, wrench in zip(points, self.applied_loads.acting(points, 0.0, 1.0), strict=True):
                result[point.motions] += point.jacobian.T @ wrench
        return result * self.unit / self.energy

    def _loads(self, state: Array) -> tuple[list[Moving], Array]:
        points = self.points(state, self.applied_loads.places)
        return points, self.applied_loads.acting(points, self.share, float(state[-1]))

    def at_tool(self, state: Array) -> Moving:
        """The end-effector's reference point."""
        return self.points(state, [self.tool])[0]

    def wrench(self, state: Array) -> Array:
        """Wrench ``(6,)`` on the end-effector: of the support, and of the loads there; N and N mm, world axes."""
        end_condition = self.residual(state)[self.held] * self.energy / self.unit[self.held]
        shift = self.states.places(state)[self.end_condition, :3] - self.hand_reference
        lever = self.tool.position + shift - self.at_tool(state).position
        result: Array = np.concatenate([end_condition[:3], end_condition[3:] + np.cross(lever, end_condition[:3])])
        if self.applied_loads.on_tool.any():
            result = result + self._loads(state)[1][self.applied_loads.on_tool].sum(axis=0)
        return result

    def end_stiffness(self, state: Array, tangent: Tangent, load_case: LoadCase) -> Array:
        """Loaded stiffness ``(6, 6)``: wrench (f, m) of the support in world axes by its shift and small turn.

        Where the support holds nothing, as all of the end-effector's pose is free, that of the end-effector under
        a dead wrench at its reference point. Not symmetric where a moment acts.

        Raises:
            numpy.linalg.LinAlgError: the tangent is singular.
        """
        if set(load_case.free) == set(COMPONENTS):
            return self._free_end_stiffness(state, tangent)
        unit = self.unit[self.held]
        return tangent.end_stiffness() * self.energy / (unit[:, None] * unit)

    def _free_end_stiffness(self, state: Array, tangent: Tangent) -> Array:
        """The inverse of what a wrench on the free end-effector moves it by; infinite where it moves nothing."""
        point = self.at_tool(state)
        forces, motions = np.zeros((2, len(self.unit), 6))
        forces[point.motions] = point.jacobian.T
        motions[self.free] = tangent.solve((forces * self.unit[:, None] / self.energy)[self.free])
        C = point.jacobian @ (motions * self.unit[:, None])[point.motions]
        # a length that makes forces and moments alike; beyond a critical point entries may be negative
        shifts, turns = np.abs(np.diag(C)).reshape(2, 3).max(axis=1).tolist()
        if len(rigid_wrenches(C, np.sqrt(shifts / turns) if shifts > 0.0 < turns else 1.0)):
            return np.full((6, 6), np.inf)
        return np.asarray(np.linalg.inv(C), dtype=float)
