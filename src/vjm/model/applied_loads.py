"""Wrenches on points of a model's bodies, dead and following."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vjm.rotations import Array


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
