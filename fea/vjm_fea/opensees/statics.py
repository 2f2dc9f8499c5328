"""Residual and tangent of a chain of corotational beams in independent motions.

The motions are the shifts and small turns of the bodies in world axes and the joints' coordinates. Nodes that a
linkage carries move with it, by the principle of virtual work their forces are the bodies' and the joints'. What is
held is a choice of motions: the six of the end-effector, or fewer, or none; dead loads act on nodes and on the
end-effector.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh, eigvalsh
from scipy.spatial.transform import Rotation

from vjm.equilibrium import NoConvergenceError
from vjm.rotations import Array
from vjm_fea.opensees.beams import Beams
from vjm_fea.opensees.linkage import Posed
from vjm_fea.opensees.system import ChainSystem

NEGLIGIBLE = 1e-6
"""Share of the typical stiffness below which a motion gets a unit by its kind instead of by its stiffness."""
ROUNDING = 1e-11
"""Scaled stiffness of what is held below which it is zero but for rounding."""


@dataclass(frozen=True)
class Tangent:
    """Derivative of the residual at one state, scaled.

    Attributes:
        K: ``(m, m)`` of all motions; symmetric in equilibrium, but for the terms that OpenSees leaves out.
        free: indices of the motions that are solved for.
        held: indices of the others.
    """

    K: Array
    free: np.ndarray
    held: np.ndarray

    def solve(self, right: Array) -> Array:
        """Free motions ``(f, …)`` by which their residual changes by ``right``.

        Raises:
            numpy.linalg.LinAlgError: the tangent is singular.
        """
        result: Array = np.linalg.solve(self.K[np.ix_(self.free, self.free)], right)
        return result

    def response(self, held: Array) -> Array:
        """Free motions ``(f, …)`` that go with held motions ``(h, …)``, the chain in equilibrium."""
        return self.solve(-self.K[np.ix_(self.free, self.held)] @ held)

    def held_stiffness(self) -> Array:
        """Derivative ``(h, h)`` of the held motions' forces by these motions, the chain in equilibrium."""
        K = self.K
        response = self.response(np.eye(len(self.held)))
        result: Array = K[np.ix_(self.held, self.held)] + K[np.ix_(self.held, self.free)] @ response
        result[np.abs(result) < ROUNDING] = 0.0
        return result

    @cached_property
    def _symmetric(self) -> Array:
        K = self.K[np.ix_(self.free, self.free)]
        return 0.5 * (K + K.T)

    def stability(self) -> tuple[float, int]:
        """Smallest eigenvalue of the free motions' stiffness and how many are negative; nan and 0 without any."""
        if len(self.free) == 0:
            return float("nan"), 0
        values = eigvalsh(self._symmetric, check_finite=False)
        return float(values[0]), int(np.sum(values < 0.0))

    def softest(self) -> Array:
        """Unit vector ``(f,)`` of the free motion with the smallest eigenvalue."""
        result: Array = eigh(self._symmetric, subset_by_index=[0, 0])[1][:, 0]
        return result


@dataclass(frozen=True)
class Configuration:
    """A state with everything that follows from it by geometry.

    Attributes:
        displacement: of the nodes ``(n, 3)``, mm.
        rotation: rotation vectors of the nodes ``(n, 3)`` from the reference, rad.
        linkages: the linkages in their places.
    """

    displacement: Array
    rotation: Array
    linkages: tuple[Posed, ...]


class Statics:
    """A chain of beams, evaluated at any state.

    A *state* is ``(7 b + k,)``: displacement from the reference in mm and rotation as a unit quaternion, scalar
    last, of each of the b bodies, the end-effector last; then the k joint coordinates from the posture.

    Attributes:
        system: bodies, linkages and stations.
        bodies: number b of bodies.
        initial: the reference configuration.
        unit: ``(6 b + k,)`` of the motions, mm and rad.
        energy: N mm, by which forces times lengths are scaled.
        tool: indices ``(6,)`` of the end-effector's motions.
        free: indices of the motions that are solved for.
        held: indices of the others.
        dead_loads: forces and moments ``(n + 1, 6)`` on the n nodes and, last, on the end-effector; N and N mm,
            constant in world axes. To be set before a state is asked for.
    """

    def __init__(
        self, system: ChainSystem, beams: Beams, length: float, held: tuple[bool, ...] = (True,) * 6
    ) -> None:
        self.system = system
        self._beams = beams
        self.bodies = len(system.carriers) + 1
        joints = len(system.stiffness)
        self.initial = np.concatenate([np.tile([0.0] * 6 + [1.0], self.bodies), np.zeros(joints)])
        motions = 6 * self.bodies + joints
        self.tool = 6 * system.tool + np.arange(6)
        self.held = self.tool[np.array(held)]
        self.free = np.setdiff1d(np.arange(motions), self.held)
        self.dead_loads = np.zeros((beams.count + 1, 6))
        carriers = np.array(system.carriers, dtype=int)
        self._carried_rows = (6 * carriers[:, None] + np.arange(6)).ravel()
        turns = np.tile([False] * 3 + [True] * 3, self.bodies)
        turns = np.append(turns, ~system.slides)
        stiffness = np.diag(self._stiffness(self.initial))
        turning = stiffness[turns]
        self.energy = float(np.exp(np.mean(np.log(turning[turning > NEGLIGIBLE * np.max(turning)]))))
        # in these units every motion's own stiffness is one
        plain = self.energy / np.where(turns, 1.0, length**2)
        self.unit = np.sqrt(self.energy / np.where(stiffness > NEGLIGIBLE * plain, stiffness, plain))

    # --- states -------------------------------------------------------------------------------------------

    def _split(self, state: Array) -> tuple[Array, Array]:
        return state[: 7 * self.bodies].reshape(-1, 7), state[7 * self.bodies :]

    def moved(self, state: Array, motion: Array) -> Array:
        """The state after scaled motions ``(6 b + k,)``."""
        step = motion * self.unit
        bodies, q = self._split(state)
        moves = step[: 6 * self.bodies].reshape(-1, 6)
        turned = Rotation.from_rotvec(moves[:, 3:]) * Rotation.from_quat(bodies[:, 3:])
        result = np.column_stack([bodies[:, :3] + moves[:, :3], turned.as_quat()])
        return np.concatenate([result.ravel(), q + step[6 * self.bodies :]])

    def normalised(self, state: Array) -> Array:
        """The state with quaternions of unit length, after an extrapolation."""
        bodies, q = self._split(state)
        bodies = bodies.copy()
        bodies[:, 3:] /= np.linalg.norm(bodies[:, 3:], axis=1)[:, None]
        return np.concatenate([bodies.ravel(), q])

    def with_tool(self, state: Array, displacement: Array) -> Array:
        """The state with the end-effector at a displacement ``(6,)``: shift in mm, rotation vector in rad."""
        result = state.copy()
        first = 7 * self.system.tool
        result[first : first + 3] = displacement[:3]
        result[first + 3 : first + 7] = Rotation.from_rotvec(displacement[3:]).as_quat()
        return result

    def configuration(self, state: Array) -> Configuration:
        """Where the nodes and linkages are.

        Raises:
            NoConvergenceError: the state is not finite.
        """
        if not np.all(np.isfinite(state)):
            raise NoConvergenceError("the state is not finite")
        system = self.system
        bodies, q = self._split(state)
        turns = Rotation.from_quat(bodies[:, 3:])
        matrices = turns.as_matrix()
        displacement, rotation = np.zeros((2, self._beams.count, 3))
        displacement[system.carriers] = bodies[:-1, :3]
        rotation[system.carriers] = turns.as_rotvec()[:-1]
        posed = []
        for linkage in system.linkages:
            position, R = linkage.near_position, np.eye(3)
            if linkage.near is not None:
                position, R = position + bodies[linkage.near, :3], matrices[linkage.near]
            there = linkage.posed(position, R, q)
            posed.append(there)
            displacement[linkage.node] = there.node_position - linkage.node_position
            rotation[linkage.node] = Rotation.from_matrix(there.turns[-1]).as_rotvec()
        return Configuration(displacement, rotation, tuple(posed))

    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        at = self.configuration(state)
        return np.array(
            [
                s.position + at.displacement[s.node]
                if s.node is not None
                else at.linkages[s.linkage[0]].place(s.position, s.linkage[1])
                for s in self.system.stations
            ]
        )

    # --- forces -------------------------------------------------------------------------------------------

    def _motions_of(self, posed: Posed) -> np.ndarray:
        """Indices of a linkage's motions among the chain's."""
        near = posed.linkage.near
        body = [] if near is None else list(range(6 * near, 6 * near + 6))
        return np.array([*body, *(6 * self.bodies + j.coordinate for j in posed.linkage.joints)], dtype=int)

    def _jacobian(self, at: Configuration) -> Array:
        """Shifts and turns ``(6 n, 6 b + k)`` of the nodes by the chain's motions."""
        J = np.zeros((6 * self._beams.count, 6 * self.bodies + len(self.system.stiffness)))
        J[self._carried_rows, np.arange(len(self._carried_rows))] = 1.0
        for posed in at.linkages:
            node = posed.linkage.node
            J[6 * node : 6 * node + 6, self._motions_of(posed)] = posed.jacobian()
        return J

    def _loads(self, at: Configuration) -> Array:
        return self._beams.forces(at.displacement, at.rotation) - self.dead_loads[:-1]

    def _residual(self, state: Array) -> Array:
        at = self.configuration(state)
        r = self._jacobian(at).T @ self._loads(at).ravel()
        r[6 * self.bodies :] += self.system.stiffness * self._split(state)[1]
        r[self.tool] -= self.dead_loads[-1]
        return r

    def _stiffness(self, state: Array) -> Array:
        at = self.configuration(state)
        J = self._jacobian(at)
        loads = self._loads(at)
        K = J.T @ self._beams.tangent(at.displacement, at.rotation) @ J
        for posed in at.linkages:
            motions = self._motions_of(posed)
            K[np.ix_(motions, motions)] += posed.geometric_stiffness(loads[posed.linkage.node])
        joints = np.arange(6 * self.bodies, len(K))
        K[joints, joints] += self.system.stiffness
        return K

    def residual(self, state: Array) -> Array:
        """Scaled forces ``(6 b + k,)`` that hold the motions: zero in equilibrium where nothing holds them.

        Raises:
            NoConvergenceError: an element cannot be evaluated there.
        """
        return self._residual(state) * self.unit / self.energy

    def tangent(self, state: Array) -> Tangent:
        """Derivative of `residual` by the scaled motions.

        Raises:
            NoConvergenceError: an element cannot be evaluated there.
        """
        K = self._stiffness(state) * (self.unit[:, None] * self.unit / self.energy)
        return Tangent(K, self.free, self.held)

    def wrench(self, state: Array) -> Array:
        """Wrench ``(6,)`` that holds the end-effector besides its dead load, N and N mm, world axes."""
        result: Array = self._residual(state)[self.tool]
        return result

    def end_stiffness(self, tangent: Tangent) -> Array:
        """Stiffness ``(h, h)`` of what is held: (f, m) as vectors in world axes by shift and small turn."""
        unit = self.unit[self.held]
        result: Array = tangent.held_stiffness() * self.energy / (unit[:, None] * unit)
        return result
