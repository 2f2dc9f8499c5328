"""Eigenvalues nearest zero of a tangent that is not symmetric, or that a device holds in one motion more."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.arrays import MachineArrays, Work
from vjm.kernels.entry_points import arnoldi
from vjm.rotations import Array

SIZES = (8, 12, 16, 24, 32, 48)
"""Of the spaces, one after the other until the eigenvalue nearest zero is sharp."""
SHARP = 1e-8
"""Residual of that eigenvalue's inverse, over it."""
KNOWN = 1e-2
"""Residual, over the inverse, up to which an eigenvalue's sign is known; three are asked to be."""
NEUTRAL = 1e-12
"""Inverse over the largest one: zero, of motions that the constraints take away."""


class NearZero(NamedTuple):
    """What is known of a spectrum near zero.

    Attributes:
        values: eigenvalues ``(k,)``, complex, nearest zero first, whose sign is known.
        motion: ``(n,)`` of the first one, its real part.
    """

    values: Array
    motion: Array


def near_zero(model: MachineArrays, work: Work, start: Array, device: Array, held: Array) -> NearZero | None:
    """Eigenvalues nearest zero with the present factors, by Arnoldi's method with the inverse.

    Args:
        model: the machine.
        work: factored at a state.
        start: vector ``(n,)`` with a share of every mode.
        device: see `vjm.kernels.entry_points.arnoldi`; empty without.
        held: likewise.

    Returns:
        None where the largest space did not tell.
    """
    n = len(start)
    sizes = sorted({min(size, n) for size in SIZES})
    H, basis = np.zeros((sizes[-1] + 1, sizes[-1])), np.empty((sizes[-1] + 1, n))
    basis[0] = start / np.linalg.norm(start)
    done = 0
    for size in sizes:
        reached = arnoldi(model, work, device, held, done, basis, H[:, :size])
        if not np.all(np.isfinite(H[: reached + 1, :reached])):
            return None
        inverse, vectors = np.linalg.eig(H[:reached, :reached])
        exhausted = reached < size
        left = 0.0 if exhausted else abs(H[reached, reached - 1])
        order = np.argsort(-np.abs(inverse))
        inverse, vectors = inverse[order], vectors[:, order]
        felt = np.abs(inverse) > NEUTRAL * np.abs(inverse[0])
        lacking = left * np.abs(vectors[-1, felt]) / np.abs(inverse[felt])
        if lacking[0] < SHARP and np.all(lacking[:3] < KNOWN):
            known = np.flatnonzero(felt)[lacking < KNOWN]
            return NearZero(1.0 / inverse[known], (vectors[:, 0].real @ basis[:reached]))
        if exhausted:
            return None
        done = reached
    return None
