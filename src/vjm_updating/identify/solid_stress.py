"""Stress of an identified part under a wrench, and how far from yield it is."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_fea.solid.compliance import Tip
from vjm_fea.solid.elasticity import von_mises
from vjm_fea.solid.identify import SolidCompliance
from vjm_updating.identify.solid_documents import StressDocument

AWAY = 0.5
"""Distance from base and tip, in thicknesses of the part, from which on Saint-Venant's principle is relied upon."""


def stress_document(found: SolidCompliance, wrench: Array, yield_stress: float | None) -> StressDocument:
    """Largest von Mises stress under a wrench.

    Args:
        found: the part.
        wrench: ``(6,)`` N and N mm, where the compliance is read, spread over the tip where that was computed.
        yield_stress: MPa, where known.
    """
    tip = Tip.SPREAD if Tip.SPREAD in found.answers else next(iter(found.answers))
    stress = von_mises(found.solid.stress(found.answers[tip].displacements @ wrench))
    points = found.solid.mesh.points
    ends = points[found.solid.mesh.face_nodes([*found.ends.base, *found.ends.tip])]
    away = _distance(points, ends) > AWAY * found.thickness
    where = int(np.argmax(stress))
    inner = int(np.argmax(np.where(away, stress, -1.0))) if np.any(away) else where
    return StressDocument(
        wrench=wrench.tolist(),
        tip=tip.value,
        largest_MPa=float(stress[where]),
        largest_at_mm=points[where].tolist(),
        away_MPa=float(stress[inner]),
        away_at_mm=points[inner].tolist(),
        yield_MPa=yield_stress,
        factor_to_yield=None if yield_stress is None else yield_stress / float(stress[inner]),
    )


def _distance(points: Array, others: Array) -> Array:
    from scipy.spatial import cKDTree

    result: Array = np.asarray(cKDTree(others).query(points)[0], dtype=np.float64)
    return result
