"""The loads of a load case on the bodies of a lumped model: dead and follower wrenches, and weight."""

from __future__ import annotations

import numpy as np

from vjm.model.applied_loads import NO_LOADS, AppliedLoads
from vjm.model.load_case import LoadCase, PointControl
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array


def loading_of(model: Mechanism, x: Array, load_case: LoadCase) -> tuple[AppliedLoads, np.ndarray, int]:
    """The loads of a load case on a model whose unloaded coordinates are ``x`` (n,).

    Returns:
        The loading; which of its points ``(l,)`` bear what acts on the end-effector; and the index of the point
        that a `PointControl` watches, −1 where there is none.

    Raises:
        ValueError: a load stands on a point that the model does not have.
    """
    rows: list[tuple[int, Array, bool, Array, Array, bool, bool]] = []
    nothing = np.zeros(6)
    for load in load_case.loads:
        joint, offset = model.find(load.part, load.at)
        wrench = np.array(load.wrench)
        if load.follower:
            R = model.kinematics(x).behind[joint + 1][:3, :3]
            wrench = np.concatenate([R.T @ wrench[:3], R.T @ wrench[3:]])
        constant, ramped = (nothing, load_case.sign * wrench) if load.ramped else (wrench, nothing)
        rows.append((joint, offset, load.follower, constant, ramped, not load.part, False))
    if load_case.gravity is not None:
        for piece in model.pieces:
            if piece.mass > 0.0:
                weight = np.concatenate([piece.mass * np.array(load_case.gravity), np.zeros(3)])
                parts = (nothing, load_case.sign * weight) if load_case.weight_ramped else (weight, nothing)
                rows.append((piece.joint, piece.centre_of_mass, False, *parts, False, False))
    if isinstance(load_case.control, PointControl):
        joint, offset = model.find(load_case.control.part, load_case.control.at)
        if joint < 0:
            raise ValueError(
                f"part '{load_case.control.part}' is fixed to the base: its displacement cannot control a path"
            )
        rows.append((joint, offset, False, nothing, nothing, False, True))
    # what stands on the base moves nothing
    rows = sorted((row for row in rows if row[0] >= 0), key=lambda row: row[0])
    if not rows:
        return NO_LOADS, np.zeros(0, dtype=bool), -1
    joints, offsets, follows, constant, ramped, tool, watched = (np.array(c) for c in zip(*rows, strict=True))
    where = int(np.argmax(watched)) if watched.any() else -1
    return AppliedLoads(joints, offsets, follows, constant, ramped), tool, where
