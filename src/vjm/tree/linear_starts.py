"""Compiled: where linear theory expects critical forces, from which their search starts."""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.entry_points import inverse
from vjm.kernels.newton import linearise
from vjm.kernels.statics import place, turn_followers

ALIKE = float(np.cos(0.04))
"""Cosine between directions of starts that count as one."""
ROUGH, TURNS = 8, 60
"""Iterations for linear starts: before those that are alike become one, and after."""
STILL = 1e-3
"""Of the work: its change in an iteration where this ends."""


@entry
def inverses_of(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, home: Floats, end_wrench: Floats, x: Floats,
    wrench: Floats, out: Floats,
) -> None:  # fmt: skip
    """Inverse second variations ``out`` (g, n, n) on what the closures leave, scaled by the units, at equilibria.

    See `vjm.kernels.batch.equilibria_of` for the arguments; those of the posture have one row each.
    """
    n = x.shape[1]
    forces, none, v = np.empty(n), np.zeros(model.size[2]), np.zeros(n)
    place(model, command, home, work)
    turn_followers(model, work)
    for g in range(len(x)):
        work.wrench[:] = wrench[g]
        linearise(model, command, natural, x[g], end_wrench[g], 1.0, False, work)
        for i in range(n):
            v[:] = 0.0
            v[i] = 1.0
            inverse(model, work, v, forces, none, out[g, i])


@entry
def linear_starts(B: Floats, counts: Ints, some: Floats, y: Floats, size: Floats) -> int:
    """Motions at which the work ``yᵀ B y`` (3,) is largest, one for each direction, for each number of modes.

    Args:
        B: ``(3, c, c)`` in modes, the most compliant last.
        counts: how many of the most compliant modes.
        some: ``(k, c)`` any motions to start from.
        y: ``(k · counts, c)`` written: motions of unit length.
        size: written: their work.

    Returns:
        Number of motions written.
    """
    c = B.shape[1]
    there, work = np.zeros(some.shape), np.zeros((len(some), 3))
    written, before = 0, -1
    for count in counts:
        first, kept = max(c - count, 0), len(some)
        if first == before:
            break
        before = first
        for r in range(kept):
            length = 0.0
            for i in range(first, c):
                length += some[r, i] ** 2
            for i in range(c):
                there[r, i] = some[r, i] / np.sqrt(length) if i >= first else 0.0
        for turns in (ROUGH, TURNS):
            for r in range(kept):
                _largest_work(B, first, turns, there[r], work[r])
            many, kept = kept, 0
            for r in range(many):
                alike = False
                for k in range(kept):
                    along = work[r, 0] * work[k, 0] + work[r, 1] * work[k, 1] + work[r, 2] * work[k, 2]
                    alike = alike or along >= ALIKE * _length(work[r]) * _length(work[k])
                if not alike:
                    there[kept], work[kept] = there[r], work[r]
                    kept += 1
        for r in range(kept):
            y[written], size[written] = there[r], _length(work[r])
            written += 1
    return written


@kernel
def _length(v: Floats) -> float:
    return np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)


@kernel
def _largest_work(B: Floats, first: int, turns: int, y: Floats, work: Floats) -> None:
    """Motion ``y`` (c,) of unit length, zero before the first mode, at which the work ``(3,)`` is largest.

    The power method with the matrix along the work's direction; it ends where this changes no more.
    """
    c = len(y)
    image = np.zeros((3, c))
    for turn in range(turns + 1):
        off = 0.0
        for a in range(3):
            s = 0.0
            for i in range(first, c):
                row, own = B[a, i, first:], y[first:]
                t = 0.0
                for j in range(len(own)):
                    t += row[j] * own[j]
                image[a, i] = t
                s += t * y[i]
            off = max(off, abs(s - work[a]))
            work[a] = s
        size = _length(work)
        if turn == turns or (turn > 0 and off <= STILL * size):
            break
        length = 0.0
        for i in range(first, c):
            t = size * y[i]
            for a in range(3):
                t += work[a] / size * image[a, i]
            y[i] = t
            length += t * t
        length = np.sqrt(length)
        for i in range(first, c):
            y[i] /= length
