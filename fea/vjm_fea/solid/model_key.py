"""Computes the compliances that model files take from drawings, see `vjm.io.solid_compliance`."""

from __future__ import annotations

from pathlib import Path

from vjm.io.solid_compliance import SolidResult, SolidTable
from vjm_fea.solid.compliance import Base, Tip
from vjm_fea.solid.elasticity import Material
from vjm_fea.solid.identify import SolidTask, identify


def computed(path: Path, table: SolidTable, key: str) -> SolidResult:
    """A compliance by solid finite elements.

    Raises:
        ImportError: the extra ``solid`` is not installed.
        ValueError: a bad drawing, face or material, or the asked accuracy is not met.
    """
    tip = Tip(table.tip_moves)
    task = SolidTask(
        path=path,
        material=Material(table.youngs_modulus_MPa, table.poissons_ratio),
        base=_words(table.base),
        tip=_words(table.tip),
        held=Base(table.base_held),
        unit_mm=table.unit_mm,
        accuracy=0.01 * table.accuracy_percent,
        tips=(tip,),
    )
    found = identify(task)
    limit = found.bounds[tip].limit
    if limit.relative > task.accuracy:
        raise ValueError(
            f"{path.name}: {100.0 * limit.relative:.2g} % is as near as {found.unknowns[-1]} unknowns come: ask "
            "for less by accuracy_percent"
        )
    return SolidResult(
        key=key,
        drawing=path.name,
        compliance=limit.compliance.tolist(),
        interval=limit.interval.tolist(),
        reach_mm=(found.at - found.base_centre).tolist(),
        unknowns=found.unknowns[-1],
    )


def _words(faces: list[str] | str) -> tuple[str, ...]:
    return (faces,) if isinstance(faces, str) else tuple(faces)
