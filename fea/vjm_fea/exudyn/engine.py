"""The Exudyn engine: the beams of a machine as geometrically exact finite elements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vjm.continuation.arc_length import trace
from vjm.continuation.path import Equilibrium, Path
from vjm.errors import NoConvergenceError
from vjm.limits import refuse
from vjm.model.load_case import LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Closure, Coupling, Joint, Part, PointSpring
from vjm.rotations import Array, frame, skew
from vjm.threads import single_threaded
from vjm_fea.common.beam_problem import BeamProblem
from vjm_fea.common.beam_statics import BeamStatics, loading_of
from vjm_fea.common.end_condition import hand_joints
from vjm_fea.common.linearized_statics import Tangent
from vjm_fea.common.mesh import NEAR, NO_POINTS, Mesh, Moving, Place, fixed_points, on_body, on_ground, wanted
from vjm_fea.common.states import States, product, rates, rotation_matrices
from vjm_fea.exudyn.joints import LinearConstraint, RelativeMotion, axes_with, crossing
from vjm_fea.exudyn.system import Description, ExudynSystem, Rigid, System, between, exu, items

# --- Residual and exact tangent of an Exudyn system in six coordinates a node, with its constraints ---------------
#
# Exudyn assembles residual and Jacobian in seven coordinates a node, position and quaternion. Here they are
# taken to shifts and small turns in world axes, which keeps quaternions of unit length without a constraint,
# and scaled, so that mm and rad, forces and moments, are comparable.
#
# Exudyn's Jacobian leaves out how the joints' reactions change with the motion, ``∂(Cᵀλ)/∂x``. Newton's method
# forgives that; a stability eigenvalue and a tangent stiffness do not, where a loaded joint sits on a rigid arm
# or carries a moment. So what joints and springs add to the columns of their nodes are central differences of their
# residual, which has everything in it. Beams, whose Jacobian is exact, are left out of it: a position is known to a
# rounding of its distance from the origin, which a short element turns into forces larger than the difference.
#
# Nodes of one rigid piece go with the one that leads it: what they put up acts on that one, by the principle of
# virtual work, and no constraint is left that would need multipliers.

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
        moving = []
        for place in places:
            if place.body is None:
                moving.append(on_ground(place.position))
                continue
            i = self._number[place.body]
            R = turns[i] @ self._reference_turns[i].T
            arm = place.position - self.system.reference[place.body, :3]
            moving.append(on_body(6 * i + np.arange(6), bodies[i, :3], R, arm))
        return moving

    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        # index −1, the ground, is the last row
        places = np.vstack([self._full(state).places, self._ground])
        R = rotation_matrices(places[:, 3:])
        node = np.array([s.node for s in self.system.stations])
        offset = np.array([s.offset for s in self.system.stations])
        return places[node, :3] + np.einsum("kab,kb->ka", R[node], offset)

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
            node_forces, body_forces = rows[6 * node : 6 * node + 6], result[6 * body : 6 * body + 6]
            body_forces += node_forces
            if full.levers[node].any():
                body_forces[3:] += skew(full.levers[node]) @ node_forces[:3]
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
        turns = 6 * np.arange(self.nodes)[:, None] + np.arange(3, 6)
        J[turns[:, :, None], turns[:, None, :]] -= 0.5 * np.cross(r[:, None, 3:], np.eye(3)).transpose(0, 2, 1)
        J = self._with_springs(J, full)
        r = r + self._spring_forces(full)
        J = self._carried(J, full)
        # the levers of nodes that are led turn with their leaders
        for node, body in self._following:
            block = slice(6 * body + 3, 6 * body + 6)
            J[block, block] += skew(r[node, :3]) @ skew(full.levers[node])
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

    def _reduced(self, rows: Array, E: Array) -> Array:
        """Rows in shifts and turns ``(6 n + c, …)`` of rows in the nodes' coordinates ``(7 n + c, …)``."""
        n, motions = 7 * self.nodes, 6 * self.nodes
        result = np.empty((motions + len(rows) - n, *rows.shape[1:]))
        own, reduced = rows[:n].reshape(self.nodes, 7, -1), result[:motions].reshape(self.nodes, 6, -1)
        reduced[:, :3] = own[:, :3]
        np.matmul(E.transpose(0, 2, 1), own[:, 3:], out=reduced[:, 3:])
        result[motions:] = rows[n:]
        return result

    def _assembled(self, system: _Evaluated, full: _Full, E: Array) -> Array:
        """Exudyn's own Jacobian ``(6 n + c, 6 n + c)`` in shifts and turns of all nodes, unscaled."""
        return self._reduced(np.ascontiguousarray(self._reduced(system.jacobian(full), E).T), E).T


# ------------------------------------------------------------------------------------------------------------------


# --- A machine in a posture as a system of Exudyn: a tree of parts, its loops closed ------------------------------

WELD, BALL = (1, 1, 1, 1, 1, 1), (1, 1, 1, 0, 0, 0)
CLOSED = 1e-7
"""mm and rad that two welded frames may be apart and still be one: what iteration of a posture leaves. More is an
error of assembly, which a joint pulls shut."""


class ExudynMachineSystem(ExudynSystem):
    """The assembled system of a tree of parts, its closures, couplings and springs between points.

    A weld makes one rigid piece of two. A ball joint, and a weld that the posture leaves open, are joints of
    Exudyn.
    """

    def __init__(
        self,
        chain: Machine,
        q: Array,
        mesh: Mesh,
        points: Mapping[str, tuple[float, ...]] = NO_POINTS,
        end_condition: Sequence[Joint] = (),
        nominal_end: Array | None = None,
    ) -> None:
        """Assemble a machine.

        Args:
            chain: the machine, its held joints at coordinates.
            q: its passive joints' coordinates.
            mesh: of its beams.
            points: fractions of its beams at which there has to be a node, by name.
            end_condition: joints between the end-effector and the support, see `vjm.model.end_condition`.
            nominal_end: frame ``(4, 4)`` of the end-effector as designed, where errors of assembly move it.

        Raises:
            ValueError: a beam without a section, or another number of joints.
        """
        if len(q) != len(chain.joints):
            raise ValueError(
                f"{chain.name}: {len(chain.joints)} passive joints but {len(q)} coordinates in the posture"
            )
        self._begin(mesh)
        self._marked, self._cuts = fixed_points(chain), chain.cuts
        self._points = {
            part: tuple(sorted({*points.get(part, ()), *self._marked.get(part, ())}))
            for part in {*points, *self._marked}
        }
        self._beams = {beam.name: beam for beam in chain.beams}
        self._end_frames = dict(chain.ends)
        self._coupled = {name for coupling in chain.couplings for name, _ in coupling.terms}
        self._passive: dict[str, tuple[RelativeMotion, int]] = {}
        values = dict(zip((joint.name for joint in chain.joints), np.asarray(q, dtype=float).tolist(), strict=True))
        self._begins: dict[str, tuple[Array, Rigid]] = {"": (np.eye(4), self._ground)}
        self._ends: dict[str, tuple[Array, Rigid]] = {"": (np.eye(4), self._ground)}
        self._string(chain, values)
        for spring in chain.point_springs:
            self._add_point_spring(spring)
        for closure in chain.closures:
            self._close(closure)
        for coupling in chain.couplings:
            self._couple(coupling, values)
        if nominal_end is not None:
            self._draw_to(nominal_end)
        self._finish(chain.name, end_condition)

    def _draw_to(self, place: Array) -> None:
        """Go on behind the last part at another place, to which a joint draws it."""
        drawn = self._marker(self._at(), self._frame)
        T = frame(p=place[:3, 3])
        self._frame, self._rigid = place, self._carrier(self._node(T), T)
        self._joint(drawn, self._marker(self._rigid, place), WELD)

    def _string(self, chain: Machine, values: Mapping[str, float]) -> None:
        """The parts, each behind the one that it follows."""
        self._frame, self._rigid = chain.base, self._ground
        seen_again = {*chain.after.values(), *chain.ends.values()}
        seen_again |= {name for closure in chain.closures for name in closure.parts}
        fixed = {name for spring in chain.point_springs for name in spring.parts} | {*chain.riders}
        parts, last = list(chain.parts), ""
        while parts:
            part = parts.pop(0)
            where = chain.after.get(part.name, last)
            if where != last:
                self._at()
                self._frame, self._rigid = self._ends[where] if where else (chain.base, self._ground)
            if isinstance(part, Joint) and part.rides_on:
                self._at()
                self._frame = self._begins[part.rides_on][0]
                self._rigid = self._section(part.rides_on, self._cuts[part.rides_on])
            if part.name in fixed:
                self._begins[part.name] = (self._frame, self._at())
            behind = parts[0] if parts else None
            if self._universal(part, behind, {*seen_again, *fixed}, chain.after):
                assert isinstance(part, Joint)
                assert isinstance(behind, Joint)
                self._add_universal(part, values[part.name], behind, values[behind.name])
                part = parts.pop(0)
            elif isinstance(part, Joint) and part.free:
                self._add_passive(part, values[part.name])
            else:
                self._add(part)
            if part.name in seen_again:
                self._ends[part.name] = (self._frame, self._at())
            if part.name in fixed and isinstance(part, Joint) and not part.fixed:
                # what is fixed to a joint is fixed behind it
                self._begins[part.name] = (self._frame, self._at())
            last = part.name

    def _universal(self, part: Part, behind: Part | None, apart: set[str], after: Mapping[str, str]) -> bool:
        """Whether two joints in a row make a universal joint, between which nothing else is held."""
        return (
            isinstance(part, Joint)
            and isinstance(behind, Joint)
            and part.free
            and behind.free
            and not {part.name, behind.name} & (self._coupled | (apart - {behind.name}))
            and behind.name not in after
            and crossing(part, behind)
        )

    def _add_passive(self, joint: Joint, value: float) -> None:
        before = self._at()
        self._add_joint(joint, value)
        if joint.name not in self._coupled:
            return
        column = 0 if joint.slides else 2
        joint_frame = self._frame @ frame(axes_with(joint.axis, column))
        motion = RelativeMotion(*between(before, self._at(), joint_frame))
        self._passive[joint.name] = motion, column if joint.slides else 3 + column

    # --- what closes loops --------------------------------------------------------------------------------

    def _close(self, closure: Closure) -> None:
        (first, a), (second, b) = (
            (self._ends[part][0] @ T, self._ends[part][1]) if part else (T, self._ground)
            for part, T in zip(closure.parts, closure.frames, strict=True)
        )
        if not closure.turns and np.abs(first - second).max() < CLOSED:
            self._locked.append((a.node, b.node))
            return
        markers = self._marker(a, first), self._marker(b, second)
        self._joint(*markers, BALL if closure.turns else WELD)

    def _couple(self, coupling: Coupling, values: Mapping[str, float]) -> None:
        terms = tuple((*self._passive[name], weight) for name, weight in coupling.terms)
        off = sum(weight * values[name] for name, weight in coupling.terms) - coupling.total
        self.constraints.append(LinearConstraint(terms, off))

    def _section(self, beam: str, fraction: float) -> Rigid:
        """The node of a beam at a fraction of its length."""
        return next(
            r for (name, station), r in self._sections.items() if name == beam and abs(station - fraction) < NEAR
        )

    def _add_point_spring(self, spring: PointSpring) -> None:
        places, markers = [], []
        for part, point in zip(spring.parts, spring.points, strict=True):
            T, rigid = self._begins[part]
            if part in self._beams:
                rigid = self._section(part, self._beams[part].fraction_of(point))
            places.append(T[:3, :3] @ point + T[:3, 3])
            markers.append(self._marker(rigid, frame(p=places[-1])))
        length = float(np.linalg.norm(places[1] - places[0]))
        if spring.law is not None:

            def pulling(_mbs: object, _time: float, _item: int, longer: float, *_: float) -> float:
                return float(spring.pull(length + longer))

            own = items.SpringDamper(markerNumbers=markers, referenceLength=length, springForceUserFunction=pulling)
            self.assembly.rigid(own)
            return
        # Exudyn's law about the present length, so that a free length of zero is one like any other
        pull = float(spring.pull(length))
        self.assembly.rigid(
            items.SpringDamper(
                markerNumbers=markers, referenceLength=length, stiffness=spring.stiffness, force=pull
            )
        )

    def find(self, part: str, fraction: float) -> Place:
        """See `ExudynSystem.find`; an end frame by its name."""
        if part in self._end_frames:
            T, rigid = self._ends[self._end_frames[part]]
            return Place(self._leader(rigid.node), T[:3, 3])
        return super().find(part, fraction)


# ------------------------------------------------------------------------------------------------------------------


TOLERANCE = 1e-11
"""Scaled residual at which an equilibrium counts as found: a thousand times what rounding leaves of it."""


class ExudynProblem(BeamProblem):
    """The `BeamProblem` of Exudyn.

    Attributes:
        statics: the system's residual and tangent.
    """

    statics: ExudynStatics

    def __init__(self, chain: Machine, load_case: LoadCase, mesh: Mesh, label: str) -> None:
        """Mesh a machine in a posture.

        Raises:
            ValueError: a beam without a section, or without shear stiffness where the element needs one; a load on
                no point of the chain; a load case that the engine does not know.
        """
        refuse(label, chain, load_case)
        chain = chain.at(load_case.posture)
        self._assembled_with_errors = bool(chain.nominal_ends)
        system = ExudynMachineSystem(
            chain, chain.posture(load_case.posture), mesh, wanted(load_case), hand_joints(chain, load_case),
            chain.nominal_ends.get(load_case.posture),
        )  # fmt: skip
        control = load_case.control
        watched = system.find(control.part, control.at) if isinstance(control, PointControl) else None
        super().__init__(
            chain,
            load_case,
            ExudynStatics(system, chain.characteristic_length, load_case),
            tuple(s.label for s in system.stations),
            watched,
            label,
            TOLERANCE,
        )

    def unloaded(self) -> Equilibrium:
        """The posture as drawn, under constant loads and the machine's errors.

        Raises:
            NoConvergenceError: no stable equilibrium was found.
        """
        point = super().unloaded()
        if self._assembled_with_errors and point.unstable:
            raise NoConvergenceError("with its errors of assembly the machine is unstable")
        return point

    def beam_force(self, beam: str, point: Equilibrium) -> Array:
        """Section force ``(3,)`` in the first element of a beam, its own axes, N; tension positive.

        Raises:
            ValueError: there is no such beam.
        """
        nodes = [station.node for station in self.statics.system.stations if station.label.part == beam]
        if len(nodes) < 2:
            raise ValueError(f"no beam '{beam}' with elements")
        return self.statics.section_force(point.state, nodes[0], nodes[1])


@dataclass(frozen=True)
class ExudynEngine:
    """Traces paths of a chain with Exudyn's `ObjectBeamGeometricallyExact`.

    With ``foot_spring`` the part named "foot" is one `RigidBodySpringDamper` in its intrinsic form instead:
    its 6×6 stiffness acts on the SE(3) logarithm between its two sides, at their mid-pose. At finite rotation
    that is another law than (22), which translates before it rotates: the same matrix, the same linear
    answer, but displacements that differ by the square of the spring's turn. A comparison of displacements
    with a lumped model must say which law each side uses.

    Exudyn gives elements, joints, residual and Jacobian; Newton's method, stability and the change of branch
    are in `vjm_fea.common.beam_problem` and `vjm_fea.exudyn.engine`. It traces every load case but those with an
    imperfection.

    Attributes:
        foot_spring: the foot as a spring with the inverse of its tip compliance.
        elements: per beam.
        shear: whether a section's shear stiffness counts.
        corrected: the residual-flexibility correction, see `Mesh`.
    """

    foot_spring: bool = False
    elements: int = 16
    shear: bool = True
    corrected: bool = True

    @property
    def label(self) -> str:
        """The name under which results are filed."""
        return "exudyn-footspring" if self.foot_spring else "exudyn"

    @single_threaded
    def problem(self, chain: Machine, load_case: LoadCase) -> ExudynProblem:
        """The chain in the load case's posture, meshed and assembled.

        Raises:
            ValueError: a beam without a section, or without shear stiffness where the element needs one; a load on
                no point of the chain; an imperfection.
        """
        mesh = Mesh(self.elements, self.shear, self.corrected, self.foot_spring)
        return ExudynProblem(chain, load_case, mesh, self.label)

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Trace the equilibrium path; see `vjm.continuation.load_stepping` and `vjm.continuation.arc_length`."""
        path = trace(self.problem(chain, load_case), load_case, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
