"""Rigid manipulators: inverse kinematics against closed forms, mobility as theory says, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.io.manipulator_file import manipulators
from vjm.machine.rigid_mechanism import Closing, PoseError, home_label, moved_by_drives
from vjm.model.machine import ROOT
from vjm.model.parts import RigidOffset
from vjm.rotations import frame, rotation_from_vector

LENGTH = 310.0
MOBILITY = {
    # freedom of the platform; constraints too many. One bar between universal joints leaves two constraints a leg
    "orthoglide": (3, 0),
    "3-puu": (3, 0),
    # two turns held by each leg, three of six too many
    "isoglide": (3, 3),
    # three for each planar parallelogram, and one turn of three that each leg holds and one would do
    "orthoglide-parallelograms": (3, 12),
    "parallelogram": (1, 3),
    # Grübler: six rods hold six freedoms; eight rods and a coupling hold six of the platform and two free arms
    "delta": (3, 0),
    "par2": (2, 1),
}


def closing(machine):
    return Closing(machine, home_label(machine))


def rates(manipulator, displacement):
    """Motions of the platform by its drives, mm and rad by mm and rad."""
    there = closing(manipulator)
    unit, length = there.tree.unit[~there.tree.passive], there.tree.length
    moved = moved_by_drives(there.tree, there.displaced(np.asarray(displacement, dtype=float))[None])[0]
    return moved * np.repeat([length, 1.0], 3)[:, None] / unit


def drives(manipulator, displacement):
    """Coordinates of the drives, in the legs' order."""
    there = closing(manipulator)
    q = dict(zip(there.tree.names, there.displaced(np.asarray(displacement, dtype=float)).tolist(), strict=True))
    return [q[joint.name] for joint in manipulator.held_joints]


@pytest.mark.parametrize("p", [(0, 0, 0), (40, -30, 60), (-73.65, -73.65, -73.65), (126.35, 126.35, 126.35)])
def test_the_orthoglides_drives_are_those_of_its_closed_form(robot, p):
    # Wenger and Chablat 2000: ρ_x = x − √(L² − y² − z²), counted here from the isotropic point; the
    # chain's base is given to 1e-6 mm
    found = drives(robot("orthoglide"), [*p, 0, 0, 0])
    square = np.sum(np.square(p)) - np.square(p)
    assert found == pytest.approx(np.array(p) - np.sqrt(LENGTH**2 - square) + LENGTH, abs=1e-6)


@pytest.mark.parametrize(
    ("corner", "share", "derived"), [("Q1", -0.25, -LENGTH / 18**0.5), ("Q2", 0.5, LENGTH / 6**0.5)]
)
def test_the_orthoglides_workspace_is_the_one_of_its_design_criterion(robot, corner, share, derived):
    # Chablat and Wenger 2003: velocity transmission factors from 1/2 to 2; on the diagonal they are 1/(1+2t) and
    # 1/(1−t) with t = c/√(L² − 2c²). The corners in the file are quoted: they lie within 0.6 mm of the derived ones
    machine = robot("orthoglide")
    c = float(machine.poses[corner][0])
    assert np.ptp(machine.workspace, axis=0) == pytest.approx(np.full(3, 200.0))
    assert c == pytest.approx(derived, abs=0.6)
    factors = {}
    for at in (c, derived):
        # each drive's platform motions are shifts alone, mm by mm
        found = np.linalg.svd(rates(machine, [at] * 3 + [0.0] * 3)[:3], compute_uv=False)
        t = at / np.sqrt(LENGTH**2 - 2.0 * at**2)
        assert np.sort(found) == pytest.approx(np.sort(np.abs([1 / (1 + 2 * t), 1 / (1 - t), 1 / (1 - t)])))
        factors[at] = found
    assert share == pytest.approx(derived / np.sqrt(LENGTH**2 - 2.0 * derived**2))
    # at the derived corner the largest is 2; at the far one the smallest is 1/2 too
    assert factors[derived].max() == pytest.approx(2.0)
    assert factors[c].max() == pytest.approx(2.0, rel=0.01)
    assert factors[c].min() == pytest.approx({"Q1": 0.8, "Q2": 0.5}[corner], rel=0.01)


def test_the_deltas_arms_stand_where_its_closed_form_has_them(robot):
    # Williams 2016: each arm's end lies on the circle of the arm and the sphere of the rods
    machine = robot("delta")
    for label in machine.poses:
        p = machine.poses[label][:3] + closing(machine).end[:3, 3]
        turned = drives(machine, machine.poses[label])
        for leg, angle in enumerate(turned):
            turn = rotation_from_vector([0.0, 0.0, 2.0 * np.pi * leg / 3.0])
            near = np.array([np.sqrt(3.0) / 6.0 * 567.0 + 524.0 * np.cos(angle), 0.0, -524.0 * np.sin(angle)])
            far = turn.T @ p + [np.sqrt(3.0) / 3.0 * 76.0, 0.0, 0.0]
            # the error measured is 7e-9
            assert np.linalg.norm(far - near) == pytest.approx(1244.0, abs=2e-7)


def test_each_drive_of_the_isoglide_is_one_coordinate(robot):
    # Gogu 2004: the Jacobian is the unit matrix everywhere
    machine = robot("isoglide")
    for label in machine.poses:
        p = machine.poses[label]
        # the file's home posture is given to 1e-9 rad, which is 3e-7 mm at a bar's end
        assert drives(machine, p) == pytest.approx(p[:3], abs=1e-6)
        assert rates(machine, p)[:3] == pytest.approx(np.eye(3), abs=1e-8)


@pytest.mark.parametrize("name", [entry.name for entry in manipulators()])
def test_mobility_is_as_theory_says(robot, name):
    machine = robot(name)
    for label in machine.poses:
        found = closing(machine).mobility(closing(machine).displaced(machine.poses[label]))
        assert (found.freedom, found.redundant) == MOBILITY[name]
        assert found.idle_freedom == 0
        assert found.loose.shape[1] == (1 if name == "parallelogram" else 0)


def test_forward_kinematics_takes_inverse_kinematics_back(robot):
    machine = closing(robot("orthoglide"))
    there = machine.displaced(np.array([10.0, 20.0, -15.0, 0, 0, 0]))
    names = ("x", "y", "z")
    back = machine.held({name: float(there[machine.tree.names.index(name)]) for name in names})
    # the error measured is rounding alone
    assert back == pytest.approx(there, abs=1e-9)


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ((300, 300, 0, 0, 0, 0), "out of reach: closure '[yz]' stays .* open"),
        ((0, 0, 0, 0, 0, 0.2), "out of reach: "),
        # beyond the singular point L/√3 = 178.98 the platform answers its drives the other way
        ((180, 180, 180, 0, 0, 0), "another branch"),
    ],
)
def test_poses_that_cannot_be_taken_are_refused_with_the_reason(robot, pose, words):
    with pytest.raises(PoseError, match=words):
        closing(robot("orthoglide")).displaced(np.array(pose, dtype=float))


def test_a_singular_pose_is_refused_with_the_motion_that_is_loose(robot):
    c = LENGTH / np.sqrt(3.0)
    with pytest.raises(PoseError, match=r"singular: with all drives held the end-effector still moves by"):
        closing(robot("orthoglide")).displaced(np.array([c, c, c, 0, 0, 0]))


def test_a_drive_beyond_its_limits_is_named(robot):
    with pytest.raises(PoseError, match=r"out of reach: a = .* its limit .* by .* (mm|rad)"):
        closing(robot("3-puu")).displaced(np.array([0, 0, -250.0, 0, 0, 0]))


def test_two_bases_at_odds_do_not_close(robot):
    machine = robot("orthoglide")
    turned = frame(rotation_from_vector([0.0, 0.0, 0.5]))
    parts = [
        replace(part, transform=turned @ part.transform)
        if isinstance(part, RigidOffset) and part.name == f"x/{ROOT}"
        else part
        for part in machine.parts
    ]
    with pytest.raises(PoseError, match=r"closure 'y' does not close at home: its frames are .* mm and 0\.5 rad"):
        closing(replace(machine, parts=tuple(parts)))
