"""Stability of an equilibrium under an imposed pose.

The second variation of the energy is ``K − H`` on the motions that leave the end-effector where it is, the
null space of ``J = [J_θ J_q]``. The equilibrium is stable where it is positive definite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh, lapack

from vjm.equilibrium import Configuration
from vjm.rotations import Array

NEUTRAL = 1e-12
"""Eigenvalues below this fraction of the largest are zero but for rounding."""


@dataclass(frozen=True)
class Stability:
    """The second variation's verdict.

    Attributes:
        eigenvalue: the smallest, in units of the model's energy scale.
        unstable: number of negative eigenvalues.
    """

    eigenvalue: float
    unstable: int


def stability(at: Configuration) -> Stability:
    """Smallest eigenvalue and number of negative ones of the second variation on the null space of J."""
    values = np.linalg.eigvalsh(_reduced(at)[0])
    return Stability(float(values[0]), int(np.count_nonzero(values < 0.0)))


def critical_mode(at: Configuration) -> Array:
    """Motion ``(m,)`` of the joints along the smallest eigenvalue's eigenvector.

    Scaled by the model's coordinate units it has length one; its sign makes the largest component of the
    deflection that it causes positive.
    """
    reduced, q_factor, tau = _reduced(at)
    _, vectors = eigh(reduced, subset_by_index=[0, 0])
    inside = np.concatenate([np.zeros(6), vectors[:, 0]])[:, None]
    mode = at.model.coordinate_scale * _apply(q_factor, tau, inside, transpose=False)[:, 0]
    deflection = at.model.shape_rate(at.kinematics, mode).ravel()
    result: Array = mode * np.sign(deflection[np.argmax(np.abs(deflection))])
    return result


def _reduced(at: Configuration) -> tuple[Array, Array, Array]:
    """Second variation ``(m − 6, m − 6)`` on the null space, with the Householder factors that span it."""
    model = at.model
    unit = model.coordinate_scale
    A = (model.stiffness - at.hessian) * unit[:, None] * unit / model.wrench_scale[3]
    A = 0.5 * (A + A.T)
    q_factor, tau, _, _ = lapack.dgeqrf((at.kinematics.jacobian * unit).T)
    A = _apply(q_factor, tau, A, transpose=True)
    A = _apply(q_factor, tau, np.ascontiguousarray(A.T), transpose=True)
    return A[6:, 6:], q_factor, tau


def _apply(q_factor: Array, tau: Array, matrix: Array, *, transpose: bool) -> Array:
    """Product of the orthogonal factor of Jᵀ, or its transpose, with a matrix ``(m, k)``."""
    trans = "T" if transpose else "N"
    result, _, _ = lapack.dormqr("L", trans, q_factor, tau, matrix, 64 * max(matrix.shape[1], 1))
    product: Array = result
    return product


def free_stability(at: Configuration) -> Stability:
    """The same verdict for an end-effector that is free under a dead wrench: nothing constrains the motions.

    Motions that cost nothing, such as a tool turning about its own joint, count as neither.
    """
    model = at.model
    unit = model.coordinate_scale
    A = (model.stiffness - at.hessian) * unit[:, None] * unit / model.wrench_scale[3]
    values = np.linalg.eigvalsh(0.5 * (A + A.T))
    felt = values[np.abs(values) > NEUTRAL * np.max(np.abs(values))]
    return Stability(float(felt[0]), int(np.count_nonzero(felt < 0.0)))
