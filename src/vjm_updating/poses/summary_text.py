"""What a diagnosis or a calibration by poses says, line by line."""

from __future__ import annotations

from typing import assert_never

from vjm.io.findings import Grade
from vjm_updating.constants import shown
from vjm_updating.poses.document import MemberRow, PoseCalibration, PoseDiagnosis, SelectionRow, WrittenRow

NOT_HELD_OUT = "not held out, for all readings are of one posture"
BY_FORCE = "; --force writes it all the same"
SHOWN = shown(30)
"""Members that are printed."""


def lines(found: PoseCalibration) -> list[str]:
    """Lines for the terminal."""
    result = _diagnosis(found) if isinstance(found, PoseDiagnosis) else _errors(found)
    result += [f"data: {row.where}: {row.found}" for row in found.doubts if row.grade != Grade.NOTED]
    if found.not_asked:
        result.append(f"not asked, for {found.not_asked_for}: {', '.join(found.not_asked)}")
    result += _not_known(found)
    members = [m for family in found.families for m in family.members if m.identifiable and "compliance" in m.name]
    result += [f"  {m.name} = {m.value:.4g} ({interval(m)}) {m.unit}" for m in members[:SHOWN]]
    blind = [m.name for family in found.families for m in family.members if not m.identifiable]
    if blind:
        result.append(f"not identifiable: {', '.join(blind[:SHOWN])}{' and more' if len(blind) > SHOWN else ''}")
    result += _written(found.written, "" if isinstance(found, PoseDiagnosis) else BY_FORCE)
    for one in found.next_postures:
        result.append(
            f"next, {one.criterion}-optimal: {len(one.q)} postures make the members' standard deviations "
            f"{one.members:.2f} of theirs, those of predictions {one.prediction:.2f}"
        )
    if isinstance(found, PoseDiagnosis):
        result.append(f"next: {found.next}")
    return result


def interval(row: MemberRow) -> str:
    """The 95 % interval in words: both ends, or the one that it has."""
    low, high = row.interval95
    match row.one_sided:
        case "":
            return f"{low:.3g} to {high:.3g}"
        case "at most":
            return f"at most {high:.3g}"
        case "at least":
            return f"at least {low:.3g}"
        case _:
            assert_never(row.one_sided)


def _errors(found: PoseCalibration) -> list[str]:
    return [
        ", ".join([f"{name}: {row.fitted_mm:.4g} mm fitted", *_held_out(row), *_beside(found, row)])
        for name, row in (("before", found.before), ("after", found.after))
    ]


def _beside(found: PoseCalibration, row: SelectionRow) -> list[str]:
    return [f"{mm:.4g} on {name}" for name, mm in zip(found.beside, row.beside_mm, strict=True)]


def _held_out(row: SelectionRow) -> list[str]:
    ends = [] if row.ends_mm is None else [f"{row.ends_mm:.4g} at the ends"]
    if row.random_mm is None or row.region_mm is None:
        return [NOT_HELD_OUT, *ends]
    return [f"{row.random_mm:.4g} held out at random", f"{row.region_mm:.4g} held out by region", *ends]


def _diagnosis(found: PoseDiagnosis) -> list[str]:
    named = f": {', '.join(found.causes)}" if found.causes else ""
    result = [f"verdict: {found.verdict}{named}", *found.findings.words]
    result += [f"  as good: {', '.join(row)}" for row in found.alternatives]
    result += [f"  not added: {row.name}: {row.reason}" for row in found.refused]
    beside = "".join(f", on {name}" for name in found.beside)
    result.append(f"mean distance in mm: fitted, held out at random, by region, at the ends{beside}")
    width = max(len(row.added or found.baseline) for row in found.selection)
    for row in found.selection:
        numbers = (row.fitted_mm, row.random_mm, row.region_mm, row.ends_mm, *row.beside_mm)
        cells = "".join(f" {'−' if v is None else f'{v:.4g}':>9s}" for v in numbers)
        result.append(f"  {row.added or found.baseline:{width}s}{cells}")
    if found.explained is None:
        explained = f"{NOT_HELD_OUT}; explained of the error fitted: {found.findings.explained:.0%}"
    else:
        explained = f"explained: {found.explained:.0%} of the error held out"
    result.append(f"{explained}; {found.remainder.words}")
    return result


def _not_known(found: PoseCalibration) -> list[str]:
    """What the postures cannot know: names by reason, shortly."""
    families: dict[str, list[str]] = {}
    for row in found.not_known:
        family, _, part = row.name.partition(".")
        families.setdefault(family, []).append(part)
    return [f"these postures cannot know {family} of {', '.join(parts)}" for family, parts in families.items()]


def _written(row: WrittenRow, remedy: str) -> list[str]:
    worth = [
        f"  {one.verdict} {one.where} than {one.against}: {one.uncalibrated_mm:.4g} to {one.file_mm:.4g} mm"
        for one in row.compared
    ]
    if worth:
        worth.insert(0, "what the model file is worth, root mean square:")
    if row.refused and not row.forced:
        return [*worth, f"no model file was written: {'; '.join(row.refused)}{remedy}"]
    judged = f"{row.judged_mm:.4g} mm with all that was judged; "
    without = f" (a model file has no word for {', '.join(row.without)})" if row.without else ""
    by_force = [f"written by force, not for use: {'; '.join(row.refused)}"] if row.forced else []
    return [*worth, f"the model file, read back: {judged}{row.file_mm:.4g} mm by the file{without}", *by_force]
