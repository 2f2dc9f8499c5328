"""Stiffness matrices of a chain: unloaded (5) and loaded (18)."""

from __future__ import annotations

import numpy as np

from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm.statics.equilibrium import Configuration


def unloaded_stiffness(model: Mechanism, q: Array) -> Array:
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
    slightly asymmetric where moments act. It is singular by the passive joints, and is never inverted. The
    matrix is condensed spring by spring, see `vjm.kernels.elimination`.

    Returns:
        ``(6, 6)`` in N/mm, N, N mm.

    Raises:
        numpy.linalg.LinAlgError: the state is a critical point.
    """
    return at.model.compiled.end_stiffness(at.x, at.wrench, at.load)
