"""Whole manipulators in Exudyn, from the same files: stiffness, critical forces and errors of assembly."""

from functools import cache

import numpy as np
import pytest
from helpers.in_pose import in_pose

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine, engine_by_name
from vjm.io.machine_file import load_model
from vjm.machine.platforms import assembled, leg_wrenches, yielding_legs
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.model.machine import legs_of
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine
from vjm_validation.studies import robots
from vjm_validation.studies.robots import platform_stiffness

# six corrected elements are within 1e-4 of the beam, and so are four springs
EXUDYN = ExudynEngine(elements=6)
SPRINGS = VjmEngine(4, 4)
MACHINES = ["orthoglide", "orthoglide-parallelograms", "3-puu", "isoglide", "delta", "par2"]
CURVES = [("isotropic", "y", -3.5), ("isotropic", "z", -3.5), ("Q1", "x", -8.0), ("Q2", "y", -8.0)]
POSES = [(name, label) for name in MACHINES for label in load_model(name).poses]


def eigenvalues(K, machine):
    """Of the symmetric part, turns over the characteristic length."""
    unit = np.repeat([1.0, machine.characteristic_length], 3)
    return np.linalg.eigvalsh(0.5 * (K + K.T) / unit[:, None] / unit)


def pushed(pose, force, axis=0, **control):
    unit = tuple(np.eye(6)[axis])
    return LoadCase(pose, force, "load", loads=(Load(unit),), free=COMPONENTS, **control)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(("name", "label"), POSES)
def test_the_unloaded_stiffness_is_exudyns(name, label):
    machine = load_model(name)
    load_case = LoadCase(label, 1.0)
    ours = SPRINGS.problem(*in_pose(machine, load_case)).unloaded().stiffness
    # 0.5 % for the Orthoglide, 1 % for the others are asked; the linear beam theory is the same in both
    assert eigenvalues(ours, machine) == pytest.approx(
        eigenvalues(platform_stiffness(EXUDYN, machine, label, np.zeros(6)), machine), rel=2e-6
    )


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("label", ["isotropic", "Q1", "Q2"])
def test_under_a_kilonewton_the_stiffness_is_exudyns(label, axis):
    machine = load_model("orthoglide")
    load_case = pushed(label, -1000.0, axis, steps=2)
    ours, theirs = (engine.trace(machine, load_case).points[-1] for engine in (SPRINGS, EXUDYN))
    assert ours.unstable == theirs.unstable == 0
    assert ours.displacement[:3] == pytest.approx(
        theirs.displacement[:3], abs=1e-3 * np.abs(ours.displacement).max()
    )
    K = platform_stiffness(EXUDYN, machine, label, theirs.displacement)
    assert eigenvalues(ours.stiffness, machine) == pytest.approx(eigenvalues(K, machine), rel=5e-3)


@pytest.mark.parametrize(
    ("pose", "axis", "to"),
    [("isotropic", "x", -3.5), *(pytest.param(*case, marks=pytest.mark.slow) for case in CURVES)],
)
def test_the_force_displacement_curve_is_exudyns_past_its_critical_point(pose, axis, to):
    # the rest of the pose held, as for the chain
    machine, load_case = load_model("orthoglide"), LoadCase(pose, to, axis)
    engines = VjmEngine(8, 8), ExudynEngine(elements=8)
    ours, theirs = (engine.trace(machine, load_case) for engine in engines)
    assert ours.complete
    assert theirs.complete
    assert [event.kind for event in ours.events] == [event.kind for event in theirs.events]
    for a, b in zip(ours.events, theirs.events, strict=True):
        assert (a.s, a.force) == pytest.approx((b.s, b.force), rel=2e-3)
        if a.stiffness_after is not None:
            assert a.stiffness_after == pytest.approx(b.stiffness_after, rel=5e-3)
    assert ours.force[-1] == pytest.approx(theirs.force[-1], rel=2e-3)
    # the error measured is rounding alone
    assert ours.tangent[0] == pytest.approx(theirs.tangent[0], rel=5e-9)
    assert ours.tangent[-1] == pytest.approx(theirs.tangent[-1], rel=5e-3)


@pytest.mark.parametrize(
    ("name", "axis", "to", "free"),
    [
        ("orthoglide", "x", -2.0, ("rz",)),
        ("orthoglide", "x", -2.0, ("y", "rx")),
        ("orthoglide", "x", -2.0, ("rx", "rz")),
        ("orthoglide", "x", -2.0, ("rx", "ry")),
        pytest.param("orthoglide-parallelograms", "x", -1.0, ("z", "rz"), marks=pytest.mark.slow),
    ],
)
def test_a_platform_let_go_in_part_moves_as_in_exudyn(name, axis, to, free):
    machine, load_case = load_model(name), LoadCase("Q1", to, axis, free=free, steps=4)
    ours, theirs = (engine.trace(machine, load_case).points[-1] for engine in (SPRINGS, EXUDYN))
    # six elements and four springs differ by 4e-4 in such bending; moments are compared over those of the forces at
    # 0.1 mm from where they act
    force = np.abs(theirs.wrench[:3]).max()
    for part, least in ((slice(0, 3), 0.0), (slice(3, 6), 0.1 * force)):
        for a, b, small in ((ours.displacement, theirs.displacement, 0.0), (ours.wrench, theirs.wrench, least)):
            assert a[part] == pytest.approx(b[part], abs=2e-3 * max(np.abs(b[part]).max(), small))
    gone = [COMPONENTS.index(component) for component in free]
    assert np.all(np.abs(ours.displacement[gone]) > 1e-4)


@pytest.mark.parametrize("engine", ["vjm-linear", "msa", "opensees"])
def test_engines_that_begin_without_forces_refuse_errors_of_assembly(engine):
    machine = assembled(load_model("orthoglide"), {"x/link": 0.2})
    with pytest.raises(ValueError, match=r"does not take errors of assembly: .* take vjm or exudyn"):
        engine_by_name(engine).trace(machine, LoadCase("Q1", 0.1))


def test_exudyn_builds_no_bows():
    with pytest.raises(ValueError, match="does not take imperfections"):
        EXUDYN.trace(load_model("orthoglide"), LoadCase("Q1", 1.0, imperfection=0.1))


def first_bifurcation(problem):
    path = trace(problem, problem.load_case, ArcControl(last=EventKind.BIFURCATION))
    return next((event for event in path.events if event.kind is EventKind.BIFURCATION), None)


@pytest.mark.slow
def test_fine_meshes_and_many_springs_have_the_same_limit_point_of_the_overconstrained_robot():
    # it lies 230 mm away, the bars deflected far: both converge with the square of the segments' length, from above
    machine, load_case = load_model("orthoglide-parallelograms"), pushed("Q2", -14_000.0, control=TO_LIMIT)
    limits = {}
    engines = VjmEngine(8, 8), VjmEngine(16, 16), ExudynEngine(elements=6), ExudynEngine(elements=8)
    for engine in engines:
        (event,) = engine.trace(machine, load_case).events
        assert event.kind is EventKind.LIMIT
        limits[engine] = event.force
    a, b, c, d = limits.values()
    # 5824.2 and 5822.2 N
    assert b - (a - b) / 3.0 == pytest.approx(d - (c - d) / ((8 / 6) ** 2 - 1.0), rel=1e-3)


@cache
def critical(engine, label, sign):
    load_case = pushed(label, sign * 12000.0, control=TO_LIMIT)
    problem = engine.problem(*in_pose(load_model("orthoglide"), load_case))
    return problem, first_bifurcation(problem)


@pytest.mark.parametrize(
    "label", ["isotropic", pytest.param("Q1", marks=pytest.mark.slow), pytest.param("Q2", marks=pytest.mark.slow)]
)
def test_compressed_along_x_the_whole_robot_buckles_where_exudyns_does(label):
    problem, ours = critical(SPRINGS, label, -1)
    other, theirs = critical(EXUDYN, label, -1)
    assert ours.force == pytest.approx(theirs.force, rel=5e-3)
    assert ours.point.displacement[:3] == pytest.approx(
        theirs.point.displacement[:3], abs=5e-3 * np.abs(theirs.point.displacement).max()
    )
    shares = yielding_legs(problem, ours.point)
    bows = robots.deflecting_shares(other, theirs.point)
    assert max(shares, key=shares.get) == max(bows, key=bows.get) == "x"


@pytest.mark.slow
def test_opensees_buckles_the_whole_robot_where_the_others_do():
    pytest.importorskip("openseespy", reason="OpenSeesPy is an optional extra and is not installed")
    found = critical(OpenSeesEngine(8), "Q2", -1)[1].force
    # 4646.2 N of springs, 4647.2 N of Exudyn with 8 elements
    assert found == pytest.approx(critical(SPRINGS, "Q2", -1)[1].force, rel=5e-3)


@pytest.mark.parametrize(
    "label", ["isotropic", pytest.param("Q1", marks=pytest.mark.slow), pytest.param("Q2", marks=pytest.mark.slow)]
)
def test_pulled_along_x_only_the_papers_springs_buckle(label):
    assert critical(VjmEngine(), label, 1)[1].force < 2800.0
    assert critical(SPRINGS, label, 1)[1] is None
    assert critical(EXUDYN, label, 1)[1] is None


def test_a_chain_too_long_moves_the_platform_as_in_exudyn():
    machine = assembled(load_model("orthoglide"), {"x/link": 0.2})
    load_case = pushed("Q1", 1e-3, steps=1)
    ours, theirs = (engine.problem(*in_pose(machine, load_case)).unloaded() for engine in (SPRINGS, EXUDYN))
    assert np.linalg.norm(ours.displacement[:3]) > 0.2
    # the error measured is 3e-9
    assert ours.displacement[:3] == pytest.approx(theirs.displacement[:3], abs=6e-8 * 0.2)


def test_a_bar_too_long_strains_the_parallelograms_as_in_exudyn():
    machine = assembled(load_model("orthoglide-parallelograms"), {"bar-x1/bar": 0.2})
    load_case = pushed("Q1", 1e-3, steps=1)
    problem, exudyn = (engine.problem(*in_pose(machine, load_case)) for engine in (SPRINGS, EXUDYN))
    ours, theirs = problem.unloaded(), exudyn.unloaded()
    scale = np.abs(theirs.displacement[:3]).max(), np.abs(theirs.displacement[3:]).max()
    # the error measured is 2e-7
    assert ours.displacement[:3] == pytest.approx(theirs.displacement[:3], abs=3e-6 * scale[0])
    # the error measured is 7e-9
    assert ours.displacement[3:] == pytest.approx(theirs.displacement[3:], abs=2e-7 * scale[1])
    names = [leg.name for leg in legs_of(machine)]
    wrenches = leg_wrenches(problem, ours)
    for name in ("bar-x1", "bar-x2", "bar-z1", "bar-z2"):
        force = np.linalg.norm(wrenches[names.index(name), :3])
        assert force > 1.0
        # the error measured is 2e-7
        assert force == pytest.approx(np.linalg.norm(exudyn.beam_force(f"{name}/bar", theirs)), rel=3e-6)
