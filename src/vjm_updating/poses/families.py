"""Families of errors that a robot can have: each a vector of members with one size.

A member moves a joint from its commanded value by a known function of the posture, gives a spring its compliance,
scales a weight, or moves what the tracker sees. Each is written in a unit of its own (`Member.unit`), so chosen
that the members of a family may be expected to be of one size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import definition, prior_scale
from vjm_updating.poses.machine import ACROSS, OWN, RIGID, MachineSpring, PoseMachine
from vjm_updating.poses.readings import PoseData

VALUE, COMPLIANCE, FACTOR, MASS, DRIFT, STRETCH = "value", "compliance", "factor", "mass", "drift", "stretch"
"""What a member acts on."""
MILLIMETRE, MILLIRADIAN = definition(1.0), definition(1e-3)
LINEAR_ZERO = prior_scale(0.1, "mm")
"""mm: zeros of sliding joints are known to some millimetres, which `LARGEST` makes of it."""
WAVES: dict[str, Callable[[Array], Array]] = {
    "sin": np.sin,
    "cos": np.cos,
    "sin2": lambda q: np.sin(2.0 * q),
    "cos2": lambda q: np.cos(2.0 * q),
}
"""What a gear's error may follow, functions of the joint's angle."""


@dataclass(frozen=True)
class Member:
    """One number of a family.

    Attributes:
        family: its name.
        name: of the member, ``family.part.what``.
        acts: see `VALUE` and the others.
        index: one-degree joint, first coordinate, load or axis that it acts on.
        unit: size of one, in ``of``.
        of: unit for people.
        basis: ``(g,)`` function of the posture that it multiplies; None: one.
        nominal: value that the model gives it.
        part: of the model file that it belongs to.
        lower: smallest and
        upper: largest value.
    """

    family: str
    name: str
    acts: str
    index: int
    unit: float
    of: str
    basis: Array | None = None
    nominal: float = 0.0
    part: str = ""
    lower: float = -np.inf
    upper: float = np.inf


LARGEST_COMPLIANCE = {
    "drive": (1e-5, "rad/(N mm)", "100 N m/rad: the smallest strain-wave gears that are sold have 90"),
    "linear drive": (0.1, "mm/N", "10 N/mm: a belt of a metre has some 50"),
    "bearing": (
        5e-6,
        "rad/(N mm)",
        "200 N m/rad: bearings, feet and links of the smallest arms that are sold have a thousand and more",
    ),
}
"""Compliances beyond which nothing of the kind is built: value, unit, reason. A fit that wants more has found
something else."""


TITLES = {
    "joint_offset": "offsets of the joints' zeros",
    "frame_error": "errors of the fixed frames between the joints",
    "joint_compliance": "compliance of the joints about their own axes",
    "coupling": "a coupled joint passes on what bends, and not only what is commanded",
    "base_compliance": "compliance of the base: what the robot stands on turns under its weight",
    "lateral_compliance": "compliance of the joints about the axes across: bearings, and the link before",
    "link_compliance": "compliance of the links",
    "mass": "masses of the links and of the payload",
    "gear_error": "errors of the gears, once and twice a turn",
    "approach": "backlash and friction: the error follows the way by which a joint came",
    "encoder_scale": "scale of the joints' encoders",
    "tracker_drift": "the tracker's frame drifts with time or temperature",
    "temperature": "temperature stretches the links",
    "one_sided_compliance": "joints that deflect more to one side, as by a crack or a loose bolt",
    "backlash": "backlash: joints that the load presses to the other side",
    "joint_nonlinearity": "springs of joints that stiffen or soften, by the cube of the torque",
    "load_zero": "zeros of the force sensors",
}
"""What each is, for people."""
LARGEST = {"mass": 2.0, "joint_offset": 100.0, "temperature": 10.0}
"""Sizes of families beyond which they are not physical: 20 % of the masses, 100 mrad or 10 mm, 1e-4 per K."""
SECOND = (
    "gear_error", "approach", "encoder_scale", "tracker_drift", "temperature", "one_sided_compliance", "backlash",
    "joint_nonlinearity", "load_zero",
)  # fmt: skip
"""Functions of the posture, of the torque or of the clock."""

DRIVES = "joint_compliance"
ZEROS = ("joint_offset", "load_zero")
"""Zeros of encoders and of force sensors, which are set anew between series of a machine."""


def members_of(machine: PoseMachine, data: PoseData, torque: Array, *, ordered: bool) -> list[Member]:
    """Every member of every family that the data can show.

    Args:
        machine: the robot.
        data: its postures.
        torque: ``(n_tree,)`` standard deviation over the postures of what each coordinate bears, N mm or N.
        ordered: whether the postures stand in the order in which they were taken.
    """
    result = _values(machine, data)
    result += _compliances(machine, torque)
    for k, part in enumerate(machine.masses):
        if part in machine.masses[:k]:
            continue  # a beam's weight in many pieces
        name = part.removesuffix("~root")
        result.append(Member("mass", f"mass.{name}", MASS, k, 0.1, "of its mass", part=name, lower=-1.0))
    if ordered:
        result += _approaches(machine, data)
    clock = data.time if data.time is not None else (np.arange(len(data), dtype=float) if ordered else None)
    for name, course in (("time", clock), ("temperature", data.temperature)):
        if course is not None and np.ptp(course) > 0.0:
            basis = (course - course.mean()) / np.ptp(course)
            result += [
                Member("tracker_drift", f"tracker_drift.{name}.{axis}", DRIFT, k, 1.0, "mm over the test", basis)
                for k, axis in enumerate("xyz")
            ]
    if data.temperature is not None and np.ptp(data.temperature) > 0.5:
        basis = data.temperature - data.temperature.mean()
        result.append(Member("temperature", "temperature.stretch", STRETCH, 0, 1e-5, "1/K", basis))
    return result


def _turning(machine: PoseMachine) -> list[tuple[str, int]]:
    return [(name, machine.driven[name]) for name in machine.joints if name in machine.turning]


def _values(machine: PoseMachine, data: PoseData) -> list[Member]:
    result = []
    for name, index in machine.driven.items():
        turns = name in machine.turning
        unit, of = (MILLIRADIAN, "rad") if turns else (LINEAR_ZERO, "mm")
        result.append(Member("joint_offset", f"joint_offset.{name}", VALUE, index, unit, of, part=name))
    for error in machine.frames:
        unit, of = (MILLIMETRE, "mm") if error.label.startswith("shift") else (MILLIRADIAN, "rad")
        name = f"frame_error.{error.joint}.{error.label}"
        result.append(Member("frame_error", name, VALUE, error.index, unit, of, part=error.joint))
    for name, index in _turning(machine):
        q = data.q[:, machine.joints.index(name)]
        result += [
            Member("gear_error", f"gear_error.{name}.{wave}", VALUE, index, MILLIRADIAN, "rad", of_q(q), part=name)
            for wave, of_q in WAVES.items()
        ]
        result.append(
            Member("encoder_scale", f"encoder_scale.{name}", VALUE, index, MILLIRADIAN, "rad/rad", q, part=name)
        )
    return result


def _compliances(machine: PoseMachine, torque: Array) -> list[Member]:
    family = {OWN: "joint_compliance", ACROSS: "lateral_compliance", "link": "link_compliance"}
    family |= {"base": "base_compliance", "beam": "link_compliance"}
    result = []
    for spring in machine.springs:
        name = f"{family[spring.kind]}.{spring.part}"
        if spring.kind != OWN:
            name += f".{spring.label}".replace("about ", "")
        if spring.kind == "beam":
            member = Member(
                family[spring.kind], name, FACTOR, spring.span[0], 0.1, "of its compliance", nominal=0.0,
                part=spring.part, lower=-0.9,
            )  # fmt: skip
        else:
            most = _largest_compliance(spring)
            size = MILLIMETRE if spring.slides else MILLIRADIAN
            of = "mm/N" if spring.slides else "rad/(N mm)"
            # a spring that bears little cannot be expected to turn by as much: none so compliant is built
            unit = size / max(float(torque[spring.span[0]]), size / most)
            member = Member(
                family[spring.kind], name, COMPLIANCE, spring.span[0], unit, of,
                nominal=spring.nominal, part=spring.part, lower=min(0.0, RIGID - spring.nominal),
                upper=max(most - spring.nominal, spring.nominal),
            )  # fmt: skip
        result.append(member)
    return result


def _largest_compliance(spring: MachineSpring) -> float:
    """Compliance beyond which nothing of a spring's kind is built."""
    if spring.kind != OWN:
        return LARGEST_COMPLIANCE["bearing"][0]
    return LARGEST_COMPLIANCE["linear drive" if spring.slides else "drive"][0]


def _approaches(machine: PoseMachine, data: PoseData) -> list[Member]:
    result = []
    for name, index in machine.driven.items():
        if name not in machine.joints:
            continue
        q = data.q[:, machine.joints.index(name)]
        way = np.sign(np.diff(q, prepend=q[0]))
        unit, of = (MILLIRADIAN, "rad") if name in machine.turning else (MILLIMETRE, "mm")
        result.append(Member("approach", f"approach.{name}", VALUE, index, unit, of, way, part=name))
    return result
