"""A machine as an MJCF file, MuJoCo's format: geometry, joints, limits, masses, springs, loops, and postures.

Written after MuJoCo's XML reference.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from vjm.io.chain_bodies import ChainBody, chain_bodies, elastic_parts, not_rigid, part_ends, written
from vjm.io.inertia import PLATE, inertia_values
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset
from vjm.rotations import Array

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
    base, bodies = chain_bodies(chain)
    massless = _massless(bodies)
    elements = {base: ET.SubElement(mujoco, "worldbody")}
    equality = ET.Element("equality")
    standing = _standing(chain)
    for body in bodies:
        element = ET.SubElement(elements[body.parent], "body", name=body.name)
        elements[body.name] = element
        # a quaternion of MuJoCo has its scalar first
        x, y, z, w = Rotation.from_matrix(body.frame[:3, :3]).as_quat()
        element.set("pos", _metres(body.frame[:3, 3]))
        element.set("quat", " ".join(written(v) for v in (w, x, y, z)))
        if body.mass > 0.0 and body.centre is not None:
            moments = _moments(body.part)
            _inertial(element, _metres(body.centre), written(body.mass), moments)
        elif body.name in massless:
            _inertial(element, "0 0 0", LEAST, None)
        if body.kind != "fixed":
            _joint(element, equality, body, standing.get(body.joint, 0.0))
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


def left_out(chain: Machine) -> list[str]:
    """What the MJCF file of a chain does not say, a line for each kind; empty where it says all."""
    lines = []
    held = [part.name for part in chain.parts if _stiffness(part) is not None]
    if rigid := [name for name in elastic_parts(chain) if name not in held]:
        lines.append(f"what is elastic in {', '.join(rigid)}: a joint of MJCF has a spring about its own axis only")
    if held:
        label = next(iter(chain.held), None)
        where = f"in the posture '{label}'" if label else "at zero"
        lines.append(f"where the springs of {', '.join(held)} are free of stress in other postures: {where}")
    lines += not_rigid(chain, "MJCF")
    given = [part for part in chain.parts if isinstance(part, RigidOffset) and part.inertia is not None]
    if odd := [part.name for part in given if _moments(part) is None]:
        lines.append(f"moments of inertia of {', '.join(odd)}, which no body has: they are {LEAST} kg m²")
    if massless := _massless(chain_bodies(chain)[1]):
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
    full = " ".join(written(value, -6) for value in moments)
    ET.SubElement(element, "inertial", pos=place, mass=mass, fullinertia=full)


def _standing(chain: Machine) -> dict[str, float]:
    """Coordinates in the first posture, mm or rad."""
    return dict(next(iter(chain.held.values()), {}))


def _stiffness(part: object) -> float | None:
    """About or along the joint's own axis, N mm/rad or N/mm; None where the joint has no such spring alone."""
    if not isinstance(part, Joint) or not part.held or part.coupling is not None:
        return None
    if part.bearings or not part.compliance:
        return None
    return part.stiffness if part.passive else 1.0 / part.compliance


def _joint(element: ET.Element, equality: ET.Element, body: ChainBody, standing: float) -> None:
    slides = body.kind == "slides"
    power = -3 if slides else 0
    joint = ET.SubElement(
        element, "joint", name=body.joint, type="slide" if slides else "hinge",
        axis=" ".join(written(v) for v in body.axis),
    )  # fmt: skip
    if body.limits is not None:
        joint.set("range", " ".join(written(v, power) for v in body.limits))
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
    ends = {"": (next(iter(elements)), np.eye(4))} | part_ends(chain, bodies)
    for closure in chain.closures:
        names = []
        for k, (part, frame) in enumerate(zip(closure.parts, closure.frames, strict=True), start=1):
            body, end = ends[part]
            T = end @ frame
            x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
            names.append(f"{closure.name}-{k}")
            ET.SubElement(
                elements[body], "site", name=names[-1], pos=_metres(T[:3, 3]),
                quat=" ".join(written(v) for v in (w, x, y, z)),
            )  # fmt: skip
        kind = "connect" if closure.turns else "weld"
        ET.SubElement(equality, kind, name=closure.name, site1=names[0], site2=names[1])


def _metres(vector: Array) -> str:
    return " ".join(written(v, -3) for v in np.asarray(vector))
