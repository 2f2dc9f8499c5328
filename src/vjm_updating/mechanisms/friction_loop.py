"""Dry friction in the passive joints, integrated along the history of the displacement.

Coulomb: a joint sticks while its torque is below the limit, and slips under the limit. The chain is elastic, so
that a joint which sticks makes it stiffer. With A how the joints turn under torques of their own while the
end-effector is held, and p the slip, each step is the box-constrained problem

    min ½ τᵀ (A + S) τ + τᵀ (q₀(u) − p_before),   |τ_j| ≤ μ_j,

whose gradient is the joints' slip in the step: where τ is at its limit it may not point back (Moreau 1988).

A contact that sticks is elastic: it is a spring and a slider in series, the elastic and perfectly plastic element
of Prandtl (1928), which bears μ_j when the spring is turned by the presliding δ. The joint's turn is the slip and
what the spring adds to it, ``q = q₀ + A τ = p − S τ``, ``S = diag(δ/μ_j)``, so that ``p = q₀ + (A + S) τ``: the law
of a rigid contact on a chain that is softer by S. With δ = 0 joints stick without turning.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.history_kernel import friction_along

SWEEPS = numerical(60)
"""Of the projected Gauss-Seidel iteration."""
ENOUGH = numerical(1e-9)
"""Change of a torque over the largest at which it ends."""


def friction_torques(
    free: Array, give: Array, limit: Array | float, begins: np.ndarray, rest: Array, presliding: float = 0.0
) -> Array:
    """Torques ``(n, n_q)`` of the joints' friction on the chain along a history.

    Args:
        free: joint coordinates ``(n, n_q)`` without friction.
        give: A ``(n, n_q, n_q)``.
        limit: μ ``(n_q,)``, or one for all, N mm.
        begins: ``(n,)`` where a posture begins, and with it the history.
        rest: joint coordinates ``(n, n_q)`` of the unloaded posture, in which no joint bears a torque.
        presliding: δ, elastic turn of a joint when it begins to slip, rad.
    """
    limits = np.maximum(np.broadcast_to(np.asarray(limit, dtype=float), free.shape[1:]), 0.0)
    if not limits.any():
        return np.zeros_like(free)
    # a joint without friction never sticks
    elastic = np.divide(presliding, limits, out=np.zeros_like(limits), where=limits > 0.0)
    softer = np.ascontiguousarray(give + np.diag(elastic))
    result: Array = friction_along(
        np.ascontiguousarray(free), softer, np.ascontiguousarray(limits), begins, np.ascontiguousarray(rest),
        SWEEPS, ENOUGH,
    )  # fmt: skip
    return result
