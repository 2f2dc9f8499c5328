"""A straight tapered beam like a compliance: bending stiffness at root and end in both planes, in closed form."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from vjm.rotations import Array, rotate_matrix6
from vjm_updating.constants import numerical, physical_bound
from vjm_updating.identify.solid_documents import TaperDocument

EXTREME = physical_bound(np.log(50.0))
"""Logarithm of the largest ratio of bending stiffnesses that is sought."""
POINTS, WEIGHTS = numerical(np.polynomial.legendre.leggauss(40))


def tapered(C: Array, reach: Array) -> TaperDocument | None:
    """The tapered beam along a line, or None where the part does not bend like one.

    Bending stiffness runs as ``EI(s) = EI_0 (EI_1/EI_0)^(s/L)``. A cantilever's end turns by ``m ∫ds/EI`` and moves
    by ``m ∫(L−s)ds/EI``: their ratio, the lever, gives the ratio of the stiffnesses, the turn their size; what the
    end moves under a force, ``∫(L−s)²ds/EI``, is then left to compare.

    Args:
        C: compliance ``(6, 6)`` at the end, mm, N, rad.
        reach: from root to end ``(3,)``, mm.
    """
    L = float(np.linalg.norm(reach))
    if L == 0.0:
        return None
    x = reach / L
    across = np.linalg.svd(x[None, :])[2][1:].T
    # the principal directions of bending across the line
    turns = across @ np.linalg.eigh(across.T @ C[3:, 3:] @ across)[1]
    axes = np.column_stack([x, turns[:, 0], np.cross(x, turns[:, 0])])
    own = rotate_matrix6(C, axes.T)
    scale = np.sqrt(np.diag(own))
    found, misses = [], []
    for move, turn, sign in ((2, 4, -1.0), (1, 5, 1.0)):
        lever = sign * own[move, turn] / own[turn, turn] / L
        if not _lever(-EXTREME) < lever < _lever(EXTREME):
            return None
        k = float(brentq(lambda k, lever=lever: _lever(k) - lever, -EXTREME, EXTREME))
        root = L * _moment(k, 0) / own[turn, turn]
        found.append([float(root), float(root * np.exp(k))])
        deflection = L**3 * _moment(k, 2) / root
        misses.append(abs(deflection - own[move, move]) / scale[move] ** 2)
    return TaperDocument(length_mm=L, EIy_Nmm2=found[0], EIz_Nmm2=found[1], worst_scaled=float(max(misses)))


def _moment(k: float, power: int) -> float:
    """``∫ (1 − t)^power e^(−k t) dt`` from 0 to 1."""
    t = 0.5 * (POINTS + 1.0)
    return 0.5 * float(np.sum(WEIGHTS * (1.0 - t) ** power * np.exp(-k * t)))


def _lever(k: float) -> float:
    """Lever of the end's turning over the length; rises with k, one half for a uniform beam."""
    return _moment(k, 1) / _moment(k, 0)
