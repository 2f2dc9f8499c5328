"""Measured data of any kind of test, as an object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, assert_never

from vjm.io.findings import Finding
from vjm.io.provenance import Provenance
from vjm.model.machine import Machine
from vjm_updating.constants import shown
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.experiment import Measurement, read_measurement
from vjm_updating.experiment.plausibility import considered
from vjm_updating.experiment.sheet import kind_of_sheet
from vjm_updating.experiment.source import (
    SheetSource,
    TableSource,
    source_of_readings,
    source_of_sheet,
    table_of,
)
from vjm_updating.frequencies.measurement import FrequencyMeasurement, read_frequencies
from vjm_updating.frequencies.plausibility import considered as frequencies_considered
from vjm_updating.poses.kinds import KINDS, PreparedTest, read_test
from vjm_updating.poses.kinds import together as joined_tests

if TYPE_CHECKING:
    from vjm.notebook import DataFrame

FREQUENCIES = "frequencies"
"""Kind of a sheet."""
SHOWN = shown(8)
"""Readings that the HTML shows."""


@dataclass(frozen=True, eq=False, repr=False)
class DataSet:
    """A test that was read and checked: its readings, its sheet and its model; see `load_data`.

    Attributes:
        test: what a diagnosis or a calibration works on.
        columns: the readings as given, by column; a cell that was not read is blank.
        files: SHA-256 of readings and sheet by name.

    Example:
        >>> from importlib.resources import files
        >>> from vjm_updating import load_data
        >>> folder = files("vjm_validation") / "examples/soft-springs"
        >>> load_data(folder / "readings.csv", folder / "sheet.toml")
        <DataSet ramps of orthoglide-chain: 120 readings of time_s, posture, run, ux_mm, fx_N, fy_N, fz_N>
    """

    test: Measurement | PreparedTest
    columns: Mapping[str, Sequence[str]]
    files: Mapping[str, str]

    @property
    def kind(self) -> str:
        """``ramps``, ``column``, ``loads``, ``joint``, ``poses``, ``deflections`` or ``frequencies``."""
        match self.test:
            case FrequencyMeasurement():
                return FREQUENCIES
            case Measurement():
                return kind_of(self.test).name
            case PreparedTest():
                return self.test.measurement.kind
            case _:
                assert_never(self.test)

    @property
    def sheet(self) -> str:
        """Name of the sheet, for messages."""
        return self.test.sheet.file if isinstance(self.test, Measurement) else self.test.measurement.sheet.file

    @property
    def chain(self) -> Machine:
        """The model's machine."""
        return self.test.chain if isinstance(self.test, Measurement) else self.test.measurement.model.chain

    def made_of(self, **options: object) -> Provenance:
        """All that determines an answer to a question about it.

        Args:
            options: of the question.
        """
        return Provenance.of({**self.files, **self.chain.files}, **options)

    def considered(self, *, strict: bool = False) -> list[Finding]:
        """What is implausible about the readings, the sheet and the model.

        Args:
            strict: whether what is doubtful is refused, too.

        Raises:
            ImplausibleError: something cannot be meant; one line.
            NoConvergenceError: the model has no equilibrium in a posture.
        """
        match self.test:
            case FrequencyMeasurement():
                return frequencies_considered(self.test, strict=strict)
            case Measurement():
                return considered(self.test, strict=strict)
            case PreparedTest():
                return self.test.considered(strict)
            case _:
                assert_never(self.test)

    def rows(self) -> list[dict[str, Any]]:
        """One row a reading: numbers where a column has numbers alone, None for what was not read."""
        columns = [_numbers(cells) for cells in self.columns.values()]
        return [dict(zip(self.columns, row, strict=True)) for row in zip(*columns, strict=True)]

    def to_frame(self) -> DataFrame:
        """`rows` as a pandas DataFrame.

        Raises:
            ImportError: pandas is not installed.
        """
        from vjm.notebook import frame_of

        return frame_of(self.rows())

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __repr__(self) -> str:
        return f"<DataSet {self.kind} of {self.chain.name}: {len(self)} readings of {', '.join(self.columns)}>"

    def _repr_html_(self) -> str:
        from vjm.notebook import table_html

        return f"<pre>{escape(repr(self))}</pre>{table_html(self.rows()[:SHOWN])}"


def load_data(readings: TableSource, sheet: SheetSource) -> DataSet:
    """Measured data with their sheet, read and checked.

    The sheet's ``kind`` says what was done; one without it is of ramps of displacements or loads, or of a column.

    Args:
        readings: a CSV file, or columns by name as in such a file: a mapping of sequences, or a pandas DataFrame.
            See docs/measured-data.md, docs/poses.md, docs/deflections.md, docs/joint-tests.md and
            docs/calibration.md.
        sheet: a TOML file, or its content as a mapping. A model that it names is looked for beside the file, then
            in the library.

    Raises:
        ValueError: readings, sheet or model cannot be used; one line that names what, where and the remedy.

    Example:
        >>> from importlib.resources import files
        >>> folder = files("vjm_validation") / "examples/soft-springs"
        >>> load_data(folder / "readings.csv", folder / "sheet.toml").kind
        'ramps'
    """
    table, text = source_of_readings(readings), source_of_sheet(sheet)
    # the sheet first: readings in its place are said to be that
    kind = kind_of_sheet(text)
    columns = dict(table_of(table).cells)
    files = {f"data {table.name}": table.sha256, f"sheet {text.name}": text.sha256}
    if kind in KINDS:
        return DataSet(read_test(table, text), columns, files)
    if kind == FREQUENCIES:
        return DataSet(read_frequencies(table, text), columns, files)
    return DataSet(read_measurement(table, text), columns, files)


def together(series: DataSet | Sequence[DataSet]) -> DataSet:
    """Several series of one machine as one data set; one series as it is.

    Args:
        series: of poses or of deflections where there are several.

    Raises:
        ValueError: there is none, they are of another kind, or of different machines; one line.
    """
    if isinstance(series, DataSet):
        return series
    if not series:
        raise ValueError("no series: give at least one")
    if len(series) == 1:
        return series[0]
    tests = [one.test for one in series if isinstance(one.test, PreparedTest)]
    if len(tests) < len(series):
        other = next(one for one in series if not isinstance(one.test, PreparedTest))
        raise ValueError(
            f"{other.sheet}: several series in one fit are for poses or deflections: give one data file"
        )
    names = dict.fromkeys(name for one in series for name in one.columns)
    columns = {name: [cell for one in series for cell in one.columns.get(name, [""] * len(one))] for name in names}
    files: dict[str, str] = {}
    for i, one in enumerate(series, start=1):
        files |= {
            (name if files.get(name, own) == own else f"{name} ({i})"): own for name, own in one.files.items()
        }
    return DataSet(joined_tests(tests), columns, files)


def _numbers(cells: Sequence[str]) -> Sequence[float | str | None]:
    try:
        return [float(cell) if cell else None for cell in cells]
    except ValueError:
        return [cell or None for cell in cells]
