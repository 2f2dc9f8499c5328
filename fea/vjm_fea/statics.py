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

from collections.abc import Sequence

import numpy as np
from scipy.sparse import bsr_array

from vjm.programme import Programme
from vjm.rotations import Array
from vjm_fea.backend import exu
from vjm_fea.beam_statics import BeamStatics
from vjm_fea.loads import loading_of
from vjm_fea.points import Moving, Place, on_body
from vjm_fea.quaternions import rotation_matrices, skews
from vjm_fea.states import States
from vjm_fea.system import ExudynSystem
from vjm_fea.tangent import Tangent

DIFFERENCE = 1e-5
"""Step of the central differences in scaled coordinates: their error of third order and rounding balance."""


class Statics(BeamStatics):
    """An assembled system, evaluated at any state.

    A *state* is that of `States`: position in mm and unit quaternion of each node, then the multipliers of the
    joints in N and N mm.

    Attributes:
        system: nodes, joints and stations.
        nodes: number n of nodes.
    """

    def __init__(self, system: ExudynSystem, length: float, programme: Programme) -> None:
        """Evaluate a system under a programme's loads.

        Args:
            system: nodes, joints and stations.
            length: unit of shifts that joints alone hold, mm.
            programme: what is done.

        Raises:
            ValueError: a load stands on a point that the chain does not have.
        """
        self.system = system
        self.loading = loading_of(programme, system.find, system.pieces)
        self.share = 1.0
        self.nodes = len(system.reference)
        self.motions = 6 * self.nodes
        self._reference_turns = rotation_matrices(system.reference[:, 3:])
        self._settings = exu.SimulationSettings()
        self._settings.solution.file.write = False
        self._settings.staticSolver.verboseMode = 0
        self._solver = exu.MainSolverStatic()
        self._solver.InitializeSolver(system.mbs, self._settings)
        multipliers = int(self._solver.GetAEsize())
        self.states = States(self.nodes, multipliers)
        self.initial = np.concatenate([system.reference.ravel(), np.zeros(multipliers + 1)])
        self.hand, self.tool = system.hand, system.find("", 1.0)
        self.hand_reference = system.reference[self.hand, :3]
        self.held = 6 * self.hand + np.arange(6)
        self.free = np.setdiff1d(np.arange(self.motions + multipliers), self.held)
        J = self._assembled(self.initial)
        rotary = np.tile([False] * 3 + [True] * 3, self.nodes)
        unit, self.energy = self._scale(np.diag(J)[: self.motions], rotary, length)
        reach = np.linalg.norm(J[: self.motions, self.motions :] * unit[:, None], axis=0)
        # a joint's free axis has a multiplier, zero, but no reach
        force = np.where(reach > 0.0, self.energy / np.where(reach > 0.0, reach, 1.0), np.sqrt(self.energy))
        self.unit = np.concatenate([unit, force])
        self._columns = np.ravel([range(6 * n, 6 * n + 6) for n in system.connected]).astype(int)

    def points(self, state: Array, places: Sequence[Place]) -> list[Moving]:
        """Points at a state."""
        bodies, turns = self.states.places(state), self.states.turns(state)
        found = []
        for place in places:
            n = int(place.body)
            R = turns[n] @ self._reference_turns[n].T
            arm = place.position - self.system.reference[n, :3]
            found.append(on_body(6 * n + np.arange(6), bodies[n, :3], R, arm))
        return found

    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        # index −1, the ground, is the last row
        p = np.vstack([self.states.places(state)[:, :3], np.zeros(3)])
        R = np.concatenate([self.states.turns(state), np.eye(3)[None]])
        node = np.array([s.node for s in self.system.stations])
        offset = np.array([s.offset for s in self.system.stations])
        result: Array = p[node] + np.einsum("kab,kb->ka", R[node], offset)
        return result

    def _inner(self, state: Array) -> Array:
        return self._reduced(self._raw_residual(state), self.states.rates(state))

    def _stiffness(self, state: Array, like: Tangent | None) -> tuple[Array, Array | None]:
        J = self._assembled(state)
        own = J[: self.motions, self._columns]
        added = self._differences(state) - own if like is None or like.added is None else like.added
        J[: self.motions, self._columns] += added
        # all of it is taken at fixed axes of the quaternions; that these turn adds half a cross product with the
        # moment that elements and joints put up
        moments = self._inner(state)[: self.motions].reshape(-1, 6)[:, 3:]
        for node in np.flatnonzero(moments.any(axis=1)):
            turns = slice(6 * node + 3, 6 * node + 6)
            J[turns, turns] -= 0.5 * skews(moments[node][None])[0]
        return J, added

    def _differences(self, state: Array) -> Array:
        """Columns ``(6 n, k)`` of the tangent by central differences of the residual."""
        E = self.states.rates(state)
        result = np.empty((self.motions, len(self._columns)))
        for i, column in enumerate(self._columns):
            node, axis = divmod(int(column), 6)
            step = np.zeros(len(state))
            size = DIFFERENCE * self.unit[column]
            if axis < 3:
                step[7 * node + axis] = size
            else:
                step[7 * node + 3 : 7 * node + 7] = size * E[node, :, axis - 3]
            change = self._raw_residual(state + step) - self._raw_residual(state - step)
            result[:, i] = self._reduced(change, E)[: self.motions] / (2.0 * size)
        return result

    # --- Exudyn -------------------------------------------------------------------------------------------

    def _set(self, state: Array) -> None:
        data = self.system.mbs.systemData
        data.SetODE2Coordinates(state[: 7 * self.nodes] - self.initial[: 7 * self.nodes])
        data.SetAECoordinates(self.states.numbers(state))

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
        blocks[:, 3:, 3:] = self.states.rates(state)
        T = bsr_array((blocks, np.arange(self.nodes), np.arange(self.nodes + 1)))
        n = 7 * self.nodes
        J = np.zeros((self.motions + len(J7) - n,) * 2)
        J[: self.motions, : self.motions] = T.T @ (T.T @ J7[:n, :n].T).T
        J[: self.motions, self.motions :] = T.T @ J7[:n, n:]
        J[self.motions :, : self.motions] = (T.T @ J7[n:, :n].T).T
        J[self.motions :, self.motions :] = J7[n:, n:]
        return J
