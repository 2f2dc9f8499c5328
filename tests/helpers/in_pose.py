"""A machine and a load case in a posture that may be given by numbers."""

from dataclasses import replace

from vjm.postures import in_posture


def in_pose(machine, load_case):
    """The machine with the posture of the load case, and the load case under that posture's label."""
    machine, label = in_posture(machine, load_case.posture)
    return machine, replace(load_case, posture=label)
