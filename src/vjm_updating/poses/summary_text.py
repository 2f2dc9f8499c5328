"""What a diagnosis or a calibration by poses says, line by line."""

from __future__ import annotations

from vjm.io.findings import Grade
from vjm_updating.poses.document import PoseCalibration, PoseDiagnosis

SHOWN = 30
"""Members that are printed."""


def lines(found: PoseCalibration) -> list[str]:
    """Lines for the terminal."""
    result = []
    if isinstance(found, PoseDiagnosis):
        named = f": {', '.join(found.causes)}" if found.causes else ""
        result.append(f"verdict: {found.verdict}{named}")
        result += [f"  as good: {', '.join(row)}" for row in found.alternatives]
        result.append("mean distance in mm: fitted, held out at random, held out by region")
        for row in found.ladder:
            name = row.added or found.baseline
            result.append(f"  {name:24s} {row.fitted_mm:9.4g} {row.random_mm:9.4g} {row.region_mm:9.4g}")
        result.append(found.remainder.words)
    else:
        for name, row in (("before", found.before), ("after", found.after)):
            result.append(
                f"{name}: {row.fitted_mm:.4g} mm fitted, {row.random_mm:.4g} held out at random, "
                f"{row.region_mm:.4g} held out by region"
            )
    result += [f"data: {row.where}: {row.found}" for row in found.doubts if row.grade == Grade.DOUBTFUL]
    if found.not_asked:
        result.append(f"not asked, for {found.not_asked_for}: {', '.join(found.not_asked)}")
    members = [m for family in found.families for m in family.members if m.identifiable and "compliance" in m.name]
    result += [f"  {m.name} = {m.value:.4g} ± {m.std:.2g} {m.unit}" for m in members[:SHOWN]]
    blind = [m.name for family in found.families for m in family.members if not m.identifiable]
    if blind:
        result.append(f"not identifiable: {', '.join(blind[:SHOWN])}{' and more' if len(blind) > SHOWN else ''}")
    lacks = f"; it has no word for {', '.join(found.not_in_model)}" if found.not_in_model else ""
    result.append(f"the model file as written, read back: {found.written_mm:.4g} mm{lacks}")
    for one in found.next_postures:
        result.append(
            f"next, {one.criterion}-optimal: {len(one.q)} postures make the members' standard deviations "
            f"{one.members:.2f} of theirs, those of predictions {one.prediction:.2f}"
        )
    if isinstance(found, PoseDiagnosis):
        result.append(f"next: {found.next}")
    return result
