"""Families of errors that a robot can have: each a vector of members with one size.

A member moves a joint from its commanded value by a known function of the posture, gives a spring its compliance,
scales a weight, or moves what the tracker sees. Each counts in a scale of its own, so chosen that the
members of a family may be expected to be of one size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import definition, prior_scale
from vjm_updating.inference.parameters import FitParameter
from vjm_updating.poses.machine import ACROSS, OWN, RIGID, PoseMachine
from vjm_updating.poses.measurement import PoseData

VALUE, COMPLIANCE, FACTOR, MASS, DRIFT, STRETCH = "value", "compliance", "factor", "weight", "drift", "stretch"
"""What a member acts on."""
LOAD, DISPLACEMENT = "load", "displacement"
"""The same of zeros: of a point's wrench, and of a marker's displacement. The index is 6 times the number of the
point or the marker, and the component's."""
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


@dataclass(frozen=True, kw_only=True)
class FamilyParameter(FitParameter):
    """One number of a family, named ``family.part.what``; its prior is the family's, of a size by the evidence.

    Attributes:
        kind: what it acts on, see `VALUE` and the others.
        subject: part of the model file that it belongs to.
        family: its name.
        index: one-degree joint, first coordinate, load or axis that it acts on.
        unit: of its value.
        basis: ``(g,)`` function of the posture that it multiplies; None: one.
    """

    sigma: float = np.inf
    subject: str = ""
    family: str
    index: int
    unit: str
    basis: Array | None = None

    @property
    def set_anew(self) -> bool:
        """Whether it is another one in each series: a zero of an encoder or of a force sensor.

        A zero of displacements is one of all series. Were it fitted in each, it would take up what the model misses
        in the mean.
        """
        return self.family in ZEROS and self.kind != DISPLACEMENT


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
    "actuator_compliance": "compliance of the joints about their own axes",
    "coupling": "a coupled joint passes on what bends, and not only what is commanded",
    "base_compliance": "compliance of the base: what the robot stands on turns under its weight",
    "lateral_compliance": "compliance of the joints about the axes across: bearings, and the link before",
    "link_compliance": "compliance of the links",
    "gravity": "weights of the links and of the payload",
    "gear_error": "errors of the gears, once and twice a turn",
    "approach": "backlash and friction: the error follows the way by which a joint came",
    "encoder_scale": "scale of the joints' encoders",
    "tracker_drift": "the tracker's frame drifts with time or temperature",
    "temperature": "temperature stretches the links",
    "tension_compression_asymmetry": "joints that deflect more to one side, as by a crack or a loose bolt",
    "actuator_backlash": "backlash: joints that the load presses to the other side",
    "actuator_hardening": "springs of joints that stiffen or soften, by the cube of the torque",
    "instrument_zero": "zeros of the force sensors, and of what reads displacements",
}
"""What each is, for people."""
LARGEST = {"gravity": 2.0, "joint_offset": 100.0, "temperature": 10.0}
"""Sizes of families beyond which they are not physical: 20 % of the weights, 100 mrad or 10 mm, 1e-4 per K."""
LawFamily: TypeAlias = Literal["tension_compression_asymmetry", "actuator_hardening", "actuator_backlash"]
LAWS: tuple[LawFamily, ...] = ("tension_compression_asymmetry", "actuator_hardening", "actuator_backlash")
"""What a joint's spring has beyond its compliance, functions of its torque."""
SECOND = ("gear_error", "approach", "encoder_scale", "tracker_drift", "temperature", *LAWS, "instrument_zero")
"""Functions of the posture, of the torque or of the clock."""

DRIVES = "actuator_compliance"
ZEROS = ("joint_offset", "instrument_zero")
"""Zeros of encoders and instruments; see `FamilyParameter.set_anew`."""


def members_of(machine: PoseMachine, data: PoseData, torque: Array, *, ordered: bool) -> list[FamilyParameter]:
    """Every member of every family that the data can show.

    ``torque`` (n_tree,) has the standard deviation over the postures of what each coordinate bears, N mm or N.
    """
    result = [*_values(machine, data), *_compliances(machine, torque)]
    for k, part in enumerate(machine.masses):
        if part in machine.masses[:k]:
            continue  # a beam's weight in many pieces
        name = part.removesuffix("~root")
        result.append(
            FamilyParameter(
                family="gravity", name=f"gravity.{name}", kind=MASS, index=k, scale=0.1, unit="of its mass",
                subject=name, low=-10.0,
            )
        )  # fmt: skip
    for name, index in machine.driven.items() if ordered else ():
        if name in machine.joints:
            q = data.q[:, machine.joints.index(name)]
            way = np.sign(np.diff(q, prepend=q[0]))
            scale, unit = (MILLIRADIAN, "rad") if name in machine.turning else (MILLIMETRE, "mm")
            result.append(value_member("approach", name, "", index, scale, unit, way))
    clock = data.time if data.time is not None else (np.arange(len(data), dtype=float) if ordered else None)
    for name, course in (("time", clock), ("temperature", data.temperature)):
        if course is not None and np.ptp(course) > 0.0:
            basis = (course - course.mean()) / np.ptp(course)
            result += [
                FamilyParameter(
                    family="tracker_drift", name=f"tracker_drift.{name}.{axis}", kind=DRIFT, index=k, scale=1.0,
                    unit="mm over the test", basis=basis,
                )
                for k, axis in enumerate("xyz")
            ]  # fmt: skip
    if data.temperature is not None and np.ptp(data.temperature) > 0.5:
        result.append(
            FamilyParameter(
                family="temperature", name="temperature.stretch", kind=STRETCH, index=0, scale=1e-5, unit="1/K",
                basis=data.temperature - data.temperature.mean(),
            )
        )  # fmt: skip
    return result


def _values(machine: PoseMachine, data: PoseData) -> list[FamilyParameter]:
    result = []
    for name, index in machine.driven.items():
        turns = name in machine.turning
        scale, unit = (MILLIRADIAN, "rad") if turns else (LINEAR_ZERO, "mm")
        result.append(value_member("joint_offset", name, "", index, scale, unit))
    for error in machine.frames:
        scale, unit = (MILLIMETRE, "mm") if error.label.startswith("shift") else (MILLIRADIAN, "rad")
        result.append(value_member("frame_error", error.joint, error.label, error.index, scale, unit))
    for name, q in zip(machine.joints, data.q.T, strict=True):
        if name not in machine.turning:
            continue
        index = machine.driven[name]
        result += [
            value_member("gear_error", name, wave, index, MILLIRADIAN, "rad", of_q(q))
            for wave, of_q in WAVES.items()
        ]
        result.append(value_member("encoder_scale", name, "", index, MILLIRADIAN, "rad/rad", q))
    return result


def _compliances(machine: PoseMachine, torque: Array) -> list[FamilyParameter]:
    family = {OWN: "actuator_compliance", ACROSS: "lateral_compliance", "link": "link_compliance"}
    family |= {"base": "base_compliance", "beam": "link_compliance"}
    result = []
    for spring in machine.springs:
        name = f"{family[spring.kind]}.{spring.part}"
        if spring.kind != OWN:
            name += f".{spring.label}".replace("about ", "")
        if spring.kind == "beam":
            member = FamilyParameter(
                family=family[spring.kind], name=name, kind=FACTOR, index=spring.span[0], scale=0.1,
                unit="of its compliance", subject=spring.part, low=-9.0,
            )  # fmt: skip
        else:
            kind = "bearing" if spring.kind != OWN else "linear drive" if spring.slides else "drive"
            most = LARGEST_COMPLIANCE[kind][0]
            size = MILLIMETRE if spring.slides else MILLIRADIAN
            # a spring that bears little cannot be expected to turn by as much: none so compliant is built
            scale = size / max(float(torque[spring.span[0]]), size / most)
            member = FamilyParameter(
                family=family[spring.kind], name=name, kind=COMPLIANCE, index=spring.span[0], scale=scale,
                unit="mm/N" if spring.slides else "rad/(N mm)", nominal=spring.nominal, subject=spring.part,
                low=min(0.0, RIGID - spring.nominal) / scale,
                high=max(most - spring.nominal, spring.nominal) / scale,
            )  # fmt: skip
        result.append(member)
    return result


def value_member(
    family: str, part: str, what: str, index: int, scale: float, unit: str, basis: Array | None = None
) -> FamilyParameter:
    """A member that moves a joint from its commanded value."""
    name = f"{family}.{part}.{what}".removesuffix(".")
    return FamilyParameter(
        name=name, kind=VALUE, subject=part, scale=scale, family=family, index=index, unit=unit, basis=basis
    )
