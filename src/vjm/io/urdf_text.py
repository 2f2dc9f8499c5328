"""A chain as a URDF: its rigid geometry, joints, limits and masses. A URDF knows no elasticity: it is left out."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from vjm.io.chain_bodies import ChainBody, chain_bodies, elastic_parts, limits_of, not_rigid, written
from vjm.io.inertia import inertia_values
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset
from vjm.rotations import Array, roll_pitch_yaw


def urdf_text(chain: Machine) -> str:
    """The URDF of a chain, a link for each part; metres and radians.

    Beams are rigid there. A mass without moments of inertia is a point: they are zero. Lengths, limits, masses and
    couplings are written exactly, rotations to 1e-15: `vjm.io.urdf.import_urdf` finds the same machine.

    Example:
        >>> from vjm.io.model_file import load_chain
        >>> urdf_text(load_chain("planar-2r")).splitlines()[1]
        '<robot name="planar-2r">'
    """
    robot = ET.Element("robot", name=chain.name)
    base, bodies = chain_bodies(chain)
    ET.SubElement(robot, "link", name=base)
    for body in bodies:
        _link(robot, body)
        _joint(robot, body)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def left_out(chain: Machine) -> list[str]:
    """What the URDF of a chain does not say, a line for each kind; empty where it says all."""
    elastic = elastic_parts(chain)
    lines = [f"what is elastic in {', '.join(elastic)}: a URDF is rigid"] if elastic else []
    return lines + not_rigid(chain, "a URDF")


def _link(robot: ET.Element, body: ChainBody) -> None:
    link = ET.SubElement(robot, "link", name=body.name)
    if body.mass > 0.0 and body.centre is not None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=_metres(body.centre), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=written(body.mass))
        values = [0.0] * 6
        if isinstance(body.part, RigidOffset) and body.part.inertia is not None:
            values = inertia_values(body.part.inertia)
        named = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), values, strict=True)
        ET.SubElement(inertial, "inertia", {key: written(value, -6) for key, value in named})


def _joint(robot: ET.Element, body: ChainBody) -> None:
    limits = limits_of(body)
    types = {"fixed": "fixed", "slides": "prismatic", "turns": "revolute" if limits else "continuous"}
    joint = ET.SubElement(robot, "joint", name=body.joint, type=types[body.kind])
    _origin(joint, body.frame)
    ET.SubElement(joint, "parent", link=body.parent)
    ET.SubElement(joint, "child", link=body.name)
    if body.kind == "fixed":
        return
    ET.SubElement(joint, "axis", xyz=" ".join(written(v) for v in body.axis))
    power = -3 if body.kind == "slides" else 0
    if limits is not None:
        low, high = (written(v, power) for v in limits)
        ET.SubElement(joint, "limit", lower=low, upper=high, effort="0", velocity="0")
    if (follows := body.follows) is not None:
        ratio, offset = written(follows.ratio, follows.power), written(follows.offset, power)
        ET.SubElement(joint, "mimic", joint=follows.joint, multiplier=ratio, offset=offset)


def _origin(joint: ET.Element, T: Array) -> None:
    angles = roll_pitch_yaw(T[:3, :3])
    ET.SubElement(joint, "origin", xyz=_metres(T[:3, 3]), rpy=" ".join(map(written, angles)))


def _metres(vector: Array) -> str:
    return " ".join(written(v, -3) for v in vector)
