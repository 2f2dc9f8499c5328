"""Static equilibrium of a chain under an imposed end-effector pose, equations (9) to (13).

Two solvers of the same equations: the paper's iteration, which freezes the Jacobians, and full Newton-Raphson,
which also linearises them by the Hessian of ``Fᵀ g``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.kinematics import Kinematics
from vjm.model.mechanism import Mechanism
from vjm.rank import least_norm
from vjm.rotations import Array, displacement_between

TOLERANCE = 1e-11
"""Scaled residual at which an equilibrium counts as found: some hundred times what rounding leaves of it."""
MAX_ITERATIONS = 30
"""Of Newton's method, after which it gives up."""


@dataclass(frozen=True)
class Configuration:
    """A state of a loaded model, in equilibrium when its residual is small.

    Attributes:
        model: a chain's or a manipulator's.
        x: joint coordinates ``(m,)``, mm and rad.
        wrench: ``(6,)`` on the end-effector, N and N mm, world axes.
        residual: largest scaled component of the equations (9) and of the pose error.
        iterations: that the solver took.
        load: factor on the model's ramped loads.
    """

    model: Mechanism
    x: Array
    wrench: Array
    residual: float
    iterations: int
    load: float = 0.0

    @cached_property
    def kinematics(self) -> Kinematics:
        """Geometry and Jacobian at ``x``, of a chain."""
        return self.model.kinematics(self.x)

    @cached_property
    def stiffness(self) -> Array:
        """Tangent stiffness ``(n, n)`` of a chain's springs, zero on the passive joints."""
        return self.model.stiffness_under(self.model.reactions(self.kinematics, self.wrench))

    @cached_property
    def hessian(self) -> Array:
        """Of a chain, ``H = ∂(Jᵀ F)/∂x`` ``(m, m)`` at constant wrench."""
        return self.kinematics.force_hessian(self.wrench)


def residual(model: Mechanism, x: Array, wrench: Array, target: Array) -> tuple[Kinematics, Array, Array]:
    """Residuals of statics and geometry.

    Args:
        model: the lumped model.
        x: joint coordinates ``(m,)``.
        wrench: ``(6,)`` N, N mm.
        target: end-effector frame ``(4, 4)``.

    Returns:
        The kinematics at ``x``; ``Jᵀ F − K θ`` ``(n,)``, eq. (9), zero at equilibrium; the displacement
        ``(6,)`` still missing to the target.
    """
    k = model.kinematics(x)
    return k, statics_residual(model, k, x, wrench), displacement_between(k.end, target)


def statics_residual(model: Mechanism, k: Kinematics, x: Array, wrench: Array) -> Array:
    """``Jᵀ F − K θ`` ``(n,)``, eq. (9); ``K (θ(Jᵀ F) − θ)`` with the tangent stiffness where a law is nonlinear."""
    reactions = model.reactions(k, wrench)
    passive = np.zeros(model.size)
    passive[model.passive] = reactions[model.passive]
    sprung = model.strain(reactions) - x
    sprung[model.passive] = 0.0
    result: Array = passive + model.stiffness_under(reactions) @ sprung
    return result


def scaled_norm(model: Mechanism, statics: Array, gap: Array, wrench: Array) -> float:
    """Largest component of the residuals ``(m,)`` and ``(6,)``, made dimensionless by the model's scales.

    Under a wrench of more than one unit it is relative to that wrench, as rounding is.
    """
    energy = model.wrench_scale[3]
    largest = max(np.abs(statics * model.coordinate_scale).max(), np.abs(gap * model.wrench_scale).max())
    return float(largest / energy / max(1.0, np.abs(wrench / model.wrench_scale).max()))


def newton_matrix(model: Mechanism, k: Kinematics, wrench: Array) -> Array:
    """Scaled tangent ``(m + 6, m + 6)`` of statics and geometry: ``[H − K, Jᵀ; J, 0]``.

    Rows and columns are in units of `Mechanism.coordinate_scale` and `Mechanism.wrench_scale`: unscaled,
    entries differ by 10⁶.
    """
    m = model.size
    A = np.zeros((m + 6, m + 6))
    A[:m, :m] = k.force_hessian(wrench) - model.stiffness_under(model.reactions(k, wrench))
    A[:m, m:] = k.jacobian.T
    A[m:, :m] = k.jacobian
    scale = newton_scale(model)
    A *= scale[:, None] * scale
    return A


def newton_scale(model: Mechanism) -> Array:
    """Units of the unknowns ``(m + 6,)`` over the square root of the energy unit.

    Scaled by them from both sides, the tangent is dimensionless.
    """
    root_energy = np.sqrt(model.wrench_scale[3])
    return np.concatenate([model.coordinate_scale, model.wrench_scale]) / root_energy


def solve_newton(
    model: Mechanism,
    target: Array,
    x: Array,
    wrench: Array,
    *,
    load: float = 0.0,
    max_iterations: int = MAX_ITERATIONS,
) -> Configuration:
    """Equilibrium at an imposed pose by full Newton-Raphson.

    Args:
        model: a chain's or a manipulator's.
        target: end-effector frame ``(4, 4)`` to be held, mm.
        x: joint coordinates ``(m,)`` to start from.
        wrench: ``(6,)`` to start from.
        load: factor on the model's ramped loads.
        max_iterations: after which it gives up.

    Raises:
        NoConvergenceError: the scaled residual did not fall below `TOLERANCE`.
    """
    x, wrench, error, iterations, failure = model.compiled.newton(
        target, x, wrench, load, TOLERANCE, max_iterations
    )
    if failure:
        raise NoConvergenceError(f"Newton stopped {failure} at a scaled residual of {error:.1e}")
    return Configuration(model, x, wrench, error, iterations, load)


def solve_paper(
    model: Mechanism,
    target: Array,
    x: Array,
    *,
    max_iterations: int = 200,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
) -> Configuration:
    """Equilibrium at an imposed pose by the paper's iteration (13), its misprints repaired.

    With the Jacobians frozen at ``(q_i, θ_i)`` one linear solve gives the next wrench and passive coordinates:

        [ J_θ k_θ J_θᵀ  J_q ] [ F ]   [ t − g + J_q q_i + J_θ θ_i ]
        [ J_qᵀ           0  ] [ q ] = [ 0                         ],   θ = k_θ J_θᵀ F

    It contracts by about F/F_cr an iteration and diverges where the equilibrium sought is unstable.

    Args:
        model: the lumped model.
        target: end-effector frame ``(4, 4)`` to be held, mm.
        x: joint coordinates ``(m,)`` to start from.
        max_iterations: after which it gives up.
        noise: standard deviation of the disturbance that the paper adds to the coordinates at each iteration,
            in units of `Mechanism.coordinate_scale`. It halves with every iteration, so that the
            iteration can still converge.
        rng: where the noise comes from.

    Raises:
        NoConvergenceError: the scaled residual did not fall below `TOLERANCE`.
        ValueError: noise without a generator.
    """
    if not model.linear:
        raise ValueError("the paper's iteration (13) is for linear springs: it has no tangent to go along")
    if noise > 0.0 and rng is None:
        raise ValueError("noise needs a random generator, so that the result can be repeated")
    elastic, passive = model.elastic, model.passive
    unit = model.wrench_scale
    passive_unit = model.coordinate_scale[passive] / unit[3]
    for iteration in range(1, max_iterations + 1):
        if rng is not None and noise > 0.0:
            x = x + noise * 0.5 ** (iteration - 1) * model.coordinate_scale * rng.standard_normal(model.size)
        k = model.kinematics(x)
        J_theta, J_q = k.jacobian[:, elastic], k.jacobian[:, passive]
        A = np.zeros((6 + len(passive), 6 + len(passive)))
        A[:6, :6] = J_theta @ model.compliance @ J_theta.T
        A[:6, 6:] = J_q
        A[6:, :6] = J_q.T
        try:
            b = np.concatenate([displacement_between(k.end, target) + k.jacobian @ x, np.zeros(len(passive))])
            scale = np.concatenate([unit / np.sqrt(unit[3]), passive_unit * np.sqrt(unit[3])])
            solution = scale * np.linalg.solve(A * scale[:, None] * scale, b * scale)
            wrench = solution[:6]
            x = model.configuration(solution[6:], model.compliance @ (J_theta.T @ wrench))
            _, statics, gap = residual(model, x, wrench, target)
        except (np.linalg.LinAlgError, ValueError):
            raise NoConvergenceError(f"the paper's iteration (13) broke down after {iteration} steps") from None
        error = scaled_norm(model, statics, gap, wrench)
        if error < TOLERANCE:
            return Configuration(model, x, wrench, error, iteration)
    raise NoConvergenceError(
        f"the paper's iteration (13) stopped after {max_iterations} steps at a scaled residual of {error:.1e}"
    )


def solve_under_wrench(model: Mechanism, wrench: Array, x: Array, *, max_iterations: int = 60) -> Configuration:
    """Equilibrium of the free end-effector under a dead wrench: the converse of an imposed pose.

    Newton-Raphson on ``Jᵀ F = K x``. A single chain resists only wrenches that leave its passive joints
    without torque. Under any other it moves until they do. Motions that the wrench does not see (a tool that
    turns about its own joint) stay where they are: steps are the shortest that solve the equations.

    Args:
        model: the lumped model.
        wrench: ``(6,)`` N, N mm, fixed in the world.
        x: joint coordinates ``(m,)`` to start from.
        max_iterations: after which it gives up.

    Raises:
        NoConvergenceError: the chain found no position in which it balances the wrench.
    """
    scale = newton_scale(model)[: model.size]
    root_energy = np.sqrt(model.wrench_scale[3])
    for iteration in range(max_iterations + 1):
        k = model.kinematics(x)
        statics = statics_residual(model, k, x, wrench)
        error = scaled_norm(model, statics, np.zeros(6), wrench)
        if error < TOLERANCE:
            return Configuration(model, x, wrench, error, iteration)
        K = model.stiffness_under(model.reactions(k, wrench))
        A = (k.force_hessian(wrench) - K) * scale[:, None] * scale
        step = least_norm(A[None], -(statics * scale)[None])[0] / root_energy
        # a swinging chain goes in steps of at most a third of a radian
        step *= min(1.0, 0.3 / max(float(np.max(np.abs(step))), 1e-300))
        x = x + model.coordinate_scale * step
    raise NoConvergenceError(
        f"the chain did not balance this wrench within {max_iterations} iterations (scaled residual {error:.1e})"
    )
