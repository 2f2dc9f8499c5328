"""A manipulator of legs as one machine: its loops close, and every point of it is where the legs put it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from vjm.io.manipulator_file import load_manipulator, manipulators
from vjm.machine.legs import machine_of
from vjm.model.chain import Chain
from vjm.model.parts import Beam, Part, RigidOffset
from vjm.platform.manipulator import Manipulator
from vjm.rotations import Array, displaced, displacement_between, translation, turn

ROBOTS = [entry.name for entry in manipulators()]
CLOSES = 1e-10
"""rad, and lengths over the characteristic one: the closing stops at 1e-11, and a few gaps add up along a leg."""


def frames_behind(machine: Chain, label: str) -> dict[str, Array]:
    """Frame ``(4, 4)`` behind each part of the rigid machine, by the parts' own motions one after the other."""
    values = dict(zip((joint.name for joint in machine.joints), machine.posture(label), strict=True))
    values |= machine.held[label]
    frames, before = {"": machine.base}, ""
    for part in machine.parts:
        frames[part.name] = frames[machine.after.get(part.name, before)] @ through(part, values)
        before = part.name
    return frames


def through(part: Part, values: Mapping[str, float]) -> Array:
    """Frame ``(4, 4)`` behind a rigid part from before it, joints at coordinates by name."""
    if isinstance(part, RigidOffset):
        return part.transform
    if isinstance(part, Beam):
        return translation(part.tip)
    if part.fixed:
        return np.eye(4)
    value = values[part.name]
    return translation(value * part.axis) if part.slides else turn(part.axis, value)


def gaps(machine: Chain, label: str) -> Array:
    """Gap ``(c, 6)`` of each closure, lengths over the machine's, and rad."""
    frames = frames_behind(machine, label)
    rows = []
    for closure in machine.closures:
        a, b = (frames[part] @ T for part, T in zip(closure.parts, closure.frames, strict=True))
        rows.append(displacement_between(b, a) / np.repeat([machine.characteristic_length, 1.0], 3))
    return np.array(rows)


def apart(machine: Chain, first: Array, second: Array) -> float:
    """How far two frames are apart: rad, or lengths over the machine's."""
    gap = displacement_between(first, second) / np.repeat([machine.characteristic_length, 1.0], 3)
    return float(np.abs(gap).max())


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> tuple[Manipulator, Chain]:
    manipulator = load_manipulator(str(request.param))
    return manipulator, machine_of(manipulator)


def test_loops_close_in_every_pose(robot: tuple[Manipulator, Chain]) -> None:
    _, machine = robot
    for label in machine.postures:
        assert np.abs(gaps(machine, label)).max() < CLOSES, label


def test_platform_is_where_the_pose_has_it(robot: tuple[Manipulator, Chain]) -> None:
    manipulator, machine = robot
    for label, displacement in manipulator.poses.items():
        end = frames_behind(machine, label)[machine.parts[-1].name]
        assert apart(machine, end, displaced(manipulator.home, displacement)) < CLOSES, label


def test_a_beam_too_long_leaves_a_gap_of_its_error() -> None:
    manipulator = load_manipulator("orthoglide").with_errors({"y": {"link": 0.5}})
    machine = machine_of(manipulator)
    nominal = machine_of(replace(manipulator, errors={}))
    assert np.abs(gaps(nominal, "isotropic")).max() < CLOSES
    open_by = gaps(machine, "isotropic")
    names = [closure.name for closure in machine.closures]
    assert np.linalg.norm(open_by[names.index("y"), :3]) * machine.characteristic_length == pytest.approx(
        0.5, rel=1e-6
    )
    assert np.abs(np.delete(open_by, names.index("y"), axis=0)).max() < CLOSES


def test_a_drive_that_is_off_stands_at_another_coordinate() -> None:
    manipulator = load_manipulator("orthoglide").with_offsets({"x": -0.25})
    machine = machine_of(manipulator)
    nominal = machine_of(replace(manipulator, offsets={}))
    for label in manipulator.poses:
        assert machine.held[label]["x"] - nominal.held[label]["x"] == pytest.approx(-0.25, abs=1e-12)
        assert machine.held[label]["y"] == nominal.held[label]["y"]
    open_by = np.linalg.norm(gaps(machine, "isotropic")[:, :3], axis=1) * machine.characteristic_length
    # the drive carries the platform on its leg, so that both other legs stay short
    assert open_by == pytest.approx([0.25, 0.25], rel=1e-6)


def test_coupled_joints_keep_their_sum() -> None:
    machine = machine_of(load_manipulator("par2"))
    (coupling,) = machine.couplings
    names = [joint.name for joint in machine.joints]
    for label in machine.postures:
        q = machine.posture(label)
        total = sum(weight * q[names.index(joint)] for joint, weight in coupling.terms)
        assert total == pytest.approx(coupling.total, abs=1e-10), label


def test_a_leg_keeps_the_numbers_of_springs_of_its_file() -> None:
    manipulator = load_manipulator("orthoglide")
    first, *others = manipulator.legs
    three = replace(first, chain=replace(first.chain, link_segments=3))
    machine = machine_of(replace(manipulator, legs=(three, *others)))
    beams = {beam.name: beam.own_segments for beam in machine.beams}
    original = {beam.name: beam.own_segments for beam in first.chain.beams}
    assert {name: beams[f"{first.name}/{name}"] for name in original} == {n: k or 3 for n, k in original.items()}
    assert {beams[f"{others[0].name}/{name}"] for name in original} == set(original.values())
