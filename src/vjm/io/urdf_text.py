"""A chain as a URDF: its rigid geometry, joints, limits and masses. A URDF knows no elasticity: it is left out."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from vjm.model.chain import Chain
from vjm.model.joints import CoupledJoint, HeldJoint
from vjm.model.parts import Beam, PassiveJoint, RigidOffset
from vjm.rotations import Array, translation

METRE = 1000.0
WIDEST = 2.0 * math.pi
"""rad: limits of a joint that has none."""


def urdf_text(chain: Chain) -> str:
    """The URDF of a chain, a link for each part; metres and radians.

    Beams are rigid there. Where a mass is a point, its inertia is left at zero.
    """
    robot = ET.Element("robot", name=chain.name)
    ET.SubElement(robot, "link", name="base")
    previous = ""
    frames = {"": ("base", chain.base)}
    for part in chain.parts:
        link, before = frames[chain.after.get(part.name, previous)]
        previous = part.name
        child = f"{part.name}-body"
        _link(robot, child, part)
        joint = ET.SubElement(robot, "joint", name=part.name, type=_type(part))
        _origin(joint, before)
        ET.SubElement(joint, "parent", link=link)
        ET.SubElement(joint, "child", link=child)
        behind = translation([0.0, 0.0, 0.0])
        if isinstance(part, HeldJoint | PassiveJoint):
            ET.SubElement(joint, "axis", xyz=_numbers(part.axis))
            _limits(joint, part)
        elif isinstance(part, RigidOffset):
            behind = part.transform
        elif isinstance(part, Beam):
            behind = translation(part.tip)
        frames[part.name] = child, behind
    for end, name in (chain.ends or {"tool": previous}).items():
        link, before = frames[name]
        ET.SubElement(robot, "link", name=end)
        joint = ET.SubElement(robot, "joint", name=f"{end}-fixed", type="fixed")
        _origin(joint, before)
        ET.SubElement(joint, "parent", link=link)
        ET.SubElement(joint, "child", link=end)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _type(part: object) -> str:
    if not isinstance(part, HeldJoint | PassiveJoint):
        return "fixed"
    return "prismatic" if part.slides else "revolute"


def _link(robot: ET.Element, name: str, part: object) -> None:
    link = ET.SubElement(robot, "link", name=name)
    mass, centre = 0.0, None
    if isinstance(part, RigidOffset):
        mass, centre = part.mass, part.centre_of_mass
    elif isinstance(part, Beam):
        mass, centre = part.mass, 0.5 * part.tip
    if mass > 0.0 and centre is not None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=_numbers(centre / METRE), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=repr(float(mass)))
        ET.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0"))


def _limits(joint: ET.Element, part: HeldJoint | PassiveJoint) -> None:
    unit = METRE if part.slides else 1.0
    limits = part.limits if isinstance(part, HeldJoint) else None
    low, high = limits or (-WIDEST * unit, WIDEST * unit)
    ET.SubElement(joint, "limit", lower=repr(low / unit), upper=repr(high / unit), effort="0", velocity="0")
    if isinstance(part, CoupledJoint):
        name, ratio = part.ratios[0]
        if len(part.ratios) == 1:
            ET.SubElement(joint, "mimic", joint=name, multiplier=repr(ratio), offset=repr(part.offset / unit))


def _origin(joint: ET.Element, T: Array) -> None:
    R = T[:3, :3]
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    if math.hypot(R[0, 0], R[1, 0]) > 1e-12:
        roll, yaw = math.atan2(R[2, 1], R[2, 2]), math.atan2(R[1, 0], R[0, 0])
    else:
        roll, yaw = math.atan2(-R[1, 2], R[1, 1]), 0.0
    ET.SubElement(
        joint, "origin", xyz=_numbers(T[:3, 3] / METRE), rpy=" ".join(repr(float(v)) for v in (roll, pitch, yaw))
    )


def _numbers(vector: Array) -> str:
    return " ".join(repr(float(v) + 0.0) for v in vector)
