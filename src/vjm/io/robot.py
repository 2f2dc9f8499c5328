"""A robot as descriptions of rigid bodies know it: bodies, joints, limits and mimics, in mm and rad."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any, Literal, TypeAlias, assert_never

import numpy as np

from vjm.io.errors import ModelFileError
from vjm.io.fields import LONGEST_MM
from vjm.rotations import Array, frame, rotation_from_vector

Kind = Literal["fixed", "turns", "slides"]
Turns = tuple[tuple[tuple[float, float, float], float], ...]
"""Axes ``(3,)`` and angles in rad, one after another."""
ON_ITS_BASE = "and a machine stands on its base: --fix-base fixes it where the file shows it"
HUGE = LONGEST_MM
"""mm or rad: the longest length of a model file, and 16,000 turns. A limit beyond it binds nothing."""
LEAST_STIFFNESS = 1e-3
"""N mm/rad or N/mm: the inverse of the largest compliance of a model file. What is softer holds nothing."""


@dataclass(frozen=True)
class FileUnits:
    """Of a file; decimal, so that its numbers are rounded once.

    Attributes:
        length: its unit in mm.
        mass: in kg.
        moments: of inertia, in kg mm².
    """

    length: Decimal = Decimal(1000)
    mass: Decimal = Decimal(1)
    moments: Decimal = Decimal(1000000)


Repairs: TypeAlias = Literal["made", "left out", "refused"]
"""What becomes of what no machine can have."""


@dataclass(frozen=True)
class Reading:
    """How a description is read.

    Attributes:
        fix_base: joints that float, of a base or of another body, hold it where the file shows it.
        repairs: whether what no machine can have, reversed limits or impossible moments of inertia, is repaired and
            said, left out and said, or refused.
        units: of the file's lengths, masses and moments of inertia.
    """

    fix_base: bool = False
    repairs: Repairs = "made"
    units: FileUnits = FileUnits()


USUAL = Reading()


@dataclass(frozen=True)
class Placing:
    """Where a frame lies in another: shifted first, then turned.

    Attributes:
        shift: ``(3,)`` mm.
        turns: axis ``(3,)`` and angle in rad, one after another, each about the axes that the one before it left.
    """

    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: Turns = ()

    @property
    def is_identity(self) -> bool:
        """Whether it moves nothing."""
        return not any(self.shift) and not self.turns

    @property
    def frame(self) -> Array:
        """The frame ``(4, 4)``, mm."""
        return frame(turned(self.turns), self.shift)

    def keys(self, shift: str = "translation_mm") -> dict[str, Any]:
        """Of a table in a model file, where the shift has a key."""
        table: dict[str, Any] = {shift: list(self.shift)}
        if self.turns:
            table["turns"] = [
                {"turn_about": axis_key(np.array(axis)), "angle_deg": math.degrees(angle)}
                for axis, angle in self.turns
            ]
        return table


def new_name(wanted: str, taken: set[str]) -> str:
    """A name not yet taken, which it is then."""
    name, count = wanted, 1
    while name in taken:
        count += 1
        name = f"{wanted}-{count}"
    taken.add(name)
    return name


def triple(vector: Iterable[float]) -> tuple[float, float, float]:
    """The three numbers of a vector."""
    x, y, z = (float(value) for value in vector)
    return x, y, z


def turned(turns: Turns) -> Array:
    """Rotation ``(3, 3)`` of turns one after another."""
    R = np.eye(3)
    for axis, angle in turns:
        R = R @ rotation_from_vector(np.array(axis) * angle)
    return R


def unit_axis(axis: Array) -> Array:
    """A direction ``(3,)`` of any length above zero at length one."""
    # scaled first: squares of tiny entries vanish
    scaled = axis / np.abs(axis).max()
    return scaled / np.linalg.norm(scaled) + 0.0


def axis_key(axis: Array) -> str | list[float]:
    """A direction ``(3,)`` of any length above zero as a model file has it."""
    unit = unit_axis(axis)
    for name, one in zip("xyz", np.eye(3), strict=True):
        if np.array_equal(unit, one):
            return name
    return [float(v) for v in unit]


@dataclass(frozen=True)
class Body:
    """A link.

    Attributes:
        name: of the link.
        mass: kg.
        centre: of mass, mm in its frame.
        between: it lies between joints of a link, and is none itself.
        inertia: ``ixx, iyy, izz, ixy, ixz, iyz`` about the centre of mass, kg mm², axes of its frame; empty where
            it is not known.
    """

    name: str
    mass: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    between: bool = False
    inertia: tuple[float, ...] = ()


@dataclass(frozen=True)
class Mimic:
    """A joint's coordinate follows another's: ``ratio · its + offset``, mm or rad."""

    joint: str
    ratio: float
    offset: float


@dataclass(frozen=True)
class RobotJoint:
    """Between two bodies.

    Attributes:
        name: of the joint.
        kind: how it moves.
        parent: body before it.
        child: body behind it, whose frame is the joint's.
        placing: of the joint's frame in the parent's.
        axis: ``(3,)`` in the joint's frame, of any length above zero.
        limits: mm or rad.
        home: coordinate inside of them.
        mimic: what it follows.
        rotor: inertia of what is geared to the joint, reflected to it, kg mm²; kg where it slides.
        passive: whether it has no drive.
        stiffness: of its drive, or of its spring where it has no drive, N mm/rad or N/mm; zero where not known.
        rest: coordinate at which the spring of a joint without a drive is free of stress.
    """

    name: str
    kind: Kind
    parent: str
    child: str
    placing: Placing = Placing()
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    limits: tuple[float, float] | None = None
    home: float = 0.0
    mimic: Mimic | None = None
    rotor: float = 0.0
    passive: bool = False
    stiffness: float = 0.0
    rest: float = 0.0

    def standing(self, coordinate: float) -> RobotJoint:
        """A fixed joint in the place of this one, as it is at a coordinate, mm or rad."""
        axis, shift, turns = unit_axis(np.array(self.axis)), np.array(self.placing.shift), self.placing.turns
        if self.kind == "slides":
            shift = shift + turned(turns) @ (coordinate * axis)
        else:
            turns = (*turns, (triple(axis), coordinate))
        return RobotJoint(self.name, "fixed", self.parent, self.child, Placing(triple(shift), turns))


def masters_of(joints: Iterable[RobotJoint], made: Callable[[str], RobotJoint]) -> dict[str, RobotJoint]:
    """By name, joints that are not among these and that some of these mimic; ``made`` makes one of its name."""
    joints = list(joints)
    names = {joint.name for joint in joints}
    masters = (joint.mimic.joint for joint in joints if joint.mimic is not None)
    return {name: made(name) for name in masters if name not in names}


@dataclass(frozen=True)
class RobotClosure:
    """Two frames of bodies that are held together.

    Attributes:
        name: of the closure.
        bodies: that have the frames.
        placings: of the frames in the bodies.
        turns: whether one frame may turn in the other, as in a ball joint.
    """

    name: str
    bodies: tuple[str, str]
    placings: tuple[Placing, Placing]
    turns: bool = False


@dataclass
class Notes:
    """What is to be said of an import.

    Attributes:
        left_out: what the model does not have of the description.
        doubtful: what is likely a mistake in it.
        changed: what the model has otherwise.
    """

    left_out: list[str] = field(default_factory=list)
    doubtful: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)

    def repaired(self, repairs: Repairs, refusal: ModelFileError, *, doubtful: str, changed: str) -> bool:
        """Say that what no machine can have was repaired; False, and said, where it is left out in place of that.

        Raises:
            ModelFileError: it is refused.
        """
        match repairs:
            case "refused":
                raise refusal
            case "left out":
                self.doubtful.append(doubtful)
                return False
            case "made":
                self.changed.append(changed)
                return True
            case _:
                assert_never(repairs)

    def lines(self) -> list[str]:
        """All of it, a line each, whatever letters names have."""
        named = (("left out", self.left_out), ("doubtful", self.doubtful), ("changed", self.changed))
        lines = (f"{word}: {text}" for word, texts in named for text in texts)
        return ["".join(c if c.isprintable() else " " for c in line) for line in lines]


@dataclass
class Robot:
    """What is imported of a robot: all of it, or the way to one link.

    Attributes:
        name: of the robot.
        root: body on which it stands.
        bodies: by name.
        joints: parents before children, in the order of the file.
        masters: joints elsewhere in the robot that joints here mimic, by name.
        file: for messages.
        notes: what was found while reading.
        closures: what closes its loops.
        impossible: moments of inertia of the file that no body has and the nearest ones that a body has, by body,
            ``(3, 3)`` kg mm² in its axes.
    """

    name: str
    root: str
    bodies: dict[str, Body]
    joints: list[RobotJoint]
    masters: dict[str, RobotJoint]
    file: str
    notes: Notes = field(default_factory=Notes)
    closures: list[RobotClosure] = field(default_factory=list)
    impossible: dict[str, tuple[Array, Array]] = field(default_factory=dict)
