"""The serial chain of a machine: the joints from its base to one end, as tables of joints hold them."""

from __future__ import annotations

import numpy as np

from vjm.io.chain_bodies import chain_bodies, elastic_parts, part_ends
from vjm.io.dh_table import DhRow, SerialChain
from vjm.io.errors import did_you_mean
from vjm.model.joints import joint_axes
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import frame


def serial_chain(machine: Machine, end: str = "") -> SerialChain:
    """The joints between the base and an end, and the frames that lie between them; beams are rigid.

    Args:
        machine: without closed loops.
        end: name of an end frame; empty for the end behind the last part.

    Raises:
        ValueError: it has closed loops, no such end, or no joint on the way.

    Example:
        >>> from vjm.io.model_file import load_chain
        >>> [joint.name for joint in serial_chain(load_chain("planar-2r")).joints]
        ['shoulder', 'elbow']
    """
    if machine.closures:
        names = ", ".join(closure.name for closure in machine.closures)
        raise ValueError(f"the closures {names} close loops, and a table of joints is one row behind another")
    if end and end not in machine.ends:
        known = ", ".join(machine.ends) or "none"
        raise ValueError(f"no end '{end}'{did_you_mean(end, machine.ends) or f'; there are {known}'}")
    base, bodies = chain_bodies(machine)
    by_name = {body.name: body for body in bodies}
    behind = machine.ends[end] if end else machine.parts[-1].name
    at, step = part_ends(machine, bodies)[behind]
    joints, steps = list[DhRow](), list[np.ndarray]()
    while at != base:
        body = by_name[at]
        if body.kind != "fixed":
            # the joint's frame, turned so that its axis is z
            Q = frame(joint_axes(body.axis), np.zeros(3))
            joints.append(DhRow(body.joint, body.kind == "slides", limits=body.limits))
            steps.append(Q.T @ step)
            step = Q
        step, at = body.frame @ step, body.parent
    if not joints:
        raise ValueError(f"no joint moves on the way to its end {end}".rstrip())
    return SerialChain(machine.name, tuple(joints[::-1]), (step, *steps[::-1]))


def not_in_table(machine: Machine, chain: SerialChain) -> list[str]:
    """What a table of joints does not hold of a machine, a line for each kind."""
    on_way = {joint.name for joint in chain.joints}
    own = [joint for joint in machine.moving if joint.name in on_way]
    ends = [name for name in machine.ends if machine.ends[name] != machine.parts[-1].name]
    kinds = (
        ("joints that are not on the way to the end:", [j.name for j in machine.moving if j.name not in on_way]),
        ("the other ends", ends if len(machine.ends) > 1 else []),
        ("what is elastic in", elastic_parts(machine)),
        ("masses of", [p.name for p in machine.parts if isinstance(p, RigidOffset | Beam) and p.mass > 0.0]),
        ("the inertia of the rotors of", [joint.name for joint in machine.moving if joint.rotor]),
        ("that these joints follow others:", [joint.name for joint in own if joint.coupling is not None]),
        ("that these joints have no drive:", [joint.name for joint in own if joint.passive]),
        ("the springs between points", [spring.name for spring in machine.point_springs]),
        ("the couplings of passive joints", [coupling.name for coupling in machine.couplings]),
        ("the postures", [*machine.postures, *(one for one in machine.held if one not in machine.postures)]),
    )
    return [f"{what} {', '.join(names)}" for what, names in kinds if names]
