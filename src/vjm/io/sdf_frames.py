"""FrameGraph of an SDF file: each is placed in another one, by a pose, until the world is reached."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal

import numpy as np

from vjm.io.bounded_xml import XmlElement
from vjm.io.errors import did_you_mean
from vjm.io.robot import Placing, turned
from vjm.io.urdf_values import METRE, WHOLE_TURN, FilePlace, quaternion_turns, rpy_turns, shown, vector
from vjm.rotations import Array, frame, inverse_frame, rotation_vector

WORLD = "world"
MODEL = "__model__"
QUATERNION = "quat_xyzw"
FORMATS = ("euler_rpy", QUATERNION)


def pose_of(place: FilePlace, element: XmlElement | None, doubts: list[str], unit: Decimal = METRE) -> Placing:
    """Where a pose places its frame, mm and rad; nowhere else where there is none.

    Args:
        place: for messages.
        element: ``<pose>``, six numbers, the last three in degrees where it says so, or seven with a quaternion.
        doubts: what is likely a mistake is added.
        unit: of the file's lengths, in mm.

    Raises:
        ModelFileError: it has other numbers.
    """
    if element is None or not element.text:
        return Placing()
    place = place.inside(element)
    form = element.attributes.get("rotation_format", FORMATS[0])
    if form not in FORMATS:
        raise place.error(f"has a pose with rotation_format '{form}': give {' or '.join(FORMATS)}")
    length = 7 if form == QUATERNION else 6
    # to mm without a second rounding
    x, y, z = vector(place, element, "", length, unit=unit)[:3]
    rest = vector(place, element, "", length)[3:]
    if form == QUATERNION:
        if not any(rest):
            raise place.error("has a quaternion of length zero: give one of length 1")
        return Placing((x, y, z), quaternion_turns(*rest))
    if element.attributes.get("degrees", "false").strip() in ("true", "1"):
        rest = [math.radians(angle) for angle in rest]
    elif max(map(abs, rest)) > WHOLE_TURN:
        doubts.append(
            f"{place.owner} (line {element.line}): {shown(element)} turns beyond a whole turn: is it in degrees? "
            'A pose has rad, or degrees="true"'
        )
    return Placing((x, y, z), rpy_turns(rest))


@dataclass(frozen=True)
class _Frame:
    """Where a frame is placed: by a pose in another, or so that a frame behind it is there.

    Attributes:
        base: name of the other.
        pose: ``(4, 4)``, mm.
        placed: name of the frame behind it that the pose places; itself where it is empty.
        place: for messages.
    """

    base: str
    pose: Array
    place: FilePlace
    placed: str = ""


@dataclass
class FrameGraph:
    """The frames of one file by name; those in nested models have the names of these before theirs."""

    _frames: dict[str, _Frame] = field(default_factory=dict)

    def add(self, name: str, base: str, pose: Placing, place: FilePlace, *, placed: str = "") -> None:
        """One more frame; the first one of a name is kept."""
        T = frame(turned(pose.turns), pose.shift)
        self._frames.setdefault(name, _Frame(base, T, place, placed))

    def __contains__(self, name: str) -> bool:
        return name == WORLD or name in self._frames

    def __iter__(self) -> Iterator[str]:
        """Names as files have them."""
        return (name for name in self._frames if name.isprintable())

    def between(self, base: str, name: str) -> Placing:
        """Where a frame lies in another.

        Raises:
            ModelFileError: a frame on the way is placed in one that is not there, or in itself.
        """
        back, forth = self._way(base), self._way(name)
        while back and forth and back[0] == forth[0]:
            del back[0], forth[0]
        back_T, forth_T = np.eye(4), np.eye(4)
        for one in back:
            back_T = back_T @ self._own(one)
        for one in forth:
            forth_T = forth_T @ self._own(one)
        T = forth_T if not back else inverse_frame(back_T) @ forth_T
        shift = (float(T[0, 3]), float(T[1, 3]), float(T[2, 3]))
        turn = rotation_vector(T[:3, :3])
        angle = float(np.linalg.norm(turn))
        if not angle:
            return Placing(shift)
        x, y, z = (float(v) for v in turn / angle)
        return Placing(shift, (((x, y, z), angle),))

    def _own(self, name: str) -> Array:
        """A frame ``(4, 4)`` in that in which it is placed."""
        one = self._frames[name]
        if not one.placed:
            return one.pose
        behind = self.between(name, one.placed)
        return one.pose @ inverse_frame(frame(turned(behind.turns), behind.shift))

    def _way(self, name: str) -> list[str]:
        """Names of frames from the world, without it, to one of them."""
        way = list[str]()
        while name != WORLD:
            place = self._frames[way[0]].place if way else None
            if name not in self._frames:
                assert place is not None
                raise place.error(
                    f"is placed in the frame '{name}', which is not there{did_you_mean(name, list(self))}"
                )
            if name in way:
                raise self._frames[name].place.error(
                    "is placed in itself, by way of other frames: correct relative_to"
                )
            way.insert(0, name)
            name = self._frames[name].base
        return way
