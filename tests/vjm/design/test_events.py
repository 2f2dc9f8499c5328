"""How critical points of imposed paths move with parameters: against paths traced anew, and dimensions alone."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.closed_machines import two_legs
from helpers.parameters import joint_compliance, orientation

from vjm.continuation.path import EventKind
from vjm.design.critical import event_rates
from vjm.design.linear_state import loaded_posture
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


def rates_of(engine, machine, path, parameters, which=0):
    """Of one event of a path; of a knee with the slopes of the unloaded stiffness by differences."""
    case = path.load_case
    asked = loaded_posture(machine, case.posture, displacement=np.zeros(6), engine=engine)

    def unloaded(parameter):
        def stiffness(value):
            return engine.problem(parameter.apply(machine, value), case).unloaded().tangent

        return difference(stiffness, parameter, 1e-3)

    path = replace(path, events=path.events[which : which + 1])
    return event_rates(asked, path, parameters, np.array([unloaded(parameter) for parameter in parameters]))


def difference(function, parameter: Parameter, step: float) -> np.ndarray:
    """Derivative by central differences of fourth order, over a fraction of the parameter's scale."""
    h, value = step * parameter.scale, parameter.value
    near = function(value + h) - function(value - h)
    far = function(value + 2.0 * h) - function(value - 2.0 * h)
    return (8.0 * near - far) / (12.0 * h)


EVENTS = [("A", 0.9, None, 6, 0), ("A", -2.9, 4, 6, 0), ("B", -8.5, 4, 8, 0), ("D", -17.0, 4, 34, 1)]


@pytest.mark.quick_cases(2)
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
    result, located = rates_of(engine, soft, path, parameters, which), path.events[which]
    assert result.reasons == ("",) * len(parameters)
    for k, parameter in enumerate(parameters):

        def event(value, parameter=parameter):
            found = engine.trace(parameter.apply(soft, value), path.load_case).events[which]
            assert found.kind is located.kind
            return np.array([found.force, found.s])

        force, s = difference(event, parameter, 2e-3) * parameter.scale
        # Events are located to 1e-9 of the path, over a step of 2e-3: 1e-6. A limit point's displacement is where
        # a flat curve is highest.
        allowed = 1e-5 if located.kind is EventKind.LIMIT else 3e-6
        assert result.force[k] * parameter.scale == pytest.approx(force, rel=3e-6, abs=3e-6 * located.force)
        assert result.s[k] * parameter.scale == pytest.approx(s, rel=allowed, abs=allowed * located.s)


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
    for which, event in enumerate(path.events):
        result = rates_of(engine, soft, path, springs, which)
        # in forces the error measured is rounding alone; where a point lies is known to 1e-9, differenced over 1e-3
        assert result.force @ scale == pytest.approx(-event.force, rel=7e-9)
        assert result.s @ scale == pytest.approx(0.0, abs=1e-6 * event.s)


def test_column_buckles_by_euler(column):
    """π²EI/L² but for the shortening, 1e-3 here: EI counts once, L twice, and EA hardly."""
    path = VjmEngine(8).trace(column, LoadCase("straight", -0.2, steps=4))
    names = [section_value(column, "link", "EIz"), beam_length(column, "link"), section_value(column, "link", "EA")]
    result = rates_of(VjmEngine(8), column, path, names)
    elasticities = result.force * [p.value for p in names] / path.critical.force
    assert elasticities == pytest.approx([1.0, -2.0, 0.0], abs=3e-3)
    # forces have the dimension of EI/L² and EA: exact to how well the event is located
    assert elasticities[0] + elasticities[2] == pytest.approx(1.0, abs=1e-9)


# --- where there is no derivative -----------------------------------------------------------------


def test_parameter_that_breaks_the_symmetry_is_said_to_do_so(soft, traced):
    """A coupling of the pull with the soft bending is an imperfection: the corner becomes a bend."""
    engine, path = traced("A", 0.9, None, 6)
    coupling = compliance_entry(soft, "link", 1, 2)
    result = rates_of(engine, soft, path, [coupling, compliance_entry(soft, "link", 2, 2)])
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
    result = rates_of(VjmEngine(2), alike, path, [section_value(alike, "link", "EIz")])
    assert "two modes" in result.reasons[0]
    assert np.isnan(result.force[0])


@pytest.mark.parametrize(("make", "part", "case", "which"), [
    (lambda: load_chain("planar-2r"), "fore", LoadCase("stretched", -4.0, steps=8), 0),
    (two_legs, "", LoadCase("p", -14.0, "z", steps=8), 0),
    (two_legs, "", LoadCase("p", -18.0, "z", steps=8), 1),
    (lambda: load_model("orthoglide"), "x/link", LoadCase("isotropic", -2.8, steps=8), 0),
    (lambda: load_model("palletiser"), "rod", LoadCase("home", 27.0, "z", steps=8), 0),
])  # fmt: skip
def test_events_of_arms_and_loops_move_as_located_ones_do(make, part, case, which):
    """Held joints; a knee and a limit of two legs that meet; platforms and a linkage that buckle."""
    machine, engine = make(), VjmEngine(2)
    parameter = compliance_factor(machine, part or machine.beams[0].name)
    path = engine.trace(machine, case)
    result, nominal = rates_of(engine, machine, path, [parameter], which), path.events[which]
    assert result.reasons == ("",)

    def event(value):
        located = engine.trace(parameter.apply(machine, value), case).events[which]
        assert located.kind is nominal.kind
        return np.array([located.force, located.s])

    force, s = difference(event, parameter, 2e-3)
    # as above
    assert result.force[0] == pytest.approx(force, rel=3e-6, abs=3e-6 * nominal.force)
    assert result.s[0] == pytest.approx(s, rel=1e-5, abs=1e-5 * nominal.s)


def test_other_load_cases_and_events_without_a_state_are_refused(soft, traced):
    engine, path = traced("A", 0.9, None, 6)
    factor = compliance_factor(soft, "link")
    bare = replace(path, events=tuple(replace(event, point=None) for event in path.events))
    with pytest.raises(ValueError, match="no critical point with a state"):
        rates_of(engine, soft, bare, [factor])
    with pytest.raises(ValueError, match="not of this engine and machine"):
        rates_of(VjmEngine(2), soft, path, [factor])
    asked = loaded_posture(soft, "A", displacement=np.zeros(6), engine=engine)
    free = replace(path, load_case=replace(path.load_case, free=("rx",)))
    with pytest.raises(ValueError, match="whole imposed pose only"):
        event_rates(asked, free, [factor], np.zeros(1))


def test_what_adds_a_spring_has_no_derivative(soft, traced):
    engine, path = traced("A", 0.9, None, 6)
    other = Parameter("other", "1", 0.0, 1.0, lambda chain, _: chain.refined({"link": 3}))
    result = rates_of(engine, soft, path, [other])
    assert "adds or takes away a spring" in result.reasons[0]
    assert np.isnan(result.force[0])
