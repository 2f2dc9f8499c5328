"""Dry friction in the passive joints, integrated along the history of the displacement.

Coulomb: a joint stands while its torque is below the limit, and turns under the limit. The chain is elastic, so
that a joint which stands makes it stiffer. With A how the joints turn under torques of their own while the
end-effector is held, each step is the box-constrained problem

    min ½ τᵀ A τ + τᵀ (q₀(u) − q_before),   |τ_j| ≤ μ,

whose gradient is the joints' turn in the step: where τ is at its limit it may not point back (Moreau 1988).
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array

SWEEPS = 60
"""Of the projected Gauss-Seidel iteration."""
ENOUGH = 1e-9
"""Change of a torque over the largest at which it ends."""


def friction_torques(free: Array, give: Array, limit: float, begins: np.ndarray, rest: Array) -> Array:
    """Torques ``(n, n_q)`` of the joints' friction on the chain along a history.

    Args:
        free: joint coordinates ``(n, n_q)`` without friction.
        give: A ``(n, n_q, n_q)``.
        limit: μ, N mm.
        begins: ``(n,)`` where a posture begins, and with it the history.
        rest: joint coordinates ``(n, n_q)`` of the unloaded posture.
    """
    n, joints = free.shape
    result = np.zeros((n, joints))
    if limit <= 0.0:
        return result
    tau = np.zeros(joints)
    stands = free[0] if n else np.zeros(joints)
    # a joint that cannot turn while the end-effector is held needs no torque to stand
    diagonal = np.einsum("njj->nj", give)
    loose = diagonal > 1e-9 * diagonal.max(axis=1, initial=0.0, keepdims=True)
    for k in range(n):
        if begins[k]:
            tau, stands = np.zeros(joints), rest[k]
        A, start = give[k].tolist(), (free[k] - stands).tolist()
        own = [float(t) for t in tau]
        moving = [j for j in range(joints) if loose[k, j]]
        for _ in range(SWEEPS):
            largest = 0.0
            for j in moving:
                turn = start[j] + sum(a * t for a, t in zip(A[j], own, strict=True))
                new = own[j] - turn / A[j][j]
                new = limit if new > limit else -limit if new < -limit else new
                largest = max(largest, abs(new - own[j]))
                own[j] = new
            if largest <= ENOUGH * max(map(abs, own)):
                break
        tau = np.array(own)
        stands = free[k] + give[k] @ tau
        result[k] = tau
    return result
