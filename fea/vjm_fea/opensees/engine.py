"""The OpenSees engine: the beams of a chain as corotational finite elements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from vjm.continuation.arc_length import trace
from vjm.continuation.path import Path
from vjm.errors import NoConvergenceError
from vjm.limits import refuse
from vjm.model.load_case import LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import PointSpring
from vjm.rotations import Array
from vjm.threads import single_threaded
from vjm_fea.common.beam_problem import BeamProblem
from vjm_fea.common.beam_statics import BeamStatics, loading_of
from vjm_fea.common.end_condition import hand_joints
from vjm_fea.common.linearized_statics import Tangent
from vjm_fea.common.mesh import Moving, Place, fixed_points, on_body, wanted
from vjm_fea.common.states import States
from vjm_fea.opensees.beams import Beams, ElementKind
from vjm_fea.opensees.system import SUPPORT, HeldFrames, MachineSystem, Posed

# --- Residual and tangent of a machine of corotational beams, with its conditions ---------------------------------
#
# The motions are the shifts and small turns of the bodies in world axes and the joints' coordinates. Nodes that a
# linkage carries move with it, by the principle of virtual work their forces are the bodies' and the joints'.
# Frames that are held together bear a wrench between them, and joints that are coupled a torque: these are
# multipliers.


@dataclass(frozen=True)
class BeamConfiguration:
    """A state with everything that follows from it by geometry.

    Attributes:
        displacement: of the nodes ``(n, 3)``, mm.
        rotation: rotation vectors of the nodes ``(n, 3)`` from the reference, rad.
        linkages: the linkages in their places.
    """

    displacement: Array
    rotation: Array
    linkages: tuple[Posed, ...]


class OpenSeesStatics(BeamStatics):
    """A chain of beams, evaluated at any state.

    A *state* is that of `States`: displacement from the reference in mm and rotation from it as a unit quaternion
    of each of the b bodies, the support last; then the k joint coordinates from the posture.

    Attributes:
        system: bodies, linkages and stations.
    """

    def __init__(self, system: MachineSystem, beams: Beams, length: float, load_case: LoadCase) -> None:
        """Evaluate a system under a load case's loads.

        Args:
            system: bodies, linkages and stations.
            beams: its rows of elements.
            length: unit of shifts that joints alone hold, mm.
            load_case: what is done.

        Raises:
            ValueError: a load stands on a point that the chain does not have.
        """
        self.system = system
        self._beams = beams
        self.applied_loads = loading_of(load_case, system.find, system.pieces)
        self.share = 1.0
        bodies, joints = len(system.carriers) + 1, len(system.slides)
        multipliers = sum(held.rows for held in system.held) + len(system.rows)
        self.states = States(bodies, joints + multipliers)
        self.motions = 6 * bodies + joints
        at_rest = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], bodies)
        self.initial = np.concatenate([at_rest, np.zeros(joints + multipliers + 1)])
        self.end_condition, self.hand_reference, self.tool = bodies - 1, np.zeros(3), system.find("", 1.0)
        self.held = 6 * self.end_condition + np.arange(6)
        self.free = np.setdiff1d(np.arange(self.motions + multipliers), self.held)
        carriers = np.array(system.carriers, dtype=int)
        self._carried_rows = (6 * carriers[:, None] + np.arange(6)).ravel()
        self._carrier_of = {int(node): i for i, node in enumerate(carriers)}
        self._end_of = {
            link.node: (i, len(link.joints)) for i, link in enumerate(system.linkages) if link.node is not None
        }
        turns = np.append(np.tile([False] * 3 + [True] * 3, bodies), ~system.slides)
        J = self._stiffness(self.initial, None)[0]
        self.unit, self.energy = self._scale(np.diag(J)[: self.motions], turns, length)
        self._add_multipliers(J)

    def number_unit(self, length: float) -> Array:
        """Units ``(k,)`` in which an arc measures joints' coordinates; it does not measure multipliers."""
        unit = np.full(self.states.others, np.inf)
        unit[: len(self.system.slides)] = np.where(self.system.slides, length, 1.0)
        return unit

    # --- places -------------------------------------------------------------------------------------------

    def configuration(self, state: Array) -> BeamConfiguration:
        """Where the nodes and linkages are.

        Raises:
            NoConvergenceError: the state is not finite.
        """
        if not np.all(np.isfinite(state)):
            raise NoConvergenceError("the state is not finite")
        system = self.system
        bodies, q = self.states.places(state), self.states.numbers(state)
        matrices = self.states.turns(state)
        displacement, rotation = np.zeros((2, self._beams.count, 3))
        displacement[system.carriers] = bodies[:-1, :3]
        rotation[system.carriers] = Rotation.from_quat(bodies[:-1, [4, 5, 6, 3]]).as_rotvec()
        posed = []
        for linkage in system.linkages:
            position, R = linkage.near_position, np.eye(3)
            if linkage.near is not None:
                position, R = position + bodies[linkage.near, :3], matrices[linkage.near]
            pose = linkage.posed(position, R, q)
            posed.append(pose)
            if linkage.node is None:
                continue
            displacement[linkage.node] = pose.node_position - linkage.node_position
            rotation[linkage.node] = Rotation.from_matrix(pose.turns[-1]).as_rotvec()
        return BeamConfiguration(displacement, rotation, tuple(posed))

    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        points = self.points(state, [station.place for station in self.system.stations])
        return np.array([point.position for point in points])

    def points(self, state: Array, places: Sequence[Place]) -> list[Moving]:
        """Points at a state."""
        if not places:
            return []
        linkages = self.configuration(state).linkages
        bodies, turns = self.states.places(state), self.states.turns(state)
        return [self._point(place, linkages, bodies, turns) for place in places]

    def _point(self, place: Place, linkages: tuple[Posed, ...], bodies: Array, turns: Array) -> Moving:
        if place.body is None:
            return Moving(
                place.position, np.eye(3), np.zeros(0, dtype=int), np.zeros((6, 0)), lambda _: np.zeros((0, 0))
            )
        if place.body == SUPPORT:
            return on_body(self.held, place.position + bodies[-1, :3], turns[-1], np.zeros(3))
        if place.body in self._carrier_of:
            i = self._carrier_of[place.body]
            reference = self.system.nodes[place.body]
            motions = 6 * i + np.arange(6)
            return on_body(motions, reference + bodies[i, :3], turns[i], place.position - reference)
        link, piece = self._end_of[place.body] if isinstance(place.body, int) else place.body
        posed = linkages[link]
        position = posed.place(place.position, piece)
        return Moving(
            position,
            posed.turns[piece],
            self._motions_of(posed),
            posed.jacobian(position, piece),
            lambda wrench: posed.geometric_stiffness(wrench, position, piece),
        )

    # --- forces -------------------------------------------------------------------------------------------

    def _motions_of(self, posed: Posed) -> np.ndarray:
        """Indices of a linkage's motions among the chain's."""
        near = posed.linkage.near
        body = [] if near is None else list(range(6 * near, 6 * near + 6))
        first = 6 * self.states.bodies
        return np.array([*body, *(first + j.coordinate for j in posed.linkage.joints)], dtype=int)

    def _jacobian(self, configuration: BeamConfiguration) -> Array:
        """Shifts and turns ``(6 n, 6 b + k)`` of the nodes by the chain's motions."""
        J = np.zeros((6 * self._beams.count, self.motions))
        J[self._carried_rows, np.arange(len(self._carried_rows))] = 1.0
        for posed in configuration.linkages:
            node = posed.linkage.node
            if node is None:
                continue
            own = posed.jacobian(posed.node_position, len(posed.axes))
            J[6 * node : 6 * node + 6, self._motions_of(posed)] = own
        return J

    def _coordinates(self, state: Array) -> tuple[Array, Array]:
        """Joint coordinates ``(k,)`` and multipliers ``(c,)``."""
        numbers, k = self.states.numbers(state), len(self.system.slides)
        return numbers[:k], numbers[k:]

    def _pairs(self, state: Array, multipliers: Array) -> list[tuple[HeldFrames, list[Moving], Array, np.ndarray]]:
        """Frames held together: their two points, the wrench ``(6,)`` between them, and their multipliers."""
        pairs, first = [], 0
        for held in self.system.held:
            wrench = np.zeros(6)
            wrench[: held.rows] = multipliers[first : first + held.rows]
            where = self.motions + np.arange(first, first + held.rows)
            pairs.append((held, self.points(state, held.places), wrench, where))
            first += held.rows
        return pairs

    def _inner(self, state: Array) -> Array:
        configuration, (q, multipliers) = self.configuration(state), self._coordinates(state)
        r = np.zeros(self.motions + len(multipliers))
        r[: self.motions] = (
            self._jacobian(configuration).T
            @ self._beams.forces(configuration.displacement, configuration.rotation).ravel()
        )
        joints = slice(6 * self.states.bodies, self.motions)
        r[joints] += self.system.stiffness @ (q - self.system.natural)
        for number, law, natural in self.system.laws:
            r[joints.start + number] += float(law.force(q[number] - natural))
        for held, (a, b), wrench, where in self._pairs(state, multipliers):
            r[b.motions] += b.jacobian.T @ wrench
            r[a.motions] -= a.jacobian.T @ wrench
            r[where] = _apart(a, b, held)[: held.rows]
        for i, row in enumerate(self.system.rows, start=len(r) - len(self.system.rows)):
            r[joints] += row.weights * multipliers[i - self.motions]
            r[i] = row.weights @ q + row.offset
        for spring, places in self.system.springs:
            a, b = self.points(state, places)
            pull, along, _ = _pull(spring, a, b)
            r[b.motions] += b.jacobian[:3].T @ (pull * along)
            r[a.motions] -= a.jacobian[:3].T @ (pull * along)
        return r

    def _stiffness(self, state: Array, like: Tangent | None) -> tuple[Array, Array | None]:
        configuration, (q, multipliers) = self.configuration(state), self._coordinates(state)
        J = self._jacobian(configuration)
        forces = self._beams.forces(configuration.displacement, configuration.rotation)
        K = np.zeros((self.motions + len(multipliers),) * 2)
        K[: self.motions, : self.motions] = (
            J.T @ self._beams.tangent(configuration.displacement, configuration.rotation) @ J
        )
        for posed in configuration.linkages:
            node = posed.linkage.node
            if node is None:
                continue
            motions = self._motions_of(posed)
            K[np.ix_(motions, motions)] += posed.geometric_stiffness(
                forces[node], posed.node_position, len(posed.axes)
            )
        joints = slice(6 * self.states.bodies, self.motions)
        K[joints, joints] += self.system.stiffness
        for number, law, natural in self.system.laws:
            K[joints.start + number, joints.start + number] += float(law.tangent(q[number] - natural))
        for held, (a, b), wrench, where in self._pairs(state, multipliers):
            for point, sign in ((a, -1.0), (b, 1.0)):
                K[np.ix_(point.motions, point.motions)] += sign * point.hessian(wrench)
                K[np.ix_(point.motions, where)] += sign * point.jacobian[: held.rows].T
            for point, rate in zip((a, b), _apart_rates(a, b, held), strict=True):
                K[np.ix_(where, point.motions)] += (rate @ point.jacobian)[: held.rows]
        for i, row in enumerate(self.system.rows, start=len(K) - len(self.system.rows)):
            K[i, joints] += row.weights
            K[joints, i] += row.weights
        for spring, places in self.system.springs:
            self._add_pull(K, spring, *self.points(state, places))
        return K, None

    def _add_pull(self, K: Array, spring: PointSpring, a: Moving, b: Moving) -> None:
        """A spring between points: its stiffness along its line, and its force as that turns."""
        pull, along, length = _pull(spring, a, b)
        across = pull / length * (np.eye(3) - np.outer(along, along)) if length else np.zeros((3, 3))
        own = float(spring.tangent(length)) * np.outer(along, along) + across
        ends = ((a, -1.0), (b, 1.0))
        for one, sign in ends:
            K[np.ix_(one.motions, one.motions)] += sign * one.hessian(np.concatenate([pull * along, np.zeros(3)]))
            for other, its in ends:
                K[np.ix_(one.motions, other.motions)] += sign * its * one.jacobian[:3].T @ own @ other.jacobian[:3]


def _apart(a: Moving, b: Moving, held: HeldFrames) -> Array:
    """Shift and turn ``(6,)`` between two frames that are to be one; the turn is right where it is small."""
    D = b.rotation @ held.turned @ a.rotation.T
    turn = 0.5 * np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    return np.concatenate([b.position - a.position, turn])


def _apart_rates(a: Moving, b: Moving, held: HeldFrames) -> Array:
    """Derivative ``(2, 6, 6)`` of `_apart` by shift and small turn of either frame.

    ``[ω] D + Dᵀ [ω]`` is the cross-product matrix of ``(tr D − D) ω``.
    """
    D = b.rotation @ held.turned @ a.rotation.T
    rates = np.zeros((2, 6, 6))
    rates[0, :3, :3], rates[1, :3, :3] = -np.eye(3), np.eye(3)
    rates[0, 3:, 3:] = -0.5 * (np.trace(D) * np.eye(3) - D.T)
    rates[1, 3:, 3:] = 0.5 * (np.trace(D) * np.eye(3) - D)
    return rates


def _pull(spring: PointSpring, a: Moving, b: Moving) -> tuple[float, Array, float]:
    """Force of a spring between points in N, the direction ``(3,)`` to the second one, and mm between."""
    way = b.position - a.position
    length = float(np.linalg.norm(way))
    along = way / length if length else np.zeros(3)
    return float(spring.pull(length)), along, length


# --- A chain of OpenSees' beams under a load case, as a problem that can be followed ------------------------------

TOLERANCE = 1e-13
"""Scaled residual at which an equilibrium counts as found: some hundred times what rounding leaves of it."""


class OpenSeesProblem(BeamProblem):
    """The `BeamProblem` of OpenSees.

    Attributes:
        statics: residual and tangent.
    """

    statics: OpenSeesStatics

    def __init__(
        self, chain: Machine, load_case: LoadCase, elements: int, element: ElementKind, label: str
    ) -> None:
        """Mesh a chain in a posture.

        Raises:
            ImportError: OpenSeesPy, an optional extra, is not installed.
            ValueError: there is no beam, or one without a section; a load on no point of the chain; a load case
                that the engine does not know.
        """
        refuse(label, chain, load_case)
        chain = chain.at(load_case.posture)
        q, points = chain.posture(load_case.posture), wanted(load_case)
        for part, fractions in fixed_points(chain).items():
            points[part] = (*points.get(part, ()), *fractions)
        system = MachineSystem(chain, q, elements, points, hand_joints(chain, load_case))
        control = load_case.control
        watched = system.find(control.part, control.at) if isinstance(control, PointControl) else None
        length = chain.characteristic_length
        super().__init__(
            chain,
            load_case,
            OpenSeesStatics(system, Beams(system.lines, element), length, load_case),
            tuple(s.label for s in system.stations),
            watched,
            label,
            TOLERANCE,
        )


@dataclass(frozen=True)
class OpenSeesEngine:
    """Traces the paths of a chain with OpenSees' shear-rigid beams in corotational frames.

    OpenSees gives the elements' forces and tangents. Rigid pieces and joints, Newton's method, stability and the
    change of branch are here: OpenSees' own constraints are linear in the turns, and so wrong at finite rotation. A
    section's shear stiffness does not count.

    Attributes:
        elements: per beam.
        element: which.
        takes_shear: its beams are rigid in shear.
    """

    elements: int = 16
    element: ElementKind = ElementKind.BOWED
    takes_shear: ClassVar[bool] = False

    @property
    def label(self) -> str:
        """The name under which results are filed."""
        return "opensees"

    @single_threaded
    def problem(self, chain: Machine, load_case: LoadCase) -> OpenSeesProblem:
        """The chain in the load case's posture, meshed.

        Raises:
            ImportError: OpenSeesPy, an optional extra, is not installed.
            ValueError: a beam without a section, a load on no point of the chain, or an imperfection.
        """
        return OpenSeesProblem(chain, load_case, self.elements, self.element, self.label)

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Trace the equilibrium path; see `vjm.continuation.load_stepping` and `vjm.continuation.arc_length`."""
        path = trace(self.problem(chain, load_case), load_case, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
