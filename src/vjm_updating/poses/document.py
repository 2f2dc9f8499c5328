"""``diagnosis.json`` and ``calibration.json`` of tests of poses and of deflections."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vjm_output.documents import MADE_OF, DoubtRow, Row
from vjm_updating.findings import FindingsRow
from vjm_updating.observation.paired_gain import Worth


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
        description="predicted error of the file: how far fits without one region of the postures each lie apart"
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


class PoseVersionRow(Row):
    """What it was made with."""

    package: str
    model_sha256: str
    data_sha256: str


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
    version: PoseVersionRow
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
    shared_correlation_before: list[float] = Field(description="of the first two markers' residuals, by axis")
    shared_correlation_after: list[float]
    remainder: RemainderRow
    next: str
