"""Residual and exact tangent of an Exudyn system in six coordinates a node, with its constraints.

Exudyn assembles residual and Jacobian in seven coordinates a node, position and quaternion. Here they are
taken to shifts and small turns in world axes, which keeps quaternions of unit length without a constraint,
and scaled, so that mm and rad, forces and moments, are comparable.

Exudyn's Jacobian leaves out how the joints' reactions change with the motion, ``∂(Cᵀλ)/∂x``. Newton's method
forgives that; a stability eigenvalue and a tangent stiffness do not, where a loaded joint sits on a rigid arm
or carries a moment. So what joints and springs add to the columns of their nodes are central differences of their
residual, which has everything in it. Beams, whose Jacobian is exact, are left out of it: a position is known to a
rounding of its distance from the origin, which a short element turns into forces larger than the difference.

Nodes of one rigid piece go with the one that leads it: what they put up acts on that one, by the principle of
virtual work, and no constraint is left that would need multipliers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array

from vjm.model.load_case import LoadCase
from vjm.rotations import Array, skew
from vjm_fea.common.applied_loads import loading_of
from vjm_fea.common.beam_statics import BeamStatics
from vjm_fea.common.linearized_statics import Tangent
from vjm_fea.common.points import Moving, Place, on_body
from vjm_fea.common.quaternions import product, rates, rotation_matrices
from vjm_fea.common.states import States
from vjm_fea.exudyn.backend import Description, System, exu
from vjm_fea.exudyn.matrix_spring import RelativeMotion
from vjm_fea.exudyn.system import ExudynSystem

DIFFERENCE = 1e-5
"""Step of the central differences in scaled coordinates: their error of third order and rounding balance."""


class _Full(NamedTuple):
    """Where all nodes are.

    Attributes:
        places: positions and quaternions ``(n, 7)``.
        levers: from the leaders ``(n, 3)``, mm, world.
        numbers: multipliers ``(c,)``.
    """

    places: Array
    levers: Array
    numbers: Array


class _Evaluated:
    """One of Exudyn's systems at any place of its nodes.

    Attributes:
        multipliers: number c.
    """

    def __init__(self, mbs: System, settings: Description, reference: Array) -> None:
        self._mbs, self._settings, self._reference = mbs, settings, reference
        self._solver = exu.MainSolverStatic()
        self._solver.InitializeSolver(mbs, settings)
        self.multipliers = int(self._solver.GetAEsize())

    def set(self, full: _Full) -> None:
        """Put the nodes there."""
        data = self._mbs.systemData
        data.SetODE2Coordinates((full.places - self._reference).ravel())
        data.SetAECoordinates(full.numbers[: self.multipliers])

    def residual(self, full: _Full) -> Array:
        """Forces that the system puts up ``(7 n,)`` and errors of joints ``(c,)``."""
        self.set(full)
        self._solver.ComputeNewtonResidual(self._mbs, self._settings)
        # Exudyn's residual holds the negative of the internal forces
        return -np.array(self._solver.GetSystemResidual())

    def jacobian(self, full: _Full) -> Array:
        """Exudyn's own Jacobian ``(7 n + c, 7 n + c)``."""
        self.set(full)
        self._solver.ComputeNewtonJacobian(self._mbs, self._settings)
        return -np.array(self._solver.GetSystemJacobian())


class ExudynStatics(BeamStatics):
    """An assembled system, evaluated at any state.

    A *state* is that of `States`: position in mm and unit quaternion of each node that leads a rigid piece, then
    the multipliers of the joints in N and N mm.

    Attributes:
        system: nodes, joints and stations.
        nodes: number of nodes, leading or not.
    """

    def __init__(self, system: ExudynSystem, length: float, load_case: LoadCase) -> None:
        """Evaluate a system under a load case's loads.

        Args:
            system: nodes, joints and stations.
            length: unit of shifts that joints alone hold, mm.
            load_case: what is done.

        Raises:
            ValueError: a load stands on a point that the chain does not have.
        """
        self.system = system
        self.applied_loads = loading_of(load_case, system.find, system.pieces)
        self.share = 1.0
        self.nodes = len(system.reference)
        self._settings = exu.SimulationSettings()
        self._settings.solution.file.write = False
        self._settings.staticSolver.verboseMode = 0
        self._whole, self._unmeshed = (
            _Evaluated(mbs, self._settings, system.reference)
            for mbs in (system.assembly.whole, system.assembly.unmeshed)
        )
        # constraints beside Exudyn have theirs behind Exudyn's own
        multipliers = self._whole.multipliers + len(system.constraints)
        self._lead(system)
        bodies = len(self._leading)
        self.motions = 6 * bodies
        self.states = States(bodies, multipliers)
        self.initial = np.concatenate([system.reference[self._leading].ravel(), np.zeros(multipliers + 1)])
        self.end_condition, self.tool = int(self._body[system.end_condition]), system.find("", 1.0)
        self.hand_reference = system.reference[system.end_condition, :3]
        self.held = 6 * self.end_condition + np.arange(6)
        self.free = np.setdiff1d(np.arange(self.motions + multipliers), self.held)
        self._columns = np.ravel([range(6 * n, 6 * n + 6) for n in system.connected]).astype(int)
        full = self._full(self.initial)
        J = self._with_springs(self._assembled(self._whole, full, rates(full.places[:, 3:])), full)
        own = np.diag(J)[: 6 * self.nodes]
        # of the elements themselves: a stiff one at the end of a long rigid arm makes the arm's turns far stiffer
        steps, self.energy = self._scale(own, np.tile([False] * 3 + [True] * 3, self.nodes), length)
        self._steps = DIFFERENCE * steps
        J = self._carried(J, full)
        rotary = np.tile([False] * 3 + [True] * 3, bodies)
        unit, _ = self._scale(np.diag(J)[: self.motions], rotary, length, self.energy)
        self.unit = unit
        self._add_multipliers(J)

    def _lead(self, system: ExudynSystem) -> None:
        """Who leads whom: the ground is a last body, which does not move."""
        leaders = np.array(system.leaders)
        self._leading = np.flatnonzero(leaders == np.arange(self.nodes))
        body = np.full(self.nodes + 1, len(self._leading))
        body[self._leading] = np.arange(len(self._leading))
        self._body = body[leaders]
        ground = np.concatenate([np.zeros(3), [1.0], np.zeros(3)])
        self._ground = ground
        references = np.vstack([system.reference[self._leading], ground])
        self._reference_turns = rotation_matrices(references[:, 3:])
        own = references[self._body]
        turns = self._reference_turns[self._body]
        # in the axes of the leader
        self._arms = np.einsum("kba,kb->ka", turns, system.reference[:, :3] - own[:, :3])
        opposite = own[:, 3:] * [1.0, -1.0, -1.0, -1.0]
        self._turned = product(opposite, system.reference[:, 3:])
        self._leading_rows = (6 * self._leading[:, None] + np.arange(6)).ravel()
        bodies = self._body.tolist()
        self._following = [
            (n, body) for n, body in enumerate(bodies) if body < len(self._leading) and n not in self._leading
        ]
        self._number = {int(n): i for i, n in enumerate(self._leading)}

    def points(self, state: Array, places: Sequence[Place]) -> list[Moving]:
        """Points at a state."""
        bodies, turns = self.states.places(state), self.states.turns(state)
        found = []
        for place in places:
            i = self._number[place.body]
            R = turns[i] @ self._reference_turns[i].T
            arm = place.position - self.system.reference[place.body, :3]
            found.append(on_body(6 * i + np.arange(6), bodies[i, :3], R, arm))
        return found

    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        # index −1, the ground, is the last row
        places = np.vstack([self._full(state).places, self._ground])
        R = rotation_matrices(places[:, 3:])
        node = np.array([s.node for s in self.system.stations])
        offset = np.array([s.offset for s in self.system.stations])
        result: Array = places[node, :3] + np.einsum("kab,kb->ka", R[node], offset)
        return result

    def node_forces(self, state: Array) -> Array:
        """Forces and moments ``(n, 6)`` that elements and joints put up at every node, world axes."""
        full = self._full(state)
        r = self._reduced(self._whole.residual(full), rates(full.places[:, 3:]))[: 6 * self.nodes].reshape(-1, 6)
        return r + self._spring_forces(full)

    def section_force(self, state: Array, root: int, tip: int) -> Array:
        """Force ``(3,)`` in the middle of the element between two nodes, its own axes, N.

        Raises:
            ValueError: there is no such element.
        """
        self._whole.set(self._full(state))
        mbs = self.system.assembly.whole
        for number in range(mbs.systemData.NumberOfObjects()):
            if [int(n) for n in mbs.GetObject(number).get("nodeNumbers", [])] == [root, tip]:
                output = exu.OutputVariableType.ForceLocal
                return np.array(mbs.GetObjectOutputBody(number, output, [0.0, 0.0, 0.0]), dtype=float)
        raise ValueError(f"no element between nodes {root} and {tip}")

    # --- nodes that are led -------------------------------------------------------------------------------

    def _full(self, state: Array) -> _Full:
        """Where all nodes are."""
        bodies = np.vstack([self.states.places(state), self._ground])[self._body]
        levers = np.einsum("kab,kb->ka", rotation_matrices(bodies[:, 3:]), self._arms)
        places = np.column_stack([bodies[:, :3] + levers, product(bodies[:, 3:], self._turned)])
        return _Full(places, levers, self.states.numbers(state))

    def _carried(self, J: Array, full: _Full) -> Array:
        """Derivative ``(m + c, m + c)`` by the state's motions of one ``(6 n + c, 6 n + c)`` by the nodes'."""
        return self._led(self._led(J.T, full).T, full)

    def _led(self, rows: Array, full: _Full) -> Array:
        """Forces ``(m + c, …)`` on what leads of forces ``(6 n + c, …)`` on the nodes."""
        n, m = 6 * self.nodes, self.motions
        result = np.empty((m + len(rows) - n, *rows.shape[1:]))
        result[m:] = rows[n:]
        result[:m] = rows[self._leading_rows]
        for node, body in self._following:
            here, there = rows[6 * node : 6 * node + 6], result[6 * body : 6 * body + 6]
            there += here
            if full.levers[node].any():
                there[3:] += skew(full.levers[node]) @ here[:3]
        return result

    def _inner(self, state: Array) -> Array:
        full = self._full(state)
        r = self._reduced(self._whole.residual(full), rates(full.places[:, 3:]))
        r[: 6 * self.nodes] += self._spring_forces(full).ravel()
        places = np.vstack([full.places, self._ground])
        errors = [constraint.error(places) for constraint in self.system.constraints]
        return self._led(np.concatenate([r, errors]), full)

    def _spring_forces(self, full: _Full) -> Array:
        """Forces and moments ``(n, 6)`` of what stands beside Exudyn at the nodes, world axes."""
        result = np.zeros((self.nodes + 1, 6))
        places = np.vstack([full.places, self._ground])
        for spring in self.system.springs:
            result[list(spring.nodes)] += spring.gradient(places)
        for motion, forces in self._constraint_forces(full):
            result[list(motion.nodes)] += motion.gradient(places, forces)
        return result[:-1]

    def _constraint_forces(self, full: _Full) -> list[tuple[RelativeMotion, Array]]:
        """Forces ``(6,)`` of constraints on the coordinates of each relative motion."""
        torques = full.numbers[self._whole.multipliers :]
        return [
            (motion, torque * weight * np.eye(6)[k])
            for torque, constraint in zip(torques, self.system.constraints, strict=True)
            for motion, k, weight in constraint.terms
        ]

    def _with_springs(self, J: Array, full: _Full) -> Array:
        """The nodes' tangent with what stands beside Exudyn ``(6 n + c, 6 n + c)``."""
        size, places = len(J), np.vstack([full.places, self._ground])
        result = np.zeros((size + len(self.system.constraints),) * 2)
        result[:size, :size] = J
        for motion, forces in [(spring, None) for spring in self.system.springs] + self._constraint_forces(full):
            second = motion.second(places, forces).reshape(2, 6, 2, 6)
            for i, k in np.ndindex(2, 2):
                a, b = motion.nodes[i], motion.nodes[k]
                if a >= 0 and b >= 0:
                    result[6 * a : 6 * a + 6, 6 * b : 6 * b + 6] += second[i, :, k]
        for row, constraint in enumerate(self.system.constraints, start=size):
            for motion, k, weight in constraint.terms:
                slopes = motion.gradient(places, weight * np.eye(6)[k])
                for node, slope in zip(motion.nodes, slopes, strict=True):
                    if node >= 0:
                        result[row, 6 * node : 6 * node + 6] += slope
                        result[6 * node : 6 * node + 6, row] += slope
        return result

    def _stiffness(self, state: Array, like: Tangent | None) -> tuple[Array, Array | None]:
        full = self._full(state)
        E = rates(full.places[:, 3:])
        J = self._assembled(self._whole, full, E)
        n = 6 * self.nodes
        if like is None or like.added is None:
            own = self._assembled(self._unmeshed, full, E)[:n, self._columns]
            added = self._differences(full, E) - own
        else:
            added = like.added
        J[:n, self._columns] += added
        # all of it is taken at fixed axes of the quaternions; that these turn adds half a cross product with the
        # moment that elements and joints put up
        r = self._reduced(self._whole.residual(full), E)[:n].reshape(-1, 6)
        for node in np.flatnonzero(r[:, 3:].any(axis=1)).tolist():
            turns = slice(6 * node + 3, 6 * node + 6)
            J[turns, turns] -= 0.5 * skew(r[node, 3:])
        J = self._with_springs(J, full)
        r = r + self._spring_forces(full)
        J = self._carried(J, full)
        # the levers of nodes that are led turn with their leaders
        for node, body in self._following:
            turns = slice(6 * body + 3, 6 * body + 6)
            J[turns, turns] += skew(r[node, :3]) @ skew(full.levers[node])
        return J, added

    def _differences(self, full: _Full, E: Array) -> Array:
        """Columns ``(6 n, k)`` of the tangent of joints and springs by central differences of their residual."""
        result = np.empty((6 * self.nodes, len(self._columns)))
        for i, column in enumerate(self._columns.tolist()):
            node, axis = divmod(column, 6)
            step = np.zeros_like(full.places)
            size = self._steps[column]
            if axis < 3:
                step[node, axis] = size
            else:
                step[node, 3:] = size * E[node, :, axis - 3]
            ahead, behind = (
                self._unmeshed.residual(_Full(full.places + sign * step, full.levers, full.numbers))
                for sign in (1.0, -1.0)
            )
            result[:, i] = self._reduced(ahead - behind, E)[: 6 * self.nodes] / (2.0 * size)
        return result

    # --- Exudyn -------------------------------------------------------------------------------------------

    def _reduced(self, r: Array, E: Array) -> Array:
        forces = r[: 7 * self.nodes].reshape(-1, 7)
        moments = np.einsum("kab,ka->kb", E, forces[:, 3:])
        return np.concatenate([np.column_stack([forces[:, :3], moments]).ravel(), r[7 * self.nodes :]])

    def _assembled(self, system: _Evaluated, full: _Full, E: Array) -> Array:
        """Exudyn's own Jacobian ``(6 n + c, 6 n + c)`` in shifts and turns of all nodes, unscaled."""
        J7 = system.jacobian(full)
        blocks = np.zeros((self.nodes, 7, 6))
        blocks[:, :3, :3] = np.eye(3)
        blocks[:, 3:, 3:] = E
        T = bsr_array((blocks, np.arange(self.nodes), np.arange(self.nodes + 1)))
        n, motions = 7 * self.nodes, 6 * self.nodes
        J = np.zeros((motions + len(J7) - n,) * 2)
        J[:motions, :motions] = T.T @ (T.T @ J7[:n, :n].T).T
        J[:motions, motions:] = T.T @ J7[:n, n:]
        J[motions:, :motions] = (T.T @ J7[n:, :n].T).T
        J[motions:, motions:] = J7[n:, n:]
        return J
