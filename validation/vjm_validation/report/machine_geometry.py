"""What of any machine is drawn: lines of its parts, joints with their axes, springs, end frames, names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import assert_never

import numpy as np

from vjm.machine.legs import ATTACHMENT, PLATFORM, ROOT, legs_of, named
from vjm.model import joints
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import Array, translation

BEAM, RIGID, BODY = "beam", "rigid", "body"
"""Kinds of lines."""
ELASTIC_JOINT, PASSIVE, STIFF = "elastic joint", "passive joint", "rigid drive"
"""Kinds of joints."""


@dataclass(frozen=True)
class DrawnLine:
    """A part between two points ``(2, 3)``, mm, world."""

    name: str
    kind: str
    points: Array


@dataclass(frozen=True)
class DrawnJoint:
    """A joint at a point ``(3,)`` mm with its axis ``(3,)``, world; it slides along it or turns about it."""

    name: str
    kind: str
    at: Array
    axis: Array
    slides: bool


@dataclass
class Geometry:
    """A machine as lines to draw, without load.

    Attributes:
        lines: its parts.
        joints: its joints.
        springs: between two points ``(2, 3)`` mm, by name.
        ends: end frames ``(4, 4)`` by name.
    """

    lines: list[DrawnLine] = field(default_factory=list)
    joints: list[DrawnJoint] = field(default_factory=list)
    springs: list[tuple[str, Array]] = field(default_factory=list)
    ends: list[tuple[str, Array]] = field(default_factory=list)

    @property
    def points(self) -> Array:
        """All points ``(k, 3)`` that the drawing must hold."""
        found = [line.points for line in self.lines] + [points for _, points in self.springs]
        found += [joint.at[None] for joint in self.joints] + [T[:3, 3][None] for _, T in self.ends]
        return np.vstack(found) if found else np.zeros((1, 3))

    @property
    def extent(self) -> float:
        """Largest side of the box around it, mm."""
        return max(1.0, float(np.ptp(self.points, axis=0).max()))


def geometry(machine: Machine, posture: str) -> Geometry:
    """What is drawn of a machine in a posture.

    Raises:
        KeyError: the machine has no such posture.
    """
    found = Geometry()
    values = dict(zip((joint.name for joint in machine.joints), machine.posture(posture), strict=True))
    frames = _draw(machine.at(posture), values, machine.base, found)
    for spring in machine.point_springs:
        points = np.array(
            [(frames[name][0] @ np.append(p, 1.0))[:3] for name, p in zip(spring.parts, spring.points, strict=True)]
        )
        found.springs.append((spring.name, points))
    _draw_bodies(machine, frames, found)
    last = machine.parts[-1].name
    found.ends = [(name, frames[part][1]) for name, part in (machine.ends or {_end_name(machine): last}).items()]
    return found


def _end_name(machine: Machine) -> str:
    return PLATFORM if machine.parts[-1].name == PLATFORM else "tool"


def _body(machine: Machine, carrier: str) -> str:
    """Name of the rigid body behind a part: of what carries the platform that, of an attachment its leg's."""
    if machine.parts[-1].name == PLATFORM and machine.predecessors[PLATFORM] == carrier:
        return PLATFORM
    return carrier.removesuffix(f"/{ATTACHMENT}")


def _draw_bodies(machine: Machine, frames: dict[str, tuple[Array, Array]], found: Geometry) -> None:
    """Lines of rigid bodies: from what carries them, and to the frames by which closures hold them."""
    legs = [leg.name for leg in legs_of(machine)]
    hidden, attachments = ({named(leg, part) for leg in legs} for part in (ROOT, ATTACHMENT))
    found.lines = [
        replace(line, name=_body(machine, line.name), kind=BODY) if line.name in attachments else line
        for line in found.lines
        if line.name not in hidden
    ]
    for closure in machine.closures:
        for part, frame in zip(closure.parts, closure.frames, strict=True):
            end = frames[part][1]
            point = (end @ frame)[:3, 3]
            if part and np.linalg.norm(point - end[:3, 3]) > 1e-6:
                found.lines.append(DrawnLine(_body(machine, part), BODY, np.array([end[:3, 3], point])))


def _draw(chain: Machine, values: dict[str, float], base: Array, found: Geometry) -> dict[str, tuple[Array, Array]]:
    """Add a chain's parts; frames where each begins, joints behind their motion, and ends, by name."""
    frames: dict[str, tuple[Array, Array]] = {"": (np.eye(4), base)}
    before = chain.predecessors
    for part in chain.parts:
        name = part.name
        begin = end = frames[before[name]][1]
        match part:
            case Beam():
                end = begin @ translation(part.tip)
                found.lines.append(DrawnLine(name, BEAM, np.array([begin[:3, 3], end[:3, 3]])))
            case RigidOffset():
                end = begin @ part.transform
                if np.linalg.norm(part.transform[:3, 3]) > 0.0:
                    found.lines.append(DrawnLine(name, RIGID, np.array([begin[:3, 3], end[:3, 3]])))
            case joints.Joint():
                end = begin @ part.motion(values[name] if part.free else part.held_at)
                kind = PASSIVE if part.free else ELASTIC_JOINT if part.elastic or part.passes_on else STIFF
                found.joints.append(DrawnJoint(name, kind, begin[:3, 3], begin[:3, :3] @ part.axis, part.slides))
                if part.held and part.slides and abs(part.held_at) > 0.0:
                    found.lines.append(DrawnLine(name, RIGID, np.array([begin[:3, 3], end[:3, 3]])))
                begin = end
            case _:
                assert_never(part)
        frames[name] = begin, end
    return frames


def labels(shown: Geometry) -> Iterator[tuple[str, Array]]:
    """Names and where they stand ``(3,)`` mm: each once, at the middle of a line and beside a joint."""
    seen: set[str] = set()
    for line in shown.lines:
        if line.name not in seen:
            seen.add(line.name)
            yield line.name, line.points.mean(axis=0)
    for joint in shown.joints:
        if joint.name not in seen:
            seen.add(joint.name)
            yield joint.name, joint.at
    for name, points in shown.springs:
        yield name, points.mean(axis=0)
    for name, T in shown.ends:
        yield name, T[:3, 3]
