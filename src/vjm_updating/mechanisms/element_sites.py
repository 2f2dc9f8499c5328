"""Where elements sit in a machine."""

from __future__ import annotations

from vjm.model.chain import FOOT
from vjm.rotations import rotate_matrix6
from vjm_updating.mechanisms.modified_chain import ModifiedChain, beam_of
from vjm_updating.mechanisms.series_elements import AlongAxis, Behind


def drive(machine: ModifiedChain) -> AlongAxis:
    """The drive.

    Raises:
        ValueError: there is none.
    """
    axis = machine.drive_axis
    if axis is None:
        raise ValueError(f"{machine.nominal.name}: there is no actuator")
    return AlongAxis((float(axis[0]), float(axis[1]), float(axis[2])))


def foot(machine: ModifiedChain) -> Behind:
    """The foot's tip, which deflects by the foot's own compliance."""
    chain = machine.chain()
    beam = beam_of(chain, FOOT)
    C = rotate_matrix6(beam.tip_compliance(), chain.base[:3, :3] @ beam.own_frame)[:3, :3]
    return Behind(tuple(tuple(float(v) for v in row) for row in C))
