"""A machine in a posture as a system of Exudyn, which is an untyped module: its type stubs do not fit its calls."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, assert_never

import exudyn
import exudyn.itemInterface
import numpy as np

from vjm.continuation.path import StationLabel
from vjm.model.machine import FOOT
from vjm.model.parts import Beam, Joint, Part, RigidOffset
from vjm.rotations import Array, frame, inverse_frame, translation, turn
from vjm_fea.common.end_condition import joint_axes
from vjm_fea.common.mesh import Mesh, Piece, Place, find, lumped_mass
from vjm_fea.common.states import quaternion
from vjm_fea.exudyn.joints import (
    PRISMATIC,
    REVOLUTE,
    UNIVERSAL,
    ElementarySpring,
    LinearConstraint,
    MatrixSpring,
    RelativeMotion,
    axes_with,
    elementary_springs,
    held_by,
    is_coupled,
)

exu: Any = exudyn
items: Any = exudyn.itemInterface
Item = Any
"""The number of a node, marker or object in Exudyn's system."""
Description = Any
"""What Exudyn makes a node, marker or object from, or its settings."""
System = Any
"""A main system of Exudyn."""


@dataclass(frozen=True)
class Rigid:
    """A rigid piece.

    Attributes:
        node: index of its node, −1 for the ground.
        item: number of the object that carries markers.
        reference: frame ``(4, 4)`` of the node in the reference configuration.
    """

    node: int
    item: Item
    reference: Array


@dataclass(frozen=True)
class ExudynStation:
    """A material point of which the shape is made: ``offset`` ``(3,)`` mm in the axes of the node."""

    label: StationLabel
    node: int
    offset: Array


def between(before: Rigid, behind: Rigid, T: Array) -> tuple[tuple[int, int], Array]:
    """Nodes of two pieces that meet in a frame ``T`` (4, 4), and that frame in the axes of each, ``(2, 4, 4)``."""
    return (before.node, behind.node), np.array([inverse_frame(r.reference) @ T for r in (before, behind)])


def leaders_of(count: int, locked: Iterable[tuple[int, int]], first: Iterable[int]) -> list[int]:
    """Leader of every node's rigid piece, −1 on the ground.

    Args:
        count: number of nodes.
        locked: pairs of nodes of one piece, −1 for the ground.
        first: nodes that lead their pieces, unless these stand on the ground.
    """
    leaders = list(range(count))
    for a, b in locked:
        old, new = leaders[b] if b >= 0 else -1, leaders[a] if a >= 0 else -1
        if old == -1:
            old, new = new, old
        leaders = [new if leader == old else leader for leader in leaders]
    for node in first:
        old = leaders[node]
        if old >= 0:
            leaders = [node if leader == old else leader for leader in leaders]
    return leaders


# --- Two systems of Exudyn side by side: a machine, and the same without its beams --------------------------------
#
# What joints and springs put up is differenced in the second one. In the first, rounding of the positions strains
# the beams' elements, and a short one answers with more force than the difference that is looked for.


class ExudynAssembly:
    """Nodes, markers, joints and springs in both systems, beams in the first.

    Attributes:
        whole: the main system of the machine.
        unmeshed: that of the same nodes without the beams between them.
    """

    def __init__(self) -> None:
        """Two empty systems."""
        exu.config.printToConsole = False
        # the container owns the systems: without it they die
        self._container = exu.SystemContainer()
        self.whole, self.unmeshed = self._container.AddSystem(), self._container.AddSystem()
        self._beams: list[Description] = []

    def node(self, item: Description) -> Item:
        """Add a node; its number."""
        self.unmeshed.AddNode(item)
        return self.whole.AddNode(item)

    def marker(self, item: Description) -> Item:
        """Add a marker; its number."""
        self.unmeshed.AddMarker(item)
        return self.whole.AddMarker(item)

    def rigid(self, item: Description) -> Item:
        """Add a rigid body, a joint or a spring; its number, the same in both systems."""
        self.unmeshed.AddObject(item)
        return self.whole.AddObject(item)

    def beam(self, item: Description) -> None:
        """Add a beam's element, behind all that both systems have."""
        self._beams.append(item)

    def close(self) -> None:
        """Assemble both."""
        for item in self._beams:
            self.whole.AddObject(item)
        self.whole.Assemble()
        self.unmeshed.Assemble()


# ------------------------------------------------------------------------------------------------------------------


Connect = Callable[[Item], None]
"""Closes a joint that is open at its far side, given the marker there."""


class ExudynSystem:
    """A system to which parts are added, and where things are in it.

    Attributes:
        assembly: the systems of Exudyn.
        reference: coordinates ``(n, 7)`` of the nodes in the reference configuration: position in mm, unit
            quaternion.
        connected: nodes on which joints or springs act, increasing.
        leaders: ``(n,)`` for every node the one that leads its rigid piece, −1 on the ground.
        stations: in the order along the chain.
        pieces: where points and masses are.
        springs: of six directions, which stand beside Exudyn.
        constraints: of joints coupled under load and of rigid directions of such springs, likewise.
        tool: node of the end-effector, in the world's axes in the reference configuration.
        end_condition: node of the support of the end-effector; the same where nothing of its pose is free.
        end: frame ``(4, 4)`` of the end-effector in the reference configuration.
    """

    def _begin(self, mesh: Mesh) -> None:
        """An empty system, to be filled with bodies."""
        self.assembly = ExudynAssembly()
        self.mesh = mesh
        self._frames: list[Array] = []
        self._connected: set[int] = set()
        self._locked: list[tuple[int, int]] = []
        self.stations: list[ExudynStation] = []
        self.pieces: list[Piece] = []
        self.springs: list[MatrixSpring] = []
        self.constraints: list[LinearConstraint] = []
        self._own: dict[str, tuple[RelativeMotion, int]] = {}
        self._waiting: list[Callable[[], None]] = []
        self._open: Connect | None = None
        self._frame = np.eye(4)
        self._points: Mapping[str, tuple[float, ...]] = {}
        self._marked: Mapping[str, tuple[float, ...]] = {}
        self._sections: dict[tuple[str, float], Rigid] = {}
        self._ground = Rigid(-1, self.assembly.rigid(items.ObjectGround()), np.eye(4))
        self._rigid = self._ground

    def _finish(self, name: str, end_condition: Sequence[Joint]) -> None:
        """Hold what the last part ends on by the support, and assemble."""
        self._name, self.end = name, self._frame
        # an end-effector on a piece whose node lies elsewhere gets a node of its own, locked to it
        self.tool = self._at(frame(p=self._frame[:3, 3])).node
        self.end_condition = self._add_hand(end_condition) if end_condition else self.tool
        self.reference = np.array([np.concatenate([T[:3, 3], quaternion(T[:3, :3])]) for T in self._frames])
        self.connected = sorted(self._connected)
        self.leaders = leaders_of(len(self._frames), self._locked, {self.tool, self.end_condition})
        self.pieces = [replace(p, body=self._leader(p.body)) for p in self.pieces]
        self.assembly.close()

    # --- parts --------------------------------------------------------------------------------------------

    def _add(self, part: Part) -> None:
        match part:
            case RigidOffset():
                self._mark(part.name, 0.0)
                R, p = self._frame[:3, :3], self._frame[:3, 3]
                self._piece(part.name, p, R @ part.transform[:3, 3], part.mass, centre=p + R @ part.centre_of_mass)
                self._frame = self._frame @ part.transform
            case Joint(free=True):
                raise TypeError(f"joint '{part.name}' is passive: it is added with its coordinate")
            case Joint():
                self._frame = self._frame @ part.motion(part.held_at)
                self._follow(part)
                if is_coupled(part.matrix):
                    self._add_matrix(part.matrix)
                for spring in elementary_springs(part):
                    self._add_sprung(spring, part)
            case Beam() if self.mesh.foot_spring and part.name == FOOT:
                self._add_spring(part)
            case Beam():
                self._add_beam(part)
            case _:
                assert_never(part)

    def _add_beam(self, beam: Beam) -> None:
        grid = self.mesh.grid(self._points.get(beam.name, ()))
        section = beam.effective_section()
        root = self._frame @ beam.section_in_chain
        node = self._at(root).node
        self._sections[beam.name, 0.0] = self._rigid
        self._mark(beam.name, 0.0, root)
        self._node_piece(beam, 0, grid, root)
        for i, (start, stop) in enumerate(pairwise(grid.tolist()), start=1):
            h = (stop - start) * beam.length
            data = exu.BeamSection()
            data.stiffnessMatrix = self.mesh.section_stiffness(section, h, beam.name)
            T = root @ translation([stop * beam.length, 0.0, 0.0])
            following = self._node(T)
            self.assembly.beam(
                items.ObjectBeamGeometricallyExact(nodeNumbers=[node, following], length=h, sectionData=data)
            )
            node = following
            # where nothing but elements meet, a node carries no markers
            carries = stop == 1.0 or stop in self._marked.get(beam.name, ())
            self._rigid = self._carrier(node, T) if carries else Rigid(node, None, T)
            self._sections[beam.name, stop] = self._rigid
            self._mark(beam.name, stop, T)
            self._node_piece(beam, i, grid, T)
        self._frame = self._frame @ translation(beam.tip)
        if np.any(beam.end_offset):
            self._mark(beam.name, 1.0 + float(np.linalg.norm(beam.end_offset)) / beam.length)

    def _node_piece(self, beam: Beam, i: int, grid: Array, T: Array) -> None:
        """The node with its share of the beam's weight."""
        mass, offset = lumped_mass(beam, grid, i)
        centre = T[:3, 3] + offset * T[:3, 0]
        fraction = float(grid[i])
        self.pieces.append(
            Piece(beam.name, fraction, fraction, self._rigid.node, T[:3, 3], np.zeros(3), mass, centre)
        )

    def _add_spring(self, beam: Beam) -> None:
        self._mark(beam.name, 0.0)
        along = beam.length * (self._frame @ beam.section_in_chain)[:3, 0]
        self._piece(beam.name, self._frame[:3, 3], along, beam.mass)
        self._frame = self._frame @ translation(beam.tip)
        tip_frame = self._frame @ frame(beam.own_frame)
        before = self._marker(self._at(), tip_frame)
        compliance = beam.tip_compliance()
        if not np.diag(compliance).all():
            raise ValueError(
                f"part '{beam.name}' is rigid in a direction, which exudyn's spring cannot be: take vjm for it"
            )
        stiffness = np.linalg.inv(compliance)

        def connect(behind: Item) -> None:
            spring = items.RigidBodySpringDamper(
                markerNumbers=[before, behind], stiffness=stiffness, useIntrinsicFormulation=True
            )
            self.assembly.rigid(spring)

        self._leave_open(tip_frame, connect)
        self._piece(beam.name, self._frame[:3, 3], np.zeros(3), start=1.0)
        self._mark(beam.name, 1.0)

    def _add_sprung(self, spring: ElementarySpring, part: Joint) -> None:
        column = 0 if spring.slides else 2
        joint_frame = self._frame @ frame(axes_with(spring.axis, column))
        rigid = self._at()
        before = self._marker(rigid, joint_frame)

        def connect(behind: Item) -> None:
            if spring.axis is part.axis:
                self._own[part.name] = (
                    RelativeMotion(*between(rigid, self._rigid, joint_frame)),
                    0 if spring.slides else 5,
                )
            self._joint(before, behind, PRISMATIC if spring.slides else REVOLUTE)
            self.assembly.rigid(_spring_item(spring, [before, behind], column if spring.slides else 3 + column))

        self._leave_open(joint_frame, connect)

    def _follow(self, joint: Joint) -> None:
        """Move by what the springs of others add about or along their own axes."""
        if not joint.passes_on:
            return
        rigid = self._at()
        others = [(*self._own[name], ratio) for name, ratio in joint.passes_on if name in self._own]
        if not others:
            return
        joint_frame = self._frame @ frame(axes_with(joint.axis, 0 if joint.slides else 2))
        before = self._marker(rigid, joint_frame)

        def connect(behind: Item) -> None:
            self._joint(before, behind, PRISMATIC if joint.slides else REVOLUTE)
            own = RelativeMotion(*between(rigid, self._rigid, joint_frame)), 0 if joint.slides else 5, -1.0
            self.constraints.append(LinearConstraint((own, *others)))

        self._leave_open(joint_frame, connect)

    def _add_matrix(self, compliance: Array) -> None:
        """A spring of six directions in the axes of the chain frame."""
        before, spring_frame = self._at(), self._frame

        def connect(_: Item) -> None:
            spring, rigid = held_by(*between(before, self._rigid, spring_frame), compliance)
            self.springs.append(spring)
            self.constraints += rigid

        self._leave_open(spring_frame, connect)

    def _add_joint(self, joint: Joint, value: float) -> None:
        axes = frame(axes_with(joint.axis, 0 if joint.slides else 2))
        before = self._marker(self._at(), self._frame @ axes)
        move = joint.motion(value)
        behind = self._frame @ move @ axes
        self._frame = self._frame @ move
        kind = PRISMATIC if joint.slides else REVOLUTE
        self._leave_open(behind, lambda marker: self._joint(before, marker, kind))

    def _add_universal(self, first: Joint, angle: float, second: Joint, angle2: float) -> None:
        # the first axis stays in the piece before as its marker's y, the second in the piece behind as z
        axes = frame(np.column_stack([np.cross(first.axis, second.axis), first.axis, second.axis]))
        before = self._marker(self._at(), self._frame @ axes)
        self._frame = self._frame @ turn(first.axis, angle) @ turn(second.axis, angle2)
        self._leave_open(self._frame @ axes, lambda behind: self._joint(before, behind, UNIVERSAL))

    def _add_hand(self, joints: Sequence[Joint]) -> int:
        """The support's node, and one joint to the end-effector that leaves free what the support's joints do."""
        tool_frame = frame(p=self._frame[:3, 3])
        R, constrained = joint_axes(joints)
        tool = self._marker(self._at(tool_frame), tool_frame @ frame(R))
        end_condition = self._carrier(self._node(tool_frame), tool_frame)
        if any(constrained):
            # the first marker's axes are those of the slides
            self._joint(self._marker(end_condition, tool_frame @ frame(R)), tool, constrained)
        return end_condition.node

    # --- rigid pieces -------------------------------------------------------------------------------------

    def _leave_open(self, T: Array, connect: Connect) -> None:
        """A joint ends at the frame ``T``; the next part makes the piece behind it, its node where it likes."""
        self._open_at = T
        self._open = connect

    def _at(self, T: Array | None = None) -> Rigid:
        """The rigid piece at the present place; where ``T`` is given, one whose node lies there."""
        if self._open is not None:
            connect, self._open = self._open, None
            T = self._open_at if T is None else T
            self._rigid = self._carrier(self._node(T), T)
            connect(self._marker(self._rigid, self._open_at))
            waiting, self._waiting = self._waiting, []
            for place in waiting:
                place()
        elif T is not None and (self._rigid.node < 0 or not np.allclose(T, self._rigid.reference, atol=1e-12)):
            before = self._rigid.node
            self._rigid = self._carrier(self._node(T), T)
            self._locked.append((before, self._rigid.node))
        return self._rigid

    def _leader(self, node: int) -> int | None:
        """Leader of a node's rigid piece; None on the ground."""
        leader = self.leaders[node] if node >= 0 else -1
        return leader if leader >= 0 else None

    def _node(self, T: Array) -> int:
        self.assembly.node(
            items.NodeRigidBodyEP(
                referenceCoordinates=[*T[:3, 3], *quaternion(T[:3, :3])],
                # unit quaternions are kept by the solver, which turns them by rotation vectors
                addConstraintEquation=False,
            )
        )
        self._frames.append(T)
        return len(self._frames) - 1

    def _carrier(self, node: int, T: Array) -> Rigid:
        # statics: the mass means nothing, but Exudyn wants one
        item = self.assembly.rigid(items.ObjectRigidBody(mass=1.0, inertia=[1, 1, 1, 0, 0, 0], nodeNumber=node))
        return Rigid(node, item, T)

    def _marker(self, rigid: Rigid, T: Array) -> Item:
        """A marker on a rigid piece, at the world frame ``T`` in the reference configuration."""
        local = inverse_frame(rigid.reference) @ T
        if rigid.node >= 0:
            self._connected.add(rigid.node)
        return self.assembly.marker(
            items.MarkerBodyRigid(
                bodyNumber=rigid.item, localHT=exu.HT(rotation=local[:3, :3], translation=local[:3, 3])
            )
        )

    def _joint(self, before: Item, behind: Item, constrained: tuple[int, ...]) -> None:
        self.assembly.rigid(items.GenericJoint(markerNumbers=[before, behind], constrainedAxes=list(constrained)))

    # --- points -------------------------------------------------------------------------------------------

    def find(self, part: str, fraction: float) -> Place:
        """The point of a part at a fraction of its elastic length; of the end-effector where it has no name.

        Raises:
            ValueError: the part has no such point.
        """
        if not part:
            return Place(self._leader(self.tool), self.end[:3, 3])
        return find(self._name, self.pieces, part, fraction)

    def _mark(self, part: str, fraction: float, T: Array | None = None) -> None:
        label = StationLabel(part, fraction)
        position = (self._frame if T is None else T)[:3, 3]

        def place() -> None:
            R, p = self._rigid.reference[:3, :3], self._rigid.reference[:3, 3]
            self.stations.append(ExudynStation(label, self._rigid.node, R.T @ (position - p)))

        self._when_closed(place)

    def _piece(
        self,
        part: str,
        root: Array,
        along: Array,
        mass: float = 0.0,
        start: float = 0.0,
        centre: Array | None = None,
    ) -> None:
        def place() -> None:
            mass_centre = root + 0.5 * along if centre is None else centre
            self.pieces.append(Piece(part, start, 1.0, self._rigid.node, root, along, mass, mass_centre))

        self._when_closed(place)

    def _when_closed(self, place: Callable[[], None]) -> None:
        """Do it at once, or where a joint is open as soon as the piece behind it is there."""
        if self._open is not None:
            self._waiting.append(place)
        else:
            place()


def _spring_item(spring: ElementarySpring, markers: list[Item], where: int) -> Description:
    """Exudyn's spring between two markers in one of six directions; with a law it has a function of the user."""
    if spring.law is None:
        stiffness, offset = np.zeros(6), np.zeros(6)
        stiffness[where], offset[where] = 1.0 / spring.compliance, spring.stretch
        return items.RigidBodySpringDamper(
            markerNumbers=markers, stiffness=np.diag(stiffness), offset=offset.tolist()
        )
    law, stretch = spring.law, spring.stretch

    def force(_mbs: object, _time: float, _item: int, deflection: float, *_: float) -> float:
        return float(law.force(deflection - stretch))

    if spring.slides:
        return items.LinearSpringDamper(markerNumbers=markers, springForceUserFunction=force)
    return items.TorsionalSpringDamper(markerNumbers=markers, springTorqueUserFunction=force)
