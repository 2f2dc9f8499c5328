"""Platforms by the thousand: the compiled equilibria against the whole machine's own, critical forces, refusals."""

import time
from functools import cache

import numpy as np
import pytest

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import EventKind
from vjm.io.manipulator_file import load_manipulator
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.platform.batch_equilibria import critical, packed_machine, platforms, weakest
from vjm.platform.problem import ManipulatorProblem
from vjm.vjm_engine import VjmEngine


@cache
def machine(name="orthoglide"):
    return packed_machine(load_manipulator(name), VjmEngine())


def label(pose):
    return ",".join(repr(float(v)) for v in pose)


@pytest.mark.parametrize("name", ["orthoglide", "3-puu"])
def test_compiled_platforms_are_the_whole_machines(robot, name):
    rng = np.random.default_rng(1)
    low, high = robot(name).workspace
    poses = np.hstack([rng.uniform(low, high, (4, 3)), np.zeros((4, 3))])
    wrenches = rng.standard_normal((4, 6)) * np.repeat([200.0, 2000.0], 3)
    engine = VjmEngine() if name == "orthoglide" else VjmEngine(2)
    found = platforms(packed_machine(robot(name), engine), poses, wrenches)
    assert found.solved.all()
    for k, pose in enumerate(poses):
        load = Load(tuple(wrenches[k]))
        load_case = LoadCase(label(pose), 1.0, "load", loads=(load,), free=COMPONENTS, steps=3)
        problem = ManipulatorProblem(robot(name), load_case, engine)
        point = follow(problem, load_case).points[-1]
        # the error measured is rounding alone
        assert found.drives[k] == pytest.approx(problem.model.pose.drives, abs=1e-8)
        assert found.displacement[k] == pytest.approx(point.displacement, abs=1e-7)
        assert np.abs(found.stiffness[k] - point.stiffness).max() < 1e-7 * np.abs(point.stiffness).max()
        size = np.linalg.norm(problem.leg_wrenches(point)[:, :3], axis=1)
        assert np.linalg.norm(found.forces[k, :, :3], axis=1) == pytest.approx(size, rel=1e-6)


def test_poses_out_of_reach_and_unstable_ones_are_no_answers():
    poses = np.array([[0.0, 0, 0, 0, 0, 0], [50.0, 0, 0, 0, 0, 0], [0, 300, 300, 0, 0, 0], [0, 0, 0, 0, 0, 0]])
    found = platforms(machine(), poses, np.array([[3000.0, 0, 0, 0, 0, 0]] * 3 + [[-3000.0, 0, 0, 0, 0, 0]]))
    assert found.why.tolist() == ["unstable", "unstable", "out of reach", ""]
    assert np.isnan(found.displacement[:3]).all()
    assert found.displacement[3, 0] == pytest.approx(-0.91, abs=0.01)


@pytest.mark.parametrize(("pose", "sign"), [("isotropic", 1), ("Q1", 1), ("Q2", 1)])
def test_critical_forces_are_those_of_the_path(robot, pose, sign):
    load_case = LoadCase(
        pose, sign * 4000.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),), free=COMPONENTS, control=TO_LIMIT
    )
    problem = ManipulatorProblem(robot("orthoglide"), load_case, VjmEngine())
    event = trace(problem, load_case, ArcControl(last=EventKind.BIFURCATION)).events[0]
    forces, found = critical(machine(), robot("orthoglide").displacement(pose), np.array([[sign, 0, 0]]), 2e4, 1e-6)
    assert found.all()
    assert forces[0] == pytest.approx(event.force, rel=1e-5)


def test_the_weakest_direction_is_weaker_than_any_of_many(robot):
    rng = np.random.default_rng(0)
    for pose in ("isotropic", "Q2"):
        displacement = robot("orthoglide").displacement(pose)
        found = weakest(machine(), displacement, 2e4)
        directions = rng.standard_normal((200, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        forces, hit = critical(machine(), displacement, directions, 2e4, 1e-3)
        # the intervals of two bisections
        assert found.force < forces[hit].min() * 1.002
        assert found.force > 0.97 * forces[hit].min()


def test_machines_with_bodies_between_are_refused(robot):
    with pytest.raises(ValueError, match="all run from base to platform"):
        packed_machine(robot("delta"), VjmEngine(1))
    with pytest.raises(ValueError, match="errors of assembly"):
        packed_machine(robot("orthoglide").with_offsets({"x": 0.1}), VjmEngine())


@pytest.mark.slow
def test_a_million_platforms_a_minute_on_two_cores(robot):
    # 120 µs of processor time each on either of two cores. The least of some runs: what other processes take from
    # the caches is not the code's
    rng = np.random.default_rng(0)
    axis = np.linspace(-73.65, 126.35, 21)
    grid = np.array(np.meshgrid(axis, axis, axis, indexing="ij")).reshape(3, -1).T[:1500]
    poses = np.hstack([grid, np.zeros_like(grid)])
    forces = np.zeros((len(poses), 6))
    forces[:, :3] = 150.0 * rng.standard_normal((len(poses), 3))
    platforms(machine(), poses[:2], forces[:2])
    spent = []
    for _ in range(8):
        started = time.process_time()
        found = platforms(machine(), poses, forces)
        spent.append((time.process_time() - started) / len(poses))
        assert found.solved.all()
    assert min(spent) < 120e-6
