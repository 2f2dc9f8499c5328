"""``calibration.json``: what a calibration found, as data."""

from __future__ import annotations

from pydantic import Field

from vjm_output.documents import MADE_OF, DoubtRow, Row


class ParameterRow(Row):
    """A parameter that the readings determine."""

    name: str
    unit: str
    nominal: float
    value: float
    std: float
    interval95: list[float] = Field(description="by the profile of the likelihood")
    over_nominal: float | None = Field(description="null where nominal is zero")
    at_bound: bool = Field(description="the drive is as rigid as can be told; its interval is one-sided")


class CombinationRow(Row):
    """A combination of parameters that cannot be distinguished.

    ``value`` is the sum of the coefficients times each parameter's z: ln(value/nominal), the entry itself for the
    off-diagonal factor of a 6×6, or the compliance in units of 1e-5 mm/N for a nominally rigid drive.
    """

    name: str
    coefficients: dict[str, float]
    seen: bool
    singular_value: float
    value: float | None = Field(description="null where the readings do not see it")
    std: float | None
    interval95: list[float] | None


class ComplianceRow(Row):
    """A full 6×6 compliance that was looked for, of one member at the tip in the part's own axes; mm, N, rad."""

    part: str
    value: list[list[float]]
    std: list[list[float | None]] = Field(description="null where the readings do not determine an entry")
    nominal: list[list[float]]


class NuisanceRow(Row):
    """A nuisance of the sheet."""

    name: str
    unit: str
    value: float
    std: float
    sheet_std: float
    from_data: float = Field(description="share of the information that is the readings'")


class DirectionRow(Row):
    """One right singular vector of the whitened sensitivity matrix, nuisances taken out."""

    name: str
    singular_value: float
    seen: bool


class IdentifiabilityRow(Row):
    """What these postures see."""

    statement: list[str]
    directions: list[DirectionRow] = Field([])
    not_separable: list[str] = Field([])


class MatrixRow(Row):
    """A symmetric matrix and what its rows are."""

    names: list[str]
    covariance: list[list[float]]
    correlation: list[list[float]]


class ChannelRow(Row):
    """The residuals of one channel."""

    channel: str
    readings: int
    rmse_nominal: float
    rmse: float
    unit: str
    in_sigma: float = Field(description="of the whitened residuals, outliers left out")
    spread: float = Field(description="by which noise exceeds the sheet's; 1 where it does not")
    autocorrelation: float
    quantum: float = Field(description="step of rounded readings; 0 where none was found")


class OutlierRow(Row):
    """A reading with channels that do not count."""

    row: int
    posture: str
    channels: list[str]
    in_sigma: float = Field(description="how far the worst of them is off, over its noise")


class FitRow(Row):
    """How well the model fits."""

    readings: int
    converged: bool
    fits: bool = Field(description="whether the residuals are what the sheet's noise allows")
    statement: str
    channels: list[ChannelRow]
    outliers: list[OutlierRow]
    behind_bifurcation: int = Field(description="readings behind a bifurcation")


class FigureRow(Row):
    """A predicted figure with what makes it uncertain."""

    posture: str
    direction: str
    quantity: str
    unit: str
    kind: str
    value: float
    std: float | None = Field(description="null where it has no derivative by something uncertain")
    interval95: list[float] | None
    sensitivities: dict[str, float | None] = Field(description="change per standard deviation of each source alone")
    reasons: list[str]


class PredictionsRow(Row):
    """The three sources of uncertainty, apart."""

    calibrated: list[FigureRow] = Field([])
    tolerances: list[FigureRow] = Field([], description="the nominal machine within the sheet's tolerances")
    rounding: list[FigureRow] = Field([], description="the nominal machine within the rounding of (19) and (20)")


class ProposedRampRow(Row):
    """A ramp that could be measured next."""

    posture: str
    ramp: str = Field(description="driven component and its signed end, mm or rad")
    parameters_shrink_to: float = Field(description="geometric mean of the standard deviations, over the present")
    figure_std: float | None


class DesignRow(Row):
    """Which posture next."""

    d_optimal: ProposedRampRow | None = None
    i_optimal: ProposedRampRow | None = None
    figure: str = Field("", description="the predicted figure that the I-optimal choice makes certain; empty: none")
    figure_std: float | None = None
    candidates: list[ProposedRampRow] = Field([])
    left_out: list[str] = Field([], description="ramps on which the calibrated model finds no path")


class PairedRow(Row):
    """A frequency and the mode that it is taken for."""

    column: str
    mode: int = Field(description="of the calibrated machine, from 1")
    measured: float = Field(description="Hz")
    computed: float = Field(description="Hz")
    in_sigma: float = Field(description="measured less computed, over its standard deviation")


class PairingRow(Row):
    """Which modes the frequencies of one row are."""

    row: int
    posture: str
    payload_kg: float
    modes: list[PairedRow]
    probability: float = Field(description="of this pairing among all that the sheet allows")
    otherwise: list[int] = Field(description="modes of the next likeliest pairing; empty where there is no other")


class Calibration(Row):
    """What ``validate calibrate`` writes to ``calibration.json``; N, mm, rad."""

    title: str
    model: str
    engine: str
    data: str
    sheet: str
    fit: FitRow
    parameters: list[ParameterRow]
    combinations: list[CombinationRow] = Field([])
    compliances: list[ComplianceRow] = Field([])
    nuisances: list[NuisanceRow]
    joint: MatrixRow = Field(description="parameters, seen combinations and nuisances; units of their rows")
    identifiability: IdentifiabilityRow
    predictions: PredictionsRow = PredictionsRow()
    next_experiment: DesignRow = DesignRow()
    calibrated_model: str = Field(description="name of its file; empty where it was not written")
    unfit: list[str] = Field([], description="why the calibrated model is not for use; empty where it is")
    versions: dict[str, str]
    made_of: dict[str, str] = Field({}, description=MADE_OF)
    pairing: list[PairingRow] = Field([], description="of a test of frequencies, row by row")
    doubts: list[DoubtRow] = Field([], description="what is implausible about readings, sheet or model")

    def __repr__(self) -> str:
        """A few lines; `vjm_updating.calibration.summary_text.fit_report` has the whole."""
        rows = [f"{row.name} = {row.value:.5g} ± {row.std:.2g} {row.unit}" for row in self.parameters]
        return "\n ".join([f"<Calibration of {self.model}, {self.engine}: {self.fit.statement}", *rows]) + ">"

    __str__ = __repr__
