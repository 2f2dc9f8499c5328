"""Engines by family: with any mesh, and what they say when they cannot express a case."""

from __future__ import annotations

from typing import assert_never

from vjm.baselines import LinearEngine, MsaEngine
from vjm.engine import Engine
from vjm.vjm_engine import VjmEngine
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine
from vjm_fea.opensees.backend import MISSING, available
from vjm_validation.verification.library import Family

MESHED: tuple[Family, ...] = ("vjm", "exudyn", "opensees")
"""Families that are refined, in the order of the tables."""
TITLES = {
    "vjm": "lumped, beam-column springs",
    "exudyn": "geometrically exact beams",
    "opensees": "corotational beams",
    "vjm-linear": "linear, eq. (5)",
    "msa": "matrix structural analysis",
}
"""What each family is."""


def engine(family: Family, mesh: int, *, shear: bool = False, foot: bool | None = None) -> Engine:
    """An engine of a family.

    Args:
        family: its name.
        mesh: springs or elements of every beam; of no meaning for the linear ones.
        shear: whether elements keep their shear flexibility. Springs always do.
        foot: whether the part named foot is split as well, or is one spring of its 6×6 compliance; None where there
            is none.

    Raises:
        ValueError: the family has no such element.
        ImportError: it is not installed.
    """
    match family:
        case "vjm":
            return VjmEngine(mesh, mesh if foot else None)
        case "exudyn":
            return ExudynEngine(elements=mesh, shear=shear, foot_spring=foot is False)
        case "opensees":
            if not available():
                raise ImportError(MISSING)
            if foot is False:
                raise ValueError("it has no 6×6 spring")
            if shear:
                raise ValueError("its corotational beams are rigid in shear")
            return OpenSeesEngine(elements=mesh)
        case "vjm-linear":
            return LinearEngine()
        case "msa":
            return MsaEngine()
        case _:
            assert_never(family)
