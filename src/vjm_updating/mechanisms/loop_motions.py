"""What a small extension somewhere in a machine with closed loops does to its end-effector, which is free.

Cut at its closures the machine is a tree. An extension moves what is behind it in the tree; the closures hold, so
that springs and passive joints follow, and the end-effector goes where nothing pushes it. By reciprocity (Maxwell,
Betti) the same numbers are the force on the place by a unit wrench on the end-effector.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm_updating.constants import numerical

LOOSE = numerical(1e-9)
"""Stiffness over the largest, in the machine's units, below which the end-effector is loose."""
BRACED = numerical(1e-6)
"""Force that holds a place back, over that which would hold the end-effector back from its motion, below which it
comes of a model file's rounded coordinates."""


@dataclass(frozen=True)
class Moved:
    """By an extension of one at each of k places.

    Attributes:
        end: what the free end-effector does ``(k, 6)``, mm and rad per mm or rad.
        held: with what force each place is held back ``(k,)`` by the rest of the machine, N/mm or N mm/rad: zero
            where the extension is a motion that the machine has.
        free: ``(k,)`` whether nothing holds it back and the end-effector moves.
    """

    end: Array
    held: Array
    free: np.ndarray


def moved(model: Mechanism, x: Array, wrench: Array, end: Array, closing: Array) -> Moved:
    """What extensions do to a machine in a state.

    Args:
        model: of the machine.
        x: its coordinates ``(n,)``.
        wrench: ``(6,)`` that holds its end-effector there.
        end: what each extension does to the end-effector ``(6, k)`` with the loops cut and all else still.
        closing: the same of what closures and couplings hold ``(f, k)``.

    Raises:
        numpy.linalg.LinAlgError: the state is singular.
    """
    n, still = model.coordinates, np.zeros(model.size)
    K = model.compiled.end_stiffness(x, wrench)
    by_pose = [model.compiled.response(x, wrench, still, own)[0][n:] for own in np.eye(6)]
    scale = np.repeat([1.0, 1.0 / model.characteristic_length], 3)
    # of a loose end-effector the smallest motion
    free = scale[:, None] * np.linalg.pinv(scale[:, None] * K * scale, rcond=LOOSE, hermitian=True) * scale
    motions, held = np.empty((end.shape[1], 6)), np.empty(end.shape[1])
    for i, (own, gap) in enumerate(zip(end.T, closing.T, strict=True)):
        behind = still.copy()
        behind[n:] = -gap
        dx, force = model.compiled.response(x, wrench, behind, -own)
        motions[i] = -free @ force
        held[i] = gap @ (dx[n:] + np.transpose(by_pose) @ motions[i]) + own @ (force + K @ motions[i])
    whole = np.einsum("ki,ij,kj->k", motions, K, motions)
    return Moved(motions, held, (whole > 0.0) & (np.abs(held) < BRACED * whole))
