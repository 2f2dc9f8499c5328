"""A machine as the arrays that its kernels take, and what they write; N, mm, rad.

The machine without its closures is a tree of one-degree joints. What Newton's method eliminates is its *units*: a
block of springs, whose joints stand in a row, or one joint whose coordinate stays, because it has no spring of its
own or drives other joints too. What stays is the *border*: closures' wrenches, forces of springs between points,
multipliers of couplings, wrenches of loads that turn, and these coordinates. A *subtree* here stands on the ground:
it has the columns of the border that touch it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.experimental import structref

from vjm.kernels.compilation import entry

LINEAR, BEAM_COLUMN, PASSIVE, LAW = 0, 1, 2, 3
"""Kinds of blocks; a spring with a law has one coordinate, which stays in the border."""
GROWS = 3.0
"""Length of a segment that grows over the value of its joints ``grows``: the halves' weights are a third of a
half from the ends."""
SHORTEST = 1e-5
"""mm: a segment that grows is not shorter, for the stiffness would have no end. It turns by 1e-8 of what a beam of
a metre does."""
OWN = 4
"""Columns of a subtree before those of the border: the rotation of the body before a unit, and the right side."""

Ints = np.ndarray[Any, np.dtype[np.int64]]
Floats = np.ndarray[Any, np.dtype[np.float64]]


class MachineArrays(NamedTuple):
    """A machine: m joints, n coordinates, b blocks, u units, h subtrees, l loads, s point springs, c closures.

    Attributes:
        parent: ``(m,)`` joint before each, −1 for the ground; smaller than its own index.
        rotary: ``(m,)`` whether it turns.
        axis: ``(m, 3)`` in its own frame.
        along: ``(m,)`` 0, 1, 2 where the axis is x, y, z of that frame, else −1.
        R0: ``(m, 3, 3)`` and
        p0: ``(m, 3)`` the rigid transform before it.
        moved: ``(m,)`` whether that is more than the identity.
        coordinate: ``(m,)`` that drives it, −1 for none.
        factor: ``(m,)`` how much of it.
        kind: ``(b,)`` of the blocks.
        first: ``(b + 1,)`` first coordinate of each block.
        K: ``(b, 6, 6)`` stiffness of linear springs.
        beam: ``(b, 7)`` EA, GJ, EIy, EIz, h, h/GAy, h/GAz of beam-column springs.
        grows: ``(b,)`` joint whose value is a third of the length h of a beam-column segment; its ``beam`` is then
            that of h = 1. −1 where the length is in ``beam``.
        unit: ``(n,)`` 1 for turns, a length for shifts: what is large for a step.
        energy: ``(1,)`` unit of energy, N mm, and
        length: ``(1,)`` unit of length, mm, by which forces are compared with moments.
        unit_joint: ``(u, 2)`` first joint of each unit and one past its last.
        unit_block: ``(u,)`` its block, −1 where its coordinate stays in the border.
        unit_column: ``(u,)`` place in the border of its coordinate, −1 where it is eliminated.
        unit_row: ``(u + 1,)`` first row of each unit.
        unit_above: ``(u,)`` unit before each, −1 for none; smaller than its own index.
        unit_subtree: ``(u,)``.
        carrier: ``(m,)`` unit at or before each joint, −1 for none.
        subtree_width: ``(h, 2)`` columns of each subtree, without and with those of the end frames.
        subtree_column: ``(h, x)`` place in the border of each of these but the first `OWN`.
        local: ``(h, g)`` column of a subtree for each place in the border, −1 where that does not touch it.
        size: ``(7,)`` where in the border the closures' wrenches, couplings, springs between points, coordinates,
            turning loads and end frames begin, and where the end frames end.
        spare: ``(2,)`` number of the closures' rows that others imply, and of idle motions, such as that of a rod
            that turns between two balls.
        source_first: ``(u + 1,)`` first of each unit's sources, and
        source: ``(z, 4)`` what of the border a unit moves: kind, index, side, column of its subtree.
        load_joint: ``(l,)`` last joint before each load, never −1.
        load_offset: ``(l, 3)`` behind it.
        load: ``(l, 6)`` wrench in the world, of followers at the unloaded posture.
        follows: ``(l,)`` whether it turns with the body.
        load_end: ``(l,)`` end frame whose wrench the load is, −1 for none; then no end frame's wrench acts else.
        load_grows: ``(l,)`` joint whose value is a third of the length of what weighs: ``load`` is then that of
            1 mm. −1 where the load is what it is.
        turning: ``(k,)`` loads that are followers or moments: their tangent is not symmetric.
        spring_joint: ``(s, 2)`` last joints before the two points, −1 for the ground.
        spring_point: ``(s, 2, 3)`` behind them.
        spring: ``(s, 3)`` stiffness, free length, preload.
        spring_law: ``(s,)`` law in place of the stiffness, −1 for none.
        law_first: ``(w + 1,)`` first knot of each of w laws,
        law_knot: their knots and
        law_piece: ``(…, 5)`` polynomials, one more for each law than knots, see `vjm.kernels.statics`.
        law_most: ``(w,)`` the largest slope of each.
        closure_joint: ``(c, 2)`` last joints before the two frames, −1 for the ground.
        closure_R: ``(c, 2, 3, 3)`` and
        closure_p: ``(c, 2, 3)`` behind them.
        closure_rows: ``(c,)`` components held: 6 of a weld, 3 of a ball.
        closure_first: ``(c + 1,)`` first row of each among the closures' rows.
        border: ``(n_q,)`` coordinates that stay, and
        border_joint: ``(n_q,)`` the joint at whose commanded value each stands.
        border_K: ``(n_q, n_q)`` their linear springs.
        border_law: ``(n_q,)`` the law of the spring of each, −1 for none.
        coupling: ``(k, n_q)`` weights of coordinates that a transmission couples.
        total: ``(k,)`` of the weighted coordinates.
        end_joint: ``(e,)`` last joint before each end frame.
        end_R: ``(e, 3, 3)`` and
        end_p: ``(e, 3)`` behind it.
    """

    parent: Ints
    rotary: Ints
    axis: Floats
    along: Ints
    R0: Floats
    p0: Floats
    moved: Ints
    coordinate: Ints
    factor: Floats
    kind: Ints
    first: Ints
    K: Floats
    beam: Floats
    grows: Ints
    unit: Floats
    energy: Floats
    length: Floats
    unit_joint: Ints
    unit_block: Ints
    unit_column: Ints
    unit_row: Ints
    unit_above: Ints
    unit_subtree: Ints
    carrier: Ints
    subtree_width: Ints
    subtree_column: Ints
    local: Ints
    size: Ints
    spare: Ints
    source_first: Ints
    source: Ints
    load_joint: Ints
    load_offset: Floats
    load: Floats
    follows: Ints
    load_end: Ints
    load_grows: Ints
    turning: Ints
    spring_joint: Ints
    spring_point: Floats
    spring: Floats
    spring_law: Ints
    law_first: Ints
    law_knot: Floats
    law_piece: Floats
    law_most: Floats
    closure_joint: Ints
    closure_R: Floats  # noqa: N815
    closure_p: Floats
    closure_rows: Ints
    closure_first: Ints
    border: Ints
    border_joint: Ints
    border_K: Floats  # noqa: N815
    border_law: Ints
    coupling: Floats
    total: Floats
    end_joint: Ints
    end_R: Floats  # noqa: N815
    end_p: Floats


class Work(NamedTuple):
    """What the kernels write; t places in the border, y of them symmetric, g with the end frames, r rows of units.

    Attributes:
        R: ``(m, 3, 3)`` and p: ``(m, 3)`` the frames behind the joints; w: ``(m, 3)`` their axes, o: ``(m, 3)``
            points on them.
        S: ``(u + 1, 15)`` sums over what is fixed to a unit, then over all behind it, of the ground last: forces,
            moments, dyads of position and force.
        body: ``(l, 6)`` followers in their bodies' axes; acting: ``(l, 6)`` all loads in the world, point:
            ``(l, 3)`` where they act.
        wrench: ``(f,)`` the closures' wrenches, world axes, at the second frame, then the couplings' forces; gap:
            ``(f,)`` what they miss;
            place: ``(c, 3)`` where they are.
        pull: ``(s, 9)`` axes of the springs between points, along and across; sign: ``(s, 3)`` and scale:
            ``(s, 3)`` of their stiffnesses, the roots of their sizes; spring_at: ``(s, 2, 3)`` their points.
        end_R: ``(e, 3, 3)`` and end_p: ``(e, 3)`` the end frames.
        t: ``(n,)`` forces on the coordinates, r: ``(n,)`` the statics' residual.
        W: ``(r, 3)`` turn and V: ``(r, 3)`` velocity at the reference point by each row's coordinate.
        X: ``(r, x)`` rows of the units, D: ``(r,)`` inverse pivots, L: ``(r, 6)``, order: ``(r,)``.
        up: ``(u, 3, x)`` what a unit passes on; P: ``(h, x, x)`` sums of the subtrees, upper triangles.
        T: ``(g + 1, g + 1)`` matrix of the border, its right side last; scale_T: ``(g,)`` units of the border;
            F: ``(y, y)`` its factor, swaps: ``(y,)``, pivots: ``(y,)``.
        Z: ``(y, t - y)``, N: ``(t - y, 6)`` and M: ``(t - y, t - y)`` of loads that turn, see `border`.
        right: ``(g + 1,)`` right side of the border, y: ``(g + 1,)`` its solution, with 1 last.
        step: ``(n,)`` motion; turn: ``(u + 1, 3)`` of the units' bodies, of the ground last; b: ``(r,)`` and
            passed: ``(u + 1, 3)`` of another right side.
        A: ``(6, 6)``, law: ``(6, 6)``, force: ``(6,)``, units: ``(6,)``, beam: ``(7,)``, strain: ``(6,)`` scratch.
        wide: ``(h + 1,)`` columns of each subtree, then the first place in the border that is not taken; column_of:
            ``(h, x)`` place in the border of each column; unit_width: ``(u,)`` columns when a unit was eliminated;
            row_column: ``(r,)`` place in the border of a coordinate whose pivot cancels, else −1; own: ``(6,)``
            stiffness of each of a unit's coordinates alone.
        begin: ``(n,)`` and begin_wrench: ``(f,)`` where Newton's method began.
        state: ``(5,)`` negative pivots of the units; how many eigenvalues of the whole are negative on what the
            closures leave; rank of the border; whether the determinant of loads that turn is negative. The last one
            says whether laws have their largest slope in place of their tangent.
        law_slope: ``(n_q,)`` slope with which the law of each coordinate in the border stands in T.
    """

    R: Floats
    p: Floats
    w: Floats
    o: Floats
    S: Floats
    body: Floats
    acting: Floats
    point: Floats
    wrench: Floats
    gap: Floats
    place: Floats
    pull: Floats
    sign: Floats
    scale: Floats
    spring_at: Floats
    end_R: Floats  # noqa: N815
    end_p: Floats
    t: Floats
    r: Floats
    W: Floats
    V: Floats
    X: Floats
    D: Floats
    L: Floats
    order: Ints
    up: Floats
    P: Floats
    T: Floats
    scale_T: Floats  # noqa: N815
    F: Floats
    swaps: Ints
    pivots: Ints
    Z: Floats
    N: Floats
    M: Floats
    right: Floats
    y: Floats
    step: Floats
    turn: Floats
    b: Floats
    passed: Floats
    A: Floats
    law: Floats
    force: Floats
    units: Floats
    beam: Floats
    strain: Floats
    wide: Ints
    column_of: Ints
    unit_width: Ints
    row_column: Ints
    own: Floats
    begin: Floats
    begin_wrench: Floats
    state: Ints
    law_slope: Floats


def workspace(model: MachineArrays) -> Work:
    """Arrays for the kernels to write."""
    m, n, u = len(model.parent), len(model.unit), len(model.unit_block)
    loads, s, c, e = len(model.load_joint), len(model.spring), len(model.closure_rows), len(model.end_joint)
    r, h, f = model.unit_row[u], len(model.subtree_width), model.size[2]
    y, t, g = model.size[4], model.size[5], model.size[6]
    x = OWN
    for subtree in range(h):
        x = max(x, model.subtree_width[subtree, 1])
    # those that are added for coordinates whose pivots cancel
    x += y - model.size[3] - len(model.border)
    return Work(
        np.zeros((m, 3, 3)), np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((u + 1, 15)),
        np.zeros((loads, 6)), np.zeros((loads, 6)), np.zeros((loads, 3)), np.zeros(f), np.zeros(f),
        np.zeros((c, 3)), np.zeros((s, 9)), np.zeros((s, 3)), np.zeros((s, 3)), np.zeros((s, 2, 3)),
        np.zeros((e, 3, 3)), np.zeros((e, 3)), np.zeros(n), np.zeros(n), np.zeros((r, 3)), np.zeros((r, 3)),
        np.zeros((r, x)), np.zeros(r), np.zeros((r, 6)), np.zeros(r, dtype=np.int64), np.zeros((u, 3, x)),
        np.zeros((h, x, x)), np.zeros((g + 1, g + 1)), np.zeros(g), np.zeros((y, y)), np.zeros(y, dtype=np.int64),
        np.zeros(y, dtype=np.int64), np.zeros((y, t - y)), np.zeros((t - y, 6)), np.zeros((t - y, t - y)),
        np.zeros(g + 1), np.zeros(g + 1), np.zeros(n), np.zeros((u + 1, 3)), np.zeros(r), np.zeros((u + 1, 3)),
        np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6), np.zeros(6), np.zeros(7), np.zeros(6),
        np.zeros(h + 1, dtype=np.int64), np.zeros((h, x), dtype=np.int64), np.zeros(u, dtype=np.int64),
        np.zeros(r, dtype=np.int64), np.zeros(6),
        np.zeros(n), np.zeros(f), np.zeros(5, dtype=np.int64),
        np.zeros(len(model.border)),
    )  # fmt: skip


# their stubs have no types
unliteral: Any = types.unliteral
define_proxy: Any = structref.define_proxy


class _Object(types.StructRef):
    """What compiled code takes by reference: a tuple of a hundred arrays is a thousand words at every call."""

    def preprocess_fields(self, fields: tuple[tuple[str, types.Type], ...]) -> tuple[tuple[str, types.Type], ...]:
        """A field has the type of its first value."""
        return tuple((name, unliteral(kind)) for name, kind in fields)


@structref.register
class _MachineType(_Object):
    pass


@structref.register
class _WorkType(_Object):
    pass


class MachineObject(structref.StructRefProxy):
    """`MachineArrays` as kernels take them."""


class WorkObject(structref.StructRefProxy):
    """`Work` as kernels take it."""


define_proxy(MachineObject, _MachineType, list(MachineArrays._fields))
define_proxy(WorkObject, _WorkType, list(Work._fields))
new_machine: Any = MachineObject
new_work: Any = WorkObject


@entry
def machine_object(arrays: MachineArrays) -> MachineArrays:
    """The arrays of a machine as one object for the kernels; it shares them."""
    made: MachineArrays = new_machine(*arrays)
    return made


@entry
def work_object(arrays: Work) -> Work:
    """The kernels' workspace as one object; it shares the arrays."""
    made: Work = new_work(*arrays)
    return made
