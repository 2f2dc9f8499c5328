"""Families of what a robot's deflection under a load can have: springs, linear or not, and a load's zero.

Errors of geometry, gears and encoders move the loaded and the unloaded robot alike: no difference shows them.
The scale of all loads is one with all compliances, and is not asked.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import physical_bound, prior_scale
from vjm_updating.deflections.forward import LOAD, DeflectionForward
from vjm_updating.deflections.readings import DeflectionData
from vjm_updating.poses.families import MILLIMETRE, MILLIRADIAN, Member, members_of, value_member
from vjm_updating.poses.machine import PoseMachine

COMPLIANCES = ("actuator_compliance", "lateral_compliance", "base_compliance", "link_compliance")
NOT_SHOWN = ("joint_offset", "frame_error", "gear_error", "encoder_scale", "approach", "tracker_drift", "gravity")
"""Families of poses that a difference of two equilibria does not show, but in the second order."""
ONE_PERCENT = prior_scale(0.01)
"""Of the largest load: the unit of a force sensor's zero."""
RESTS = physical_bound(1e-3)
"""Of a joint's root mean square torque by the loads: a smaller torque presses a joint to neither side."""


def members_of_loads(
    machine: PoseMachine, data: DeflectionData, forward: DeflectionForward, scale: Array
) -> list[Member]:
    """Every member of every family that a test of deflections can show.

    Args:
        machine: the robot.
        data: the readings.
        forward: their model, without members.
        scale: ``(n_tree,)`` what the loads of the test bring on each coordinate, root mean square, N mm or N.
    """
    springs = members_of(machine, data, scale, ordered=False)
    result = [member for member in springs if member.family in COMPLIANCES]
    result += _of_joints(machine, forward, scale)
    result += _zeros(data)
    return result


def _of_joints(machine: PoseMachine, forward: DeflectionForward, scale: Array) -> list[Member]:
    """What a joint turns by under the load beyond a linear spring, a function of its torque."""
    result = []
    loaded, still = forward.loaded.bearing(), forward.unloaded.bearing()
    for spring in machine.springs:
        c = spring.span[0]
        if spring.kind != "own" or scale[c] < 1e-3 * scale.max(initial=0.0) or spring.part not in machine.driven:
            continue
        over, before = loaded[:, c], still[:, c]
        side, side0 = (np.sign(np.where(np.abs(one) > RESTS * scale[c], one, 0.0)) for one in (over, before))
        size, of, by = (MILLIMETRE, "mm", "N") if spring.slides else (MILLIRADIAN, "rad", "(N mm)")
        # values of one scale turn the joint by as much under the root mean square torque, whatever their dimension
        laws = {
            "actuator_hardening": (over**3 - before**3, size / scale[c] ** 3, f"{of}/{by}³"),
            "tension_compression_asymmetry": (np.abs(over) - np.abs(before), size / scale[c], f"{of}/{by}"),
            "actuator_backlash": (0.5 * (side - side0), size, of),
        }
        index = machine.driven[spring.part]
        result += [
            value_member(family, spring.part, "", index, scale_of_law, unit, basis)
            for family, (basis, scale_of_law, unit) in laws.items()
            if np.any(basis)
        ]
    return result


def _zeros(data: DeflectionData) -> list[Member]:
    """Zeros of the force sensors along the axes that they read."""
    largest = np.abs(data.load).max(axis=0)
    result = []
    for j, point in enumerate(data.loads):
        for a, label in enumerate(("fx", "fy", "fz", "mx", "my", "mz")):
            half = largest[j, :3] if a < 3 else largest[j, 3:]
            if largest[j, a] > 0.0:
                result.append(
                    Member(
                        family="instrument_zero", name=f"instrument_zero.{point}.{label}", kind=LOAD,
                        index=6 * j + a, scale=ONE_PERCENT * float(half.max()), unit="N" if a < 3 else "N mm",
                    )
                )  # fmt: skip
    return result
