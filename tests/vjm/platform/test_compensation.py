"""Compensation of loaded platforms: the error left by the rigid, the linear and the loaded model."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.machine.closing import PoseError
from vjm.machine.compensation import compensated_platform
from vjm.vjm_engine import VjmEngine


def compensated(machine, pose, wrench):
    return compensated_platform(machine, pose[None], wrench[None], VjmEngine(1))


@pytest.mark.parametrize(("name", "pose"), [("orthoglide", "Q2"), ("3-puu", "side")])
def test_the_loaded_models_offsets_put_the_platform_where_it_should_be(robot, name, pose):
    machine = robot(name)
    wrench = np.array([-300.0, 200.0, 100.0, 0.0, 0.0, 0.0])
    found = compensated(machine, machine.displacement(pose), wrench)
    rigid, linear, loaded = (np.linalg.norm(e[0, :3]) for e in (found.rigid, found.linear, found.loaded))
    assert loaded < 1e-7
    # the linear model leaves what is of the second order in the deflection
    assert loaded < linear < 0.1 * rigid
    # a platform that the drives only shift keeps the turn that its load gives it
    assert np.abs(found.loaded[0, 3:]).max() > 1e-6
    assert set(found.joints) == {leg.name for leg in machine.legs if leg.drive}


def test_a_drives_own_offset_is_taken_back(robot):
    machine = robot("orthoglide").with_offsets({"y": 0.25})
    wrench = np.array([0.0, 0.0, 1e-3, 0.0, 0.0, 0.0])
    found = compensated(machine, np.zeros(6), wrench)
    # the error measured is rounding alone
    assert found.rigid[0, 1] == pytest.approx(0.25, abs=6e-9)
    # the error measured is rounding alone
    y = found.joints.index("y")
    assert found.q_loaded[0, y] == pytest.approx(found.q[0, y], abs=1e-9)


def test_many_poses_of_a_machine_built_wrong_are_compensated_at_once(robot):
    machine = robot("orthoglide").with_errors({"x": {"link": 0.2}})
    poses = np.array([[0.0, 0, 0, 0, 0, 0], [40.0, -20.0, 30.0, 0, 0, 0]])
    wrenches = np.array([[-200.0, 100.0, 50.0, 0, 0, 0], [0.0, 0.0, -300.0, 0, 0, 0]])
    found = compensated_platform(machine, poses, wrenches, VjmEngine(1))
    assert np.linalg.norm(found.loaded[:, :3], axis=1).max() < 1e-7
    # the linear model knows the design alone: the error of the beam is left
    assert np.abs(found.linear[:, 0] - 0.2).max() < 0.05
    for k in range(2):
        alone = compensated(machine, poses[k], wrenches[k])
        assert alone.q_loaded[0] == pytest.approx(found.q_loaded[k], abs=1e-8)


def test_a_robot_with_revolute_drives(robot):
    machine = robot("delta")
    found = compensated(machine, machine.displacement("side"), np.array([10.0, 0, -20.0, 0, 0, 0]))
    assert np.linalg.norm(found.loaded[0, :3]) < 1e-7
    assert np.linalg.norm(found.rigid[0, :3]) > 1e-3


def test_no_drive_is_sent_beyond_its_limits(robot):
    """Limits between what the rigid and the loaded machine ask of a drive: the loaded pose is refused."""
    machine, wrench = robot("3-puu"), np.array([-300.0, 200.0, 100.0, 0.0, 0.0, 0.0])
    pose = machine.displacement("side")
    found = compensated(machine, pose, wrench)
    offsets, edges = found.q_loaded[0] - found.q[0], 0.5 * (found.q[0] + found.q_loaded[0])
    # one whose limits home, at zero, keeps
    k = int(np.argmax(offsets * edges > 0.0))
    leg, offset, edge = machine.leg(found.joints[k]), offsets[k], edges[k]
    assert offset * edge > 0.0
    limits = (-np.inf, edge) if offset > 0.0 else (edge, np.inf)
    tight = replace(leg, drive=replace(leg.drive, limits=limits))
    legs = tuple(tight if each.name == leg.name else each for each in machine.legs)
    with pytest.raises(PoseError, match=rf"the drive of leg '{leg.name}' = .* by {0.5 * abs(offset):.3g}\d* mm"):
        compensated(replace(machine, legs=legs), pose, wrench)


def test_a_mechanism_without_drives_is_refused(robot):
    with pytest.raises(ValueError, match="drives do not match"):
        compensated(robot("parallelogram"), np.zeros(6), np.eye(6)[0])
