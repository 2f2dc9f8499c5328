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
STILL = 1e-6
"""Deflection of a unit mode, over the characteristic length, below which the stations do not move."""
COINCIDENT = 1e-3
"""Two eigenvalues vanish together where the second is below this fraction of the third."""


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
    """Smallest eigenvalue and number of negative ones of the second variation on the null space of J.

    Where J leaves no motion at all there is nothing to be unstable: nan and none.
    """
    values = np.linalg.eigvalsh(_reduced(at)[0])
    if values.size == 0:
        return Stability(float("nan"), 0)
    # a bar that bends alike in all planes turns freely about its chord: zero but for rounding is not unstable
    return Stability(float(values[0]), int(np.count_nonzero(values < -NEUTRAL * np.abs(values).max())))


def critical_modes(at: Configuration) -> list[Array]:
    """Motions ``(m,)`` of the joints along which a critical point loses its stability: one, or two at once.

    Eigenvectors of the smallest eigenvalue, and of the next where it vanishes together with it (a bar that
    bends alike in both planes). Scaled by the model's coordinate units each has length one. Its sign makes the
    largest component of the deflection that it causes positive, or, where no station moves (one spring a
    link), of the motion itself.
    """
    reduced, q_factor, tau = _reduced(at)
    count = min(3, len(reduced))
    values, vectors = eigh(reduced, subset_by_index=[0, count - 1])
    together = 2 if count == 3 and values[1] < COINCIDENT * values[2] else 1
    unit = at.model.coordinate_scale
    modes = []
    for vector in vectors.T[:together]:
        inside = np.concatenate([np.zeros(6), vector])[:, None]
        mode = unit * _apply(q_factor, tau, inside, transpose=False)[:, 0]
        deflection = at.model.shape_rate(at.kinematics, mode).ravel()
        if np.abs(deflection).max(initial=0.0) < STILL * at.model.chain.characteristic_length:
            deflection = mode / unit
        modes.append(mode * np.sign(deflection[np.argmax(np.abs(deflection))]))
    return modes


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
