"""Where elements sit in a machine."""

from __future__ import annotations

from vjm.chain import FOOT
from vjm.effects.machine import Machine, beam_of
from vjm.effects.series import AlongAxis, Behind
from vjm.rotations import rotate_matrix6


def drive(machine: Machine) -> AlongAxis:
    """The drive.

    Raises:
        ValueError: there is none.
    """
    axis = machine.drive_axis
    if axis is None:
        raise ValueError(f"{machine.nominal.name}: there is no actuator")
    return AlongAxis((float(axis[0]), float(axis[1]), float(axis[2])))


def foot(machine: Machine) -> Behind:
    """The foot's tip, which gives way by the foot's own compliance."""
    chain = machine.chain()
    beam = beam_of(chain, FOOT)
    C = rotate_matrix6(beam.tip_compliance(), chain.base[:3, :3] @ beam.own_frame)[:3, :3]
    return Behind(tuple(tuple(float(v) for v in row) for row in C))
