"""A manipulator of legs as one machine: a tree of parts, its loops held together by closures.

The first leg that ends on a body carries it; every further one is held to it. What carries the platform is the last
part, so that the end-effector is the platform's reference point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from vjm.model.chain import FOOT, Chain
from vjm.model.closures import Closure, Coupling
from vjm.model.joints import ActuatedJoint, CoupledJoint, PointSpring
from vjm.model.parts import Beam, Part, RigidOffset
from vjm.platform.closure import RigidPose
from vjm.platform.manipulator import BASE, PLATFORM, Leg, Manipulator
from vjm.platform.rigid import home_pose, inverse_kinematics
from vjm.rotations import inverse_frame

HOME = "home"
"""Label of the posture in which a machine is drawn, where its file gives it no other."""
ROOT, ATTACHMENT = "root", "attachment"
"""Rigid parts before a leg's first part and behind its last one."""


def machine_of(manipulator: Manipulator) -> Chain:
    """The machine that a manipulator is, in the poses that it has.

    Args:
        manipulator: legs on a platform. What is wrong with it, beams of another length and drives that are off, is
            in the parts and in the held coordinates; so the loops then have gaps in its poses.

    Returns:
        Its parts are named ``leg/part``, a drive by the leg's name, the last part ``platform``.

    Raises:
        PoseError: the rigid manipulator cannot take one of its poses.
        ValueError: names of parts are not unique.

    Example:
        >>> import vjm
        >>> machine = machine_of(vjm.load("parallelogram"))
        >>> [part.name for part in machine.parts][:3], machine.closures[0].name
        (['bar-1/root', 'bar-1/near', 'bar-1/bar'], 'bar-2')
    """
    home = home_pose(manipulator)
    parts: list[Part] = []
    after: dict[str, str] = {}
    carriers: dict[str, str] = {BASE: ""}
    closures: list[Closure] = []
    springs: list[PointSpring] = []
    ends: dict[str, str] = {}
    shared = {leg.chain.link_segments for leg in manipulator.legs}
    link_segments = shared.pop() if len(shared) == 1 else None
    for leg in manipulator.legs:
        made = _parts(leg, manipulator.errors.get(leg.name, {}), own_numbers=link_segments is None)
        parts += made
        after[made[0].name] = carriers[leg.start]
        after |= {_named(leg, part): _behind(leg, where) for part, where in leg.chain.after.items()}
        springs += [_spring(leg, spring) for spring in leg.chain.point_springs]
        ends |= {_named(leg, end): _behind(leg, where) for end, where in leg.chain.ends.items()}
        if leg.end not in carriers:
            carriers[leg.end] = _named(leg, ATTACHMENT)
            parts.append(RigidOffset(carriers[leg.end], inverse_frame(leg.attachment)))
        else:
            frames = np.array([np.eye(4), leg.attachment])
            closures.append(Closure(leg.name, (made[-1].name, carriers[leg.end]), frames))
    parts.append(RigidOffset(PLATFORM))
    after[PLATFORM] = carriers[PLATFORM]
    poses = {label: home if not np.any(d) else inverse_kinematics(manipulator, d, home)
             for label, d in manipulator.poses.items()}  # fmt: skip
    if not any(pose is home for pose in poses.values()):
        poses = {HOME: home} | poses
    return Chain(
        name=manipulator.name,
        parts=tuple(parts),
        postures={label: np.concatenate(pose.q) for label, pose in poses.items()},
        title=manipulator.title,
        source=manipulator.source,
        sha256=manipulator.sha256,
        link_segments=link_segments,
        held={label: _held(manipulator, pose) for label, pose in poses.items()},
        after=after,
        point_springs=tuple(springs),
        ends=ends,
        closures=tuple(closures),
        couplings=tuple(_coupling(manipulator, coupling.name, home) for coupling in manipulator.couplings),
    )


def _named(leg: Leg, part: str) -> str:
    return f"{leg.name}/{part}"


def _behind(leg: Leg, part: str) -> str:
    """The part of a leg behind which another begins; an empty one is the leg's root."""
    return _named(leg, part or ROOT)


def _parts(leg: Leg, too_long: Mapping[str, float], *, own_numbers: bool) -> list[Part]:
    """The parts of a leg, its root first and the joint of its drive among them.

    Args:
        leg: of the manipulator.
        too_long: by how many mm a beam was built too long, by its name.
        own_numbers: whether the beams keep the numbers of springs that their own file asks for.
    """
    taken = next((part.name for part in leg.chain.parts if part.name in (ROOT, ATTACHMENT)), None)
    if taken is not None:
        raise ValueError(
            f"leg '{leg.name}': '{taken}' is the name of what holds a leg: rename that part of its chain"
        )
    drive = leg.drive
    joint: list[Part] = []
    if drive is not None:
        limits = drive.limits if np.any(np.isfinite(drive.limits)) else None
        joint.append(ActuatedJoint(leg.name, drive.axis, drive.slides, limits=limits))
    numbers = _numbers(leg.chain, own=own_numbers)
    result: list[Part] = [RigidOffset(_named(leg, ROOT), leg.root @ leg.chain.base)]
    for part in leg.chain.parts:
        made = replace(part, name=_named(leg, part.name))
        if isinstance(part, Beam) and isinstance(made, Beam):
            free = _named(leg, part.free_length) if part.free_length else ""
            length = part.length + too_long.get(part.name, 0.0)
            made = replace(made, length=length, free_length=free, own_segments=numbers.get(part.name))
        if isinstance(part, CoupledJoint) and isinstance(made, CoupledJoint):
            made = replace(made, ratios=tuple((_named(leg, name), ratio) for name, ratio in part.ratios))
        if drive is None or part.name != drive.part:
            result.append(made)
        elif isinstance(part, RigidOffset) and not np.array_equal(part.transform, np.eye(4)):
            # the drive acts where the rigid part ends
            result += [made, *joint]
        else:
            result += [*joint, made]
    return result


def _numbers(chain: Chain, *, own: bool) -> dict[str, int | None]:
    """Springs that each beam has by itself, by its name, where a machine cannot say it for all."""
    numbers = {beam.name: beam.own_segments for beam in chain.beams}
    if own and chain.link_segments is not None:
        numbers = {name: n or chain.link_segments for name, n in numbers.items()}
    if FOOT in numbers and (chain.foot_segments or 1) > 1:
        numbers[FOOT] = chain.foot_segments
    return numbers


def _spring(leg: Leg, spring: PointSpring) -> PointSpring:
    first, second = (_named(leg, part or ROOT) for part in spring.parts)
    points = spring.points.copy()
    for i, part in enumerate(spring.parts):
        if not part:
            # a leg's base is the body on which it begins
            world = leg.root
            points[i] = world[:3, :3] @ points[i] + world[:3, 3]
    return replace(spring, name=_named(leg, spring.name), parts=(first, second), points=points)


def _held(manipulator: Manipulator, pose: RigidPose) -> dict[str, float]:
    """Coordinates of the drives by the legs' names, mm or rad, with what they are off."""
    return {
        leg.name: float(value) + manipulator.offsets.get(leg.name, 0.0)
        for leg, value in zip(manipulator.legs, pose.drives, strict=True)
        if leg.drive is not None
    }


def _coupling(manipulator: Manipulator, name: str, home: RigidPose) -> Coupling:
    """A coupling, its total as at home."""
    (found,) = (coupling for coupling in manipulator.couplings if coupling.name == name)
    total, terms = 0.0, []
    for leg_name, joint, weight in found.terms:
        leg = manipulator.leg(leg_name)
        place = [passive.name for passive in leg.chain.joints].index(joint)
        total += weight * float(home.q[manipulator.legs.index(leg)][place])
        terms.append((_named(leg, joint), weight))
    return Coupling(name, tuple(terms), total)
