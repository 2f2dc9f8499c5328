"""The factor of the border against dense eigenvalues and solutions."""

import numpy as np

from vjm.kernels.border import symmetric_factor, symmetric_solve
from vjm.kernels.compilation import njit


@njit(error_model="numpy")
def solved(F, b):
    """Negative eigenvalues and rank; the solution in place of the right side."""
    n = len(F)
    swaps, pivots = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    negative, rank = symmetric_factor(F, swaps, pivots, 0)
    symmetric_solve(F, swaps, pivots, rank, b)
    return negative, rank


def test_a_pair_of_pivots_is_that_of_the_largest_entry_between_them():
    """The third row has 0.6 twice: with the last row, from which it is reached, and with the second, singular."""
    A = np.array([[0.0, 0.0, 0.05, 0.1], [0.0, 1.0, 0.6, 0.0], [0.05, 0.6, 0.36, 0.6], [0.1, 0.0, 0.6, 0.0]])
    b = np.array([1.0, 2.0, -1.0, 0.5])
    x = b.copy()
    assert solved(A.copy(), x) == (np.count_nonzero(np.linalg.eigvalsh(A) < 0.0), 4)
    # backward stable
    assert np.abs(A @ x - b).max() < 1e-14 * np.abs(x).max()
