"""How a machine becomes one-degree joints between rigid links.

A six-dimensional spring is six joints in the order of (22), Tx Ty Tz Rx Ry Rz. Symmetric about its middle it
is nine: Rx Ry Rz Tx Ty Tz Rz Ry Rx, where each turn is half of the spring's coordinate. So a coordinate drives one
joint or two, with a factor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import assert_never

import numpy as np

from vjm.kernels.arrays import GROWS
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, JointKind, Part, Placement, RigidOffset
from vjm.model.springs import BeamColumnSpring, LawSpring, LinearSpring, Spring
from vjm.rotations import AXES, Array, frame, inverse_frame, rotation_from_vector, translation

NEAR = 1e-9
"""Difference of two fractions of a beam that are one."""


@dataclass(frozen=True)
class BodyFrame:
    """A frame on a body: behind a joint (−1: the base), ``(4, 4)`` mm from there."""

    joint: int
    frame: Array


@dataclass(frozen=True)
class Stretch:
    """A straight stretch of a part on one rigid body.

    Attributes:
        start: fraction of the part's elastic length at which it begins.
        stop: and ends.
        joint: before it.
        frame: ``(4, 4)`` behind that joint, where it begins.
        drawn: the same in the frame where the part begins, as drawn.
    """

    start: float
    stop: float
    joint: int
    frame: Array
    drawn: Array

    @property
    def site(self) -> BodyFrame:
        """The frame where the part begins, carried along by this body."""
        return BodyFrame(self.joint, self.frame @ inverse_frame(self.drawn))


@dataclass(frozen=True)
class Marker:
    """A point of the machine that moves with the rigid link behind a joint.

    Attributes:
        part: name of the part that the point belongs to.
        fraction: where along the part's elastic length, 0 at the root; above 1 on its end offset.
        joint: index of the last joint before the point, −1 for the base.
        position: ``(3,)`` mm in the frame behind that joint.
    """

    part: str
    fraction: float
    joint: int
    position: Array


@dataclass(frozen=True)
class LinkSegment:
    """A straight stretch of a part on one rigid body, where points can be found by part and fraction.

    Attributes:
        part: name of the part.
        start: fraction of the part's elastic length at which it begins.
        stop: and ends.
        joint: index of the last joint before it, −1 for the base.
        root: ``(3,)`` mm where it begins, in the frame behind that joint.
        along: ``(3,)`` mm per unit of the fraction.
        mass: kg.
        centre: fraction at which its weight acts.
        weight_at: position ``(3,)`` mm at which it acts, where that is off the stretch.
        grows: joint of a beam that grows; the mass is then that of 1 mm, see `vjm.kernels.arrays`.
    """

    part: str
    start: float
    stop: float
    joint: int
    root: Array
    along: Array
    mass: float = 0.0
    centre: float = 0.5
    weight_at: Array | None = None
    grows: int = -1

    @property
    def centre_of_mass(self) -> Array:
        """Where its weight acts ``(3,)``, mm, in the frame behind the joint."""
        return self.at(self.centre) if self.weight_at is None else self.weight_at

    def at(self, fraction: float) -> Array:
        """Position ``(3,)`` mm of a fraction of the part, in the frame behind the joint."""
        return self.root + (fraction - self.start) * self.along


@dataclass(frozen=True)
class GrowingPiece:
    """A piece of a beam whose length a joint's coordinate gives: ``share`` of it, and a ``constant`` in mm.

    Attributes:
        joint: its name.
        share: of the coordinate.
        constant: mm.
        rides: whether the joint rides on the beam; else it pushes the beam out and bears what its end does.
    """

    joint: str
    share: float = 1.0
    constant: float = 0.0
    rides: bool = False


def growing_pieces(chain: Machine, *, rigid: bool) -> dict[str, list[GrowingPiece]]:
    """The pieces of beams whose lengths a posture gives, by the beams' names, where the machine is in none.

    Args:
        chain: the machine.
        rigid: whether nothing deflects: a beam on which a joint rides is one piece then.
    """
    pieces = {beam.name: [GrowingPiece(beam.free_length)] for beam in chain.beams if beam.free_length}
    riders, cuts = chain.riders, chain.cuts
    for beam in () if rigid else chain.beams:
        if beam.name in riders and beam.name not in cuts:
            x = riders[beam.name].name
            pieces[beam.name] = [GrowingPiece(x, rides=True), GrowingPiece(x, -1.0, beam.length, rides=True)]
    return pieces


GROWING_SEGMENTS = 4
"""Of a beam that grows out of its root, where its model file asks for no other number."""
DEFINITE = 1e-12
"""Smallest eigenvalue of a compliance scaled to a unit diagonal; less is rounding."""
NOWHERE = np.eye(4)
"""The transform between joints that meet in a point; shared, never written to."""
SYMMETRIC = (3, 4, 5, 0, 1, 2, 5, 4, 3)
"""Coordinates of a beam's spring in the order of its joints: shifts between the two halves of its turns."""


class Assembly:
    """The joints and bodies of a machine, parents before children, as lists.

    Joints stand at values that are given later, see `commands`; a passive one deflects from where it stands.

    Attributes:
        chain: the machine.
        rotary: whether each joint turns.
        axis: of each joint, in its own frame.
        before: rigid transform ``(4, 4)`` before each joint.
        coordinate: which coordinate drives it, −1 where none does.
        factor: and how much of it.
        held: name of the part that gives a joint its value, by the joint's index.
        share: of that value that the joint stands at, where it is not the whole.
        constant: what is added to that, mm.
        bears: share of a joint's force that the part's drive bears, where it is not that of the value.
        growing: pieces of the beams whose lengths are given with the values, by the beams' names.
        grows: joint that gives a beam-column spring its length, by the spring's first coordinate.
        rests: coordinates of sprung joints with a rest position of their own: the part's name and that position.
        parent: joint before each joint, −1 for the base.
        roots: where each part begins, by name.
        begins: the same, but joints behind what moves and deflects in them.
        lengths: of the segments of each beam that is split, mm, by its name.
        ends: where each part ends.
        rigid: transform behind the last joint.
        size: number of coordinates.
        passive: indices of the passive joints' coordinates.
        elastic: indices of the virtual springs' coordinates.
        springs: the springs' laws.
        natural: coordinates at which springs are free of stress.
        spans: each part's own coordinates, by name.
        stations: points that show the chain's shape.
        pieces: straight stretches of the rigid bodies.
    """

    def __init__(self, chain: Machine, *, rigid: bool = False) -> None:
        """Walk a machine from its base.

        Args:
            chain: the machine.
            rigid: whether nothing deflects.

        Raises:
            ValueError: a spring is none, or a part or joint that one names does not stand before it.
        """
        self.chain, self._rigid, self._pushing = chain, rigid, chain.pushing
        self.held: dict[int, str] = {}
        self.share: dict[int, float] = {}
        self.constant: dict[int, float] = {}
        self.bears: dict[int, float] = {}
        self.grows: dict[int, int] = {}
        self._cuts, self._nodes = chain.cuts, dict[str, BodyFrame]()
        self.growing = growing_pieces(chain, rigid=rigid)
        self.rests: dict[int, tuple[str, float]] = {}
        self._beams = {beam.name: beam for beam in chain.beams}
        self._stretches: dict[str, list[Stretch]] = {}
        self._drawn = np.eye(4)
        self.parent: list[int] = []
        self.roots: dict[str, BodyFrame] = {}
        self.lengths: dict[str, list[float]] = {}
        self.begins: dict[str, BodyFrame] = {"": BodyFrame(-1, np.eye(4))}
        self.ends: dict[str, BodyFrame] = {"": BodyFrame(-1, chain.base)}
        self._last, self._open = -1, ""
        self.rotary: list[bool] = []
        self.axis: list[Array] = []
        self.before: list[Array] = []
        self.coordinate: list[int] = []
        self.factor: list[float] = []
        self.rigid = chain.base.copy()
        self.size = 0
        self.passive: list[int] = []
        self.elastic: list[int] = []
        self.springs: list[Spring] = []
        self.natural: dict[int, float] = {}
        self.spans: dict[str, range] = {}
        self._own: dict[str, int | None] = {}
        self.stations: list[Marker] = []
        self.pieces: list[LinkSegment] = []
        for part in chain.parts:
            site = self.ends[chain.after.get(part.name, self._open)]
            if isinstance(part, Joint) and part.rides_on and not rigid:
                site = self._on_beam(part)
            self._last, self.rigid = site.joint, site.frame
            self._open, self._drawn = part.name, np.eye(4)
            self.roots[part.name] = self.begins[part.name] = site
            first = self.size
            self._add(part)
            self.spans[part.name] = range(first, self.size)
            (self.passive if isinstance(part, Joint) and part.free else self.elastic).extend(self.spans[part.name])
            self.ends[part.name] = BodyFrame(self._last, self.rigid)

    def carrying(self, part: str, point: Array) -> BodyFrame:
        """The frame where a part begins, as the body carries it on which a point of the part lies.

        A beam carries a point with the cross-section at which it lies, see `PointSpring`.

        Args:
            part: its name; empty for the base.
            point: ``(3,)`` mm, in the frame where the part begins as drawn.

        Raises:
            ValueError: the beam has no shape there.
        """
        beam = self._beams.get(part)
        if beam is None:
            return self.begins[part]
        fraction = float(np.clip(beam.section_in_chain[:3, 0] @ point / beam.length, 0.0, 1.0))
        if beam.segments is None and NEAR < fraction < 1.0 - NEAR:
            raise ValueError(
                f"it is fixed at {fraction:.3g} of the length of part '{part}', which is one spring here without "
                f"a shape between its ends. Take an engine that splits it, such as vjm-8"
            )
        # of two bodies that meet in a cross-section the further one, as for loads
        for stretch in reversed(self._stretches[part]):
            if stretch.start - NEAR <= fraction <= stretch.stop + NEAR:
                return stretch.site
        raise AssertionError(f"no body carries {fraction} of the beam '{part}'")

    def _on_beam(self, joint: Joint) -> BodyFrame:
        """The frame where a beam begins, as the cross-section carries it on which a joint rides.

        Where the joint has no value yet it is the cross-section's own, at which two pieces of the beam meet.
        """
        beam = self._beams[joint.rides_on]
        if beam.name in self._nodes:
            return self._nodes[beam.name]
        try:
            return self.carrying(beam.name, self._cuts[beam.name] * beam.length * joint.axis)
        except ValueError as error:
            raise ValueError(f"joint '{joint.name}' rides on a beam: {error}") from error

    def _add(self, part: Part) -> None:
        match part:
            case RigidOffset():
                self._mark(part.name, 0.0)
                self._piece(part.name, 0.0, 1.0, part.transform[:3, 3], part.mass, centre=part.centre)
                self._move(part.transform)
            case Joint(free=True):
                self._add_passive(part)
            case Joint(fixed=True):
                self._add_springs(part)
            case Joint():
                self._hold(part)
                self._add_springs(part)
                self._piece(part.name, 1.0, 1.0, np.zeros(3))
                self.begins[part.name] = BodyFrame(self._last, self.rigid)
            case Beam():
                self._add_beam(part)
            case _:
                assert_never(part)

    def _add_passive(self, joint: Joint) -> None:
        self._stand(joint.name, joint.axis, rotary=not joint.slides)
        self._own[joint.name] = self.size
        if not self._rigid:
            self._deflect_there()
        self.begins[joint.name] = BodyFrame(self._last, self.rigid)

    def _hold(self, joint: Joint) -> None:
        """Stand at the joint's coordinate; of what rides on a beam the points begin there."""
        if joint.rides_on:
            self._stand(joint.name, joint.axis, rotary=False)
            if joint.rides_on in self._nodes:
                self.share[self._last], self.bears[self._last] = 0.0, 1.0
        self._mark(joint.name, 0.0)
        self._piece(joint.name, 0.0, 0.0, np.zeros(3))
        if not joint.rides_on and joint.name not in self._pushing:
            self._stand(joint.name, joint.axis, rotary=not joint.slides)

    def _stand(self, name: str, axis: Array, *, rotary: bool) -> None:
        """A joint that stands at the value of a part."""
        self._joint(axis, -1, 0.0, rotary=rotary)
        self.held[self._last] = name

    def _add_springs(self, joint: Joint) -> None:
        """What deflects in a joint: across its axis first, as (22) has it, then about or along it."""
        if self._rigid:
            return
        self._own[joint.name] = None
        self._pass_on(joint)
        if joint.matrix is not None:
            self._spring_of_22(joint.matrix, joint.name)
        for axis, compliance in joint.bearings:
            self._coordinate_joint(axis, rotary=True)
            self.springs.append(LinearSpring(np.array([[compliance]])))
        if joint.sprung:
            self._own_spring(joint)
            self._stress(joint)

    def _own_spring(self, joint: Joint) -> None:
        self._own[joint.name] = self.size
        if self._last >= 0 and self.held.get(self._last) == joint.name:
            self._deflect_there()
        else:
            self._coordinate_joint(joint.axis, rotary=not joint.slides)
        law = joint.law
        self.springs.append(LinearSpring(np.array([[joint.compliance]])) if law is None else LawSpring(law))

    def _deflect_there(self) -> None:
        """A coordinate in the last joint: nothing lies between the value that it stands at and what deflects."""
        self.coordinate[self._last], self.factor[self._last] = self.size, 1.0
        self.size += 1

    def _stress(self, joint: Joint) -> None:
        """Say where the last coordinate's spring is free of stress."""
        if joint.rest is not None:
            self.rests[self.size - 1] = (joint.name, joint.rest)
        elif joint.kind is JointKind.SPRUNG:
            self.natural[self.size - 1] = joint.stretch

    def _pass_on(self, joint: Joint) -> None:
        """Move a coupled joint by what the springs of the others add about their own axes."""
        for name, ratio in joint.passes_on:
            if name not in self._own:
                raise ValueError(
                    f"joint '{joint.name}' is coupled to '{name}', which must be a held joint before it"
                )
            coordinate = self._own[name]
            if coordinate is not None:
                self._joint(joint.axis, coordinate, ratio, rotary=not joint.slides)

    def _add_beam(self, beam: Beam) -> None:
        own = frame(beam.own_frame)
        if beam.name in self.growing:
            self._add_growing(beam)
            return
        if self._rigid:
            self._move(translation(beam.tip))
            return
        if (beam.segments is None or beam.segments < 2) and any(beam.bow):
            raise ValueError(
                f"part '{beam.name}' has a bow, which one spring, which has no shape, does not know: take vjm with "
                "2 springs or more"
            )
        if beam.segments is None:
            self._mark(beam.name, 0.0)
            along = beam.section_in_chain[:3, 0] * beam.length
            self._piece(beam.name, 0.0, 1.0, along, beam.mass, centre=beam.centre_of_mass)
            self._move(translation(beam.tip) @ own)
            self._spring_of_22(beam.tip_compliance(), beam.name)
            self._piece(beam.name, 1.0, 1.0, np.zeros(3))
            self._mark(beam.name, 1.0)
            self._move(own.T)
            return
        self._move(beam.section_in_chain)
        self._mark(beam.name, 0.0)
        slope = beam.end_slope
        self._turn(slope)
        # what rides on it stands between two pieces, each of them split
        cut, self.lengths[beam.name] = self._cuts.get(beam.name, 0.0), []
        for start, stop in pairwise((0.0, cut, 1.0) if 0.0 < cut < 1.0 else (0.0, 1.0)):
            self._add_segments(beam, beam.segments, start, stop - start)
        self._turn(slope)
        self._move(frame(beam.section_frame.T) @ translation(beam.end_offset))
        if np.any(beam.end_offset):
            self._mark(beam.name, 1.0 + float(np.linalg.norm(beam.end_offset)) / beam.length)
        self._move(own.T)

    def _add_segments(self, beam: Beam, n: int, start: float, width: float) -> None:
        """A piece of a beam, of a fraction ``width`` of its length, as ``n`` segments."""
        fraction, h = beam.placement.fraction, width * beam.length / n
        section, slope, along = beam.effective_section(), beam.end_slope, np.array([beam.length, 0.0, 0.0])
        # a spring in the middle turns as the segment under its own weight does where the halves' weights act at a
        # third of their length from its ends: q h/2 · h/3 = q h²/6, the moment's mean
        lever = 1.0 / 3.0 if fraction == 0.5 else 0.5
        law, mass = BeamColumnSpring(section, h), width * beam.mass
        to_spring, to_end = translation([fraction * h, 0.0, 0.0]), translation([(1.0 - fraction) * h, 0.0, 0.0])
        for i in range(n):
            near, middle, far = (start + width * k / n for k in (i, i + fraction, i + 1))
            self._piece(beam.name, near, middle, along, mass * fraction / n, lever)
            self._move(to_spring)
            # what the slope changes by over the segment, half of it on either side of the spring
            kink = 0.5 * slope * (np.cos(np.pi * far) - np.cos(np.pi * near))
            self._turn(kink)
            if beam.placement is Placement.BEST:
                self._symmetric_spring(law)
            else:
                self._spring_of_22(section.compliance(h, fraction), beam.name)
            self._turn(kink)
            self._piece(beam.name, middle, far, along, mass * (1.0 - fraction) / n, 1.0 - lever)
            self._move(to_end)
            self._mark(beam.name, far)
            self.lengths[beam.name].append(h)

    def _add_growing(self, beam: Beam) -> None:
        """A beam that is pushed out of its root, or carries a joint: joints stand at shares of its pieces."""
        self._move(beam.section_in_chain)
        self._mark(beam.name, 0.0)
        self._piece(beam.name, 0.0, 0.0, np.zeros(3))
        for piece in self.growing[beam.name]:
            if self._rigid:
                self._slide(beam, piece, 1.0)
            else:
                self._grow(beam, piece)
            self._nodes.setdefault(beam.name, BodyFrame(self._last, self.rigid @ beam.section_in_chain.T))
        self._piece(beam.name, 1.0, 1.0, np.zeros(3))
        self._mark(beam.name, 1.0)
        self._move(frame(beam.section_frame.T) @ translation(beam.end_offset))
        self._move(frame(beam.own_frame.T))

    def _grow(self, beam: Beam, piece: GrowingPiece) -> None:
        n, section = beam.own_segments or GROWING_SEGMENTS, beam.effective_section()
        for _ in range(n):
            # the halves' weights act at a third of their length from the segment's ends, as in a beam that
            # stays: the first joint's value is a third of a half, the third one's that of the whole
            self._slide(beam, piece, (0.5 - 1.0 / GROWS) / n, section.mass)
            self._slide(beam, piece, 1.0 / GROWS / n)
            self.grows[self.size] = self._last
            self._symmetric_spring(BeamColumnSpring(section, 1.0))
            self._slide(beam, piece, 1.0 / GROWS / n, 0.5 * section.mass)
            self._slide(beam, piece, (0.5 - 1.0 / GROWS) / n)

    def _slide(self, beam: Beam, piece: GrowingPiece, share: float, mass: float = 0.0) -> None:
        self._stand(piece.joint, np.array([1.0, 0.0, 0.0]), rotary=False)
        self.share[self._last], self.constant[self._last] = piece.share * share, piece.constant * share
        if piece.rides:
            self.bears[self._last] = 0.0
        if mass:
            self._weigh(beam.name, mass)

    def _weigh(self, part: str, mass: float) -> None:
        """A weight, kg for each mm of which the last joint's value is a third; no fraction finds it."""
        nowhere, origin = float("nan"), np.zeros(3)
        piece = LinkSegment(
            part, nowhere, nowhere, self._last, origin, origin, mass, weight_at=origin, grows=self._last
        )
        self.pieces.append(piece)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints whose coordinates the data give, in the order of the parts; coupled ones follow."""
        return tuple(joint.name for joint in self.chain.moving if joint.coupling is None)

    def posture(self, label: str) -> Array:
        """Coordinates of `joints` in a posture; the held joints of a machine that is in one stay, see `Machine.at`.

        Raises:
            KeyError: no such posture.
            ValueError: it leaves a joint out.
        """
        values = dict(zip((joint.name for joint in self.chain.joints), self.chain.posture(label), strict=True))
        values |= self.chain.held.get(label, {})
        values |= {joint.name: joint.value for joint in self.chain.held_joints if joint.value is not None}
        return self.coordinates(values)

    def coordinates(self, values: Mapping[str, float]) -> Array:
        """Coordinates of `joints` from values by name, mm or rad; values of other names are not read.

        Raises:
            ValueError: one is missing.
        """
        missing = next((name for name in self.joints if name not in values), None)
        if missing is not None:
            raise ValueError(f"{self.chain.name}: no coordinate for joint '{missing}'")
        return np.array([values[name] for name in self.joints], dtype=float)

    @property
    def stands(self) -> Array:
        """Coordinates of `joints` where the machine's held ones stand; passive ones stand at zero.

        Raises:
            ValueError: the machine is in no posture, see `Machine.at`.
        """
        own = [joint for joint in self.chain.moving if joint.coupling is None]
        return np.array([0.0 if joint.free else joint.held_at for joint in own])

    def values(self, q: Array) -> Array:
        """Values ``(g, m)`` of all one-degree joints that stand at rows of coordinates ``(g, n)`` of `joints`."""
        share, offset = self.commands
        return np.ascontiguousarray(q @ share.T + offset)

    @cached_property
    def commands(self) -> tuple[Array, Array]:
        """C ``(m, n)`` and c ``(m,)`` by which the joints' values are ``C q + c``, see `coordinates`."""
        names = self.joints
        rows: dict[str, tuple[Array, float]] = {name: (np.eye(len(names))[i], 0.0) for i, name in enumerate(names)}
        for joint in self.chain.moving:
            if (coupling := joint.coupling) is not None:
                row = coupling.summed({name: share for name, (share, _) in rows.items()})
                rows[joint.name] = row, coupling.value({name: offset for name, (_, offset) in rows.items()})
        C, c = np.zeros((len(self.parent), len(names))), np.zeros(len(self.parent))
        for i, name in self.held.items():
            C[i], c[i] = (self.share.get(i, 1.0) * value for value in rows[name])
            c[i] += self.constant.get(i, 0.0)
        return C, c

    def _move(self, transform: Array) -> None:
        self.rigid, self._drawn = self.rigid @ transform, self._drawn @ transform

    def _turn(self, vector: Array) -> None:
        if vector.any():
            self._move(frame(rotation_from_vector(vector)))

    def _coordinate_joint(self, axis: Array, *, rotary: bool) -> None:
        """A joint with a coordinate of its own."""
        self._joint(axis, self.size, 1.0, rotary=rotary)
        self.size += 1

    def _joint(self, axis: Array, coordinate: int, factor: float, *, rotary: bool) -> None:
        self.parent.append(self._last)
        self.before.append(self.rigid)
        self.axis.append(np.asarray(axis, dtype=float))
        self.rotary.append(rotary)
        self.coordinate.append(coordinate)
        self.factor.append(factor)
        self.rigid, self._last = NOWHERE, len(self.rotary) - 1

    def _spring_of_22(self, compliance: Array, part: str) -> None:
        """Translations, then rotations, as (22) has them; those that do not deflect are left out.

        Raises:
            ValueError: the compliance is not that of a spring.
        """
        gives = compliance.any(axis=0) | compliance.any(axis=1)
        felt = compliance[np.ix_(gives, gives)]
        size = np.sqrt(np.abs(np.diag(felt)))
        definite = bool(np.all(size > 0.0)) and np.linalg.eigvalsh(felt / np.outer(size, size)).min() > DEFINITE
        if not definite:
            raise ValueError(
                f"part '{part}': its compliance is not positive definite in the directions in which it deflects. "
                f"Give a rigid direction zeros in its row and column"
            )
        for k in np.flatnonzero(gives):
            self._coordinate_joint(AXES["xyz"[k % 3]], rotary=bool(k >= 3))
        if len(felt):
            self.springs.append(LinearSpring(felt))

    def _symmetric_spring(self, law: Spring) -> None:
        """Half of the turns, the shifts, and the other half in reverse: the same seen from either end."""
        first, count = len(self.parent), len(SYMMETRIC)
        self.parent += [self._last, *range(first, first + count - 1)]
        self.before += [self.rigid, *[NOWHERE] * (count - 1)]
        self.axis += [AXES["xyz"[k % 3]] for k in SYMMETRIC]
        self.rotary += [k >= 3 for k in SYMMETRIC]
        self.coordinate += [self.size + k for k in SYMMETRIC]
        self.factor += [0.5 if k >= 3 else 1.0 for k in SYMMETRIC]
        self.rigid, self._last = NOWHERE, first + count - 1
        self.size += 6
        self.springs.append(law)

    def _piece(
        self,
        part: str,
        start: float,
        stop: float,
        along: Array,
        mass: float = 0.0,
        lever: float = 0.5,
        centre: Array | None = None,
    ) -> None:
        root, R = self.rigid[:3, 3].copy(), self.rigid[:3, :3]
        fraction = start + lever * (stop - start)
        weight_at = None if centre is None else root + R @ centre
        self.pieces.append(LinkSegment(part, start, stop, self._last, root, R @ along, mass, fraction, weight_at))
        self._stretches.setdefault(part, []).append(Stretch(start, stop, self._last, self.rigid, self._drawn))

    @property
    def last(self) -> int:
        """Index of the last joint before the end of the last part, −1 at the base."""
        return self._last

    def _mark(self, part: str, fraction: float) -> None:
        self.stations.append(Marker(part, fraction, self._last, self.rigid[:3, 3].copy()))
