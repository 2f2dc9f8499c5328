"""What a rigid machine can do in a posture, by the rank of its motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rank import ROUNDING, null_space, rank_of, span
from vjm.rotations import Array

TOGETHER = ROUNDING**0.5
"""Share of a joint in a motion, from which on it takes part: half-way between one and rounding in digits."""


@dataclass(frozen=True)
class Mobility:
    """What a rigid machine can do in a posture.

    Attributes:
        freedom: independent motions of the end-effector with the drives free.
        loose: motions ``(6, k)`` of the end-effector with the drives held, world axes, lengths over the machine's.
        idle: names of the passive joints of each group that moves with end-effector and drives at rest.
        idle_freedom: number of those motions.
        redundant: constraints beyond those that are needed: that many self-stresses are possible.
        gap: by how much the constraints that count differ from those that do not, see `vjm.rank.Rank`.
    """

    freedom: int
    loose: Array
    idle: tuple[tuple[str, ...], ...]
    idle_freedom: int
    redundant: int
    gap: float


def mobility_of(J: Array, stretching: Array, end: Array, passive: np.ndarray, names: Sequence[str]) -> Mobility:
    """Freedom, idle motions and redundant constraints of a machine.

    Args:
        J: derivatives ``(r, n)`` of the closures' gaps by the coordinates, dimensionless.
        stretching: derivatives ``(s, n)`` of the lengths of springs between points, which hold too, likewise.
        end: derivatives ``(6, n)`` of the end-effector's pose, likewise.
        passive: ``(n,)`` which coordinates are those of passive joints.
        names: of the joints.
    """
    closures = rank_of(J)
    free, held = null_space(J), null_space(np.vstack([J, stretching])[:, passive])
    idle = null_space(np.vstack([J, stretching, end])[:, passive])
    passive_names = [name for name, is_passive in zip(names, passive, strict=True) if is_passive]
    return Mobility(
        freedom=span(end @ free).shape[1],
        loose=span(end[:, passive] @ held),
        idle=_groups(passive_names, idle),
        idle_freedom=idle.shape[1],
        redundant=len(J) - closures.rank,
        gap=closures.gap,
    )


def _groups(names: Sequence[str], motions: Array) -> tuple[tuple[str, ...], ...]:
    """Joints that move together in motions ``(n, k)``: what is apart in them is a group of its own."""
    together = np.abs(motions @ motions.T) > TOGETHER
    groups: list[tuple[str, ...]] = []
    seen = np.zeros(len(names), dtype=bool)
    for first in np.flatnonzero(np.diag(together)).tolist():
        if seen[first]:
            continue
        group = np.zeros(len(names), dtype=bool)
        group[first] = True
        while np.any(grown := together[group].any(axis=0) & ~group):
            group |= grown
        seen |= group
        groups.append(tuple(names[i] for i in np.flatnonzero(group).tolist()))
    return tuple(groups)
