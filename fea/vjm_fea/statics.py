"""Residual and exact tangent of an Exudyn system in six coordinates a node, with its constraints.

Exudyn assembles residual and Jacobian in seven coordinates a node, position and quaternion. Here they are
taken to shifts and small turns in world axes, which keeps quaternions of unit length without a constraint,
and scaled, so that mm and rad, forces and moments, are comparable.

Exudyn's Jacobian leaves out how the joints' reactions change with the motion, ``∂(Cᵀλ)/∂x``. Newton's method
forgives that; a stability eigenvalue and a tangent stiffness do not, where a loaded joint sits on a rigid arm
or carries a moment. So the columns of the nodes on which joints and springs act are central differences of
the residual, which has everything in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh, eigvalsh, qr
from scipy.sparse import bsr_array

from vjm.rotations import Array
from vjm_fea.backend import exu
from vjm_fea.quaternions import rates, rotation_matrices, turned
from vjm_fea.system import ExudynSystem

DIFFERENCE = 1e-5
"""Step of the central differences in scaled coordinates: their error of third order and rounding balance."""
NEGLIGIBLE = 1e-6
"""Share of the typical stiffness below which a coordinate counts as held by joints alone."""


@dataclass(frozen=True)
class Tangent:
    """Linearised statics at one state: how residuals answer to motion, all scaled.

    Attributes:
        J: ``(6 n + m, 6 n + m)`` stiffness and constraint Jacobian, ``[K, Cᵀ; C, 0]``.
        free: indices of what is solved for: all but the pose of the end-effector.
        held: indices of the pose of the end-effector.
        motions: ``6 n``, number of coordinates that are not multipliers.
        joint_columns: ``(6 n, 6 k)`` what was added to Exudyn's own Jacobian at the nodes with joints.
    """

    J: Array
    free: np.ndarray
    held: np.ndarray
    motions: int
    joint_columns: Array

    def solve(self, right: Array) -> Array:
        """Motion of the free coordinates ``(f, …)`` that makes their residual change by ``right``.

        Raises:
            numpy.linalg.LinAlgError: the tangent is singular.
        """
        result: Array = np.linalg.solve(self.J[np.ix_(self.free, self.free)], right)
        return result

    def response(self) -> Array:
        """Motion of the free coordinates ``(f, 6)`` per unit of each motion of the end-effector."""
        return self.solve(-self.J[np.ix_(self.free, self.held)])

    def end_stiffness(self) -> Array:
        """Derivative ``(6, 6)`` of the end-effector's wrench by its motion, the chain in equilibrium."""
        result: Array = (
            self.J[np.ix_(self.held, self.held)] + self.J[np.ix_(self.held, self.free)] @ self.response()
        )
        return result

    @cached_property
    def _modal(self) -> tuple[Array, Array]:
        """Stiffness ``(k, k)`` on the null space of the constraints, and its basis ``(f, k)``."""
        moving = self.free[self.free < self.motions]
        C = self.J[np.ix_(moving, np.arange(self.motions, len(self.J)))]
        # a joint's free axis is a multiplier without a constraint
        C = C[:, np.any(C != 0.0, axis=0)]
        N = qr(C, check_finite=False)[0][:, C.shape[1] :]
        K = N.T @ self.J[np.ix_(moving, moving)] @ N
        return 0.5 * (K + K.T), N

    def stability(self) -> tuple[float, int]:
        """Smallest eigenvalue of the stiffness that the constraints leave, and how many are negative.

        Where they leave no motion at all, as in a cantilever of one element, nan and none.
        """
        if self._modal[0].size == 0:
            return float("nan"), 0
        values = eigvalsh(self._modal[0], check_finite=False)
        return float(values[0]), int(np.sum(values < 0.0))

    def softest(self) -> Array:
        """Unit vector ``(f,)`` of the motion with the smallest eigenvalue, zero on the multipliers."""
        K, N = self._modal
        mode = N @ eigh(K, subset_by_index=[0, 0])[1][:, 0]
        result = np.zeros(len(self.free))
        result[: len(mode)] = mode
        return result


class Statics:
    """An assembled system, evaluated at any state.

    A *state* is ``(7 n + m,)``: position in mm and unit quaternion of each node, then the multipliers of the
    joints in N and N mm.

    Attributes:
        system: nodes, joints and stations.
        nodes: number n of nodes.
        motions: ``6 n``.
        initial: the reference configuration, without load.
        unit: ``(6 n + m,)`` of motions and multipliers: mm, rad, N, N mm.
        energy: N mm, by which forces times lengths are scaled.
        held: indices ``(6,)`` of the end-effector's motion.
        free: indices of all other motions and of the multipliers.
    """

    def __init__(self, system: ExudynSystem, length: float) -> None:
        self.system = system
        self.nodes = len(system.reference)
        self.motions = 6 * self.nodes
        self._settings = exu.SimulationSettings()
        self._settings.solution.file.write = False
        self._settings.staticSolver.verboseMode = 0
        self._solver = exu.MainSolverStatic()
        self._solver.InitializeSolver(system.mbs, self._settings)
        multipliers = int(self._solver.GetAEsize())
        self.initial = np.concatenate([system.reference.ravel(), np.zeros(multipliers)])
        J = self._assembled(self.initial)
        stiffness = np.diag(J)[: self.motions]
        rotary = np.tile([False] * 3 + [True] * 3, self.nodes)
        turning = stiffness[rotary]
        self.energy = float(np.exp(np.mean(np.log(turning[turning > NEGLIGIBLE * np.max(turning)]))))
        # in these units every node that elements meet at has a stiffness of one in all directions: rounding
        # leaves some thousand times more of the stability eigenvalue than in plain lengths and radians
        plain = self.energy / np.where(rotary, 1.0, length**2)
        reference = np.where(stiffness > NEGLIGIBLE * plain, stiffness, plain)
        self.unit = np.sqrt(self.energy / reference)
        reach = np.linalg.norm(J[: self.motions, self.motions :] * self.unit[:, None], axis=0)
        # a joint's free axis has a multiplier, zero, but no reach
        force = np.where(reach > 0.0, self.energy / np.where(reach > 0.0, reach, 1.0), np.sqrt(self.energy))
        self.unit = np.concatenate([self.unit, force])
        self.held = 6 * system.tool + np.arange(6)
        self.free = np.setdiff1d(np.arange(len(self.unit)), self.held)

    def residual(self, state: Array) -> Array:
        """Scaled forces and moments ``(6 n)`` on the nodes in world axes, and joint errors ``(m,)``.

        Zero in equilibrium but for the end-effector's six, the wrench that holds it.
        """
        r = self._raw_residual(state)
        return self._reduced(r, self._rates(state)) * self.unit / self.energy

    def tangent(self, state: Array, like: Tangent | None = None) -> Tangent:
        """Exact derivative of `residual` by the scaled motions and multipliers.

        Args:
            state: where.
            like: tangent at a state nearby, whose additions to Exudyn's own Jacobian are good enough: for
                Newton's method, which is then three times as fast.
        """
        J = self._assembled(state)
        J *= self.unit[:, None] * self.unit / self.energy
        columns = np.ravel([range(6 * node, 6 * node + 6) for node in self.system.connected]).astype(int)
        own = J[: self.motions, columns]
        added = self._differences(state, columns) - own if like is None else like.joint_columns
        J[: self.motions, columns] += added
        return Tangent(J, self.free, self.held, self.motions, added)

    def _differences(self, state: Array, columns: np.ndarray) -> Array:
        """Columns ``(6 n, k)`` of the tangent by central differences of the residual."""
        E = self._rates(state)
        result = np.empty((self.motions, len(columns)))
        for i, column in enumerate(columns):
            node, axis = divmod(int(column), 6)
            step = np.zeros(len(state))
            size = DIFFERENCE * self.unit[column]
            if axis < 3:
                step[7 * node + axis] = size
            else:
                step[7 * node + 3 : 7 * node + 7] = size * E[node, :, axis - 3]
            change = self._raw_residual(state + step) - self._raw_residual(state - step)
            result[:, i] = self._reduced(change, E)[: self.motions]
        return result * self.unit[: self.motions, None] / (2.0 * DIFFERENCE * self.energy)

    def moved(self, state: Array, motion: Array) -> Array:
        """The state after a scaled motion and change of multipliers ``(6 n + m,)``."""
        step = motion * self.unit
        coordinates, multipliers = self._split(state)
        moves = step[: self.motions].reshape(-1, 6)
        result = np.column_stack([coordinates[:, :3] + moves[:, :3], turned(coordinates[:, 3:], moves[:, 3:])])
        return np.concatenate([result.ravel(), multipliers + step[self.motions :]])

    def normalised(self, state: Array) -> Array:
        """The state with quaternions of unit length, after an extrapolation."""
        coordinates, multipliers = self._split(state)
        coordinates = coordinates.copy()
        coordinates[:, 3:] /= np.linalg.norm(coordinates[:, 3:], axis=1)[:, None]
        return np.concatenate([coordinates.ravel(), multipliers])

    def with_tool(self, state: Array, position: Array, orientation: Array) -> Array:
        """The state with the end-effector at a position ``(3,)`` mm and a unit quaternion ``(4,)``."""
        result = state.copy()
        first = 7 * self.system.tool
        result[first : first + 3] = position
        result[first + 3 : first + 7] = orientation
        return result

    def wrench(self, state: Array) -> Array:
        """Wrench ``(6,)`` that holds the end-effector, N and N mm, world axes."""
        result: Array = self.residual(state)[self.held] * self.energy / self.unit[self.held]
        return result

    def end_stiffness(self, state: Array, tangent: Tangent) -> Array:
        """Loaded stiffness ``(6, 6)``: wrench in world axes by shift and small turn of the end-effector.

        The residual's derivative is taken at fixed quaternion axes; how these turn with the end-effector adds
        half a cross product with the moment. So K is the derivative of (f, m) as vectors, not symmetric when
        a moment acts.
        """
        unit = self.unit[self.held]
        K: Array = tangent.end_stiffness() * self.energy / (unit[:, None] * unit)
        r = self._raw_residual(state)[7 * self.system.tool + 3 : 7 * self.system.tool + 7]
        E = self._rates(state)[self.system.tool]
        for axis in range(3):
            K[3:, 3 + axis] += rates(E[:, axis][None])[0].T @ r
        return K

    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        coordinates, _ = self._split(state)
        # index −1, the ground, is the last row
        p = np.vstack([coordinates[:, :3], np.zeros(3)])
        R = np.concatenate([rotation_matrices(coordinates[:, 3:]), np.eye(3)[None]])
        node = np.array([s.node for s in self.system.stations])
        offset = np.array([s.offset for s in self.system.stations])
        result: Array = p[node] + np.einsum("kab,kb->ka", R[node], offset)
        return result

    # --- Exudyn -------------------------------------------------------------------------------------------

    def _split(self, state: Array) -> tuple[Array, Array]:
        return state[: 7 * self.nodes].reshape(-1, 7), state[7 * self.nodes :]

    def _rates(self, state: Array) -> Array:
        return rates(self._split(state)[0][:, 3:])

    def _set(self, state: Array) -> None:
        data = self.system.mbs.systemData
        data.SetODE2Coordinates(state[: 7 * self.nodes] - self.initial[: 7 * self.nodes])
        data.SetAECoordinates(state[7 * self.nodes :])

    def _raw_residual(self, state: Array) -> Array:
        self._set(state)
        self._solver.ComputeNewtonResidual(self.system.mbs, self._settings)
        # Exudyn's residual holds the negative of the internal forces
        return -np.array(self._solver.GetSystemResidual())

    def _reduced(self, r: Array, E: Array) -> Array:
        forces = r[: 7 * self.nodes].reshape(-1, 7)
        moments = np.einsum("kab,ka->kb", E, forces[:, 3:])
        return np.concatenate([np.column_stack([forces[:, :3], moments]).ravel(), r[7 * self.nodes :]])

    def _assembled(self, state: Array) -> Array:
        """Exudyn's own Jacobian ``(6 n + m, 6 n + m)`` in shifts and turns, unscaled."""
        self._set(state)
        self._solver.ComputeNewtonJacobian(self.system.mbs, self._settings)
        J7 = -np.array(self._solver.GetSystemJacobian())
        blocks = np.zeros((self.nodes, 7, 6))
        blocks[:, :3, :3] = np.eye(3)
        blocks[:, 3:, 3:] = self._rates(state)
        T = bsr_array((blocks, np.arange(self.nodes), np.arange(self.nodes + 1)))
        n = 7 * self.nodes
        J = np.zeros((self.motions + len(J7) - n,) * 2)
        J[: self.motions, : self.motions] = T.T @ (T.T @ J7[:n, :n].T).T
        J[: self.motions, self.motions :] = T.T @ J7[:n, n:]
        J[self.motions :, : self.motions] = (T.T @ J7[n:, :n].T).T
        J[self.motions :, self.motions :] = J7[n:, n:]
        return J
