"""Smooth functions made small where others stay positive."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import Bounds, minimize

from vjm.rotations import Array


def smallest(
    objective: Callable[[Array], tuple[float, Array]],
    start: Array,
    bounds: tuple[Array, Array],
    margins: Callable[[Array], tuple[Array, Array]],
    *,
    iterations: int,
    tolerance: float,
) -> Array:
    """A local minimum ``(n,)`` by sequential quadratic programming, or the last point before it gave up.

    Args:
        objective: its value and gradient ``(n,)``.
        start: ``(n,)``.
        bounds: lowest and highest coordinates ``(n,)``.
        margins: what must not be negative ``(m,)``, and its derivative ``(m, n)``.
        iterations: at most.
        tolerance: of the objective.
    """
    constraints: Any = {"type": "ineq", "fun": lambda x: margins(x)[0], "jac": lambda x: margins(x)[1]}
    solution = minimize(
        objective,
        start,
        jac=True,
        method="SLSQP",
        bounds=Bounds(*bounds),
        constraints=constraints,
        options={"maxiter": iterations, "ftol": tolerance},
    )
    return np.array(solution.x, dtype=float)
