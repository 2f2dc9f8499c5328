"""How many rows of a matrix are independent, decided once for all commands by the gap in its singular values.

The rows are what closures, couplings and supports hold, and what springs strain by, per unit of the coordinates.
They are dimensionless: lengths over the machine's, turns in radians. So a value that counts is of the order of a
ratio of lengths, and one that does not is rounding. The rank is where neighbouring values lie farthest apart. No
stiffness enters: springs may differ by any number of decades.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.rotations import Array

ROUNDING = float(np.finfo(float).eps)
"""Of a number."""
SUM_ROUNDING = 1e-13
"""Of a sum over the size of its terms: some hundred times that of a number."""
NEGLIGIBLE = ROUNDING**0.5
"""Of what could be one: less of it is none. It is half-way between one and rounding in digits."""


class Rank(NamedTuple):
    """Rank of a matrix.

    Attributes:
        rank: number of singular values that count.
        gap: the least one that counts over the largest one that does not. Rounding stands for a value of zero.
    """

    rank: int
    gap: float


def decided(values: Array, size: int) -> tuple[np.ndarray, Array]:
    """Ranks ``(…,)`` and gaps ``(…,)`` from singular values ``(…, k)``, the largest first.

    Args:
        values: of dimensionless rows; one stands for what the largest could be.
        size: number of rows or columns, whichever is larger: rounding grows with it.

    Example:
        >>> int(decided(np.array([2.0, 1e-3, 4e-17]), 4)[0])
        2
    """
    whole = np.maximum(values[..., :1].max(axis=-1, initial=0.0, keepdims=True), 1.0)
    floor = ROUNDING * max(size, 1) * whole
    steps = np.concatenate([whole, np.maximum(values, floor), floor], axis=-1)
    ratios = steps[..., :-1] / steps[..., 1:]
    # of values that are all rounding the first step is the largest
    rank = np.argmax(ratios, axis=-1)
    return rank, np.take_along_axis(ratios, rank[..., None], axis=-1)[..., 0]


def rank_of(A: Array) -> Rank:
    """Rank of dimensionless rows ``(r, n)``."""
    if not A.size:
        return Rank(0, float("inf"))
    values = np.asarray(np.linalg.svd(A, compute_uv=False), dtype=float)
    rank, gap = decided(values, max(A.shape))
    return Rank(int(rank), float(gap))


def split(A: Array) -> tuple[Array, Array, Array]:
    """Independent combinations of dimensionless rows ``(r, n)``, and what they do and do not move.

    Returns:
        Orthonormal bases: of the rows' combinations that are independent ``(r, k)``, of the motions ``(n, k)`` that
        they see, and of the null space ``(n, n − k)``.
    """
    if not A.size:
        return np.zeros((len(A), 0)), np.zeros((A.shape[1], 0)), np.eye(A.shape[1])
    U, values, Vt = np.linalg.svd(A)
    rank = int(decided(values, max(A.shape))[0])
    return U[:, :rank], Vt[:rank].T, Vt[rank:].T


def null_space(A: Array) -> Array:
    """Orthonormal motions ``(n, k)`` that dimensionless rows ``(r, n)`` do not see."""
    return split(A)[2]


def span(A: Array) -> Array:
    """Orthonormal basis ``(r, k)`` of what dimensionless columns ``(r, n)`` span."""
    return split(A)[0]


def beyond(rows: Array, held: Array) -> Array:
    """What dimensionless rows ``(r, n)`` see of the motions that others ``(c, n)`` leave: ``(r, n)``."""
    if not held.size:
        return rows
    _, values, Vt = np.linalg.svd(held, full_matrices=False)
    V = Vt[: int(decided(values, max(held.shape))[0])]
    return rows - (rows @ V.T) @ V


def least_norm(A: Array, b: Array) -> Array:
    """Solutions ``(g, n)`` of ``A x = b`` by least squares, of least norm; A is ``(g, r, n)``, b ``(g, r)``."""
    U, values, Vt = np.linalg.svd(A, full_matrices=False)
    rank, _ = decided(values, max(A.shape[1:]))
    kept = np.arange(values.shape[1]) < rank[:, None]
    y = np.einsum("grk,gr->gk", U, b) * np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    return np.einsum("gkn,gk->gn", Vt, y)
