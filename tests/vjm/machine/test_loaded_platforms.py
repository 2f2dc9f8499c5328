"""Loaded manipulators: the paper's sum, the converse, critical points, errors of assembly."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.first_losses import first_losses
from helpers.in_pose import in_pose
from helpers.legs import leg_alone

import vjm
from vjm.compensation import compensated_arm
from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.machine.critical_force import CriticalForce
from vjm.machine.critical_search import TOLERANCE
from vjm.machine.equilibria import equilibria
from vjm.machine.inverse_kinematics import ReachError
from vjm.machine.platforms import assembled, leg_wrenches, yielding_legs
from vjm.machine.rigid_mechanism import LoopClosure, home_label
from vjm.model.load_case import ARC, COMPONENTS, TO_LIMIT, Load, LoadCase, PointControl
from vjm.model.parts import Joint
from vjm.rotations import displaced, displacement_between, rotation_from_vector, skew
from vjm.statics import solve_newton, unloaded_stiffness

RAMP_ALL = (0.3, 0.2, 0.1, 2e-3, -1e-3, 1e-3)
SOME_WRENCH = {"orthoglide": 200.0, "3-puu": 300.0, "delta": 30.0, "par2": 30.0}


def differences(problem, at, target, step):
    """Derivative (6, 6) of the platform's wrench by its displacement, central differences of the sixth order."""
    result = np.zeros((6, 6))
    for k, h in enumerate(np.repeat([step, step / 200.0], 3)):

        def wrench(times, k=k, h=h):
            move = np.zeros(6)
            move[k] = times * h
            return solve_newton(problem.model, displaced(target, move), at.x, at.wrench).wrench

        near, next_, far = (wrench(n) - wrench(-n) for n in (1, 2, 3))
        result[:, k] = (45.0 * near - 9.0 * next_ + far) / (60.0 * h)
    return result


def alone(machine, engine, label, leg, displacement):
    """Stiffness at the platform of a leg from the base, a chain of its own, and that chain's equilibrium."""
    displacement = np.asarray(displacement)
    chain, attachment = leg_alone(machine, leg)
    home = LoopClosure(machine, label).end
    there = displaced(home, displacement)
    if np.any(displacement):
        way = displacement_between(home @ attachment, there @ attachment)
        point = engine.trace(chain, LoadCase(label, 1.0, axis=tuple(way), steps=2)).points[-1]
    else:
        point = engine.problem(chain, LoadCase(label, 1.0)).unloaded()
    lever = -skew((there @ attachment)[:3, 3] - there[:3, 3])
    A = np.block([[np.eye(3), lever], [np.zeros((3, 3)), np.eye(3)]])
    K = A.T @ point.stiffness @ A
    K[3:, 3:] -= skew(point.wrench[:3]) @ lever
    return K, point


@pytest.mark.parametrize("name", ["orthoglide", "orthoglide-parallelograms", "3-puu", "delta", "par2"])
def test_the_stiffness_is_the_platforms_own_differences(robot, name):
    machine = robot(name)
    label = list(machine.poses)[1]
    load_case = LoadCase(label, 1.0, axis=RAMP_ALL, steps=1)
    problem = VjmEngine(2).problem(*in_pose(machine, load_case))
    unit = np.repeat([1.0, machine.characteristic_length], 3)
    for point in (problem.unloaded(), problem.solve(1.0, problem.unloaded())):
        at = problem.configuration(point)
        K = problem.model.compiled.end_stiffness(at.x, at.wrench)
        wrong = K - differences(problem, at, problem.target(point.ramp), 0.02)
        scale = np.abs(K / unit[:, None] / unit).max()
        assert np.abs(wrong / unit[:, None] / unit).max() < 1e-9 * scale


def test_the_platforms_stiffness_is_the_sum_over_its_chains(robot):
    # K^F = Σ K_i^F, the paper after (18): unloaded and in a loaded state
    machine = robot("orthoglide")
    problem = VjmEngine().problem(*in_pose(machine, LoadCase("Q2", 0.5, axis=RAMP_ALL, steps=1)))
    for point in (problem.unloaded(), problem.solve(0.5, problem.unloaded())):
        parts = [alone(machine, VjmEngine(), "Q2", leg, point.displacement)[0] for leg in "xyz"]
        assert np.abs(sum(parts) - point.stiffness).max() < 1e-10 * np.abs(point.stiffness).max()
        for K in parts:
            assert np.linalg.matrix_rank(K / np.outer(*2 * [np.repeat([1.0, 310.0], 3)]), 1e-9) < 6


def test_at_the_isotropic_point_each_axis_has_the_chains_own_stiffness(robot, chain):
    found = vjm.stiffness(robot("orthoglide"), "isotropic", engine=VjmEngine()).loaded
    alone = unloaded_stiffness(VjmEngine().model(chain), chain.posture("A"))
    # the others' parallelograms lie across: one of them resists a shift by nothing, being hinged at both ends
    assert np.diag(found)[:3] == pytest.approx(np.full(3, alone[0, 0]), rel=1e-8)  # the base's seventh digit


@pytest.mark.parametrize("name", SOME_WRENCH)
def test_an_external_wrench_is_the_converse_of_an_imposed_pose(robot, name):
    machine = robot(name)
    label = list(machine.poses)[1]
    wrench = SOME_WRENCH[name] * np.array([1.0, -0.5, 0.7, 10.0, 20.0, -30.0])
    free = LoadCase(label, 1.0, "load", loads=(Load(tuple(wrench)),), free=COMPONENTS, steps=2)
    point = follow(VjmEngine(2).problem(*in_pose(machine, free)), free).points[-1]
    assert point.unstable == 0
    assert point.wrench == pytest.approx(wrench)
    held = VjmEngine(2).problem(*in_pose(machine, LoadCase(label, 1.0, axis=tuple(point.displacement), steps=2)))
    back = follow(held, held.load_case).points[-1]
    size = np.repeat([np.abs(wrench[:3]).max(), np.abs(wrench[:3]).max() * machine.characteristic_length], 3)
    # the error measured is rounding alone
    assert (back.wrench - wrench) / size == pytest.approx(np.zeros(6), abs=1e-9)


def test_pulled_along_its_axis_the_robot_of_the_papers_chains_buckles_in_tension(robot):
    # the artefact of the single spring at the link's end: the chain's own 2696 N, and nothing in compression
    engine, machine = VjmEngine(), robot("orthoglide")
    found, problems = {}, {}
    for sign in (1, -1):
        load_case = LoadCase(
            "isotropic", sign * 3000.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),), free=COMPONENTS, control=ARC
        )
        problems[sign] = engine.problem(*in_pose(machine, load_case))
        path = engine.trace(*in_pose(machine, load_case))
        found[sign] = [event for event in path.events if event.kind is EventKind.BIFURCATION]
        assert path.complete
    assert not found[-1]
    # the error measured is 3e-7
    assert found[1][0].force == pytest.approx(2696.2, rel=5e-6)
    assert found[1][0].switched
    share = yielding_legs(problems[1], found[1][0].point)
    assert share["x"] > 0.99


def test_refined_chains_buckle_in_compression_and_the_held_robot_goes_on(robot):
    # 8849 N, the chain's own: the two other legs lie across and help neither before nor behind
    engine, machine = VjmEngine(4), robot("orthoglide")
    path = engine.trace(*in_pose(machine, LoadCase("isotropic", -3.5)))
    event = path.critical
    assert event is not None
    assert event.kind is EventKind.BIFURCATION
    assert event.force == pytest.approx(8849.0, rel=5e-4)
    assert event.switched
    assert path.complete
    assert np.all(path.unstable <= 0)


def test_a_chain_may_be_past_its_own_critical_force_while_the_robot_is_stable(robot):
    # alone, its end let go under the same force, the pressed chain moves away at once: its K_i^F is indefinite
    load_case = LoadCase(
        "isotropic", -5000.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),), free=COMPONENTS, steps=4
    )
    machine = robot("orthoglide")
    point = follow(VjmEngine(4).problem(*in_pose(machine, load_case)), load_case).points[-1]
    pressed, _ = alone(machine, VjmEngine(4), "isotropic", "x", point.displacement)
    lowest = np.linalg.eigvalsh(0.5 * (pressed + pressed.T)[:3, :3])[0]
    assert lowest == pytest.approx(-5000.0 / 310.0, rel=0.05)
    assert point.unstable == 0
    assert np.linalg.eigvalsh(0.5 * (point.stiffness + point.stiffness.T))[0] > 0.0


def test_a_chain_too_long_shifts_an_isostatic_robot_and_strains_an_overconstrained_one(robot):
    free = LoadCase("isotropic", 1.0, "load", loads=(Load((1e-3, 0, 0, 0, 0, 0)),), free=COMPONENTS, steps=1)
    plain = assembled(robot("orthoglide"), {"x/link": 0.2})
    problem = VjmEngine(2).problem(*in_pose(plain, free))
    at_rest = problem.unloaded()
    # the error measured is rounding alone
    assert at_rest.displacement[0] == pytest.approx(0.2, abs=1e-9)
    assert np.abs(leg_wrenches(problem, at_rest)).max() < 1e-4
    real = assembled(robot("orthoglide-parallelograms"), {"bar-x1/bar": 0.2})
    problem = VjmEngine(2).problem(*in_pose(real, free))
    at_rest = problem.unloaded()
    forces = leg_wrenches(problem, at_rest)[:, :3]
    # the long bar tilts its axis by 0.2/80; the leg that lies along its axis resists by twisting its two
    # bars, in torsion and in bending 40 mm from their middle; a little less, as feet and other bars deflect too
    L, EI, GJ, d = 310.0, 4.3055556e7, 1.0689655e7, 80.0
    tilt = 0.2 / d * (24.0 * EI / L**3 * (0.5 * d) ** 2 + 2.0 * GJ / L)
    assert np.linalg.norm(forces, axis=1).max() == pytest.approx(tilt / d, rel=0.1)
    # inside the machine they balance one another
    assert np.abs(at_rest.wrench).max() < 1e-6


def test_a_drive_that_is_off_moves_the_platform(robot):
    free = LoadCase("isotropic", 1.0, "load", loads=(Load((1e-3, 0, 0, 0, 0, 0)),), free=COMPONENTS, steps=1)
    problem = VjmEngine(2).problem(*in_pose(assembled(robot("orthoglide"), off={"y": -0.3}), free))
    # the error measured is 2e-7
    assert problem.unloaded().displacement[:3] == pytest.approx([-1.45e-4, -0.3, -1.45e-4], abs=4e-6)


@pytest.mark.parametrize(
    ("load_case", "words"),
    [
        (
            LoadCase("isotropic", 1.0, control=PointControl("link", 0.5, (0, 1, 0))),
            "no part 'link' with points on it",
        ),
        (
            LoadCase("isotropic", 1.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0), "link"),)),
            "no part 'link' with points",
        ),
        (LoadCase("isotropic", 1.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),)), "held components only"),
        (LoadCase("nowhere", 1.0), r"no posture 'nowhere' \(it has isotropic, Q1, Q2\)"),
    ],
)
def test_load_cases_that_move_or_name_nothing_of_the_machine_are_refused(robot, load_case, words):
    with pytest.raises(ValueError, match=words):
        VjmEngine().problem(*in_pose(robot("orthoglide"), load_case))


def test_a_machine_without_drives_that_is_let_go_is_a_mechanism(robot):
    pulled = LoadCase("straight", 10.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),), free=COMPONENTS)
    with pytest.raises(ValueError, match="is a mechanism: it moves without straining a spring; hold one of them"):
        VjmEngine(2).problem(*in_pose(robot("parallelogram"), pulled))
    # its own freedom held, it is none
    held = LoadCase("straight", 10.0, "load", loads=pulled.loads, free=("x", "z", "rx", "ry", "rz"), steps=1)
    L, EA = 310.0, 6.7391304e6
    point = VjmEngine(2).trace(*in_pose(robot("parallelogram"), held)).points[-1]
    # the error measured is rounding alone
    assert point.displacement[0] == pytest.approx(10.0 * L / (2.0 * EA), rel=1e-10)


@pytest.mark.slow
def test_bows_built_into_the_legs_grow_as_timoshenko_says(robot):
    # a sine of amplitude a grows to a / (1 − F/F_cr); segments are straight, which costs 0.4 % with 16 of them
    engine, machine = VjmEngine(16), robot("orthoglide")
    load, force, size = Load((1.0, 0, 0, 0, 0, 0)), 4000.0, 0.3
    load_case = LoadCase("isotropic", -force, "load", loads=(load,), free=COMPONENTS, steps=4, imperfection=size)
    path = engine.trace(*in_pose(machine, load_case))
    bows = []
    for point in (path.points[0], path.points[-1]):
        rows = [i for i, label in enumerate(path.stations) if label.part == "x/link"]
        bar = point.shape[rows]
        bows.append(np.linalg.norm(bar[len(bar) // 2] - 0.5 * (bar[0] + bar[-1])))
    assert bows[0] == pytest.approx(size, rel=0.01)
    assert bows[1] == pytest.approx(bows[0] / (1.0 - force / 8849.9), rel=5e-3)
    # nothing is prestressed before it is loaded
    problem = engine.problem(*in_pose(machine, load_case))
    assert np.abs(leg_wrenches(problem, path.points[0])).max() < 1e-6


def test_a_limit_point_at_which_the_tangent_is_singular_to_the_last_digit_is_located(robot):
    load_case = LoadCase(
        "Q2", -14_000.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),), free=COMPONENTS, control=TO_LIMIT
    )
    path = VjmEngine(4, 4).trace(*in_pose(robot("orthoglide-parallelograms"), load_case))
    (event,) = path.events
    assert event.kind is EventKind.LIMIT
    assert path.complete
    # 4 springs a beam; fine meshes have 5824 N
    assert event.force == pytest.approx(5923.9, rel=1e-4)
    assert np.diff(path.ramp).min() > 0.0


@pytest.mark.parametrize("free", [("rz",), ("rx", "ry"), ("y", "ry", "rz")])
def test_a_platform_in_a_joint_has_the_stiffness_of_its_forces_differences(robot, free):
    # the joint's own axis has turned with the platform; the knee of the force lies at 2.8 mm
    load_case = LoadCase("Q1", -2.0, "x", free=free, steps=20)
    problem = VjmEngine(2).problem(*in_pose(robot("orthoglide"), load_case))
    path = follow(problem, load_case)
    assert path.complete
    s, force = path.s[8:13], path.force[8:13]
    h = s[1] - s[0]
    assert path.tangent[10] == pytest.approx(
        (force[0] - 8 * force[1] + 8 * force[3] - force[4]) / (12 * h), rel=1e-6
    )
    # nothing is borne in what is free: of two turns along the platform's own axis and along the fixed one
    last = path.points[-1]
    size = np.abs(last.wrench[:3]).max()
    moment = last.wrench[3:]
    turns = [k for k in (1, 0, 2) if COMPONENTS[3 + k] in free]
    turned = rotation_from_vector(last.displacement[3:])
    directions = [turned[:, turns[0]], np.eye(3)[turns[-1]]]
    assert np.abs([moment @ d for d in directions]).max() < 1e-9 * size * 310.0
    assert np.abs(last.displacement[3:]).max() > 1e-3
    for k, name in enumerate("xyz"):
        if name in free:
            assert abs(last.wrench[k]) < 1e-9 * size


# Batches of platforms: against paths of single ones, critical forces, refusals.


SLACK = 2.0 * TOLERANCE
"""The tolerance is of the stiffness that is left, which falls about in a line with the force."""


@cache
def orthoglide():
    """Its model, and its loops as they close."""
    machine = load_model("orthoglide")
    return VjmEngine().model(machine), LoopClosure(machine, home_label(machine))


def closed(poses, closing=None):
    q, why = (closing or orthoglide()[1]).all_displaced(np.asarray(poses, dtype=float))
    assert not any(why)
    return q


def weakest(poses):
    return CriticalForce(orthoglide()[0], 0, 2e4).each(closed(poses))


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
    closing = LoopClosure(robot(name), home_label(robot(name)))
    q = closed(poses, closing)
    states = equilibria(engine.model(robot(name)), q, wrench=wrenches[:, None])
    assert states.stable.all()
    for k, pose in enumerate(poses):
        load = Load(tuple(wrenches[k]))
        load_case = LoadCase(label(pose), 1.0, "load", loads=(load,), free=COMPONENTS, steps=3)
        posed, load_case = in_pose(robot(name), load_case)
        problem = engine.problem(posed, load_case)
        point = follow(problem, load_case).points[-1]
        drives = list(posed.held[load_case.posture].values())
        # the error measured is rounding alone
        assert q[k, ~closing.tree.passive] == pytest.approx(drives, abs=1e-8)
        assert states.deflection[k, 0] == pytest.approx(point.displacement, abs=1e-7)
        assert np.abs(states.stiffness[k, 0] - point.stiffness).max() < 1e-7 * np.abs(point.stiffness).max()


def test_what_one_spring_a_link_bears_when_pressed_it_does_not_when_pulled():
    model, _ = orthoglide()
    forces = np.array([[[3000.0, 0, 0, 0, 0, 0]]] * 2 + [[[-3000.0, 0, 0, 0, 0, 0]]])
    states = equilibria(model, closed([[0.0] * 6, [50.0, 0, 0, 0, 0, 0], [0.0] * 6]), wrench=forces)
    assert states.stable.tolist() == [False, False, True]
    assert states.deflection[2, 0, 0] == pytest.approx(-0.91, abs=0.01)


@pytest.mark.parametrize("pose", ["Q1", "Q2"])
def test_along_the_weakest_direction_a_path_has_its_bifurcation(robot, pose):
    (weak,) = weakest(robot("orthoglide").poses[pose][None])
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
    forces = np.array([weak.force for weak in weakest(in_corners())]).reshape(-1, 3)
    assert np.isfinite(forces).all()
    assert forces == pytest.approx(np.tile(forces.min(axis=1)[:, None], (1, 3)), rel=SLACK)


def test_many_poses_at_once_have_the_smallest_critical_forces_of_single_ones():
    low, high = load_model("orthoglide").workspace
    poses = np.zeros((24, 6))
    poses[:, :3] = np.random.default_rng(4).uniform(low, high, (24, 3))
    for pose, weak in zip(poses, weakest(poses), strict=True):
        (alone,) = weakest(pose[None])
        assert not weak.why
        assert weak.force == pytest.approx(alone.force, rel=SLACK)
        assert weak.negative[0] == 0 < weak.negative[1]


@pytest.mark.slow
def test_a_pose_far_out_has_the_smallest_critical_force_of_a_scan_over_directions():
    """The machine turns so far there that motions which took no force at first take much."""
    poses = np.array([[-70.0, 120.0, 120.0, 0.0, 0.0, 0.0]])
    (weak,) = weakest(poses)
    assert not weak.why
    # over the sphere in equal areas, then twice around the best
    k = np.arange(400) + 0.5
    height, angle = 1.0 - 2.0 * k / len(k), np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    around = np.column_stack([flat * np.cos(angle), flat * np.sin(angle), height])
    rng = np.random.default_rng(5)
    for width in (0.05, 0.01, 0.002):
        forces = first_losses(orthoglide()[0], closed(poses)[0], around, 1.5 * weak.force)
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
    q = closed(poses, LoopClosure(machine, home_label(machine)))
    model = VjmEngine(2).model(assembled(machine, **built))
    q += [built.get("off", {}).get(name, 0.0) for name in model.joints]
    states = equilibria(model, q, wrench=wrenches[:, None])
    for k, (pose, wrench, K) in enumerate(zip(poses, wrenches, states.stiffness[:, 0], strict=True)):
        load = Load(tuple(wrench if wrench.any() else 1e-9 * np.eye(6)[0]))
        load_case = LoadCase(label(pose), 1.0, "load", loads=(load,), free=COMPONENTS, steps=2)
        posed, load_case = in_pose(machine, load_case)
        wrong = assembled(posed, **built)
        point = follow(VjmEngine(2).problem(wrong, load_case), load_case).points[-1]
        stands = states.position[k, 0] - displaced(LoopClosure(machine, home_label(machine)).end, pose)[:3, 3]
        assert stands == pytest.approx(point.displacement[:3], abs=1e-8)
        assert np.abs(K - point.stiffness).max() < 1e-7 * np.abs(K).max()


# Compensation of loaded platforms: the error left by the rigid, the linear and the loaded model.


def compensated(machine, poses, wrenches):
    """Poses are from home; a platform of fewer freedoms turns as its loops let it."""
    home = LoopClosure(machine, home_label(machine)).end[:3, 3]
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
