"""Loaded manipulators: the paper's sum, the converse, critical points, errors of assembly."""

import numpy as np
import pytest
from helpers.in_pose import in_pose
from helpers.legs import leg_alone

import vjm
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.machine.platforms import assembled, leg_wrenches, yielding_legs
from vjm.machine.rigid_mechanism import Closing
from vjm.model.load_case import ARC, COMPONENTS, TO_LIMIT, Load, LoadCase, PointControl
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
    home = Closing(machine, label).end
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
        (
            LoadCase("isotropic", 1.0, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),)),
            "held components only",
        ),
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
