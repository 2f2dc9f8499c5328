"""A machine in a posture as bodies, linkages (rigid pieces and joints in a row) and rows of beam elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import assert_never

import numpy as np

from vjm.continuation.path import StationLabel
from vjm.model.laws import Law
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Closure, Joint, Part, PointSpring, RigidOffset
from vjm.rotations import Array, rotation_from_vector, skew, translation
from vjm_fea.common.mesh import NO_POINTS, Piece, Place, find, grid, lumped_mass
from vjm_fea.opensees.beams import ElementLine


@dataclass(frozen=True)
class LinkageJoint:
    """One coordinate of a linkage.

    Attributes:
        coordinate: its number in the chain.
        position: a point ``(3,)`` on the axis in the reference configuration, mm.
        axis: unit vector ``(3,)`` in the reference configuration.
        slides: along the axis; else it turns about it.
    """

    coordinate: int
    position: Array
    axis: Array
    slides: bool = False


@dataclass(frozen=True)
class Linkage:
    """What leads from a body to a rigid piece behind joints, and to a node where that carries one.

    Attributes:
        near: number of the body; None for the ground.
        near_position: its reference position ``(3,)``, mm.
        joints: from the body to the piece.
        node: number of the node at the far end; None where there is none.
        node_position: its reference position ``(3,)``, mm.
    """

    near: int | None
    near_position: Array
    joints: tuple[LinkageJoint, ...]
    node: int | None = None
    node_position: Array = field(default_factory=lambda: np.zeros(3))

    def posed(self, position: Array, rotation: Array, q: Array) -> Posed:
        """The linkage with its near body at a place.

        Args:
            position: of the near body ``(3,)``, mm.
            rotation: of the near body from the reference ``(3, 3)``.
            q: coordinates of all joints of the chain, from the reference.
        """
        points, axes, turns, anchors = [], [], [rotation], [(self.near_position, position)]
        for joint in self.joints:
            X, x = anchors[-1]
            R = turns[-1]
            point, axis = x + R @ (joint.position - X), R @ joint.axis
            amount = float(q[joint.coordinate])
            points.append(point)
            axes.append(axis)
            turns.append(R if joint.slides else rotation_from_vector(axis * amount) @ R)
            anchors.append((joint.position, point + axis * amount if joint.slides else point))
        return Posed(self, position, tuple(points), tuple(axes), tuple(turns), tuple(anchors))


@dataclass(frozen=True)
class Posed:
    """A linkage at a place.

    Its motions are the near body's shift and turn, then its joints' rates: ``6 + k``; without the six where the
    near body is the ground.

    Attributes:
        linkage: which.
        position: of the near body ``(3,)``, mm.
        points: of the joints, each ``(3,)``.
        axes: of the joints, each ``(3,)``.
        turns: rotation ``(3, 3)`` from the reference of every rigid piece, from the near body to the node.
        anchors: reference and present position of a point of every rigid piece.
    """

    linkage: Linkage
    position: Array
    points: tuple[Array, ...]
    axes: tuple[Array, ...]
    turns: tuple[Array, ...]
    anchors: tuple[tuple[Array, Array], ...]

    def place(self, reference: Array, piece: int = -1) -> Array:
        """Present position ``(3,)`` of a point of a rigid piece, by default of the one with the node."""
        X, x = self.anchors[piece]
        return x + self.turns[piece] @ (reference - X)

    @property
    def node_position(self) -> Array:
        """Of the node ``(3,)``, mm."""
        return self.place(self.linkage.node_position)

    def _motion(self, point: Array, piece: int) -> tuple[Array, Array]:
        """Shift and turn ``(3, 6 + k)`` of a rigid piece at a point of it, by the linkage's motions."""
        shift, turn = np.zeros((2, 3, 6 + len(self.axes)))
        shift[:, :3] = turn[:, 3:6] = np.eye(3)
        shift[:, 3:6] = -skew(point - self.position)
        for j in range(piece):
            slides = self.linkage.joints[j].slides
            shift[:, 6 + j] = self.axes[j] if slides else np.cross(self.axes[j], point - self.points[j])
            if not slides:
                turn[:, 6 + j] = self.axes[j]
        return shift, turn

    def jacobian(self, point: Array, piece: int) -> Array:
        """Shift and turn ``(6, 6 + k)`` of a rigid piece at a point ``(3,)`` of it, by the linkage's motions."""
        return self._moving(np.vstack(self._motion(point, piece)))

    def geometric_stiffness(self, wrench: Array, point: Array, piece: int) -> Array:
        """How the motions' share of a wrench ``(6,)`` on a rigid piece changes with them, ``(6 + k, 6 + k)``.

        The wrench stays as it is in world axes; what changes are arms and axes: ``∂(Jᵀ w)/∂x`` at constant ``w``.

        Args:
            wrench: force and moment.
            point: on which it acts ``(3,)``.
            piece: of which the point is.
        """
        k = len(self.axes)
        force, moment = wrench[:3], wrench[3:]
        end_shift = self._motion(point, piece)[0]
        G = np.zeros((6 + k, 6 + k))
        G[3:6] = -skew(force) @ (end_shift - np.eye(3, 6 + k))
        for j in range(piece):
            axis = self.axes[j]
            shift, turn = self._motion(self.points[j], j)
            if self.linkage.joints[j].slides:
                G[6 + j] = -force @ skew(axis) @ turn
            else:
                about = moment + np.cross(point - self.points[j], force)
                G[6 + j] = -about @ skew(axis) @ turn - axis @ skew(force) @ (end_shift - shift)
        return self._moving(self._moving(G).T).T

    def _moving(self, columns: Array) -> Array:
        return columns if self.linkage.near is not None else columns[:, 6:]


Body = int | tuple[int, int] | None
"""What carries a point: a beam's node by its number, a linkage by its number and that of its rigid piece, or None
for the ground."""


@dataclass(frozen=True)
class OpenSeesStation:
    """A material point of which the shape is made.

    Attributes:
        label: of its row.
        place: where it is, and on what.
    """

    label: StationLabel
    place: Place


@dataclass(frozen=True)
class HeldFrames:
    """Two frames that are held together.

    Attributes:
        places: of their origins; without a body on the ground.
        turned: rotation ``(3, 3)`` from the first frame to the second in the reference configuration, world axes.
        rows: 6 of a weld, 3 of a ball joint.
    """

    places: tuple[Place, Place]
    turned: Array
    rows: int


SUPPORT = "support"
"""What carries the support's point."""


@dataclass(frozen=True)
class CoordinateRow:
    """A weighted sum of joint coordinates from the posture, and a number, that is zero."""

    weights: Array
    offset: float


@dataclass
class _Here:
    """Where the next part begins: the body from which joints lead on, and the frame behind them."""

    frame: Array
    near: int | None
    near_position: Array
    joints: tuple[LinkageJoint, ...] = ()
    node: int | None = None
    """The node that is there, where no joint lies behind it."""


class MachineSystem:
    """Where everything is in the reference configuration: the given posture, its closures where it has them.

    Attributes:
        lines: rows of beam elements.
        nodes: reference positions ``(n, 3)`` of their nodes, mm.
        carriers: node of every body but the last, which is the support.
        linkages: to the nodes at which beams begin, and to rigid pieces.
        stiffness: of the joints' coordinates ``(k, k)``, N, mm, rad; zero for passive ones.
        natural: coordinates ``(k,)`` at which their springs are free of stress.
        slides: which of the joints' coordinates ``(k,)`` are shifts.
        held: frames that are held together, the end-effector's and its support's among them.
        rows: conditions on joint coordinates alone: couplings.
        springs: springs between points, and the two places of each.
        stations: in the order of the parts.
        pieces: where points and masses are.
        end: frame ``(4, 4)`` of the end-effector.
    """

    def __init__(
        self,
        chain: Machine,
        q: Array,
        elements: int,
        points: Mapping[str, tuple[float, ...]] = NO_POINTS,
        end_condition: Sequence[Joint] = (),
    ) -> None:
        """Set out a machine.

        Args:
            chain: the machine.
            q: its passive joints' coordinates.
            elements: of each of its beams.
            points: fractions of its beams at which there has to be a node, by name.
            end_condition: joints between the end-effector and the support, see `vjm.model.end_condition`.

        Raises:
            ValueError: a beam without a section, or another number of joints.
        """
        if elements < 1:
            raise ValueError(f"a beam needs at least one element, not {elements}")
        if len(q) != len(chain.joints):
            raise ValueError(
                f"{chain.name}: {len(chain.joints)} passive joints but {len(q)} coordinates in the posture"
            )
        self._elements, self._points, self._chain = elements, points, chain
        self.pieces: list[Piece] = []
        self.lines: list[ElementLine] = []
        self.carriers: list[int] = []
        self.linkages: list[Linkage] = []
        self.stations: list[OpenSeesStation] = []
        self._count = 0
        self._slides: list[bool] = []
        self._springs: list[tuple[int, Array, Array]] = []
        self.laws: list[tuple[int, Law, float]] = []
        self._own: dict[str, int] = {}
        self._following: list[tuple[dict[int, float], float]] = []
        self._linked: dict[tuple[int, ...], int] = {}
        values = dict(zip((joint.name for joint in chain.joints), np.asarray(q, dtype=float).tolist(), strict=True))
        world = _Here(np.eye(4), None, np.zeros(3))
        begins, ends = {"": world}, {"": world}
        base, behind = _Here(chain.base, None, chain.base[:3, 3]), chain.predecessors
        for part in chain.parts:
            where = behind[part.name]
            start = ends[where] if where else base
            if isinstance(part, Joint) and part.rides_on:
                start = self._on_beam(begins[part.rides_on], part.rides_on)
            self._here = begins[part.name] = start
            self._add(part, values)
            if isinstance(part, Joint) and not part.fixed:
                begins[part.name] = self._here
            ends[part.name] = self._here
        self._ends = {end: ends[behind] for end, behind in chain.ends.items()}
        self.end = self._here.frame
        self._tool = Place(self._body(), self.end[:3, 3])
        for joint in end_condition:
            # along the world's axes, through the end-effector's reference point
            self._add_joint(self.end[:3, :3].T @ joint.axis, slides=joint.slides)
        support = (Place(self._body(), self.end[:3, 3]), Place(SUPPORT, self.end[:3, 3]))
        self.held = [
            HeldFrames(support, np.eye(3), 6),
            *(self._closed(closure, ends) for closure in chain.closures),
        ]
        self.springs: list[tuple[PointSpring, list[Place]]] = [
            (spring, [self._fixed(*end, begins) for end in zip(spring.parts, spring.points, strict=True)])
            for spring in chain.point_springs
        ]
        for coupling in chain.couplings:
            off = sum(weight * values[name] for name, weight in coupling.terms) - coupling.total
            self._following.append(({self._own[name]: weight for name, weight in coupling.terms}, off))
        self._close()

    def _close(self) -> None:
        """Arrays of what was collected part by part."""
        self.nodes = np.vstack([line.positions for line in self.lines])
        self.slides = np.array(self._slides, dtype=bool)
        k = len(self.slides)
        self.stiffness, self.natural = np.zeros((k, k)), np.zeros(k)
        for first, stiffness, natural in self._springs:
            where = slice(first, first + len(natural))
            self.stiffness[where, where], self.natural[where] = stiffness, natural
        self.rows: list[CoordinateRow] = []
        for weights, offset in self._following:
            row = np.zeros(k)
            row[list(weights)] = list(weights.values())
            self.rows.append(CoordinateRow(row, offset))

    # --- parts --------------------------------------------------------------------------------------------

    def _add(self, part: Part, values: Mapping[str, float]) -> None:
        match part:
            case RigidOffset():
                self._mark(part.name, 0.0)
                T = self._here.frame
                centre = T[:3, :3] @ part.centre_of_mass + T[:3, 3]
                self.pieces.append(
                    Piece(part.name, 0.0, 1.0, self._body(), T[:3, 3], T[:3, :3] @ part.transform[:3, 3], part.mass,
                          centre)
                )  # fmt: skip
                self._move(part.transform)
            case Joint(free=True):
                self._own[part.name] = self._add_joint(part.axis, slides=part.slides)
                self._move(part.motion(values[part.name]))
            case Joint():
                self._move(part.motion(part.held_at))
                self._add_springs(part)
            case Beam():
                self._add_beam(part)
            case _:
                assert_never(part)

    def _on_beam(self, root: _Here, beam: str) -> _Here:
        """The frame where a beam begins, as the node carries it at which a joint rides."""
        fraction = self._chain.cuts[beam]
        if not fraction:
            return root
        place = find(beam, self.pieces, beam, fraction)
        return _Here(root.frame, self.carriers.index(place.body), place.position, (), place.body)

    def _move(self, transform: Array) -> None:
        start = self._here
        self._here = _Here(start.frame @ transform, start.near, start.near_position, start.joints, start.node)

    def _add_joint(self, axis: Array, *, slides: bool) -> int:
        """A joint with a coordinate of its own; the coordinate's number."""
        start, number = self._here, len(self._slides)
        joint = LinkageJoint(number, start.frame[:3, 3], start.frame[:3, :3] @ axis, slides)
        self._here = _Here(start.frame, start.near, start.near_position, (*start.joints, joint))
        self._slides.append(slides)
        return number

    def _add_spring(self, axis: Array, slides: bool, compliance: float, stretch: float = 0.0) -> int:
        number = self._add_joint(axis, slides=slides)
        self._springs.append((number, np.array([[1.0 / compliance]]), np.array([stretch])))
        return number

    def _add_springs(self, joint: Joint) -> None:
        """What deflects in a joint, as the virtual joint method has it."""
        sprung = {self._own[name]: ratio for name, ratio in joint.passes_on if name in self._own}
        if sprung:
            number = self._add_joint(joint.axis, slides=joint.slides)
            self._following.append((sprung | {number: -1.0}, 0.0))
        if joint.matrix is not None and joint.matrix.any():
            gives = np.flatnonzero(joint.matrix.any(axis=0))
            numbers = [self._add_joint(np.eye(3)[k % 3], slides=k < 3) for k in gives.tolist()]
            stiffness = np.asarray(np.linalg.inv(joint.matrix[np.ix_(gives, gives)]), dtype=float)
            self._springs.append((numbers[0], stiffness, np.zeros(len(numbers))))
        for axis, compliance in joint.bearings:
            self._add_spring(axis, False, compliance)
        if joint.law is not None:
            number = self._own[joint.name] = self._add_joint(joint.axis, slides=joint.slides)
            self.laws.append((number, joint.law, joint.stretch))
        elif joint.compliance > 0.0:
            self._own[joint.name] = self._add_spring(joint.axis, joint.slides, joint.compliance, joint.stretch)

    def _add_beam(self, beam: Beam) -> None:
        section = beam.effective_section()
        start = self._here
        root = start.frame @ beam.section_in_chain
        fractions = grid(self._elements, self._points.get(beam.name, ()))
        positions = root[:3, 3] + np.outer(fractions * beam.length, root[:3, 0])
        self.lines.append(ElementLine(positions, root[:3, 2], section))
        first = self._count
        self.linkages.append(Linkage(start.near, start.near_position, start.joints, first, positions[0]))
        self.carriers += range(first + 1, first + len(positions))
        self._count += len(positions)
        for i, fraction in enumerate(fractions.tolist()):
            place = Place(first + i, positions[i])
            self.stations.append(OpenSeesStation(StationLabel(beam.name, fraction), place))
            mass, offset = lumped_mass(beam, fractions, i)
            centre = positions[i] + offset * root[:3, 0]
            self.pieces.append(
                Piece(beam.name, fraction, fraction, place.body, positions[i], np.zeros(3), mass, centre)
            )
        tip = first + len(positions) - 1
        self._here = _Here(start.frame @ translation(beam.tip), len(self.carriers) - 1, positions[-1], (), tip)
        if np.any(beam.end_offset):
            self._mark(beam.name, 1.0 + float(np.linalg.norm(beam.end_offset)) / beam.length)

    # --- places -------------------------------------------------------------------------------------------

    def _body(self, end: _Here | None = None) -> Body:
        """What carries a place, by default the present one."""
        end = self._here if end is None else end
        if not end.joints:
            return end.node
        # a joint is on one way only
        key = tuple(joint.coordinate for joint in end.joints)
        if key not in self._linked:
            self._linked[key] = len(self.linkages)
            self.linkages.append(Linkage(end.near, end.near_position, end.joints))
        return self._linked[key], len(end.joints)

    def _mark(self, part: str, fraction: float) -> None:
        place = Place(self._body(), self._here.frame[:3, 3])
        self.stations.append(OpenSeesStation(StationLabel(part, fraction), place))

    def _closed(self, closure: Closure, ends: Mapping[str, _Here]) -> HeldFrames:
        """A closure's two frames where the posture has them."""
        sides = [ends[part] for part in closure.parts]
        first, second = (side.frame @ T for side, T in zip(sides, closure.frames, strict=True))
        places = [Place(self._body(side), T[:3, 3]) for side, T in zip(sides, (first, second), strict=True)]
        return HeldFrames((places[0], places[1]), second[:3, :3] @ first[:3, :3].T, closure.rows)

    def _fixed(self, part: str, point: Array, begins: Mapping[str, _Here]) -> Place:
        """A point ``(3,)`` of a part, in the frame where the part begins, see `PointSpring`."""
        start = begins[part]
        where = start.frame[:3, :3] @ point + start.frame[:3, 3]
        beam = next((beam for beam in self._chain.beams if beam.name == part), None)
        if beam is None:
            return Place(self._body(start), where)
        return Place(find(part, self.pieces, part, beam.fraction_of(point)).body, where)

    def find(self, part: str, fraction: float) -> Place:
        """The point of a part at a fraction of its elastic length, or an end frame; no name: the end-effector.

        Raises:
            ValueError: the part has no such point.
        """
        if not part:
            return self._tool
        if part in self._ends:
            end = self._ends[part]
            return Place(self._body(end), end.frame[:3, 3])
        return find(self._chain.name, self.pieces, part, fraction)
