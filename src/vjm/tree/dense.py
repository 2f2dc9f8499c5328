"""Compiled dense linear algebra of small matrices, for which a library's call takes longer than the work."""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import kernel
from vjm.kernels.packed_model import Floats, Ints


@kernel
def factor(A: Floats, swaps: Ints) -> bool:
    """LU factors of ``A`` (n, n) in place with partial pivoting; false where it is singular."""
    n = len(A)
    for k in range(n):
        best = k
        for r in range(k + 1, n):
            if abs(A[r, k]) > abs(A[best, k]):
                best = r
        swaps[k] = best
        if not 0.0 < abs(A[best, k]) < np.inf:
            return False
        if best != k:
            for c in range(n):
                A[k, c], A[best, c] = A[best, c], A[k, c]
        d = 1.0 / A[k, k]
        for r in range(k + 1, n):
            f = A[r, k] * d
            A[r, k] = f
            if f != 0.0:
                for c in range(k + 1, n):
                    A[r, c] -= f * A[k, c]
    return True


@kernel
def solve(A: Floats, swaps: Ints, B: Floats) -> None:
    """``A X = B`` (n, k) with the factors of `factor`, in place."""
    n, k = B.shape
    for r in range(n):
        s = swaps[r]
        if s != r:
            for c in range(k):
                B[r, c], B[s, c] = B[s, c], B[r, c]
    for r in range(n):
        for i in range(r):
            f = A[r, i]
            if f != 0.0:
                for c in range(k):
                    B[r, c] -= f * B[i, c]
    for r in range(n - 1, -1, -1):
        for i in range(r + 1, n):
            f = A[r, i]
            if f != 0.0:
                for c in range(k):
                    B[r, c] -= f * B[i, c]
        d = 1.0 / A[r, r]
        for c in range(k):
            B[r, c] *= d


@kernel
def definite(A: Floats) -> bool:
    """Whether the symmetric part of ``A`` (n, n), overwritten, is positive definite: Cholesky's factorisation."""
    n = len(A)
    for j in range(n):
        for i in range(j + 1, n):
            A[i, j] = 0.5 * (A[i, j] + A[j, i])
    for j in range(n):
        for k in range(j):
            for i in range(j, n):
                A[i, j] -= A[i, k] * A[j, k]
        if not A[j, j] > 0.0:
            return False
        d = 1.0 / np.sqrt(A[j, j])
        for i in range(j, n):
            A[i, j] *= d
    return True
