"""What a rigid machine can do in a posture, by the rank of its motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array

SINGULAR = 1e-6
"""Singular value over the largest below which a motion or a constraint is lost."""
NEGLIGIBLE = 1e-9
"""Singular value over the largest that Newton's step leaves out: what redundant constraints leave to rounding."""


@dataclass(frozen=True)
class Mobility:
    """What a rigid machine can do in a posture.

    Attributes:
        freedom: independent motions of the end-effector with the drives free.
        loose: motions ``(6, k)`` of the end-effector with the drives held, world axes, lengths over the machine's.
        idle: names of the passive joints of each group that moves with end-effector and drives at rest.
        idle_freedom: number of those motions.
        redundant: constraints beyond those that are needed: that many self-stresses are possible.
    """

    freedom: int
    loose: Array
    idle: tuple[tuple[str, ...], ...]
    idle_freedom: int
    redundant: int


def mobility_of(J: Array, end: Array, passive: np.ndarray, names: Sequence[str]) -> Mobility:
    """Freedom, idle motions and redundant constraints of a machine.

    Args:
        J: derivatives ``(r, n)`` of the closures' gaps by the coordinates, dimensionless.
        end: derivatives ``(6, n)`` of the end-effector's pose, likewise.
        passive: ``(n,)`` which coordinates are those of passive joints.
        names: of the joints.
    """
    free, held = _null(J), _null(J[:, passive])
    idle = _null(np.vstack([J, end])[:, passive])
    passive_names = [name for name, is_passive in zip(names, passive, strict=True) if is_passive]
    return Mobility(
        freedom=_span(end @ free).shape[1],
        loose=_span(end[:, passive] @ held),
        idle=_groups(passive_names, idle),
        idle_freedom=idle.shape[1],
        redundant=int(len(J) - (J.shape[1] - free.shape[1])),
    )


def least_norm(A: Array, b: Array) -> Array:
    """Solutions ``(g, n)`` of ``A x = b`` by least squares, of least norm; A is ``(g, r, n)``, b ``(g, r)``."""
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    kept = s > NEGLIGIBLE * s.max(axis=1, initial=0.0, keepdims=True)
    y = np.einsum("grk,gr->gk", U, b) * np.where(kept, 1.0 / np.where(kept, s, 1.0), 0.0)
    result: Array = np.einsum("gkn,gk->gn", Vt, y)
    return result


def _null(A: Array) -> Array:
    """Orthonormal basis ``(n, k)`` of a null space."""
    if not A.size:
        return np.eye(A.shape[1])
    _, s, Vt = np.linalg.svd(A)
    rank = int(np.count_nonzero(s > SINGULAR * s[0]))
    result: Array = Vt[rank:].T
    return result


def _span(A: Array) -> Array:
    """Orthonormal basis ``(r, k)`` of what the columns of a matrix span."""
    if not A.size:
        return np.zeros((len(A), 0))
    U, s, _ = np.linalg.svd(A)
    result: Array = U[:, : int(np.count_nonzero(s > SINGULAR))]
    return result


def _groups(names: Sequence[str], motions: Array) -> tuple[tuple[str, ...], ...]:
    """Joints that move together in motions ``(n, k)``: what is apart in them is a group of its own."""
    together = np.abs(motions @ motions.T) > SINGULAR
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
