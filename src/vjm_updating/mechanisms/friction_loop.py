"""Dry friction in the passive joints, integrated along the history of the displacement.

Coulomb: a joint stands while its torque is below the limit, and turns under the limit. The chain is elastic, so
that a joint which stands makes it stiffer. With A how the joints turn under torques of their own while the
end-effector is held, each step is the box-constrained problem

    min ½ τᵀ A τ + τᵀ (q₀(u) − q_before),   |τ_j| ≤ μ_j,

whose gradient is the joints' turn in the step: where τ is at its limit it may not point back (Moreau 1988).
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.mechanisms.history_kernel import friction_along

SWEEPS = 60
"""Of the projected Gauss-Seidel iteration."""
ENOUGH = 1e-9
"""Change of a torque over the largest at which it ends."""


def friction_torques(free: Array, give: Array, limit: Array | float, begins: np.ndarray, rest: Array) -> Array:
    """Torques ``(n, n_q)`` of the joints' friction on the chain along a history.

    Args:
        free: joint coordinates ``(n, n_q)`` without friction.
        give: A ``(n, n_q, n_q)``.
        limit: μ ``(n_q,)``, or one for all, N mm.
        begins: ``(n,)`` where a posture begins, and with it the history.
        rest: joint coordinates ``(n, n_q)`` of the unloaded posture.
    """
    limits = np.maximum(np.broadcast_to(np.asarray(limit, dtype=float), free.shape[1:]), 0.0)
    if not limits.any():
        return np.zeros_like(free)
    result: Array = friction_along(
        np.ascontiguousarray(free), np.ascontiguousarray(give), np.ascontiguousarray(limits), begins,
        np.ascontiguousarray(rest), SWEEPS, ENOUGH,
    )  # fmt: skip
    return result
