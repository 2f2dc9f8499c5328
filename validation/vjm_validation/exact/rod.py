"""The plane, extensible and shearable rod as a differential equation, and its integration.

Reissner, *On one-dimensional finite-strain beam theory: the plane problem*, ZAMP 23 (1972). At the undeformed
arc length S the section stands at (x, y) and is turned by θ. With the internal force n = (n_x, n_y) in fixed
axes, which is constant along a piece that no load acts on, the bending moment M and the curvature at rest κ₀,

    N = n_x cos θ + n_y sin θ,   Q = −n_x sin θ + n_y cos θ,   ε = N/EA,   γ = Q/GA,
    x' = (1 + ε) cos θ − γ sin θ,   y' = (1 + ε) sin θ + γ cos θ,
    θ' = κ₀ + M/EI,   M' = −(x' n_y − y' n_x) = −(1 + ε) Q + γ N.

Everything is dimensionless: lengths over a length L of the problem, forces times L²/EI, moments times L/EI. Then
EI = 1, 1/EA becomes ``axial`` = EI/(EA L²) and 1/GA becomes ``shear`` = EI/(GA L²). Zero for both is Euler's
elastica.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

State = NDArray[Any]
"""``(4,)``, or ``(4, k)`` of k rods: x, y, θ and M; complex where a derivative is taken by a complex step."""


def slope(
    state: State, force: tuple[Any, Any], axial: float = 0.0, shear: float = 0.0, curvature: float = 0.0
) -> State:
    """Derivative of (x, y, θ, M) by S under the internal force ``(n_x, n_y)``."""
    theta, moment = state[2], state[3]
    cos, sin = np.cos(theta), np.sin(theta)
    N = force[0] * cos + force[1] * sin
    Q = -force[0] * sin + force[1] * cos
    stretch, slip = 1.0 + axial * N, shear * Q
    return np.array(
        [stretch * cos - slip * sin, stretch * sin + slip * cos, curvature + moment, -stretch * Q + slip * N]
    )


def integrate(
    start: State,
    force: tuple[Any, Any],
    span: tuple[float, float],
    axial: float = 0.0,
    shear: float = 0.0,
    curvature: float = 0.0,
) -> State:
    """State at ``span[1]``, from ``start`` at ``span[0]``, either way along the rod; of one rod or several at once.

    Dormand and Prince's method of the eighth order with relative tolerance 1e-13.

    Raises:
        RuntimeError: the integration broke down.
    """
    solution = solve_ivp(
        lambda _, flat: slope(flat.reshape(start.shape), force, axial, shear, curvature).ravel(),
        span,
        start.ravel(),
        method="DOP853",
        rtol=1e-13,
        atol=1e-15,
    )
    if not solution.success:
        raise RuntimeError(f"rod from S = {span[0]} to {span[1]}: {solution.message}")
    end: State = solution.y[:, -1].reshape(start.shape)
    return end
