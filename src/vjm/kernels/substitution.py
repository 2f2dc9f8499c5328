"""Compiled solutions with the factors of the elimination: from the leaves to the border, and back again."""

from __future__ import annotations

from vjm.kernels.arrays import OWN, Floats, MachineArrays, Work
from vjm.kernels.compilation import kernel


@kernel
def load(model: MachineArrays, forces: Floats, gap: Floats, work: Work) -> None:
    """Write the border's right side for ``forces`` (n,) and the closures' ``gap`` (f,); factors are at hand."""
    X, W, right, passed, b = work.X, work.W, work.right, work.passed, work.b
    L, D, order, size, border, first = work.L, work.D, work.order, model.size, model.border, model.first
    unit_row, unit_above, unit_limb = model.unit_row, model.unit_above, model.unit_limb
    unit_column = model.unit_column
    unit_width, column_of, row_column, unit_block = (
        work.unit_width,
        work.column_of,
        work.row_column,
        model.unit_block,
    )
    right[:] = 0.0
    passed[:, :] = 0.0
    for i in range(len(gap)):
        right[i] = gap[i]
    for q in range(len(border)):
        right[size[3] + q] = -forces[border[q]]
    for u in range(len(unit_block) - 1, -1, -1):
        row, above, limb, column = unit_row[u], unit_above[u], unit_limb[u], unit_column[u]
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
                    right[column_of[limb, c]] -= z * X[i, c]
        if above >= 0:
            passed[above, 0] += p0
            passed[above, 1] += p1
            passed[above, 2] += p2


@kernel
def move(model: MachineArrays, own_side: bool, work: Work) -> None:
    """Motion ``work.step`` (n,) with the border's solution: of Newton's method, or of what `load` has written."""
    X, W, y, step, turn, z = work.X, work.W, work.y, work.step, work.turn, work.force
    L, D, order, b, first = work.L, work.D, work.order, work.b, model.first
    unit_row, unit_above, unit_limb = model.unit_row, model.unit_above, model.unit_limb
    unit_column = model.unit_column
    unit_width, column_of, row_column, unit_block = (
        work.unit_width,
        work.column_of,
        work.row_column,
        model.unit_block,
    )
    coordinate, unit_joint = model.coordinate, model.unit_joint
    last = len(turn) - 1
    turn[last, 0] = turn[last, 1] = turn[last, 2] = 0.0
    for u in range(len(unit_block)):
        row, limb, column = unit_row[u], unit_limb[u], unit_column[u]
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
                s += X[row + i, c] * y[column_of[limb, c]]
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
