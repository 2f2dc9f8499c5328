"""A manipulator of legs as one machine: a tree of parts, its loops held together by closures.

The first leg that ends on a body carries it; every further one is held to it. What carries the platform is the last
part, so that the end-effector is the platform's reference point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.machine.closing import closed
from vjm.machine.rigid_tree import RigidTree
from vjm.model.chain import FOOT, Chain
from vjm.model.closures import Closure, Coupling
from vjm.model.joints import Joint, PointSpring
from vjm.model.load_case import LoadCase
from vjm.model.parts import Beam, Part, RigidOffset
from vjm.platform.manipulator import BASE, PLATFORM, Leg, Manipulator
from vjm.rotations import Array, inverse_frame

HOME = "home"
"""Label of the posture in which a machine is drawn, where its file gives it no other."""
ROOT, ATTACHMENT = "root", "attachment"
"""Rigid parts before a leg's first part and behind its last one."""


@dataclass(frozen=True)
class MachineLeg:
    """A chain between two bodies of a machine.

    Attributes:
        name: unique.
        chain: its parts.
        start: body on which it begins.
        end: body on which it ends.
        root: frame ``(4, 4)`` of the chain's world in the starting body, mm.
        attachment: frame ``(4, 4)`` of the chain's end in the body that it ends on, mm.
        drive: joint that its drive adds, named by the leg, or None.
        drive_part: name of the part before which that joint lies, or behind whose end if that part is rigid.
        home: coordinates at home of the chain's own joints, and of the drive by the leg's name, mm or rad.
    """

    name: str
    chain: Chain
    start: str = BASE
    end: str = PLATFORM
    root: Array = field(default_factory=lambda: np.eye(4))
    attachment: Array = field(default_factory=lambda: np.eye(4))
    drive: Joint | None = None
    drive_part: str = ""
    home: Mapping[str, float] = field(default_factory=dict)


def joined(
    name: str,
    legs: Sequence[MachineLeg],
    couplings: Sequence[tuple[str, Sequence[tuple[str, str, float]]]] = (),
) -> Chain:
    """Legs on bodies as one machine, in its one posture, home, not yet closed.

    Args:
        name: of the machine.
        legs: those that carry a body come before those that begin on it.
        couplings: name, and leg, passive joint and weight of each term. The sum stays as at home.

    Returns:
        Its parts are named ``leg/part``, a drive by the leg's name, the last part ``platform``.

    Raises:
        ValueError: names are not unique, a leg begins where no leg before it ends, or none ends on the platform.
    """
    parts: list[Part] = []
    after: dict[str, str] = {}
    carriers: dict[str, str] = {BASE: ""}
    closures: list[Closure] = []
    springs: list[PointSpring] = []
    ends: dict[str, str] = {}
    values: dict[str, float] = {}
    shared = {leg.chain.link_segments for leg in legs}
    link_segments = shared.pop() if len(shared) == 1 else None
    for leg in legs:
        if leg.end == BASE:
            raise ValueError(f"leg '{leg.name}' ends on the base: turn it round")
        if leg.start not in carriers:
            raise ValueError(
                f"leg '{leg.name}' begins on '{leg.start}', where no leg before it ends: it is not connected to "
                f"the base"
            )
        made = _parts(leg, own_numbers=link_segments is None)
        parts += made
        after[made[0].name] = carriers[leg.start]
        after |= {_named(leg, part): _behind(leg, where) for part, where in leg.chain.after.items()}
        springs += [_spring(leg, spring) for spring in leg.chain.point_springs]
        ends |= {_named(leg, end): _behind(leg, where) for end, where in leg.chain.ends.items()}
        values |= {joint if joint == leg.name else _named(leg, joint): v for joint, v in leg.home.items()}
        closures += [_closure(leg, closure) for closure in leg.chain.closures]
        if leg.end not in carriers:
            carriers[leg.end] = _named(leg, ATTACHMENT)
            parts.append(RigidOffset(carriers[leg.end], inverse_frame(leg.attachment)))
        else:
            frames = np.array([np.eye(4), leg.attachment])
            closures.append(Closure(leg.name, (made[-1].name, carriers[leg.end]), frames))
    if PLATFORM not in carriers:
        raise ValueError(f"{name}: no leg ends on the platform")
    parts.append(RigidOffset(PLATFORM, np.eye(4)))
    after[PLATFORM] = carriers[PLATFORM]
    passive = [part.name for part in parts if isinstance(part, Joint) and part.free]
    return Chain(
        name=name,
        parts=tuple(parts),
        postures={HOME: np.array([values[joint] for joint in passive], dtype=float)},
        held={HOME: {joint: v for joint, v in values.items() if joint not in passive}},
        link_segments=link_segments,
        after=after,
        point_springs=tuple(springs),
        ends=ends,
        closures=tuple(closures),
        couplings=(*(_coupling(c, values) for c in couplings), *_own_couplings(legs)),
    )


def machine_of(manipulator: Manipulator) -> Chain:
    """The machine that a manipulator is, in the poses that it has.

    Args:
        manipulator: legs on a platform. What is wrong with it, beams of another length and drives that are off, is
            in the parts and in the held coordinates; so the loops then have gaps in its poses.

    Returns:
        See `joined`.

    Raises:
        PoseError: the rigid manipulator cannot take one of its poses.
        ValueError: names of parts are not unique.

    Example:
        >>> import vjm
        >>> machine = machine_of(vjm.load("parallelogram"))
        >>> [part.name for part in machine.parts][:3], machine.closures[0].name
        (['bar-1/root', 'bar-1/near', 'bar-1/bar'], 'bar-2')
    """
    couplings = [(coupling.name, coupling.terms) for coupling in manipulator.couplings]
    machine = joined(manipulator.name, [_leg(leg) for leg in manipulator.legs], couplings=couplings)
    machine = replace(machine, title=manipulator.title, source=manipulator.source, sha256=manipulator.sha256)
    machine = posed(machine, manipulator.poses, manipulator.home)
    too_long = {
        f"{leg}/{part}": error for leg, errors in manipulator.errors.items() for part, error in errors.items()
    }
    parts = (
        replace(part, length=part.length + too_long.get(part.name, 0.0)) if isinstance(part, Beam) else part
        for part in machine.parts
    )
    off = manipulator.offsets
    held = {
        label: {name: value + off.get(name, 0.0) for name, value in values.items()}
        for label, values in machine.held.items()
    }
    ends = {}
    if too_long or off:
        tree = RigidTree(machine)
        ends = {each: tree.end_frames(tree.posture(each)[None])[0] for each in machine.postures}
    return replace(machine, parts=tuple(parts), held=held, nominal_ends=ends)


def in_pose(manipulator: Manipulator, load_case: LoadCase) -> tuple[Chain, LoadCase]:
    """The machine that a manipulator is, in the one pose of a load case, for whatever takes a machine.

    Args:
        manipulator: legs on a platform.
        load_case: its posture is the label of a pose, or the platform's displacement from home, see
            `vjm.platform.manipulator.Manipulator.displacement`.

    Returns:
        The machine, see `machine_of`, and the same load case.

    Raises:
        ValueError: there is no such pose.
        PoseError: the rigid manipulator cannot take it.

    Example:
        >>> import vjm
        >>> robot, load_case = vjm.load("orthoglide"), vjm.LoadCase("10,0,0", to=-0.1)
        >>> vjm.VjmEngine(4).trace(*in_pose(robot, load_case)).complete
        True
    """
    label = load_case.posture
    machine = machine_of(replace(manipulator, poses={label: manipulator.displacement(label)}))
    postures, held = {label: machine.postures[label]}, {label: machine.held[label]}
    return replace(machine, postures=postures, held=held, poses={}, home=""), load_case


def posed(machine: Chain, poses: Mapping[str, Array], end: Array) -> Chain:
    """A machine at home, closed in poses.

    Args:
        machine: with one posture.
        poses: displacements ``(6,)`` of the end-effector from home by label, mm and rad. The one that is none is
            home's label.
        end: frame ``(4, 4)`` of the end-effector at home, mm.

    Raises:
        PoseError: its loops do not close in one of them.
    """
    (old,) = machine.postures
    home = next((label for label, displacement in poses.items() if not np.any(displacement)), old)
    return closed(
        replace(
            machine,
            postures={home: machine.postures[old]},
            held={home: machine.held[old]},
            poses=dict(poses),
            home=home,
        ),
        end,
    )


def _leg(leg: Leg) -> MachineLeg:
    joint, home = None, dict(zip((j.name for j in leg.chain.joints), leg.posture.tolist(), strict=True))
    if leg.drive is not None:
        limits = leg.drive.limits if np.any(np.isfinite(leg.drive.limits)) else None
        joint = Joint(leg.name, leg.drive.axis, leg.drive.slides, limits=limits)
        home[leg.name] = leg.coordinate
    part = "" if leg.drive is None else leg.drive.part
    return MachineLeg(leg.name, leg.chain, leg.start, leg.end, leg.root, leg.attachment, joint, part, home)


def _named(leg: MachineLeg, part: str) -> str:
    return f"{leg.name}/{part}"


def _behind(leg: MachineLeg, part: str) -> str:
    """The part of a leg behind which another begins; an empty one is the leg's root."""
    return _named(leg, part or ROOT)


def _parts(leg: MachineLeg, *, own_numbers: bool) -> list[Part]:
    """The parts of a leg, its root first and the joint of its drive among them.

    Args:
        leg: of the machine.
        own_numbers: whether the beams keep the numbers of springs that their own file asks for.
    """
    names = [part.name for part in leg.chain.parts]
    taken = next((name for name in names if name in (ROOT, ATTACHMENT)), None)
    if taken is not None:
        raise ValueError(
            f"leg '{leg.name}': '{taken}' is the name of what holds a leg: rename that part of its chain"
        )
    if leg.drive is not None and leg.drive_part not in names:
        raise ValueError(f"leg '{leg.name}': no part '{leg.drive_part}' to drive (there are {', '.join(names)})")
    joint: list[Part] = [] if leg.drive is None else [leg.drive]
    numbers = spring_numbers(leg.chain, own=own_numbers)
    result: list[Part] = [RigidOffset(_named(leg, ROOT), leg.root @ leg.chain.base)]
    for part in leg.chain.parts:
        made = replace(part, name=_named(leg, part.name))
        if isinstance(part, Beam) and isinstance(made, Beam):
            free = _named(leg, part.free_length) if part.free_length else ""
            made = replace(made, free_length=free, own_segments=numbers.get(part.name))
        if isinstance(made, Joint) and made.coupling is not None:
            ratios = tuple((_named(leg, name), ratio) for name, ratio in made.coupling.ratios)
            made = replace(made, coupling=replace(made.coupling, ratios=ratios))
        if not joint or part.name != leg.drive_part:
            result.append(made)
        elif isinstance(part, RigidOffset) and not np.array_equal(part.transform, np.eye(4)):
            # the drive acts where the rigid part ends
            result += [made, *joint]
        else:
            result += [*joint, made]
    return result


def spring_numbers(chain: Chain, *, own: bool) -> dict[str, int | None]:
    """Springs that each beam has by itself, by its name, where a machine cannot say it for all."""
    numbers = {beam.name: beam.own_segments for beam in chain.beams}
    if own and chain.link_segments is not None:
        numbers = {name: n or chain.link_segments for name, n in numbers.items()}
    if FOOT in numbers and (chain.foot_segments or 1) > 1:
        numbers[FOOT] = chain.foot_segments
    return numbers


def _spring(leg: MachineLeg, spring: PointSpring) -> PointSpring:
    first, second = (_named(leg, part or ROOT) for part in spring.parts)
    points = spring.points.copy()
    for i, part in enumerate(spring.parts):
        if not part:
            # a leg's base is the body on which it begins
            world = leg.root
            points[i] = world[:3, :3] @ points[i] + world[:3, 3]
    return replace(spring, name=_named(leg, spring.name), parts=(first, second), points=points)


def _closure(leg: MachineLeg, closure: Closure) -> Closure:
    """A closure of a leg's own; its base is where the leg's chain has its world."""
    first, second = (_named(leg, part or ROOT) for part in closure.parts)
    frames = np.array(
        [
            T if part else inverse_frame(leg.chain.base) @ T
            for part, T in zip(closure.parts, closure.frames, strict=True)
        ]
    )
    return replace(closure, name=_named(leg, closure.name), parts=(first, second), frames=frames)


def _coupling(coupling: tuple[str, Sequence[tuple[str, str, float]]], values: Mapping[str, float]) -> Coupling:
    """A coupling, its total as at home."""
    name, given = coupling
    terms = tuple((f"{leg}/{joint}", weight) for leg, joint, weight in given)
    missing = next((joint for joint, _ in terms if joint not in values), None)
    if missing is not None:
        leg, joint = missing.split("/", 1)
        raise ValueError(f"coupling '{name}': leg '{leg}' has no joint '{joint}'")
    return Coupling(name, terms, sum(weight * values[joint] for joint, weight in terms))


def _own_couplings(legs: Sequence[MachineLeg]) -> list[Coupling]:
    return [
        Coupling(_named(leg, c.name), tuple((_named(leg, joint), w) for joint, w in c.terms), c.total)
        for leg in legs
        for c in leg.chain.couplings
    ]
