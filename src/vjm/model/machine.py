"""A machine of parts: a chain as in the paper's (1) and (21), a tree, or one with closed loops.

Where a manipulator file describes it, its legs have names.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vjm.model.laws import Law
from vjm.model.parts import (
    SHORTEST_FREE,
    Beam,
    Closure,
    Coupling,
    Joint,
    JointKind,
    Part,
    Placement,
    PointSpring,
    RigidOffset,
)
from vjm.rotations import Array

FOOT = "foot"
"""Name of the beam that ``foot_segments`` splits."""
OVER = 1e-9
"""Of a free length: what rounding and solvers that close loops leave beyond its end."""
ALONG = 1e-6
"""Of a unit vector: axes in a file have six digits."""
USUAL_SEGMENTS = 16
"""Springs in a beam where neither the model file nor anybody else says how many."""


def one_digest(files: Mapping[str, str]) -> str:
    """SHA-256 of files by name: of one alone its own, of none the empty text."""
    if len(files) < 2:
        return next(iter(files.values()), "")
    return hashlib.sha256("".join(f"{name}\0{one}\n" for name, one in sorted(files.items())).encode()).hexdigest()


@dataclass(frozen=True)
class Machine:
    """Parts between a fixed base and the end-effector: in series, in branches, and in closed loops.

    Attributes:
        name: of the model.
        parts: from base to tool.
        base: frame ``(4, 4)`` of the first part's root in the world, mm.
        postures: passive joint coordinates ``(n_q,)`` in rad by posture label.
        title: one line for people.
        source: where the numbers come from.
        files: SHA-256 of each file that it was read from by its name; none where it was not read.
        link_segments: springs in every beam but the foot that its model file asks for; 1: the paper's one spring
            at the far end. None where it leaves that to the engine.
        foot_segments: likewise in the foot.
        held: coordinates of the held joints (`vjm.model.parts`) by their names, mm or rad, by posture label.
            Coupled joints follow from the others.
        after: for a tree: name of the part behind which a part begins, by its name, empty for the base. A part that
            is not named begins behind the part before it.
        point_springs: springs between points of two parts.
        ends: end frames of a tree by name: the name of the part behind which each lies. Behind the last part lies
            the end-effector, whose name is empty.
        closures: frames that are held together, which close loops.
        couplings: of passive joints.
        poses: displacements ``(6,)`` of the end-effector from home by label, mm and rad, for a machine whose
            coordinates follow from them by its closures. `postures` and `held` have them under the same labels.
            Home is the first posture. A machine with poses counts all places of its end-effector from there.
        workspace: corners ``(2, 3)`` of a box of places of the end-effector, mm: from home where it has poses, else
            in the world.
        nominal_ends: frames ``(4, 4)`` of the end-effector by posture label, mm, from which its displacements count
            where errors of assembly leave the loops open: as designed. Without one it is where the parts put it.
        valid_within: of a calibrated machine, measured ranges of joints by name, rad or mm, beyond which nothing
            tells how good it is.

    Example:
        >>> import vjm
        >>> arm = vjm.load("planar-2r")
        >>> arm.name, [joint.name for joint in arm.held_joints]
        ('planar-2r', ['shoulder', 'elbow'])
    """

    name: str
    parts: tuple[Part, ...]
    base: Array = field(default_factory=lambda: np.eye(4))
    postures: Mapping[str, Array] = field(default_factory=dict)
    title: str = ""
    source: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    link_segments: int | None = None
    foot_segments: int | None = None
    held: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    after: Mapping[str, str] = field(default_factory=dict)
    point_springs: tuple[PointSpring, ...] = ()
    ends: Mapping[str, str] = field(default_factory=dict)
    closures: tuple[Closure, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    poses: Mapping[str, Array] = field(default_factory=dict)
    workspace: Array | None = None
    nominal_ends: Mapping[str, Array] = field(default_factory=dict)
    valid_within: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def sha256(self) -> str:
        """See `one_digest`."""
        return one_digest(self.files)

    def __repr__(self) -> str:
        parts = ", ".join(part.name for part in self.parts)
        return f"<Machine {self.name}: {parts}; postures {', '.join(self.postures) or 'none'}>"

    def __post_init__(self) -> None:
        names = [part.name for part in self.parts]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{self.name}: part names must differ, but {', '.join(twice)} stands twice")
        before = self.predecessors
        riding = {joint.name: before[name] for name, joint in self._checked_riders().items()}
        object.__setattr__(self, "after", {**self.after, **riding})
        self._check_references()

    def _check_references(self) -> None:
        """Refuse names of parts that are not there, by a `ValueError`."""
        before, joints = {""}, set[str]()
        for part in self.parts:
            where = self.after.get(part.name, "")
            if where not in before:
                raise ValueError(
                    f"{self.name}: part '{part.name}' begins after '{where}', which is no part before it"
                )
            before.add(part.name)
            if not isinstance(part, Joint) or part.fixed:
                continue
            for name, _ in part.coupling.ratios if part.coupling is not None else ():
                if name not in joints:
                    raise ValueError(f"joint '{part.name}' is coupled to '{name}', which is no joint before it")
            joints.add(part.name)
        self._check_free_lengths()
        for end, behind in self.ends.items():
            if behind not in before:
                raise ValueError(f"{self.name}: end frame '{end}' lies behind '{behind}', which is no part")
        for spring in self.point_springs:
            for name in spring.parts:
                if name not in before:
                    raise ValueError(f"{self.name}: spring '{spring.name}' is fixed to '{name}', which is no part")
        for closure in self.closures:
            for name in closure.parts:
                if name not in before:
                    raise ValueError(f"{self.name}: closure '{closure.name}' holds '{name}', which is no part")
        passive = {joint.name for joint in self.joints}
        for coupling in self.couplings:
            for name, _ in coupling.terms:
                if name not in passive:
                    raise ValueError(
                        f"{self.name}: coupling '{coupling.name}' names '{name}', which is no passive joint"
                    )

    def _checked_riders(self) -> dict[str, Joint]:
        """Joints that ride on beams, by the beams' names.

        Raises:
            ValueError: one cannot, naming both.
        """
        beams, riders = dict[str, Beam](), dict[str, Joint]()
        for part in self.parts:
            if isinstance(part, Beam):
                beams[part.name] = part
            if not isinstance(part, Joint) or not part.rides_on:
                continue
            name = part.rides_on
            where = f"joint '{part.name}': rides_on = '{name}'"
            if name not in beams:
                raise ValueError(f"{where} is no beam before it")
            if name in riders:
                raise ValueError(f"{where}: joint '{riders[name].name}' rides on it too, and a beam carries one")
            _refuse_ride(where, part, beams[name])
            fixed = next((spring.name for spring in self.point_springs if name in spring.parts), None)
            if fixed is not None:
                raise ValueError(f"spring '{fixed}': joint '{part.name}' rides on '{name}': fix it to another part")
            riders[name] = part
        return riders

    def _check_free_lengths(self) -> None:
        """Refuse a beam that no sliding joint before it pushes out, or one that a spring between points holds.

        Raises:
            ValueError: naming both.
        """
        sliding, pushed = set[str](), set[str]()
        for part in self.parts:
            if isinstance(part, Joint) and part.kind is JointKind.ACTUATED and part.slides:
                sliding.add(part.name)
            if isinstance(part, Beam) and part.free_length:
                fixed = next((spring.name for spring in self.point_springs if part.name in spring.parts), None)
                if fixed is not None:
                    raise ValueError(
                        f"spring '{fixed}': part '{part.name}' comes out of its root, so that no point of it lies "
                        f"at one place along it. Fix the spring to the part before or behind it"
                    )
                name = part.free_length
                if name not in sliding:
                    raise ValueError(
                        f"part '{part.name}': free_length = '{name}' is no actuated joint before it that slides"
                    )
                if name in pushed:
                    raise ValueError(
                        f"part '{part.name}': joint '{name}' pushes out another beam too: take two joints"
                    )
                pushed.add(name)

    @property
    def pushing(self) -> dict[str, Beam]:
        """Beams whose free length is a joint's coordinate, by the joint's name; the joint itself stands still."""
        return {beam.free_length: beam for beam in self.beams if beam.free_length}

    @property
    def riders(self) -> dict[str, Joint]:
        """Joints that ride on beams, by the beams' names."""
        return {part.rides_on: part for part in self.parts if isinstance(part, Joint) and part.rides_on}

    @property
    def cuts(self) -> dict[str, float]:
        """Fractions of beams at which joints stand on them, by the beams' names, of a machine in a posture.

        Less than `SHORTEST_FREE` from an end of the beam a joint is carried by that end.
        """
        beams, fractions = {beam.name: beam for beam in self.beams}, dict[str, float]()
        for name, joint in self.riders.items():
            if joint.value is not None:
                least = SHORTEST_FREE / beams[name].length
                fraction = joint.value / beams[name].length
                fractions[name] = 0.0 if fraction < least else 1.0 if fraction > 1.0 - least else fraction
        return fractions

    @property
    def beams(self) -> tuple[Beam, ...]:
        """The elastic parts, from base to tool."""
        return tuple(part for part in self.parts if isinstance(part, Beam))

    @property
    def predecessors(self) -> dict[str, str]:
        """Name of the part behind which each part begins, by its own name; empty for the base."""
        names = ["", *(part.name for part in self.parts)]
        return {name: self.after.get(name, before) for before, name in pairwise(names)}

    @property
    def moving(self) -> tuple[Joint, ...]:
        """The joints that have a coordinate, from base to tool: all but fixed ones."""
        return tuple(part for part in self.parts if isinstance(part, Joint) and not part.fixed)

    @property
    def laws(self) -> tuple[tuple[str, Law], ...]:
        """The laws of its springs, with what has each in words: of the parts, then between points."""
        joints = (part for part in self.parts if isinstance(part, Joint))
        own = [(f"{joint.what} '{joint.name}'", joint.law) for joint in joints]
        own += [(f"spring '{spring.name}'", spring.law) for spring in self.point_springs]
        return tuple((words, law) for words, law in own if law is not None)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The joints that move freely, from base to tool."""
        return tuple(joint for joint in self.moving if joint.free)

    @property
    def held_joints(self) -> tuple[Joint, ...]:
        """The joints that stand at a coordinate which the data give: actuated and sprung ones, base to tool."""
        return tuple(joint for joint in self.moving if joint.held and joint.coupling is None)

    def at(self, label: str) -> Machine:
        """The machine with its held joints at the coordinates of a posture; itself where it has none.

        Raises:
            KeyError: no such posture.
        """
        if not any(joint.held for joint in self.moving):
            return self
        self.posture(label)
        return self.locked(self.held.get(label, {}))

    def locked(self, values: Mapping[str, float]) -> Machine:
        """The machine with its held joints at coordinates by name, mm or rad.

        Raises:
            ValueError: a coordinate is missing or unknown, a joint is coupled to one that is not before it, or one
                that rides on a beam is not on it.
        """
        known = {joint.name for joint in self.held_joints}
        unknown, missing = sorted(set(values) - known), sorted(known - set(values))
        if unknown or missing:
            what = f"no held joint '{unknown[0]}'" if unknown else f"no coordinate for the joint '{missing[0]}'"
            raise ValueError(f"{self.name}: {what}; it has {', '.join(sorted(known)) or 'none'}")
        coordinates, pushing = dict(values), self.pushing
        parts: list[Part] = []
        for part in self.parts:
            if isinstance(part, Joint) and part.coupling is not None:
                other = next((name for name, _ in part.coupling.ratios if name not in coordinates), None)
                if other is not None:
                    raise ValueError(
                        f"joint '{part.name}' is coupled to '{other}', which is no held joint before it"
                    )
                coordinates[part.name] = part.coupling.value(coordinates)
                # what pushes a beam out stands at zero in a posture: what follows it stays where it was brought
                brought = sum(ratio * coordinates[name] for name, ratio in part.coupling.ratios if name in pushing)
                part = replace(part, coupling=replace(part.coupling, offset=part.coupling.offset + brought))
            if isinstance(part, Beam) and part.free_length:
                parts.append(pushed_out(part, coordinates[part.free_length]))
                continue
            if isinstance(part, Joint) and part.rides_on:
                _refuse_off(part, coordinates[part.name], next(b for b in self.beams if b.name == part.rides_on))
            stands = 0.0 if part.name in pushing else coordinates.get(part.name, 0.0)
            parts.append(replace(part, value=float(stands)) if isinstance(part, Joint) and part.held else part)
        return replace(self, parts=tuple(parts))

    @property
    def closes(self) -> bool:
        """Whether its joints' coordinates depend on one another: by loops, or by couplings of passive joints."""
        return bool(self.closures or self.couplings)

    @property
    def is_tree(self) -> bool:
        """Whether it has branches, closed loops, or springs between two parts."""
        return bool(self.after or self.point_springs or self.closes)

    @cached_property
    def characteristic_length(self) -> float:
        """Length of the longest straight piece in mm, elastic or rigid: the unit in which solvers measure lengths.

        Short elastic parts on long rigid ones are springs of joints. Measured by their own length, the chain's
        motions would be large, and its branches would be sought next to where it stands. It is 1 mm where no part
        has a length.
        """
        return self.longest or 1.0

    @cached_property
    def longest(self) -> float:
        """Length of the longest straight piece in mm; 0 where no part has any."""
        offsets = [part.transform[:3, 3] for part in self.parts if isinstance(part, RigidOffset)]
        offsets += [beam.end_offset for beam in self.beams]
        lengths = [beam.length for beam in self.beams] + [float(np.linalg.norm(offset)) for offset in offsets]
        return max(lengths, default=0.0)

    def posture(self, label: str) -> Array:
        """Passive joint coordinates ``(n_q,)`` in rad.

        Raises:
            KeyError: no such posture, with the ones that there are.
        """
        if label not in self.postures:
            raise KeyError(f"{self.name}: no posture '{label}'; it has {', '.join(self.postures) or 'none'}")
        return self.postures[label]

    def refined(self, segments: Mapping[str, int] | int, placement: Placement | str = Placement.BEST) -> Machine:
        """The same machine with its beams split into virtual springs.

        Args:
            segments: number of segments by beam name; one number for every beam without a number of its own. A
                beam that is not named stays as it is; 1 leaves a beam whole that has a number of its own, or a
                compliance matrix alone.
            placement: where the spring sits in its segment.

        Raises:
            ValueError: no such beam, fewer than one segment, or a beam known by its compliance only.
        """
        if isinstance(segments, int):
            segments = {beam.name: beam.own_segments or segments for beam in self.beams}
        names = {beam.name for beam in self.beams}
        for name, n in segments.items():
            if name not in names:
                known = ", ".join(sorted(names)) or "none"
                raise ValueError(f"{self.name}: no beam '{name}' to split; it has {known}")
            if n < 1:
                raise ValueError(f"{self.name}: beam '{name}' needs at least one segment, got {n}")

        def split(part: Part) -> Part:
            if not isinstance(part, Beam) or part.name not in segments:
                return part
            if segments[part.name] == 1 and part.own_segments is not None:
                return part
            part.effective_section()
            return replace(part, segments=segments[part.name], placement=Placement(placement))

        return replace(self, parts=tuple(split(part) for part in self.parts))

    @property
    def usual_segments(self) -> tuple[int | None, int | None]:
        """Springs in every beam without a number of its own, and in the foot, that engine ``vjm`` takes.

        The model file's numbers, else `USUAL_SEGMENTS` in the beams; None: one spring with the part's compliance.
        """
        foot = self.foot_segments if (self.foot_segments or 1) > 1 else None
        if self.link_segments is None:
            return USUAL_SEGMENTS, foot
        return (self.link_segments if self.link_segments > 1 else None), foot

    def segment_numbers(self, segments: int | None, foot: int | None) -> dict[str, int]:
        """Springs by beam where every beam without a number of its own gets ``segments``, and the foot ``foot``.

        A beam that is not named stays one spring. Of a machine of legs it is the foot of every leg that has one.
        """
        numbers = {beam.name: beam.own_segments or segments for beam in self.beams}
        if foot and foot > 1:
            numbers |= dict.fromkeys(self.beams_named(FOOT) or ([] if self.closures else [FOOT]), foot)
        return {name: n for name, n in numbers.items() if n is not None}

    def beams_named(self, name: str) -> list[str]:
        """Full names of the beams of a name; the same part of every leg of a machine, ``leg/part``, has one."""
        return [beam.name for beam in self.beams if name in (beam.name, beam.name.rpartition("/")[2])]

    def split(self) -> Machine:
        """The same machine with its beams split as engine ``vjm`` splits them.

        What is split already stays so, and a beam without a section stays one spring with its given compliance.
        """
        whole = {beam.name for beam in self.beams if beam.segments is None and beam.section is not None}
        numbers = self.segment_numbers(*self.usual_segments)
        return self.refined({name: n for name, n in numbers.items() if name in whole})

    @property
    def shears(self) -> bool:
        """Whether a beam states a shear stiffness."""
        return any(beam.section is not None and beam.section.shears for beam in self.beams)

    def rigid_in_shear(self) -> Machine:
        """The same machine with the shear of its sections neglected; given matrices stay as they are."""
        parts = (
            replace(part, section=replace(part.section, GAy=np.inf, GAz=np.inf))
            if isinstance(part, Beam) and part.section is not None
            else part
            for part in self.parts
        )
        return replace(self, parts=tuple(parts))

    def with_actuator_compliance(self, compliance: float) -> Machine:
        """The same machine with a ``compliance`` of every actuator, mm/N."""
        parts = (
            replace(part, compliance=compliance, law=None)
            if isinstance(part, Joint) and part.kind is JointKind.ACTUATOR
            else part
            for part in self.parts
        )
        return replace(self, parts=tuple(parts))


def pushed_out(beam: Beam, free: float) -> Beam:
    """A beam of which ``free`` mm are out of its root, all else being as it is.

    Raises:
        ValueError: nothing of it is, or more than there is.
    """
    # a solver that closes loops leaves rounding at a limit
    if not SHORTEST_FREE * (1.0 - OVER) <= free <= beam.length * (1.0 + OVER):
        raise ValueError(
            f"part '{beam.name}': joint '{beam.free_length}' at {free:g} mm leaves no free length between "
            f"{SHORTEST_FREE:g} mm and the whole, {beam.length:g} mm"
        )
    return replace(beam, length=float(free), free_length="")


def _refuse_ride(where: str, joint: Joint, beam: Beam) -> None:
    """Refuse a joint that cannot ride on a beam; ``where`` names both.

    Raises:
        ValueError: saying why.
    """
    if joint.kind not in (JointKind.ACTUATED, JointKind.COUPLED) or not joint.slides:
        raise ValueError(f"{where}: what rides on a beam slides, and is actuated or coupled")
    if beam.free_length or beam.section is None or beam.compliance is not None or any(beam.bow):
        raise ValueError(f"{where}: that beam needs a section, and neither compliance, bow nor free_length")
    if beam.own_segments == 1:
        raise ValueError(f"{where}: that beam has segments = 1, one spring without a shape: leave segments out")
    along = beam.section_in_chain[:3, 0]
    if np.abs(joint.axis - along).max() > ALONG:
        written = ", ".join(f"{value:.6g}" for value in along)
        raise ValueError(f"{where}: its axis is not along the beam, from its root on: give [{written}]")
    low, high = joint.limits or (0.0, beam.length)
    if low > beam.length or high < 0.0:
        raise ValueError(
            f"{where}: its limits, {low:g} to {high:g} mm, leave no place on {beam.length:g} mm of beam"
        )


def _refuse_off(joint: Joint, value: float, beam: Beam) -> None:
    """Refuse a joint that is off the beam on which it rides.

    Raises:
        ValueError: naming both.
    """
    if not -OVER * beam.length <= value <= beam.length * (1.0 + OVER):
        raise ValueError(
            f"joint '{joint.name}' at {value:g} mm is not on the beam '{beam.name}', from 0 to {beam.length:g} mm"
        )


BASE, PLATFORM = "base", "platform"
"""Names of the body that stands still, and of the one whose pose is asked for: the last part's too."""
HOME = "home"
"""Label of the posture in which a machine is drawn, where its file gives it no other."""
ROOT, ATTACHMENT = "root", "attachment"
"""Rigid parts before a leg's first part, and from the end of a leg to the body that it carries."""


class Leg(NamedTuple):
    """A leg of a machine.

    Attributes:
        name: unique.
        parts: full names of its chain's parts, from where it begins to where it ends.
    """

    name: str
    parts: tuple[str, ...]


def named(leg: str, part: str) -> str:
    """Full name of a part of a leg."""
    return f"{leg}/{part}"


def legs_of(machine: Machine) -> tuple[Leg, ...]:
    """The legs of a machine, none where its file is not one of legs.

    Example:
        >>> import vjm
        >>> [leg.name for leg in legs_of(vjm.load("parallelogram"))]
        ['bar-1', 'bar-2']
    """
    names: dict[str, list[str]] = {}
    for part in machine.parts:
        leg, _, own = part.name.partition("/")
        if own == ROOT:
            names[leg] = []
        elif own and own != ATTACHMENT and leg in names:
            names[leg].append(part.name)
    return tuple(Leg(leg, tuple(parts)) for leg, parts in names.items())
