"""Chains of any parts become the same machine as in the lumped model; residual and tangent are consistent."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.engines import engine_by_name
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, JointCoupling, RigidOffset, Section
from vjm.rotations import AXES, frame, rotation_from_vector
from vjm_fea.common.states import quaternion, rotation_matrices
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.exudyn.joints import MatrixSpring

from .odd_parts import ARM, OddParts, agrees_with_springs


@pytest.fixture(scope="module")
def odd_chain():
    """Every kind of part, every kind of joint: oblique, crossing and single revolutes, drives, arms."""
    odd = OddParts(3, Section(6e6, 1e7, 2e8, 4e7))
    first = odd.unit()
    second = np.cross(first, odd.unit())
    second /= np.linalg.norm(second)
    parts = (
        odd.offset("o1"), Joint("drive", odd.unit(), slides=True, fixed=True, compliance=2e-5), odd.beam("b1"),
        odd.offset("o2"),
        Joint("p1", odd.unit(), passive=True),
        odd.offset("o3"), odd.beam("b2"), Joint("p2", first, passive=True), Joint("p3", second, passive=True),
        Joint("slide", odd.unit(), slides=True, fixed=True, compliance=1e-5), odd.offset("o4"), odd.beam("b3"),
        odd.beam("b4"),
        Joint("held", odd.unit(), slides=True, fixed=True),
        Joint("p4", odd.unit(), passive=True), odd.offset("o5"),
    )  # fmt: skip
    return odd.chain(parts)


def test_any_chain_has_the_lumped_model_s_unloaded_stiffness_and_stations(odd_chain, linear_stiffness):
    # joint columns are differences with a relative error near 1e-8
    agrees_with_springs(ExudynEngine(elements=3), odd_chain, linear_stiffness, within=1e-6)


@pytest.mark.parametrize("foot_spring", [False, True])
def test_tangent_is_the_derivative_of_the_residual(orthoglide, foot_spring):
    """With the reactions of the joints loaded: Exudyn's own Jacobian lacks their change with the motion."""
    problem = ExudynEngine(foot_spring=foot_spring, elements=3).problem(orthoglide, LoadCase("D", -14.0))
    here = problem.solve(6.0, problem.solve(3.0, problem.unloaded()))
    statics = problem.statics
    tangent = statics.tangent(here.state)
    moves = statics.free[statics.free < statics.motions]
    step = 2e-5
    for column in moves:
        motion = np.zeros(len(statics.unit))
        motion[column] = step
        ahead = statics.residual(statics.moved(here.state, motion))
        behind = statics.residual(statics.moved(here.state, -motion))
        difference = (ahead - behind)[statics.free] / (2.0 * step)
        # in units in which diagonals are one: rounding 1e-15 over the step, and its square
        assert tangent.J[statics.free, column] == pytest.approx(difference, abs=1e-7)
    if not foot_spring:
        # an equilibrium of conservative parts: the stiffness is symmetric where motion is possible
        assert tangent.J[np.ix_(moves, moves)] == pytest.approx(tangent.J[np.ix_(moves, moves)].T, abs=1e-7)


@pytest.mark.parametrize("foot_spring", [False, True])
def test_loaded_stiffness_is_the_derivative_of_the_wrench(orthoglide, foot_spring):
    problem = ExudynEngine(foot_spring=foot_spring).problem(orthoglide, LoadCase("D", -14.0))
    here = problem.solve(4.0, problem.solve(2.0, problem.unloaded()))
    K = here.stiffness
    differences = np.empty((6, 6))
    for i, step in enumerate([1e-2] * 3 + [1e-4] * 3):
        d = np.zeros(6)
        d[i] = step
        ahead = problem.solve_pose(here.displacement + d, here).wrench
        behind = problem.solve_pose(here.displacement - d, here).wrench
        differences[:, i] = (ahead - behind) / (2.0 * step)
    # third derivatives of the wrench over these steps, measured 1e-7 and less of the largest entry
    scale = np.max(np.abs(K / np.outer(ARM, ARM)))
    assert (K - differences) / np.outer(ARM, ARM) / scale == pytest.approx(0.0, abs=1e-6)
    assert here.tangent == pytest.approx(K[0, 0], rel=1e-12)


def test_the_whole_chain_is_in_equilibrium(orthoglide):
    problem = ExudynEngine().problem(orthoglide, LoadCase("D", -14.0))
    here = problem.solve(6.0, problem.solve(3.0, problem.unloaded()))
    statics = problem.statics
    # the root's node goes with the ground, which must give what the beam puts up there
    base = statics.node_forces(here.state)[0]
    tip = problem.solve(0.0, here).shape[-1] + here.displacement[:3]
    assert base[:3] + here.wrench[:3] == pytest.approx(0.0, abs=1e-6)
    # 3 kN on arms of 400 mm, 1e6 N mm in all, closed to the solver's tolerance
    assert base[3:] + here.wrench[3:] + np.cross(tip, here.wrench[:3]) == pytest.approx(0.0, abs=2e-5)
    # the joint at the end-effector is free about y: it carries no moment there
    assert here.wrench[4] == pytest.approx(0.0, abs=1e-8)
    assert np.linalg.norm(here.wrench[[3, 5]]) > 100.0


def test_restart_does_not_depend_on_what_was_solved_before(orthoglide):
    problem = ExudynEngine(elements=4).problem(orthoglide, LoadCase("B", -14.0))
    start = problem.solve(1.0, problem.unloaded())
    first = problem.solve(2.0, start)
    problem.solve(8.0, problem.solve(5.0, first))
    again = problem.solve(2.0, start)
    assert np.array_equal(first.state, again.state)
    assert np.array_equal(first.wrench, again.wrench)


def test_an_impossible_step_is_refused_and_leaves_no_trace(orthoglide):
    problem = ExudynEngine(elements=4).problem(orthoglide, LoadCase("B", -14.0))
    start = problem.solve(1.0, problem.unloaded())
    with pytest.raises(NoConvergenceError, match="scaled residual"):
        problem.solve(1e4, start)
    assert problem.solve(1.0, start).wrench == pytest.approx(start.wrench, rel=1e-9, abs=1e-6)


def test_what_cannot_be_meshed_is_refused(orthoglide):
    bare = Machine("bare", (Beam("foot", 100.0, compliance=np.eye(6)),), postures={"-": np.zeros(0)})
    with pytest.raises(ValueError, match="part 'foot': exudyn does not take beams without a section"):
        ExudynEngine().problem(bare, LoadCase("-", 1.0))
    assert ExudynEngine(foot_spring=True).problem(bare, LoadCase("-", 1.0)).unloaded().tangent == pytest.approx(1.0)
    with pytest.raises(ValueError, match="finite GAy and GAz"):
        ExudynEngine(shear=True, corrected=False).problem(orthoglide, LoadCase("A", 1.0))
    with pytest.raises(ValueError, match="ask for shear"):
        ExudynEngine(shear=False, corrected=False).problem(orthoglide, LoadCase("A", 1.0))
    with pytest.raises(ValueError, match="at least one element"):
        ExudynEngine(elements=0).problem(orthoglide, LoadCase("A", 1.0))


@pytest.mark.parametrize("vector", [[0.0, 0, 0], [np.pi, 0, 0], [0, np.pi, 0], [0, 0, np.pi], [1.0, 2.0, -1.5]])
def test_quaternion_and_rotation_matrix_are_inverse(vector):
    R = rotation_from_vector(vector)
    p = quaternion(R)
    assert np.linalg.norm(p) == pytest.approx(1.0, abs=1e-15)
    assert rotation_matrices(p[None])[0] == pytest.approx(R, abs=1e-14)


# Joints with a whole 6×6 compliance in Exudyn: against the lumped model of the same law, and differences.


def compliance(seed):
    """Positive definite, every direction coupled with every other."""
    rng = np.random.default_rng(seed)
    A = 0.4 * rng.normal(size=(6, 6)) + np.eye(6)
    unit = np.repeat([200.0, 1.0], 3) * 1e-4
    return A @ A.T * unit[:, None] * unit


def arm(*, beam, rigid=()):
    bend = frame(rotation_from_vector(np.array([0.3, -0.2, 0.5])), [250.0, 40.0, -30.0])
    section = Section(EA=2e9, GJ=1e11, EIy=2e11, EIz=1e11)
    last = Beam("last", 300.0, section=section) if beam else RigidOffset("last", bend)
    wrist = compliance(2)
    wrist[list(rigid)] = wrist[:, list(rigid)] = 0.0
    parts = (
        Joint("base", AXES["z"], matrix=compliance(1)),
        RigidOffset("link", bend, mass=3.0),
        Joint("wrist", AXES["y"], matrix=wrist),
        last,
    )
    return Machine("arm", parts, postures={"-": np.zeros(0)}, held={"-": {"base": 0.4, "wrist": -0.7}})


def case(factor):
    load = Load((30.0, -200.0, 120.0, 0.0, 0.0, 0.0))
    return LoadCase("-", factor, axis="load", free=COMPONENTS, loads=(load,), gravity=(0.0, 0.0, -9.81), steps=4)


@pytest.mark.parametrize("rigid", [(), (0, 4), (0, 1, 2)])
def test_a_rigid_arm_on_such_joints_is_the_lumped_one(rigid):
    chain = arm(beam=False, rigid=rigid)
    one = engine_by_name("vjm-paper").trace(chain, case(20.0)).points[-1]
    other = ExudynEngine().trace(chain, case(20.0)).points[-1]
    # the same equations in other coordinates
    assert np.abs(one.displacement[3:]).max() > 0.01
    assert other.displacement == pytest.approx(one.displacement, rel=1e-8, abs=1e-9)
    assert other.tangent == pytest.approx(one.tangent, rel=1e-6)
    assert other.unstable == one.unstable == 0


def test_an_arm_with_a_beam_behind_such_joints_is_the_lumped_one():
    chain = arm(beam=True)
    one = engine_by_name("vjm-16").trace(chain, case(20.0)).points[-1]
    other = ExudynEngine(elements=16).trace(chain, case(20.0)).points[-1]
    # what remains is the beam's share, a thousandth of the deflection, by the square of the element
    assert other.displacement == pytest.approx(one.displacement, rel=1e-6, abs=1e-8)


def test_forces_are_differences_of_the_energy_and_the_tangent_of_the_forces():
    rng = np.random.default_rng(4)
    frames = np.array([frame(rotation_from_vector(rng.normal(size=3)), 50.0 * rng.normal(size=3)) for _ in (0, 1)])
    spring = MatrixSpring((0, 1), frames, np.linalg.inv(compliance(3)))
    T = frame(rotation_from_vector(np.array([0.2, 0.1, -0.3])), [5.0, 3.0, -2.0])
    # the second node where the spring is shifted and turned by T
    first = frame(rotation_from_vector(rng.normal(size=3)), [100.0, 20.0, 30.0])
    second = first @ frames[0] @ T @ np.linalg.inv(frames[1])

    def at(motion):
        moved = []
        for k, node in enumerate((first, second)):
            shift, turn = motion[6 * k : 6 * k + 3], motion[6 * k + 3 : 6 * k + 6]
            moved.append(frame(rotation_from_vector(turn) @ node[:3, :3], node[:3, 3] + shift))
        return moved

    def energy(motion):
        a, b = at(motion)
        R = np.linalg.inv(a @ frames[0]) @ b @ frames[1]
        y = np.arcsin(R[0, 2])
        theta = np.array([*R[:3, 3], np.arctan2(-R[1, 2], R[2, 2]), y, np.arctan2(-R[0, 1], R[0, 0])])
        return 0.5 * theta @ spring.stiffness @ theta

    def places(motion):
        rows = [[*node[:3, 3], *quaternion(node[:3, :3])] for node in at(motion)]
        return np.array([*rows, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])

    unit = np.tile(np.repeat([1e-3, 1e-5], 3), 2)
    steps = np.diag(unit)
    slopes = np.array([(energy(s) - energy(-s)) / 2.0 for s in steps]) / unit
    forces = spring.gradient(places(np.zeros(12))).ravel()
    # differences of the energy: rounding 1e-16 over a relative change of 1e-5
    assert forces == pytest.approx(slopes, rel=1e-6, abs=1e-6 * np.abs(forces).max())
    K = np.array([(spring.gradient(places(s)) - spring.gradient(places(-s))).ravel() / 2.0 for s in steps]).T / unit
    found = spring.second(places(np.zeros(12)))
    assert found == pytest.approx(K, rel=1e-6, abs=1e-7 * np.abs(K).max())


@pytest.mark.parametrize("slides", [False, True])
def test_couplings_as_bent_pass_on_what_bends(slides):
    size = 2e-4 if slides else 5e-8
    parts = (
        Joint("first", AXES["z"], compliance=4e-8, lateral=(1e-8, 2e-8)),
        RigidOffset("upper", frame(rotation_from_vector(np.array([0.1, 0.4, 0.0])), [300.0, 20.0, 50.0]), mass=2.0),
        Joint("second", AXES["y"], slides, compliance=size),
        RigidOffset("middle", frame(p=[200.0, 0.0, 10.0]), mass=1.0),
        Joint(
            "third", AXES["x"], slides, compliance=size, lateral=(3e-8, 0.0),
            coupling=JointCoupling((("first", 100.0 if slides else -0.7), ("second", 0.4))),
        ),
        RigidOffset("lower", frame(p=[250.0, 30.0, 0.0]), mass=1.5),
        Joint("fourth", AXES["y"], coupling=JointCoupling((("first", -1.0),))),
        Beam("last", 200.0, section=Section(EA=2e9, GJ=1e10, EIy=2e10, EIz=1e10)),
    )  # fmt: skip
    values = {"first": 0.3, "second": 0.2}
    chain = Machine("coupled", parts, postures={"-": np.zeros(0)}, held={"-": values})
    one = engine_by_name("vjm-8").trace(chain, case(4.0)).points[-1]
    other = ExudynEngine(elements=16).trace(chain, case(4.0)).points[-1]
    # what remains is the beam's share by the square of the element
    assert other.displacement == pytest.approx(one.displacement, rel=1e-5, abs=1e-7)
    assert other.tangent == pytest.approx(one.tangent, rel=1e-5)
    assert other.unstable == one.unstable == 0
    without = replace(parts[4], coupling=replace(parts[4].coupling, as_deflected=False))
    chain = replace(chain, parts=(*parts[:4], without, *parts[5:]))
    commanded = engine_by_name("vjm-8").trace(chain, case(4.0)).points[-1]
    assert np.abs(commanded.displacement - one.displacement).max() > 1e-3
