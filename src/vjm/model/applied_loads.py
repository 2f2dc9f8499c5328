"""Loads on the bodies of a lumped model: dead and follower wrenches, and weight."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vjm.model.load_case import LoadCase, PointControl
from vjm.rotations import Array

if TYPE_CHECKING:
    from vjm.model.lumped import LumpedModel


@dataclass(frozen=True)
class AppliedLoads:
    """Wrenches on l points of a model's bodies; all of them ``constant + factor · ramped``.

    Attributes:
        joint: ``(l,)`` last joint before each point, increasing.
        offset: ``(l, 3)`` position behind that joint, mm.
        follows: ``(l,)`` whether the wrench turns with the body.
        constant: ``(l, 6)`` N, N mm; in the axes of the frame behind the joint where it follows, else world.
        ramped: ``(l, 6)`` likewise, per unit of the load factor.
    """

    joint: np.ndarray
    offset: Array
    follows: np.ndarray
    constant: Array
    ramped: Array

    def __len__(self) -> int:
        return len(self.joint)

    @cached_property
    def turning(self) -> np.ndarray:
        """Indices of the points whose wrench is not conservative: it follows, or it is a moment."""
        wrench = np.abs(self.constant) + np.abs(self.ramped)
        result: np.ndarray = np.flatnonzero(
            (self.follows & wrench.any(axis=1)) | wrench[:, 3:].any(axis=1),
        )
        return result

    def gradual(self) -> AppliedLoads:
        """The constant loads alone, to be put on by the load factor."""
        return AppliedLoads(self.joint, self.offset, self.follows, np.zeros_like(self.constant), self.constant)


NO_LOADS = AppliedLoads(
    np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros(0, dtype=bool), np.zeros((0, 6)), np.zeros((0, 6))
)
"""Of a chain that is held at its end-effector and nowhere else."""


def loading_of(model: LumpedModel, x: Array, load_case: LoadCase) -> tuple[AppliedLoads, np.ndarray, int]:
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
            raise ValueError(f"part '{load_case.control.part}' is fixed to the base: it cannot steer a path")
        rows.append((joint, offset, False, nothing, nothing, False, True))
    # what stands on the base moves nothing
    rows = sorted((row for row in rows if row[0] >= 0), key=lambda row: row[0])
    if not rows:
        return NO_LOADS, np.zeros(0, dtype=bool), -1
    joints, offsets, follows, constant, ramped, tool, watched = (np.array(c) for c in zip(*rows, strict=True))
    where = int(np.argmax(watched)) if watched.any() else -1
    return AppliedLoads(joints, offsets, follows, constant, ramped), tool, where
