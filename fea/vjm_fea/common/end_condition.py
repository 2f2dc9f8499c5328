"""The support of the end-effector, as one joint of a finite element program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vjm.baselines.msa import geometry
from vjm.model.end_condition import in_order, rigid_direction, support_joints
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint
from vjm.rotations import Array

STILL = 1e-9
"""Largest shift of a point in the machine's lengths, over the end-effector's turn, that is none."""


def hand_joints(chain: Machine, load_case: LoadCase) -> tuple[Joint, ...]:
    """Joints between the end-effector and the support, from the end-effector; see `vjm.model.end_condition`.

    Hinges that the machine's own last joints make superfluous are left out.

    Args:
        chain: the machine, its held joints at the coordinates of the load case's posture.
        load_case: what is held.

    Raises:
        ValueError: what is free makes the machine a mechanism, or it is rigid in a direction in which it is held.
    """
    where = f"{chain.name}, posture {load_case.posture}"
    machine, shape = geometry(_as_meshed(chain), chain.posture(load_case.posture))
    free, all_held = in_order(load_case), machine.end
    if free and machine.neutral(all_held).shape[1]:
        raise ValueError(
            f"{where} is singular: some of its passive joints move without moving the tool; choose another posture"
        )
    while True:
        held = all_held[[i for i, name in enumerate(COMPONENTS) if name not in free]]
        if machine.rigid(held):
            raise rigid_direction(where)
        loose = machine.neutral(held) if free else np.zeros((len(machine.unit), 0))
        if not loose.shape[1]:
            return support_joints(free)
        motion = loose[:, 0]
        turned, shifted = np.abs(all_held @ motion), np.abs(shape @ motion).max() / machine.length
        hinges = [name for name in free if len(name) == 2]
        if shifted > STILL * turned[3:].max() or not hinges:
            raise ValueError(
                f"{where}: with {', '.join(load_case.free)} free the chain is a mechanism: it moves without "
                f"straining a spring; hold one of them"
            )
        free.remove(max(hinges, key=lambda name: float(turned[COMPONENTS.index(name)])))


def _as_meshed(chain: Machine) -> Machine:
    """The chain with straight beams of their sections, as elements have them."""
    parts = (
        replace(part, compliance=None, bow=(0.0, 0.0)) if isinstance(part, Beam) and part.section else part
        for part in chain.parts
    )
    return replace(chain, parts=tuple(parts))


def joint_axes(joints: Sequence[Joint]) -> tuple[Array, tuple[int, ...]]:
    """One joint for the support's hinges and slides in a row.

    Hinges in a row leave as many conditions as there are turns less: none is all three turns; one hinge keeps the
    two other turns. Two keep the hinge in the tool at right angles to the one in the support; three keep nothing.

    Args:
        joints: from the end-effector to the support, along the world's axes: hinges first, see
            `vjm.model.end_condition`.

    Returns:
        Axes ``(3, 3)`` of both sides of the joint as columns, and which of the three shifts along them, in the
        support, and of the three turns it constrains ``(6,)``. One turn left is about z; of two the support's hinge
        is y and the tool's z.
    """
    hinges = [joint.axis for joint in joints if not joint.slides]
    slides = [joint.axis for joint in joints if joint.slides]
    if len(hinges) == 1:
        side = np.roll(hinges[0], 1)
        R, turns = np.column_stack([side, np.cross(hinges[0], side), hinges[0]]), (1, 1, 0)
    elif len(hinges) == 2:
        tool, end_condition = hinges
        R, turns = np.column_stack([np.cross(end_condition, tool), end_condition, tool]), (1, 0, 0)
    else:
        R, turns = np.eye(3), (0, 0, 0) if hinges else (1, 1, 1)
    free = [any(abs(R[:, i] @ slide) > 0.5 for slide in slides) for i in range(3)]
    return R, (*(0 if slide else 1 for slide in free), *turns)
