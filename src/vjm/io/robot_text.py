"""A machine as a description of a robot: rigid bodies and joints between them.

It is written as URDF, as MJCF, or as the joints of a serial chain.

A URDF knows no elasticity: it is left out.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from vjm.io.dh_table import DhRow, SerialChain
from vjm.io.errors import did_you_mean
from vjm.io.inertia import PLATE, inertia_values
from vjm.io.robot import HUGE, Kind, new_name
from vjm.model.joint_limits import own_limits
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Part, RigidOffset, deflects, joint_axes
from vjm.rotations import Array, frame, roll_pitch_yaw, translation, unit_quaternion


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


def _chain_bodies(chain: Machine) -> tuple[str, list[ChainBody]]:
    """The base's name and all bodies, parents before children; beams are rigid."""
    ends = chain.ends or {"tool": chain.parts[-1].name if chain.parts else ""}
    # names of bodies differ, and an end keeps the one by which people know it
    links, names = set(ends), {part.name for part in chain.parts}
    base = new_name("base", links)
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
        name = pushed.name if pushed is not None else new_name(f"{part.name}-root", names) if pushes else part.name
        child, behind, axis = new_name(f"{part.name}-body", links), np.eye(4), np.array([1.0, 0.0, 0.0])
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
        bodies.append(ChainBody(end, new_name(f"{end}-fixed", names), "fixed", parent, before, np.eye(3)[0]))
    return base, bodies


def _part_ends(chain: Machine, bodies: Sequence[ChainBody]) -> dict[str, tuple[str, Array]]:
    """By the parts' names, the body that each is, and the frame ``(4, 4)`` in it where the part ends, mm."""
    ends = {}
    for body in bodies:
        part, end = body.part, np.eye(4)
        if part is None:
            continue
        if isinstance(part, RigidOffset):
            end = part.transform
        elif isinstance(part, Beam):
            end = translation(part.own_frame @ part.end_offset if body.kind == "slides" else part.tip)
        ends[part.name] = body.name, end
    return ends


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


def _not_rigid(chain: Machine, format_name: str) -> list[str]:
    """What no description of rigid bodies with one inertia each holds of a chain, a line for each kind."""
    of_mujoco = format_name == "MJCF"
    points = [
        part.name
        for part in chain.parts
        if isinstance(part, RigidOffset | Beam) and part.mass > 0.0 and getattr(part, "inertia", None) is None
    ]
    couplings = {one.name: one.coupling for one in chain.moving if one.coupling is not None}
    several = [name for name, coupling in couplings.items() if len(coupling.ratios) > 1]
    commanded = [name for name, one in couplings.items() if not one.as_deflected and name not in several]
    rows: tuple[tuple[str, list[str], str], ...] = (
        ("the coupling of", several, f": a joint of {format_name} follows one other joint"),
        ("that", commanded,
         f" follow what others are commanded, not how these deflect: {format_name} does not tell the two apart"),
        ("that", [] if of_mujoco else [joint.name for joint in chain.joints],
         f" move freely: {format_name} does not tell them from driven joints"),
        ("the laws of", [name for name, _ in chain.laws], f": {format_name} has none"),
        ("the springs between points:", [spring.name for spring in chain.point_springs], ""),
        ("moments of inertia of", points, ", which the model does not give: they are zero"),
        ("the couplings of passive joints:", [coupling.name for coupling in chain.couplings], ""),
        ("the inertia of the rotors of", [] if of_mujoco else [joint.name for joint in chain.moving if joint.rotor],
         f": {format_name} has none"),
        ("the postures", [] if of_mujoco else list(dict.fromkeys((*chain.postures, *chain.held))), ""),
    )  # fmt: skip
    return [f"{what} {', '.join(names)}{why}" for what, names, why in rows if names]


def written(value: float, power: int = 0) -> str:
    """A number times ``10**power``, exactly: what reads it back by decimals finds the same number."""
    text = repr(float(value) + 0.0)
    return str(Decimal(text).scaleb(power)) if power else text


def serial_chain(machine: Machine, end: str = "") -> SerialChain:
    """The joints between the base and an end, and the frames that lie between them; beams are rigid.

    Args:
        machine: without closed loops.
        end: name of an end frame; empty for the end behind the last part.

    Raises:
        ValueError: it has closed loops, no such end, or no joint on the way.

    Example:
        >>> from vjm.io.model_file import load_chain
        >>> [joint.name for joint in serial_chain(load_chain("planar-2r")).joints]
        ['shoulder', 'elbow']
    """
    if machine.closures:
        names = ", ".join(closure.name for closure in machine.closures)
        raise ValueError(f"the closures {names} close loops, and a table of joints is one row behind another")
    if end and end not in machine.ends:
        known = ", ".join(machine.ends) or "none"
        raise ValueError(f"no end '{end}'{did_you_mean(end, machine.ends) or f'; there are {known}'}")
    base, bodies = _chain_bodies(machine)
    by_name = {body.name: body for body in bodies}
    behind = machine.ends[end] if end else machine.parts[-1].name
    body_name, step = _part_ends(machine, bodies)[behind]
    joints, steps = list[DhRow](), list[np.ndarray]()
    while body_name != base:
        body = by_name[body_name]
        if body.kind != "fixed":
            # the joint's frame, turned so that its axis is z
            Q = frame(joint_axes(body.axis), np.zeros(3))
            joints.append(DhRow(body.joint, body.kind == "slides", limits=body.limits))
            steps.append(Q.T @ step)
            step = Q
        step, body_name = body.frame @ step, body.parent
    if not joints:
        raise ValueError(f"no joint moves on the way to its end {end}".rstrip())
    return SerialChain(machine.name, tuple(joints[::-1]), (step, *steps[::-1]))


def not_in_table(machine: Machine, chain: SerialChain) -> list[str]:
    """What a table of joints does not hold of a machine, a line for each kind."""
    on_way = {joint.name for joint in chain.joints}
    own = [joint for joint in machine.moving if joint.name in on_way]
    ends = [name for name in machine.ends if machine.ends[name] != machine.parts[-1].name]
    kinds = (
        ("joints that are not on the way to the end:", [j.name for j in machine.moving if j.name not in on_way]),
        ("the other ends", ends if len(machine.ends) > 1 else []),
        ("what is elastic in", elastic_parts(machine)),
        ("masses of", [p.name for p in machine.parts if isinstance(p, RigidOffset | Beam) and p.mass > 0.0]),
        ("the inertia of the rotors of", [joint.name for joint in machine.moving if joint.rotor]),
        ("that these joints follow others:", [joint.name for joint in own if joint.coupling is not None]),
        ("that these joints have no drive:", [joint.name for joint in own if joint.passive]),
        ("the springs between points", [spring.name for spring in machine.point_springs]),
        ("the couplings of passive joints", [coupling.name for coupling in machine.couplings]),
        ("the postures", list(dict.fromkeys((*machine.postures, *machine.held)))),
    )
    return [f"{what} {', '.join(names)}" for what, names in kinds if names]


def urdf_text(chain: Machine) -> str:
    """The URDF of a chain, a link for each part; metres and radians.

    Beams are rigid there. A mass without moments of inertia is a point: they are zero. Lengths, limits, masses and
    couplings are written exactly, rotations to 1e-15: `vjm.io.robot_file.import_robot` finds the same machine.

    Example:
        >>> from vjm.io.model_file import load_chain
        >>> urdf_text(load_chain("planar-2r")).splitlines()[1]
        '<robot name="planar-2r">'
    """
    robot = ET.Element("robot", name=chain.name)
    base, bodies = _chain_bodies(chain)
    ET.SubElement(robot, "link", name=base)
    for body in bodies:
        _link(robot, body)
        _urdf_joint(robot, body)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def urdf_leaves_out(chain: Machine) -> list[str]:
    """What the URDF of a chain does not say, a line for each kind; empty where it says all."""
    elastic = elastic_parts(chain)
    lines = [f"what is elastic in {', '.join(elastic)}: a URDF is rigid"] if elastic else []
    return lines + _not_rigid(chain, "a URDF")


def _link(robot: ET.Element, body: ChainBody) -> None:
    link = ET.SubElement(robot, "link", name=body.name)
    if body.mass > 0.0 and body.centre is not None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=_words(body.centre, -3), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=written(body.mass))
        values = [0.0] * 6
        if isinstance(body.part, RigidOffset) and body.part.inertia is not None:
            values = inertia_values(body.part.inertia)
        named = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), values, strict=True)
        ET.SubElement(inertial, "inertia", {key: written(value, -6) for key, value in named})


def _urdf_joint(robot: ET.Element, body: ChainBody) -> None:
    # the format asks for some where a joint slides
    limits = (-HUGE, HUGE) if body.limits is None and body.kind == "slides" else body.limits
    types = {"fixed": "fixed", "slides": "prismatic", "turns": "revolute" if limits else "continuous"}
    joint = ET.SubElement(robot, "joint", name=body.joint, type=types[body.kind])
    angles = roll_pitch_yaw(body.frame[:3, :3])
    ET.SubElement(joint, "origin", xyz=_words(body.frame[:3, 3], -3), rpy=_words(angles))
    ET.SubElement(joint, "parent", link=body.parent)
    ET.SubElement(joint, "child", link=body.name)
    if body.kind == "fixed":
        return
    ET.SubElement(joint, "axis", xyz=_words(body.axis))
    power = -3 if body.kind == "slides" else 0
    if limits is not None:
        low, high = (written(v, power) for v in limits)
        ET.SubElement(joint, "limit", lower=low, upper=high, effort="0", velocity="0")
    if (follows := body.follows) is not None:
        ratio, offset = written(follows.ratio, follows.power), written(follows.offset, power)
        ET.SubElement(joint, "mimic", joint=follows.joint, multiplier=ratio, offset=offset)


LEAST = "1e-09"
"""kg and kg m², a gram at a millimetre: MuJoCo takes no moving body without mass or inertia."""


def mjcf_text(chain: Machine) -> str:
    """The MJCF file of a chain, a body for each part; metres, kilograms, newtons, radians.

    A drive that is elastic about or along its own axis alone, and a sprung joint, have their ``stiffness`` there;
    the spring is free of stress in the machine's first posture, or at its rest.

    Example:
        >>> from vjm.io.model_file import load_chain
        >>> mjcf_text(load_chain("planar-2r")).splitlines()[0]
        '<mujoco model="planar-2r">'
    """
    mujoco = ET.Element("mujoco", model=chain.name)
    ET.SubElement(mujoco, "compiler", angle="radian", autolimits="true")
    base, bodies = _chain_bodies(chain)
    massless = _massless(bodies)
    elements = {base: ET.SubElement(mujoco, "worldbody")}
    equality = ET.Element("equality")
    # coordinates in the first posture, mm or rad
    standing = dict(next(iter(chain.held.values()), {}))
    for body in bodies:
        element = ET.SubElement(elements[body.parent], "body", {"name": body.name} | _pose(body.frame))
        elements[body.name] = element
        if body.mass > 0.0 and body.centre is not None:
            moments = _moments(body.part)
            _inertial(element, _words(body.centre, -3), written(body.mass), moments)
        elif body.name in massless:
            _inertial(element, "0 0 0", LEAST, None)
        if body.kind != "fixed":
            _mjcf_joint(element, equality, body, standing.get(body.joint, 0.0))
    _close(chain, bodies, elements, equality)
    if len(equality):
        mujoco.append(equality)
    if driven := [joint for joint in chain.held_joints if not joint.passive]:
        # a joint with a spring, or in a loop, that has no actuator is passive
        drives = ET.SubElement(mujoco, "actuator")
        for joint in driven:
            ET.SubElement(drives, "motor", name=f"{joint.name}-drive", joint=joint.name)
    if chain.postures:
        keys = ET.SubElement(mujoco, "keyframe")
        order = [str(joint.get("name")) for joint in elements[base].iter("joint")]
        slides = {joint.name: joint.slides for joint in chain.moving}
        for label in chain.postures:
            values = _coordinates(chain, label)
            qpos = " ".join(written(values[name], -3 if slides[name] else 0) for name in order)
            ET.SubElement(keys, "key", name=label, qpos=qpos)
    ET.indent(mujoco)
    return ET.tostring(mujoco, encoding="unicode") + "\n"


def mjcf_leaves_out(chain: Machine) -> list[str]:
    """What the MJCF file of a chain does not say, a line for each kind; empty where it says all."""
    lines = []
    held = [part.name for part in chain.parts if _stiffness(part) is not None]
    own = ": a joint of MJCF has a spring about its own axis only"
    # of a joint with a law alone its law is told as left out
    laws = [p.name for p in chain.moving if p.law is not None and p.matrix is None and not any(p.lateral)]
    if rigid := [name for name in elastic_parts(chain) if name not in (*held, *laws)]:
        lines.append(f"what is elastic in {', '.join(rigid)}{own}")
    if across := [part.name for part in chain.moving if part.name in held and part.bearings]:
        lines.append(f"what is elastic across the axes of {', '.join(across)}{own}")
    if held:
        label = next(iter(chain.held), None)
        where = f"in the posture '{label}'" if label else "at zero"
        lines.append(f"where the springs of {', '.join(held)} are free of stress in other postures: {where}")
    lines += _not_rigid(chain, "MJCF")
    given = [part for part in chain.parts if isinstance(part, RigidOffset) and part.inertia is not None]
    if odd := [part.name for part in given if _moments(part) is None]:
        lines.append(f"moments of inertia of {', '.join(odd)}, which no body has: they are {LEAST} kg m²")
    if massless := _massless(_chain_bodies(chain)[1]):
        lines.append(f"that {', '.join(massless)} have no mass: MuJoCo takes no zero, and has {LEAST} kg there")
    return lines


def _massless(bodies: list[ChainBody]) -> list[str]:
    """Moving bodies that have no mass, and none fixed to them."""
    carrier: dict[str, str] = {}
    for body in bodies:
        carrier[body.name] = carrier.get(body.parent, "") if body.kind == "fixed" else body.name
    heavy = {carrier[body.name] for body in bodies if body.mass > 0.0}
    return [body.name for body in bodies if body.kind != "fixed" and body.name not in heavy]


def _moments(part: object) -> list[float] | None:
    """``ixx, iyy, izz, ixy, ixz, iyz`` of a part, kg mm²; None where it gives none that MuJoCo takes."""
    if not isinstance(part, RigidOffset) or part.inertia is None:
        return None
    least, middle, most = np.linalg.eigvalsh(part.inertia)
    # MuJoCo bears no rounding where the largest is the sum of the others, as of a plate: all are raised by it
    lacking = max(0.0, PLATE * most - (least + middle - most))
    if least <= 1e6 * float(LEAST) or lacking > 2.0 * PLATE * most:
        return None
    return inertia_values(part.inertia + lacking * np.eye(3))


def _inertial(element: ET.Element, place: str, mass: str, moments: list[float] | None) -> None:
    if moments is None:
        ET.SubElement(element, "inertial", pos=place, mass=mass, diaginertia=" ".join([LEAST] * 3))
        return
    ET.SubElement(element, "inertial", pos=place, mass=mass, fullinertia=_words(moments, -6))


def _stiffness(part: object) -> float | None:
    """About or along the joint's own axis, N mm/rad or N/mm; None where the joint has no such spring."""
    if not isinstance(part, Joint) or not part.held or part.coupling is not None or not part.compliance:
        return None
    return part.stiffness if part.passive else 1.0 / part.compliance


def _mjcf_joint(element: ET.Element, equality: ET.Element, body: ChainBody, standing: float) -> None:
    slides = body.kind == "slides"
    power = -3 if slides else 0
    joint = ET.SubElement(
        element, "joint", name=body.joint, type="slide" if slides else "hinge",
        axis=_words(body.axis),
    )  # fmt: skip
    if body.limits is not None:
        joint.set("range", _words(body.limits, power))
    if body.rotor:
        # kg mm² are 1e-6 kg m²; of a joint that slides it is a mass
        joint.set("armature", written(body.rotor, 0 if slides else -6))
    stiffness = _stiffness(body.part)
    if stiffness is not None:
        # N/mm are 1e3 N/m, N mm/rad 1e-3 N m/rad
        joint.set("stiffness", written(stiffness, 3 if slides else -3))
        free = standing
        if isinstance(body.part, Joint) and body.part.passive:
            free = body.part.rest if body.part.rest is not None else standing + body.part.stretch
        joint.set("springref", written(free, power))
    if (follows := body.follows) is not None:
        ratio, offset = written(follows.ratio, follows.power), written(follows.offset, power)
        ET.SubElement(
            equality, "joint", joint1=body.joint, joint2=follows.joint, polycoef=f"{offset} {ratio} 0 0 0"
        )


def _coordinates(chain: Machine, label: str) -> dict[str, float]:
    """Coordinates of all joints in a posture, mm or rad."""
    passive = dict(zip((joint.name for joint in chain.joints), chain.posture(label).tolist(), strict=True))
    coupled = {part.name: part.value for part in chain.at(label).moving if part.coupling is not None}
    return passive | dict(chain.held.get(label, {})) | coupled


def _close(chain: Machine, bodies: list[ChainBody], elements: dict[str, ET.Element], equality: ET.Element) -> None:
    """Sites at the frames that closures hold, and the equalities that hold them."""
    # where each part ends, in the body that it is: of a rigid one what comes behind it stands there
    ends = {"": (next(iter(elements)), np.eye(4))} | _part_ends(chain, bodies)
    for closure in chain.closures:
        names = []
        for k, (part, at_part) in enumerate(zip(closure.parts, closure.frames, strict=True), start=1):
            body, end = ends[part]
            names.append(f"{closure.name}-{k}")
            ET.SubElement(elements[body], "site", {"name": names[-1]} | _pose(end @ at_part))
        kind = "connect" if closure.turns else "weld"
        ET.SubElement(equality, kind, name=closure.name, site1=names[0], site2=names[1])


def _pose(T: Array) -> dict[str, str]:
    """Of a frame ``(4, 4)``, mm; a quaternion of MuJoCo has its scalar first."""
    return {"pos": _words(T[:3, 3], -3), "quat": _words(unit_quaternion(T[:3, :3]))}


def _words(numbers: Iterable[float], power: int = 0) -> str:
    return " ".join(written(number, power) for number in numbers)
