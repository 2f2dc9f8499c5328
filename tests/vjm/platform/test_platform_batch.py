"""Batches of platforms: against paths of single ones, critical forces, refusals."""

from functools import cache

import numpy as np
import pytest
from helpers.first_losses import first_losses
from helpers.in_pose import in_pose

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.machine.critical_search import TOLERANCE
from vjm.machine.platforms import PlatformBatch, assembled, leg_wrenches
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase

SLACK = 2.0 * TOLERANCE
"""The tolerance is of the stiffness that is left, which falls about in a line with the force."""


@cache
def machine(name="orthoglide"):
    return PlatformBatch(load_model(name), VjmEngine())


def label(pose):
    return ",".join(repr(float(v)) for v in pose)


@pytest.mark.parametrize("name", ["orthoglide", "3-puu", "delta", "par2", "orthoglide-parallelograms"])
def test_a_batch_is_what_single_platforms_are(robot, name):
    rng = np.random.default_rng(1)
    low, high = robot(name).workspace
    poses = np.hstack([rng.uniform(low, high, (4, 3)), np.zeros((4, 3))])
    size = 20.0 if name in ("delta", "par2") else 200.0
    wrenches = rng.standard_normal((4, 6)) * np.repeat([size, 10.0 * size], 3)
    engine = VjmEngine() if name == "orthoglide" else VjmEngine(2)
    found = PlatformBatch(robot(name), engine).equilibria(poses, wrenches)
    assert found.solved.all()
    for k, pose in enumerate(poses):
        load = Load(tuple(wrenches[k]))
        load_case = LoadCase(label(pose), 1.0, "load", loads=(load,), free=COMPONENTS, steps=3)
        posed, load_case = in_pose(robot(name), load_case)
        problem = engine.problem(posed, load_case)
        point = follow(problem, load_case).points[-1]
        drives = list(posed.held[load_case.posture].values())
        # the error measured is rounding alone
        assert found.drives[k] == pytest.approx(drives, abs=1e-8)
        assert found.displacement[k] == pytest.approx(point.displacement, abs=1e-7)
        assert np.abs(found.stiffness[k] - point.stiffness).max() < 1e-7 * np.abs(point.stiffness).max()
        forces = leg_wrenches(problem, point)[:, :3]
        assert found.forces[k] == pytest.approx(forces, abs=1e-6 * np.abs(forces).max())


def test_poses_out_of_reach_and_unstable_ones_are_no_answers():
    poses = np.array([[0.0, 0, 0, 0, 0, 0], [50.0, 0, 0, 0, 0, 0], [0, 300, 300, 0, 0, 0], [0, 0, 0, 0, 0, 0]])
    found = machine().equilibria(poses, np.array([[3000.0, 0, 0, 0, 0, 0]] * 3 + [[-3000.0, 0, 0, 0, 0, 0]]))
    assert found.why.tolist() == ["unstable", "unstable", "out of reach", ""]
    assert np.isnan(found.displacement[:3]).all()
    assert found.displacement[3, 0] == pytest.approx(-0.91, abs=0.01)


@pytest.mark.parametrize("pose", ["Q1", "Q2"])
def test_along_the_weakest_direction_a_path_has_its_bifurcation(robot, pose):
    weak = machine().weakest(robot("orthoglide").poses[pose][None], 2e4)[0]
    load = Load((*weak.direction.tolist(), 0, 0, 0))
    load_case = LoadCase(pose, 2.0 * weak.force, "load", loads=(load,), free=COMPONENTS, control=TO_LIMIT)
    problem = VjmEngine().problem(*in_pose(robot("orthoglide"), load_case))
    event = trace(problem, load_case, ArcControl(last=EventKind.BIFURCATION)).events[0]
    assert weak.force == pytest.approx(event.force, rel=2e-5)


def in_corners():
    """Poses of the orthoglide that lie alike but for the names of its axes, three and three."""
    rows = [(-73.65, 126.35, 126.35), (-73.65, -73.65, 126.35), (-73.65, 126.35, 26.35), (26.35, 26.35, 126.35)]
    turned = [(row[k:] + row[:k]) for row in rows for k in range(3)]
    return np.hstack([turned, np.zeros((len(turned), 3))])


def test_poses_that_lie_alike_have_the_same_smallest_critical_force():
    """The orthoglide's legs are alike, so that turning the names of the axes changes nothing."""
    forces = np.array([weak.force for weak in machine().weakest(in_corners(), 2e4)]).reshape(-1, 3)
    assert np.isfinite(forces).all()
    assert forces == pytest.approx(np.tile(forces.min(axis=1)[:, None], (1, 3)), rel=SLACK)


def test_many_poses_at_once_have_the_smallest_critical_forces_of_single_ones():
    low, high = load_model("orthoglide").workspace
    poses = np.zeros((24, 6))
    poses[:, :3] = np.random.default_rng(4).uniform(low, high, (24, 3))
    for pose, weak in zip(poses, machine().weakest(poses, 2e4), strict=True):
        (alone,) = machine().weakest(pose[None], 2e4)
        assert not weak.why
        assert weak.force == pytest.approx(alone.force, rel=SLACK)
        assert weak.negative[0] == 0 < weak.negative[1]


def test_a_pose_far_out_has_the_smallest_critical_force_of_a_scan_over_directions():
    """The machine turns so far there that motions which took no force at first take much."""
    poses = np.array([[-70.0, 120.0, 120.0, 0.0, 0.0, 0.0]])
    q, _ = machine().closed(poses)
    (weak,) = machine().weakest(poses, 2e4)
    assert not weak.why
    # over the sphere in equal areas, then twice around the best
    k = np.arange(400) + 0.5
    height, angle = 1.0 - 2.0 * k / len(k), np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    around = np.column_stack([flat * np.cos(angle), flat * np.sin(angle), height])
    rng = np.random.default_rng(5)
    for width in (0.05, 0.01, 0.002):
        forces = first_losses(machine().model, q[0], around, 1.5 * weak.force)
        assert forces.min() > weak.force * (1.0 - 1e-4)
        best = around[np.argmin(forces)]
        around = best + width * rng.standard_normal((60, 3))
        around /= np.linalg.norm(around, axis=1)[:, None]
    # the force grows by the square of the angle from the best direction, of which the scan leaves some hundredths
    assert forces.min() == pytest.approx(weak.force, rel=1e-3)


@pytest.mark.parametrize("built", [{"too_long": {"x/link": 0.2}}, {"off": {"y": -0.3}}])
def test_a_machine_with_errors_of_assembly_stands_where_its_single_poses_do(robot, built):
    machine = robot("orthoglide")
    poses = np.array([[0.0, 0, 0, 0, 0, 0], [40.0, -20.0, 30.0, 0, 0, 0]])
    wrenches = np.array([[0.0] * 6, [-200.0, 100.0, 50.0, 0.0, 0.0, 0.0]])
    found = PlatformBatch(machine, VjmEngine(2), **built).equilibria(poses, wrenches)
    for pose, wrench, moved, K in zip(poses, wrenches, found.displacement, found.stiffness, strict=True):
        load = Load(tuple(wrench if wrench.any() else 1e-9 * np.eye(6)[0]))
        load_case = LoadCase(label(pose), 1.0, "load", loads=(load,), free=COMPONENTS, steps=2)
        posed, load_case = in_pose(machine, load_case)
        wrong = assembled(posed, **built)
        point = follow(VjmEngine(2).problem(wrong, load_case), load_case).points[-1]
        assert moved == pytest.approx(point.displacement, abs=1e-8)
        assert np.abs(K - point.stiffness).max() < 1e-7 * np.abs(K).max()
