"""``diagnosis.json`` and ``calibration.json`` of tests of poses and of deflections, and their lines of text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from pydantic import Field

from vjm.io.findings import Grade
from vjm_output.documents import MADE_OF, DoubtRow, Row, VersionRow
from vjm_updating.constants import shown
from vjm_updating.diagnosis.document import FindingsRow
from vjm_updating.inference.significance import Worth
from vjm_updating.poses.state import AT_RANDOM, BY_LEVEL, BY_SERIES


class MemberRow(Row):
    """A number of a family."""

    name: str
    value: float
    std: float
    interval95: list[float] = Field(description="of a new series of the machine")
    within_series95: list[float] = Field(
        description="of several series of what they share, of one series of its own value: without the scatter"
    )
    scatter: float = Field(
        description="standard deviation between series, in the unit; of one series what is believed beforehand"
    )
    one_sided: Literal["", "at most", "at least"] = Field(
        description="what the interval says where the value stands at its end, as at a bound; else empty"
    )
    unit: str
    learnt: float = Field(description="share of the prior variance that the data took away")
    identifiable: bool
    one_with: list[str] = Field(description="members and frames that can make up its effect wholly")
    at_bound: bool
    in_file: float | None = Field(
        description="value in the model file, fitted anew with what the file keeps of the model; null where it is "
        "not there, or the model's"
    )
    beyond_bound: float = Field(description="standard deviations by which the data want it beyond its bound")

    @property
    def may_be_nothing(self) -> bool:
        """Whether zero lies within what is known of it."""
        return self.within_series95[0] <= 0.0 <= self.within_series95[1]


class WeighedDownRow(Row):
    """Readings one after another that count little in the fit, for they lie far off what the others say."""

    file: str
    marker: str
    first_row: int = Field(description="of the data file")
    last_row: int
    readings: int
    off_mm: list[float] = Field(description="smallest and largest distance from the fit")


class ChangeRow(Row):
    """A change in the course of the file."""

    kind: Literal["shift", "tracker frame", "marker", "joint zero", "load zero"]
    name: str = Field(description="of the marker, joint or point of load; else empty")
    file: str
    row: int = Field(description="of the data file, the first after it")
    size: list[float] = Field(
        description="mm; of a tracker's frame rad too, of a joint's zero rad or mm, of a load N and N mm"
    )
    gain: float = Field(description="of twice the log likelihood, less what numbers, place and kind cost")
    share: float = Field(description="of the squared residual, that it explains")
    fitted: bool = Field(
        description="whether the series is cut there: each part has a number of its own for what changed"
    )


class SeriesRow(Row):
    """A series, or a part of one between two changes, with frames, markers and zeros of its own in the fit."""

    file: str
    sheet: str
    first_row: int
    last_row: int
    postures: int
    markers: list[str]


class FamilyRow(Row):
    """A family that was fitted."""

    name: str
    title: str
    size: float | None = Field(description="standard deviation of its members in their units, by the evidence")
    effective: float | None = Field(description="effective number of members")
    members: list[MemberRow]


class TrialRow(Row):
    """A hypothesis one move off a step of the selection."""

    name: str
    log_evidence: float = Field(description="by which it is larger, with what the choice of families costs")


class SelectionRow(Row):
    """A step of the selection: mean distances in mm."""

    added: str
    fitted_mm: float
    random_mm: float | None = Field(description="postures held out at random; null: of one posture nothing can be")
    region_mm: float | None = Field(description="regions of joint space held out; null likewise")
    level_mm: float | None = Field(
        description="whole levels of a grid held out, the mean over its coordinates; null: the postures lie in none"
    )
    series_mm: float | None = Field(
        description="whole series held out, frames and zeros fitted there; null: there is one series"
    )
    ends_mm: float | None = Field(
        description="the ends of the joints' ranges and of the clock held out, one at a time; null: there are none"
    )
    beside_mm: list[float] = Field(
        description="of each other series, nothing refitted but frames and zeros, as they stand in 'beside'"
    )
    parameters: float = Field(description="effective number of parameters, frames included")
    tried: list[TrialRow]


class PoseContrastRow(Row):
    """What residuals follow."""

    name: str
    kind: str
    share: float
    significance: float


class RemainderRow(Row):
    """The residual."""

    over_noise: float
    significant: bool
    kind: str
    words: str
    share: float = Field(description="of the residual, that a contrast of this kind explains")


class NextRow(Row):
    """Postures to measure next."""

    criterion: Literal["D", "I"]
    joints: list[str]
    q: list[list[float]]
    loads: list[dict[str, list[float]]] = Field(
        description="wrenches at the points of load, N and N mm, where they were measured. Those of deflections "
        "are in their tables' axes, of poses on the markers in the base's axes."
    )
    members: float = Field(description="factor on the members' standard deviations that they promise")
    prediction: float = Field(description="factor on the standard deviation of predictions")


class NotKnownRow(Row):
    """A member, or all of a part, that these data cannot know."""

    name: str
    reason: str


class ComparedRow(Row):
    """The model file against an uncalibrated model, on readings that it was not fitted to: root mean squares."""

    where: str = Field(description="held out by region, at the ends, or on another series")
    against: str = Field(
        description="the sheet's model; or that with its own compliances, which the sheet sets aside"
    )
    uncalibrated_mm: float = Field(description="by that model, only what the instruments leave unknown fitted")
    file_mm: float
    saved: float = Field(description="share of the error that the file saves, in the geometric mean of the regions")
    noise: float = Field(description="share that would have to be saved, or lost, beyond noise")
    blocks: int = Field(description="regions of joint space whose squared errors are compared in pairs")
    verdict: Worth


class RangeRow(Row):
    """What a model file is over the joints' whole range, frames refitted: root mean squares in mm."""

    model_mm: float = Field(description="that the model before it misses where it was measured, held out by region")
    asked_mm: float = Field(description="by how much the numbers change predictions, by these postures alone")
    changed_mm: float = Field(
        description="by how much those in the file do; a prior holds this to what the model before it misses"
    )
    error_mm: float = Field(
        description="predicted error of the file: how far fits without one region of the postures each lie apart. "
        "What the model lacks is added: what regions that were held out missed beyond the noise"
    )
    unsupported: list[str] = Field(
        description="members that these postures know, and that are nearer to the model's value in the file"
    )


class AskedPlaceRow(Row):
    """A posture of which a prediction was asked: errors of the first marker in mm, root mean squares."""

    q: list[float] = Field(description="coordinates of the joints, rad and mm")
    place_mm: list[float] = Field(description="of the first marker by the rigid model, in the base's axes")
    without_mm: float = Field(description="predicted error of the model that is not calibrated")
    with_mm: float = Field(description="of the calibrated one, in a new series")
    most_mm: float = Field(description="below which 95 % of these errors lie")
    supported: bool = Field(description="whether the measured postures support the file here")
    reason: str = Field(description="why they do not; else empty")
    likely: bool = Field(
        description="whether it is the nearest to a measured posture of all that reach its place; of a file always"
    )


class AskedForRow(Row):
    """What the file errs by where it will be used: root mean squares in mm.

    Over the likely postures that the measured ones support; over all likely ones where they support none.
    """

    joints: list[str]
    without_mm: float
    with_mm: float
    most_mm: float
    lack_mm: float = Field(
        description="what the model lacks: what regions that were held out missed beyond the noise; in both errors"
    )
    asked: int = Field(description="places, or postures of a file, that are reached within the joints' limits")
    supported: int = Field(description="of these, whose likely posture the measured ones support")
    places: list[AskedPlaceRow]


class WrittenRow(Row):
    """The model file, read back and evaluated on the readings: mean distances in mm."""

    judged_mm: float = Field(description="of the hypothesis that was judged, fitted")
    without: list[str] = Field(description="its families for which a model file has no word")
    refitted_mm: float = Field(description="of the hypothesis without them, fitted anew")
    file_mm: float = Field(description="by the file itself, only the frames fitted")
    verdict: Worth | None = Field(
        None,
        description="of a calibration: what the file is worth against the model before it, by 'compared'; null "
        "where nothing was held out",
    )
    compared: list[ComparedRow] = Field(
        [], description="of a calibration: what it is worth against the model before it"
    )
    at_bound: list[str] = Field(
        description="members that ended at the bound of what is built, and keep the model's value"
    )
    whole_range: RangeRow | None = Field(
        description="over the joints' limits or turns; null where nothing was fitted or can be held out"
    )
    refused: list[str] = Field(
        description="why it is not for use: what no machine is, or columns that are mistaken. Of a calibration, "
        "too, where it is no better than the model before it"
    )
    valid_within: dict[str, list[float]] = Field(
        {},
        description="of a calibration: measured ranges, rad or mm, of joints that reach further than held-out ends "
        "can tell of. The file has them under the same key",
    )
    forced: bool = Field(False, description="whether it was written all the same; it says so")


class HalvesRow(Row):
    """Share of members whose differences between halves of the test are within their 95 % intervals."""

    random: float
    file: float | None = Field(description="first against second half of the file, where the order is known")
    differ: bool = Field(description="whether these differ by more than random ones: a drift")
    members: dict[str, float] = Field(
        {}, description="that differ most between those of the file, by how many of their standard deviations"
    )


class PoseCalibration(Row):
    """A calibration by poses or deflections."""

    kind: Literal["poses", "deflections"]
    baseline: str = Field(description="what is fitted before any family is added")
    postures: int
    different_postures: int
    grid: list[str] = Field(
        description="joints, and axes of the first marker's place, with a few values only. Their whole levels "
        "are held out: at random each posture has neighbours, and says too little"
    )
    series: list[SeriesRow] = Field(description="in one fit; one where there are no others and no changes")
    markers: list[str]
    left_out: int
    outliers: int = Field(description="readings that are weighed down")
    weighed_down: list[WeighedDownRow] = Field(description="the same, by their rows")
    changes: list[ChangeRow] = Field(description="in the course of the file; none where the order is not known")
    before: SelectionRow
    after: SelectionRow
    families: list[FamilyRow]
    frames: dict[str, list[float]] = Field(
        description="base in the tracker's frame, and the markers' places, mm, rad"
    )
    next_postures: list[NextRow]
    doubts: list[DoubtRow] = Field(description="what is implausible about the data and the model")
    joints: str = Field(description="what the joints' columns are")
    not_asked: list[str] = Field(description="families that such readings cannot show")
    not_asked_for: str = Field(description="why they cannot")
    not_known: list[NotKnownRow] = Field(description="members that these postures cannot know, with the reason")
    beside: list[str] = Field(description="other series by which the findings were judged")
    written: WrittenRow
    asked_for: AskedForRow | None = Field(
        None, description="of a calibration: predicted errors where they were asked for"
    )
    halves: HalvesRow | None = Field(description="whether halves of the test give the same members")
    not_in_model: list[str] = Field(description="what the calibrated model file cannot hold")
    version: VersionRow
    made_of: dict[str, str] = Field({}, description=MADE_OF)
    seconds: float


class PoseDiagnosis(PoseCalibration):
    """A diagnosis by poses or deflections."""

    verdict: Literal["none", "named", "class", "partly", "unknown"]
    findings: FindingsRow = Field(description="what acts, what may act, and the residual")
    causes: list[str] = Field(description="that are named; where the verdict is 'unknown', guesses")
    alternatives: list[list[str]]
    refused: list[NotKnownRow] = Field(description="families that do not hold where they were held out, or beside")
    explained: float | None = Field(
        description="share of the mean distance held out that the causes save. Null: of one posture nothing can be "
        "held out. There findings.explained is of the fit."
    )
    selection: list[SelectionRow] = Field(description="steps of the stepwise selection, from the first to the last")
    contrasts_before: list[PoseContrastRow]
    contrasts_after: list[PoseContrastRow]
    remainder: RemainderRow
    next: str


NOT_HELD_OUT = "not held out, for all readings are of one posture"
BY_FORCE = "; `validate calibrate --force` writes it all the same"
RUNS = shown(6)
CHANGED = shown(3)
"""Neighbours that are a change rather than outliers, the fewest that a change has."""
SHOWN = shown(30)
"""Members that are printed."""


def lines(calibration: PoseCalibration) -> list[str]:
    """Lines for the terminal."""
    diagnosis = calibration if isinstance(calibration, PoseDiagnosis) else None
    if diagnosis:
        result = _diagnosis(diagnosis)
    else:
        steps = {"before": calibration.before, "after": calibration.after}
        result = [of_file(calibration.written), *(_errors(calibration, *step) for step in steps.items())]
    result += weighed_down(calibration)
    if calibration.grid:
        random = calibration.after.random_mm
        at_random = "" if random is None else f" ({random:.4g} mm at random)"
        result.append(
            f"the postures lie in a grid of {', '.join(calibration.grid)}: whole levels are held out, for at "
            f"random each has neighbours with the same coordinates{at_random}"
        )
    result += [f"data: {row.where}: {row.found}" for row in calibration.doubts if row.grade != Grade.NOTED]
    if calibration.not_asked:
        result.append(f"not asked, for {calibration.not_asked_for}: {', '.join(calibration.not_asked)}")
    result += _not_known(calibration)
    if not (diagnosis and diagnosis.verdict == "unknown"):
        result += _members(calibration)
        result += _intervals_are(calibration)
    result += of_asked(calibration)
    result += _written(calibration.written, "" if diagnosis else BY_FORCE)
    lacks = [one for one in calibration.not_in_model if one not in calibration.written.without]
    result += [f"not in the model file: {one}" for one in lacks]
    result += [
        f"next, {one.criterion}-optimal: {len(one.q)} postures make the members' standard deviations "
        f"{one.members:.2f} of theirs, those of predictions {one.prediction:.2f}"
        for one in calibration.next_postures
    ]
    return [*result, f"next: {diagnosis.next}"] if diagnosis else result


def _members(calibration: PoseCalibration) -> list[str]:
    """The numbers that the postures know: compliances, then of other families what is surely not nothing."""
    known = [m for one in calibration.families for m in one.members if m.identifiable]
    soft = [m for m in known if "compliance" in m.name]
    others = [m for m in known if m not in soft and not m.may_be_nothing]
    others.sort(key=lambda m: -abs(m.value) / max(m.std, 1e-300))
    result = []
    for members in (soft, others):
        result += [f"  {m.name} = {m.value:.4g} ({interval(m)}) {m.unit}" for m in members[:SHOWN]]
        more = len(members) - SHOWN
        result += [f"  and {more} more, which the document has"] if more > 0 else []
    return result


def interval(row: MemberRow) -> str:
    """The 95 % interval in words: both ends, or the one that it has."""
    low, high = row.interval95
    two_ends = f"{low:.3g} to {high:.3g}"
    return {"": two_ends, "at most": f"at most {high:.3g}", "at least": f"at least {low:.3g}"}[row.one_sided]


WORDS = {
    None: "nothing can be held out", Worth.BETTER: "better there", Worth.ALIKE: "no better", Worth.WORSE: "worse"
}  # fmt: skip
"""Of what a model file is worth."""


def of_file(row: WrittenRow) -> str:
    """The verdict of a calibration's model file, in a line."""
    done = "" if not row.refused else ": written by force" if row.forced else ": not written"
    worth = WORDS[row.verdict]
    if row.verdict is Worth.BETTER and row.refused:
        worth += ", but no machine is so"
    return f"the model file, where postures were held out: {worth}{done}"


def of_range(row: WrittenRow) -> list[str]:
    """How well the file is known over the joints' whole range, and which numbers the postures do not support."""
    if row.whole_range is None:
        return []
    span, said = row.whole_range, []
    words = (
        f"over the joints' whole range the file changes the model by {span.changed_mm:.3g} mm, known to "
        f"{span.error_mm:.3g} mm. Where it was measured the model misses {span.model_mm:.3g} mm, root mean square"
    )
    if span.unsupported:
        names = ", ".join(span.unsupported[:SHOWN])
        said = [
            f"that range asks for other postures: held near to the model's value {names}. "
            f"Else the file would change the model by {span.asked_mm:.3g} mm there"
        ]
    return [words, *said]


def of_asked(calibration: PoseCalibration) -> list[str]:
    """What the file errs by where it will be used."""
    row = calibration.asked_for
    if row is None:
        return []
    several = len(row.places) > row.asked
    which = ", in the configuration of the arm that is nearest to a measured posture" if several else ""
    where = "There" if row.supported else "In all of them"
    reasons = dict.fromkeys(place.reason for place in row.places if place.likely and place.reason)
    why = f" (else: {'; '.join(reasons)})" if reasons else ""
    table = ". The page has all configurations" if several else ""
    return [
        f"asked for: {row.asked} places{which}; measured postures support {row.supported}{why}. {where} the model "
        f"errs by {row.without_mm:.3g} mm without the file, with it in a new series by {row.with_mm:.3g} mm, in "
        f"95 % of cases by less than {row.most_mm:.3g} mm{table}"
    ]


def _errors(calibration: PoseCalibration, name: str, row: SelectionRow) -> str:
    held = [f"{name}: {row.fitted_mm:.4g} mm fitted"]
    if row.random_mm is None or row.region_mm is None:
        held.append(NOT_HELD_OUT)
    else:
        level, random = row.level_mm, row.random_mm
        held.append(f"{random:.4g} {AT_RANDOM}" if level is None else f"{level:.4g} {BY_LEVEL}")
        held.append(f"{row.region_mm:.4g} held out by region")
    held += [] if row.series_mm is None else [f"{row.series_mm:.4g} {BY_SERIES}"]
    held += [] if row.ends_mm is None else [f"{row.ends_mm:.4g} at the ends"]
    held += [f"{mm:.4g} on {series}" for series, mm in zip(calibration.beside, row.beside_mm, strict=True)]
    return ", ".join(held)


def weighed_down(calibration: PoseCalibration) -> list[str]:
    """What counts little in the fit, with its rows; a run of neighbours is more likely a change than outliers."""
    if not calibration.weighed_down:
        return []
    several = len({row.file for row in calibration.weighed_down}) > 1
    longest = sorted(calibration.weighed_down, key=lambda row: -row.readings)
    named = [_run(row, row.file if several else "") for row in longest[:RUNS]]
    readings = calibration.postures * len(calibration.markers)
    more = f" and {len(longest) - RUNS} more runs of rows" if len(longest) > RUNS else ""
    return [
        f"weighed down, for they lie far off: {calibration.outliers} of {readings} readings: "
        f"{', '.join(named)}{more}"
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


def _diagnosis(diagnosis: PoseDiagnosis) -> list[str]:
    result = [f"verdict: {diagnosis.verdict}"]
    if diagnosis.verdict != "unknown" and diagnosis.causes:
        result[0] += f": {', '.join(diagnosis.causes)}"
    result += diagnosis.findings.words
    if diagnosis.verdict != "unknown":
        result += [f"  as good: {', '.join(row)}" for row in diagnosis.alternatives]
    result += [f"  not added: {row.name}: {row.reason}" for row in diagnosis.refused]
    beside = "".join(f", on {name}" for name in diagnosis.beside)
    between = BY_LEVEL if diagnosis.grid else AT_RANDOM
    result.append(f"mean distance in mm: fitted, {between}, by region, at the ends{beside}")
    width = max(len(row.added or diagnosis.baseline) for row in diagnosis.selection)
    for row in diagnosis.selection:
        held = row.level_mm if diagnosis.grid else row.random_mm
        numbers = (row.fitted_mm, held, row.region_mm, row.ends_mm, *row.beside_mm)
        cells = "".join(f" {'−' if v is None else f'{v:.4g}':>9s}" for v in numbers)
        result.append(f"  {row.added or diagnosis.baseline:{width}s}{cells}")
    if diagnosis.explained is None:
        explained = f"{NOT_HELD_OUT}; explained of the error fitted: {diagnosis.findings.explained:.0%}"
    else:
        explained = f"explained: {diagnosis.explained:.0%} of the error held out"
    result.append(f"{explained}; {diagnosis.remainder.words}")
    return result


def _not_known(calibration: PoseCalibration) -> list[str]:
    """What the postures cannot know, in a line; the page has a table with the reasons."""
    families: dict[str, list[str]] = {}
    for row in calibration.not_known:
        family, _, part = row.name.partition(".")
        families.setdefault(family, []).append(part)
    words = [f"{family} of {', '.join(parts)}" for family, parts in families.items()]
    for one in calibration.families:
        blind = sum(not member.identifiable for member in one.members)
        words += [f"{blind} of {len(one.members)} members of {one.name}"] if blind else []
    return [f"these postures cannot know {'; '.join(words)}"] if words else []


def _intervals_are(calibration: PoseCalibration) -> list[str]:
    """What the intervals are of: a new series."""
    if not any(m.identifiable and m.scatter > 0.0 for one in calibration.families for m in one.members):
        return []
    many = len({row.file for row in calibration.series})
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
