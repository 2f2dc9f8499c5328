"""Tests of deflections: a row is a posture, a wrench, and by how much the markers moved; and their study."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, Self, assert_never

import numpy as np
from pydantic import Field, model_validator
from scipy.optimize import nnls

from vjm.errors import NoConvergenceError
from vjm.io.fields import Table, Turns, rotation
from vjm.io.schema import Label
from vjm.model.laws import Law, Tabulated
from vjm.rotations import Array, rotation_from_vector, rotation_vector
from vjm_updating.calibration.calibrated_model import tabulated
from vjm_updating.constants import numerical, physical_bound, prior_scale
from vjm_updating.experiment.data_file import WRENCH, DataTable, beyond_turn
from vjm_updating.inference.significance import median_sigma
from vjm_updating.poses.families import (
    DISPLACEMENT,
    LAWS,
    LOAD,
    MILLIMETRE,
    MILLIRADIAN,
    FamilyParameter,
    LawFamily,
    members_of,
    value_member,
)
from vjm_updating.poses.forward import (
    LARGEST_TURN,
    MARKER_PLACE,
    Frames,
    Linearised,
    PoseForward,
    SeriesForward,
    turn_between,
    velocities,
)
from vjm_updating.poses.machine import OWN, PoseMachine
from vjm_updating.poses.measurement import (
    ANGLES,
    ANGLES_DEG,
    COORDINATE,
    POSTURE,
    READING,
    MarkerTable,
    Owners,
    PoseData,
    Rider,
    RobotSheet,
    RobotTest,
    Sigma,
    angles_of,
    check_columns,
    check_noise,
    columns_of,
    ends_of,
    numbers_by_name,
    postures,
    wrenches,
)
from vjm_updating.poses.state import Candidates, FittedState, Hypothesis
from vjm_updating.poses.study import SeriesStudy, Study

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

    @property
    def loaded(self) -> tuple[str, ...]:
        """Points at which wrenches act."""
        return self.loads

    def only(self, keep: np.ndarray) -> Self:
        """The readings of a mask or of indices."""
        return replace(super().only(keep), load=self.load[keep], sigma_turn=self.sigma_turn[keep])


def read_deflections(table: DataTable, sheet: DeflectionSheet, machine: PoseMachine) -> DeflectionData:
    """The readings of a table, which fit their sheet and give the coordinates or postures of the model's joints.

    Raises:
        ValueError: they do not; one line.
    """
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
        keys, factor = angles_of(name, by_name)
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


# --- By how much the markers move under a known wrench, and exact derivatives of that by every member and nuisance-
#
# Two equilibria of the machine, both under its weight, one under the wrench too. With p, R the marker's frame
# loaded and p₀, R₀ unloaded, the prediction is ``Q (p + R m − p₀ − R₀ m)`` and the rotation from R₀ to R, both in
# the axes Q of what reads them. What shifts or turns both equilibria alike, such as the tracker's origin and the
# joints' zeros, is not in a difference. Nuisances are Q and what the marker's place in its body is off, m.

PUSHES = numerical(1e-3)
"""Of the largest load: by what it is changed for a difference, whose error is that share squared of it."""


class DeflectionForward(SeriesForward):
    """The model of a test of deflections.

    Attributes:
        loaded: the machine under weight and wrenches.
        unloaded: the same under its weight.
    """

    def __init__(self, machine: PoseMachine, data: DeflectionData, sheet: DeflectionSheet) -> None:
        """Take a test, whose machine's first end frames are the markers', then come the points of load."""
        self.data, self._sheet = data, sheet
        self._loads, self._tracker, gravity = tuple(sheet.loads.values()), sheet.tracker, sheet.test.gravity
        k = len(data.markers)
        none = replace(data, wrench=np.zeros((len(data), k + len(self._loads), 6)))
        # differences have no place about which they would turn
        self.centre = np.zeros(3)
        self.unloaded = PoseForward(machine, none, gravity, self.centre)
        R, _ = self.unloaded.unloaded()
        wrench = none.wrench.copy()
        wrench[:, k:] = in_base(data.load, R[:, k:], self._loads)
        self._wrench, self._points = wrench, R[:, k:]
        self.loaded = PoseForward(machine, replace(none, wrench=wrench), gravity, self.centre)

    @property
    def members(self) -> list[FamilyParameter]:
        """Numbers that a hypothesis may change."""
        return self.unloaded.members

    @members.setter
    def members(self, members: list[FamilyParameter]) -> None:
        # what follows the load acts in the loaded state only
        still = np.zeros(len(self.data))
        self.loaded.members = members
        self.unloaded.members = [m if m.basis is None else replace(m, basis=still) for m in members]

    def nuisance_names(self) -> list[str]:
        """What each is: three turns of the axes, three shifts a marker."""
        return ["axes of the displacements"] * 3 + [
            f"{MARKER_PLACE} {marker}" for marker in self.data.markers for _ in range(3)
        ]

    def bearing(self) -> Array:
        """What the loads alone bring on each coordinate ``(g, n_tree)``, N mm or N."""
        return self.loaded.bearing() - self.unloaded.bearing()

    def torques(self) -> Array:
        """Root mean square ``(n_tree,)`` of what the loads alone bring on each coordinate."""
        return np.sqrt(np.mean(self.bearing() ** 2, axis=0))

    def evaluate(self, z: Array, frames: Frames) -> Linearised:
        """See `ReadingsForward`."""
        k = len(self.data.markers)
        self.loaded.wrench = self._under(z)
        R, p, columns, forces = self.loaded.end_frames(z)
        self._by_loads(z, columns)
        R0, p0, columns0, forces0 = self.unloaded.end_frames(z)
        arm, arm0 = (np.einsum("gkab,kb->gka", F[:, :k], frames.m) for F in (R, R0))
        moved = velocities(columns[:, :k], arm) - velocities(columns0[:, :k], arm0)
        Q = frames.R
        J = np.concatenate([Q @ moved, Q @ (columns[:, :k, 3:] - columns0[:, :k, 3:])], axis=2)
        seen = (p[:, :k] + arm - p0[:, :k] - arm0) @ Q.T
        turned = Q @ (R[:, :k] @ np.swapaxes(R0[:, :k], -1, -2)) @ Q.T
        for i, (size, member) in enumerate(zip(z, self.members, strict=True)):
            if member.kind == DISPLACEMENT:
                j, a = divmod(member.index, 6)
                J[:, j, a, i] = member.scale
                seen[:, j, a] += size * member.scale
        residual = np.full((len(self.data), k, 6), np.nan)
        residual[..., :3] = self.data.position - seen
        residual[..., 3:] = turn_between(turned, self.data.orientation)
        none = np.broadcast_to(np.eye(3), turned.shape)
        by_turn = np.concatenate([seen, turn_between(none, turned)], axis=2)
        F = np.zeros((*residual.shape, self.nuisances))
        tilt = np.zeros((*residual.shape, 3))
        place = p[:, :k] + arm
        for a in range(3):
            e = np.eye(3)[a]
            F[..., :3, a], F[..., 3:, a] = np.cross(e, by_turn[..., :3]), np.cross(e, by_turn[..., 3:])
            tilt[..., :3, a], tilt[..., 3:, a] = np.cross(e, place) @ Q.T, Q[:, a]
        for j in range(k):
            F[:, j, :3, 3 + 3 * j : 6 + 3 * j] = Q @ (R[:, j] - R0[:, j])
        torque = self.loaded.machine.tree.torques(forces - forces0)[:, self.loaded.given]
        turn = rotation_vector(Q) if self._tracker.axes == "base" else np.zeros(3)
        off = np.concatenate([turn, frames.m.reshape(-1)])
        return Linearised(residual, F, J, torque, off, tilt)

    def _under(self, z: Array) -> Array:
        """Wrenches ``(g, e, 6)`` with the zeros that members ``z`` take from those that were read."""
        wrench = self._wrench.copy()
        for size, member in zip(z, self.members, strict=True):
            if member.kind == LOAD and size != 0.0:
                wrench[:, len(self.data.markers) :] += size * member.scale * self._direction(member)
        return wrench

    def _direction(self, member: FamilyParameter) -> Array:
        """Wrenches ``(g, l, 6)`` in the base's axes of one N or N mm that a sensor's zero adds."""
        load = np.zeros_like(self.data.load)
        load[:, member.index // 6, member.index % 6] = 1.0
        return in_base(load, self._points, self._loads)

    def _by_loads(self, z: Array, columns: Array) -> None:
        """Write the velocities of the end frames by zeros of loads into ``columns`` (g, e, 6, P)."""
        k, around = len(self.data.markers), self.loaded.wrench
        for i, member in enumerate(self.members):
            if member.kind != LOAD:
                continue
            half = slice(0, 3) if member.index % 6 < 3 else slice(3, 6)
            step = PUSHES * float(np.abs(self.data.load[:, member.index // 6, half]).max())
            ends = []
            for side in (1.0, -1.0):
                self.loaded.wrench = around.copy()
                self.loaded.wrench[:, k:] += side * step * self._direction(member)
                ends.append(self.loaded.placed(z))
            (R, p), (R0, p0) = ends
            none = np.broadcast_to(np.eye(3), R.shape)
            turned = turn_between(none, R @ np.swapaxes(R0, -1, -2))
            columns[..., i] = member.scale / (2.0 * step) * np.concatenate([p - p0, turned], axis=2)
        self.loaded.wrench = around

    def moved(self, frames: Frames, step: Array) -> Frames:
        """See `ReadingsForward`."""
        turn, size = step[:3], float(np.linalg.norm(step[:3]))
        if size > LARGEST_TURN:
            turn = turn * (LARGEST_TURN / size)
        return Frames(rotation_from_vector(turn) @ frames.R, frames.t, frames.m + step[3:].reshape(-1, 3), frames.M)

    def with_machine(self, machine: PoseMachine) -> DeflectionForward:
        """The same test of another machine with the same members."""
        other = DeflectionForward(machine, self.data, self._sheet)
        other.members = self.loaded.with_machine(machine).members
        return other


def in_base(load: Array, R: Array, tables: Sequence[DeflectionLoadTable]) -> Array:
    """Wrenches ``(g, l, 6)`` in the base's axes from those in their tables' axes.

    A tool's axes are those of the unloaded robot, in the frames R ``(g, l, 3, 3)`` of the points: it turns by some
    mrad under the load.
    """
    result = load.copy()
    for j, table in enumerate(tables):
        if table.axes == "tool":
            axes = R[:, j] @ rotation(table.turns)
            for half in (slice(0, 3), slice(3, 6)):
                result[:, j, half] = np.einsum("gab,gb->ga", axes, load[:, j, half])
    return result


# --- Families of what a robot's deflection under a load can have: springs, linear or not, and a load's zero -------
#
# Errors of geometry, gears and encoders move the loaded and the unloaded robot alike: no difference shows them.
# The scale of all loads is one with all compliances, and is not asked.

COMPLIANCES = ("actuator_compliance", "lateral_compliance", "base_compliance", "link_compliance")
NOT_SHOWN = ("joint_offset", "frame_error", "gear_error", "encoder_scale", "approach", "tracker_drift", "gravity")
"""Families of poses that a difference of two equilibria does not show, but in the second order."""
ONE_PERCENT = prior_scale(0.01)
"""Of the largest load or displacement: the unit of a zero."""
RESTS = physical_bound(1e-3)
"""Of a joint's root mean square torque by the loads: a smaller torque presses a joint to neither side."""


def members_of_loads(
    machine: PoseMachine, data: DeflectionData, forward: DeflectionForward, scale: Array
) -> list[FamilyParameter]:
    """Every member of every family that a test of deflections can show.

    ``scale`` (n_tree,) is what its loads bring on each coordinate, root mean square, N mm or N.
    """
    springs = [m for m in members_of(machine, data, scale, ordered=False) if m.family in COMPLIANCES]
    return [*springs, *_of_joints(machine, forward, scale), *_zeros(data)]


def by_law(family: LawFamily, torque: Array, scale: float) -> Array:
    """What a unit of a family turns its joint by, at torques ``(n,)`` of root mean square ``scale``."""
    match family:
        case "tension_compression_asymmetry":
            return np.abs(torque)
        case "actuator_hardening":
            return torque**3
        case "actuator_backlash":
            return 0.5 * np.sign(np.where(np.abs(torque) > RESTS * scale, torque, 0.0))
        case _:
            assert_never(family)


def law_of_joint(
    study: Study, joint: str, compliance: float, values: Mapping[str, float], law: Law | None
) -> Tabulated | None:
    """The law of a joint's spring, known up to the largest torque of a test; None where it does not rise.

    Args:
        study: the test.
        joint: its name.
        compliance: of a straight spring, rad/(N mm) or mm/N.
        values: of the members of `LAWS`, by name.
        law: in series with both.
    """
    (c,) = (s.span[0] for s in study.machine.springs if s.part == joint and s.kind == OWN)
    forwards = [one.forward() for one in study.groups]
    loaded = [one.loaded if isinstance(one, DeflectionForward) else one for one in forwards]

    def turned(torque: Array) -> Array:
        result = compliance * torque
        if law is not None:
            result = result + [law.deflection(load) for load in torque.tolist()]
        for family in LAWS:
            # however small a torque is, it presses to a side
            result = result + values.get(f"{family}.{joint}", 0.0) * by_law(family, torque, 0.0)
        return result

    return tabulated(turned, max(float(np.abs(one.bearing()[:, c]).max()) for one in loaded))


def _of_joints(machine: PoseMachine, forward: DeflectionForward, scale: Array) -> list[FamilyParameter]:
    """What a joint turns by under the load beyond a linear spring, a function of its torque."""
    result = []
    loaded, still = forward.loaded.bearing(), forward.unloaded.bearing()
    for spring in machine.springs:
        c = spring.span[0]
        if spring.kind != "own" or scale[c] < 1e-3 * scale.max(initial=0.0) or spring.part not in machine.driven:
            continue
        over, before = loaded[:, c], still[:, c]
        size, of, by = (MILLIMETRE, "mm", "N") if spring.slides else (MILLIRADIAN, "rad", "(N mm)")
        # values of one scale turn the joint by as much under the root mean square torque, whatever their dimension
        units: dict[LawFamily, tuple[float, str]] = {
            "actuator_hardening": (size / scale[c] ** 3, f"{of}/{by}³"),
            "tension_compression_asymmetry": (size / scale[c], f"{of}/{by}"),
            "actuator_backlash": (size, of),
        }
        index = machine.driven[spring.part]
        for family, (scale_of_law, unit) in units.items():
            basis = by_law(family, over, scale[c]) - by_law(family, before, scale[c])
            if np.any(basis):
                result.append(value_member(family, spring.part, "", index, scale_of_law, unit, basis))
    return result


def _zeros(data: DeflectionData) -> list[FamilyParameter]:
    """Zeros of the force sensors along the axes that they read, and of what reads the markers' displacements."""
    largest = np.abs(data.load).max(axis=0)
    read = np.nanmax(np.abs(data.position), axis=0, initial=0.0)
    zeros = [
        (LOAD, point, 6 * j + a, label, float(largest[j].reshape(2, 3)[a // 3].max()), "N" if a < 3 else "N mm")
        for j, point in enumerate(data.loads)
        for a, label in enumerate(("fx", "fy", "fz", "mx", "my", "mz"))
        if largest[j, a] > 0.0
    ]
    zeros += [
        (DISPLACEMENT, marker, 6 * j + a, f"d{axis}", float(read[j].max()), "mm")
        for j, marker in enumerate(data.markers)
        for a, axis in enumerate("xyz")
        if read[j, a] > 0.0
    ]
    return [
        FamilyParameter(
            family="instrument_zero", name=f"instrument_zero.{place}.{label}", kind=kind, index=index,
            scale=ONE_PERCENT * most, unit=unit,
        )
        for kind, place, index, label, most, unit in zeros
    ]  # fmt: skip


ANY_AXES = prior_scale(10.0, "rad")
"""rad: of axes that are found."""


class DeflectionStudy(SeriesStudy):
    """A test of deflections."""

    baseline: str = "as modelled"
    against: tuple[str, str] = (
        "[loads]",
        "the joints deflect against the load: are the displacements unloaded minus loaded, or is the force that "
        "of the robot on what loads it? Reverse the sign of one of them",
    )
    jump: tuple[str, str] = (
        "reference_jump",
        "from here on all displacements are ({by}) mm off: the unloaded readings have changed",
    )
    turns_with_tracker: bool = False
    not_asked = NOT_SHOWN
    not_asked_for = "they move the loaded and the unloaded robot alike"
    sheet: DeflectionSheet
    data: DeflectionData

    def forward_of(self, machine: PoseMachine, data: PoseData) -> DeflectionForward:
        """The model of readings of the test, by a machine and without members."""
        assert isinstance(data, DeflectionData)
        return DeflectionForward(machine, data, self.sheet)

    def members_for(self, forward: SeriesForward) -> list[FamilyParameter]:
        """All members that a difference of two equilibria shows."""
        assert isinstance(forward, DeflectionForward)
        return members_of_loads(self.machine, self.data, forward, forward.torques())

    def nuisance_prior(self) -> Array:
        """Standard deviations ``(n_f,)`` of the axes and of the markers' places."""
        turns = ANY_AXES if self.sheet.tracker.axes == "own" else self.sheet.tracker.sigma_rad
        places = [np.full(3, table.sigma_mm) for table in self.sheet.markers.values()]
        return np.concatenate([np.full(3, turns), *places])

    def first_frames(self) -> tuple[Frames, Array]:
        """The axes of the base, or those in which the joints deflect best; what the nominal machine misses."""
        k = len(self.data.markers)
        frames = Frames(np.eye(3), np.zeros(3), np.zeros((k, 3)), np.tile(np.eye(3), (k, 1, 1)))
        forward = self.forward_of(self.machine, self.data)
        forward.members = self.members
        z = np.zeros(len(self.members))
        if self.sheet.tracker.axes == "own":
            frames = replace(frames, R=self._axes(forward.evaluate(z, frames)))
        return frames, self.distance(forward.evaluate(z, frames).residual)

    def _axes(self, linearised: Linearised) -> Array:
        """Axes ``(3, 3)`` in which springs of the joints, none negative, explain the displacements best.

        Springs and axes are found in turn from the 24 axes that are right-angled turns of the base's.
        """
        own = [i for i, member in enumerate(self.members) if member.family == COMPLIANCES[0]]
        seen = np.isfinite(self.data.position).all(axis=2)
        y = self.data.position[seen]
        modelled, J = y - linearised.residual[..., :3][seen], linearised.member[..., :3, :][seen][..., own]
        lower = np.array([self.members[i].low for i in own])
        best, axes = np.inf, np.eye(3)
        for order in itertools.permutations(range(3)):
            for signs in itertools.product((1.0, -1.0), repeat=3):
                Q = np.diag(signs)[:, order]
                if np.linalg.det(Q) < 0.0:
                    continue
                for _ in range(10):
                    c = springs_to(J.reshape(-1, len(own)), (y @ Q - modelled).reshape(-1), lower)
                    p = modelled + J @ c
                    U, _, Vt = np.linalg.svd(p.T @ y)
                    Q = Vt.T @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ U.T
                left = float(np.sum((y @ Q - p) ** 2))
                if left < best:
                    best, axes = left, Q
        return axes

    def stated(self) -> Array:
        """Standard deviations ``(g, k, 6)`` of the deflections."""
        said = np.empty((*self.data.sigma.shape[:2], 6))
        said[..., :3], said[..., 3:] = self.data.sigma, self.data.sigma_turn[..., None]
        return said

    def scatter(self, linearised: Linearised) -> Array:
        """Standard deviations ``(g, k, 6)``: the readings' own, all by one factor more where residuals show it.

        What a model lacks grows with the load as what it has, so that a factor is nearer than a sum.
        """
        said = self.stated()
        for half in (slice(0, 3), slice(3, 6)):
            over = np.abs(linearised.residual[..., half]) / said[..., half]
            if np.isfinite(over).any():
                said[..., half] *= max(median_sigma(over), 1.0)
        return said

    def misfits(self) -> tuple[Array, Array]:
        """Residuals once all compliances are fitted, over the readings' standard deviations; none without a fit."""
        try:
            state = self.gauss_newton(Hypothesis(tuple(f for f in COMPLIANCES if f in self.families)))
        except NoConvergenceError:
            return self.aligned * 0.0, self.aligned
        over = state.linearised.residual / self.scatter(state.linearised)
        return self.distance(over), self.distance(state.linearised.residual)

    def ends(self) -> dict[str, tuple[str, Array]]:
        """The markers' and loads' parts and places."""
        return ends_of_test(self.sheet)

    def at_candidates(self, state: FittedState, candidates: Candidates) -> Linearised:
        """The model at a state in other postures under other loads."""
        g = len(candidates)
        blank = self.data.only(np.zeros(g, dtype=int))
        data = replace(blank, q=candidates.q, load=candidates.load, row=np.arange(g))
        machine = self.machine_of(state.hypothesis.as_deflected)
        return self.of_others(self.members, machine, data).evaluate(state.z, state.frames)

    def of_others(
        self, members: Sequence[FamilyParameter], machine: PoseMachine, data: DeflectionData
    ) -> DeflectionForward:
        """The model of other readings; members that are functions of a torque are so of theirs."""
        forward = self.forward_of(machine, data)
        own: list[FamilyParameter] = []
        if any(m.basis is not None for m in members):
            own = members_of_loads(machine, data, forward, self.torques)
        basis, still = {m.name: m.basis for m in own}, np.zeros(len(data))
        forward.members = [m if m.basis is None else replace(m, basis=basis.get(m.name, still)) for m in members]
        return forward

    def under_loads(self, q: Array, rng: np.random.Generator) -> Candidates:
        """Each posture under one load: along one axis of one point, as large as the largest that was measured."""
        largest = np.abs(self.data.load).max(axis=0)
        used = np.argwhere(largest > 0.0)
        load = np.zeros((len(q), *largest.shape))
        for i in range(len(q)):
            point, axis = used[i % len(used)]
            load[i, point, axis] = largest[point, axis]
        return Candidates(q, load)


def ends_of_test(sheet: DeflectionSheet) -> dict[str, tuple[str, Array]]:
    """Points of a test's machine, the markers first; a load may bear the name of a marker."""
    return ends_of(sheet.markers) | {f"{name}~load": end for name, end in ends_of(sheet.loads).items()}


def springs_to(J: Array, y: Array, lower: Array) -> Array:
    """Sizes ``(n,)``, none below ``lower`` (n,), of columns ``J`` (r, n) that come nearest to ``y`` (r,)."""
    scale = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    return lower + nnls(J / scale, y - J @ lower)[0] / scale
