"""OpenSees' beams with our joints: any chain, finite rotation, tangents, dead loads, and the extra's absence."""

import importlib.util

import numpy as np
import pytest
from helpers.elements import needs_opensees
from scipy.linalg import null_space

from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES, rotation_from_vector
from vjm_fea.opensees import OpenSeesEngine, available
from vjm_fea.opensees.beams import Beams, ElementKind, opensees
from vjm_fea.opensees.system import MachineSystem

from .odd_parts import ARM, OddParts, agrees_with_springs

LENGTH = 310.0
BAR = Section(6.74e6, 1.07e7, 2.07e8, 4.3e7)


@pytest.fixture(scope="module")
def odd_chain():
    """Every kind of part at every kind of place, nothing along an axis."""
    odd = OddParts(11, BAR)
    parts = (
        odd.offset("o1"), Joint("drive", odd.unit(), slides=True, fixed=True, compliance=2e-5), odd.beam("b1"),
        odd.offset("o2"),
        Joint("p1", odd.unit(), passive=True),
        odd.offset("o3"), odd.beam("b2"), Joint("p2", odd.unit(), passive=True),
        Joint("p3", odd.unit(), passive=True),
        Joint("slide", odd.unit(), slides=True, fixed=True, compliance=1e-5), odd.offset("o4"), odd.beam("b3"),
        odd.beam("b4"),
        Joint("held", odd.unit(), slides=True, fixed=True),
        Joint("p4", odd.unit(), passive=True), odd.offset("o5"),
        Joint("last", odd.unit(), slides=True, fixed=True, compliance=3e-5), odd.offset("o6"),
    )  # fmt: skip
    return odd.chain(parts)


def cantilever(**of_beam):
    return Machine("cantilever", (Beam("bar", LENGTH, section=BAR, **of_beam),), postures={"-": np.zeros(0)})


@needs_opensees
def test_any_chain_has_the_lumped_model_s_unloaded_stiffness_and_stations(odd_chain, linear_stiffness):
    # both solve one linear system: rounding times its condition
    agrees_with_springs(OpenSeesEngine(3), odd_chain, linear_stiffness, within=1e-9)


@needs_opensees
@pytest.mark.parametrize("element", ElementKind)
@pytest.mark.parametrize("elements", [1, 5])
def test_tip_compliance_of_a_cantilever_is_beam_theory(element, elements):
    own, across = rotation_from_vector([0.3, -0.2, 0.9]), rotation_from_vector([-0.5, 0.1, 0.4])
    arm = np.array([20.0, -8.0, 5.0])
    chain = cantilever(own_frame=own, section_frame=across, end_offset=arm)
    problem = OpenSeesEngine(elements, element).problem(chain, LoadCase("-", 1.0))
    found = np.linalg.inv(problem.unloaded().stiffness)
    turned = np.kron(np.eye(2), own)
    reference = turned @ Beam("bar", LENGTH, section_frame=across, end_offset=arm, section=BAR).beam_compliance()
    reference = reference @ turned.T
    scale = np.sqrt(np.diag(reference))
    # exact in linear statics for any number of elements
    assert (found - reference) / np.outer(scale, scale) == pytest.approx(0.0, abs=1e-9)


@needs_opensees
def test_rigid_motion_costs_nothing(orthoglide):
    """Turned by a large angle and shifted as a whole, from wherever the elements were before."""
    system = MachineSystem(orthoglide, orthoglide.posture("D"), 4)
    beams = Beams(system.lines, ElementKind.BOWED)
    for vector in ([1.2, -0.7, 2.0], [0.3, 3.0, 0.0], [-0.1, 0.2, -0.05]):
        moved = system.nodes @ rotation_from_vector(vector).T + [10.0, -20.0, 30.0] - system.nodes
        forces = beams.forces(moved, np.tile(vector, (beams.count, 1)))
        # rounding of 300 mm, 5e-14, by the stiffest element's 12 EI/h³ and EA/h, 2e6 N/mm, on arms of 40 mm
        assert forces == pytest.approx(0.0, abs=4e-6)


@pytest.mark.slow
@needs_opensees
def test_tangent_is_the_derivative_of_the_residual(odd_chain):
    """Linkages, arms and drives under load; what OpenSees leaves out shows less on the finer mesh."""
    missing = []
    for elements in (2, 8):
        problem = OpenSeesEngine(elements).problem(odd_chain, LoadCase("P", 12.0))
        statics = problem.statics
        here = problem.solve(12.0, problem.solve(6.0, problem.unloaded()))
        K = statics.tangent(here.state).J
        D = np.empty_like(K)
        step = 2e-5
        for column in range(len(K)):
            motion = np.zeros(len(K))
            motion[column] = step
            ahead, behind = (statics.residual(statics.moved(here.state, sign * motion)) for sign in (1.0, -1.0))
            D[:, column] = (ahead - behind) / (2.0 * step)
        missing.append(np.max(np.abs(K - D)))
        # an equilibrium of conservative parts: symmetric on the motions that the end-effector's support leaves
        moving = statics.free[statics.free < statics.motions]
        N = null_space(K[np.ix_(statics.free[statics.free >= statics.motions], moving)])
        left = N.T @ K[np.ix_(moving, moving)] @ N
        assert left == pytest.approx(left.T, abs=3.0 * missing[-1] + 1e-8)
    # in units in which diagonals are one
    assert missing[0] < 1e-4
    assert missing[1] < 0.3 * missing[0]


@needs_opensees
def test_loaded_stiffness_is_the_derivative_of_the_wrench(orthoglide):
    problem = OpenSeesEngine().problem(orthoglide, LoadCase("D", -14.0))
    here = problem.solve(4.0, problem.solve(2.0, problem.unloaded()))
    K = here.stiffness
    differences = np.empty((6, 6))
    for i, step in enumerate([1e-2] * 3 + [1e-4] * 3):
        d = np.zeros(6)
        d[i] = step
        ahead, behind = (problem.solve_pose(here.displacement + sign * d, here).wrench for sign in (1.0, -1.0))
        differences[:, i] = (ahead - behind) / (2.0 * step)
    scale = np.max(np.abs(K / np.outer(ARM, ARM)))
    assert (K - differences) / np.outer(ARM, ARM) / scale == pytest.approx(0.0, abs=1e-6)
    assert here.tangent == pytest.approx(K[0, 0], rel=1e-12)


@needs_opensees
def test_the_whole_chain_is_in_equilibrium(orthoglide):
    problem = OpenSeesEngine(8).problem(orthoglide, LoadCase("D", -14.0))
    here = problem.solve(6.0, problem.solve(3.0, problem.unloaded()))
    statics = problem.statics
    at = statics.configuration(here.state)
    root = problem.statics.system.nodes[0]
    base = Beams(statics.system.lines, ElementKind.BOWED).forces(at.displacement, at.rotation)[0]
    tip = here.shape[-1] - root
    # the error measured is 2e-9
    assert base[:3] + here.wrench[:3] == pytest.approx(0.0, abs=3e-8)
    # 3 kN on arms of 400 mm, 1e6 N mm in all
    assert base[3:] + here.wrench[3:] + np.cross(tip, here.wrench[:3]) == pytest.approx(0.0, abs=4e-6)
    # the joint at the end-effector is free about y: it carries no moment there
    assert here.wrench[4] == pytest.approx(0.0, abs=1e-8)


@pytest.mark.slow
@needs_opensees
def test_a_dead_moment_bends_a_free_cantilever_to_half_a_circle():
    """With nothing held: the deflection is 2 L/π. Straight chords of their own length make it a polygon's.

    OpenSees' mean of two nodes' axes is not quite half-way: measured 1e-4 mm for 4 elements, 2e-7 for 8.
    """
    R = rotation_from_vector([0.4, -0.3, 0.8])
    load = Load((0.0, 0.0, 0.0, *R[:, 2]))
    load_case = LoadCase("-", np.pi * BAR.EIz / LENGTH, "load", free=COMPONENTS, loads=(load,), steps=8)
    for n in (8, 16):
        path = OpenSeesEngine(n, ElementKind.LINEAR).trace(cantilever(own_frame=R), load_case)
        half = 0.5 * np.pi / n
        deflection = R.T @ path.points[-1].shape[-1]
        assert deflection == pytest.approx([0.0, 2.0 * LENGTH / np.pi * half / np.sin(half), 0.0], abs=1e-6)


@needs_opensees
def test_a_load_on_a_node_is_the_reaction_of_a_held_end():
    """A dead force at mid-span of a clamped bar goes to the ends by halves, deflecting it P L³/192 EI."""
    load = Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), "bar", 0.5)
    end = OpenSeesEngine(4).trace(cantilever(), LoadCase("-", 1e-3, "load", loads=(load,), steps=1)).points[-1]
    assert end.shape[2, 1] == pytest.approx(1e-3 * LENGTH**3 / (192.0 * BAR.EIz), rel=1e-9)
    # the error measured is rounding alone
    assert end.wrench[1] == pytest.approx(-0.5e-3, rel=1e-9)


@needs_opensees
def test_states_do_not_depend_on_what_was_solved_before(orthoglide):
    """Nor on the other problem that uses OpenSees' one domain in between."""
    problem = OpenSeesEngine(4).problem(orthoglide, LoadCase("B", -14.0))
    start = problem.solve(1.0, problem.unloaded())
    first = problem.solve(2.0, start)
    problem.solve(8.0, problem.solve(5.0, first))
    other = OpenSeesEngine(3, ElementKind.LINEAR).problem(cantilever(), LoadCase("-", 20.0, axis="y"))
    other.solve(20.0, other.solve(10.0, other.unloaded()))
    again = problem.solve(2.0, start)
    assert np.array_equal(first.state, again.state)
    assert np.array_equal(first.wrench, again.wrench)


@needs_opensees
def test_an_impossible_step_is_refused_and_leaves_no_trace(orthoglide):
    problem = OpenSeesEngine(4).problem(orthoglide, LoadCase("B", -14.0))
    start = problem.solve(1.0, problem.unloaded())
    with pytest.raises(NoConvergenceError):
        problem.solve(1e4, start)
    with pytest.raises(NoConvergenceError, match="not finite"):
        problem.solve_pose(np.full(6, np.nan), start)
    assert problem.solve(1.0, start).wrench == pytest.approx(start.wrench, rel=1e-9, abs=1e-4)


def test_what_cannot_be_meshed_is_refused(orthoglide):
    engine, ramp = OpenSeesEngine(), LoadCase("-", 1.0)
    bare = Machine("bare", (Beam("foot", 100.0, compliance=np.eye(6)),), postures={"-": np.zeros(0)})
    with pytest.raises(ValueError, match="part 'foot': opensees does not take beams without a section"):
        engine.problem(bare, ramp)
    with pytest.raises(ValueError, match="does not take machines without a beam"):
        engine.problem(Machine("stiff", (Joint("q", AXES["x"], passive=True),), postures={"-": np.zeros(1)}), ramp)
    with pytest.raises(ValueError, match="at least one element"):
        OpenSeesEngine(elements=0).problem(orthoglide, LoadCase("A", 1.0))
    with pytest.raises(ValueError, match="opensees does not take imperfections"):
        engine.problem(orthoglide, LoadCase("A", -4.0, imperfection=0.1))


def test_without_the_extra_one_line_says_what_to_install(orthoglide, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "openseespy" else find(name, *a)
    )
    opensees.cache_clear()
    try:
        assert not available()
        with pytest.raises(ImportError, match=r"pip install 'vjm-stiffness\[opensees\]'"):
            OpenSeesEngine().trace(orthoglide, LoadCase("A", -1.0))
    finally:
        opensees.cache_clear()
