"""Derivatives by parameters, against differences of whole solutions and against what dimensions alone demand."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.closed_machines import two_legs, y_tree
from helpers.parameters import joint_compliance, orientation

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parameters import (
    Parameter,
    beam_length,
    compliance_entry,
    compliance_factor,
    section_value,
)
from vjm.model.parts import RigidOffset
from vjm.rotations import frame, turn
from vjm.sensitivity import Mode, Sensitivity, State, by_posture, links_of, place, wrench_sensitivity
from vjm.statics import newton_matrix, newton_scale

SPRINGS = ("EA", "GJ", "EIy", "EIz")


@pytest.fixture(scope="module")
def soft(chain) -> Machine:
    """The paper's chain with the actuator compliance that a fit to Table II gives."""
    return chain.with_actuator_compliance(2e-6)


@pytest.fixture(scope="module")
def traced(soft):
    """A path of the soft chain, and its engine, traced once for all tests that ask for the same."""
    known = {}

    def path(posture, to, segments, steps):
        key = posture, to, segments, steps
        if key not in known:
            known[key] = VjmEngine(segments).trace(soft, LoadCase(posture, to, steps=steps))
        return VjmEngine(segments), known[key]

    return path


def joint_angle(chain: Machine, posture: str, joint: str) -> Parameter:
    """Passive joint coordinate of a posture in rad: where the chain stands when it is unloaded."""
    index = [part.name for part in chain.joints].index(joint)

    def apply(machine: Machine, value: float) -> Machine:
        angles = machine.posture(posture).copy()
        angles[index] = value
        return replace(machine, postures={**machine.postures, posture: angles})

    return Parameter(f"{posture} {joint}", "rad", float(chain.posture(posture)[index]), 1.0, apply)


def critical_sensitivity(engine, chain, path, parameters):
    return Sensitivity(engine, chain, parameters, path.load_case.posture).critical(path)


def one_of_each(chain: Machine, posture: str, segments: int | None) -> list[Parameter]:
    """Every kind of parameter that this engine sees."""
    parameters = [
        compliance_entry(chain, "foot", 1, 1),
        compliance_entry(chain, "foot", 3, 5),
        compliance_factor(chain, "foot"),
        compliance_factor(chain, "link"),
        beam_length(chain, "link"),
        joint_compliance(chain, "actuator"),
        joint_angle(chain, posture, "q1"),
        joint_angle(chain, posture, "q2"),
        orientation(chain, "foot", "y"),
        orientation(chain, "foot", "z"),
        orientation(chain, "link", "x"),
        orientation(chain, "actuator", "y"),
        orientation(chain, "q3", "x"),
    ]
    if segments is None:
        # (1,2) is zero as printed: a coupling of the pull with the soft bending
        return [*parameters, *(compliance_entry(chain, "link", *ij) for ij in ((2, 2), (2, 6), (1, 2)))]
    return [*parameters, *(section_value(chain, "link", name) for name in SPRINGS)]


def difference(function, parameter: Parameter, step: float) -> np.ndarray:
    """Derivative by central differences of fourth order, over a fraction of the parameter's scale."""
    h, value = step * parameter.scale, parameter.value
    near = function(value + h) - function(value - h)
    far = function(value + 2.0 * h) - function(value - 2.0 * h)
    return (8.0 * near - far) / (12.0 * h)


# --- wrenches -------------------------------------------------------------------------------------

PATHS = [("A", 2.0, None, 5), ("B", 4.0, None, 4), ("A", -4.0, 4, 5), ("B", -10.0, 4, 4), ("D", 3.0, None, 3)]


@pytest.mark.parametrize(("posture", "to", "segments", "steps"), PATHS)
def test_wrenches_change_as_those_of_the_solver_do(soft, traced, posture, to, segments, steps):
    """Before and behind the bifurcation (A) and the stiffness knee (B, D)."""
    engine, path = traced(posture, to, segments, steps)
    parameters = one_of_each(soft, posture, segments)
    found = wrench_sensitivity(engine, soft, path, parameters)
    assert found.shape == (len(path.points), 6, len(parameters))
    unit = engine.model(soft).wrench_scale
    # at the entry of a branch its change is a hundred times larger than elsewhere: differences do not resolve it
    critical = path.critical.s if path.critical.kind is EventKind.BIFURCATION else np.inf
    rows = [i for i, s in enumerate(path.s) if s > 0.0 and abs(s / critical - 1.0) > 0.02]
    for k, parameter in enumerate(parameters):

        def wrenches(value, parameter=parameter):
            problem = LumpedProblem(engine.model(parameter.apply(soft, value)), path.load_case, "")
            return np.array([problem.solve(path.s[i], path.points[i]).wrench for i in rows])

        expected = difference(wrenches, parameter, 3e-4) * parameter.scale / unit
        error = np.linalg.norm(found[rows, :, k] * parameter.scale / unit - expected, axis=1)
        # 3e-8: what the solver's tolerance 1e-11 is over the step
        assert np.all(error <= 1e-6 * np.linalg.norm(expected, axis=1) + 3e-8), parameter.name


@pytest.mark.parametrize(("posture", "to", "segments", "steps"), [("B", 4.0, None, 4), ("A", -4.0, 4, 5)])
def test_last_wrench_changes_as_that_of_a_whole_path_does(soft, traced, posture, to, segments, steps):
    engine, path = traced(posture, to, segments, steps)
    parameters = [compliance_factor(soft, "link"), joint_compliance(soft, "actuator"), beam_length(soft, "link")]
    found = wrench_sensitivity(engine, soft, path, parameters)[-1]
    for k, parameter in enumerate(parameters):

        def last(value, parameter=parameter):
            return engine.trace(parameter.apply(soft, value), path.load_case).wrench[-1]

        assert found[:, k] == pytest.approx(
            difference(last, parameter, 1e-3), rel=1e-6, abs=1e-6 * np.abs(found[:, k]).max()
        )


def test_unloaded_chain_feels_nothing(soft, traced):
    engine, path = traced("B", 4.0, None, 4)
    found = wrench_sensitivity(engine, soft, path, one_of_each(soft, "B", None))[0]
    # rounding of a pose of 400 mm over a step of 1e-5, times stiffnesses of 1e6 N mm
    assert np.abs(found / engine.model(soft).wrench_scale[:, None]).max() < 1e-8


# --- the tangent ----------------------------------------------------------------------------------


def state_of(engine, chain, path, point) -> State:
    problem = LumpedProblem(engine.model(chain), path.load_case, "")
    at, links = problem.configuration(point), links_of(problem.model)
    return State(at, point.s, links, place(links, at.x))


@pytest.mark.parametrize("transposed", [False, True])
def test_tangent_of_the_blocks_is_the_dense_one(soft, traced, transposed):
    """Under a moment, which makes it unsymmetric."""
    engine, path = traced("B", -10.0, 4, 4)
    state = state_of(engine, soft, path, path.points[-1])
    model, scale = state.at.model, newton_scale(state.at.model)
    dense = newton_matrix(model, state.at.kinematics, state.at.wrench)
    assert np.abs(dense - dense.T).max() > 1e-3
    right = np.random.default_rng(1).standard_normal((4, model.size + 6))
    found = state.solve(right / scale, transposed=transposed) / scale
    expected = np.linalg.solve(dense.T if transposed else dense, right.T).T
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_at_a_bifurcation_the_tangent_without_its_mode_is_the_dense_one(soft, traced):
    engine, path = traced("A", -2.9, 4, 6)
    state = state_of(engine, soft, path, path.events[0].point)
    scale = newton_scale(state.at.model)
    U, values, Vt = np.linalg.svd(newton_matrix(state.at.model, state.at.kinematics, state.at.wrench))
    mode = Mode(state)
    assert not mode.twofold
    for vector in (U[:, -1], Vt[-1]):
        assert abs(mode.vector / scale @ vector) == pytest.approx(1.0, abs=1e-9)
    right = np.random.default_rng(1).standard_normal((4, len(scale)))
    found = mode.solve(right / scale) / scale
    expected = (Vt[:-1].T @ ((U[:, :-1].T @ right.T) / values[:-1, None])).T
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_neighbours_serve_every_path_of_a_chain(soft, traced):
    parameters = [compliance_factor(soft, "link"), joint_angle(soft, "A", "q1"), beam_length(soft, "link")]
    engine, _ = traced("A", -4.0, 4, 5)
    once = Sensitivity(engine, soft, parameters)
    for posture, to, steps in (("A", -4.0, 5), ("B", -10.0, 4)):
        _, path = traced(posture, to, 4, steps)
        assert np.array_equal(once.wrench(path), wrench_sensitivity(engine, soft, path, parameters))


@pytest.mark.parametrize("posture", ["bent", "folded"])
def test_joints_that_are_held_stand_as_the_posture_says(posture):
    """An arm on geared joints: the derivatives of a path are those in its posture."""
    arm, engine = load_chain("planar-2r"), VjmEngine(4)
    load_case = LoadCase(posture, 2.0, "z", steps=4)
    parameters = [compliance_factor(arm, "upper"), beam_length(arm, "upper"), beam_length(arm, "fore")]
    found = by_posture(engine, arm, parameters)(posture).wrench(engine.trace(arm, load_case))
    for i, parameter in enumerate(parameters):

        def wrenches(value: float, parameter: Parameter = parameter) -> np.ndarray:
            path = engine.trace(parameter.apply(arm, value), load_case)
            return np.array([point.wrench for point in path.points])

        wrench = difference(wrenches, parameter, 1e-4)
        assert np.abs(found[..., i] - wrench).max() < 1e-6 * np.abs(wrench).max()


# --- critical points ------------------------------------------------------------------------------

EVENTS = [("A", 0.9, None, 6, 0), ("A", -2.9, 4, 6, 0), ("B", -8.5, 4, 8, 0), ("D", -17.0, 4, 34, 1)]


@pytest.mark.parametrize(("posture", "to", "segments", "steps", "which"), EVENTS)
def test_events_move_as_located_ones_do(soft, traced, posture, to, segments, steps, which):
    """A bifurcation, a stiffness knee and a limit point."""
    engine, path = traced(posture, to, segments, steps)
    parameters = [
        compliance_factor(soft, "foot"),
        compliance_factor(soft, "link"),
        joint_compliance(soft, "actuator"),
        orientation(soft, "actuator", "y"),
        orientation(soft, "link", "x"),
    ]
    if segments is None:
        parameters += [compliance_entry(soft, "link", 2, 2), beam_length(soft, "link")]
    elif which == 0:
        parameters += [section_value(soft, "link", "EA"), section_value(soft, "link", "EIz")]
    if posture in "AB":
        parameters += [orientation(soft, "foot", "y"), joint_angle(soft, posture, "q1")]
    result = critical_sensitivity(engine, soft, path, parameters)[which]
    assert result.event is path.events[which]
    assert result.reasons == ("",) * len(parameters)
    for k, parameter in enumerate(parameters):

        def event(value, parameter=parameter):
            found = engine.trace(parameter.apply(soft, value), path.load_case).events[which]
            assert found.kind is result.event.kind
            return np.array([found.force, found.s])

        force, s = difference(event, parameter, 2e-3) * parameter.scale
        # Events are located to 1e-9 of the path, over a step of 2e-3: 1e-6. A limit point's displacement is where
        # a flat curve is highest.
        allowed = 1e-5 if result.event.kind is EventKind.LIMIT else 3e-6
        assert result.force[k] * parameter.scale == pytest.approx(force, rel=3e-6, abs=3e-6 * result.event.force)
        assert result.s[k] * parameter.scale == pytest.approx(s, rel=allowed, abs=allowed * result.event.s)


@pytest.mark.parametrize(("posture", "to", "segments", "steps"), [
    ("A", 0.9, None, 6), ("A", -2.9, 4, 6), ("B", 2.5, None, 5), ("B", -8.5, 4, 8), ("D", -17.0, 4, 34),
])  # fmt: skip
def test_softening_every_spring_alike_lowers_the_force_alike_and_leaves_the_displacement(
    soft, traced, posture, to, segments, steps
):
    """With all compliances times f, all forces are over f at the same displacements, whatever the laws."""
    engine, path = traced(posture, to, segments, steps)
    springs = [compliance_factor(soft, "foot"), compliance_factor(soft, "link")]
    springs.append(joint_compliance(soft, "actuator"))
    scale = np.array([p.scale for p in springs])
    for result in critical_sensitivity(engine, soft, path, springs):
        # the error measured is rounding alone
        assert result.force @ scale == pytest.approx(-result.event.force, rel=7e-9)
        assert result.s @ scale == pytest.approx(0.0, abs=1e-6 * result.event.s)


def test_column_buckles_by_euler(column):
    """π²EI/L² but for the shortening, 1e-3 here: EI counts once, L twice, and EA hardly."""
    path = VjmEngine(8).trace(column, LoadCase("straight", -0.2, steps=4))
    names = [section_value(column, "link", "EIz"), beam_length(column, "link"), section_value(column, "link", "EA")]
    (result,) = critical_sensitivity(VjmEngine(8), column, path, names)
    elasticities = result.force * [p.value for p in names] / result.event.force
    assert elasticities == pytest.approx([1.0, -2.0, 0.0], abs=3e-3)
    # forces have the dimension of EI/L² and EA: exact to how well the event is located
    assert elasticities[0] + elasticities[2] == pytest.approx(1.0, abs=1e-9)


# --- where there is no derivative -----------------------------------------------------------------


def test_parameter_that_breaks_the_symmetry_is_said_to_do_so(soft, traced):
    """A coupling of the pull with the soft bending is an imperfection: the corner becomes a bend."""
    engine, path = traced("A", 0.9, None, 6)
    coupling = compliance_entry(soft, "link", 1, 2)
    (result,) = critical_sensitivity(engine, soft, path, [coupling, compliance_entry(soft, "link", 2, 2)])
    assert "breaks the symmetry" in result.reasons[0]
    assert result.reasons[1] == ""
    assert np.isnan([result.force[0], result.s[0]]).all()
    assert np.isfinite([result.force[1], result.s[1]]).all()
    # and so it does
    broken = engine.trace(coupling.apply(soft, 1e-3 * coupling.scale), path.load_case)
    assert EventKind.BIFURCATION not in [event.kind for event in broken.events]
    assert EventKind.BIFURCATION in [event.kind for event in path.events]


def test_two_modes_at_once_have_a_kink(soft):
    link = soft.beams[1]
    round_link = replace(link, section=replace(link.section, EIy=link.section.EIz))
    alike = replace(soft, parts=tuple(round_link if part is link else part for part in soft.parts))
    path = VjmEngine(2).trace(alike, LoadCase("A", -3.0, steps=4))
    (result,) = critical_sensitivity(VjmEngine(2), alike, path, [section_value(alike, "link", "EIz")])
    assert "two modes" in result.reasons[0]
    assert np.isnan(result.force[0])


# --- parameters -----------------------------------------------------------------------------------


def test_parameters_know_their_present_value(soft):
    for parameter in one_of_each(soft, "B", None) + one_of_each(soft, "B", 4):
        same = parameter.apply(soft, parameter.value)
        at = VjmEngine(4).model(same).kinematics(np.zeros(VjmEngine(4).model(same).size))
        before = VjmEngine(4).model(soft).kinematics(np.zeros(VjmEngine(4).model(soft).size))
        assert np.array_equal(at.end, before.end), parameter.name
        assert np.array_equal(VjmEngine().model(same).stiffness, VjmEngine().model(soft).stiffness), parameter.name
        assert np.array_equal(same.posture("B"), soft.posture("B")), parameter.name


def test_parameters_are_set_one_after_the_other(soft):
    first, second = beam_length(soft, "link"), section_value(soft, "link", "EA")
    third, fourth = compliance_entry(soft, "link", 1, 1), orientation(soft, "link", "x")
    changed = fourth.apply(third.apply(second.apply(first.apply(soft, 300.0), 1e6), 1e-5), 0.1)
    link = changed.beams[1]
    assert (link.length, link.section.EA, link.compliance[0, 0]) == (300.0, 1e6, 1e-5)
    assert np.allclose(link.own_frame, turn([1.0, 0.0, 0.0], 0.1)[:3, :3] @ soft.beams[1].own_frame, atol=1e-15)


def test_a_parameter_of_ones_own(soft, traced):
    """Where the base stands changes nothing: forces are counted in world axes, and the base only shifts."""
    engine, path = traced("B", 4.0, None, 4)
    shift = Parameter("base x", "mm", 0.0, 1.0, lambda c, v: replace(c, base=frame(p=[v, 0, 0]) @ c.base))
    found = wrench_sensitivity(engine, soft, path, [shift])
    assert np.abs(found[..., 0] / engine.model(soft).wrench_scale).max() < 1e-8


def test_an_offset_and_a_joint_turn_with_what_is_behind(soft):
    parts = (RigidOffset("bracket", frame(p=[10.0, 0.0, 0.0])), *soft.parts)
    chain = replace(soft, parts=parts)
    turned = orientation(chain, "bracket", "z").apply(chain, 0.1)
    assert turned.parts[0].transform[:2, 3] == pytest.approx([10.0 * np.cos(0.1), 10.0 * np.sin(0.1)], rel=1e-15)
    joint = orientation(chain, "q2", "x").apply(chain, np.pi / 2.0)
    assert joint.joints[1].axis == pytest.approx([0.0, -1.0, 0.0], abs=1e-15)


def test_path_of_another_engine_and_new_coordinates_are_refused(soft, chain, traced):
    engine, path = traced("B", 4.0, None, 4)
    factor = compliance_factor(soft, "link")
    with pytest.raises(ValueError) as refusal:
        wrench_sensitivity(VjmEngine(2), soft, path, [factor])
    assert "not of this engine and chain" in str(refusal.value)
    gap = Parameter("drive", "mm/N", 0.0, 1e-6, lambda c, v: c.with_actuator_compliance(abs(v)))
    rigid = engine.trace(chain, LoadCase("B", 1.0, steps=2))
    with pytest.raises(ValueError) as refusal:
        wrench_sensitivity(engine, chain, rigid, [gap])
    assert "changes the chain's coordinates" in str(refusal.value)
    bare = replace(path, events=tuple(replace(event, point=None) for event in path.events))
    with pytest.raises(ValueError) as refusal:
        critical_sensitivity(engine, soft, bare, [factor])
    assert "no state" in str(refusal.value)
    free = replace(path, load_case=replace(path.load_case, free=("rx",)))
    with pytest.raises(ValueError) as refusal:
        wrench_sensitivity(engine, soft, free, [factor])
    assert "whole imposed pose only" in str(refusal.value)


@pytest.mark.parametrize("make", [two_legs, y_tree, lambda: load_model("orthoglide")])
def test_branches_and_loops_are_refused(make):
    """Of one line of bodies alone: for two legs that meet they gave 4.0e6 N a unit, and differences -1.1e4 N."""
    machine = make()
    with pytest.raises(ValueError, match="of critical points in branches"):
        Sensitivity(VjmEngine(), machine, [compliance_factor(machine, machine.beams[0].name)])
