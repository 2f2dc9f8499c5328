"""A lumped model and the kernels' workspace as arrays, packed into a few flat buffers.

All quantities are dimensionless: lengths over the model's length, forces and moments over its units.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vjm.kernels.compilation import entry, kernel

LINEAR, BEAM_COLUMN, PASSIVE = 0, 1, 2
"""Kinds of blocks."""

Ints = np.ndarray[Any, np.dtype[np.int64]]
Floats = np.ndarray[Any, np.dtype[np.float64]]


class PackedModel(NamedTuple):
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
        natural: ``(n,)`` coordinates at which the springs are free of stress.
        point_joint: ``(l,)`` last joint before each loaded point, increasing; and
        point_offset: ``(l, 3)`` where it lies in the frame behind that joint.
        follows: ``(l,)`` whether its load turns with that frame.
        turning: ``(k,)`` the points whose loads' tangent is not symmetric, see `vjm.kernels.unsymmetric`.
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
    natural: Floats
    point_joint: Ints
    point_offset: Floats
    follows: Ints
    turning: Ints


class Workspace(NamedTuple):
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
        load: ``(l, 6)`` wrenches on the loaded points, in the axes of the frames that they follow, else of the
            world; written by the caller.
        point: ``(l, 3)`` where they are and acting: ``(l, 6)`` the wrenches, in the world.
        hung: ``(m, 4)`` what the loads behind a joint do to it, see `vjm.kernels.recursion.apply_loads`.
        W: ``(3k, n)``, S: ``(3k, n)``, reaction: ``(3k, 6)``, M: ``(3k, 3k)``, determinant: ``(1,)`` of its
            inverse, turns: ``(3k,)`` and unit: ``(l, 6)``, both scratch: see `vjm.kernels.unsymmetric`.
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
    load: Floats
    point: Floats
    acting: Floats
    hung: Floats
    W: Floats
    S: Floats
    reaction: Floats
    M: Floats
    determinant: Floats
    turns: Floats
    unit: Floats


class Buffers(NamedTuple):
    """A model and its workspace as four flat arrays: what crosses from Python to compiled code in a microsecond.

    Attributes:
        integers: sizes m, b, n, n_q, l, k, then the model's integer arrays.
        numbers: the model's other arrays.
        work_integers: the workspace's integer arrays.
        work_numbers: its other arrays.
    """

    integers: Ints
    numbers: Floats
    work_integers: Ints
    work_numbers: Floats


def buffers(model: PackedModel) -> Buffers:
    """Pack a model, and allocate what the kernels write."""
    m, b, n = len(model.rotary), len(model.kind), int(model.first[-1])
    q = int(np.count_nonzero(model.kind == PASSIVE))
    t, points, turns = 6 + q, len(model.point_joint), 3 * len(model.turning)
    integers = [np.array([m, b, n, q, points, len(model.turning)]), model.rotary, model.along, model.moved,
                model.coordinate, model.kind, model.first, model.joints, model.point_joint, model.follows,
                model.turning]  # fmt: skip
    numbers = [model.axis, model.R0, model.p0, model.factor, model.K, model.beam, model.R_tail, model.p_tail,
               model.natural, model.point_offset]  # fmt: skip
    # in the order of `work_of`
    size = 9 * m + 12 + 10 * n + 6 + b * (36 + 6 + 36 + 6 * q + 6) + 2 * t * t + t + 36 + 6 * q + q * q + q
    size += n + 36 + 6 * t + 36 + 6 + 6 + 6 + 21 * points + 4 * m
    size += turns * (2 * n + 6 + turns + 1) + 1
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
def model_of(integers: Ints, numbers: Floats) -> PackedModel:
    """The model's arrays as views of its buffers."""
    m, b, n, points, turns = integers[0], integers[1], integers[2], integers[4], integers[5]
    at = 6
    rotary, at = _ints(integers, at, m)
    along, at = _ints(integers, at, m)
    moved, at = _ints(integers, at, m)
    coordinate, at = _ints(integers, at, m)
    kind, at = _ints(integers, at, b)
    first, at = _ints(integers, at, b + 1)
    joints, at = _ints(integers, at, b + 1)
    point_joint, at = _ints(integers, at, points)
    follows, at = _ints(integers, at, points)
    turning, at = _ints(integers, at, turns)
    at = 0
    axis, at = _floats(numbers, at, 3 * m)
    R0, at = _floats(numbers, at, 9 * m)
    p0, at = _floats(numbers, at, 3 * m)
    factor, at = _floats(numbers, at, m)
    K, at = _floats(numbers, at, 36 * b)
    beam, at = _floats(numbers, at, 7 * b)
    R_tail, at = _floats(numbers, at, 9)
    p_tail, at = _floats(numbers, at, 3)
    natural, at = _floats(numbers, at, n)
    point_offset, at = _floats(numbers, at, 3 * points)
    return PackedModel(
        rotary, axis.reshape((m, 3)), along, moved, R0.reshape((m, 3, 3)), p0.reshape((m, 3)), coordinate, factor,
        kind, first, joints, K.reshape((b, 6, 6)), beam.reshape((b, 7)), R_tail.reshape((3, 3)), p_tail,
        natural, point_joint, point_offset.reshape((points, 3)), follows, turning,
    )  # fmt: skip


@entry
def work_of(sizes: Ints, integers: Ints, numbers: Floats) -> Workspace:
    """The workspace as views of its buffers; ``sizes`` are the first six integers of the model."""
    m, b, n, q, points = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    t, k = 6 + q, 3 * sizes[5]
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
    load, at = _floats(numbers, at, 6 * points)
    point, at = _floats(numbers, at, 3 * points)
    acting, at = _floats(numbers, at, 6 * points)
    hung, at = _floats(numbers, at, 4 * m)
    W, at = _floats(numbers, at, k * n)
    S, at = _floats(numbers, at, k * n)
    reaction, at = _floats(numbers, at, 6 * k)
    M, at = _floats(numbers, at, k * k)
    determinant, at = _floats(numbers, at, 1)
    turns, at = _floats(numbers, at, k)
    unit, at = _floats(numbers, at, 6 * points)
    return Workspace(
        w.reshape((m, 3)), v.reshape((m, 3)), o.reshape((m, 3)), R.reshape((3, 3)), p, J.reshape((n, 6)),
        G.reshape((n, 3)), residual, gap, L.reshape((b, 6, 6)), D.reshape((b, 6)), order.reshape((b, 6)),
        U.reshape((b, 6, 6)), Y.reshape((b, 6, q)), a.reshape((b, 6)), T.reshape((t, t)), F.reshape((t, t)),
        swaps, pivots, right, Q.reshape((6, 6)), Y_end.reshape((6, q)), Z.reshape((q, q)), z, step,
        A.reshape((6, 6)), X.reshape((6, t)), K.reshape((6, 6)), s1, s2, s3,
        load.reshape((points, 6)), point.reshape((points, 3)), acting.reshape((points, 6)), hung.reshape((m, 4)),
        W.reshape((k, n)), S.reshape((k, n)), reaction.reshape((k, 6)), M.reshape((k, k)), determinant, turns,
        unit.reshape((points, 6)),
    )  # fmt: skip
