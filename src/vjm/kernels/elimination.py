"""Compiled elimination of a machine's springs, from the leaves to the ground.

Its cost is linear in their number. Solutions with its factors go from the leaves to the border and back again.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import LINEAR, OWN, Floats, Ints, MachineArrays, Work
from vjm.kernels.beam_column import beam_column
from vjm.kernels.compilation import kernel
from vjm.kernels.statics import grown

CANCELLED = 1e-2
"""Share of a coordinate's own stiffness below which its pivot stays in the border: two digits are lost at most."""
NONE = 5e-32
"""Square of rounding: a pivot below this share of its coordinate's own stiffness, or of the largest, is zero."""
WELD, BALL, SPRING, TURNING, END = 0, 1, 2, 3, 4
"""What a column of the border stands for."""


@kernel
def pivoted(
    A: Floats, k: int, size: Floats, room: int, L: Floats, D: Floats, order: Ints, row: int
) -> tuple[int, int]:
    """Factor a symmetric ``A[:k, :k]``, largest pivots first, into rows from ``row`` on of L, inverse D and order.

    The rest of a pivot is compared with the ``size`` (6,) that its coordinate alone has. Where cancellation has
    taken most of it, dividing by it would lose digits: the rest is left in A where there is ``room`` for it.

    Returns:
        How many pivots were taken, and how many of these are negative; −1 if one is zero.
    """
    negative = 0
    for i in range(k):
        order[row + i] = i
    for i in range(k):
        best, largest = i, -1.0
        for r in range(i, k):
            share = abs(A[r, r]) / size[order[row + r]]
            if share > largest:
                best, largest = r, share
        if largest < CANCELLED and k - i <= room:
            return i, negative
        if best != i:
            order[row + i], order[row + best] = order[row + best], order[row + i]
            for c in range(k):
                A[i, c], A[best, c] = A[best, c], A[i, c]
            for c in range(k):
                A[c, i], A[c, best] = A[c, best], A[c, i]
            for c in range(i):
                L[row + i, c], L[row + best, c] = L[row + best, c], L[row + i, c]
        d = A[i, i]
        if not largest > NONE or not np.isfinite(d):
            return i, -1
        if d < 0.0:
            negative += 1
        D[row + i] = 1.0 / d
        for r in range(i + 1, k):
            f = A[r, i] / d
            L[row + r, i] = f
            for c in range(i + 1, r + 1):
                A[r, c] -= f * A[c, i]
        for r in range(i + 1, k):
            for c in range(i + 1, r):
                A[c, r] = A[r, c]
    return k, negative


@kernel
def six_rows(X: Floats, D: Floats, row: int, width: int, up: Floats, P: Floats, u: int, subtree: int) -> None:
    """Add ``Bᵀ D⁻¹ B`` of six rows from ``row`` on at once: a beam's spring, with which most time is spent."""
    x0, x1, x2, x3, x4, x5 = X[row], X[row + 1], X[row + 2], X[row + 3], X[row + 4], X[row + 5]
    d0, d1, d2, d3, d4, d5 = D[row], D[row + 1], D[row + 2], D[row + 3], D[row + 4], D[row + 5]
    for q in range(width):
        f0, f1, f2, f3, f4, f5 = d0 * x0[q], d1 * x1[q], d2 * x2[q], d3 * x3[q], d4 * x4[q], d5 * x5[q]
        if q < OWN - 1:
            to, first = up[u, q], 0
        elif f0 == f1 == f2 == f3 == f4 == f5 == 0.0:
            # most units touch few places of the border
            continue
        else:
            to, first = P[subtree, q], q
        for c in range(first, width):
            to[c] += f0 * x0[c] + f1 * x1[c] + f2 * x2[c] + f3 * x3[c] + f4 * x4[c] + f5 * x5[c]


@kernel
def eliminate(model: MachineArrays, command: Floats, natural: Floats, x: Floats, ends: bool, work: Work) -> int:
    """Eliminate all units at placed bodies and gathered loads.

    Args:
        model: the machine.
        command: ``(m,)`` values of the held joints.
        natural: ``(n,)`` coordinates at which the springs are free of stress.
        x: ``(n,)`` coordinates.
        ends: whether with the columns of the end frames.
        work: written.

    Returns:
        Number of negative pivots; −1 where one is zero.
    """
    w, o, S, W, V, X, up, P = work.w, work.o, work.S, work.W, work.V, work.X, work.up, work.P
    A, force, units, beam, strain, law = work.A, work.force, work.units, work.beam, work.strain, work.law
    t, r = work.t, work.r
    place, spring_at, point, end_p, pull, scale = (
        work.place, work.spring_at, work.point, work.end_p, work.pull, work.scale,
    )  # fmt: skip
    rotary, factor, coordinate, source = model.rotary, model.factor, model.coordinate, model.source
    unit_joint, unit_row, unit_above = model.unit_joint, model.unit_row, model.unit_above
    unit_subtree = model.unit_subtree
    unit_block, unit_column = model.unit_block, model.unit_column
    subtree_width, first = model.subtree_width, model.first
    border, source_first, local, kind = model.border, model.source_first, model.local, model.kind
    K, grows, unit, beams = model.K, model.grows, model.unit, model.beam
    subtree_column, column_of, wide, unit_width = model.subtree_column, work.column_of, work.wide, work.unit_width
    row_column, scale_T, size = work.row_column, work.scale_T, work.own
    L, D, order = work.L, work.D, work.order
    O0 = O1 = O2 = 0.0
    if len(end_p):
        O0, O1, O2 = end_p[0, 0], end_p[0, 1], end_p[0, 2]
    which = 1 if ends else 0
    for u in range(len(unit_block)):
        for a in range(3):
            for c in range(subtree_width[unit_subtree[u], which]):
                up[u, a, c] = 0.0
    for subtree in range(len(subtree_width)):
        wide[subtree] = subtree_width[subtree, which]
        for c in range(wide[subtree]):
            column_of[subtree, c] = subtree_column[subtree, c - OWN] if c >= OWN else -1
            for b in range(wide[subtree]):
                P[subtree, c, b] = 0.0
    # places in the border that are kept for coordinates whose pivots cancel
    first_free, free = model.size[3] + len(border), model.size[4]
    for q in range(len(border)):
        t[border[q]] = r[border[q]] = 0.0
    negative = 0
    for u in range(len(unit_block) - 1, -1, -1):
        j0, j1, row, above = unit_joint[u, 0], unit_joint[u, 1], unit_row[u], unit_above[u]
        k, subtree, block, column = unit_row[u + 1] - row, unit_subtree[u], unit_block[u], unit_column[u]
        width = wide[subtree]
        unit_width[u] = width
        c0 = coordinate[j0] if column >= 0 else first[block]
        f0, f1, f2, m0, m1, m2 = S[u, 0], S[u, 1], S[u, 2], S[u, 3], S[u, 4], S[u, 5]
        N00, N01, N02, N10, N11, N12, N20, N21, N22 = (
            S[u, 6], S[u, 7], S[u, 8], S[u, 9], S[u, 10], S[u, 11], S[u, 12], S[u, 13], S[u, 14],
        )  # fmt: skip
        a0, a1, a2, trace = N12 - N21 + m0, N20 - N02 + m1, N01 - N10 + m2, N00 + N11 + N22
        for i in range(k):
            for a in range(3):
                W[row + i, a] = V[row + i, a] = 0.0
            row_column[row + i] = -1
            for c in range(width):
                X[row + i, c] = 0.0
            force[i] = 0.0
            for c in range(k):
                A[i, c] = 0.0
        # joints of the unit: turns, velocities, forces, and how loads couple them
        for j in range(j0, j1):
            i, s = 0 if column >= 0 else coordinate[j] - c0, factor[j]
            w0, w1, w2 = s * w[j, 0], s * w[j, 1], s * w[j, 2]
            if rotary[j]:
                o0, o1, o2 = o[j, 0], o[j, 1], o[j, 2]
                b0, b1, b2 = O0 - o0, O1 - o1, O2 - o2
                V[row + i, 0] += w1 * b2 - w2 * b1
                V[row + i, 1] += w2 * b0 - w0 * b2
                V[row + i, 2] += w0 * b1 - w1 * b0
                along, spread = w0 * f0 + w1 * f1 + w2 * f2, trace - o0 * f0 - o1 * f1 - o2 * f2
                g0 = N00 * w0 + N01 * w1 + N02 * w2 - o0 * along - spread * w0
                g1 = N10 * w0 + N11 * w1 + N12 * w2 - o1 * along - spread * w1
                g2 = N20 * w0 + N21 * w1 + N22 * w2 - o2 * along - spread * w2
                force[i] += w0 * (a0 - o1 * f2 + o2 * f1) + w1 * (a1 - o2 * f0 + o0 * f2)
                force[i] += w2 * (a2 - o0 * f1 + o1 * f0)
                A[i, i] -= w0 * g0 + w1 * g1 + w2 * g2
                g0 += 0.5 * (w1 * m2 - w2 * m1)
                g1 += 0.5 * (w2 * m0 - w0 * m2)
                g2 += 0.5 * (w0 * m1 - w1 * m0)
            else:
                V[row + i, 0] += w0
                V[row + i, 1] += w1
                V[row + i, 2] += w2
                force[i] += w0 * f0 + w1 * f1 + w2 * f2
                g0, g1, g2 = w1 * f2 - w2 * f1, w2 * f0 - w0 * f2, w0 * f1 - w1 * f0
            X[row + i, 0] += g0
            X[row + i, 1] += g1
            X[row + i, 2] += g2
            # with the turns of the joints before; of A the lower half counts
            for d in range(i):
                A[i, d] -= W[row + d, 0] * g0 + W[row + d, 1] * g1 + W[row + d, 2] * g2
            A[i, i] -= 2.0 * (W[row + i, 0] * g0 + W[row + i, 1] * g1 + W[row + i, 2] * g2)
            for d in range(i + 1, k):
                A[d, i] -= W[row + d, 0] * g0 + W[row + d, 1] * g1 + W[row + d, 2] * g2
            if rotary[j]:
                W[row + i, 0] += w0
                W[row + i, 1] += w1
                W[row + i, 2] += w2
        # twists of what stays in the border
        for e in range(source_first[u], source_first[u + 1]):
            what, index, side, start = source[e, 0], source[e, 1], source[e, 2], source[e, 3]
            if what == END and not ends:
                continue
            sign = 1.0 if side else -1.0
            if what <= BALL:
                b0, b1, b2 = place[index, 0] - O0, place[index, 1] - O1, place[index, 2] - O2
            elif what == SPRING:
                b0, b1, b2 = (
                    spring_at[index, side, 0] - O0, spring_at[index, side, 1] - O1,
                    spring_at[index, side, 2] - O2,
                )  # fmt: skip
            elif what == TURNING:
                b0, b1, b2 = point[index, 0] - O0, point[index, 1] - O1, point[index, 2] - O2
            else:
                b0, b1, b2 = end_p[index, 0] - O0, end_p[index, 1] - O1, end_p[index, 2] - O2
            for i in range(row, row + k):
                w0, w1, w2 = W[i, 0], W[i, 1], W[i, 2]
                v0 = V[i, 0] + w1 * b2 - w2 * b1
                v1 = V[i, 1] + w2 * b0 - w0 * b2
                v2 = V[i, 2] + w0 * b1 - w1 * b0
                if what == SPRING:
                    for a in range(3):
                        along = pull[index, 3 * a] * v0 + pull[index, 3 * a + 1] * v1
                        along += pull[index, 3 * a + 2] * v2
                        X[i, start + a] += sign * scale[index, a] * along
                    continue
                X[i, start] += sign * v0
                X[i, start + 1] += sign * v1
                X[i, start + 2] += sign * v2
                if what != BALL:
                    X[i, start + 3] += sign * w0
                    X[i, start + 4] += sign * w1
                    X[i, start + 5] += sign * w2
        if column >= 0:
            # a coordinate that stays: Ω behind is Ω + W q; its own coupling to itself is in A
            q = local[subtree, column]
            w0, w1, w2 = W[row, 0], W[row, 1], W[row, 2]
            t[c0] += force[0]
            r[c0] += force[0]
            X[row, 3] += force[0]
            quadratic = -A[0, 0]
            for a in range(3):
                s = w0 * up[u, 0, a] + w1 * up[u, 1, a] + w2 * up[u, 2, a]
                quadratic += W[row, a] * s
                X[row, a] += s
            for c in range(3, width):
                X[row, c] += w0 * up[u, 0, c] + w1 * up[u, 1, c] + w2 * up[u, 2, c]
                P[subtree, q, c] += X[row, c]
                P[subtree, c, q] += X[row, c]
            P[subtree, q, q] += quadratic
            for a in range(3):
                up[u, a, q] += X[row, a]
        else:
            for i in range(k):
                t[c0 + i] = force[i]
            if kind[block] == LINEAR:
                for i in range(k):
                    s = force[i]
                    size[i] = K[block, i, i]
                    for c in range(k):
                        s -= K[block, i, c] * (x[c0 + c] - natural[c0 + c])
                        A[i, c] += K[block, i, c]
                    X[row + i, 3] = s
                    r[c0 + i] = s
            else:
                h = grown(grows[block], command)
                for i in range(7):
                    beam[i] = beams[block, i] * (h if i >= 4 else 1.0)
                for i in range(6):
                    strain[i] = x[c0 + i] - natural[c0 + i]
                beam_column(beam, force, strain, law, units)
                for i in range(6):
                    X[row + i, 3] = units[i]
                    r[c0 + i] = units[i]
                    size[i] = abs(law[i, i])
                    for c in range(6):
                        A[i, c] += law[i, c]
            for i in range(k):
                w0, w1, w2 = W[row + i, 0], W[row + i, 1], W[row + i, 2]
                # of Pᵀ W three numbers, with all W before
                s0 = w0 * up[u, 0, 0] + w1 * up[u, 1, 0] + w2 * up[u, 2, 0]
                s1 = w0 * up[u, 0, 1] + w1 * up[u, 1, 1] + w2 * up[u, 2, 1]
                s2 = w0 * up[u, 0, 2] + w1 * up[u, 1, 2] + w2 * up[u, 2, 2]
                for c in range(i + 1):
                    A[i, c] -= s0 * W[row + c, 0] + s1 * W[row + c, 1] + s2 * W[row + c, 2]
                    A[c, i] = A[i, c]
                for c in range(width):
                    X[row + i, c] += w0 * up[u, 0, c] + w1 * up[u, 1, c] + w2 * up[u, 2, c]
            kept = 1
            if k == 1 and (abs(A[0, 0]) > CANCELLED * size[0] or first_free == free):
                d = A[0, 0]
                if not abs(d) > NONE * size[0] or not np.isfinite(d):
                    return -1
                if d < 0.0:
                    negative += 1
                D[row], order[row] = 1.0 / d, 0
            else:
                kept, block_negative = pivoted(A, k, size, free - first_free, L, D, order, row)
                if block_negative < 0:
                    return -1
                negative += block_negative
                # rows in the order of the pivots
                for i in range(k):
                    best = order[row + i]
                    while best < i:
                        best = order[row + best]
                    if best != i:
                        for c in range(width):
                            X[row + i, c], X[row + best, c] = X[row + best, c], X[row + i, c]
                for i in range(1, k):
                    for before in range(min(i, kept)):
                        f = L[row + i, before]
                        for c in range(width):
                            X[row + i, c] -= f * X[row + before, c]
            for i in range(kept, k):
                q = wide[subtree]
                wide[subtree] = q + 1
                column_of[subtree, q] = row_column[row + i] = first_free
                scale_T[first_free] = unit[c0 + order[row + i]]
                first_free += 1
                for c in range(q + 1):
                    P[subtree, c, q] = 0.0
                for other in range(len(unit_block)):
                    if unit_subtree[other] == subtree:
                        up[other, 0, q] = up[other, 1, q] = up[other, 2, q] = 0.0
                for a in range(3):
                    up[u, a, q] = X[row + i, a]
                for c in range(OWN - 1, width):
                    P[subtree, c, q] = X[row + i, c]
                for before in range(kept, i + 1):
                    P[subtree, q - i + before, q] = -A[i, before]
            if kept == 6:
                six_rows(X, D, row, width, up, P, u, subtree)
                kept = 0
            for i in range(row, row + kept):
                d = D[i]
                f0, f1, f2 = d * X[i, 0], d * X[i, 1], d * X[i, 2]
                for c in range(width):
                    up[u, 0, c] += f0 * X[i, c]
                    up[u, 1, c] += f1 * X[i, c]
                    up[u, 2, c] += f2 * X[i, c]
                for c in range(OWN - 1, width):
                    f = d * X[i, c]
                    # most units touch few places of the border
                    if f == 0.0:
                        continue
                    for b in range(c, width):
                        P[subtree, c, b] += f * X[i, b]
        if above >= 0:
            for a in range(3):
                for c in range(wide[subtree]):
                    up[above, a, c] += up[u, a, c]
            for a in range(15):
                S[above, a] += S[u, a]
    work.wide[len(subtree_width)] = first_free
    return negative


@kernel
def load(model: MachineArrays, forces: Floats, gap: Floats, work: Work) -> None:
    """Write the border's right side for ``forces`` (n,) and the closures' ``gap`` (f,); factors are at hand."""
    X, W, right, passed, b = work.X, work.W, work.right, work.passed, work.b
    L, D, order, size, border, first = work.L, work.D, work.order, model.size, model.border, model.first
    unit_row, unit_above, unit_subtree = model.unit_row, model.unit_above, model.unit_subtree
    unit_column = model.unit_column
    unit_width, column_of, row_column = work.unit_width, work.column_of, work.row_column
    unit_block = model.unit_block
    right[:] = 0.0
    passed[:, :] = 0.0
    for i in range(len(gap)):
        right[i] = gap[i]
    for q in range(len(border)):
        right[size[3] + q] = -forces[border[q]]
    for u in range(len(unit_block) - 1, -1, -1):
        row, above, subtree, column = unit_row[u], unit_above[u], unit_subtree[u], unit_column[u]
        k, width = unit_row[u + 1] - row, unit_width[u]
        p0, p1, p2 = passed[u, 0], passed[u, 1], passed[u, 2]
        if column >= 0:
            right[column] -= W[row, 0] * p0 + W[row, 1] * p1 + W[row, 2] * p2
        else:
            c0 = first[unit_block[u]]
            for i in range(row, row + k):
                o = row + order[i]
                s = forces[c0 + o - row] + W[o, 0] * p0 + W[o, 1] * p1 + W[o, 2] * p2
                for before in range(i - row):
                    if row_column[row + before] >= 0:
                        break
                    s -= L[i, before] * b[row + before]
                b[i] = s
            for i in range(row, row + k):
                if row_column[i] >= 0:
                    right[row_column[i]] -= b[i]
                    continue
                z = D[i] * b[i]
                p0, p1, p2 = p0 + z * X[i, 0], p1 + z * X[i, 1], p2 + z * X[i, 2]
                for c in range(OWN, width):
                    right[column_of[subtree, c]] -= z * X[i, c]
        if above >= 0:
            passed[above, 0] += p0
            passed[above, 1] += p1
            passed[above, 2] += p2


@kernel
def move(model: MachineArrays, own_side: bool, work: Work) -> None:
    """Motion ``work.step`` (n,) with the border's solution: of Newton's method, or of what `load` has written."""
    X, W, y, step, turn, z = work.X, work.W, work.y, work.step, work.turn, work.force
    L, D, order, b, first = work.L, work.D, work.order, work.b, model.first
    unit_row, unit_above, unit_subtree = model.unit_row, model.unit_above, model.unit_subtree
    unit_column = model.unit_column
    unit_width, column_of, row_column = work.unit_width, work.column_of, work.row_column
    unit_block = model.unit_block
    coordinate, unit_joint = model.coordinate, model.unit_joint
    last = len(turn) - 1
    turn[last, 0] = turn[last, 1] = turn[last, 2] = 0.0
    for u in range(len(unit_block)):
        row, subtree, column = unit_row[u], unit_subtree[u], unit_column[u]
        k, width = unit_row[u + 1] - row, unit_width[u]
        before = unit_above[u] if unit_above[u] >= 0 else last
        t0, t1, t2 = turn[before, 0], turn[before, 1], turn[before, 2]
        if column >= 0:
            q = y[column]
            step[coordinate[unit_joint[u, 0]]] = q
            turn[u, 0], turn[u, 1], turn[u, 2] = t0 + W[row, 0] * q, t1 + W[row, 1] * q, t2 + W[row, 2] * q
            continue
        c0 = first[unit_block[u]]
        for i in range(k):
            if row_column[row + i] >= 0:
                z[i] = y[row_column[row + i]]
                continue
            s = X[row + i, 0] * t0 + X[row + i, 1] * t1 + X[row + i, 2] * t2
            s += X[row + i, 3] if own_side else b[row + i]
            for c in range(OWN, width):
                s += X[row + i, c] * y[column_of[subtree, c]]
            z[i] = s * D[row + i]
        for i in range(k - 1, -1, -1):
            s = z[i]
            if row_column[row + i] < 0:
                for r in range(i + 1, k):
                    s -= L[row + r, i] * z[r]
            z[i] = s
            o = order[row + i]
            step[c0 + o] = s
            t0, t1, t2 = t0 + W[row + o, 0] * s, t1 + W[row + o, 1] * s, t2 + W[row + o, 2] * s
        turn[u, 0], turn[u, 1], turn[u, 2] = t0, t1, t2
