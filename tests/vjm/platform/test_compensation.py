"""Compensation of loaded platforms: the error left by the rigid, the linear and the loaded model."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.compensation import compensated_arm
from vjm.engines import VjmEngine
from vjm.machine.inverse_kinematics import ReachError
from vjm.machine.platforms import assembled
from vjm.machine.rigid_mechanism import Closing, home_label
from vjm.model.parts import Joint


def compensated(machine, poses, wrenches):
    """Poses are from home; a platform of fewer freedoms turns as its loops let it."""
    home = Closing(machine, home_label(machine)).end[:3, 3]
    return compensated_arm(
        VjmEngine(1).model(machine), home + np.atleast_2d(poses)[:, :3], None, np.atleast_2d(wrenches)
    )


@pytest.mark.parametrize(("name", "pose"), [("orthoglide", "Q2"), ("3-puu", "side")])
def test_the_loaded_models_offsets_put_the_platform_where_it_should_be(robot, name, pose):
    machine = robot(name)
    wrench = np.array([-300.0, 200.0, 100.0, 0.0, 0.0, 0.0])
    found = compensated(machine, machine.poses[pose], wrench)
    rigid, linear, loaded = (np.linalg.norm(e[0, :3]) for e in (found.rigid, found.linear, found.loaded))
    # the search stops at 1e-9 of the machine's reach
    assert loaded < 1e-5
    # the linear model leaves what is of the second order in the deflection
    assert loaded < linear < 0.1 * rigid
    # a platform that the drives only shift keeps the turn that its load gives it
    assert np.abs(found.loaded[0, 3:]).max() > 1e-6
    assert {joint.name for joint in machine.held_joints} <= set(found.joints)


def test_many_poses_of_a_machine_built_wrong_are_compensated_at_once(robot):
    machine = assembled(robot("orthoglide"), {"x/link": 0.2})
    poses = np.array([[0.0, 0, 0, 0, 0, 0], [40.0, -20.0, 30.0, 0, 0, 0]])
    wrenches = np.array([[-200.0, 100.0, 50.0, 0, 0, 0], [0.0, 0.0, -300.0, 0, 0, 0]])
    found = compensated(machine, poses, wrenches)
    assert np.linalg.norm(found.loaded[:, :3], axis=1).max() < 1e-5
    for k in range(2):
        alone = compensated(machine, poses[k], wrenches[k])
        # both searches stop at 1e-9 of the machine's reach
        assert alone.q_loaded[0] == pytest.approx(found.q_loaded[k], abs=1e-5)


def test_a_robot_with_revolute_drives(robot):
    machine = robot("delta")
    found = compensated(machine, machine.poses["side"], np.array([10.0, 0, -20.0, 0, 0, 0]))
    assert np.linalg.norm(found.loaded[0, :3]) < 1e-5
    assert np.linalg.norm(found.rigid[0, :3]) > 1e-3


def test_no_drive_is_sent_beyond_its_limits(robot):
    """Limits between what the rigid and the loaded machine ask of a drive: the loaded pose is refused."""
    machine, wrench = robot("3-puu"), np.array([-300.0, 200.0, 100.0, 0.0, 0.0, 0.0])
    pose = machine.poses["side"]
    found = compensated(machine, pose, wrench)
    held = [joint.name for joint in machine.held_joints]
    columns = [found.joints.index(name) for name in held]
    rigid, loaded = found.q[0, columns], found.q_loaded[0, columns]
    offsets, edges = loaded - rigid, 0.5 * (rigid + loaded)
    # one whose limits home, at zero, keeps
    k = int(np.argmax(offsets * edges > 0.0))
    name, offset, edge = held[k], offsets[k], edges[k]
    assert offset * edge > 0.0
    limits = (-1e3, edge) if offset > 0.0 else (edge, 1e3)
    parts = tuple(
        replace(part, limits=limits) if isinstance(part, Joint) and part.name == name else part
        for part in machine.parts
    )
    with pytest.raises(ReachError, match=rf"{name} = .* by {0.5 * abs(offset):.3g}\d* mm"):
        compensated(replace(machine, parts=parts), pose, wrench)
