"""A test of a robot in many postures from its two files, checked.

The sheet with what all kinds have, the readings, and the model that the sheet names.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from vjm.io.errors import did_you_mean
from vjm.io.fields import Table, Turns, VectorMM
from vjm.io.model_file import build_chain
from vjm.io.provenance import digest
from vjm.io.robot_file import Description, import_robot
from vjm.io.schema import Label
from vjm.io.stiffness_file import beside
from vjm.model.machine import Machine
from vjm.model.parts import Joint
from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import physical_bound
from vjm_updating.experiment.data_file import (
    WRENCH,
    DataTable,
    SheetError,
    beyond_turn,
    converted,
    table_of,
)
from vjm_updating.experiment.measurement import model_document
from vjm_updating.experiment.readings import check_labels
from vjm_updating.experiment.sheet import AnySheet
from vjm_updating.poses.machine import PoseMachine

Sigma = Annotated[float, Field(gt=0.0, le=1e6)]
Three = Annotated[list[float], Field(min_length=3, max_length=3)]


class RobotTest(Table):
    """What was measured, on which model."""

    title: str = ""
    model: str = Field(min_length=1, description="a model of the library, a model file, or a URDF")
    tip: str | None = Field(None, description="of a URDF: the last link")
    rigid: bool = Field(False, description="whether the compliances of the model's joints are set aside")
    gravity: Three = Field([0.0, 0.0, -9.81], description="m/s², in the axes of the robot's base")
    order: Literal["as taken", "unknown"] = Field("unknown", description="in which the rows stand")
    source: str = ""


class PoseTest(RobotTest):
    """What was measured, and how."""

    joints: Literal["commanded", "measured"] = Field(
        "commanded",
        description="what the columns of the joints are: what the controller was told, or what was read",
    )
    encoders: Literal["motor", "output"] | None = Field(
        None, description="of measured joints: behind the motor (the usual), or behind the gear"
    )


class Rider(Table):
    """A point that rides behind a part."""

    on: Label | Literal[""] = Field("", description="part behind which it rides; empty: the last one")
    position_mm: VectorMM = Field([0.0, 0.0, 0.0], description="in the frame behind that part")
    source: str = ""


class MarkerTable(Rider):
    """A marker that the tracker sees; its place is a first guess."""

    sigma_mm: Sigma = Field(300.0, description="how well the guess is known")


class PoseMarker(MarkerTable):
    """A marker, a reflector or a frame that the tracker sees, or an inclinometer."""

    orientation: Literal["none", "quaternion", "fixed xyz", "moving xyz", "rotation vector", "tilt"] = Field(
        "none", description="how the columns of its orientation are to be read"
    )


class TrackerTable(Table):
    """What sees the markers. Its frame is found with the rest: only its errors need be known."""

    noise_mm: Sigma = Field(description="1 sigma of a coordinate of a position, where the reading has none")
    noise_rad: Sigma = Field(1e-3, description="1 sigma about an axis of an orientation, or of a tilt")
    source: str = ""


class BaseGuess(Table):
    """First guess of the base in the tracker's frame, where fewer than three postures tell."""

    position_mm: VectorMM = Field([0.0, 0.0, 0.0])
    turns: Turns = Field([])
    sigma_mm: Sigma = 1e5
    sigma_rad: Sigma = 10.0


class RobotSheet(AnySheet):
    """What the sheets of all kinds of test have."""

    test: RobotTest
    markers: Mapping[Label, MarkerTable]
    joints: dict[str, str] = Field({}, description="names of columns, where they differ: the model's joints")

    @model_validator(mode="after")
    def _gravity(self) -> Self:
        size = sum(v * v for v in self.test.gravity) ** 0.5
        if size > 100.0:
            raise ValueError(f"[test] gravity has {size:.4g} m/s²: write it in m/s²")
        return self

    @property
    def at_output(self) -> bool:
        """Whether the joints were measured behind what bends about their own axes."""
        return False

    @property
    def ordered(self) -> bool:
        """Whether the rows stand in the order in which they were taken."""
        return self.test.order == "as taken"

    @property
    def meaning(self) -> str:
        """What the joints' columns are, for people."""
        return "commanded"

    @property
    def bends(self) -> str:
        """What lies between the joints' columns and the links, and so bends about the joints' axes."""
        return "gears, drives, and what the controllers leave of their error under load"


class PoseSheet(RobotSheet):
    """The sheet of a test of poses."""

    kind: Literal["poses"]
    test: PoseTest
    markers: dict[Label, PoseMarker] = Field(min_length=1)
    tracker: TrackerTable
    base: BaseGuess | None = None

    @property
    def at_output(self) -> bool:
        """Whether the joints were measured behind what bends about their own axes."""
        return self.test.encoders == "output"

    @property
    def meaning(self) -> str:
        """What the joints' columns are, for people."""
        if self.test.joints == "commanded":
            return "commanded"
        return "measured at the output" if self.at_output else "measured at the motor"

    @property
    def bends(self) -> str:
        """What lies between the joints' columns and the links, and so bends about the joints' axes."""
        if self.test.joints == "commanded":
            return super().bends
        return "gears, and all else between the encoders at the motors and the links"

    @model_validator(mode="after")
    def _encoders(self) -> PoseSheet:
        if self.test.encoders is not None and self.test.joints == "commanded":
            raise ValueError("[test] encoders is for joints = 'measured': write that, or leave encoders away")
        return self

    @model_validator(mode="after")
    def _tilts(self) -> PoseSheet:
        tilted = next((name for name, table in self.markers.items() if table.orientation == "tilt"), None)
        if not any(self.test.gravity) and tilted is not None:
            raise ValueError(f"[markers.{tilted}] orientation = 'tilt' is against gravity, and [test] has none")
        return self


# --- Columns of the readings of a robot: by their names, and refused where they are of nothing that is known ------


class Owners(NamedTuple):
    """Tables of a sheet whose names columns have: what each is, their names, what stands behind these."""

    what: str
    names: tuple[str, ...]
    keys: tuple[str, ...]


def columns_of(by_name: Mapping[str, Array], names: tuple[str, ...], keys: tuple[str, ...], absent: Array) -> Array:
    """Columns of several tables ``(g, names, keys)``; one that the file has not is ``absent`` (g,)."""
    return np.stack(
        [np.column_stack([by_name.get(f"{name}.{key}", absent) for key in keys]) for name in names], axis=1
    )


def numbers_by_name(table: DataTable, sheet: RobotSheet, skip: Callable[[str], bool]) -> dict[str, Array]:
    """Columns ``(g,)`` by their names, those of joints by the model's names.

    ``skip`` says whether a column with a key, what stands behind the name's point or the whole, is left out.

    Raises:
        ValueError: a cell is no number.
    """
    result = {}
    for column in table.cells:
        name, dot, key = column.partition(".")
        if not skip(key if dot else column):
            result[f"{sheet.joints.get(name, name)}.{key}" if dot else column] = table.numbers(column)
    return result


def check_columns(
    header: Sequence[str], sheet: RobotSheet, machine: PoseMachine, keys: Collection[str], owners: Sequence[Owners],
    whole: Sequence[str],
) -> None:  # fmt: skip
    """Refuse columns that are of nothing that the sheet or the model has.

    A column is of a joint, with one of the keys behind its name, of an owner, or is named as a whole.

    Raises:
        ValueError: one is; one line.
    """
    followers = [f"{one.name}.{'q_mm' if one.slides else 'q_rad'}" for one in machine.followers]
    known = [*machine.joints, *sheet.joints, *(name for one in owners for name in one.names)]
    every = [*keys, *(key for one in owners for key in one.keys)]
    for column in header:
        name, _, key = column.partition(".")
        joint = sheet.joints.get(name, name)
        if (
            column in whole
            or column in followers
            or (joint in machine.joints and key in keys)
            or any(name in one.names and key in one.keys for one in owners)
        ):
            continue
        if key in keys:
            raise ValueError(
                f"column '{column}': the model has no joint '{joint}' that is driven; it has "
                f"{', '.join(machine.joints)}: name it in [joints] or delete it{did_you_mean(joint, known)}"
            )
        for one in owners:
            if key in one.keys:
                raise ValueError(
                    f"column '{column}': no {one.what} '{name}': add [{one.what}s.{name}] or delete it"
                    f"{did_you_mean(name, one.names)}"
                )
        for right in every:
            (quantity, _, unit), (given, _, other) = right.rpartition("_"), key.rpartition("_")
            if name in known and given == quantity:
                how = converted(other, unit)
                raise ValueError(f"column '{column}' must be in {unit}: {how} and name it {name}.{right}")
        raise ValueError(
            f"column '{column}' is not known: a joint's is JOINT.{next(iter(keys))}, "
            + "".join(f"a {one.what}'s {one.what.upper()}.{one.keys[0]}, " for one in owners)[:-2]
            + f": rename or delete it{did_you_mean(key or column, [*whole, *every])}"
        )


def check_noise(by_name: Mapping[str, Array], keys: Collection[str], rows: np.ndarray) -> None:
    """Refuse standard deviations below zero.

    Raises:
        ValueError: one is; one line.
    """
    for column, values in by_name.items():
        if column.partition(".")[2] in keys and (values < 0.0).any():
            row = rows[int(np.argmax(values < 0.0))]
            raise ValueError(
                f"row {row}, column {column}: a standard deviation is not negative; leave it blank for the sheet's"
            )


POSITION, NOISE = ("x_mm", "y_mm", "z_mm"), ("x_std_mm", "y_std_mm", "z_std_mm")
ANGLES, ANGLES_DEG = ("rx_rad", "ry_rad", "rz_rad"), ("rx_deg", "ry_deg", "rz_deg")
QUATERNION = ("qw", "qx", "qy", "qz")
TILT, TILT_DEG = ("tilt_x_rad", "tilt_y_rad"), ("tilt_x_deg", "tilt_y_deg")
"""By how much the instrument's own axis x or y points above the horizontal plane."""
COORDINATE = {"q_rad": False, "q_mm": True}
TORQUE = ("tau_Nmm", "tau_N")
FOLLOWS_RAD, FOLLOWS_MM = physical_bound(0.02, "rad"), physical_bound(1.0, "mm")
"""By how much a coupled joint's own column may be off what its masters make: what logs round, and backlash."""
READING, POSTURE, TIME, TEMPERATURE = "reading", "posture", "time_s", "temperature_C"
OF_MARKERS = (*POSITION, *NOISE, *ANGLES, *ANGLES_DEG, *QUATERNION, *TILT, *TILT_DEG, *WRENCH)


@dataclass(frozen=True)
class PoseData:
    """g postures of a robot with k markers.

    Attributes:
        file: name for messages.
        sha256: of the file.
        row: ``(g,)`` line of the file, the first being line 1.
        joints: names of the n joints, the model's.
        q: ``(g, n)`` their coordinates, mm and rad.
        markers: names of the k markers.
        position: ``(g, k, 3)`` mm in the tracker's frame, nan where a coordinate of a marker was not seen.
        orientation: ``(g, k, 3, 3)`` in the tracker's frame, nan where it was not tracked.
        tilt: ``(g, k, 2)`` rad, nan where it was not read.
        sigma: ``(g, k, 3)`` mm, 1 sigma of the positions.
        wrench: ``(g, k, 6)`` applied at the markers, the base's axes, N and N mm.
        torque: ``(g, n)`` measured, nan where not.
        time: ``(g,)`` s, or None.
        temperature: ``(g,)`` °C, or None.
        left_out: rows without a joint's coordinate or without any marker.
    """

    file: str
    sha256: str
    row: np.ndarray
    joints: tuple[str, ...]
    q: Array
    markers: tuple[str, ...]
    position: Array
    orientation: Array
    tilt: Array
    sigma: Array
    wrench: Array
    torque: Array
    time: Array | None
    temperature: Array | None
    left_out: int

    def __len__(self) -> int:
        return len(self.row)

    @property
    def loaded(self) -> tuple[str, ...]:
        """Markers, where wrenches on them were measured; else none."""
        return self.markers if self.wrench.any() else ()

    def only(self, keep: np.ndarray) -> Self:
        """The postures of a mask or of indices."""
        rows = {
            name: getattr(self, name)[keep]
            for name in ("row", "q", "position", "orientation", "tilt", "sigma", "wrench", "torque")
        }
        time = None if self.time is None else self.time[keep]
        temperature = None if self.temperature is None else self.temperature[keep]
        return replace(self, **rows, time=time, temperature=temperature)

    def blanked(self, readings: np.ndarray) -> Self:
        """Without the positions of a mask ``(g, k)``; postures of which nothing is left are left out."""
        position = np.where(readings[:, :, None], np.nan, self.position)
        read = np.asarray(np.isfinite(position).any(axis=(1, 2)) | np.isfinite(self.tilt).any(axis=(1, 2)))
        return replace(self, position=position).only(read)


def read_candidates(
    path: Path, sheet: RobotSheet, machine: PoseMachine, points: tuple[str, ...]
) -> tuple[Array, Array | None]:
    """Postures ``(c, n)`` of a CSV file, and wrenches ``(c, l, 6)`` at l points; None where the file has none.

    Raises:
        DataError: it cannot be used; one line.
    """
    table = table_of(path)
    with table.named():
        by_name = numbers_by_name(table, sheet, skip=lambda key: key not in (*COORDINATE, *WRENCH))
        q, load = postures(table, by_name, machine), wrenches(by_name, points, len(table.row))
        blank = ~(np.isfinite(q).all(axis=1) & np.isfinite(load).all(axis=(1, 2)))
        if blank.any():
            raise ValueError(f"row {table.row[int(np.argmax(blank))]} has a blank: fill it")
        return q, load if any(f"{name}.{key}" in by_name for name in points for key in WRENCH) else None


def wrenches(by_name: Mapping[str, Array], points: tuple[str, ...], g: int) -> Array:
    """Wrenches ``(g, l, 6)`` at points; what has no column is zero, what is blank is nan."""
    return columns_of(by_name, points, WRENCH, np.zeros(g))


def coordinates(by_name: Mapping[str, Array], rows: np.ndarray, machine: PoseMachine) -> Array:
    """The joints' coordinates ``(g, n)``, mm and rad.

    Columns of coupled joints may stand beside those of their masters, as logs have them.

    Raises:
        ValueError: a column is missing, or one of a coupled joint is not what its masters make.
    """
    columns = []
    for joint, sliding in zip(machine.joints, machine.slides, strict=True):
        column, other = (f"{joint}.{key}" for key in (("q_mm", "q_rad") if sliding else ("q_rad", "q_mm")))
        if column not in by_name:
            said = f", which {'slides' if sliding else 'turns'}; the file has {other}" if other in by_name else ""
            raise ValueError(f"column '{column}' is missing{said}: add it, or name its column in [joints]")
        columns.append(by_name[column])
    by_joint = dict(zip(machine.joints, columns, strict=True))
    for one in machine.followers:
        _check_follower(one, by_name, by_joint, rows)
    return np.column_stack(columns)


def postures(table: DataTable, by_name: Mapping[str, Array], machine: PoseMachine) -> Array:
    """Coordinates ``(g, n)`` by their columns, or by the names of the model's postures."""
    if POSTURE not in table.cells:
        return coordinates(by_name, table.row, machine)
    if any(f"{joint}.{key}" in by_name for joint in machine.driven for key in COORDINATE):
        raise ValueError(f"column '{POSTURE}' stands beside coordinates of joints: leave one of both")
    known, labels = machine.chain.held, table.cells[POSTURE]
    check_labels(labels, table.row, known, "the model has", "write one of them")
    return np.array([[known[label][name] for name in machine.joints] for label in labels])


def read_poses(table: DataTable, sheet: PoseSheet, machine: PoseMachine) -> PoseData:
    """The readings of a table, which fit their sheet and give the coordinates of the model's joints.

    Raises:
        ValueError: they do not; one line.
    """
    joints, slides, rows = machine.joints, machine.slides, table.row
    owners = [Owners("marker", tuple(sheet.markers), OF_MARKERS)]
    check_columns(
        list(table.cells), sheet, machine, (*COORDINATE, *TORQUE), owners, (READING, POSTURE, TIME, TEMPERATURE)
    )
    by_name = numbers_by_name(table, sheet, skip=lambda key: key in (READING, POSTURE))
    g, nothing = len(rows), np.full(len(rows), np.nan)
    q = postures(table, by_name, machine)
    torque = np.column_stack(
        [by_name.get(f"{j}.tau_{'N' if s else 'Nmm'}", nothing) for j, s in zip(joints, slides, strict=True)]
    )
    markers = tuple(sheet.markers)

    for marker in markers:
        if sheet.markers[marker].orientation != "tilt" and not any(
            f"{marker}.{key}" in by_name for key in POSITION
        ):
            raise ValueError(f"column '{marker}.x_mm' is missing: add it, or take [markers.{marker}] away")
        _check_coordinates(marker, by_name, sheet)
    position = columns_of(by_name, markers, POSITION, nothing)
    check_noise(by_name, NOISE, rows)
    sigma = columns_of(by_name, markers, NOISE, np.full(g, sheet.tracker.noise_mm))
    sigma = np.where(np.isnan(sigma) | (sigma <= 0.0), sheet.tracker.noise_mm, sigma)
    wrench = np.nan_to_num(wrenches(by_name, markers, g))
    orientation = np.stack([_orientation(m, sheet, by_name, g) for m in markers], axis=1)
    tilt = np.stack([_tilt(m, sheet, by_name, g) for m in markers], axis=1)
    if not np.isfinite(position).any():
        raise ValueError("no marker's position was read: tilts alone place nothing; add MARKER.x_mm, y_mm, z_mm")
    read = np.isfinite(position).any(axis=(1, 2)) | np.isfinite(tilt).any(axis=(1, 2))
    keep = np.asarray(np.isfinite(q).all(axis=1) & read)
    data = PoseData(
        table.name, table.sha256, rows, joints, q, markers, position, orientation, tilt, sigma, wrench, torque,
        by_name.get(TIME), by_name.get(TEMPERATURE), int((~keep).sum()),
    )  # fmt: skip
    for name in (TIME, TEMPERATURE):
        if name in by_name and np.isnan(by_name[name][keep]).any():
            raise ValueError(f"column {name} has blanks: complete it or leave the column away")
    if not keep.any():
        raise ValueError("no row has all joints and a marker: nothing to be fitted")
    return data.only(keep)


def _check_coordinates(marker: str, by_name: Mapping[str, Array], sheet: PoseSheet) -> None:
    """Refuse positions of which a coordinate was never read, where nothing else tells the tracker's frame."""
    read = [f"{marker}.{key}" in by_name and np.isfinite(by_name[f"{marker}.{key}"]).any() for key in POSITION]
    if sheet.base is not None or all(read) or not any(read):
        return
    column = f"{marker}.{POSITION[read.index(False)]}"
    raise ValueError(
        f"column '{column}' is {'blank' if column in by_name else 'missing'}: without it the tracker's frame "
        "cannot be found: add it, or give that frame in a table [base] of the sheet"
    )


def _check_follower(joint: Joint, by_name: Mapping[str, Array], q: dict[str, Array], rows: np.ndarray) -> None:
    """A coupled joint's own column, as logs have it beside its masters', must be what these make."""
    column = f"{joint.name}.q_mm" if joint.slides else f"{joint.name}.q_rad"
    if column not in by_name or joint.coupling is None:
        return
    masters = [name for name, _ in joint.coupling.ratios]
    if any(name not in q for name in masters):
        return  # it follows another coupled joint, whose own column is held against its masters
    made = joint.coupling.offset + joint.coupling.summed(q)
    off = np.abs(by_name[column] - made)
    worst = int(np.nanargmax(off)) if np.isfinite(off).any() else 0
    if off[worst] > (FOLLOWS_MM if joint.slides else FOLLOWS_RAD):
        raise ValueError(
            f"row {rows[worst]}, column '{column}': {by_name[column][worst]:.4g} where the model makes "
            f"{made[worst]:.4g} of {', '.join(masters)}: correct the model's coupling, or delete the column"
        )


def _orientation(marker: str, sheet: PoseSheet, columns: dict[str, Array], g: int) -> Array:
    """Rotations ``(g, 3, 3)`` of a marker as its table says they are to be read."""
    result, how = np.full((g, 3, 3), np.nan), sheet.markers[marker].orientation
    if how in ("none", "tilt"):
        return result
    keys, factor = (QUATERNION, 1.0) if how == "quaternion" else angles_of(marker, columns)
    for key in keys:
        if f"{marker}.{key}" not in columns:
            raise ValueError(f"column '{marker}.{key}' is missing: add it, or write orientation = 'none'")
    values = factor * np.column_stack([columns[f"{marker}.{key}"] for key in keys])
    for i in np.flatnonzero(np.isfinite(values).all(axis=1)):
        result[i] = rotation_by(how, values[i])
    return result


def angles_of(marker: str, columns: Mapping[str, Array]) -> tuple[tuple[str, ...], float]:
    """What stands behind a marker's name in its columns of angles, and what makes rad of these."""
    return (ANGLES_DEG, np.pi / 180.0) if f"{marker}.{ANGLES_DEG[0]}" in columns else (ANGLES, 1.0)


def _tilt(marker: str, sheet: PoseSheet, columns: dict[str, Array], g: int) -> Array:
    """Tilts ``(g, 2)`` of a marker that is an inclinometer, one axis of which may be missing."""
    result = np.full((g, 2), np.nan)
    if sheet.markers[marker].orientation != "tilt":
        return result
    given = [(k, key, f) for names, f in ((TILT, 1.0), (TILT_DEG, np.pi / 180.0)) for k, key in enumerate(names)]
    for k, key, factor in given:
        if f"{marker}.{key}" in columns:
            result[:, k] = factor * columns[f"{marker}.{key}"]
    if not np.isfinite(result).any():
        raise ValueError(f"column '{marker}.tilt_x_rad' is missing: add it, or write orientation = 'none'")
    largest, upright = np.nanmax(np.abs(result), axis=0, initial=0.0), 0.5 * np.pi
    if largest.max() > upright + 1e-6:
        why = beyond_turn(float(largest.max()), upright, "Name it tilt_x_deg")
        column = f"{marker}.{TILT[int(np.argmax(largest))]}"
        raise ValueError(f"column '{column}' reaches {largest.max():.4g} rad, more than upright: {why}")
    return result


def rotation_by(how: str, values: Array) -> Array:
    """Rotation ``(3, 3)`` of a marker from its columns, rad or a quaternion ``(w, x, y, z)``.

    Raises:
        ValueError: a quaternion of length zero.
    """
    if how == "quaternion":
        length = float(np.linalg.norm(values))
        if length < 1e-6:
            raise ValueError("a quaternion has the length zero: leave a missed sample blank")
        w, v = values[0] / length, values[1:] / length
        angle = 2.0 * np.arctan2(np.linalg.norm(v), w)
        return rotation_from_vector(v * (angle / np.linalg.norm(v) if np.any(v) else 0.0))
    if how == "rotation vector":
        return rotation_from_vector(values)
    X, Y, Z = (rotation_from_vector(np.eye(3)[i] * values[i]) for i in range(3))
    return Z @ Y @ X if how == "fixed xyz" else X @ Y @ Z


DESCRIPTIONS = (".urdf", ".sdf")
"""Of files that a sheet may name in place of a model file."""


@dataclass(frozen=True)
class SheetModel:
    """The model that a sheet names.

    Attributes:
        document: as TOML gives it.
        chain: its machine.
        machine: the same, extended.
        doubts: what is likely a mistake in a URDF or an SDF file.
        notes: where the stiffness of its drives is from.
    """

    document: dict[str, Any]
    chain: Machine
    machine: PoseMachine
    doubts: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class RobotMeasurement:
    """What was measured and on what, of any kind of test.

    Attributes:
        sheet: the sheet.
        data: the postures.
        model: of the robot.
        kind: of test.
    """

    sheet: RobotSheet
    data: PoseData
    model: SheetModel
    kind: Literal["poses", "deflections"]


def ends_of(tables: Mapping[str, Rider]) -> dict[str, tuple[str, Array]]:
    """Part behind which each point of a sheet rides, and where there, ``(3,)`` mm, by its name."""
    return {name: (table.on, np.array(table.position_mm, dtype=float)) for name, table in tables.items()}


def model_of(page: RobotSheet, ends: dict[str, tuple[str, Array]]) -> SheetModel:
    """The model that a sheet names, beside it or of the library, with the points ``ends``, see `ends_of`.

    Raises:
        ValueError: the model cannot be used; one line.
    """
    near = page.folder / page.test.model
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    if near.suffix not in DESCRIPTIONS:
        source = model_document(page, page.test.model)
        content, file, files = source.content, source.file, source.files
    elif not near.is_file():
        raise SheetError(f"{page.file}: [test] model: no file {near.name} beside the sheet")
    else:
        drives = beside(near)
        robot = import_robot(Description(near), page.test.tip, stiffness=drives)
        content, file, doubts = robot.document, near.name, tuple(robot.notes.doubtful)
        files = {one.name: digest(one.read_bytes()) for one in (near, drives) if one is not None}
        # what is said last is from where the stiffness of the drives is
        notes = tuple(robot.notes.changed[-1:]) if drives is not None else ()
    chain = build_chain(content, file, files, may_be_rigid=page.test.rigid)
    names = [joint.name for joint in chain.held_joints]
    for column, joint in page.joints.items():
        if joint not in names:
            raise SheetError(
                f"{page.file}: [joints] {column} = '{joint}': the model has no such driven joint; "
                f"it has {', '.join(names)}"
            )
    try:
        machine = PoseMachine(chain, ends, rigid=page.test.rigid, at_output=page.at_output)
    except ValueError as error:
        raise SheetError(f"{page.file}: {error}") from error
    return SheetModel(content, chain, machine, doubts, notes)
