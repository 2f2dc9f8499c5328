"""Which way a branch leaves: by formulas, by mechanisms with a closed form, and where it cannot be told."""

import numpy as np
import pytest
from helpers.file_texts import model_text, table_text

import vjm
from vjm.continuation.arc_length import trace
from vjm.continuation.branch_shape import Leaving, branch_shape
from vjm.continuation.path import Equilibrium, EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import ARC, COMPONENTS, RAMP, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, translation

SIZES = np.array([1e-3 * 2.0**k for k in range(8)])


def point(s, amplitude=0.0, unstable=0):
    """A state whose only coordinate is the amplitude."""
    state = np.array([amplitude, s])
    return Equilibrium(
        s, np.zeros(6), np.zeros(6), 0.0, -1.0 if unstable else 1.0, unstable, 0, 0.0,
        np.array([[0.0, 0.0, 0.0], [1.0, amplitude, 0.0]]), state,
    )  # fmt: skip


def shape_of(parameter, unstable=1):
    def along(amplitude, _):
        s = parameter(amplitude)
        return point(s, amplitude, unstable if s < 7.0 else 0)

    return branch_shape(along, point(7.0), np.array([1.0, 0.0]), 1e-9, SIZES)


@pytest.mark.parametrize(
    ("slope", "curvature", "leaving"),
    [
        (0.0, 0.3, Leaving.SUPERCRITICAL),
        (0.0, -0.3, Leaving.SUBCRITICAL),
        (2.0, 0.3, Leaving.ASYMMETRIC),
        (-2.0, 0.3, Leaving.ASYMMETRIC),
    ],
)
def test_a_branch_is_told_by_its_coefficients(slope, curvature, leaving):
    # the fourth power stands for what follows
    found = shape_of(lambda a: 7.0 + slope * a + curvature * a**2 + a**4)
    assert found.leaving is leaving
    # extrapolation takes the fourth power away; the critical value's resolution over the amplitude's square is left
    wanted = slope or curvature
    assert (found.slope or found.curvature) == pytest.approx(wanted, abs=2e-3)
    assert abs((found.slope or found.curvature) - wanted) <= found.error + 1e-12
    assert str(leaving) in str(found)


@pytest.mark.parametrize("offset", [1e-3, -1e-3, 1.0, -1.0])
@pytest.mark.parametrize("curvature", [0.3, -0.3, 900.0])
def test_points_of_another_branch_say_nothing(offset, curvature):
    # their differences are as regular as the branch's own: only the critical value tells
    found = shape_of(lambda a: 7.0 + offset + curvature * a**2)
    reach = abs(curvature) * SIZES[-1] ** 2
    # an offset of a hundredth of the change cannot turn the sign, and is in the error
    assert found.leaving is Leaving.UNDECIDED or abs(offset) < 0.01 * reach
    assert found.leaving is Leaving.UNDECIDED or abs(found.curvature - curvature) <= found.error


def test_a_shape_away_from_the_critical_one_says_nothing():
    def along(amplitude, _):
        there = point(7.0 - 0.3 * amplitude**2, amplitude, 1)
        return Equilibrium(**{**vars(there), "shape": there.shape + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]])})

    found = branch_shape(along, point(7.0), np.array([1.0, 0.0]), 1e-9, SIZES)
    assert found.leaving is Leaving.UNDECIDED
    assert "mm away" in str(found)


def test_a_falling_branch_that_is_stable_is_not_believed():
    found = shape_of(lambda a: 7.0 - 0.3 * a**2, unstable=0)
    assert found.leaving is Leaving.UNDECIDED
    assert "stable" in str(found)


def test_rounding_alone_decides_nothing():
    rng = np.random.default_rng(0)
    for _ in range(50):
        found = shape_of(lambda _: 7.0 + 1e-9 * rng.standard_normal())
        assert found.leaving is Leaving.UNDECIDED
        assert "undecided" in str(found)


def test_rounding_is_outgrown():
    rng = np.random.default_rng(1)
    found = shape_of(lambda a: 7.0 - 0.3 * a**2 + 1e-6 * rng.standard_normal())
    assert found.leaving is Leaving.SUBCRITICAL
    assert found.curvature == pytest.approx(-0.3, rel=0.1)
    assert abs(found.curvature + 0.3) <= 3.0 * found.error


def test_a_branch_that_is_not_found_is_undecided_and_says_why():
    def lost(_, __):
        raise NoConvergenceError("no such point")

    found = branch_shape(lost, point(7.0), np.array([1.0, 0.0]), 1e-9, SIZES)
    assert found.leaving is Leaving.UNDECIDED
    assert "no such point" in str(found)


def sprung_column(stiffness, share):
    """Two beams of 1000 mm between pins, with a sprung hinge at a share of the length."""
    section = Section(1e9, 1e9, 5e9, 1e8)
    parts = (
        Joint("a", AXES["z"], passive=True), Beam("b1", 1000.0 * share, section=section),
        Joint("m", AXES["z"], passive=True, compliance=1.0 / stiffness),
        Beam("b2", 1000.0 * (1.0 - share), section=section), Joint("c", AXES["z"], passive=True),
    )  # fmt: skip
    return Machine("sprung", parts, postures={"p": np.zeros(2)}, held={"p": {"m": 0.0}})


def pushed(to, **of_case):
    load = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return LoadCase("p", to, "load", free=of_case.pop("free", ("x",)), loads=(load,), **of_case)


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize("steps", [None, 50, 80])
@pytest.mark.parametrize("segments", [4, 8, 16])
@pytest.mark.parametrize(("stiffness", "to", "share"), [(1e6, 1700.0, 0.5), (1e5, 1000.0, 0.5), (1e6, 2300.0, 0.3)])
def test_where_pinned_ends_meet_the_branch_falls_with_the_cosine(segments, steps, stiffness, to, share):
    """The closed loop turns by φ about the pins: P cos φ. Both pins turn, a² = 2 φ², so c₂ = −P/4."""
    path = VjmEngine(segments).trace(sprung_column(stiffness, share), pushed(to, steps=steps))
    first, second = path.events
    assert first.kind is second.kind is EventKind.BIFURCATION
    assert second.point.displacement[0] == pytest.approx(-1000.0, abs=1e-3)
    problem = VjmEngine(segments).problem(sprung_column(stiffness, share), pushed(to, steps=steps))
    (shape,) = problem.branch_shapes(second.point)
    assert shape.leaving is Leaving.SUBCRITICAL
    # the critical load is known to 1e-9 of the path, 0.3 % of the change at the smallest amplitude
    assert shape.curvature == pytest.approx(-0.25 * second.force, rel=2e-3)
    assert abs(shape.curvature + 0.25 * second.force) <= shape.error
    assert "subcritical" in path.stopped
    assert set(path.unstable) == {0}


def test_an_arc_goes_along_the_cosine():
    path = VjmEngine(8).trace(sprung_column(1e5, 0.5), pushed(1000.0, control=ARC))
    lost = path.events[1]
    # found by refinement: it is unstable from 477.905 to 479.05 N only
    assert lost.force == pytest.approx(477.905, rel=1e-6)
    behind = [point for point in path.points if lost.s < point.s < path.events[2].s]
    assert min(point.unstable for point in behind) == 1
    # the ends stay together, and the load goes through the whole circle
    assert all(point.displacement[0] == pytest.approx(-1000.0, abs=1e-6) for point in behind)
    assert path.events[2].force == pytest.approx(-lost.force, rel=1e-6)
    assert "closed" in path.stopped


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize(("control", "steps"), [(RAMP, None), (RAMP, 20), (RAMP, 30), (RAMP, 50), (ARC, None)])
@pytest.mark.parametrize("to", [592.0, 700.0, 1000.0, 1300.0])
def test_a_short_unstable_stretch_is_found(control, steps, to):
    """From 477.905 to 479.05 N, where another mode comes and goes again behind the one that is softest besides."""
    path = VjmEngine(8).trace(sprung_column(1e5, 0.5), pushed(to, control=control, steps=steps))
    assert [event.force for event in path.events][1] == pytest.approx(477.905, rel=1e-6)


def test_a_link_on_a_sprung_hinge_rises_as_the_angle_over_its_sine():
    """P = k φ / L sin φ: c₂ = P/6 of the angle's square.

    The end turns back by φ and shifts by φ lengths, a² = 3 φ².
    """
    hinge = Joint("h", AXES["z"], passive=True, compliance=1e-05)
    parts = (hinge, RigidOffset("l", translation([100.0, 0.0, 0.0])))
    chain = Machine("link", parts, postures={"p": np.zeros(0)}, held={"p": {"h": 0.0}})
    case = pushed(1500.0, free=COMPONENTS)
    problem = VjmEngine().problem(chain, case)
    event = trace(problem, case).critical
    assert event.force == pytest.approx(1000.0, rel=1e-9)
    (shape,) = problem.branch_shapes(event.point)
    assert shape.leaving is Leaving.SUPERCRITICAL
    assert shape.error < 0.1 * shape.curvature
    assert shape.curvature == pytest.approx(1000.0 / 18.0, abs=shape.error)
    # in the hinge's own angle
    assert shape.measure[:2] == ("rotation of h", "rad")
    assert shape.coefficient == pytest.approx(1000.0 / 6.0, rel=1e-3)
    assert "times the square of the rotation of h in rad" in shape.how


def test_a_round_link_says_how_it_leaves_in_both_directions():
    hinges = [Joint(name, AXES[name], passive=True, compliance=1e-05) for name in "yz"]
    parts = (*hinges, RigidOffset("l", translation([100.0, 0.0, 0.0])))
    chain = Machine("link", parts, postures={"p": np.zeros(0)}, held={"p": {"y": 0.0, "z": 0.0}})
    case = pushed(1500.0, free=COMPONENTS)
    problem = VjmEngine().problem(chain, case)
    event = trace(problem, case).critical
    assert event.multiplicity == 2
    # universal hinges are not round beyond the second order: the branch rises along each axis and between them
    assert {shape.leaving for shape in problem.branch_shapes(event.point)} == {Leaving.SUPERCRITICAL}


PROPPED = model_text(
    "propped",
    table_text("[bodies]", name="bar"),
    table_text("[joints]", name="foot", kind="joint", between=["ground", "bar"], at_mm=[0.0, 0.0, 0.0], axis="z"),
    table_text("[bodies]", name="far"),
    table_text(
        "[joints]",
        name="far_hinge",
        kind="joint",
        stiffness_Nmm_per_rad=1e6,
        between=["ground", "far"],
        at_mm=[300.0, 0.0, 0.0],
        axis="y",
    ),
    table_text(
        "[point_springs]",
        name="prop",
        between=["ground", "bar"],
        points_mm=[[100.0, 0.0, 0.0], [0.0, 100.0, 0.0]],
        stiffness_N_per_mm=8.0,
        free_length_mm=141.4213562373095,
    ),
    kind="bodies",
    end={"body": "bar", "at_mm": [0.0, 100.0, 0.0]},
)


def test_a_propped_bar_leaves_with_three_eighths_of_its_spring_to_a_radian(tmp_path):
    """P = k L/2 (1 - 3/4 θ), pressed: 400 N, and 300 N to a radian of the foot's angle."""
    file = tmp_path / "propped.toml"
    file.write_text(PROPPED, encoding="utf-8")
    machine = vjm.load(str(file))
    push = Load((0.0, -1.0, 0.0, 0.0, 0.0, 0.0))
    case = LoadCase(next(iter(machine.postures)), 600.0, "load", free=COMPONENTS, loads=(push,))
    problem = VjmEngine().problem(machine, case)
    event = trace(problem, case).critical
    assert event.force == pytest.approx(400.0, rel=1e-9)
    (shape,) = problem.branch_shapes(event.point)
    assert shape.leaving is Leaving.ASYMMETRIC
    assert shape.measure[:2] == ("rotation of foot", "rad")
    # the third order is extrapolated away
    assert abs(shape.coefficient) == pytest.approx(300.0, rel=1e-4)
    assert "times the rotation of foot in rad" in shape.how
