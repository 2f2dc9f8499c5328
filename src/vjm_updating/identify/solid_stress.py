"""Stress of an identified part under a wrench, and how far from yield it is."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_fea.solid.compliance import TipLoad
from vjm_fea.solid.elasticity import von_mises
from vjm_fea.solid.identify import SolidCompliance
from vjm_fea.solid.stress_forms import away_from_ends
from vjm_updating.identify.solid_documents import StressDocument


def stress_document(found: SolidCompliance, wrench: Array, yield_stress: float | None) -> StressDocument:
    """Largest von Mises stress under a wrench.

    Args:
        found: the part.
        wrench: ``(6,)`` N and N mm, where the compliance is read, spread over the tip where that was computed.
        yield_stress: MPa, where known.
    """
    tip = TipLoad.SPREAD if TipLoad.SPREAD in found.answers else next(iter(found.answers))
    stress = von_mises(found.solid.stress(found.answers[tip].displacements @ wrench))
    points = found.solid.mesh.points
    away = away_from_ends(found.solid, [*found.ends.base, *found.ends.tip], found.thickness)
    where = int(np.argmax(stress))
    inner = int(np.argmax(np.where(away, stress, -1.0)))
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
