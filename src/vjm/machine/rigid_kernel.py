"""Compiled kinematics of the rigid machine: what its loops miss, and Newton's method that closes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.arrays import Floats, Ints
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.statics import rotation_between


class RigidArrays(NamedTuple):
    """A rigid machine of m one-degree joints, n coordinates and c closures, which hold r components with couplings.

    Attributes:
        parent: ``(m,)`` joint before each, −1 for the base.
        rotary: ``(m,)`` 1 where it turns.
        axis: ``(m, 3)`` in its own frame.
        before: ``(m, 4, 4)`` rigid transform before it.
        share: ``(m, n)`` its value by the coordinates.
        offset: ``(m,)`` and what is added.
        joint: ``(2 c + 1,)`` last joints before the closures' frames, two each, and before the end-effector.
        frame: ``(2 c + 1, 4, 4)`` those frames behind them.
        rows: ``(c,)`` number of components that each holds.
        coupled: ``(k, n)`` weights of the coordinates that are coupled.
        total: ``(k,)`` of what they add up to.
        unit: ``(n,)`` of the coordinates.
        length: ``(1,)`` of the machine, mm.
    """

    parent: Ints
    rotary: Ints
    axis: Floats
    before: Floats
    share: Floats
    offset: Floats
    joint: Ints
    frame: Floats
    rows: Ints
    coupled: Floats
    total: Floats
    unit: Floats
    length: Floats


@kernel
def _placed(tree: RigidArrays, q: Floats, T: Floats, w: Floats) -> None:
    """Frames ``T`` (m + 1, 3, 4) behind the base and behind each joint, and the axes ``w`` (m, 3) in the world."""
    T[0] = 0.0
    for a in range(3):
        T[0, a, a] = 1.0
    frame, K, turned = np.empty((3, 4)), np.empty((3, 3)), np.empty((3, 3))
    for j in range(len(tree.parent)):
        value = tree.offset[j]
        for c in range(len(q)):
            value += tree.share[j, c] * q[c]
        _behind(T[tree.parent[j] + 1], tree.before[j], frame)
        u = tree.axis[j]
        for a in range(3):
            w[j, a] = frame[a, 0] * u[0] + frame[a, 1] * u[1] + frame[a, 2] * u[2]
        behind = T[j + 1]
        behind[:] = frame
        if tree.rotary[j] == 0:
            for a in range(3):
                behind[a, 3] += value * w[j, a]
            continue
        s, v = np.sin(value), 1.0 - np.cos(value)
        K[0, 0], K[0, 1], K[0, 2] = 0.0, -u[2], u[1]
        K[1, 0], K[1, 1], K[1, 2] = u[2], 0.0, -u[0]
        K[2, 0], K[2, 1], K[2, 2] = -u[1], u[0], 0.0
        for a in range(3):
            for b in range(3):
                square = K[a, 0] * K[0, b] + K[a, 1] * K[1, b] + K[a, 2] * K[2, b]
                turned[a, b] = s * K[a, b] + v * square + (1.0 if a == b else 0.0)
        for a in range(3):
            for b in range(3):
                behind[a, b] = frame[a, 0] * turned[0, b] + frame[a, 1] * turned[1, b] + frame[a, 2] * turned[2, b]


@kernel
def _behind(T: Floats, own: Floats, out: Floats) -> None:
    """Frame ``out`` (3, 4) that lies at ``own`` (4, 4) behind ``T`` (3, 4)."""
    for a in range(3):
        for b in range(4):
            s = T[a, 3] if b == 3 else 0.0
            for c in range(3):
                s += T[a, c] * own[c, b]
            out[a, b] = s


@kernel
def _moved(
    tree: RigidArrays, T: Floats, w: Floats, joint: int, point: Floats, sign: float, rows: int, J: Floats
) -> None:
    """Add to ``J`` (rows, n) how a point on the body behind a joint moves, lengths over the machine's."""
    L = tree.length[0]
    j = joint
    while j >= 0:
        for c in range(len(tree.unit)):
            s = sign * tree.share[j, c] * tree.unit[c]
            if s == 0.0:
                continue
            if tree.rotary[j] == 0:
                for a in range(3):
                    J[a, c] += s * w[j, a] / L
                continue
            x, y, z = point[0] - T[j + 1, 0, 3], point[1] - T[j + 1, 1, 3], point[2] - T[j + 1, 2, 3]
            J[0, c] += s * (w[j, 1] * z - w[j, 2] * y) / L
            J[1, c] += s * (w[j, 2] * x - w[j, 0] * z) / L
            J[2, c] += s * (w[j, 0] * y - w[j, 1] * x) / L
            if rows == 6:
                for a in range(3):
                    J[3 + a, c] += s * w[j, a]
        j = tree.parent[j]


@kernel
def _apart(A: Floats, B: Floats, length: float, rows: int, gap: Floats) -> None:
    """Displacement ``gap`` (rows,) from a frame B to A, lengths over one; nan where it turns by half a turn."""
    for a in range(3):
        gap[a] = (A[a, 3] - B[a, 3]) / length
    if rows < 6:
        return
    rotation_between(A, B, gap[3:6])


@kernel
def _linearised(
    tree: RigidArrays, q: Floats, T: Floats, w: Floats, gap: Floats, J: Floats, end: Floats, J_end: Floats
) -> None:
    """Gaps ``(r,)`` of closures and couplings with derivatives ``(r, n)``, end frame ``(3, 4)`` with ``(6, n)``."""
    _placed(tree, q, T, w)
    J[:, :] = 0.0
    J_end[:, :] = 0.0
    A, B = np.empty((3, 4)), np.empty((3, 4))
    first = 0
    for k in range(len(tree.rows)):
        rows = tree.rows[k]
        a, b = tree.joint[2 * k], tree.joint[2 * k + 1]
        _behind(T[a + 1], tree.frame[2 * k], A)
        _behind(T[b + 1], tree.frame[2 * k + 1], B)
        _apart(A, B, tree.length[0], rows, gap[first : first + rows])
        _moved(tree, T, w, a, A[:, 3], 1.0, rows, J[first : first + rows])
        _moved(tree, T, w, b, A[:, 3], -1.0, rows, J[first : first + rows])
        first += rows
    for k in range(len(tree.total)):
        gap[first + k] = -tree.total[k]
        for c in range(len(q)):
            gap[first + k] += tree.coupled[k, c] * q[c]
            J[first + k, c] = tree.coupled[k, c] * tree.unit[c]
    last = len(tree.joint) - 1
    _behind(T[tree.joint[last] + 1], tree.frame[last], end)
    _moved(tree, T, w, tree.joint[last], end[:, 3], 1.0, 6, J_end)


@kernel
def _normal(J: Floats, rows: Ints, columns: Ints, A: Floats) -> None:
    """Add the upper half of ``JᵀJ`` of some rows and columns to ``A`` (f, f); a loop's rows are mostly zeros."""
    own = np.empty(len(columns))
    for k in rows:
        for i in range(len(columns)):
            own[i] = J[k, columns[i]]
        for i in range(len(columns)):
            if own[i] == 0.0:
                continue
            # loops over slices from zero on are compiled to vector instructions
            row, rest = A[i, i:], own[i:]
            for j in range(len(row)):
                row[j] += own[i] * rest[j]


@kernel
def _factored(A: Floats, damping: float) -> None:
    """Cholesky factor of a symmetric matrix's upper half, its diagonal larger by a share of its largest entry."""
    n, largest = len(A), 0.0
    for i in range(n):
        largest = max(largest, A[i, i])
    added = damping * (largest if largest > 0.0 else 1.0)
    for i in range(n):
        A[i, i] += added
    for i in range(n):
        A[i, i] = np.sqrt(A[i, i])
        for j in range(i + 1, n):
            A[i, j] /= A[i, i]
        for k in range(i + 1, n):
            f = A[i, k]
            if f == 0.0:
                continue
            row, own = A[k, k:], A[i, k:]
            for j in range(len(row)):
                row[j] -= f * own[j]


@kernel
def _substituted(F: Floats, b: Floats) -> None:
    """Solve with Cholesky's factor, in place."""
    n = len(b)
    for i in range(n):
        b[i] /= F[i, i]
        own, rest = F[i, i + 1 :], b[i + 1 :]
        for k in range(len(rest)):
            rest[k] -= own[k] * b[i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= F[i, k] * b[k]
        b[i] /= F[i, i]


@entry
def linearised(tree: RigidArrays, q: Floats, gap: Floats, J: Floats, end: Floats, J_end: Floats) -> None:
    """See `vjm.machine.rigid_mechanism.RigidMechanism.linearised`; end frames are ``(g, 3, 4)``."""
    m = len(tree.parent)
    T, w = np.empty((m + 1, 3, 4)), np.empty((m, 3))
    for g in range(len(q)):
        _linearised(tree, q[g], T, w, gap[g], J[g], end[g], J_end[g])


@entry
def close(
    tree: RigidArrays, q: Floats, free: Ints, wanted: Floats, components: Ints, damping: float, closed: float,
    most: int, left: Floats,
) -> None:  # fmt: skip
    """Newton's method that closes g postures, by least squares.

    Args:
        tree: the machine.
        q: ``(g, n)`` to start from; becomes what is closed.
        free: ``(f,)`` the coordinates that may move.
        wanted: ``(g, 4, 4)`` frames of the end-effector; without rows where it is free.
        components: ``(k,)`` of its pose that are wanted.
        damping: of the normal equations, over their largest diagonal entry.
        closed: gap at which a posture is closed.
        most: steps.
        left: ``(g,)`` written: the largest gap that is left.
    """
    m, n, f = len(tree.parent), len(tree.unit), len(free)
    r = len(tree.total)
    for rows in tree.rows:
        r += rows
    T, w = np.empty((m + 1, 3, 4)), np.empty((m, 3))
    gap, J, end, J_end, miss = np.empty(r), np.empty((r, n)), np.empty((3, 4)), np.empty((6, n)), np.empty(6)
    A, b = np.empty((f, f)), np.empty(f)
    held, every = len(wanted) > 0, np.arange(r)
    for g in range(len(q)):
        for iteration in range(most + 1):
            _linearised(tree, q[g], T, w, gap, J, end, J_end)
            size = 0.0
            for i in range(r):
                size = max(size, abs(gap[i])) if gap[i] == gap[i] else np.inf
            if held:
                _apart(end, wanted[g], tree.length[0], 6, miss)
                for i in components:
                    size = max(size, abs(miss[i])) if miss[i] == miss[i] else np.inf
            left[g] = size
            if not size < np.inf or size < closed or iteration == most:
                break
            for i in range(f):
                s = 0.0
                for k in range(r):
                    s += J[k, free[i]] * gap[k]
                if held:
                    for k in components:
                        s += J_end[k, free[i]] * miss[k]
                b[i] = -s
            A[:, :] = 0.0
            _normal(J, every, free, A)
            if held:
                _normal(J_end, components, free, A)
            _factored(A, damping)
            _substituted(A, b)
            largest = 0.0
            for i in range(f):
                largest = max(largest, abs(b[i]))
            cut = min(1.0, 0.5 / largest) if largest > 0.0 else 1.0
            for i in range(f):
                q[g, free[i]] += cut * b[i] * tree.unit[free[i]]


@entry
def answers(tree: RigidArrays, q: Floats, passive: Ints, driven: Ints, damping: float, out: Floats) -> None:
    """Motions ``out`` (g, 6, d) of the end-effector by driven coordinates, the passive ones following."""
    m, n, f = len(tree.parent), len(tree.unit), len(passive)
    r = len(tree.total)
    for rows in tree.rows:
        r += rows
    T, w = np.empty((m + 1, 3, 4)), np.empty((m, 3))
    gap, J, end, J_end = np.empty(r), np.empty((r, n)), np.empty((3, 4)), np.empty((6, n))
    A, b, every = np.empty((f, f)), np.empty(f), np.arange(r)
    for g in range(len(q)):
        _linearised(tree, q[g], T, w, gap, J, end, J_end)
        A[:, :] = 0.0
        _normal(J, every, passive, A)
        _factored(A, damping)
        for d in range(len(driven)):
            for i in range(f):
                s = 0.0
                for k in range(r):
                    s += J[k, passive[i]] * J[k, driven[d]]
                b[i] = -s
            _substituted(A, b)
            for a in range(6):
                s = J_end[a, driven[d]]
                for i in range(f):
                    s += J_end[a, passive[i]] * b[i]
                out[g, a, d] = s
