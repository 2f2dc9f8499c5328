"""Computes the compliances that model files take from drawings, see `vjm.io.solid_compliance`."""

from __future__ import annotations

from pathlib import Path

from vjm.io.drawn_plausibility import LIKE
from vjm.io.solid_compliance import SolidResult, SolidTable
from vjm_fea.solid.compliance import RootSupport, TipLoad
from vjm_fea.solid.elasticity import IsotropicMaterial
from vjm_fea.solid.identify import SolidTask, identify
from vjm_fea.solid.stress_forms import UPPER, away_from_ends, stress_forms


def computed(path: Path, table: SolidTable) -> SolidResult:
    """A compliance by solid finite elements.

    Raises:
        ImportError: the extra ``solid`` is not installed.
        ValueError: a bad drawing, face or material, or the asked accuracy is not met.
    """
    tip = TipLoad(table.tip_moves)
    task = SolidTask(
        path=path,
        material=IsotropicMaterial(table.youngs_modulus_MPa, table.poissons_ratio),
        base=_words(table.base),
        tip=_words(table.tip),
        held=RootSupport(table.base_held),
        unit_mm=table.unit_mm,
        accuracy=0.01 * table.accuracy_percent,
        tips=(tip,),
    )
    found = identify(task)
    limit, column = found.bounds[tip].limit, found.column
    if limit.relative > task.accuracy:
        raise ValueError(
            f"{path.name}: {100.0 * limit.relative:.2g} % is as near as {found.unknowns[-1]} unknowns come: ask "
            "for less by accuracy_percent"
        )
    away = away_from_ends(found.solid, [*found.ends.base, *found.ends.tip], found.thickness)
    points, forms = stress_forms(found.solid, found.answers[tip].displacements, away)
    return SolidResult(
        drawing=path.name,
        compliance=limit.compliance.tolist(),
        interval=limit.interval.tolist(),
        reach_mm=(found.at - found.base_centre).tolist(),
        volume_mm3=found.volume,
        centre_of_mass_mm=(found.centre - found.base_centre).tolist(),
        thickness_mm=found.thickness,
        bodies=found.bodies,
        buckling_N=column.force if column is not None and column.misfit + limit.relative <= LIKE else None,
        stress_at_mm=(points - found.base_centre).tolist(),
        stress_forms=forms[:, UPPER[0], UPPER[1]].tolist(),
        unknowns=found.unknowns[-1],
    )


def _words(faces: list[str] | str) -> tuple[str, ...]:
    return (faces,) if isinstance(faces, str) else tuple(faces)
