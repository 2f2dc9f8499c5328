"""A chain as a URDF: its rigid geometry, joints, limits and masses. A URDF knows no elasticity: it is left out."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping

from vjm.model.chain import Chain
from vjm.model.joints import CoupledJoint, HeldJoint
from vjm.model.parts import Beam, PassiveJoint, RigidOffset, deflects
from vjm.rotations import Array, translation

METRE = 1000.0
WIDEST = 2.0 * math.pi
"""rad: limits of a joint that has none."""


def urdf_text(chain: Chain) -> str:
    """The URDF of a chain, a link for each part; metres and radians.

    Beams are rigid there. Where a mass is a point, its inertia is left at zero.
    """
    robot = ET.Element("robot", name=chain.name)
    ends = chain.ends or {"tool": chain.parts[-1].name if chain.parts else ""}
    # names of links differ, and an end keeps the one by which people know it
    base = "base" if "base" not in ends else "base-link"
    ET.SubElement(robot, "link", name=base)
    joints = {part.name: part for part in chain.parts if isinstance(part, HeldJoint)}
    pushing = chain.pushing
    previous = ""
    frames = {"": (base, chain.base)}
    for part in chain.parts:
        link, before = frames[chain.after.get(part.name, previous)]
        previous = part.name
        child = f"{part.name}-body"
        _link(robot, child, part)
        # what pushes a beam out stands still itself, and the beam's end slides in its place
        pushes = part.name in pushing
        pushed = joints.get(part.free_length) if isinstance(part, Beam) else None
        name = pushed.name if pushed is not None else f"{part.name}-root" if pushes else part.name
        kind = "fixed" if pushes else _type(part if pushed is None else pushed)
        joint = ET.SubElement(robot, "joint", name=name, type=kind)
        _origin(joint, before)
        ET.SubElement(joint, "parent", link=link)
        ET.SubElement(joint, "child", link=child)
        behind = translation([0.0, 0.0, 0.0])
        if isinstance(part, Beam) and pushed is not None:
            ET.SubElement(joint, "axis", xyz=_numbers(part.section_in_chain[:3, 0]))
            _limits(joint, pushed, joints)
            behind = translation(part.own_frame @ part.end_offset)
        elif isinstance(part, HeldJoint | PassiveJoint) and not pushes:
            ET.SubElement(joint, "axis", xyz=_numbers(part.axis))
            _limits(joint, part, joints)
        elif isinstance(part, RigidOffset):
            behind = part.transform
        elif isinstance(part, Beam):
            behind = translation(part.tip)
        frames[part.name] = child, behind
    for end, name in ends.items():
        link, before = frames[name]
        ET.SubElement(robot, "link", name=end)
        joint = ET.SubElement(robot, "joint", name=f"{end}-fixed", type="fixed")
        _origin(joint, before)
        ET.SubElement(joint, "parent", link=link)
        ET.SubElement(joint, "child", link=end)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def left_out(chain: Chain) -> list[str]:
    """What the URDF of a chain does not say, a line for each kind; empty where it says all."""
    lines = []
    if elastic := [part.name for part in chain.parts if deflects(part)]:
        lines.append(f"what is elastic in {', '.join(elastic)}: a URDF is rigid")
    sums = [part.name for part in chain.parts if isinstance(part, CoupledJoint) and len(part.ratios) > 1]
    if sums:
        lines.append(f"the coupling of {', '.join(sums)}: a URDF's joint mimics one other joint")
    if chain.point_springs:
        lines.append(f"the springs between points: {', '.join(spring.name for spring in chain.point_springs)}")
    if any(part.mass > 0.0 for part in chain.parts if isinstance(part, RigidOffset | Beam)):
        lines.append("moments of inertia, which a model file does not have: they are zero")
    labels = [*chain.postures, *(label for label in chain.held if label not in chain.postures)]
    if labels:
        lines.append(f"the postures {', '.join(labels)}")
    return lines


def _type(part: object) -> str:
    if not isinstance(part, HeldJoint | PassiveJoint):
        return "fixed"
    return "prismatic" if part.slides else "revolute"


def _link(robot: ET.Element, name: str, part: object) -> None:
    link = ET.SubElement(robot, "link", name=name)
    mass, centre = 0.0, None
    if isinstance(part, RigidOffset | Beam):
        mass, centre = part.mass, part.centre_of_mass
    if mass > 0.0 and centre is not None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=_numbers(centre / METRE), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=repr(float(mass)))
        ET.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0"))


def _limits(joint: ET.Element, part: HeldJoint | PassiveJoint, joints: Mapping[str, HeldJoint]) -> None:
    unit = METRE if part.slides else 1.0
    limits = part.limits if isinstance(part, HeldJoint) else None
    low, high = limits or (-WIDEST * unit, WIDEST * unit)
    ET.SubElement(joint, "limit", lower=repr(low / unit), upper=repr(high / unit), effort="0", velocity="0")
    if isinstance(part, CoupledJoint):
        name, ratio = part.ratios[0]
        if len(part.ratios) == 1:
            ratio *= (METRE if joints[name].slides else 1.0) / unit
            ET.SubElement(joint, "mimic", joint=name, multiplier=repr(ratio), offset=repr(part.offset / unit))


def _origin(joint: ET.Element, T: Array) -> None:
    R = T[:3, :3]
    # near a pitch of a quarter turn the yaw is anything; the roll that goes with it is not
    pitch, yaw = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0])), math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    ET.SubElement(
        joint, "origin", xyz=_numbers(T[:3, 3] / METRE), rpy=" ".join(repr(float(v)) for v in (roll, pitch, yaw))
    )


def _numbers(vector: Array) -> str:
    return " ".join(repr(float(v) + 0.0) for v in vector)
