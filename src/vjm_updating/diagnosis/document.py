"""``diagnosis.json`` as docs/measured-data.md has it."""

from __future__ import annotations

from typing import Literal, assert_never

from pydantic import Field

from vjm_output.documents import MADE_OF, DoubtRow, Row
from vjm_updating.findings import FindingsRow


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
        limits = (
            self.limits
            if other.limits in ("both", self.limits)
            else other.limits
            if self.limits == "both"
            else "none"
        )
        return self.model_copy(update={"interval95": ends, "limits": limits})

    @property
    def words(self) -> str:
        """Value and standard deviation, or what is told in their place."""
        match self.limits:
            case "both":
                return f"{self.value:.5g} ± {self.std:.2g}"
            case "upper":
                return f"below {self.high:.3g}"
            case "lower":
                return f"above {self.low:.3g}"
            case "none":
                return "not told by these readings"
            case _:
                assert_never(self.limits)


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


class VersionRow(Row):
    """What made it."""

    package: str
    model_sha256: str
    data_sha256: str


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
