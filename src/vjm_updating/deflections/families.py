"""Families of what a robot's deflection under a load can have: springs, and joints whose springs are not linear.

Errors of geometry, gears and encoders move the loaded and the unloaded robot alike: a difference does not show them.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.deflections.forward import DeflectionForward
from vjm_updating.deflections.readings import DeflectionData
from vjm_updating.poses.families import MILLIRADIAN, VALUE, Member, members_of
from vjm_updating.poses.machine import PoseMachine

COMPLIANCES = ("joint_compliance", "lateral_compliance", "base_compliance", "link_compliance")
NOT_SHOWN = ("joint_offset", "frame_error", "gear_error", "encoder_scale", "approach", "tracker_drift", "mass")
"""Families of poses that a difference of two equilibria does not show, but in the second order."""


def members_of_loads(machine: PoseMachine, data: DeflectionData, forward: DeflectionForward) -> list[Member]:
    """Every member of every family that a test of deflections can show.

    Args:
        machine: the robot.
        data: the readings.
        forward: their model, without members.
    """
    springs = members_of(machine, data, forward.torques(), ordered=False)
    return [member for member in springs if member.family in COMPLIANCES]
