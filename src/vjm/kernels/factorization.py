"""Compiled factorisations of small symmetric matrices, definite or not."""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.packed_model import Floats, Ints

_ALPHA = 0.6403882032022076
"""(1 + √17)/8: where Bunch and Parlett (1971) prefer a 2×2 pivot."""


@kernel
def pivoted(A: Floats, k: int, L: Floats, D: Floats, order: Ints) -> int:
    """Factor a symmetric ``A[:k, :k]``, diagonal pivots largest first; how many are negative, −1 if one is zero."""
    negative = 0
    for i in range(k):
        order[i] = i
    for i in range(k):
        best = i
        for r in range(i + 1, k):
            if abs(A[r, r]) > abs(A[best, best]):
                best = r
        if best != i:
            order[i], order[best] = order[best], order[i]
            for c in range(k):
                A[i, c], A[best, c] = A[best, c], A[i, c]
            for c in range(k):
                A[c, i], A[c, best] = A[c, best], A[c, i]
            for c in range(i):
                L[i, c], L[best, c] = L[best, c], L[i, c]
        d = A[i, i]
        if d == 0.0 or not np.isfinite(d):
            return -1
        if d < 0.0:
            negative += 1
        D[i] = d
        for r in range(i + 1, k):
            f = A[r, i] / d
            L[r, i] = f
            for c in range(i + 1, r + 1):
                A[r, c] -= f * A[c, i]
        for r in range(i + 1, k):
            for c in range(i + 1, r):
                A[c, r] = A[r, c]
    return negative


@kernel
def pivoted_solve(L: Floats, D: Floats, order: Ints, k: int, b: Floats, x: Floats) -> None:
    """``A x = b`` with the factors of `_pivoted`; ``(k,)`` each, b is destroyed."""
    for i in range(k):
        x[i] = b[order[i]]
    for i in range(k):
        for c in range(i):
            x[i] -= L[i, c] * x[c]
    for i in range(k - 1, -1, -1):
        x[i] /= D[i]
        for r in range(i + 1, k):
            x[i] -= L[r, i] * x[r]
    for i in range(k):
        b[order[i]] = x[i]
    for i in range(k):
        x[i] = b[i]


@entry
def bunch_parlett(T: Floats, F: Floats, swaps: Ints, pivots: Ints) -> int:
    """Factor a symmetric matrix, indefinite or not, with complete pivoting; its negative eigenvalues' number."""
    n = len(T)
    for i in range(n):
        for j in range(n):
            F[i, j] = T[i, j]
    negative = 0
    i = 0
    while i < n:
        diagonal, d = 0.0, i
        off, r0, s0 = 0.0, i, i
        for r in range(i, n):
            if abs(F[r, r]) > diagonal:
                diagonal, d = abs(F[r, r]), r
            for c in range(i, r):
                if abs(F[r, c]) > off:
                    off, r0, s0 = abs(F[r, c]), r, c
        if not (diagonal > 0.0 or off > 0.0):
            return -1
        if diagonal >= _ALPHA * off:
            _swap(F, i, d, n)
            swaps[i] = d
            pivots[i] = 1
            p = F[i, i]
            if p < 0.0:
                negative += 1
            for r in range(i + 1, n):
                f = F[r, i] / p
                for c in range(i + 1, r + 1):
                    F[r, c] -= f * F[i, c]
                    F[c, r] = F[r, c]
            for r in range(i + 1, n):
                F[r, i] /= p
            i += 1
        else:
            _swap(F, i, s0, n)
            _swap(F, i + 1, r0, n)
            swaps[i], swaps[i + 1] = s0, r0
            pivots[i], pivots[i + 1] = 2, 0
            # such a pivot has one eigenvalue of either sign
            negative += 1
            p, q, u = F[i, i], F[i + 1, i], F[i + 1, i + 1]
            det = p * u - q * q
            for r in range(i + 2, n):
                f = (F[r, i] * u - F[r, i + 1] * q) / det
                g = (F[r, i + 1] * p - F[r, i] * q) / det
                for c in range(i + 2, r + 1):
                    F[r, c] -= f * F[i, c] + g * F[i + 1, c]
                    F[c, r] = F[r, c]
                # the column's own entries are still needed by the rows behind, on the other side of the diagonal
                F[r, i], F[r, i + 1] = f, g
            i += 2
    return negative


@kernel
def _swap(F: Floats, i: int, j: int, n: int) -> None:
    if i == j:
        return
    for c in range(n):
        F[i, c], F[j, c] = F[j, c], F[i, c]
    for c in range(n):
        F[c, i], F[c, j] = F[c, j], F[c, i]


@entry
def bunch_parlett_solve(F: Floats, swaps: Ints, pivots: Ints, B: Floats) -> None:
    """``T X = B`` (n, k) with the factor of `bunch_parlett`, in place."""
    n, k = B.shape
    for i in range(n):
        j = swaps[i]
        if i != j:
            for c in range(k):
                B[i, c], B[j, c] = B[j, c], B[i, c]
    i = 0
    while i < n:
        width = 1 if pivots[i] == 1 else 2
        for r in range(i + width, n):
            for w in range(i, i + width):
                f = F[r, w]
                for c in range(k):
                    B[r, c] -= f * B[w, c]
        i += width
    i = 0
    while i < n:
        if pivots[i] == 1:
            d = 1.0 / F[i, i]
            for c in range(k):
                B[i, c] *= d
            i += 1
        else:
            p, q, u = F[i, i], F[i + 1, i], F[i + 1, i + 1]
            det = p * u - q * q
            for c in range(k):
                b0, b1 = B[i, c], B[i + 1, c]
                B[i, c], B[i + 1, c] = (u * b0 - q * b1) / det, (p * b1 - q * b0) / det
            i += 2
    for r in range(n - 1, -1, -1):
        for i in range(r):
            if not (pivots[i] == 2 and r == i + 1):
                f = F[r, i]
                for c in range(k):
                    B[i, c] -= f * B[r, c]
    for i in range(n - 1, -1, -1):
        j = swaps[i]
        if i != j:
            for c in range(k):
                B[i, c], B[j, c] = B[j, c], B[i, c]


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
