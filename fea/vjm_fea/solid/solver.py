"""Sparse symmetric systems: PARDISO from the wheel of MKL, chosen by measurement, see ``docs/solid-parts.md``."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from vjm.rotations import Array
from vjm_fea.solid.libraries import load

SYMMETRIC_DEFINITE = 2
"""PARDISO's name of the kind of matrix, of which it takes the upper triangle."""
OUT_OF_MEMORY = -2


class Factorization:
    """A factorized matrix, to be freed: its working memory is not Python's.

    Attributes:
        solve: from right-hand sides ``(n, k)`` to solutions.
        free: give the working memory back; nothing can be solved any more.
    """

    def __init__(self, solve: Callable[[Array], Array], free: Callable[[], None]) -> None:
        self.solve = solve
        self.free = free


def solver_name() -> str:
    """Which solver `factorized` takes on this machine."""
    return "pardiso" if importlib.util.find_spec("pypardiso") is not None else "superlu"


def factorized(upper: scipy.sparse.csr_matrix) -> Factorization:
    """Factorize a symmetric positive definite matrix, given by its upper triangle ``(n, n)``.

    PARDISO's wheel exists for Intel and AMD processors; elsewhere SciPy's SuperLU does the same with several times
    the working memory and time.

    Raises:
        ValueError: the matrix is not positive definite: some piece of the part is not held.
        MemoryError: there is not enough.
    """
    if solver_name() == "pardiso":
        return _pardiso(upper)
    full = (upper + scipy.sparse.triu(upper, 1).T).tocsc()
    try:
        lu = scipy.sparse.linalg.splu(full, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise ValueError(f"the stiffness matrix cannot be factorized (SuperLU: {error})") from error
    return Factorization(lu.solve, lambda: None)


def _pardiso(upper: scipy.sparse.csr_matrix) -> Factorization:
    wrapper = load("pypardiso.pardiso_wrapper")
    solver: Any = wrapper.PyPardisoSolver(mtype=SYMMETRIC_DEFINITE)
    try:
        solver.factorize(upper)
    except wrapper.PyPardisoError as error:
        if error.value == OUT_OF_MEMORY:
            raise MemoryError("PARDISO: not enough working memory") from error
        raise ValueError(f"the stiffness matrix cannot be factorized (PARDISO error {error.value})") from error

    def solve(right: Array) -> Array:
        result: Array = np.asarray(solver.solve(upper, right))
        return result

    return Factorization(solve, lambda: solver.free_memory(everything=True))
