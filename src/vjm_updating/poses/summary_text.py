"""What a diagnosis or a calibration by poses says, line by line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never

from vjm.io.findings import Grade
from vjm_updating.constants import shown
from vjm_updating.observation.paired_gain import Worth
from vjm_updating.poses.document import (
    MemberRow,
    PoseCalibration,
    PoseDiagnosis,
    SelectionRow,
    WeighedDownRow,
    WrittenRow,
)
from vjm_updating.poses.state import AT_RANDOM, BY_LEVEL, BY_SERIES

NOT_HELD_OUT = "not held out, for all readings are of one posture"
BY_FORCE = "; `validate calibrate --force` writes it all the same"
RUNS = shown(6)
CHANGED = shown(3)
"""Neighbours that are a change rather than outliers, the fewest that a change has."""
SHOWN = shown(30)
"""Members that are printed."""


def lines(found: PoseCalibration) -> list[str]:
    """Lines for the terminal."""
    result = _diagnosis(found) if isinstance(found, PoseDiagnosis) else [of_file(found.written), *_errors(found)]
    result += weighed_down(found)
    result += _grid(found)
    result += [f"data: {row.where}: {row.found}" for row in found.doubts if row.grade != Grade.NOTED]
    if found.not_asked:
        result.append(f"not asked, for {found.not_asked_for}: {', '.join(found.not_asked)}")
    result += _not_known(found)
    if not (isinstance(found, PoseDiagnosis) and found.verdict == "unknown"):
        members = [m for one in found.families for m in one.members if m.identifiable and "compliance" in m.name]
        result += [f"  {m.name} = {m.value:.4g} ({interval(m)}) {m.unit}" for m in members[:SHOWN]]
        result += _intervals_are(found)
    result += of_asked(found)
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


def of_file(row: WrittenRow) -> str:
    """The verdict of a calibration's model file, in a line."""
    done = "" if not row.refused else ": written by force" if row.forced else ": not written"
    match row.verdict:
        case None:
            worth = "nothing can be held out"
        case Worth.BETTER:
            worth = "better there, but no machine is so" if row.refused else "better there"
        case Worth.ALIKE:
            worth = "no better"
        case Worth.WORSE:
            worth = "worse"
        case _:
            assert_never(row.verdict)
    return f"the model file, where postures were held out: {worth}{done}"


def of_range(row: WrittenRow) -> list[str]:
    """How well the file is known over the joints' whole range, and which numbers the postures do not support."""
    if row.whole_range is None:
        return []
    found, said = row.whole_range, []
    words = (
        f"over the joints' whole range the file changes the model by {found.changed_mm:.3g} mm, known to "
        f"{found.error_mm:.3g} mm. Where it was measured the model misses {found.model_mm:.3g} mm, root mean square"
    )
    if found.unsupported:
        names = ", ".join(found.unsupported[:SHOWN])
        said = [
            f"that range asks for other postures: held near to the model's value {names}. "
            f"Else the file would change the model by {found.asked_mm:.3g} mm there"
        ]
    return [words, *said]


def of_asked(found: PoseCalibration) -> list[str]:
    """What the file errs by where it will be used."""
    row = found.asked_for
    if row is None:
        return []
    several = len(row.places) > row.asked
    which = ", in the configuration of the arm that is nearest to a measured posture" if several else ""
    there = "There" if row.supported else "In all of them"
    reasons = dict.fromkeys(place.reason for place in row.places if place.likely and place.reason)
    why = f" (else: {'; '.join(reasons)})" if reasons else ""
    table = ". The page has all configurations" if several else ""
    return [
        f"asked for: {row.asked} places{which}; measured postures support {row.supported}{why}. {there} the model "
        f"errs by {row.without_mm:.3g} mm without the file, with it in a new series by {row.with_mm:.3g} mm, in "
        f"95 % of cases by less than {row.most_mm:.3g} mm{table}"
    ]


def _errors(found: PoseCalibration) -> list[str]:
    return [
        ", ".join([f"{name}: {row.fitted_mm:.4g} mm fitted", *_held_out(row), *_beside(found, row)])
        for name, row in (("before", found.before), ("after", found.after))
    ]


def _beside(found: PoseCalibration, row: SelectionRow) -> list[str]:
    return [f"{mm:.4g} on {name}" for name, mm in zip(found.beside, row.beside_mm, strict=True)]


def _held_out(row: SelectionRow) -> list[str]:
    ends = [] if row.ends_mm is None else [f"{row.ends_mm:.4g} at the ends"]
    ends = ends if row.series_mm is None else [f"{row.series_mm:.4g} {BY_SERIES}", *ends]
    if row.random_mm is None or row.region_mm is None:
        return [NOT_HELD_OUT, *ends]
    between = f"{row.random_mm:.4g} {AT_RANDOM}" if row.level_mm is None else f"{row.level_mm:.4g} {BY_LEVEL}"
    return [between, f"{row.region_mm:.4g} held out by region", *ends]


def weighed_down(found: PoseCalibration) -> list[str]:
    """What counts little in the fit, with its rows; a run of neighbours is more likely a change than outliers."""
    if not found.weighed_down:
        return []
    several = len({row.file for row in found.weighed_down}) > 1
    longest = sorted(found.weighed_down, key=lambda row: -row.readings)
    named = [_run(row, row.file if several else "") for row in longest[:RUNS]]
    readings = found.postures * len(found.markers)
    more = f" and {len(longest) - RUNS} more runs of rows" if len(longest) > RUNS else ""
    return [
        f"weighed down, for they lie far off: {found.outliers} of {readings} readings: {', '.join(named)}{more}"
    ]


def _run(row: WeighedDownRow, file: str) -> str:
    (low, high), where = row.off_mm, f"{file} " if file else ""
    if row.readings == 1:
        return f"{where}row {row.first_row} of {row.marker} ({high:.3g} mm)"
    run = f"{where}rows {row.first_row} to {row.last_row} of {row.marker} ({low:.3g} to {high:.3g} mm)"
    return f"{run}, which together are a change rather than outliers" if row.readings >= CHANGED else run


def within_words(ranges: Mapping[str, Sequence[float]]) -> list[str]:
    """Where a file is known, in words: a line, or none."""
    if not ranges:
        return []
    each = ", ".join(f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in ranges.items())
    return [f"valid within (rad, mm): {each}; beyond nothing was measured, and no held-out end tells of it"]


def _grid(found: PoseCalibration) -> list[str]:
    """What is said where postures lie in a pattern."""
    if not found.grid:
        return []
    at_random = f" ({found.after.random_mm:.4g} mm at random)" if found.after.random_mm is not None else ""
    return [
        f"the postures lie in a grid of {', '.join(found.grid)}: whole levels are held out, for at random each has "
        f"neighbours with the same coordinates{at_random}"
    ]


def _diagnosis(found: PoseDiagnosis) -> list[str]:
    result = [f"verdict: {found.verdict}"]
    if found.verdict != "unknown" and found.causes:
        result[0] += f": {', '.join(found.causes)}"
    result += found.findings.words
    if found.verdict != "unknown":
        result += [f"  as good: {', '.join(row)}" for row in found.alternatives]
    result += [f"  not added: {row.name}: {row.reason}" for row in found.refused]
    beside = "".join(f", on {name}" for name in found.beside)
    between = BY_LEVEL if found.grid else AT_RANDOM
    result.append(f"mean distance in mm: fitted, {between}, by region, at the ends{beside}")
    width = max(len(row.added or found.baseline) for row in found.selection)
    for row in found.selection:
        held = row.level_mm if found.grid else row.random_mm
        numbers = (row.fitted_mm, held, row.region_mm, row.ends_mm, *row.beside_mm)
        cells = "".join(f" {'−' if v is None else f'{v:.4g}':>9s}" for v in numbers)
        result.append(f"  {row.added or found.baseline:{width}s}{cells}")
    if found.explained is None:
        explained = f"{NOT_HELD_OUT}; explained of the error fitted: {found.findings.explained:.0%}"
    else:
        explained = f"explained: {found.explained:.0%} of the error held out"
    result.append(f"{explained}; {found.remainder.words}")
    return result


def _not_known(found: PoseCalibration) -> list[str]:
    """What the postures cannot know, in a line; the page has a table with the reasons."""
    families: dict[str, list[str]] = {}
    for row in found.not_known:
        family, _, part = row.name.partition(".")
        families.setdefault(family, []).append(part)
    words = [f"{family} of {', '.join(parts)}" for family, parts in families.items()]
    for one in found.families:
        blind = sum(not member.identifiable for member in one.members)
        words += [f"{blind} of {len(one.members)} members of {one.name}"] if blind else []
    return [f"these postures cannot know {'; '.join(words)}"] if words else []


def _intervals_are(found: PoseCalibration) -> list[str]:
    """What the intervals are of: a new series."""
    if not any(m.identifiable and m.scatter > 0.0 for one in found.families for m in one.members):
        return []
    many = len({row.file for row in found.series})
    if many > 1:
        return [f"intervals are those of a new series of the machine, by the scatter of these {many}"]
    return [
        "intervals are those of a new series: how much springs and gears change until then is a prior's, since one "
        "series does not tell"
    ]


def _written(row: WrittenRow, remedy: str) -> list[str]:
    worth = [
        f"  {one.where}: {one.verdict} than {one.against}, {one.uncalibrated_mm:.4g} to {one.file_mm:.4g} mm"
        for one in row.compared
    ]
    if worth:
        worth.insert(0, "what the model file is worth, root mean square:")
    bound = [f"{name} ended at the bound of what is built and keeps the model's value" for name in row.at_bound]
    bound += of_range(row)
    if row.refused and not row.forced:
        return [*worth, *bound, f"no model file was written: {'; '.join(row.refused)}{remedy}"]
    judged = f"{row.judged_mm:.4g} mm with all that was judged; "
    without = f" (a model file has no word for {', '.join(row.without)})" if row.without else ""
    warned = [f"warning: the model file is {line}" for line in within_words(row.valid_within)]
    by_force = [f"written by force, not for use: {'; '.join(row.refused)}"] if row.forced else []
    return [
        *worth,
        *bound,
        f"the model file, read back: {judged}{row.file_mm:.4g} mm by the file{without}",
        *by_force,
        *warned,
    ]
