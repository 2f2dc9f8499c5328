"""Residual and tangent of a chain of corotational beams in independent motions.

The motions are the shifts and small turns of the bodies in world axes and the joints' coordinates. Nodes that a
linkage carries move with it, by the principle of virtual work their forces are the bodies' and the joints'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_fea.common.applied_loads import loading_of
from vjm_fea.common.beam_statics import BeamStatics
from vjm_fea.common.linearized_statics import Tangent
from vjm_fea.common.points import Moving, Place, on_body
from vjm_fea.common.states import States
from vjm_fea.opensees.beams import Beams
from vjm_fea.opensees.linkage import Posed
from vjm_fea.opensees.system import ChainSystem


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


class Statics(BeamStatics):
    """A chain of beams, evaluated at any state.

    A *state* is that of `States`: displacement from the reference in mm and rotation from it as a unit quaternion
    of each of the b bodies, the support last; then the k joint coordinates from the posture.

    Attributes:
        system: bodies, linkages and stations.
    """

    def __init__(self, system: ChainSystem, beams: Beams, length: float, load_case: LoadCase) -> None:
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
        bodies, joints = len(system.carriers) + 1, len(system.stiffness)
        self.states = States(bodies, joints)
        self.motions = 6 * bodies + joints
        at_rest = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], bodies)
        self.initial = np.concatenate([at_rest, np.zeros(joints + 1)])
        self.end_condition, self.hand_reference, self.tool = system.end_condition, np.zeros(3), system.find("", 1.0)
        self.held = 6 * self.end_condition + np.arange(6)
        self.free = np.setdiff1d(np.arange(self.motions), self.held)
        carriers = np.array(system.carriers, dtype=int)
        self._carried_rows = (6 * carriers[:, None] + np.arange(6)).ravel()
        self._carrier_of = {int(node): i for i, node in enumerate(carriers)}
        self._end_of = {link.node: (i, len(link.joints)) for i, link in enumerate(system.linkages)}
        turns = np.append(np.tile([False] * 3 + [True] * 3, bodies), ~system.slides)
        stiffness = np.diag(self._stiffness(self.initial, None)[0])
        self.unit, self.energy = self._scale(stiffness, turns, length)

    def number_unit(self, length: float) -> Array:
        """Units ``(k,)`` in which an arc measures joints' coordinates."""
        return np.where(self.system.slides, length, 1.0)

    # --- places -------------------------------------------------------------------------------------------

    def configuration(self, state: Array) -> Configuration:
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

    def points(self, state: Array, places: Sequence[Place]) -> list[Moving]:
        """Points at a state."""
        if not places:
            return []
        linkages = self.configuration(state).linkages
        bodies, turns = self.states.places(state), self.states.turns(state)
        return [self._point(place, linkages, bodies, turns) for place in places]

    def _point(self, place: Place, linkages: tuple[Posed, ...], bodies: Array, turns: Array) -> Moving:
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

    def _jacobian(self, at: Configuration) -> Array:
        """Shifts and turns ``(6 n, 6 b + k)`` of the nodes by the chain's motions."""
        J = np.zeros((6 * self._beams.count, self.motions))
        J[self._carried_rows, np.arange(len(self._carried_rows))] = 1.0
        for posed in at.linkages:
            node = posed.linkage.node
            own = posed.jacobian(posed.node_position, len(posed.axes))
            J[6 * node : 6 * node + 6, self._motions_of(posed)] = own
        return J

    def _inner(self, state: Array) -> Array:
        at = self.configuration(state)
        r: Array = self._jacobian(at).T @ self._beams.forces(at.displacement, at.rotation).ravel()
        r[6 * self.states.bodies :] += self.system.stiffness * self.states.numbers(state)
        return r

    def _stiffness(self, state: Array, like: Tangent | None) -> tuple[Array, Array | None]:
        at = self.configuration(state)
        J = self._jacobian(at)
        forces = self._beams.forces(at.displacement, at.rotation)
        K: Array = J.T @ self._beams.tangent(at.displacement, at.rotation) @ J
        for posed in at.linkages:
            motions = self._motions_of(posed)
            node = posed.linkage.node
            K[np.ix_(motions, motions)] += posed.geometric_stiffness(
                forces[node], posed.node_position, len(posed.axes)
            )
        joints = np.arange(6 * self.states.bodies, len(K))
        K[joints, joints] += self.system.stiffness
        return K, None
