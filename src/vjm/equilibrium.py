"""Static equilibrium of a chain under an imposed end-effector pose, equations (9) to (13).

Two solvers of the same equations: the paper's iteration, which freezes the Jacobians, and full Newton-Raphson,
which also linearises them by the Hessian of ``Fᵀ g``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgWarning, lu_factor, lu_solve

from vjm.lumped import Kinematics, LumpedModel
from vjm.rotations import Array, displacement_between

TOLERANCE = 1e-11
"""Scaled residual at which an equilibrium counts as found: some hundred times what rounding leaves of it."""


class NoConvergenceError(RuntimeError):
    """A solver stopped before the residual was small; the message says how far it came."""


@dataclass(frozen=True)
class Configuration:
    """A state of the lumped model, in equilibrium when its residual is small.

    Attributes:
        model: the lumped model.
        x: joint coordinates ``(m,)``, mm and rad.
        wrench: ``(6,)`` on the end-effector, N and N mm, world axes.
        residual: largest scaled component of the equations (9) and of the pose error.
        iterations: that the solver took.
    """

    model: LumpedModel
    x: Array
    wrench: Array
    residual: float
    iterations: int

    @cached_property
    def kinematics(self) -> Kinematics:
        """Geometry and Jacobian at ``x``."""
        return self.model.kinematics(self.x)

    @cached_property
    def hessian(self) -> Array:
        """``H = ∂(Jᵀ F)/∂x`` ``(m, m)`` at constant wrench."""
        return self.kinematics.force_hessian(self.wrench)


def residual(model: LumpedModel, x: Array, wrench: Array, target: Array) -> tuple[Kinematics, Array, Array]:
    """Residuals of statics and geometry.

    Args:
        model: the lumped model.
        x: joint coordinates ``(m,)``.
        wrench: ``(6,)`` N, N mm.
        target: end-effector frame ``(4, 4)``.

    Returns:
        The kinematics at ``x``; ``Jᵀ F − K x`` ``(m,)``, eq. (9), zero at equilibrium; the displacement
        ``(6,)`` still missing to the target.
    """
    k = model.kinematics(x)
    return k, k.jacobian.T @ wrench - model.stiffness @ x, displacement_between(k.end, target)


def newton_matrix(model: LumpedModel, k: Kinematics, wrench: Array) -> Array:
    """Scaled tangent ``(m + 6, m + 6)`` of statics and geometry: ``[H − K, Jᵀ; J, 0]``.

    Rows and columns are in units of `LumpedModel.coordinate_scale` and `LumpedModel.wrench_scale`: unscaled,
    entries differ by 10⁶.
    """
    m = model.size
    A = np.zeros((m + 6, m + 6))
    A[:m, :m] = k.force_hessian(wrench) - model.stiffness
    A[:m, m:] = k.jacobian.T
    A[m:, :m] = k.jacobian
    scale = newton_scale(model)
    A *= scale[:, None] * scale
    return A


def newton_scale(model: LumpedModel) -> Array:
    """Units of the unknowns ``(m + 6,)``, divided by the square root of the energy unit so that scaling
    the tangent from both sides leaves it dimensionless.
    """
    root_energy = np.sqrt(model.wrench_scale[3])
    return np.concatenate([model.coordinate_scale, model.wrench_scale]) / root_energy


def solve_newton(
    model: LumpedModel, target: Array, x: Array, wrench: Array, *, max_iterations: int = 30
) -> Configuration:
    """Equilibrium at an imposed pose by full Newton-Raphson.

    Args:
        model: the lumped model.
        target: end-effector frame ``(4, 4)`` to be held, mm.
        x: joint coordinates ``(m,)`` to start from.
        wrench: ``(6,)`` to start from.
        max_iterations: after which it gives up.

    Raises:
        NoConvergenceError: the residual did not fall below `TOLERANCE`.
    """
    scale = newton_scale(model)
    m = model.size
    error = np.inf
    for iteration in range(max_iterations + 1):
        k, statics, gap = residual(model, x, wrench, target)
        r = np.concatenate([statics, gap]) * scale
        error = float(np.max(np.abs(r))) / np.sqrt(model.wrench_scale[3])
        if error < TOLERANCE:
            return Configuration(model, x, wrench, error, iteration)
        if not np.isfinite(error) or error > 1e6:
            break
        r[:m] *= -1.0
        try:
            step = solve_scaled(newton_matrix(model, k, wrench), r) * scale
        except np.linalg.LinAlgError:
            break
        x = x + step[:m]
        wrench = wrench + step[m:]
    raise NoConvergenceError(f"Newton stopped after {iteration} iterations at a scaled residual of {error:.1e}")


def solve_scaled(A: Array, b: Array) -> Array:
    result: Array = np.linalg.solve(A, b)
    return result
