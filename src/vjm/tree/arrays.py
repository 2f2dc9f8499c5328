"""A tree as the arrays that its kernels take, and what they write; N, mm, rad."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.compilation import kernel
from vjm.kernels.packed_model import Floats, Ints

GROWS = 3.0
"""Length of a segment that grows over the value of its joints ``grows``: the halves' weights are a third of a
half from the ends."""
SHORTEST = 1e-2
"""mm: a segment that grows is not shorter, for the stiffness would have no end."""


class TreeArrays(NamedTuple):
    """A machine as arrays; m joints, n coordinates, b blocks of springs, l loads, s point springs, e end frames.

    Attributes:
        parent: ``(m,)`` joint before each, −1 for the base; smaller than its own index.
        rotary: ``(m,)`` whether it turns.
        axis: ``(m, 3)`` in its own frame.
        R0: ``(m, 3, 3)`` and
        p0: ``(m, 3)`` the rigid transform before it.
        coordinate: ``(m,)`` that drives it, −1 for none.
        factor: ``(m,)`` how much of it.
        kind: ``(b,)`` see `vjm.kernels.packed_model`.
        first: ``(b + 1,)`` first coordinate of each block.
        K: ``(b, 6, 6)`` stiffness of linear springs.
        beam: ``(b, 7)`` of beam-column springs.
        grows: ``(b,)`` joint whose value is a third of the length h of a beam-column segment; its ``beam`` is then
            that of h = 1. −1 where the length is in ``beam``.
        unit: ``(n,)`` 1 for turns, a length for shifts: what is large for a step.
        load_joint: ``(l,)`` last joint before each load, never −1.
        load_offset: ``(l, 3)`` behind it.
        load: ``(l, 6)`` wrench in the world, of followers at the unloaded posture.
        follows: ``(l,)`` whether it turns with the body.
        load_grows: ``(l,)`` joint whose value is a third of the length of what weighs: ``load`` is then that of
            1 mm. −1 where the load is what it is.
        spring_joint: ``(s, 2)`` last joints before the two points, −1 for the base.
        spring_point: ``(s, 2, 3)`` behind them.
        spring: ``(s, 3)`` stiffness, free length, preload.
        end_joint: ``(e,)`` last joint before each end frame.
        end_R: ``(e, 3, 3)`` and
        end_p: ``(e, 3)`` behind it.
    """

    parent: Ints
    rotary: Ints
    axis: Floats
    R0: Floats
    p0: Floats
    coordinate: Ints
    factor: Floats
    kind: Ints
    first: Ints
    K: Floats
    beam: Floats
    grows: Ints
    unit: Floats
    load_joint: Ints
    load_offset: Floats
    load: Floats
    follows: Ints
    load_grows: Ints
    spring_joint: Ints
    spring_point: Floats
    spring: Floats
    end_joint: Ints
    end_R: Floats  # noqa: N815
    end_p: Floats


class TreeWork(NamedTuple):
    """What the kernels write.

    Attributes:
        R: ``(m, 3, 3)`` and p: ``(m, 3)`` the frames behind the joints.
        w: ``(m, 3)`` their axes, o: ``(m, 3)`` points on them.
        S: ``(m, 15)`` sums over what is behind a joint: forces, moments, dyads of position and force.
        G: ``(m, 3)`` coupling to rotations before, Q: ``(m,)`` force on a joint.
        body: ``(l, 6)`` followers in their bodies' axes.
        t: ``(n,)`` forces on the coordinates, r: ``(n,)`` the statics' residual.
        A: ``(n, n)`` the tangent, then its factor; swaps: ``(n,)`` of its rows.
        B: ``(n, n)`` scratch of the same size.
        J: ``(6, n)`` a Jacobian, Z: ``(n, 6)`` solutions, Kb: ``(6, 6)``, u: ``(6,)``, v: ``(6,)``, beam:
            ``(7,)`` scratch.
        end_R: ``(e, 3, 3)`` and end_p: ``(e, 3)`` the end frames.
        begin: ``(n,)`` where Newton's method began.
        swaps6: ``(6,)`` scratch.
    """

    R: Floats
    p: Floats
    w: Floats
    o: Floats
    S: Floats
    G: Floats
    Q: Floats
    body: Floats
    t: Floats
    r: Floats
    A: Floats
    swaps: Ints
    B: Floats
    J: Floats
    Z: Floats
    Kb: Floats
    u: Floats
    v: Floats
    beam: Floats
    end_R: Floats  # noqa: N815
    end_p: Floats
    begin: Floats
    swaps6: Ints


@kernel
def workspace(model: TreeArrays) -> TreeWork:
    """Arrays for the kernels to write."""
    m, n, e = len(model.parent), len(model.unit), len(model.end_joint)
    return TreeWork(
        np.zeros((m, 3, 3)), np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((m, 15)),
        np.zeros((m, 3)), np.zeros(m), np.zeros((len(model.load_joint), 6)), np.zeros(n), np.zeros(n),
        np.zeros((n, n)), np.zeros(n, np.int64), np.zeros((n, n)), np.zeros((6, n)), np.zeros((n, 6)),
        np.zeros((6, 6)), np.zeros(6), np.zeros(6), np.zeros(7), np.zeros((e, 3, 3)), np.zeros((e, 3)),
        np.zeros(n), np.zeros(6, np.int64),
    )  # fmt: skip
