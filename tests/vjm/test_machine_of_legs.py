"""A manipulator of legs as one machine: its loops close, and every point of it is where the legs put it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from vjm.io.machine_file import build_machine, load_model
from vjm.io.manipulator_file import manipulators
from vjm.io.model_file import written_document
from vjm.machine.platforms import assembled
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part, RigidOffset
from vjm.rotations import Array, displaced, displacement_between, translation, turn

ROBOTS = [entry.name for entry in manipulators()]
CLOSES = 1e-10
"""rad, and lengths over the characteristic one: the closing stops at 1e-11, and a few gaps add up along a leg."""


def frames_behind(machine: Machine, label: str) -> dict[str, Array]:
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


def gaps(machine: Machine, label: str) -> Array:
    """Gap ``(c, 6)`` of each closure, lengths over the machine's, and rad."""
    frames = frames_behind(machine, label)
    rows = []
    for closure in machine.closures:
        a, b = (frames[part] @ T for part, T in zip(closure.parts, closure.frames, strict=True))
        rows.append(displacement_between(b, a) / np.repeat([machine.characteristic_length, 1.0], 3))
    return np.array(rows)


def apart(machine: Machine, first: Array, second: Array) -> float:
    """How far two frames are apart: rad, or lengths over the machine's."""
    gap = displacement_between(first, second) / np.repeat([machine.characteristic_length, 1.0], 3)
    return float(np.abs(gap).max())


@pytest.fixture(scope="module", params=ROBOTS)
def machine(request: pytest.FixtureRequest) -> Machine:
    return load_model(str(request.param))


def test_loops_close_in_every_pose(machine: Machine) -> None:
    for label in machine.postures:
        assert np.abs(gaps(machine, label)).max() < CLOSES, label


def test_platform_is_where_the_pose_has_it(machine: Machine) -> None:
    table = written_document(machine.name).content.get("platform", {})
    home = translation(table.get("position_mm", [0.0, 0.0, 0.0]))
    assert not table.get("turns")
    for label, displacement in machine.poses.items():
        end = frames_behind(machine, label)[machine.parts[-1].name]
        assert apart(machine, end, displaced(home, displacement)) < CLOSES, label


def test_a_beam_too_long_leaves_a_gap_of_its_error() -> None:
    nominal = load_model("orthoglide")
    machine = assembled(nominal, {"y/link": 0.5})
    assert np.abs(gaps(nominal, "isotropic")).max() < CLOSES
    open_by = gaps(machine, "isotropic")
    names = [closure.name for closure in machine.closures]
    assert np.linalg.norm(open_by[names.index("y"), :3]) * machine.characteristic_length == pytest.approx(
        0.5, rel=1e-6
    )
    assert np.abs(np.delete(open_by, names.index("y"), axis=0)).max() < CLOSES


def test_a_drive_that_is_off_stands_at_another_coordinate() -> None:
    nominal = load_model("orthoglide")
    machine = assembled(nominal, off={"x": -0.25})
    for label in nominal.poses:
        assert machine.held[label]["x"] - nominal.held[label]["x"] == pytest.approx(-0.25, abs=1e-12)
        assert machine.held[label]["y"] == nominal.held[label]["y"]
    open_by = np.linalg.norm(gaps(machine, "isotropic")[:, :3], axis=1) * machine.characteristic_length
    # the drive carries the platform on its leg, so that both other legs stay short
    assert open_by == pytest.approx([0.25, 0.25], rel=1e-6)


def test_coupled_joints_keep_their_sum() -> None:
    machine = load_model("par2")
    (coupling,) = machine.couplings
    names = [joint.name for joint in machine.joints]
    for label in machine.postures:
        q = machine.posture(label)
        total = sum(weight * q[names.index(joint)] for joint, weight in coupling.terms)
        assert total == pytest.approx(coupling.total, abs=1e-10), label


def test_a_leg_keeps_the_numbers_of_springs_of_its_file() -> None:
    """Of two chains with other numbers a machine cannot say one for all its beams."""
    document = written_document("orthoglide")
    chain = written_document("orthoglide-chain")
    three = chain._replace(content=chain.content | {"springs": {"link_segments": 3}})
    legs = [dict(leg) for leg in document.content["legs"]]
    legs[0]["chain"] = "three"
    content = document.content | {"legs": legs}
    machine = build_machine(document._replace(content=content), {"orthoglide-chain": chain, "three": three})
    original = {beam.name: beam.own_segments for beam in load_model("orthoglide-chain").beams}
    beams = {beam.name: beam.own_segments for beam in machine.beams}
    assert {name: beams[f"x/{name}"] for name in original} == {n: k or 3 for n, k in original.items()}
