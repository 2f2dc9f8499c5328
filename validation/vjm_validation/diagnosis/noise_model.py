"""The autocorrelation of the noise, by restricted maximum likelihood: what a model may get wrong does not count.

For each channel the whitened residual is noise plus any mixture of given shapes. The likelihood of what is left
once these are projected out (Patterson and Thompson 1971) has no bias from their number, as a plain estimate from
residuals has. The sheet's standard deviation is believed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.rotations import Array
from vjm_validation.calibration.noise import Memory

GRID = (0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8, 0.87, 0.92, 0.96)
"""Autocorrelations that are tried first."""
RANK = 1e-6
"""Of singular values over the largest, below which shapes are one."""


def estimate_memory(memory: Memory, instant: Array, shapes: Array, present: np.ndarray) -> Memory:
    """The memory with its autocorrelations.

    Args:
        memory: who precedes whom.
        instant: whitened residuals ``(n, 6)``, still with memory.
        shapes: whitened ``(n, 6, k)`` that do not count.
        present: ``(n, 6)``.
    """
    rho = np.zeros(6)
    for c in range(6):
        if present[:, c].sum() < 20:
            continue
        X = shapes[:, c][:, np.any(shapes[present[:, c], c] != 0.0, axis=0)]
        X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        U, values, _ = np.linalg.svd(X[present[:, c]], full_matrices=False)
        basis = np.zeros((len(X), int((values > RANK * values[0]).sum()) if len(values) else 0))
        basis[present[:, c]] = U[:, : basis.shape[1]]
        if basis.shape[1] > 0.5 * present[:, c].sum():
            basis = basis[:, : int(0.5 * present[:, c].sum())]
        grid = list(GRID)
        costs = [_cost(memory, instant[:, c], basis, present[:, c], c, r) for r in grid]
        k = int(np.argmin(costs))
        if 0 < k < len(grid) - 1:
            # the parabola through three points
            a, b, d = grid[k - 1 : k + 2]
            fa, fb, fd = costs[k - 1 : k + 2]
            top = (b - a) ** 2 * (fb - fd) - (b - d) ** 2 * (fb - fa)
            low = (b - a) * (fb - fd) - (b - d) * (fb - fa)
            rho[c] = float(np.clip(b - 0.5 * top / low, a, d)) if low != 0.0 else b
        else:
            rho[c] = grid[k]
    return replace(memory, rho=rho)


def _cost(memory: Memory, r: Array, X: Array, present: np.ndarray, c: int, rho: float) -> float:
    """Twice the negative logarithm of the restricted likelihood, but for a constant."""
    table = np.zeros((len(r), 6, X.shape[1] + 1))
    table[:, c, 0], table[:, c, 1:] = r, X
    own = replace(memory, rho=np.full(6, rho))
    free = own.remove(table)[present, c]
    y, Z = free[:, 0], free[:, 1:]
    linked = (memory.before[:, c] >= 0) & present
    power = rho ** np.maximum(memory.gap[linked, c], 1)
    determinant = float(np.sum(np.log1p(-(power**2))))
    if Z.shape[1] == 0:
        return determinant + float(y @ y)
    Q, R = np.linalg.qr(Z)
    rest = y - Q @ (Q.T @ y)
    return determinant + 2.0 * float(np.sum(np.log(np.abs(np.diag(R))))) + float(rest @ rest)
