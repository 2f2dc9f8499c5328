"""Dense reference for the compiled kernels: the paper's equations as they are written, with numpy."""

import numpy as np
from scipy.linalg import null_space

from vjm.statics import Configuration


def loaded_stiffness(at: Configuration) -> np.ndarray:
    """Upper-left block of the inverse of the matrix of (18), scaled."""
    model, H, J = at.model, at.hessian, at.kinematics.jacobian
    e, p = model.elastic, model.passive
    unit, energy = model.coordinate_scale, model.wrench_scale[3]
    wrench_unit = model.wrench_scale / energy
    J_theta = wrench_unit[:, None] * J[:, e] * unit[e]
    J_q = wrench_unit[:, None] * J[:, p] * unit[p]
    H = H * unit[:, None] * unit / energy
    K = (at.stiffness * unit[:, None] * unit / energy)[np.ix_(e, e)]
    k = np.linalg.inv(K - H[np.ix_(e, e)])
    H_tq, H_qt, H_qq = H[np.ix_(e, p)], H[np.ix_(p, e)], H[np.ix_(p, p)]
    A = np.block(
        [
            [J_theta @ k @ J_theta.T, J_q + J_theta @ k @ H_tq],
            [J_q.T + H_qt @ k @ J_theta.T, H_qq + H_qt @ k @ H_tq],
        ]
    )
    return np.linalg.inv(A)[:6, :6] * model.wrench_scale[:, None] * wrench_unit


def second_variation(at: Configuration) -> tuple[np.ndarray, np.ndarray]:
    """Second variation on an orthonormal basis of the null space of J, and that basis, both scaled."""
    unit, energy = at.model.coordinate_scale, at.model.wrench_scale[3]
    A = (at.stiffness - at.hessian) * unit[:, None] * unit / energy
    J = at.kinematics.jacobian * unit * at.model.wrench_scale[:, None] / energy
    N = null_space(J)
    reduced = N.T @ A @ N
    return 0.5 * (reduced + reduced.T), N


def newton_step(at: Configuration, statics: np.ndarray, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solution of ``(K − H) δx − Jᵀ δF = statics``, ``J δx = gap`` with the whole matrix."""
    model, J = at.model, at.kinematics.jacobian
    n = model.size
    A = np.zeros((n + 6, n + 6))
    A[:n, :n] = at.stiffness - at.hessian
    A[:n, n:] = -J.T
    A[n:, :n] = J
    unit = np.concatenate([model.coordinate_scale, model.wrench_scale])
    solved = unit * np.linalg.solve(A * unit[:, None] * unit, np.concatenate([statics, gap]) * unit)
    return solved[:n], solved[n:]
