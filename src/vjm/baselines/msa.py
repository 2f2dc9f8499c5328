"""Matrix structural analysis: linear two-node beams, 6×6 matrices, joints as releases, closures as conditions.

Assembled over the machine's tree from textbook 12×12 beam stiffnesses, independently of the virtual joint method's
Jacobians. Rigid parts and joints give nodes that move with those before them, so that what is unknown are the far
nodes of beams and the motions of joints.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import assert_never

import numpy as np

from vjm.baselines.linear import LinearMachine, refuse_open, refuse_stretched, refuse_uncoupled, straight_path
from vjm.continuation.path import Path
from vjm.limits import refuse
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Closure, Coupling, Joint, Part, PointSpring, RigidOffset, Section
from vjm.rotations import Array, frame, rotate_matrix6, skew, translation
from vjm.threads import single_threaded

# --- Elements of matrix structural analysis: a beam between two nodes, and an arm of a rigid body -----------------


def beam_element(section: Section, length: float) -> Array:
    """Stiffness ``(12, 12)`` of a straight beam between two nodes, section axes, x from node 1 to node 2.

    Timoshenko's with ``Φ = 12 EI/(GA L²)``, Bernoulli's where GA is infinite; Przemieniecki, *Theory of Matrix
    Structural Analysis* (1968), eq. (5.116).
    """
    K = np.zeros((12, 12))
    L = length

    def add(dofs: list[int], block: list[list[float]]) -> None:
        K[np.ix_(dofs, dofs)] += np.array(block)

    a, t = section.EA / L, section.GJ / L
    add([0, 6], [[a, -a], [-a, a]])
    add([3, 9], [[t, -t], [-t, t]])
    for EI, GA, v, r, sign in (
        (section.EIz, section.GAy, 1, 5, 1.0),
        (section.EIy, section.GAz, 2, 4, -1.0),
    ):
        phi = 12.0 * EI / (GA * L**2)
        b = EI / ((1.0 + phi) * L**3)
        m = sign * 6.0 * L * b
        near, far = (4.0 + phi) * L**2 * b, (2.0 - phi) * L**2 * b
        add(
            [v, r, v + 6, r + 6],
            [
                [12.0 * b, m, -12.0 * b, m],
                [m, near, -m, far],
                [-12.0 * b, -m, 12.0 * b, -m],
                [m, far, -m, near],
            ],
        )
    return K


def rigid_arm(offset: Array) -> Array:
    """Displacement transport ``(6, 6)``: of a point ``offset`` (3,) away on a rigid body, from the body's."""
    A = np.eye(6)
    A[:3, 3:] = -skew(offset)
    return A


# ------------------------------------------------------------------------------------------------------------------


LABEL = "msa"
NEAR = 1e-9
"""Difference of two fractions of a beam that are one."""


@dataclass(frozen=True)
class _Node:
    """A place on a rigid piece: its frame ``(4, 4)`` in the posture, its displacement by the unknowns ``(6, n)``.

    Unknowns that were added later do not move it: their columns are left out.
    """

    T: Array
    position: Array

    def behind(self, transform: Array) -> _Node:
        """Another place of the same rigid piece, a frame ``(4, 4)`` on."""
        T = self.T @ transform
        return _Node(T, rigid_arm(T[:3, 3] - self.T[:3, 3]) @ self.position)

    def within(self, size: int) -> Array:
        """Its displacement ``(6, n)`` by all of n unknowns."""
        return np.pad(self.position, ((0, 0), (0, size - self.position.shape[1])))


class _Assembly:
    """A tree of parts as nodes and elements, its closures and couplings as conditions.

    Attributes:
        K: stiffness of the unknowns ``(n, n)``.
        unit: of the unknowns: the machine's length for shifts, 1 for turns.
    """

    def __init__(
        self, chain: Machine, posture: Array, points: Mapping[str, tuple[float, ...]], *, stressed: bool = False
    ) -> None:
        """Set a machine up.

        Args:
            chain: its held joints at the coordinates of a posture.
            posture: passive coordinates ``(n_q,)`` rad or mm.
            points: fractions of beams at which there has to be a node, by name.
            stressed: whether springs and closures may be under stress in the posture, which is left out here.

        Raises:
            ValueError: they may not, but are.
        """
        self.chain, self._stressed = chain, stressed
        self.length = chain.characteristic_length
        self.K = np.zeros((0, 0))
        self.unit: list[float] = []
        self.weights: list[tuple[float, _Node]] = []
        self._points = points
        self._own: dict[str, int] = {}
        base = np.zeros((6, 0))
        self._begins, self._ends = {"": _Node(np.eye(4), base)}, {"": _Node(chain.base, base)}
        self._along: dict[str, list[tuple[float, _Node]]] = {}
        coordinates = dict(zip((joint.name for joint in chain.joints), posture.tolist(), strict=True))
        before = chain.predecessors
        for part in chain.parts:
            begin = self._ends[before[part.name]]
            if isinstance(part, Joint) and part.rides_on:
                begin = self._carried(begin.T, self._place(part.rides_on, chain.cuts[part.rides_on]))
            self._node = self._begins[part.name] = begin
            self._add(part, coordinates)
            self._ends[part.name] = self._node
        for spring in chain.point_springs:
            self._add_point_spring(spring)
        self._conditions = [self._closed(closure) for closure in chain.closures]
        self._conditions += [self._coupled(coupling, coordinates) for coupling in chain.couplings]

    def machine(self) -> LinearMachine:
        """What was set up."""
        n = len(self.K)
        return LinearMachine(
            self.chain.name,
            self.length,
            np.array(self.unit),
            self.K,
            self._node.within(n),
            np.vstack([np.zeros((0, n)), *self._conditions]),
            lambda part, at: self._place(part, at).within(n),
            [(mass, node.within(n)[:3]) for mass, node in self.weights],
        )

    def shape(self) -> Array:
        """Shifts ``(3 k, n)`` of the ends of all parts."""
        return np.vstack([node.within(len(self.K))[:3] for node in self._ends.values()])

    # --- unknowns -----------------------------------------------------------------------------------------

    def _unknowns(self, unit: Sequence[float]) -> None:
        self.unit += unit
        self.K = np.pad(self.K, (0, len(unit)))

    def _free(self, directions: Array, slides: Sequence[bool], stiffness: Array | None = None) -> None:
        """Let the node move further along directions ``(6, k)``, with a spring ``(k, k)`` or without."""
        k = directions.shape[1]
        self._unknowns([self.length if along else 1.0 for along in slides])
        self._node = _Node(self._node.T, np.hstack([self._node.within(len(self.K) - k), directions]))
        if stiffness is not None and k:
            self.K[-k:, -k:] = stiffness

    def _release(self, axis: Array, *, slides: bool, compliance: float | None = None) -> None:
        """Let the node slide along or turn about an axis (3,) of the chain frame, with a spring or without."""
        world, nothing = self._node.T[:3, :3] @ axis, np.zeros(3)
        motion = np.concatenate([world, nothing] if slides else [nothing, world])
        self._free(motion[:, None], [slides], None if compliance is None else np.array([[1.0 / compliance]]))

    def _deflect(self, compliance: Array, axes: Array) -> None:
        """Let the node move by a compliance ``(6, 6)`` in axes ``(3, 3)`` of the chain frame; 0 is rigid."""
        gives = compliance.any(axis=0)
        directions = np.asarray(np.kron(np.eye(2), self._node.T[:3, :3] @ axes)[:, gives], dtype=float)
        stiffness = np.asarray(np.linalg.inv(compliance[np.ix_(gives, gives)]), dtype=float)
        self._free(directions, [k < 3 for k in np.flatnonzero(gives).tolist()], stiffness)

    def _element(self, K: Array, axes: Array, transform: Array) -> None:
        """Add a two-node element ``(12, 12)`` given in ``axes`` (3, 3), and go to its far node."""
        turned = np.zeros((12, 12))
        turned[:6, :6] = rotate_matrix6(K[:6, :6], axes)
        turned[6:, 6:] = rotate_matrix6(K[6:, 6:], axes)
        turned[:6, 6:] = rotate_matrix6(K[:6, 6:], axes)
        turned[6:, :6] = turned[:6, 6:].T
        near = self._node
        self._unknowns([self.length] * 3 + [1.0] * 3)
        n = len(self.K)
        self._node = _Node(near.T @ transform, np.eye(6, n, n - 6))
        both = np.vstack([near.within(n), self._node.position])
        self.K += both.T @ turned @ both

    # --- parts --------------------------------------------------------------------------------------------

    def _add(self, part: Part, coordinates: Mapping[str, float]) -> None:
        match part:
            case RigidOffset():
                begin = self._node
                self._weigh(part.mass, translation(part.centre_of_mass))
                self._node = begin.behind(part.transform)
                self._along[part.name] = [(0.0, begin), (1.0, self._node)]
            case Joint(free=True):
                self._own[part.name] = len(self.K)
                self._release(part.axis, slides=part.slides)
                # along or about the joint itself, so that its direction stays what it was
                self._node = self._begins[part.name] = self._node.behind(part.motion(coordinates[part.name]))
            case Joint(fixed=True):
                self._add_springs(part)
            case Joint():
                begin = self._node = self._node.behind(part.motion(part.held_at))
                self._add_springs(part)
                self._begins[part.name] = self._node
                self._along[part.name] = [(0.0, begin), (1.0, self._node)]
            case Beam():
                self._add_beam(part)
            case _:
                assert_never(part)

    def _add_springs(self, joint: Joint) -> None:
        """What deflects in a joint, as releases with springs."""
        self._pass_on(joint)
        if joint.matrix is not None:
            self._deflect(joint.matrix, np.eye(3))
        for axis, compliance in joint.bearings:
            self._release(axis, slides=False, compliance=compliance)
        if joint.sprung:
            compliance = joint.compliance
            if joint.law is not None:
                # of a machine with no slope at rest only the geometry is asked
                compliance = 1.0 / (joint.law.rest_stiffness or joint.law.largest_stiffness)
            self._own[joint.name] = len(self.K)
            self._release(joint.axis, slides=joint.slides, compliance=compliance)

    def _pass_on(self, joint: Joint) -> None:
        """Move the node by the ratio times what the springs of the other joints do about their own axes."""
        displacement = self._node.within(len(self.K))
        world = self._node.T[:3, :3] @ joint.axis
        rows = slice(0, 3) if joint.slides else slice(3, 6)
        for name, ratio in joint.passes_on:
            if name in self._own:
                displacement[rows, self._own[name]] += ratio * world
        self._node = _Node(self._node.T, displacement)

    def _add_beam(self, beam: Beam) -> None:
        begin = self._node
        if beam.section is None or beam.own_segments == 1:
            # known by its matrix: a spring at its tip, whose mass hangs on its root
            self._weigh(beam.mass, translation(beam.centre_of_mass))
            self._along[beam.name] = [(0.0, begin)]
            self._node = begin.behind(translation(beam.tip))
            self._deflect(beam.tip_compliance(), beam.own_frame)
            self._along[beam.name].append((1.0, self._node))
            return
        section, axes = beam.effective_section(), beam.own_frame @ beam.section_frame
        inside = [fraction for fraction in self._points.get(beam.name, ()) if NEAR < fraction < 1.0 - NEAR]
        cuts = np.unique([0.0, *inside, 1.0])
        nodes = [(0.0, begin)]
        for start, stop in pairwise(cuts.tolist()):
            h = (stop - start) * beam.length
            along = axes @ np.array([h, 0.0, 0.0])
            near = self._node
            self._element(beam_element(section, h), near.T[:3, :3] @ axes, translation(along))
            nodes.append((stop, self._node))
            # half of an even load at either node with its moment q h²/12: a sixth of the length inside
            for node, inside in ((near, along / 6.0), (self._node, -along / 6.0)):
                self.weights.append((0.5 * section.mass * h, node.behind(translation(inside))))
        self._node = self._node.behind(translation(beam.own_frame @ beam.end_offset))
        if np.any(beam.end_offset):
            nodes.append((1.0 + float(np.linalg.norm(beam.end_offset)) / beam.length, self._node))
        self._along[beam.name] = nodes

    def _weigh(self, mass: float, transform: Array) -> None:
        if mass > 0.0:
            self.weights.append((mass, self._node.behind(transform)))

    # --- places -------------------------------------------------------------------------------------------

    def _place(self, part: str, share: float) -> _Node:
        """The node of a part at a fraction of its length, of the end-effector where it has no name.

        Raises:
            ValueError: the part has no such point.
        """
        if not part:
            return self._node
        if part in self.chain.ends:
            return self._ends[self.chain.ends[part]]
        if part not in self._along:
            known = ", ".join(self._along)
            raise ValueError(f"{self.chain.name}: no part '{part}' with points on it (there are {known})")
        nodes = self._along[part]
        for fraction, node in reversed(nodes):
            if abs(fraction - share) < NEAR:
                return node
        named = {each.name: each for each in self.chain.parts}
        own = named[part]
        if isinstance(own, RigidOffset) and 0.0 < share < 1.0:
            return nodes[0][1].behind(translation(share * own.transform[:3, 3]))
        if isinstance(own, Beam) and 1.0 < share < nodes[-1][0]:
            short = (share - nodes[-1][0]) / (nodes[-1][0] - 1.0)
            return nodes[-1][1].behind(translation(short * (own.own_frame @ own.end_offset)))
        if isinstance(own, Beam) and 0.0 < share < 1.0:
            raise ValueError(
                f"{self.chain.name}: part '{part}' is known by its compliance, which has no point at {share:g} of "
                f"its length; give it a section"
            )
        raise ValueError(f"{self.chain.name}: part '{part}' has points from 0 to 1 of its length, not at {share:g}")

    def _carrying(self, part: str, point: Array) -> _Node:
        """A point ``(3,)`` of a part, given where the part begins, on what carries it, see `PointSpring`."""
        begin = self._begins[part]
        beam = next((beam for beam in self.chain.beams if beam.name == part), None)
        if beam is None:
            return begin.behind(translation(point))
        carrier = self._place(part, beam.fraction_of(point))
        return self._carried(frame(p=begin.T[:3, :3] @ point + begin.T[:3, 3]), carrier)

    def _carried(self, T: Array, carrier: _Node) -> _Node:
        """A frame ``(4, 4)`` that goes with a node."""
        return _Node(T, rigid_arm(T[:3, 3] - carrier.T[:3, 3]) @ carrier.position)

    # --- what is closed -----------------------------------------------------------------------------------

    def _add_point_spring(self, spring: PointSpring) -> None:
        n = len(self.K)
        a, b = (self._carrying(part, point) for part, point in zip(spring.parts, spring.points, strict=True))
        way = b.T[:3, 3] - a.T[:3, 3]
        length = float(np.linalg.norm(way))
        if not self._stressed:
            refuse_stretched(LABEL, self.chain, spring, length)
        row = (way / length if length else way) @ (b.within(n) - a.within(n))[:3]
        self.K += float(spring.tangent(length)) * np.outer(row, row)

    def _closed(self, closure: Closure) -> Array:
        """Rows ``(6, n)`` of a weld, ``(3, n)`` of a ball joint."""
        n = len(self.K)
        a, b = (
            self._ends[part].behind(T) if part else _Node(T, np.zeros((6, 0)))
            for part, T in zip(closure.parts, closure.frames, strict=True)
        )
        if not self._stressed:
            refuse_open(LABEL, self.chain, closure, a.T, b.T)
        return (b.within(n) - a.within(n))[: closure.rows]

    def _coupled(self, coupling: Coupling, coordinates: Mapping[str, float]) -> Array:
        """Row ``(1, n)`` of a coupling."""
        if not self._stressed:
            refuse_uncoupled(LABEL, coupling, coordinates)
        row = np.zeros((1, len(self.K)))
        for name, weight in coupling.terms:
            row[0, self._own[name]] += weight
        return row


def msa_machine(chain: Machine, posture: Array, load_case: LoadCase | None = None) -> LinearMachine:
    """A machine in a posture as a linear one of nodes and elements.

    Args:
        chain: the machine, its held joints at the coordinates of a posture; a beam with ``own_segments`` 1 or
            without a section enters as its 6×6 matrix, every other one as elements.
        posture: passive coordinates ``(n_q,)`` rad or mm.
        load_case: whose loads need nodes.

    Raises:
        ValueError: see `vjm.limits`, or a point that the machine does not have.
    """
    refuse(LABEL, chain)
    return _Assembly(chain, posture, _points(chain, load_case)).machine()


def geometry(chain: Machine, posture: Array) -> tuple[LinearMachine, Array]:
    """A machine without the stress that its posture may put it under, to tell what its joints and closures leave.

    Args:
        chain: as for `msa_machine`.
        posture: passive coordinates ``(n_q,)`` rad or mm.

    Returns:
        The machine, and the shifts ``(3 k, n)`` of the ends of its parts by its unknowns.
    """
    assembly = _Assembly(chain, posture, _points(chain, None), stressed=True)
    return assembly.machine(), assembly.shape()


def _points(chain: Machine, load_case: LoadCase | None) -> dict[str, tuple[float, ...]]:
    """Fractions of beams at which there has to be a node, by name."""
    points: dict[str, set[float]] = {name: {fraction} for name, fraction in chain.cuts.items()}
    for load in load_case.loads if load_case is not None else ():
        points.setdefault(load.part, set()).add(load.at)
    for spring in chain.point_springs:
        for name, point in zip(spring.parts, spring.points, strict=True):
            for beam in chain.beams:
                if beam.name == name:
                    points.setdefault(name, set()).add(beam.fraction_of(point))
    return {part: tuple(sorted(fractions)) for part, fractions in points.items()}


@dataclass(frozen=True)
class MsaEngine:
    """Matrix structural analysis of the unloaded posture: a straight line."""

    label: str = LABEL

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Straight line of the machine of `msa_machine`."""
        refuse(self.label, chain, load_case)
        started = time.perf_counter()
        posture = load_case.posture
        machine = msa_machine(chain.at(posture), chain.posture(posture), load_case)
        return straight_path(self.label, chain, load_case, machine, started)
