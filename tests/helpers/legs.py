"""Legs that a test writes as chains, joined to a machine between a base and a platform."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.machine.rigid_mechanism import closed
from vjm.model.machine import ATTACHMENT, BASE, HOME, PLATFORM, ROOT, Machine, named
from vjm.model.parts import Closure, Joint, Part, RigidOffset
from vjm.rotations import Array, inverse_frame


@dataclass(frozen=True)
class Leg:
    """A chain between two bodies; its drive moves all from a part on."""

    name: str
    chain: Machine
    start: str = BASE
    end: str = PLATFORM
    root: Array = field(default_factory=lambda: np.eye(4))
    attachment: Array = field(default_factory=lambda: np.eye(4))
    drive: Joint | None = None
    before: str = ""
    posture: Sequence[float] = ()


def joined(name: str, legs: Sequence[Leg], poses: Mapping[str, Array] = {}, home: Array | None = None) -> Machine:
    """The machine, closed at home and in poses, the platform's frame at home being given."""
    parts: list[Part] = []
    after, carriers, closures = dict[str, str](), {BASE: ""}, list[Closure]()
    values: dict[str, float] = {}
    for leg in legs:
        root = RigidOffset(named(leg.name, ROOT), leg.root @ leg.chain.base)
        after[root.name] = carriers[leg.start]
        parts.append(root)
        for part in leg.chain.parts:
            if leg.drive is not None and part.name == leg.before:
                parts.append(replace(leg.drive, name=leg.name))
            parts.append(replace(part, name=named(leg.name, part.name)))
        values |= {named(leg.name, j.name): v for j, v in zip(leg.chain.joints, leg.posture, strict=True)}
        if leg.end in carriers:
            frames = np.array([np.eye(4), leg.attachment])
            closures.append(Closure(leg.name, (parts[-1].name, carriers[leg.end]), frames))
        else:
            carriers[leg.end] = named(leg.name, ATTACHMENT)
            parts.append(RigidOffset(carriers[leg.end], inverse_frame(leg.attachment)))
    after[PLATFORM] = carriers[PLATFORM]
    parts.append(RigidOffset(PLATFORM, np.eye(4)))
    label = next((label for label, pose in poses.items() if not np.any(pose)), HOME)
    passive = [part.name for part in parts if isinstance(part, Joint) and part.free]
    machine = Machine(
        name, tuple(parts), postures={label: np.array([values[joint] for joint in passive])},
        held={label: {leg.name: 0.0 for leg in legs if leg.drive is not None}}, after=after,
        closures=tuple(closures), poses={label: np.zeros(6), **poses},
    )  # fmt: skip
    return closed(machine, home)


def leg_alone(machine: Machine, name: str) -> tuple[Machine, Array]:
    """A leg as a chain of its own, its drive held, and the frame ``(4, 4)`` of its end in the platform."""
    own = [
        part
        for part in machine.parts
        if part.name == name or (part.name.startswith(f"{name}/") and part.name != named(name, ATTACHMENT))
    ]
    joints = [joint.name for joint in machine.joints]
    rows = [joints.index(part.name) for part in own if isinstance(part, Joint) and part.free]
    drives = [part.name for part in own if isinstance(part, Joint) and part.held]
    carried = next((part for part in machine.parts if part.name == named(name, ATTACHMENT)), None)
    if carried is None:
        attachment = next(closure for closure in machine.closures if closure.name == name).frames[1]
    else:
        assert isinstance(carried, RigidOffset)
        attachment = inverse_frame(carried.transform)
    chain = Machine(
        name, tuple(own), base=machine.base, link_segments=machine.link_segments,
        postures={label: q[rows] for label, q in machine.postures.items()},
        held={label: {drive: values[drive] for drive in drives} for label, values in machine.held.items()},
    )  # fmt: skip
    return chain, attachment
