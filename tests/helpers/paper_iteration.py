"""The paper's iteration (13), which freezes the Jacobians: a second solver of the same equilibria."""

import numpy as np

from vjm import statics as equilibrium
from vjm.errors import NoConvergenceError
from vjm.model.mechanism import Mechanism
from vjm.model.springs import LinearSpring
from vjm.rotations import Array, displacement_between
from vjm.statics import Configuration


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
    if not all(isinstance(spring, LinearSpring) for spring in model.springs):
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
            _, statics, gap = equilibrium.residual(model, x, wrench, target)
        except (np.linalg.LinAlgError, ValueError):
            raise NoConvergenceError(f"the paper's iteration (13) broke down after {iteration} steps") from None
        error = equilibrium.scaled_norm(model, statics, gap, wrench)
        if error < equilibrium.TOLERANCE:
            return Configuration(model, x, wrench, error, iteration)
    raise NoConvergenceError(
        f"the paper's iteration (13) stopped after {max_iterations} steps at a scaled residual of {error:.1e}"
    )
