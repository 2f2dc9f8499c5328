"""A test of loads or of deflections that sees one joint only, as the test of that joint that it is.

A machine of one elastic joint between rigid parts has a torque and a turn, however they were read. Where one load
and one displacement were read in one posture, they are these over two levers. So the same bench gives the same
answer in each of the three kinds of file that can hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np

from vjm.io.fields import rotation
from vjm.io.findings import Finding, Grade
from vjm.model.joints import Joint
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import Array, rotation_from_vector, translation, turn
from vjm_updating.constants import numerical
from vjm_updating.deflections.readings import DeflectionData, DeflectionSheet
from vjm_updating.experiment import Measurement, Readings
from vjm_updating.experiment.channels import EFFORT, MOTION, POSE, TEMPERATURE, TIME, WRENCH, split_point
from vjm_updating.experiment.measurement import check_joint, check_units, engine_of_sheet
from vjm_updating.experiment.nuisances import nuisances
from vjm_updating.experiment.sheet import Instrument, LeverTable, Sheet, Test
from vjm_updating.poses.kinds import PreparedTest

KNOWN_LOAD = numerical(1e-3)
"""Noise of a load that is known, over what the gauge's noise makes of one: a millionth of the variance."""
SMALL = numerical(1e-9)
"""Of a unit vector, or of the longest part: rounding."""


@dataclass(frozen=True)
class _OnlyJoint:
    """A machine whose only joint yields, in a posture.

    Attributes:
        joint: that one.
        axis: unit vector ``(3,)`` in the world.
        origin: a point of the axis ``(3,)``, mm.
        behind: frame ``(4, 4)`` behind each part that the joint carries, by its name, mm.
        last: name of the last part.
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
        column: its name in the file.
        values: ``(n,)``.
        point: where ``(3,)``, mm.
        direction: ``(6,)`` of a unit of the column, world axes.
        instrument: its errors.
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

    Args:
        test: by loads; or of deflections, whose rows stand in the order in which they were taken.

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
        at = bench.behind.get(where.body if where else bench.last)
        if at is None or (where is not None and where.at != 1.0):
            return None
        found, names = (loads, WRENCH) if channel in WRENCH else (gauges, POSE)
        own = _Channel(name, readings.values[name], at[:3, 3], np.eye(6)[names.index(channel)], sheet.errors(name))
        if np.nan_to_num(own.values).any():
            found.append(own)
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
        if (at := ends[name]) is None:
            return None
        axes = at[:3, :3] @ rotation(table.turns) if table.axes == "tool" else np.eye(3)
        point = (at @ translation(table.position_mm))[:3, 3]
        for k in np.flatnonzero(data.load[:, j].any(axis=0)).tolist():
            along = (np.eye(6)[k].reshape(2, 3) @ axes.T).ravel()
            loads.append(_Channel(f"{name}.{WRENCH[k]}", data.load[:, j, k], point, along, Instrument(noise=0.0)))
    for i, (name, marker) in enumerate(sheet.markers.items()):
        if (at := ends[name]) is None:
            return None
        point = (at @ translation(marker.position_mm))[:3, 3]
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
        alike = gauge.instrument.noise / (joint.compliance * abs(arms[0] * arms[1]))
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
    found = replace(
        test, sheet=own, readings=readings, nuisances=nuisances(own, readings.channels, test.chain),
        notes=(Finding(Grade.NOTED, sheet.file, said),),
    )  # fmt: skip
    try:
        check_joint(found)
        check_units(found)
    except ValueError as error:
        # in the file's own names
        raise type(error)(str(error).replace(effort, load.column).replace(motion, gauge.column)) from error
    return found


def _bench(machine: Machine, gravity: Sequence[float] | None, coordinate: float | None = None) -> _OnlyJoint | None:
    """A machine of one joint that yields about, or along, its axis; None of others, and where weight loads it.

    Args:
        machine: in a posture, where ``coordinate`` is not given.
        gravity: its direction in the world, any length; None where weight has acted before.
        coordinate: of the joint, mm or rad.
    """
    joints = [part for part in machine.parts if isinstance(part, Joint)]
    if len(joints) != 1 or machine.beams or machine.is_tree or machine.couplings:
        return None
    (joint,) = joints
    if not joint.held or joint.fixed or not joint.compliance or any(joint.lateral) or joint.preload:
        return None
    q = (joint.value or 0.0) if coordinate is None else coordinate
    T, at, weights = machine.base, machine.base, list[tuple[float, Array]]()
    behind: dict[str, Array] = {}
    for part in machine.parts:
        match part:
            case RigidOffset():
                centre = (T @ translation(part.centre_of_mass))[:3, 3]
                weights += [(part.mass, centre)] if behind else []
                T = T @ part.transform
            case Joint():
                at = T
                T = T @ (translation(part.axis * q) if part.slides else turn(part.axis, q))
            case Beam():
                return None
            case _:
                assert_never(part)
        if behind or part is joint:
            behind[part.name] = T
    bench = _OnlyJoint(joint, at[:3, :3] @ joint.axis, at[:3, 3], behind, machine.parts[-1].name)
    pull = np.zeros(3) if gravity is None else np.array(gravity, dtype=float)
    weighs = any(mass * abs(bench.motion(centre)[:3] @ pull) > SMALL for mass, centre in weights)
    return None if weighs or bench.last not in behind else bench
