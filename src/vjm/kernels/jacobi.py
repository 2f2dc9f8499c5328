"""Compiled eigenvalues of small symmetric matrices."""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats
from vjm.kernels.compilation import kernel


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
