"""A chain in a posture as bodies, linkages and rows of beam elements.

Bodies are the beams' nodes and the support of the end-effector, each with six motions. The nodes at which a
rigid piece or a joint begins or ends are no bodies of their own: a linkage carries them. The last beam's tip hangs
on the support, over the joints of what is free of the end-effector's pose, so that an imposed pose is one body
held, and no constraint is left that would need a multiplier.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np

from vjm.continuation.path import StationLabel
from vjm.model.chain import Chain
from vjm.model.joints import ActuatedJoint, CoupledJoint, SprungJoint, elementary_springs
from vjm.model.parts import Actuator, Beam, Mount, PassiveJoint, RigidOffset
from vjm.rotations import Array, translation, turn
from vjm_fea.common.mesh import grid, lumped_mass
from vjm_fea.common.points import NO_POINTS, Piece, Place, find
from vjm_fea.opensees.beams import Line
from vjm_fea.opensees.linkage import Joint, Linkage


@dataclass(frozen=True)
class Station:
    """A material point of which the shape is made.

    Attributes:
        label: of its row.
        position: in the reference configuration ``(3,)``, mm.
        node: on which it is; None where it is on a linkage.
        linkage: number of the linkage on which it is, and of that one's rigid piece from the base's side.
    """

    label: StationLabel
    position: Array
    node: int | None = None
    linkage: tuple[int, int] = (0, 0)


class ChainSystem:
    """Where everything is in the reference configuration: the given posture, unloaded and free of stress.

    Attributes:
        lines: rows of beam elements, from base to tool.
        nodes: reference positions ``(n, 3)`` of their nodes, mm.
        carriers: node of every body but the last, which is the support.
        linkages: from base to tool; the last leads from the support back over the end-effector to the last beam's
            tip.
        stiffness: of the joints' coordinates ``(k,)``, N/mm; zero for passive ones.
        slides: which of the joints' coordinates ``(k,)`` are shifts.
        stations: in the order along the chain.
        pieces: where points and masses are; on a node by its number, else on a linkage by its number and that of
            its rigid piece.
        end: frame ``(4, 4)`` of the end-effector.
    """

    def __init__(
        self,
        chain: Chain,
        q: Array,
        elements: int,
        points: Mapping[str, tuple[float, ...]] = NO_POINTS,
        end_condition: Sequence[PassiveJoint] = (),
    ) -> None:
        """Set out a chain.

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
        self._frame = chain.base
        self._stiffness: list[float] = []
        self._slides: list[bool] = []
        self._open: list[Joint] = []
        """Joints behind the last beam."""
        self._start: tuple[int | None, Array] = (None, chain.base[:3, 3])
        """Body from which they lead on, and its reference position."""
        self._count = 0
        self.lines: list[Line] = []
        self.carriers: list[int] = []
        self.linkages: list[Linkage] = []
        self.stations: list[Station] = []
        angles = iter(np.asarray(q, dtype=float))
        for part in chain.parts:
            match part:
                case RigidOffset():
                    self._mark(part.name, 0.0)
                    self._add_piece(part)
                    self._frame = self._frame @ part.transform
                case Actuator() | Mount():
                    if part.compliance > 0.0:
                        slides = isinstance(part, Actuator) or part.slides
                        self._add_joint(part.axis, slides=slides, stiffness=1.0 / part.compliance)
                case ActuatedJoint() | SprungJoint() | CoupledJoint():
                    self._frame = self._frame @ part.motion(part.held_at)
                    for spring in elementary_springs(part, "opensees"):
                        if spring.stretch:
                            raise ValueError(f"joint '{part.name}': opensees does not know preloads")
                        self._add_joint(spring.axis, slides=spring.slides, stiffness=1.0 / spring.compliance)
                case PassiveJoint():
                    angle = next(angles)
                    self._add_joint(part.axis, slides=part.slides)
                    move = translation(part.axis * angle) if part.slides else turn(part.axis, angle)
                    self._frame = self._frame @ move
                case Beam():
                    self._add_beam(part)
                case _:
                    assert_never(part)
        for joint in end_condition:
            # along the world's axes, through the end-effector's reference point
            self._add_joint(self._frame[:3, :3].T @ joint.axis, slides=joint.slides)
        self._hang_on_end_condition()
        self._tool_piece = len(end_condition)
        self.nodes = np.vstack([line.positions for line in self.lines])
        self.stiffness = np.array(self._stiffness)
        self.slides = np.array(self._slides, dtype=bool)
        self.end = self._frame

    @property
    def end_condition(self) -> int:
        """Number of the support's body, which is the end-effector's where nothing of its pose is free."""
        return len(self.carriers)

    def _add_joint(self, axis: Array, *, slides: bool, stiffness: float = 0.0) -> None:
        position, world = self._frame[:3, 3], self._frame[:3, :3] @ axis
        self._open.append(Joint(len(self._stiffness), position, world, slides))
        self._stiffness.append(stiffness)
        self._slides.append(slides)

    def _add_beam(self, beam: Beam) -> None:
        beam.refuse_bow("opensees")
        section = beam.effective_section()
        root = self._frame @ beam.section_in_chain
        fractions = grid(self._elements, self._points.get(beam.name, ()))
        positions = root[:3, 3] + np.outer(fractions * beam.length, root[:3, 0])
        self.lines.append(Line(positions, root[:3, 2], section))
        body, near_position = self._start
        first = self._count
        self.linkages.append(Linkage(body, near_position, first, positions[0], tuple(self._open)))
        self._open = []
        self.carriers += range(first + 1, first + len(positions))
        self._count += len(positions)
        for i, fraction in enumerate(fractions.tolist()):
            self.stations.append(Station(StationLabel(beam.name, fraction), positions[i], node=first + i))
            mass, offset = lumped_mass(beam, fractions, i)
            centre = positions[i] + offset * root[:3, 0]
            self.pieces.append(
                Piece(beam.name, fraction, fraction, first + i, positions[i], np.zeros(3), mass, centre)
            )
        self._start = (len(self.carriers) - 1, positions[-1])
        self._frame = self._frame @ translation(beam.tip)
        if np.any(beam.end_offset):
            self._mark(beam.name, 1.0 + float(np.linalg.norm(beam.end_offset)) / beam.length)

    def _hang_on_end_condition(self) -> None:
        """Let the support carry the last beam's tip: its linkage, and the coordinates, turned round."""
        position = self._frame[:3, 3]
        joints = tuple(replace(joint, axis=-joint.axis) for joint in reversed(self._open))
        tip = self.carriers.pop()
        self.linkages.append(Linkage(self.end_condition, position, tip, self._start[1], joints))
        last, count = len(self.linkages) - 1, len(joints)
        self.stations = [
            replace(s, linkage=(last, count - s.linkage[1])) if s.node is None and s.linkage[0] == last else s
            for s in self.stations
        ]
        self.pieces = [
            replace(p, body=(last, count - p.body[1])) if isinstance(p.body, tuple) and p.body[0] == last else p
            for p in self.pieces
        ]

    def _add_piece(self, offset: RigidOffset) -> None:
        body = (len(self.linkages), len(self._open))
        root, along = self._frame[:3, 3], self._frame[:3, :3] @ offset.transform[:3, 3]
        on_ground = self._start[0] is None and not self._open
        centre = root + self._frame[:3, :3] @ offset.centre_of_mass
        self.pieces.append(
            Piece(offset.name, 0.0, 1.0, None if on_ground else body, root, along, offset.mass, centre)
        )

    def find(self, part: str, at: float) -> Place:
        """The point of a part at a fraction of its elastic length; of the end-effector where it has no name.

        Raises:
            ValueError: the part has no such point.
        """
        if not part:
            return Place((len(self.linkages) - 1, self._tool_piece), self.end[:3, 3])
        return find(self._chain.name, self.pieces, part, at)

    def _mark(self, part: str, fraction: float) -> None:
        at = (len(self.linkages), len(self._open))
        self.stations.append(Station(StationLabel(part, fraction), self._frame[:3, 3], linkage=at))
