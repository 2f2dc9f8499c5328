"""Von Mises stress of a part under any wrench, as quadratic forms at the few points that can bear the highest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vjm.rotations import Array
from vjm_fea.solid.elasticity import ElasticSolid
from vjm_fea.solid.mesh import Indices

Mask = NDArray[np.bool_]

AWAY = 0.5
"""Distance from base and tip, in thicknesses of the part, from which on Saint-Venant's principle is relied upon."""
WRENCHES = 4000
"""Directions of the wrench that are tried."""
BELOW = 0.005
"""What the kept points may miss of the highest stress under a wrench that was tried, over it."""
CHUNK = 2000
"""Nodes whose stresses are compared at once: 64 MB."""
UPPER = np.triu_indices(6)


def away_from_ends(solid: ElasticSolid, faces: list[int], thickness: float) -> Mask:
    """Which nodes ``(n,)`` lie `AWAY` thicknesses or more from base and tip; all where none does."""
    points = solid.mesh.points
    distance = np.asarray(cKDTree(points[solid.mesh.face_nodes(faces)]).query(points)[0])
    away: Mask = distance > AWAY * thickness
    return away if np.any(away) else np.ones_like(away)


def stress_forms(solid: ElasticSolid, displacements: Array, away: Mask) -> tuple[Array, Array]:
    """Points ``(k, 3)`` mm and matrices ``(k, 6, 6)`` Q, so that √(max wᵀ Q w) is the highest von Mises stress.

    Under a wrench w; MPa, N, N mm.

    The squared von Mises stress at a node is a quadratic form of the wrench. Of all nodes those are kept that
    together come within `BELOW` of the highest stress under each of `WRENCHES` wrenches.

    Args:
        solid: the part.
        displacements: ``(3 n, 6)`` under unit wrenches.
        away: which nodes count ``(n,)``.
    """
    nodes = np.flatnonzero(away)
    unit = np.stack([solid.stress(displacements[:, k])[nodes] for k in range(6)], axis=1)
    deviator = unit - np.trace(unit, axis1=2, axis2=3)[..., None, None] / 3.0 * np.eye(3)
    forms: Array = 1.5 * np.einsum("nkab,nlab->nkl", deviator, deviator)
    scale = 1.0 / np.sqrt(np.max(np.einsum("nkk->nk", forms), axis=0))
    tried = np.random.default_rng(1).standard_normal((WRENCHES, 6)) * scale
    tried = np.vstack([tried, np.diag(scale)])
    kept = _covering(_flat(forms), _products(tried))
    return solid.mesh.points[nodes[kept]], forms[kept]


def _flat(forms: Array) -> Array:
    """Upper triangles ``(k, 21)``, those off the diagonal doubled."""
    twice = np.where(UPPER[0] == UPPER[1], 1.0, 2.0)
    result: Array = forms[:, UPPER[0], UPPER[1]] * twice
    return result


def _products(wrenches: Array) -> Array:
    result: Array = wrenches[:, UPPER[0]] * wrenches[:, UPPER[1]]
    return result


def _covering(flat: Array, products: Array) -> Indices:
    """Fewest nodes, about, that serve every wrench: again and again the one that serves most of those left."""
    highest = np.full(len(products), -1.0)
    where = np.zeros(len(products), dtype=np.int64)
    for start in range(0, len(flat), CHUNK):
        values = flat[start : start + CHUNK] @ products.T
        best = np.argmax(values, axis=0)
        value = values[best, np.arange(len(products))]
        where = np.where(value > highest, start + best, where)
        highest = np.maximum(value, highest)
    candidates = np.unique(where)
    serves = flat[candidates] @ products.T >= (1.0 - BELOW) ** 2 * highest
    kept = []
    left = np.ones(len(products), dtype=bool)
    while left.any():
        best_one = int(np.argmax(np.sum(serves & left, axis=1)))
        kept.append(candidates[best_one])
        left &= ~serves[best_one]
    return np.array(sorted(kept), dtype=np.int64)
