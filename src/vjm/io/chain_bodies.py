"""A chain as rigid bodies and joints between them, as descriptions of robots have it: a body for each part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from vjm.io.robot import HUGE, Kind
from vjm.model.joint_limits import own_limits
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part, RigidOffset, deflects
from vjm.rotations import Array, translation


@dataclass(frozen=True)
class Follows:
    """``offset + ratio · coordinate of the other``, mm or rad; ``power`` of ten from its unit to the follower's."""

    joint: str
    ratio: float
    offset: float
    power: int


@dataclass(frozen=True)
class ChainBody:
    """A body of a machine and the joint before it.

    Attributes:
        name: of the body; names of bodies differ, and so do names of joints.
        joint: name of the joint.
        kind: how the joint moves.
        parent: body before it; the first body's is the base.
        frame: ``(4, 4)`` of the joint and the body in the parent's, mm.
        axis: ``(3,)``.
        limits: mm or rad.
        follows: what a coupled joint follows.
        part: of the machine, None for a frame at an end.
        mass: kg.
        centre: of mass ``(3,)``, mm in the body's frame.
        rotor: inertia of what is geared to the joint, kg mm² where it turns, kg where it slides.
    """

    name: str
    joint: str
    kind: Kind
    parent: str
    frame: Array
    axis: Array
    limits: tuple[float, float] | None = None
    follows: Follows | None = None
    part: Part | None = None
    mass: float = 0.0
    centre: Array | None = None
    rotor: float = 0.0


def chain_bodies(chain: Machine) -> tuple[str, list[ChainBody]]:
    """The base's name and all bodies, parents before children; beams are rigid."""
    ends = chain.ends or {"tool": chain.parts[-1].name if chain.parts else ""}
    # names of bodies differ, and an end keeps the one by which people know it
    links, names = set(ends), {part.name for part in chain.parts}
    base = _new("base", links)
    joints = {joint.name: joint for joint in chain.moving}
    beams = {beam.name: beam for beam in chain.beams}
    pushing = chain.pushing
    predecessors = chain.predecessors
    frames = {"": (base, chain.base)}
    bodies = []
    for part in chain.parts:
        parent, before = frames[predecessors[part.name]]
        # what pushes a beam out stands still itself, and the beam's end slides in its place
        pushes = part.name in pushing
        pushed = joints.get(part.free_length) if isinstance(part, Beam) else None
        moving = pushed if pushed is not None else None if pushes else joints.get(part.name)
        name = pushed.name if pushed is not None else _new(f"{part.name}-root", names) if pushes else part.name
        child, behind, axis = _new(f"{part.name}-body", links), np.eye(4), np.array([1.0, 0.0, 0.0])
        if isinstance(part, Beam) and pushed is not None:
            axis = part.section_in_chain[:3, 0]
            behind = translation(part.own_frame @ part.end_offset)
        elif moving is not None or pushes:
            axis = joints[part.name].axis
        elif isinstance(part, RigidOffset):
            behind = part.transform
        elif isinstance(part, Beam):
            behind = translation(part.tip)
        mass = part.mass if isinstance(part, RigidOffset | Beam) else 0.0
        bodies.append(
            ChainBody(
                child, name, _kind(moving), parent, before, axis,
                None if moving is None else own_limits(moving, beams) if moving.rides_on else moving.limits,
                _followed(moving, joints), part, mass,
                part.centre_of_mass if mass and isinstance(part, RigidOffset | Beam) else None,
                0.0 if moving is None else moving.rotor,
            )
        )  # fmt: skip
        frames[part.name] = child, behind
    for end, part_name in ends.items():
        parent, before = frames[part_name]
        bodies.append(ChainBody(end, _new(f"{end}-fixed", names), "fixed", parent, before, np.eye(3)[0]))
    return base, bodies


def part_ends(chain: Machine, bodies: Sequence[ChainBody]) -> dict[str, tuple[str, Array]]:
    """By the parts' names, the body that each is, and the frame ``(4, 4)`` in it where the part ends, mm."""
    found = {}
    for body in bodies:
        part, end = body.part, np.eye(4)
        if part is None:
            continue
        if isinstance(part, RigidOffset):
            end = part.transform
        elif isinstance(part, Beam):
            end = translation(part.own_frame @ part.end_offset if body.kind == "slides" else part.tip)
        found[part.name] = body.name, end
    return found


def _new(wanted: str, taken: set[str]) -> str:
    """A name not yet taken, which it is then."""
    name, count = wanted, 1
    while name in taken:
        count += 1
        name = f"{wanted}-{count}"
    taken.add(name)
    return name


def _kind(joint: Joint | None) -> Kind:
    if joint is None:
        return "fixed"
    return "slides" if joint.slides else "turns"


def _followed(joint: Joint | None, joints: Mapping[str, Joint]) -> Follows | None:
    if joint is None or joint.coupling is None or len(joint.coupling.ratios) > 1:
        return None
    name, ratio = joint.coupling.ratios[0]
    return Follows(name, ratio, joint.coupling.offset, 3 * (joints[name].slides - joint.slides))


def elastic_parts(chain: Machine) -> list[str]:
    """Names of the parts that deflect."""
    return [part.name for part in chain.parts if deflects(part)]


def not_rigid(chain: Machine, format_name: str) -> list[str]:
    """What no description of rigid bodies with one inertia each holds of a chain, a line for each kind."""
    lines = []
    sums = [one.name for one in chain.moving if one.coupling is not None and len(one.coupling.ratios) > 1]
    if sums:
        lines.append(f"the coupling of {', '.join(sums)}: a joint of {format_name} follows one other joint")
    if (passive := [joint.name for joint in chain.joints]) and format_name != "MJCF":
        lines.append(f"that {', '.join(passive)} move freely: {format_name} does not tell them from driven joints")
    if chain.laws:
        lines.append(f"the laws of {', '.join(words for words, _ in chain.laws)}: {format_name} has none")
    if chain.point_springs:
        lines.append(f"the springs between points: {', '.join(spring.name for spring in chain.point_springs)}")
    points = [
        part.name
        for part in chain.parts
        if isinstance(part, RigidOffset | Beam) and part.mass > 0.0 and getattr(part, "inertia", None) is None
    ]
    if points:
        lines.append(f"moments of inertia of {', '.join(points)}, which the model does not give: they are zero")
    if chain.couplings:
        named = ", ".join(coupling.name for coupling in chain.couplings)
        lines.append(f"the couplings of passive joints: {named}")
    if format_name == "MJCF":
        return lines
    if rotors := [joint.name for joint in chain.moving if joint.rotor]:
        lines.append(f"the inertia of the rotors of {', '.join(rotors)}: {format_name} has none")
    labels = [*chain.postures, *(label for label in chain.held if label not in chain.postures)]
    if labels:
        lines.append(f"the postures {', '.join(labels)}")
    return lines


def written(value: float, power: int = 0) -> str:
    """A number times ``10**power``, exactly: what reads it back by decimals finds the same number."""
    text = repr(float(value) + 0.0)
    return str(Decimal(text).scaleb(power)) if power else text


def limits_of(body: ChainBody) -> tuple[float, float] | None:
    """Limits as a format takes them that asks for some where a joint slides, mm or rad."""
    return (-HUGE, HUGE) if body.limits is None and body.kind == "slides" else body.limits
