"""Compiled kernels: the part of a tangent that is not symmetric, of loads that turn and moments that do not.

The blocks of `vjm.kernels.condensation` have the symmetric part. With the turns ``y = W δx`` of the k bodies that
such loads act on, and the loads ``C`` (3k, n) that a unit of each turn brings, the rest is ``−Cᵀ W``: a
follower's force gains ``Ω × f``, its moment ``½ Ω × m``, and a moment that keeps its direction ``½ m × Ω``. By
Woodbury's formula 3k substitutions more are all that a factorisation takes, and a product with two thin matrices
all that a solution does: the cost stays linear in the number of springs.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.condensation import factor, substitute
from vjm.kernels.packed_model import Floats, Ints, PackedModel, Workspace, model_of, work_of
from vjm.kernels.recursion import apply_loads


@kernel
def linearise(model: PackedModel, x: Floats, force: Floats, work: Workspace) -> int:
    """`vjm.kernels.condensation.factor`, and what `solve` needs beside it.

    Returns:
        Number of negative eigenvalues of the symmetric part; −1 where a pivot is zero, or the whole is singular.
    """
    negative = factor(model, x, force, work)
    if negative >= 0 and len(model.turning) > 0 and not _border(model, work):
        return -1
    return negative


@kernel
def solve(model: PackedModel, work: Workspace, load: Floats, gap: Floats) -> None:
    """`vjm.kernels.condensation.substitute` with the whole tangent."""
    substitute(model, work, load, gap)
    k = len(work.W)
    if k == 0:
        return
    for i in range(k):
        s = 0.0
        for c in range(len(work.step)):
            s += work.W[i, c] * work.step[c]
        work.turns[i] = s
    for i in range(k):
        y = 0.0
        for j in range(k):
            y += work.M[i, j] * work.turns[j]
        for c in range(len(work.step)):
            work.step[c] += y * work.S[i, c]
        for c in range(6):
            work.right[c] += y * work.reaction[i, c]


@kernel
def _border(model: PackedModel, work: Workspace) -> bool:
    """Write W, the solutions S for C and their reactions, and ``M = (1 − W Sᵀ)⁻¹``; false where there is none."""
    W, S, unit, none = work.W, work.S, work.unit, np.zeros(6)
    row = 0
    for k in model.turning:
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            unit[:, :] = 0.0
            unit[k, 3 + a] = 1.0
            _generalised(model, work, W[row])
            unit[k, 3 + a] = 0.0
            half = -0.5
            if model.follows[k]:
                # e_a × f
                unit[k, c] = work.acting[k, b]
                unit[k, b] = -work.acting[k, c]
                half = 0.5
            unit[k, 3 + c] = half * work.acting[k, 3 + b]
            unit[k, 3 + b] = -half * work.acting[k, 3 + c]
            _generalised(model, work, S[row])
            substitute(model, work, S[row], none)
            for i in range(len(work.step)):
                S[row, i] = work.step[i]
            for i in range(6):
                work.reaction[row, i] = work.right[i]
            row += 1
    for i in range(row):
        for j in range(row):
            s = 1.0 if i == j else 0.0
            for c in range(len(work.step)):
                s -= W[i, c] * S[j, c]
            work.M[i, j] = s
    work.determinant[0] = _invert(work.M)
    return work.determinant[0] != 0.0


@kernel
def _generalised(model: PackedModel, work: Workspace, out: Floats) -> None:
    """Generalised forces ``out`` (n,) of the wrenches ``work.unit`` (l, 6) on the loaded points."""
    apply_loads(model, work, work.unit)
    for c in range(len(out)):
        out[c] = 0.0
    for j in range(len(model.rotary)):
        out[model.coordinate[j]] += model.factor[j] * work.hung[j, 3]


@kernel
def _invert(A: Floats) -> float:
    """Invert a small matrix in place by Gauss and Jordan with row exchanges; its determinant, 0 if singular."""
    k = len(A)
    swaps = np.empty(k, dtype=np.int64)
    determinant = 1.0
    for i in range(k):
        p = i
        for r in range(i + 1, k):
            if abs(A[r, i]) > abs(A[p, i]):
                p = r
        swaps[i] = p
        pivot = A[p, i]
        if pivot == 0.0 or not np.isfinite(pivot):
            return 0.0
        if p != i:
            determinant = -determinant
            for c in range(k):
                A[i, c], A[p, c] = A[p, c], A[i, c]
        determinant *= pivot
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
    return determinant


@entry
def arnoldi(
    integers: Ints,
    numbers: Floats,
    work_integers: Ints,
    work_numbers: Floats,
    device: Floats,
    held: Floats,
    begin: int,
    basis: Floats,
    H: Floats,
) -> int:
    """Extend a basis of the space that the inverse tangent makes of its first vector, with the present factors.

    Args:
        integers: see `vjm.kernels.packed_model.Buffers`.
        numbers: likewise.
        work_integers: likewise.
        work_numbers: likewise.
        device: ``(n,)`` generalised forces of a device that holds one motion more, over its own work on ``held``;
            empty where there is none.
        held: ``(n,)`` what the device's unit load moves.
        begin: so many of its vectors have been multiplied.
        basis: ``(k + 1, n)`` the first ``begin + 1`` given, orthonormal.
        H: ``(k + 1, k)`` the products in the basis, Hessenberg's form.

    Returns:
        How many vectors have been multiplied: k, or fewer where the space is exhausted.
    """
    model = model_of(integers, numbers)
    work = work_of(integers, work_integers, work_numbers)
    none = np.zeros(6)
    n, image = basis.shape[1], work.step
    for j in range(begin, H.shape[1]):
        solve(model, work, basis[j], none)
        if len(device):
            s = 0.0
            for i in range(n):
                s += device[i] * image[i]
            for i in range(n):
                image[i] -= s * held[i]
        size = 0.0
        for i in range(n):
            size += image[i] * image[i]
        # twice, as Kahan says, against rounding
        for _turn in range(2):
            for r in range(j + 1):
                along = 0.0
                for i in range(n):
                    along += basis[r, i] * image[i]
                for i in range(n):
                    image[i] -= along * basis[r, i]
                H[r, j] += along
        left = 0.0
        for i in range(n):
            left += image[i] * image[i]
        if not left > 1e-28 * size:
            return j + 1
        left = np.sqrt(left)
        H[j + 1, j] = left
        for i in range(n):
            basis[j + 1, i] = image[i] / left
    return H.shape[1]
