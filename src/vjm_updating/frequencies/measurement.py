"""A test of frequencies from its two files, checked."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from vjm.io.errors import did_you_mean
from vjm.io.fields import Table, VectorMM
from vjm.io.schema import Label
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset
from vjm.rotations import Array
from vjm_updating.constants import physical_bound
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.data_file import POSTURE, DataTable, SheetError, SheetSource, TableSource, table_of
from vjm_updating.experiment.measured import Kind, Nuisance, nuisances
from vjm_updating.experiment.measurement import engine_of_sheet, machine_of_sheet
from vjm_updating.experiment.readings import Readings, check_labels
from vjm_updating.experiment.sheet import Sheet, read_sheet_of

# --- The sheet of a test of ``kind = "frequencies"``: the machine, its postures, how well frequencies are read

MOST_MISSING = physical_bound(4)
"""Modes that may not have been seen: beyond it the pairing says more than the readings."""


class FrequencyTable(Table):
    """How frequencies were read; a standard deviation has a fixed part and one in proportion."""

    noise_Hz: Annotated[float, Field(gt=0.0, le=1e3)] = Field(  # noqa: N815
        description="1 sigma of a frequency whose column fK_std_Hz is blank or absent"
    )
    noise_rel: Annotated[float, Field(ge=0.0, le=0.1)] = Field(0.0, description="1 sigma more, of its value")
    missing: int = Field(
        0, ge=0, le=MOST_MISSING,
        description="modes below the highest one read that may not have been seen in a posture; "
        "0: column fK_Hz is mode K",
    )  # fmt: skip
    source: str = ""


class CarriedTable(Table):
    """A point mass that the machine carries in the test and the model does not have, such as the sensor."""

    on: Label | Literal[""] = Field("", description="part behind which it is; empty: the last one")
    position_mm: VectorMM = Field([0.0, 0.0, 0.0], description="in the frame behind that part")
    mass_kg: float = Field(0.0, ge=0.0, le=1e5, description="where the column payload_kg is absent")
    source: str = ""


class FrequencySheet(Sheet):
    """The sheet."""

    kind: Literal["frequencies"]
    frequencies: FrequencyTable
    payload: CarriedTable = CarriedTable()

    @model_validator(mode="after")
    def _without_loads(self) -> FrequencySheet:
        if self.test.control != "displacement" or self.test.held:
            raise ValueError("[test] control and held are for tests by loads: leave them out, the end is free")
        for name in ("instrument", "points", "lever"):
            if name in self.model_fields_set:
                raise ValueError(f"[{name}] is for tests by loads: leave it out, [frequencies] has the noise")
        return self


READING, PAYLOAD = "reading", "payload_kg"
FREQUENCY, DEVIATION = re.compile(r"f([1-9]\d?)_Hz"), re.compile(r"f([1-9]\d?)_std_Hz")
COORDINATE = re.compile(r"(.+)\.q_(?:rad|mm)")
CARRIED = "payload of the test"
"""Name of the part that is the payload."""


class Unit(NamedTuple):
    """Another unit of frequencies.

    Attributes:
        name: for people.
        ending: of a column in it.
        in_hz: what 1 Hz is in it.
        remedy: how numbers become Hz.
    """

    name: str
    ending: str
    in_hz: float
    remedy: str


UNITS = (
    Unit("rad/s", "rad_per_s", 2.0 * np.pi, "divide by 2π"),
    Unit("rpm", "rpm", 60.0, "divide by 60"),
    Unit("kHz", "kHz", 1e-3, "multiply by 1000"),
)


@dataclass(frozen=True)
class FrequencyMeasurement(Measurement):
    """A test of frequencies, one row a posture.

    Attributes:
        sheet: the sheet.
        frequency: ``(n, k)`` Hz, none below that before it in its row; nan where none was read.
        sigma: ``(n, k)`` Hz, 1 sigma.
        payload: ``(n,)`` kg.
    """

    sheet: FrequencySheet
    frequency: Array
    sigma: Array
    payload: Array

    @property
    def columns(self) -> tuple[str, ...]:
        """Of the frequencies."""
        return tuple(f"f{k + 1}_Hz" for k in range(self.frequency.shape[1]))

    def carrying(self, chain: Machine, mass: float) -> Machine:
        """A machine with the payload of the test, of a mass in kg."""
        if not mass:
            return chain
        table, last = self.sheet.payload, chain.parts[-1].name
        load = RigidOffset(CARRIED, mass=mass, centre=np.array(table.position_mm, dtype=float))
        on = table.on or last
        return replace(
            chain, parts=(*chain.parts, load), after={**chain.after, **({} if on == last else {CARRIED: on})}
        )


def read_frequencies(data: TableSource, sheet: SheetSource) -> FrequencyMeasurement:
    """A measurement from its two files, or from columns and a sheet's content.

    Raises:
        ValueError: one of them or the model cannot be used; one line that says what, where and the remedy.
    """
    page, table = read_sheet_of(sheet, FrequencySheet), table_of(data)
    rows = table.row
    with table.named():
        for column in table.cells:
            _check_column(column)
        by_name = {column: table.numbers(column) for column in table.cells if column not in (POSTURE, READING)}
        frequency, sigma = _frequencies(by_name, rows, page)
        labels, made = _postures(table, by_name)
        payload = by_name.get(PAYLOAD, np.full(len(rows), page.payload.mass_kg))
        wrong = ~(payload >= 0.0)
        if wrong.any():
            raise ValueError(f"row {rows[int(np.argmax(wrong))]}, column {PAYLOAD}: give kg, or 0 for none")
    page = page.model_copy(update={"postures": page.postures | made})
    document, chain = machine_of_sheet(page)
    with table.named():
        check_labels(labels, rows, chain.postures)
    names = [part.name for part in chain.parts]
    if page.payload.on and page.payload.on not in names:
        raise SheetError(f"{page.file}: [payload] on: no part '{page.payload.on}'; there are {', '.join(names)}")
    masses = [
        Nuisance(Kind.MASS, part.name, page.tolerance.mass_rel)
        for part in chain.parts
        if page.tolerance.mass_rel and getattr(part, "mass", 0.0)
    ]
    values = {f"f{k + 1}_Hz": column for k, column in enumerate(frequency.T)}
    readings = Readings(table.name, rows, np.array(labels), np.ones(len(rows), dtype=int), values)
    return FrequencyMeasurement(
        page, readings, document, chain, engine_of_sheet(page, chain),
        (*nuisances(page, (), chain), *masses), table.sha256, frequency, sigma, payload,
    )  # fmt: skip


def _check_column(column: str) -> None:
    known = (POSTURE, READING, PAYLOAD)
    if column in known or any(one.fullmatch(column) for one in (FREQUENCY, DEVIATION, COORDINATE)):
        return
    for unit in UNITS:
        if column.endswith(unit.ending):
            raise ValueError(f"column '{column}': a frequency is in Hz: {unit.remedy} and name it f1_Hz")
    raise ValueError(
        f"column '{column}' is not known: a frequency's is f1_Hz, its deviation's f1_std_Hz, a joint's JOINT.q_rad "
        f"or JOINT.q_mm: rename or delete it{did_you_mean(column, [*known, 'f1_Hz', 'f1_std_Hz'])}"
    )


def _frequencies(by_name: dict[str, Array], rows: np.ndarray, page: FrequencySheet) -> tuple[Array, Array]:
    """Frequencies and their deviations ``(n, k)``.

    Raises:
        ValueError: a column is missing, or a row has no frequency or one below that before it.
    """
    known = sorted(int(match[1]) for name in by_name if (match := FREQUENCY.fullmatch(name)))
    if not known:
        raise ValueError("column 'f1_Hz' is missing: add the frequencies in Hz, f1_Hz, f2_Hz and so on")
    nothing = np.full(len(rows), np.nan)
    frequency = np.column_stack([by_name.get(f"f{k}_Hz", nothing) for k in range(1, known[-1] + 1)])
    given = np.column_stack([by_name.get(f"f{k}_std_Hz", nothing) for k in range(1, known[-1] + 1)])
    for i, row in enumerate(rows):
        read = frequency[i][np.isfinite(frequency[i])]
        if not len(read):
            raise ValueError(f"row {row} has no frequency: delete it")
        if not np.all(read > 0.0) or not np.all(np.diff(read) >= 0.0):
            raise ValueError(
                f"row {row}: frequencies {', '.join(f'{f:g}' for f in read)} are to be above zero and ascending: "
                "sort them"
            )
        if np.any(given[i] <= 0.0):
            raise ValueError(f"row {row}: a standard deviation is above zero; leave it blank for the sheet's")
    table = page.frequencies
    return frequency, np.where(np.isfinite(given), given, np.hypot(table.noise_Hz, table.noise_rel * frequency))


def _postures(table: DataTable, by_name: dict[str, Array]) -> tuple[Sequence[str], dict[str, dict[str, float]]]:
    """The label of each row, and the postures that rows give by their joints' coordinates.

    Raises:
        ValueError: rows give no posture, or two.
    """
    joints = {match[1]: name for name in by_name if (match := COORDINATE.fullmatch(name))}
    if POSTURE in table.cells:
        if joints:
            raise ValueError(f"column '{POSTURE}' stands beside coordinates of joints: leave one of both")
        return table.cells[POSTURE], {}
    if not joints:
        raise ValueError(f"column '{POSTURE}' is missing: add it, or the coordinates of the joints, JOINT.q_rad")
    labels = [f"row-{number}" for number in table.row]
    made = {
        label: {joint: float(by_name[name][i]) for joint, name in joints.items()} for i, label in enumerate(labels)
    }
    for label, values in made.items():
        blank = [name for name, value in values.items() if not np.isfinite(value)]
        if blank:
            raise ValueError(f"{label}: joint {blank[0]} is blank: fill it or delete the row")
    return labels, made
