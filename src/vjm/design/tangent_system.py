"""A tangent with what closures hold, as one regular system of equations.

    [A, Rᵀ, W; R, 0, ·; Vᵀ, ·, 0]

R are independent rows of what closures hold, see `vjm.rank`. W and V border motions without stiffness: idle ones,
and those along which a critical point loses its stability. No singular value is cut off, so that stiffnesses may
differ by any number of decades.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from vjm.rotations import Array


class TangentSystem:
    """Solves for motions and multipliers, scaled.

    Attributes:
        matrix: ``(m + k, m + k)`` with its borders.
        borders: their number k.
    """

    def __init__(self, B: Array, right: Array, left: Array) -> None:
        """Border a matrix and factor it.

        Args:
            B: ``(m, m)`` tangent and rows, scaled.
            right: ``(m, k)`` forces W that are added in unknown amounts.
            left: ``(m, k)`` what solutions are perpendicular to, V.
        """
        k = self.borders = right.shape[1]
        self.matrix = np.block([[B, right], [left.T, np.zeros((k, k))]])
        self._factors = lu_factor(self.matrix, check_finite=False)

    def solve(self, forces: Array, *, transposed: bool = False) -> tuple[Array, Array]:
        """Solution ``(m, …)`` for right sides ``(m, …)``, and the amounts ``(k, …)`` of W that they need."""
        return self._parts(np.concatenate([forces, np.zeros((self.borders, *forces.shape[1:]))]), transposed)

    def null(self, *, transposed: bool = False) -> tuple[Array, Array]:
        """Vectors ``(m, k)`` with unit products with V that the matrix takes to W times amounts ``(k, k)``."""
        m, k = len(self.matrix) - self.borders, self.borders
        return self._parts(np.vstack([np.zeros((m, k)), np.eye(k)]), transposed)

    def _parts(self, right: Array, transposed: bool) -> tuple[Array, Array]:
        A = self.matrix.T if transposed else self.matrix
        y = self._substituted(right, transposed)
        # one step of refinement brings back the digits that row exchanges of unequal rows cost
        y = y + self._substituted(right - A @ y, transposed)
        m = len(self.matrix) - self.borders
        return y[:m], y[m:]

    def _substituted(self, right: Array, transposed: bool) -> Array:
        return np.asarray(lu_solve(self._factors, right, 1 if transposed else 0, check_finite=False), dtype=float)
