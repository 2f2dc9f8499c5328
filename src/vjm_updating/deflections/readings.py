"""The readings of a test of deflections: a row is a posture, a wrench, and by how much the markers moved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from vjm.io.fields import Turns
from vjm.io.schema import Label
from vjm.io.sections import Table
from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import physical_bound
from vjm_updating.experiment.channels import WRENCH, beyond_turn
from vjm_updating.experiment.sheet import read_sheet_of
from vjm_updating.experiment.source import DataTable, SheetSource, TableSource, table_of
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.readings import (
    ANGLES,
    ANGLES_DEG,
    COORDINATE,
    POSTURE,
    READING,
    Owners,
    PoseData,
    check_columns,
    check_noise,
    columns_of,
    numbers_by_name,
    postures,
    wrenches,
)
from vjm_updating.poses.sheet import MarkerTable, Rider, RobotSheet, RobotTest, Sigma, check_gravity

# --- The sheet of a test of ``kind = "deflections"``: the robot, where it is loaded, the markers, what is read ----

PerLoad = Annotated[float, Field(ge=0.0, le=1e3)]


class DeflectionLoadTable(Rider):
    """Where a known wrench acts."""

    axes: Literal["base", "tool"] = Field(
        "base", description="whose axes the columns are in: base's, or the part's"
    )
    turns: Turns = Field([], description="of a force sensor's axes in those of the part; for axes = 'tool'")

    @model_validator(mode="after")
    def _turned(self) -> DeflectionLoadTable:
        if self.turns and self.axes == "base":
            raise ValueError("turns are for axes = 'tool': write that, or leave turns away")
        return self


class DeflectionMarker(MarkerTable):
    """A point or a frame whose displacement is read."""

    sigma_mm: Sigma = Field(5.0, description="how well its place is known")


class DeflectionTracker(Table):
    """What reads the displacements; a standard deviation has a fixed part and one in proportion to the load."""

    noise_mm: Sigma = Field(description="1 sigma of a coordinate of a displacement without load")
    noise_mm_per_N: PerLoad = Field(0.0, description="1 sigma more for each N of force")  # noqa: N815
    noise_mm_per_Nmm: PerLoad = Field(0.0, description="1 sigma more for each N mm of moment")  # noqa: N815
    noise_rad: Sigma = Field(1e-4, description="1 sigma about an axis of a rotation without load")
    noise_rad_per_N: PerLoad = Field(0.0, description="1 sigma more for each N of force")  # noqa: N815
    noise_rad_per_Nmm: PerLoad = Field(0.0, description="1 sigma more for each N mm of moment")  # noqa: N815
    axes: Literal["base", "own"] = Field(
        "base", description="whose axes displacements are in; 'own' ones are found"
    )
    sigma_rad: Sigma = Field(0.01, description="how well axes = 'base' are those of the base")
    source: str = ""


class DeflectionSheet(RobotSheet):
    """The sheet."""

    kind: Literal["deflections"]
    test: RobotTest
    loads: dict[Label, DeflectionLoadTable] = Field(min_length=1)
    markers: dict[Label, DeflectionMarker] = Field(min_length=1)
    tracker: DeflectionTracker

    @model_validator(mode="after")
    def _gravity(self) -> DeflectionSheet:
        check_gravity(self.test.gravity)
        return self


def read_deflection_sheet(sheet: SheetSource) -> DeflectionSheet:
    """A sheet of deflections from its file or its content.

    Raises:
        SheetError: no such file, no TOML, or no sheet of deflections; one line.
    """
    return read_sheet_of(sheet, DeflectionSheet)


SHIFT, NOISE = ("dx_mm", "dy_mm", "dz_mm"), ("dx_std_mm", "dy_std_mm", "dz_std_mm")
OF_MARKERS = (*SHIFT, *NOISE, *ANGLES, *ANGLES_DEG)
LARGEST_ROTATION = physical_bound(0.5, "rad")
"""rad: a robot that turns further under a load is broken, or its columns are in degrees."""


@dataclass(frozen=True)
class DeflectionData(PoseData):
    """g readings of a robot with k markers and l points of load.

    As poses have them, with these meanings: ``position`` is the displacement, loaded minus unloaded,
    ``orientation`` the rotation from unloaded to loaded, both in the tracker's axes; ``wrench`` is zero.

    Attributes:
        loads: names of the points.
        load: ``(g, l, 6)`` wrench at them as read, in their tables' axes, N and N mm.
        given: ``(l, 6)`` which of its columns the file has; what it has not is zero.
        sigma_turn: ``(g, k)`` rad, 1 sigma of the rotations.
    """

    loads: tuple[str, ...] = ()
    load: Array = field(default_factory=lambda: np.zeros((0, 0, 6)))
    given: np.ndarray = field(default_factory=lambda: np.zeros((0, 6), dtype=bool))
    sigma_turn: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def only(self, keep: np.ndarray) -> DeflectionData:
        """The readings of a mask or of indices."""
        kept = super().only(keep)
        return replace(self, **vars(kept) | {"load": self.load[keep], "sigma_turn": self.sigma_turn[keep]})

    def blanked(self, readings: np.ndarray) -> DeflectionData:
        """Without the displacements of a mask ``(g, k)``; rows of which nothing is left are left out."""
        position = np.where(readings[:, :, None], np.nan, self.position)
        return replace(self, position=position).only(np.asarray(np.isfinite(position).any(axis=(1, 2))))


def read_deflections(readings: TableSource, sheet: DeflectionSheet, machine: PoseMachine) -> DeflectionData:
    """The readings of a data file, which fit their sheet.

    Args:
        readings: the CSV file, or columns.
        sheet: its sheet.
        machine: of the model, whose joints' coordinates or postures the data have to give.

    Raises:
        DataError: they do not; one line.
    """
    table = table_of(readings)
    with table.named():
        return _read(table, sheet, machine)


def _read(table: DataTable, sheet: DeflectionSheet, machine: PoseMachine) -> DeflectionData:
    rows = table.row
    owners = [Owners("load", tuple(sheet.loads), WRENCH), Owners("marker", tuple(sheet.markers), OF_MARKERS)]
    check_columns(list(table.cells), sheet, machine, tuple(COORDINATE), owners, (READING, POSTURE))
    by_name = numbers_by_name(table, sheet, skip=lambda key: key in (READING, POSTURE))
    g, markers = len(rows), tuple(sheet.markers)
    q = postures(table, by_name, machine)
    for name in sheet.loads:
        if not any(f"{name}.{key}" in by_name for key in WRENCH):
            raise ValueError(
                f"column '{name}.fx_N' is missing: add the wrench at '{name}', or take [loads.{name}] away"
            )
    for name in markers:
        if not any(f"{name}.{key}" in by_name for key in (*SHIFT, *ANGLES, *ANGLES_DEG)):
            raise ValueError(f"column '{name}.dx_mm' is missing: add it, or take [markers.{name}] away")
    load = wrenches(by_name, tuple(sheet.loads), g)
    given = np.array([[f"{name}.{key}" in by_name for key in WRENCH] for name in sheet.loads])
    shift = columns_of(by_name, markers, SHIFT, np.full(g, np.nan))
    if not np.isfinite(shift).any():
        raise ValueError("no displacement was read: add MARKER.dx_mm, dy_mm, dz_mm")
    rotation = _rotations(by_name, markers, g)
    sigma, sigma_turn = _sigmas(by_name, sheet, load, rows)
    read = np.isfinite(shift).any(axis=(1, 2)) | np.isfinite(rotation).any(axis=(1, 2, 3))
    whole = np.isfinite(load).all(axis=(1, 2))
    keep = np.asarray(np.isfinite(q).all(axis=1) & read & whole)
    if not keep.any():
        raise ValueError("no row has all joints, the wrench and a displacement: nothing to be fitted")
    if not load[keep].any():
        raise ValueError("no row has a load: write the wrench in the columns of [loads]")
    k, n = len(markers), len(machine.joints)
    data = DeflectionData(
        table.name, table.sha256, rows, machine.joints, q, markers, shift, rotation,
        np.full((g, k, 2), np.nan), sigma, np.zeros((g, k, 6)), np.full((g, n), np.nan), None, None,
        int((~keep).sum()), tuple(sheet.loads), load, given, sigma_turn,
    )  # fmt: skip
    return data.only(keep)


def _rotations(by_name: Mapping[str, Array], markers: tuple[str, ...], g: int) -> Array:
    """Rotations ``(g, k, 3, 3)`` from the columns of rotation vectors, nan where there are none."""
    result = np.full((g, len(markers), 3, 3), np.nan)
    for k, name in enumerate(markers):
        degrees = f"{name}.{ANGLES_DEG[0]}" in by_name
        keys, factor = (ANGLES_DEG, np.pi / 180.0) if degrees else (ANGLES, 1.0)
        given = [f"{name}.{key}" in by_name for key in keys]
        if not any(given):
            continue
        if not all(given):
            raise ValueError(f"column '{name}.{keys[given.index(False)]}' is missing: a rotation has three: add it")
        values = factor * np.column_stack([by_name[f"{name}.{key}"] for key in keys])
        largest = float(np.nanmax(np.abs(values), initial=0.0))
        if largest > LARGEST_ROTATION:
            why = beyond_turn(largest, LARGEST_ROTATION, "Name them rx_deg, ry_deg, rz_deg")
            raise ValueError(
                f"column '{name}.{keys[0]}' and its two reach {largest:.4g} rad: no robot turns so far under a "
                f"load; {why}"
            )
        for i in np.flatnonzero(np.isfinite(values).all(axis=1)):
            result[i, k] = rotation_from_vector(values[i])
    return result


def _sigmas(
    by_name: Mapping[str, Array], sheet: DeflectionSheet, load: Array, rows: np.ndarray
) -> tuple[Array, Array]:
    """Standard deviations of displacements ``(g, k, 3)`` mm and of rotations ``(g, k)`` rad."""
    check_noise(by_name, NOISE, rows)
    said, markers = sheet.tracker, tuple(sheet.markers)
    force = np.linalg.norm(np.nan_to_num(load[..., :3]), axis=2).sum(axis=1)
    moment = np.linalg.norm(np.nan_to_num(load[..., 3:]), axis=2).sum(axis=1)
    by_load = np.sqrt(said.noise_mm**2 + (said.noise_mm_per_N * force + said.noise_mm_per_Nmm * moment) ** 2)
    turn = np.sqrt(said.noise_rad**2 + (said.noise_rad_per_N * force + said.noise_rad_per_Nmm * moment) ** 2)
    own = columns_of(by_name, markers, NOISE, np.full(len(rows), np.nan))
    sigma = np.where(own > 0.0, own, by_load[:, None, None])
    return sigma, np.repeat(turn[:, None], len(markers), axis=1)
