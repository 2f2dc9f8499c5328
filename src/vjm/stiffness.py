"""Stiffness matrices of a chain: unloaded (5) and loaded (18)."""

from __future__ import annotations

import numpy as np

from vjm.equilibrium import Configuration
from vjm.lumped import LumpedModel
from vjm.rotations import Array


def unloaded_stiffness(model: LumpedModel, q: Array) -> Array:
    """Stiffness ``K`` ``(6, 6)`` of (5) at the passive coordinates ``q`` (n_q,), no load.

    Its rank is what the passive joints leave of six; N/mm, N, N mm.
    """
    return loaded_stiffness(Configuration(model, model.configuration(q), np.zeros(6), 0.0, 0))


def loaded_stiffness(at: Configuration) -> Array:
    """Stiffness ``K^F`` ``(6, 6)`` of (18) at a loaded equilibrium.

    The upper-left block of the inverse of

        [ J_θ k J_θᵀ          J_q + J_θ k H_θq    ]
        [ J_qᵀ + H_qθ k J_θᵀ  H_qq + H_qθ k H_θq  ],   k = (K_θ − H_θθ)⁻¹.

    It maps a displacement of the end-effector (shift and rotation vector, world axes) to the change of a
    wrench that is counted in world axes. A moment fixed in the world is not conservative, so that K^F is
    slightly asymmetric where moments act. It is singular by the passive joints, and is never inverted.

    Returns:
        ``(6, 6)`` in N/mm, N, N mm.

    Raises:
        numpy.linalg.LinAlgError: the state is a critical point.
    """
    model, H, J = at.model, at.hessian, at.kinematics.jacobian
    e, p = model.elastic, model.passive
    elastic_unit, passive_unit = model.coordinate_scale[e], model.coordinate_scale[p]
    energy = model.wrench_scale[3]
    J_theta = J[:, e] * elastic_unit
    J_q = J[:, p] * passive_unit
    H_theta_q = H[np.ix_(e, p)] * elastic_unit[:, None] * passive_unit / energy
    H_q_theta = H[np.ix_(p, e)] * passive_unit[:, None] * elastic_unit / energy
    H_qq = H[np.ix_(p, p)] * passive_unit[:, None] * passive_unit / energy
    K_theta = (model.stiffness - H)[np.ix_(e, e)] * elastic_unit[:, None] * elastic_unit / energy

    wrench_unit = model.wrench_scale / energy
    J_theta = wrench_unit[:, None] * J_theta
    J_q = wrench_unit[:, None] * J_q
    k_times = np.linalg.solve(K_theta, np.hstack([J_theta.T, H_theta_q]))
    kJ, kH = k_times[:, :6], k_times[:, 6:]
    A = np.block([[J_theta @ kJ, J_q + J_theta @ kH], [J_q.T + H_q_theta @ kJ, H_qq + H_q_theta @ kH]])
    unit_columns = np.eye(6 + len(p), 6)
    K: Array = np.linalg.solve(A, unit_columns)[:6]
    return K * model.wrench_scale[:, None] * wrench_unit
