"""Chains of any parts become the same machine as in the lumped model; residual and tangent are consistent."""

from __future__ import annotations

import numpy as np
import pytest

from vjm.continuation.path import StationLabel
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import rotation_from_vector
from vjm_fea.common.states import quaternion, rotation_matrices
from vjm_fea.exudyn.engine import ExudynEngine

from .odd_parts import OddParts

# wrench and stiffness in units of 300 mm, so that forces and moments weigh the same
ARM = np.array([1.0, 1.0, 1.0, 300.0, 300.0, 300.0])


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
    problem = ExudynEngine(elements=3).problem(odd_chain, LoadCase("P", 1.0))
    unloaded = problem.unloaded()
    names = [beam.name for beam in odd_chain.beams]
    reference = linear_stiffness(odd_chain.refined(dict.fromkeys(names, 1)), odd_chain.posture("P"))
    scaled = (unloaded.stiffness - reference) / np.outer(ARM, ARM)
    # joint columns are differences with a relative error near 1e-8
    assert scaled == pytest.approx(0.0, abs=1e-6 * np.max(np.abs(reference / np.outer(ARM, ARM))))

    model = Mechanism(odd_chain.refined(dict.fromkeys(names, 3)))
    assert problem.stations == tuple(StationLabel(s.part, s.fraction) for s in model.stations)
    lumped_shape = model.shape(model.kinematics(model.configuration(odd_chain.posture("P"))))
    # the same products of frames, to rounding of some hundred mm
    assert unloaded.shape == pytest.approx(lumped_shape, abs=1e-10)
    assert unloaded.wrench / ARM == pytest.approx(0.0, abs=1e-9)


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
