"""Compiled kernels: kinematics, condensation and substitution of a chain, block by block.

The linearised equilibrium of a chain at an imposed pose, ``[H − K, Jᵀ; J, 0]`` with (17), is condensed from base
to tool. A block is one spring (up to six coordinates) or one passive joint. Behind each block the motion ``ξ`` of
a body that the end-effector's point is fixed to follows from the wrench ``λ`` on it and the passive coordinates
``q`` so far:

    ξ = Q λ + Y q + a,     with the energy's remainder  −½ qᵀ Z q − zᵀ q.

At the tool this is equation (18), ``[Q, Y; Yᵀ, −Z]``, with a matrix of 6 + n_q rows, for a cost that is linear in
the number of springs. The blocks' pivots give the number of negative eigenvalues (Sylvester's law of inertia).

A load couples a block to all before it only through the rotation Ω that they bring: the work
``Ω · Σ_j (v_j × f + ½ w_j × m) δx_j`` over the joints with the axes w_j and the velocities v_j that they give to
the end-effector. The moment's term is the symmetric half of ``m · (w_i × w_j)``; the rest, a moment fixed in the
world not being conservative, acts on the end-effector alone and is added there: ``½ m × Ω``.

All quantities are dimensionless: lengths over the model's length, forces and moments over its units.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vjm.compilation import entry, kernel

LINEAR, BEAM_COLUMN, PASSIVE = 0, 1, 2
"""Kinds of blocks."""

Ints = np.ndarray[Any, np.dtype[np.int64]]
Floats = np.ndarray[Any, np.dtype[np.float64]]


class Arrays(NamedTuple):
    """A lumped model as arrays; m joints, b blocks, n coordinates.

    Attributes:
        rotary: ``(m,)`` whether a joint turns.
        axis: ``(m, 3)`` its axis in its own frame.
        along: ``(m,)`` 0, 1, 2 where the axis is x, y, z of that frame, else −1.
        moved: ``(m,)`` whether a rigid transform lies before the joint.
        R0: ``(m, 3, 3)`` and
        p0: ``(m, 3)`` that transform.
        coordinate: ``(m,)`` which coordinate drives it.
        factor: ``(m,)`` how much of it.
        kind: ``(b,)`` of the blocks.
        first: ``(b + 1,)`` first coordinate of each block.
        joints: ``(b + 1,)`` first joint of each block.
        K: ``(b, 6, 6)`` stiffness of linear springs.
        beam: ``(b, 7)`` EA, GJ, EIy, EIz, h, h/GAy, h/GAz of beam-column springs.
        R_tail: ``(3, 3)`` and
        p_tail: ``(3,)`` the rigid transform behind the last joint.
    """

    rotary: Ints
    axis: Floats
    along: Ints
    moved: Ints
    R0: Floats
    p0: Floats
    coordinate: Ints
    factor: Floats
    kind: Ints
    first: Ints
    joints: Ints
    K: Floats
    beam: Floats
    R_tail: Floats
    p_tail: Floats


class Work(NamedTuple):
    """What the kernels write, allocated once.

    Attributes:
        w: ``(m, 3)`` joint axes, v: ``(m, 3)`` velocities that they give the end-effector, o: ``(m, 3)`` points on
            the axes.
        R: ``(3, 3)`` and p: ``(3,)`` the end-effector's frame.
        J: ``(n, 6)`` transposed Jacobian, G: ``(n, 3)`` coupling to rotations before.
        residual: ``(n,)`` statics, gap: ``(6,)`` missing displacement.
        L: ``(b, 6, 6)``, D: ``(b, 6)``, order: ``(b, 6)`` the blocks' factors.
        U: ``(b, 6, 6)`` motion at the tool by a block's coordinates.
        Y: ``(b, 6, n_q)`` and a: ``(b, 6)`` as they are before a block.
        T: ``(t, t)`` the condensed matrix, t = 6 + n_q.
        F: ``(t, t)``, swaps: ``(t,)``, pivots: ``(t,)`` its factor.
        right: ``(t,)``, Q: ``(6, 6)``, Y_end: ``(6, n_q)``, Z: ``(n_q, n_q)``, z: ``(n_q,)``, step: ``(n,)``.
        A: ``(6, 6)``, X: ``(6, t)``, K: ``(6, 6)``, s1, s2, s3: ``(6,)`` scratch.
    """

    w: Floats
    v: Floats
    o: Floats
    R: Floats
    p: Floats
    J: Floats
    G: Floats
    residual: Floats
    gap: Floats
    L: Floats
    D: Floats
    order: Ints
    U: Floats
    Y: Floats
    a: Floats
    T: Floats
    F: Floats
    swaps: Ints
    pivots: Ints
    right: Floats
    Q: Floats
    Y_end: Floats
    Z: Floats
    z: Floats
    step: Floats
    A: Floats
    X: Floats
    K: Floats
    s1: Floats
    s2: Floats
    s3: Floats


class Buffers(NamedTuple):
    """A model and its workspace as four flat arrays: what crosses from Python to compiled code in a microsecond.

    Attributes:
        integers: sizes m, b, n, n_q, then the model's integer arrays.
        numbers: the model's other arrays.
        work_integers: the workspace's integer arrays.
        work_numbers: its other arrays.
    """

    integers: Ints
    numbers: Floats
    work_integers: Ints
    work_numbers: Floats


def buffers(model: Arrays) -> Buffers:
    """Pack a model, and allocate what the kernels write."""
    m, b, n = len(model.rotary), len(model.kind), int(model.first[-1])
    q = int(np.count_nonzero(model.kind == PASSIVE))
    t = 6 + q
    integers = [np.array([m, b, n, q]), model.rotary, model.along, model.moved, model.coordinate, model.kind,
                model.first, model.joints]  # fmt: skip
    numbers = [model.axis, model.R0, model.p0, model.factor, model.K, model.beam, model.R_tail, model.p_tail]
    # in the order of `work_of`
    size = 9 * m + 12 + 10 * n + 6 + b * (36 + 6 + 36 + 6 * q + 6) + 2 * t * t + t + 36 + 6 * q + q * q + q
    size += n + 36 + 6 * t + 36 + 6 + 6 + 6
    return Buffers(
        np.concatenate([np.asarray(v, dtype=np.int64).ravel() for v in integers]),
        np.concatenate([np.asarray(v, dtype=np.float64).ravel() for v in numbers]),
        np.zeros(6 * b + 2 * t, dtype=np.int64),
        np.zeros(size),
    )


@entry
def _ints(flat: Ints, at: int, count: int) -> tuple[Ints, int]:
    return flat[at : at + count], at + count


@entry
def _floats(flat: Floats, at: int, count: int) -> tuple[Floats, int]:
    return flat[at : at + count], at + count


@kernel
def model_of(integers: Ints, numbers: Floats) -> Arrays:
    """The model's arrays as views of its buffers."""
    m, b = integers[0], integers[1]
    at = 4
    rotary, at = _ints(integers, at, m)
    along, at = _ints(integers, at, m)
    moved, at = _ints(integers, at, m)
    coordinate, at = _ints(integers, at, m)
    kind, at = _ints(integers, at, b)
    first, at = _ints(integers, at, b + 1)
    joints, at = _ints(integers, at, b + 1)
    at = 0
    axis, at = _floats(numbers, at, 3 * m)
    R0, at = _floats(numbers, at, 9 * m)
    p0, at = _floats(numbers, at, 3 * m)
    factor, at = _floats(numbers, at, m)
    K, at = _floats(numbers, at, 36 * b)
    beam, at = _floats(numbers, at, 7 * b)
    R_tail, at = _floats(numbers, at, 9)
    p_tail, at = _floats(numbers, at, 3)
    return Arrays(
        rotary, axis.reshape((m, 3)), along, moved, R0.reshape((m, 3, 3)), p0.reshape((m, 3)), coordinate, factor,
        kind, first, joints, K.reshape((b, 6, 6)), beam.reshape((b, 7)), R_tail.reshape((3, 3)), p_tail,
    )  # fmt: skip


@entry
def work_of(sizes: Ints, integers: Ints, numbers: Floats) -> Work:
    """The workspace as views of its buffers; ``sizes`` are the first four integers of the model."""
    m, b, n, q = sizes[0], sizes[1], sizes[2], sizes[3]
    t = 6 + q
    at = 0
    order, at = _ints(integers, at, 6 * b)
    swaps, at = _ints(integers, at, t)
    pivots, at = _ints(integers, at, t)
    at = 0
    w, at = _floats(numbers, at, 3 * m)
    v, at = _floats(numbers, at, 3 * m)
    o, at = _floats(numbers, at, 3 * m)
    R, at = _floats(numbers, at, 9)
    p, at = _floats(numbers, at, 3)
    J, at = _floats(numbers, at, 6 * n)
    G, at = _floats(numbers, at, 3 * n)
    residual, at = _floats(numbers, at, n)
    gap, at = _floats(numbers, at, 6)
    L, at = _floats(numbers, at, 36 * b)
    D, at = _floats(numbers, at, 6 * b)
    U, at = _floats(numbers, at, 36 * b)
    Y, at = _floats(numbers, at, 6 * q * b)
    a, at = _floats(numbers, at, 6 * b)
    T, at = _floats(numbers, at, t * t)
    F, at = _floats(numbers, at, t * t)
    right, at = _floats(numbers, at, t)
    Q, at = _floats(numbers, at, 36)
    Y_end, at = _floats(numbers, at, 6 * q)
    Z, at = _floats(numbers, at, q * q)
    z, at = _floats(numbers, at, q)
    step, at = _floats(numbers, at, n)
    A, at = _floats(numbers, at, 36)
    X, at = _floats(numbers, at, 6 * t)
    K, at = _floats(numbers, at, 36)
    s1, at = _floats(numbers, at, 6)
    s2, at = _floats(numbers, at, 6)
    s3, at = _floats(numbers, at, 6)
    return Work(
        w.reshape((m, 3)), v.reshape((m, 3)), o.reshape((m, 3)), R.reshape((3, 3)), p, J.reshape((n, 6)),
        G.reshape((n, 3)), residual, gap, L.reshape((b, 6, 6)), D.reshape((b, 6)), order.reshape((b, 6)),
        U.reshape((b, 6, 6)), Y.reshape((b, 6, q)), a.reshape((b, 6)), T.reshape((t, t)), F.reshape((t, t)),
        swaps, pivots, right, Q.reshape((6, 6)), Y_end.reshape((6, q)), Z.reshape((q, q)), z, step,
        A.reshape((6, 6)), X.reshape((6, t)), K.reshape((6, 6)), s1, s2, s3,
    )  # fmt: skip


@kernel
def forward(model: Arrays, x: Floats, work: Work) -> None:
    """Kinematics (1), (2): joint axes, points on them, the end-effector's frame and velocities."""
    R, p, w, o, v = work.R, work.p, work.w, work.o, work.v
    for a in range(3):
        p[a] = 0.0
        for b in range(3):
            R[a, b] = 1.0 if a == b else 0.0
    for j in range(len(model.rotary)):
        if model.moved[j]:
            _move(R, p, model.R0[j], model.p0[j])
        k = model.along[j]
        if k >= 0:
            for a in range(3):
                w[j, a] = R[a, k]
        else:
            for a in range(3):
                w[j, a] = R[a, 0] * model.axis[j, 0] + R[a, 1] * model.axis[j, 1] + R[a, 2] * model.axis[j, 2]
        for a in range(3):
            o[j, a] = p[a]
        value = model.factor[j] * x[model.coordinate[j]]
        if not model.rotary[j]:
            for a in range(3):
                p[a] += value * w[j, a]
        elif k >= 0:
            c, s = np.cos(value), np.sin(value)
            k1, k2 = (k + 1) % 3, (k + 2) % 3
            for a in range(3):
                r1, r2 = R[a, k1], R[a, k2]
                R[a, k1] = c * r1 + s * r2
                R[a, k2] = c * r2 - s * r1
        else:
            turn_about(R, w[j], value)
    _move(R, p, model.R_tail, model.p_tail)
    for j in range(len(model.rotary)):
        if model.rotary[j]:
            r0, r1, r2 = p[0] - o[j, 0], p[1] - o[j, 1], p[2] - o[j, 2]
            v[j, 0] = w[j, 1] * r2 - w[j, 2] * r1
            v[j, 1] = w[j, 2] * r0 - w[j, 0] * r2
            v[j, 2] = w[j, 0] * r1 - w[j, 1] * r0
        else:
            for a in range(3):
                v[j, a] = w[j, a]


@kernel
def _move(R: Floats, p: Floats, R0: Floats, p0: Floats) -> None:
    for a in range(3):
        p[a] += R[a, 0] * p0[0] + R[a, 1] * p0[1] + R[a, 2] * p0[2]
        r0 = R[a, 0] * R0[0, 0] + R[a, 1] * R0[1, 0] + R[a, 2] * R0[2, 0]
        r1 = R[a, 0] * R0[0, 1] + R[a, 1] * R0[1, 1] + R[a, 2] * R0[2, 1]
        r2 = R[a, 0] * R0[0, 2] + R[a, 1] * R0[1, 2] + R[a, 2] * R0[2, 2]
        R[a, 0], R[a, 1], R[a, 2] = r0, r1, r2


@kernel
def turn_about(R: Floats, w: Floats, angle: float) -> None:
    """Turn a frame about a world axis: each column by Rodrigues' formula."""
    c, s = np.cos(angle), np.sin(angle)
    for b in range(3):
        r0, r1, r2 = R[0, b], R[1, b], R[2, b]
        d = (1.0 - c) * (w[0] * r0 + w[1] * r1 + w[2] * r2)
        R[0, b] = c * r0 + s * (w[1] * r2 - w[2] * r1) + d * w[0]
        R[1, b] = c * r1 + s * (w[2] * r0 - w[0] * r2) + d * w[1]
        R[2, b] = c * r2 + s * (w[0] * r1 - w[1] * r0) + d * w[2]


@kernel
def missing(work: Work, R_to: Floats, p_to: Floats) -> bool:
    """Displacement from the end-effector to a target frame; false where it is half a turn away."""
    R, gap = work.R, work.gap
    for a in range(3):
        gap[a] = p_to[a] - work.p[a]
    # the relative rotation R_to Rᵀ in the world
    t = 0.0
    for a in range(3):
        for b in range(3):
            s = R_to[a, 0] * R[b, 0] + R_to[a, 1] * R[b, 1] + R_to[a, 2] * R[b, 2]
            work.A[a, b] = s
        t += work.A[a, a]
    A = work.A
    x, y, z = 0.5 * (A[2, 1] - A[1, 2]), 0.5 * (A[0, 2] - A[2, 0]), 0.5 * (A[1, 0] - A[0, 1])
    sine, cosine = np.sqrt(x * x + y * y + z * z), 0.5 * (t - 1.0)
    scale = 1.0
    if sine > 1e-9:
        scale = np.arctan2(sine, cosine) / sine
    elif not cosine > 0.0:
        return False
    gap[3], gap[4], gap[5] = x * scale, y * scale, z * scale
    return True


@entry
def positions(integers: Ints, numbers: Floats, x: Floats, joint: Ints, offset: Floats, out: Floats) -> None:
    """World positions ``(k, 3)`` of points fixed behind joints, in the order of the joints."""
    model = model_of(integers, numbers)
    R, p, w = np.eye(3), np.zeros(3), np.empty(3)
    k = 0
    for j in range(-1, len(model.rotary)):
        if j >= 0:
            if model.moved[j]:
                _move(R, p, model.R0[j], model.p0[j])
            for a in range(3):
                w[a] = R[a, 0] * model.axis[j, 0] + R[a, 1] * model.axis[j, 1] + R[a, 2] * model.axis[j, 2]
            value = model.factor[j] * x[model.coordinate[j]]
            if model.rotary[j]:
                turn_about(R, w, value)
            else:
                for a in range(3):
                    p[a] += value * w[a]
        while k < len(joint) and joint[k] == j:
            for a in range(3):
                out[k, a] = p[a] + R[a, 0] * offset[k, 0] + R[a, 1] * offset[k, 1] + R[a, 2] * offset[k, 2]
            k += 1
