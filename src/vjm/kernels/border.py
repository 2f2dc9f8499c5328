"""Compiled border of a machine.

Here are closures' wrenches and coordinates without springs, equation (18) for any machine; factors, solutions and
eigenvalues of small symmetric matrices.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import OWN, Floats, Ints, MachineArrays, Work
from vjm.kernels.compilation import kernel
from vjm.kernels.elimination import NONE
from vjm.kernels.statics import law_at


@kernel
def jacobi(A: Floats) -> Floats:
    """Diagonalise a small symmetric ``A`` (k, k) in place by Jacobi's rotations; its eigenvectors as columns."""
    k = len(A)
    V = np.eye(k)
    for _ in range(50):
        off, size = 0.0, 0.0
        for r in range(k):
            size += A[r, r] * A[r, r]
            for c in range(r):
                off += A[r, c] * A[r, c]
        if off <= 1e-32 * size:
            break
        for r in range(1, k):
            for c in range(r):
                if A[r, c] == 0.0:
                    continue
                ratio = 0.5 * (A[r, r] - A[c, c]) / A[r, c]
                t = 1.0 / (abs(ratio) + np.sqrt(ratio * ratio + 1.0))
                if ratio < 0.0:
                    t = -t
                cosine = 1.0 / np.sqrt(t * t + 1.0)
                sine = t * cosine
                for i in range(k):
                    p, q = A[i, c], A[i, r]
                    A[i, c], A[i, r] = cosine * p - sine * q, sine * p + cosine * q
                for i in range(k):
                    p, q = A[c, i], A[r, i]
                    A[c, i], A[r, i] = cosine * p - sine * q, sine * p + cosine * q
                for i in range(k):
                    p, q = V[i, c], V[i, r]
                    V[i, c], V[i, r] = cosine * p - sine * q, sine * p + cosine * q
    return V


DEPENDENT = 1e-12
"""Pivot over the largest that is rounding, where by geometry closures imply one another or motions are idle."""
_ALPHA = 0.6403882032022076
"""(1 + √17)/8: where Bunch and Parlett (1971) prefer a 2×2 pivot."""


@kernel
def _swap(F: Floats, i: int, j: int) -> None:
    """Exchange two rows and columns, i < j, of a symmetric matrix of which the lower half is kept."""
    if i == j:
        return
    F[i, i], F[j, j] = F[j, j], F[i, i]
    for c in range(i):
        F[i, c], F[j, c] = F[j, c], F[i, c]
    for c in range(i + 1, j):
        F[c, i], F[j, c] = F[j, c], F[c, i]
    for r in range(j + 1, len(F)):
        F[r, i], F[r, j] = F[r, j], F[r, i]


@kernel
def _largest(F: Floats, i: int) -> tuple[int, int, float]:
    """Row and column, from i on, of complete pivoting's pivot, equal where it is single, and its size."""
    diagonal, d, off, r0, s0 = -1.0, i, 0.0, i, i
    for r in range(i, len(F)):
        if abs(F[r, r]) > diagonal:
            diagonal, d = abs(F[r, r]), r
        for c in range(i, r):
            if abs(F[r, c]) > off:
                off, r0, s0 = abs(F[r, c]), r, c
    size = max(diagonal, off)
    return (d, d, size) if diagonal >= _ALPHA * off else (s0, r0, size)


@kernel
def _rook(F: Floats, i: int) -> tuple[int, int, float]:
    """The same by rook pivoting: the largest of its own rows only, which takes less time to find.

    Of a pair both rows have the entry between them as their largest: the row before counts, not another one with an
    entry of the same size.
    """
    n = len(F)
    s, last, before = i, i, -1.0
    while True:
        off, r = 0.0, s
        for c in range(i, s):
            if abs(F[s, c]) > off:
                off, r = abs(F[s, c]), c
        for c in range(s + 1, n):
            if abs(F[c, s]) > off:
                off, r = abs(F[c, s]), c
        if not abs(F[s, s]) < _ALPHA * off:
            return s, s, max(abs(F[s, s]), off)
        if not off > before:
            return min(s, last), max(s, last), off
        s, last, before = r, s, off


@kernel
def symmetric_factor(F: Floats, swaps: Ints, pivots: Ints, spare: int) -> tuple[int, int]:
    """Factor a symmetric ``F`` (n, n) in its lower half; so many of its pivots may be rounding.

    Rook pivoting (Ashcraft, Grimes and Lewis 1998) is as stable as complete pivoting, but does not tell the rank: a
    row of rounding may come first. Where one does, complete pivoting takes that step.

    Returns:
        Number of negative eigenvalues and rank; −1 and what was reached where a number is not finite.
    """
    n = len(F)
    negative, i, largest = 0, 0, 0.0
    own, other = np.empty(n), np.empty(n)
    for r in range(n):
        for c in range(r + 1):
            if not abs(F[r, c]) < np.inf:
                return -1, 0
            largest = max(largest, abs(F[r, c]))
    rounding = (DEPENDENT if spare else NONE) * largest
    while i < n:
        s, r, size = _rook(F, i)
        if not size > rounding:
            s, r, size = _largest(F, i)
        if not size < np.inf:
            return -1, i
        if not size > NONE * largest or (n - i <= spare and size < DEPENDENT * largest):
            return negative, i
        _swap(F, i, s)
        swaps[i] = s
        p = F[i, i]
        if s == r:
            pivots[i] = 1
            if p < 0.0:
                negative += 1
            for k in range(i + 1, n):
                f = F[k, i] / p
                own[k - i - 1] = F[k, i]
                if f == 0.0:
                    continue
                # loops over slices from zero on are compiled to vector instructions
                row = F[k, i + 1 : k + 1]
                for c in range(len(row)):
                    row[c] -= f * own[c]
                F[k, i] = f
            i += 1
        else:
            _swap(F, i + 1, r)
            swaps[i + 1] = r
            pivots[i], pivots[i + 1] = 2, 0
            # such a pivot has one eigenvalue of either sign
            negative += 1
            p, q, u = F[i, i], F[i + 1, i], F[i + 1, i + 1]
            det = p * u - q * q
            for k in range(i + 2, n):
                own[k - i - 2], other[k - i - 2] = F[k, i], F[k, i + 1]
                f, g = (F[k, i] * u - F[k, i + 1] * q) / det, (F[k, i + 1] * p - F[k, i] * q) / det
                if f == 0.0 and g == 0.0:
                    continue
                row = F[k, i + 2 : k + 1]
                for c in range(len(row)):
                    row[c] -= f * own[c] + g * other[c]
                F[k, i], F[k, i + 1] = f, g
            i += 2
    return negative, n


@kernel
def symmetric_solve(F: Floats, swaps: Ints, pivots: Ints, rank: int, b: Floats) -> None:
    """``F x = b`` (n,) in place; what is beyond the rank is zero."""
    n = len(F)
    for i in range(rank):
        j = swaps[i]
        if i != j:
            b[i], b[j] = b[j], b[i]
    for r in range(1, rank):
        total = b[r]
        # the second of a pair stands in one pivot with the first
        for i in range(r if pivots[r] else r - 1):
            total -= F[r, i] * b[i]
        b[r] = total
    i = 0
    while i < rank:
        if pivots[i] == 1:
            b[i] /= F[i, i]
            i += 1
        else:
            p, q, u = F[i, i], F[i + 1, i], F[i + 1, i + 1]
            det = p * u - q * q
            b[i], b[i + 1] = (u * b[i] - q * b[i + 1]) / det, (p * b[i + 1] - q * b[i]) / det
            i += 2
    for r in range(rank, n):
        b[r] = 0.0
    for r in range(rank - 1, -1, -1):
        behind = r if pivots[r] else r - 1
        row, head, value = F[r, :behind], b[:behind], b[r]
        for i in range(len(row)):
            head[i] -= row[i] * value
    for i in range(rank - 1, -1, -1):
        j = swaps[i]
        if i != j:
            b[i], b[j] = b[j], b[i]


@kernel
def assemble(model: MachineArrays, command: Floats, natural: Floats, x: Floats, ends: bool, work: Work) -> None:
    """The border's matrix from the subtrees' sums, with its right side: what Newton's method asks for."""
    T, size, P, wide, column_of = work.T, model.size, work.P, work.wide, work.column_of
    last = size[6]
    g = size[6] if ends else size[5]
    T[:, :] = 0.0
    for subtree in range(len(P)):
        width = wide[subtree]
        for i in range(OWN - 1, width):
            a = last if i == OWN - 1 else column_of[subtree, i]
            for j in range(i, width):
                b = last if j == OWN - 1 else column_of[subtree, j]
                T[a, b] += P[subtree, i, j]
                if i != j:
                    T[b, a] += P[subtree, i, j]
    for k in range(len(model.spring)):
        for a in range(3):
            i = size[2] + 3 * k + a
            T[i, i] += work.sign[k, a]
    n_q = len(model.border)
    for k in range(len(model.total)):
        i = size[1] + k
        work.gap[i] = model.total[k]
        for q in range(n_q):
            weight = model.coupling[k, q]
            c = model.border[q]
            T[i, size[3] + q] += weight
            T[size[3] + q, i] += weight
            T[size[3] + q, last] += weight * work.wrench[i]
            work.r[c] += weight * work.wrench[i]
            work.gap[i] -= weight * (x[c] + command[model.border_joint[q]])
    for q in range(n_q):
        for k in range(n_q):
            c = model.border[k]
            T[size[3] + q, size[3] + k] -= model.border_K[q, k]
            T[size[3] + q, last] -= model.border_K[q, k] * (x[c] - natural[c])
            work.r[model.border[q]] -= model.border_K[q, k] * (x[c] - natural[c])
    for q in range(n_q):
        if model.border_law[q] >= 0:
            c = model.border[q]
            force, slope = law_at(
                model.law_first, model.law_knot, model.law_piece, model.border_law[q], x[c] - natural[c]
            )
            if work.state[4]:
                slope = model.law_most[model.border_law[q]]
            work.law_slope[q] = slope
            T[size[3] + q, size[3] + q] -= slope
            T[size[3] + q, last] -= force
            work.r[c] -= force
    for i in range(size[2]):
        T[i, last] -= work.gap[i]
    # places that no coordinate has taken
    for i in range(wide[len(P)], size[4]):
        T[i, i], work.scale_T[i] = -model.energy[0], 1.0
    for i in range(g):
        work.right[i] = -T[i, last]
    # units: of a wrench, the root of the energy, of a multiplier, of a coordinate
    energy, length = model.energy[0], model.length[0]
    for k in range(len(model.closure_rows)):
        for i in range(model.closure_rows[k]):
            work.scale_T[model.closure_first[k] + i] = energy / length if i < 3 else energy
    for i in range(size[1], size[2]):
        work.scale_T[i] = energy
    for i in range(size[2], size[3]):
        work.scale_T[i] = np.sqrt(energy)
    for q in range(n_q):
        work.scale_T[size[3] + q] = model.unit[model.border[q]]


@kernel
def factor(model: MachineArrays, work: Work) -> int:
    """Factor the border; what is known of the whole is in ``work.state``.

    Returns:
        Number of negative eigenvalues of the symmetric part on what the closures leave; −1 where it is singular.
    """
    size = model.size
    y, t = size[4], size[5]
    F, T, scale = work.F, work.T, work.scale_T
    energy = model.energy[0]
    for i in range(y):
        for j in range(i + 1):
            F[i, j] = T[i, j] * scale[i] * scale[j] / energy
    below, rank = symmetric_factor(F, work.swaps, work.pivots, model.spare[0] + model.spare[1])
    # closures that others imply take no motion away, idle motions are felt by nothing
    neutral = max(y - rank - model.spare[0], 0)
    if below < 0 or neutral > model.spare[1]:
        return -1
    pushing = 0
    for k in range(len(model.spring)):
        for a in range(3):
            if work.sign[k, a] < 0.0:
                pushing += 1
    negative = work.state[0] + size[4] - size[3] - below + pushing - neutral
    work.state[1], work.state[2], work.state[3] = negative, rank, 0
    if t > y:
        turning_wrenches(model, work)
        if not factor_turning(model, work):
            return -1
    return negative


@kernel
def turning_wrenches(model: MachineArrays, work: Work) -> None:
    """Write ``N``: the wrench that a motion ``(6,)`` of the body brings on it, for each load that turns."""
    N, acting = work.N, work.acting
    N[:, :] = 0.0
    for k in range(len(model.turning)):
        load = model.turning[k]
        half = 0.5 if model.follows[load] else -0.5
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            # e_a × f and ± ½ e_a × m, the motion turning about axis a
            if model.follows[load]:
                N[6 * k + c, 3 + a] = acting[load, b]
                N[6 * k + b, 3 + a] = -acting[load, c]
            N[6 * k + 3 + c, 3 + a] = half * acting[load, 3 + b]
            N[6 * k + 3 + b, 3 + a] = -half * acting[load, 3 + c]


@kernel
def factor_turning(model: MachineArrays, work: Work) -> bool:
    """Write ``Z = T⁻¹ T_yμ`` and ``M = (1 − N C)⁻¹`` of the loads that turn; false where there is none."""
    y, t = model.size[4], model.size[5]
    N, Z, M, T, scale = work.N, work.Z, work.M, work.T, work.scale_T
    column = np.empty(y)
    for j in range(t - y):
        for i in range(y):
            column[i] = T[i, y + j] * scale[i]
        symmetric_solve(work.F, work.swaps, work.pivots, work.state[2], column)
        for i in range(y):
            Z[i, j] = column[i] * scale[i] / model.energy[0]
    # C = T_μμ − T_μy Z
    for i in range(t - y):
        for j in range(t - y):
            M[i, j] = 1.0 if i == j else 0.0
    for row in range(t - y):
        first = row - row % 6
        for j in range(t - y):
            s = T[y + row, y + j]
            for i in range(y):
                s -= T[y + row, i] * Z[i, j]
            for i in range(first, first + 6):
                M[i, j] -= N[i, row - first] * s
    sign = invert(M, 0.0)
    work.state[3] = 1 if sign < 0 else 0
    return sign != 0


@kernel
def transpose(model: MachineArrays, work: Work) -> bool:
    """Factor the transposed tangent; once more, the tangent itself. False where it is singular."""
    N = work.N
    for k in range(0, len(N), 6):
        for i in range(6):
            for j in range(i):
                N[k + i, j], N[k + j, i] = N[k + j, i], N[k + i, j]
    return factor_turning(model, work) if len(N) else True


@kernel
def invert(A: Floats, least: float) -> int:
    """Invert a small matrix in place by Gauss and Jordan with row exchanges.

    Returns:
        Sign of its determinant; 0 where a pivot is not above the least, or not finite.
    """
    k = len(A)
    swaps = np.empty(k, dtype=np.int64)
    sign = 1
    for i in range(k):
        p = i
        for r in range(i + 1, k):
            if abs(A[r, i]) > abs(A[p, i]):
                p = r
        swaps[i] = p
        pivot = A[p, i]
        if not abs(pivot) > least or not np.isfinite(pivot):
            return 0
        if p != i:
            sign = -sign
            for c in range(k):
                A[i, c], A[p, c] = A[p, c], A[i, c]
        if pivot < 0.0:
            sign = -sign
        A[i, i] = 1.0
        for c in range(k):
            A[i, c] /= pivot
        for r in range(k):
            if r != i:
                f = A[r, i]
                A[r, i] = 0.0
                for c in range(k):
                    A[r, c] -= f * A[i, c]
    for i in range(k - 1, -1, -1):
        p = swaps[i]
        if p != i:
            for r in range(k):
                A[r, i], A[r, p] = A[r, p], A[r, i]
    return sign


@kernel
def solve(model: MachineArrays, work: Work) -> None:
    """Solve for the border ``work.y`` with ``work.right``; of turning loads that is what their bodies move by."""
    y, t, last = model.size[4], model.size[5], model.size[6]
    out, T, scale = work.y, work.T, work.scale_T
    for i in range(y):
        out[i] = work.right[i] * scale[i]
    symmetric_solve(work.F, work.swaps, work.pivots, work.state[2], out[:y])
    for i in range(y):
        out[i] *= scale[i] / model.energy[0]
    if t > y:
        pushed = np.zeros(t - y)
        for row in range(t - y):
            s = -work.right[y + row]
            for i in range(y):
                s += T[y + row, i] * out[i]
            first = row - row % 6
            for i in range(first, first + 6):
                pushed[i] += work.N[i, row - first] * s
        for i in range(t - y):
            s = 0.0
            for j in range(t - y):
                s += work.M[i, j] * pushed[j]
            out[y + i] = s
        for i in range(y):
            for j in range(t - y):
                out[i] -= work.Z[i, j] * out[y + j]
    for i in range(t, last):
        out[i] = 0.0
    out[last] = 1.0
