"""Loads on the bodies of a meshed chain: dead and follower wrenches, and weight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.model.load_case import LoadCase
from vjm.rotations import Array, skew
from vjm_fea.common.points import Moving, Piece, Place


@dataclass(frozen=True)
class AppliedLoads:
    """Wrenches on l points; all of them ``share · constant + factor · ramped``.

    Attributes:
        places: the points.
        follows: ``(l,)`` whether the wrench turns with the body.
        on_tool: ``(l,)`` whether it counts to what acts on the end-effector.
        constant: ``(l, 6)`` N, N mm, world axes in the reference configuration.
        ramped: ``(l, 6)`` likewise, per unit of the load factor.
    """

    places: tuple[Place, ...]
    follows: np.ndarray
    on_tool: np.ndarray
    constant: Array
    ramped: Array

    @property
    def conservative(self) -> bool:
        """Whether there is neither a follower nor a moment."""
        return not (self.follows.any() or self.constant[:, 3:].any() or self.ramped[:, 3:].any())

    def acting(self, points: Sequence[Moving], share: float, factor: float) -> Array:
        """The wrenches ``(l, 6)`` in world axes.

        Args:
            points: the places at a state.
            share: of the constant loads.
            factor: on the ramped ones.
        """
        wrench = share * self.constant + factor * self.ramped
        for i in np.flatnonzero(self.follows).tolist():
            R = points[i].rotation
            wrench[i] = np.concatenate([R @ wrench[i, :3], R @ wrench[i, 3:]])
        return wrench

    def stiffness(self, i: int, point: Moving, wrench: Array) -> Array:
        """Derivative ``(k, k)`` of a load's generalised forces ``Jᵀ w`` by the motions of its point."""
        H = point.hessian(wrench)
        if self.follows[i]:
            turned = -np.vstack([skew(wrench[:3]), skew(wrench[3:])])
            H = H + point.jacobian.T @ turned @ point.jacobian[3:]
        return H


def loading_of(load_case: LoadCase, find: Callable[[str, float], Place], pieces: Sequence[Piece]) -> AppliedLoads:
    """The loads of a load case.

    Args:
        load_case: what is done.
        find: the point of a part at a fraction.
        pieces: of the chain, with their masses.

    Raises:
        ValueError: a load stands on a point that the chain does not have.
    """
    rows: list[tuple[Place, bool, bool, Array, Array]] = []
    nothing = np.zeros(6)
    for load in load_case.loads:
        wrench = np.array(load.wrench)
        parts = (nothing, load_case.sign * wrench) if load.ramped else (wrench, nothing)
        rows.append((find(load.part, load.at), load.follower, not load.part, *parts))
    if load_case.gravity is not None:
        for piece in pieces:
            if piece.mass > 0.0:
                assert piece.centre is not None
                weight = np.concatenate([piece.mass * np.array(load_case.gravity), np.zeros(3)])
                parts = (nothing, load_case.sign * weight) if load_case.weight_ramped else (weight, nothing)
                rows.append((Place(piece.body, piece.centre), False, False, *parts))
    # what stands on the ground moves nothing
    rows = [row for row in rows if row[0].body is not None]
    return AppliedLoads(
        tuple(row[0] for row in rows),
        np.array([row[1] for row in rows], dtype=bool),
        np.array([row[2] for row in rows], dtype=bool),
        np.array([row[3] for row in rows]).reshape(-1, 6),
        np.array([row[4] for row in rows]).reshape(-1, 6),
    )
