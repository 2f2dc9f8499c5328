"""What a diagnosis finds, as probabilities, and ``diagnosis.json`` as docs/measured-data.md has it.

Probabilities are of every cause, of every place, and of groups of which one acts.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from math import inf
from typing import Literal, TypeVar

from pydantic import Field

from vjm_output.documents import MADE_OF, DoubtRow, Row, VersionRow
from vjm_updating.constants import stated_level

SURE = stated_level(0.95)
"""Probability from which on a cause, or one of a group, is said to act: that of the intervals of parameters."""


class Word(StrEnum):
    """What is said of a cause."""

    ACTS = "acts"
    ONE_OF = "one of these acts"
    MAY = "may act"


class PlaceRow(Row):
    """A place where a cause may sit."""

    place: str = Field(description="the cause with its part or channel, as in creep(foot)")
    probability: float


class CauseRow(Row):
    """A cause that may act."""

    cause: str
    probability: float = Field(
        description="that it acts: the sum over the hypotheses that contain it. Of a guess, times the probability "
        "that nothing acts that no catalogue has"
    )
    share: float | None = Field(description="of what the nominal model misses, that it explains; null: not known")
    word: Word
    places: list[PlaceRow] = Field([])
    within_law_of: str = Field(
        "", description="the main cause, whose law may be wrong by as much as this cause explains; empty: none"
    )


class GroupRow(Row):
    """Causes of which one acts; these readings do not tell which."""

    causes: list[str]
    probability: float = Field(description="that one of them acts at least")


class FindingsRow(Row):
    """What acts, what may act, and the residual."""

    causes: list[CauseRow] = Field([], description="the largest share first, then by probability")
    groups: list[GroupRow] = Field([])
    nothing: float | None = Field(None, description="probability that nothing acts beyond the sheet's tolerances")
    unknown: float | None = Field(None, description="probability that something acts that no catalogue has")
    explained: float = Field(0.0, description="share of what the nominal model misses, by the likeliest hypothesis")
    left: float = Field(0.0, description="residual, root mean square over the noise")
    more_than_noise: bool = Field(False, description="whether the residual is more than noise")
    within_law_error: bool = Field(
        False, description="whether the residual is noise only beside what the causes' laws may be wrong by"
    )
    trusted: bool = Field(True, description="whether anything is said to act; else the causes are guesses")
    words: list[str] = Field([])


@dataclass(frozen=True)
class PosteriorSample:
    """A set of causes in their places, and how probable it is.

    Attributes:
        places: by cause, where it sits.
        probability: of all of them together, nothing else acting.
    """

    places: Mapping[str, Sequence[str]]
    probability: float


def acting(hypotheses: Iterable[PosteriorSample], causes: Iterable[str]) -> float:
    """Probability that one of several causes acts at least."""
    wanted = set(causes)
    return min(1.0, sum(h.probability for h in hypotheses if wanted & set(h.places)))


def groups_of(hypotheses: Sequence[PosteriorSample]) -> list[GroupRow]:
    """Causes of which one surely acts, though of none of them it is sure that it does.

    Two exchange where they act together more rarely than if they knew nothing of one another. Of those that are
    linked so, the likeliest are taken until one of them surely acts.
    """
    known = {cause for h in hypotheses for cause in h.places}
    p = {cause: acting(hypotheses, [cause]) for cause in sorted(known)}
    open_ = sorted((cause for cause in p if p[cause] < SURE), key=lambda cause: -p[cause])
    linked: dict[str, set[str]] = {cause: {cause} for cause in open_}
    for a, b in combinations(open_, 2):
        both = sum(h.probability for h in hypotheses if a in h.places and b in h.places)
        if both < p[a] * p[b]:
            joined = linked[a] | linked[b]
            for cause in joined:
                linked[cause] = joined
    rows: list[GroupRow] = []
    seen: set[str] = set()
    for cause in open_:
        if cause in seen:
            continue
        seen |= linked[cause]
        chosen: list[str] = []
        for other in (one for one in open_ if one in linked[cause]):
            chosen.append(other)
            if (together := acting(hypotheses, chosen)) >= SURE:
                rows.append(GroupRow(causes=chosen, probability=together))
                break
    return rows


K = TypeVar("K", bound=Hashable)


def credible(
    best: K, probability: Mapping[K, float], needless: Callable[[K, K], bool] = lambda *_: False, most: float = inf
) -> list[K]:
    """The fewest hypotheses of which one is right with 95 %, the best one among them; the likeliest first.

    A rival that says the same as a member with more is ``needless``, and counts as that member. No more than
    ``most`` are taken.

    Example:
        >>> credible("a", {"a": 0.6, "b": 0.37, "c": 0.03})
        ['a', 'b']
    """
    members, held = [best], probability[best]
    for rival in sorted(probability, key=lambda one: -probability[one]):
        if held >= SURE or len(members) >= most:
            break
        if rival != best:
            held += probability[rival]
            if not any(needless(one, rival) for one in members):
                members.append(rival)
    return sorted(members, key=lambda one: -probability[one])


def by_hypotheses(hypotheses: Sequence[PosteriorSample]) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Probability of every cause, and of every place of it."""
    p = {cause: acting(hypotheses, [cause]) for cause in sorted({cause for h in hypotheses for cause in h.places})}
    places: dict[str, dict[str, float]] = {cause: {} for cause in p}
    for h in hypotheses:
        for cause, own in h.places.items():
            for place in own:
                places[cause][place] = min(1.0, places[cause].get(place, 0.0) + h.probability)
    return p, places


def shares_of(explained: float, lost: Mapping[str, float]) -> dict[str, float]:
    """Share of what the nominal model misses by cause: as each is missed, of all that they explain together.

    Together they have ``explained`` of it. Without a cause so much more is left as ``lost`` says, in any unit.

    Example:
        >>> shares_of(0.8, {"a": 3.0, "b": 1.0})
        {'a': 0.6000000000000001, 'b': 0.2}
    """
    together = sum(lost.values())
    return {cause: explained * part / together if together > 0.0 else 0.0 for cause, part in lost.items()}


def findings_of(
    probability: Mapping[str, float],
    shares: Mapping[str, float],
    groups: Sequence[GroupRow],
    *,
    explained: float,
    left: float,
    more_than_noise: bool,
    trusted: bool,
    places: Mapping[str, Mapping[str, float]] | None = None,
    nothing: float | None = None,
    unknown: float | None = None,
    within_law: Mapping[str, str] | None = None,
    within_law_error: bool = False,
) -> FindingsRow:
    """The findings in rows and words.

    What the nominal model misses has ``shares`` by cause, and the likeliest hypothesis has ``explained`` so much of
    it; ``left`` is the residual over the noise. What was not asked is None. Of a cause that explains no more than
    another one's law may be wrong by, ``within_law`` has the other.
    """
    kept = list(groups) if trusted else []
    inside = {cause for group in kept for cause in group.causes}
    # hypotheses of the catalogue are all that there is only where something unknown does not act
    known = 1.0 if trusted or unknown is None else 1.0 - unknown
    rows = []
    for cause, p in probability.items():
        word = Word.ONE_OF if cause in inside else Word.ACTS if trusted and p >= SURE else Word.MAY
        if word is Word.MAY and p < 1.0 - SURE and cause not in (within_law or {}):
            continue
        ranked = sorted((places or {}).get(cause, {}).items(), key=lambda pair: -pair[1])
        by_place = [PlaceRow(place=place, probability=known * q) for place, q in ranked if q >= 1.0 - SURE]
        rows.append(
            CauseRow(
                cause=cause, probability=known * p, share=shares.get(cause), word=word, places=by_place,
                within_law_of=(within_law or {}).get(cause, ""),
            )
        )  # fmt: skip
    order = list(Word)
    rows.sort(key=lambda row: (order.index(row.word), -(row.share or 0.0), -row.probability))
    findings = FindingsRow(
        causes=rows,
        groups=kept,
        nothing=nothing,
        unknown=unknown,
        explained=explained,
        left=left,
        more_than_noise=more_than_noise,
        within_law_error=within_law_error,
        trusted=trusted,
    )
    return findings.model_copy(update={"words": words(findings)})


def words(findings: FindingsRow) -> list[str]:
    """The findings in plain words, line by line."""
    said = findings.causes if findings.trusted else []
    acting = [_line(row) for row in said if row.word is Word.ACTS]
    lines = [f"{line}; the main cause" if len(acting) > 1 and line is acting[0] else line for line in acting]
    lines += [f"one of these acts ({row.probability:.2f}): {', '.join(row.causes)}" for row in findings.groups]
    lines += [_line(row) for row in said if row.word is not Word.ACTS]
    if findings.nothing is not None and findings.nothing >= 1.0 - SURE:
        lines.append(f"nothing acts: probability {findings.nothing:.2f}")
    if findings.unknown is not None and findings.unknown >= 1.0 - SURE:
        lines.append(f"something acts that no catalogue has: probability {findings.unknown:.2f}")
    noise = "more than noise" if findings.more_than_noise else "no more than noise"
    if findings.within_law_error:
        noise = "more than noise, but no more than the laws of these causes may be wrong by"
    if not findings.trusted:
        noise += ", and nothing is said to act"
    explained = f"explained: {findings.explained:.0%} of what the nominal model misses"
    lines.append(f"{explained}; residual: {findings.left:.2f} sigma, {noise}")
    if findings.causes and not findings.trusted:
        nearest = ", ".join(f"{row.cause} {row.probability:.2f}" for row in findings.causes)
        lines.append(f"no answer, guesses of the catalogue with their probabilities: {nearest}")
    return lines


def _line(row: CauseRow) -> str:
    where = ", ".join(f"{place.place} {place.probability:.2f}" for place in row.places)
    share = "" if row.share is None else f", {row.share:.0%} of what the nominal model misses"
    verb = {Word.ACTS: f"{row.cause} acts", Word.ONE_OF: f"  {row.cause}", Word.MAY: f"{row.cause} may act"}[
        row.word
    ]
    said = f"{verb} ({row.probability:.2f}{share})"
    if len(row.places) > 1 or where.partition(" ")[0] not in ("", row.cause):
        said += f": {where}"
    return f"{said}; the law of {row.within_law_of} may be wrong by as much" if row.within_law_of else said


class ValueRow(Row):
    """A parameter."""

    value: float
    std: float
    interval95: list[float]
    limits: Literal["both", "upper", "lower", "none"] = Field(
        "both", description="which ends of the interval the readings tell; the others are those of what is usual"
    )

    @property
    def low(self) -> float:
        """End of the 95 % interval."""
        return self.interval95[0]

    @property
    def high(self) -> float:
        """End of the 95 % interval."""
        return self.interval95[1]

    def joined(self, other: ValueRow) -> ValueRow:
        """The same with an interval that takes in another's."""
        ends = [min(self.low, other.low), max(self.high, other.high)]
        limits = self.limits
        if other.limits not in ("both", limits):
            limits = other.limits if limits == "both" else "none"
        return self.model_copy(update={"interval95": ends, "limits": limits})

    @property
    def words(self) -> str:
        """Value and standard deviation, or what is told in their place."""
        return {
            "both": f"{self.value:.5g} ± {self.std:.2g}",
            "upper": f"below {self.high:.3g}",
            "lower": f"above {self.low:.3g}",
            "none": "not told by these readings",
        }[self.limits]


class CriticalForceRow(Row):
    """The critical force, where one was measured, and its predictions."""

    measured_N: float | None = None  # noqa: N815
    before_N: float | None = None  # noqa: N815
    after_N: float | None = None  # noqa: N815


class FoldRow(Row):
    """Errors of readings that were held out together."""

    name: str
    readings: int = Field(description="samples that were read; a reading of three components has three")
    force: float = Field(description="root mean square of what was read, in the unit of the gain")
    rmse_before: float
    rmse_after: float


class GainRow(Row):
    """Error of readings held out."""

    rmse_before: float
    rmse_after: float
    interval95: list[float] = Field(description="of the reduction")
    unit: Literal["N", "mm", "Nmm", "rad"] = "N"
    before_in_sigma: float
    after_in_sigma: float
    expected_in_sigma: float = Field(
        description="a right model's error: the noise, and what the rest of the readings leaves open"
    )
    split: str
    critical: CriticalForceRow = CriticalForceRow()
    folds: list[FoldRow] = Field([], description="each part on its own")


class CriticalPointRow(Row):
    """Critical forces of one half-ray of the test."""

    posture: str
    direction: str
    reached_N: float = Field(description="largest force that was read")  # noqa: N815
    measured_N: float | None = Field(description="knee of the readings")  # noqa: N815
    before_N: float | None = Field(description="knee of the nominal model at the same readings")  # noqa: N815
    after_N: float | None = Field(description="and of the extended one")  # noqa: N815
    nominal: str = Field(description="kind of the nominal model's own critical point; empty where it has none")
    nominal_N: float | None  # noqa: N815
    extended: str = Field(description="and of the extended model's")
    extended_N: float | None  # noqa: N815
    yields_N: float | None = Field(description="where the extended model's material would yield first")  # noqa: N815
    yields: str = Field(description="where that is, or why it is not known")

    @property
    def forces(self) -> CriticalForceRow:
        """Knees where the readings show one, else the models' own critical points."""
        if self.measured_N is None:
            return CriticalForceRow(before_N=self.nominal_N, after_N=self.extended_N)
        return CriticalForceRow(measured_N=self.measured_N, before_N=self.before_N, after_N=self.after_N)


class CandidateRow(Row):
    """A set of causes that remains possible."""

    causes: list[str]
    places: list[str] = Field([], description="the causes with the part that each sits in, as in creep(foot)")
    probability: float
    parameters: dict[str, ValueRow | str]
    gain: GainRow | None = Field(description="null where it is a mistake of the instruments alone")


class AlternativeRow(Row):
    """A set of causes that was tried and is less likely."""

    causes: list[str]
    places: list[str] = Field([], description="the causes with the part or channel that each sits in")
    confidence: float


class ExperimentRow(Row):
    """What to measure next."""

    why: str = ""
    posture: str = ""
    path: str = ""
    difference: float | None = Field(None, description="largest difference that it would show, N or N mm")
    channel: str = ""
    strength: float | None = Field(None, description="of the discrimination to be expected")


class TransferRow(Row):
    """Error of another specimen's readings under what was found, nothing fitted anew."""

    causes: list[str] = Field(description="candidate of this diagnosis")
    what: str = Field(description="that was taken over of it")
    rmse: float | None = Field(description="null where the machine does not stand with it")
    unit: Literal["N", "mm", "Nmm", "rad"] = "N"


class ContrastRow(Row):
    """A contrast of the nominal model's residual."""

    name: str
    channel: str
    size: float
    significance: float


class NoiseRow(Row):
    """What was found of the noise."""

    autocorrelation: dict[str, float]
    outliers: int
    readings: int
    critical: int = Field(0, description="left out near a critical point; `residual` says why")


class Diagnosis(Row):
    """What a diagnosis found."""

    verdict: Literal["none", "named", "class", "unknown"]
    findings: FindingsRow = Field(FindingsRow(), description="what acts, what may act, and the residual")
    causes: list[str]
    candidates: list[CandidateRow]
    parameters: dict[str, ValueRow | str]
    confidence: float
    alternatives: list[AlternativeRow]
    gain: GainRow | None
    next_experiment: ExperimentRow
    version: VersionRow
    made_of: dict[str, str] = Field({}, description=MADE_OF)
    residual: str = Field("", description="shape of what no cause explains")
    contrasts: list[ContrastRow] = Field(default=[])
    noise: NoiseRow | None = None
    nuisances: dict[str, ValueRow] = Field(default={})
    critical: list[CriticalPointRow] = Field([], description="of every half-ray that was traced")
    transfer: list[TransferRow] = Field([], description="to the specimen of --beside")
    doubts: list[DoubtRow] = Field([], description="what is implausible about readings, sheet or model")
    seconds: float = 0.0
