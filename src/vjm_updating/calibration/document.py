"""``calibration.json``: what a calibration finds, as data, and in sentences and tables for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO

from pydantic import Field
from rich.box import SIMPLE
from rich.console import Console

from vjm_output.documents import MADE_OF, DoubtRow, Row
from vjm_output.number_text import number
from vjm_output.terminal import TerminalTable
from vjm_updating.constants import shown


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
    counted_std: float = Field(description="that of the prior: larger where the fit takes it beyond the sheet's")
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
        """A few lines; `vjm_updating.calibration.document.fit_report` has the whole."""
        rows = [f"{row.name} = {row.value:.5g} ± {row.std:.2g} {row.unit}" for row in self.parameters]
        return "\n ".join([f"<Calibration of {self.model}, {self.engine}: {self.fit.statement}", *rows]) + ">"

    __str__ = __repr__


DIGITS = shown(5)
JUDGED = "the model file is judged by the readings that it was fitted to: tests of this kind hold nothing out"
WIDTH = shown(120)
"""Columns of `fit_report`."""


def tables(document: Calibration) -> list[TerminalTable | str]:
    """What a person wants to know first."""
    blocks: list[TerminalTable | str] = [document.fit.statement, *document.identifiability.statement]
    if document.calibrated_model:
        blocks.append(JUDGED)
    if document.fit.outliers:
        rows = ", ".join(str(one.row) for one in document.fit.outliers[:10])
        more = ", …" if len(document.fit.outliers) > 10 else ""
        blocks.append(f"{len(document.fit.outliers)} outliers do not count, in rows {rows}{more}")
    blocks += [_parameters(document)]
    if document.combinations:
        blocks.append(_combinations(document))
    if document.predictions.calibrated:
        blocks.append(_figures("What the calibrated machine will do", document.predictions.calibrated))
    if document.pairing:
        blocks.append(_pairing(document))
    # a test of one joint or of frequencies has no ramps
    elif document.identifiability.directions:
        blocks += _next(document)
    return blocks


def fit_report(document: Calibration) -> str:
    """Fit, parameters with their uncertainty, predictions and what to measure next, as the command prints them."""
    console = Console(width=WIDTH, file=StringIO(), markup=False, color_system=None)
    for item in tables(document):
        console.print(item, soft_wrap=isinstance(item, str))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def _table(title: str, columns: Sequence[str]) -> TerminalTable:
    table = TerminalTable(title=title, title_justify="left", box=SIMPLE)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left")
    return table


def interval(ends: Sequence[float] | None) -> str:
    """``0.94 to 0.96``."""
    return number(None) if ends is None else f"{number(ends[0], DIGITS)} to {number(ends[1], DIGITS)}"


def _parameters(document: Calibration) -> TerminalTable:
    columns = ("parameter", "value", "unit", "std", "95 % interval", "over nominal")
    table = _table(f"{document.model}, {document.engine}: {document.title}", columns)
    for row in document.parameters:
        ratio = number(row.over_nominal, DIGITS)
        ends = interval(row.interval95) + (" (at its bound)" if row.at_bound else "")
        table.add_row(row.name, number(row.value, DIGITS), row.unit, number(row.std, 2), ends, ratio)
    return table


def _combinations(document: Calibration) -> TerminalTable:
    table = _table("What can be told only together, in z", ("combination", "value", "std", "95 % interval"))
    for row in document.combinations:
        if row.seen:
            table.add_row(row.name, number(row.value), number(row.std, 2), interval(row.interval95))
        else:
            table.add_row(row.name, "not seen", "", "")
    return table


def _pairing(document: Calibration) -> TerminalTable:
    columns = ("posture", "Hz, measured", "mode", "Hz, calibrated", "sigma off", "pairing's probability")
    table = _table("Which mode each frequency is", columns)
    for row in document.pairing:
        for i, one in enumerate(row.modes):
            load = f" with {number(row.payload_kg)} kg" if row.payload_kg else ""
            first = ("", "") if i else (row.posture + load, number(row.probability, 3))
            table.add_row(
                first[0], number(one.measured, DIGITS), str(one.mode), number(one.computed, DIGITS),
                number(one.in_sigma, 2), first[1],
            )  # fmt: skip
    return table


def _figures(title: str, rows: Sequence[FigureRow]) -> TerminalTable:
    columns = ("figure", "value", "unit", "std", "95 % interval", "mostly from")
    table = _table(title, columns)
    for row in rows:
        if row.quantity == "K0" and row.direction == "compression":
            continue  # the same as in tension
        kind = f" ({row.kind})" if row.kind else ""
        name = f"{row.posture} {row.direction} {row.quantity}{kind}"
        first = next(iter(row.sensitivities), "")
        std = number(row.std, 2)
        table.add_row(name, number(row.value, DIGITS), row.unit, std, interval(row.interval95), first)
    return table


def _next(document: Calibration) -> list[TerminalTable | str]:
    experiment = document.next_experiment
    if experiment.d_optimal is None:
        return ["no feasible ramp tells anything new"]
    table = _table("Which posture next", ("ramp", "parameters' std times", f"std of {_figure(experiment.figure)}"))
    for row in experiment.candidates[:8]:
        name = _ramp(row)
        table.add_row(name, number(row.parameters_shrink_to, 3), number(row.figure_std, 3))
    d, i = experiment.d_optimal, experiment.i_optimal
    words = f"for the parameters (D-optimal): {_ramp(d)}"
    if i is not None:
        words += f"; for {_figure(experiment.figure)} (I-optimal): {_ramp(i)}"
    return [table, words]


def _ramp(row: ProposedRampRow) -> str:
    """``D x -12``: a colon would make a picture of it in a terminal."""
    return f"{row.posture} {row.ramp.replace(':', ' ')}"


def _figure(label: str) -> str:
    return label.replace(":", " ")
