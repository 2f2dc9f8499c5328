"""Errors of assembly: beams of another length than designed, and drives that are off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.machine import Machine
from vjm.model.parts import Beam


def assembled(machine: Machine, too_long: Mapping[str, float] = {}, off: Mapping[str, float] = {}) -> Machine:
    """A machine as built; its loops have gaps in its postures, which its springs close.

    Args:
        machine: as designed.
        too_long: by how many mm beams are longer, by their names.
        off: what the coordinates of held joints are off, mm or rad, by their names.

    Returns:
        The machine, its displacements counted from where the end-effector is as designed.

    Raises:
        ValueError: no such beam or held joint.

    Example:
        >>> import vjm
        >>> built = assembled(vjm.load("orthoglide"), {"x/link": 0.2})
        >>> vjm.stiffness(built, "isotropic").wrench[0] < -100.0
        True
    """
    beams, held = [beam.name for beam in machine.beams], [joint.name for joint in machine.held_joints]
    for name in too_long:
        if name not in beams:
            raise ValueError(f"{machine.name}: no beam '{name}' to be too long (it has {', '.join(beams)})")
    for name in off:
        if name not in held:
            raise ValueError(f"{machine.name}: no held joint '{name}' that could be off (it has {', '.join(held)})")
    if not too_long and not off:
        return machine
    tree = RigidMechanism(machine)
    return replace(
        machine,
        parts=tuple(
            replace(part, length=part.length + too_long.get(part.name, 0.0)) if isinstance(part, Beam) else part
            for part in machine.parts
        ),
        held={
            label: {name: value + off.get(name, 0.0) for name, value in values.items()}
            for label, values in machine.held.items()
        },
        nominal_ends={label: tree.end_frames(tree.posture(label)[None])[0] for label in machine.postures},
    )
