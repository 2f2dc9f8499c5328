"""Measured data of any kind of test, as an object.

A test of loads or of deflections that sees one joint only is also the test of that joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any, assert_never

import numpy as np

from vjm.io.fields import rotation
from vjm.io.findings import Finding, Grade
from vjm.io.provenance import Provenance
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset
from vjm.rotations import Array, rotation_from_vector, translation, turn
from vjm_updating.constants import numerical, shown
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.experiment import Measurement, Readings, read_measurement
from vjm_updating.experiment.data_file import (
    EFFORT,
    MOTION,
    POSE,
    TEMPERATURE,
    TIME,
    WRENCH,
    SheetSource,
    TableSource,
    source_of_readings,
    source_of_sheet,
    split_point,
    table_of,
)
from vjm_updating.experiment.measured import nuisances
from vjm_updating.experiment.measurement import check_joint, check_units, engine_of_sheet
from vjm_updating.experiment.plausibility import considered
from vjm_updating.experiment.sheet import Instrument, LeverTable, Sheet, Test, kind_of_sheet
from vjm_updating.frequencies.measurement import FrequencyMeasurement, read_frequencies
from vjm_updating.frequencies.plausibility import considered as frequencies_considered
from vjm_updating.poses.deflections import DeflectionData, DeflectionSheet
from vjm_updating.poses.kinds import KINDS, PreparedTest, read_test
from vjm_updating.poses.kinds import together as joined_tests

if TYPE_CHECKING:
    from vjm.outcome import DataFrame


KNOWN_LOAD = numerical(1e-3)
"""Noise of a load that is known, over what the gauge's noise makes of one: a millionth of the variance."""
SMALL = numerical(1e-9)
"""Of a unit vector, or of the longest part: rounding."""


@dataclass(frozen=True)
class _OnlyJoint:
    """A machine whose only joint yields, in a posture.

    Attributes:
        axis: unit vector ``(3,)`` in the world.
        origin: a point of the axis ``(3,)``, mm.
        behind: frame ``(4, 4)`` behind each part that the joint carries, by its name, mm.
    """

    joint: Joint
    axis: Array
    origin: Array
    behind: dict[str, Array]
    last: str

    def motion(self, point: Array, angle: float = 0.0) -> Array:
        """What a unit of the joint's motion does to a point ``(3,)``, ``(6,)``, an angle from where it stands."""
        if self.joint.slides:
            return np.concatenate([self.axis, np.zeros(3)])
        arm = rotation_from_vector(self.axis * angle) @ (point - self.origin)
        return np.concatenate([np.cross(self.axis, arm), self.axis])


@dataclass(frozen=True)
class _Channel:
    """A column of loads, or of a gauge.

    Attributes:
        values: ``(n,)``.
        point: where ``(3,)``, mm.
        direction: ``(6,)`` of a unit of the column, world axes.
    """

    column: str
    values: Array
    point: Array
    direction: Array
    instrument: Instrument

    def arm(self, bench: _OnlyJoint, angle: float = 0.0) -> float:
        """What a unit of the joint's motion moves it by; a unit of a load bears as much on the joint."""
        return float(self.direction @ bench.motion(self.point, angle))

    @property
    def straight(self) -> bool:
        """Whether it is a force or a shift."""
        return bool(self.direction[:3].any())


def as_joint_test(test: Measurement | PreparedTest) -> Measurement | None:
    """The same test as one of its only joint; None where it sees more than that, or is one already.

    Rows of a test of deflections have to stand in the order in which they were taken.

    Raises:
        ValueError: the readings cannot be those of that joint, such as in another unit; one line.
    """
    match test:
        case Measurement():
            return _of_loads(test) if test.loaded and not test.sheet.kind else None
        case PreparedTest():
            return _of_deflections(test)
        case _:
            assert_never(test)


def _of_loads(test: Measurement) -> Measurement | None:
    readings, sheet = test.readings, test.sheet
    labels = np.unique(readings.posture)
    if len(labels) > 1 or sheet.test.held:
        return None
    bench = _bench(test.chain.at(str(labels[0])), sheet.test.gravity)
    if bench is None:
        return None
    loads, gauges = list[_Channel](), list[_Channel]()
    for name in readings.channels:
        label, channel = split_point(name)
        where = sheet.points.get(label)
        frame = bench.behind.get(where.body if where else bench.last)
        if frame is None or (where is not None and where.at != 1.0):
            return None
        channels, names = (loads, WRENCH) if channel in WRENCH else (gauges, POSE)
        own = _Channel(
            name, readings.values[name], frame[:3, 3], np.eye(6)[names.index(channel)], sheet.errors(name)
        )
        if np.nan_to_num(own.values).any():
            channels.append(own)
    return _joint_test(test, bench, loads, gauges)


def _of_deflections(test: PreparedTest) -> Measurement | None:
    sheet, data, model = test.measurement.sheet, test.measurement.data, test.measurement.model
    if not (isinstance(sheet, DeflectionSheet) and isinstance(data, DeflectionData)) or len(test.study.groups) > 1:
        return None
    if len(data.joints) != 1 or np.ptp(data.q) > 0.0 or sheet.test.rigid:
        return None
    bench = _bench(model.chain, sheet.test.gravity, float(data.q[0, 0]))
    if bench is None or not sheet.ordered or sheet.tracker.axes != "base" or np.isfinite(data.orientation).any():
        return None
    ends = {name: bench.behind.get(end.on or bench.last) for name, end in (sheet.loads | sheet.markers).items()}
    loads, gauges = list[_Channel](), list[_Channel]()
    for j, (name, table) in enumerate(sheet.loads.items()):
        if (frame := ends[name]) is None:
            return None
        axes = frame[:3, :3] @ rotation(table.turns) if table.axes == "tool" else np.eye(3)
        point = (frame @ translation(table.position_mm))[:3, 3]
        for k in np.flatnonzero(data.load[:, j].any(axis=0)).tolist():
            along = (np.eye(6)[k].reshape(2, 3) @ axes.T).ravel()
            loads.append(_Channel(f"{name}.{WRENCH[k]}", data.load[:, j, k], point, along, Instrument(noise=0.0)))
    for i, (name, marker) in enumerate(sheet.markers.items()):
        if (frame := ends[name]) is None:
            return None
        point = (frame @ translation(marker.position_mm))[:3, 3]
        for k in np.flatnonzero(np.isfinite(data.position[:, i]).any(axis=0)).tolist():
            read, sigma = data.position[:, i, k], data.sigma[:, i, k]
            if np.ptp(sigma) > 0.0:
                return None
            own = _Channel(
                f"{name}.d{COMPONENTS[k]}_mm", read, point, np.eye(6)[k], Instrument(noise=float(sigma[0]))
            )
            # the marker's place is known so well, and with it the lever
            off = 0.0 if bench.joint.slides else marker.sigma_mm / max(abs(own.arm(bench)), marker.sigma_mm)
            if off * np.linalg.norm(np.nan_to_num(read)) > own.instrument.noise:
                own = replace(own, instrument=own.instrument.model_copy(update={"scale": off}))
            gauges.append(own)
    test_of = Test(title=sheet.test.title, model=sheet.test.model, source=sheet.test.source)
    bare = Sheet(test=test_of, file=sheet.file, folder=sheet.folder)
    n = len(data)
    rows = Readings(data.file, data.row, np.full(n, bench.joint.name), np.ones(n, dtype=int), {})
    engine = engine_of_sheet(bare, model.chain)
    return _joint_test(
        Measurement(bare, rows, model.document, model.chain, engine, (), data.sha256), bench, loads, gauges
    )


def _joint_test(
    test: Measurement, bench: _OnlyJoint, loads: Sequence[_Channel], gauges: Sequence[_Channel]
) -> Measurement | None:
    """The test of the joint by one load and one gauge; None where there are others, or levers that change."""
    if len(loads) != 1 or len(gauges) != 1:
        return None
    (load,), (gauge,), joint, sheet = loads, gauges, bench.joint, test.sheet
    arms = [one.arm(bench) for one in (load, gauge)]
    least = 1.0 - SMALL if joint.slides else SMALL * test.chain.characteristic_length
    if min(map(abs, arms)) < least:
        return None
    # levers are those of the unloaded posture: what the turn changes of them has to lie below the noise
    largest = float(np.nanmax(np.abs(gauge.values)))
    angle = largest / abs(arms[1])
    if any(
        abs(one.arm(bench, end) / arm - 1.0) * largest > gauge.instrument.noise
        for one, arm in zip((load, gauge), arms, strict=True)
        for end in (angle, -angle)
    ):
        return None
    effort, motion = (names[joint.slides or one.straight] for names, one in ((EFFORT, load), (MOTION, gauge)))
    cell = load.instrument
    if cell.noise == 0.0:
        alike = gauge.instrument.noise / (joint.compliances[0] * abs(arms[0] * arms[1]))
        cell = cell.model_copy(update={"noise": KNOWN_LOAD * alike})
    thermometer = {name: own for name, own in sheet.instrument.items() if name == TEMPERATURE}
    force_mm, gauge_mm = (
        abs(arm) if one.straight and not joint.slides else None
        for one, arm in zip((load, gauge), arms, strict=True)
    )
    own = Sheet(
        kind="joint",
        test=Test(title=sheet.test.title, model=sheet.test.model, joint=joint.name, source=sheet.test.source),
        model=sheet.model, postures=sheet.postures,
        instrument={motion: gauge.instrument, effort: cell} | thermometer,
        lever=LeverTable(force_mm=force_mm, gauge_mm=gauge_mm), file=sheet.file, folder=sheet.folder,
    )  # fmt: skip
    times = {name: column for name, column in test.readings.values.items() if name in (TIME, TEMPERATURE)}
    read = {motion: np.sign(arms[1]) * gauge.values, effort: np.sign(arms[0]) * load.values}
    readings = replace(test.readings, values=times | read)
    names = f"{effort} is {load.column}, {motion} is {gauge.column}"
    said = f"only {joint.name} yields, and one load and one gauge see it: read as a test of that joint ({names})"
    measurement = replace(
        test, sheet=own, readings=readings, nuisances=nuisances(own, readings.channels, test.chain),
        notes=(Finding(Grade.NOTED, sheet.file, said),),
    )  # fmt: skip
    try:
        check_joint(measurement)
        check_units(measurement)
    except ValueError as error:
        # in the file's own names
        raise type(error)(str(error).replace(effort, load.column).replace(motion, gauge.column)) from error
    return measurement


def _bench(machine: Machine, gravity: Sequence[float] | None, coordinate: float | None = None) -> _OnlyJoint | None:
    """A machine of one joint that yields about, or along, its axis; None of others, and where weight loads it.

    Without a ``coordinate`` of the joint, mm or rad, the machine is in a posture. The direction of ``gravity`` has
    any length; None where weight has acted before.
    """
    joints = [part for part in machine.parts if isinstance(part, Joint)]
    if len(joints) != 1 or machine.beams or machine.is_tree or machine.couplings:
        return None
    (joint,) = joints
    told = joint.sprung and (joint.law is None or joint.law.rises)
    if not joint.held or joint.fixed or not told or any(joint.lateral) or joint.preload:
        return None
    q = (joint.value or 0.0) if coordinate is None else coordinate
    T, joint_frame, weights = machine.base, machine.base, list[tuple[float, Array]]()
    behind: dict[str, Array] = {}
    for part in machine.parts:
        match part:
            case RigidOffset():
                centre = (T @ translation(part.centre_of_mass))[:3, 3]
                weights += [(part.mass, centre)] if behind else []
                T = T @ part.transform
            case Joint():
                joint_frame = T
                T = T @ (translation(part.axis * q) if part.slides else turn(part.axis, q))
            case Beam():
                return None
            case _:
                assert_never(part)
        if behind or part is joint:
            behind[part.name] = T
    bench = _OnlyJoint(joint, joint_frame[:3, :3] @ joint.axis, joint_frame[:3, 3], behind, machine.parts[-1].name)
    pull = np.zeros(3) if gravity is None else np.array(gravity, dtype=float)
    weighs = any(mass * abs(bench.motion(centre)[:3] @ pull) > SMALL for mass, centre in weights)
    return None if weighs or bench.last not in behind else bench


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
        from vjm.outcome import frame_of

        return frame_of(self.rows())

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __repr__(self) -> str:
        return f"<DataSet {self.kind} of {self.chain.name}: {len(self)} readings of {', '.join(self.columns)}>"

    def _repr_html_(self) -> str:
        from vjm.outcome import table_html

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

    Where there are several, they are of poses or of deflections.

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
