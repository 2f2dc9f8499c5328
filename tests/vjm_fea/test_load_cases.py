"""Loads, free pose components, weight and controlled points on finite elements: closed forms, on either engine."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.elements import either
from helpers.file_texts import model_text, part_text, section_of
from scipy.optimize import brentq
from scipy.special import jv

import vjm
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, translation
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_validation.exact import elastica

EI, LENGTH, EA = 1e6, 100.0, 1e7
PLANE = ("x", "y", "rz")


def cantilever(mass: float = 0.0, *behind) -> Machine:
    """A clamped bar along x, 100 mm long, stiffer out of the plane than in it."""
    section = Section(EA, GJ=EI, EIy=2.0 * EI, EIz=EI, mass=mass)
    return Machine("cantilever", (Beam("link", LENGTH, section=section), *behind), postures={"-": np.zeros(0)})


def tip(force, *, follower=False, ramped=True) -> Load:
    return Load((*force, 0.0, 0.0, 0.0), follower=follower, ramped=ramped)


def order(errors) -> np.ndarray:
    return np.log2(np.abs(np.array(errors[:-1]) / np.array(errors[1:])))


def stiff(chain: Machine) -> Machine:
    """The same beam, a hundred times as stiff along itself: the elastica does not stretch."""
    (beam,) = chain.parts
    return replace(chain, parts=(replace(beam, section=replace(beam.section, EA=100.0 * EA)),))


@pytest.mark.parametrize("follower", [False, True])
def test_a_tip_force_bends_the_cantilever_as_the_elastica(follower):
    """F L²/EI = 3, once keeping its direction, once normal to the tip."""
    exact = (elastica.follower_force if follower else elastica.dead_force)(3.0)
    force = 3.0 * EI / LENGTH**2
    errors = []
    for n in (2, 4, 8):
        load_case = LoadCase("-", force, "load", free=COMPONENTS, loads=(tip((0.0, 1.0, 0.0), follower=follower),))
        path = ExudynEngine(elements=n).trace(stiff(cantilever()), replace(load_case, steps=6))
        end = path.points[-1]
        assert path.complete
        assert set(path.unstable) == {0}
        errors.append(np.hypot(*(end.displacement[:2] / LENGTH - [exact.x - 1.0, exact.y])))
        turned = end.displacement[5]
        assert turned == pytest.approx(exact.theta, abs=2.0 * errors[-1] + 1e-6)
        across = force if not follower else force * np.array([-np.sin(turned), np.cos(turned)])
        # the error measured is rounding alone
        assert end.wrench[:2] == pytest.approx(across if follower else [0.0, across], abs=1e-8 * force)
    # bending in a plane is of fourth order; the stretch F/EA = 3e-7 does not show yet
    assert order(errors) == pytest.approx(4.0, abs=0.4)
    assert errors[-1] < 1e-5


@pytest.mark.slow
@either
def test_the_tangent_is_the_load_s_derivative_by_its_own_displacement(engine):
    loads = (tip((0.0, 1.0, 0.0)),)
    path = engine(8).trace(cantilever(), LoadCase("-", 200.0, "load", free=PLANE, loads=loads, steps=40))
    slope = np.gradient(path.force, path.displacement[:, 1], edge_order=2)
    # second differences of forty steps
    assert path.tangent[2:-2] == pytest.approx(slope[2:-2], rel=1e-3)


@pytest.mark.quick_cases(3)
@either
@pytest.mark.parametrize(
    ("joints", "free", "factor"),
    [((), ("rz",), 2.0457485159), ((), ("y", "rz"), 0.25), (("base",), ("rz",), 1.0), (("base", "tip"), (), 1.0)],
)
@pytest.mark.parametrize("force", [False, True], ids=["displacement", "force"])
def test_columns_buckle_as_their_ends_are_held(engine, joints, free, factor, force):
    """Euler's loads, whether the end is pushed by a displacement or by a dead load; clamped, tan kL = kL."""
    hinge = {name: Joint(name, AXES["z"], passive=True) for name in joints}
    parts = (
        *(hinge[j] for j in joints if j == "base"),
        *cantilever().parts,
        *(hinge[j] for j in joints if j == "tip"),
    )
    chain = Machine("column", parts, postures={"-": np.zeros(len(joints))})
    euler = factor * np.pi**2 * EI / LENGTH**2
    exact = 0.5 * EA * (1.0 - np.sqrt(1.0 - 4.0 * euler / EA))
    push = tip((1.0, 0.0, 0.0))
    load_case = (
        LoadCase("-", -1.1 * exact, "load", free=("x", *free), loads=(push,))
        if force
        else LoadCase("-", -1.1 * exact * LENGTH / EA, free=free)
    )
    path = engine(8).trace(chain, load_case)
    event = path.critical
    assert path.complete
    assert event.kind is EventKind.BIFURCATION
    assert event.switched
    # fourth order: eight of Exudyn's elements in a half wave are 2.1e-4 off, OpenSees' 7e-5
    assert event.force == pytest.approx(exact, rel=3e-4 * max(1.0, factor**2))
    assert event.point.displacement[0] == pytest.approx(-event.force * LENGTH / EA, rel=1e-9)
    assert path.points[-1].unstable == 0


@pytest.mark.slow
@either
@pytest.mark.parametrize("share", [0.25, 0.45])
def test_partly_following_load_loses_stability_where_it_should(engine, share):
    """At cos kL = η/(η − 1) for shares η up to one half (Ziegler, *Principles of Structural Stability*, 1968)."""
    critical = np.arccos(share / (share - 1.0)) ** 2 * EI / LENGTH**2
    loads = (tip((1.0 - share, 0.0, 0.0)), tip((share, 0.0, 0.0), follower=True))
    errors = []
    for n in (4, 8):
        path = engine(n).trace(
            stiff(cantilever()), LoadCase("-", -1.05 * critical, "load", free=PLANE, loads=loads)
        )
        assert path.critical.kind is EventKind.BIFURCATION
        errors.append(path.critical.force / critical - 1.0)
    assert order(errors) == pytest.approx(4.0, abs=0.5)
    assert abs(errors[-1]) < 2e-4


@either
def test_a_fully_following_load_never_diverges(engine):
    """Beck's column has no static instability: flutter at 20.05 EI/L² needs masses, which statics has not."""
    load = tip((1.0, 0.0, 0.0), follower=True)
    path = engine(4).trace(cantilever(), LoadCase("-", -30.0 * EI / LENGTH**2, "load", free=PLANE, loads=(load,)))
    assert path.complete
    assert not path.events
    assert set(path.unstable) == {0}


@pytest.mark.slow
@either
def test_a_column_under_its_own_weight_buckles_at_greenhills_load(engine):
    """(q L)_cr = (9/4) j² EI/L², j the first zero of the Bessel function J_{−1/3} (Greenhill 1881)."""
    j = brentq(lambda z: jv(-1.0 / 3.0, z), 1.0, 2.5, xtol=1e-14)
    heavy = stiff(cantilever(mass=2.25 * j**2 * EI / LENGTH**2 / LENGTH / 9.81))
    errors = []
    for n in (4, 8):
        path = engine(n).trace(heavy, LoadCase("-", 1.05, "load", free=COMPONENTS, gravity=(-9.81, 0.0, 0.0)))
        assert path.critical.kind is EventKind.BIFURCATION
        errors.append(path.critical.force - 1.0)
    assert order(errors) == pytest.approx(4.0, abs=0.5)
    assert abs(errors[-1]) < 3e-5


@either
@pytest.mark.parametrize("elements", [1, 3])
def test_weight_bends_a_cantilever_as_beam_theory_says(engine, elements):
    q = 1e-5 * 9.81
    load_case = LoadCase(
        "-", 1e-6, "load", free=COMPONENTS, gravity=(0.0, -9.81, 0.0), loads=(tip((0.0, 1.0, 0.0)),)
    )
    start = engine(elements).problem(cantilever(mass=1e-5), load_case).unloaded()
    # nodes are where beam theory has them on any mesh
    assert start.displacement[1] == pytest.approx(-q * LENGTH**4 / (8.0 * EI), rel=1e-8)
    assert start.displacement[5] == pytest.approx(-q * LENGTH**3 / (6.0 * EI), rel=1e-9)
    assert start.unstable == 0


@either
def test_a_mass_on_a_rigid_piece_hangs_at_its_middle(engine):
    chain = cantilever(0.0, RigidOffset("arm", translation([0.0, 40.0, 0.0]), mass=2.0))
    load_case = LoadCase("-", 1e-3, "load", free=COMPONENTS, gravity=(0.0, 0.0, -9.81), steps=1)
    twist = engine(4).trace(chain, load_case).points[-1].displacement[3]
    # the weight's lever about the bar's axis is half of the arm
    assert twist == pytest.approx(-1e-3 * 2.0 * 9.81 * 20.0 * LENGTH / EI, rel=4e-8)


@either
def test_a_force_between_nodes_gets_a_node_of_its_own(engine):
    """A dead force at 0.3 of a cantilever, once on a mesh that has a node there and once on one that has not."""
    load = Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), "link", 0.3)
    load_case = LoadCase("-", 1.0, "load", free=PLANE, loads=(load,), steps=1)
    for n in (1, 4, 10):
        end = engine(n).trace(cantilever(), load_case).points[-1]
        a = 0.3 * LENGTH
        # F a² (3 L − a)/(6 EI), to the second order of a turn of 5e-4
        assert end.displacement[1] == pytest.approx(a**2 * (3.0 * LENGTH - a) / (6.0 * EI), rel=1e-6)


@either
def test_a_point_controls_the_path_by_its_own_displacement(engine):
    """The same states as under the load, at the displacements that were asked for."""
    load = Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), "link", 0.5)
    control = PointControl("link", 0.5, (0.0, 2.0, 0.0))
    load_case = LoadCase("-", 12.0, "load", free=PLANE, loads=(load,), steps=4, control=control)
    path = engine(4).trace(cantilever(), load_case)
    middle = next(i for i, s in enumerate(path.stations) if s.fraction == 0.5)
    gone = np.array([p.shape[middle][1] for p in path.points])
    assert gone == pytest.approx([0.0, 3.0, 6.0, 9.0, 12.0], abs=1e-8)
    pushed = engine(4).trace(cantilever(), replace(load_case, to=path.force[-1], control="ramp", steps=3))
    # the error measured is rounding alone
    assert path.points[-1].displacement == pytest.approx(pushed.points[-1].displacement, abs=1e-8)


@either
def test_what_the_chain_cannot_bear_is_said(engine):
    load_case = LoadCase(
        "-", 1.0, "load", free=COMPONENTS, gravity=(-9810.0, 0.0, 0.0), loads=(tip((0.0, 1.0, 0.0)),)
    )
    with pytest.raises(NoConvergenceError, match="does not bear its constant loads: stable up to"):
        engine(3).trace(cantilever(mass=1.0), load_case)


@either
def test_load_cases_that_make_no_sense_are_refused_by_name(engine):
    def trace(**of_load_case):
        load = of_load_case.pop("load", tip((0.0, 1.0, 0.0)))
        ramp = {"to": 1.0, "axis": "load", "free": COMPONENTS, "loads": (load,)}
        engine(2).trace(cantilever(), LoadCase("-", **{**ramp, **of_load_case}))

    force = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="no part 'lever' with points on it"):
        trace(load=Load(force, "lever"))
    with pytest.raises(ValueError, match=r"part 'link' has points from 0 to 1 of its length, not at 1\.5"):
        trace(load=Load(force, "link", 1.5))
    with pytest.raises(ValueError, match="does not take imperfections"):
        trace(imperfection=0.1)
    arm = RigidOffset("arm", translation([10.0, 0.0, 0.0]))
    chain = Machine("on an arm", (arm, *cantilever().parts), postures={"-": np.zeros(0)})
    controlled = LoadCase("-", 1.0, "load", free=PLANE, loads=(tip((0.0, 1.0, 0.0)),),
                        control=PointControl("arm", 0.5, (0.0, 1.0, 0.0)))  # fmt: skip
    with pytest.raises(ValueError, match="part 'arm' is fixed to the base"):
        engine(2).trace(chain, controlled)


@pytest.mark.slow
@pytest.mark.parametrize("length", [0.3, 1.0])
def test_short_elements_as_end_springs_of_a_sway_column(length):
    """A rigid bar on two beams that are so short that rounding is 1e-4 of the critical load."""
    k, bar = 1e6, 300.0
    section = Section(1e9, 1e9, 1e9, k * length)
    ends = [Beam(name, length, section=section) for name in ("a", "b")]
    parts = (ends[0], RigidOffset("bar", translation([bar, 0.0, 0.0])), ends[1])
    chain = Machine("sway", parts, postures={"-": np.zeros(0)})
    load_case = LoadCase("-", 3.0 * k / bar, "load", free=("x", "y"), loads=(tip((-1.0, 0.0, 0.0)),))
    ours, lumped = (e.trace(chain, load_case) for e in (ExudynEngine(elements=2), VjmEngine(1)))
    assert lumped.complete
    assert ours.complete, ours.stopped
    assert ours.critical.switched
    # the error measured is 1e-4
    assert ours.critical.s == pytest.approx(lumped.critical.s, rel=1e-3)
    # rigid links and hinges: two springs k bear P at P L = 2 k, but for the beams' own lengths
    assert lumped.critical.s == pytest.approx(2.0 * k / bar, rel=5.0 * length / bar)


# K^F of an end-effector that nothing holds, under forces and moments, by every engine that traces it.


WRENCHES = {
    "none": (0.0,) * 6,
    "force": (0.0, 0.0, 100.0, 0.0, 0.0, 0.0),
    "moment": (0.0, 0.0, 0.0, 1e4, 2e4, 0.0),
    "both": (30.0, -20.0, 50.0, 1e4, 0.0, 5e3),
}


def apart(found, expected) -> float:
    size = np.sqrt(np.abs(np.diag(expected)))
    return float(np.abs((found - expected) / size[:, None] / size).max())


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("wrench", WRENCHES)
@pytest.mark.parametrize(("model", "posture", "engine"), [
    ("ur10", "work", "exudyn"), ("planar-2r", "bent", "exudyn"), ("planar-2r", "bent", "opensees"),
])  # fmt: skip
def test_elements_and_springs_agree(model: str, posture: str, engine: str, wrench: str):
    """6e-7 was measured under loads: 16 elements and 16 springs a beam are that near to each other."""
    found, expected = (
        vjm.stiffness(vjm.load(model), posture, wrench=WRENCHES[wrench], engine=each) for each in (engine, "vjm")
    )
    assert apart(found.unloaded, expected.unloaded) < 1e-7
    assert apart(found.loaded, expected.loaded) < 2e-5
    assert found.displacement == pytest.approx(expected.displacement, rel=1e-4, abs=2e-6)


@pytest.mark.slow
def test_a_platform_too():
    robot = vjm.load("orthoglide")
    # elements know no printed matrices: those of the sections instead
    robot = replace(robot, parts=tuple(
        replace(part, compliance=None, own_segments=None) if isinstance(part, Beam) else part
        for part in robot.parts
    ))  # fmt: skip
    found, expected = (
        vjm.stiffness(robot, "isotropic", wrench=WRENCHES["both"], engine=each, options=vjm.EngineOptions(6))
        for each in ("exudyn", "vjm")
    )
    # six elements and six springs a beam: 2e-6 was measured under the load, and 6e-10 without
    assert apart(found.loaded, expected.loaded) < 5e-5
    assert apart(found.unloaded, expected.unloaded) < 2e-8


@pytest.mark.parametrize("wrench", ["force", "moment", "both"])
def test_a_path_ends_with_the_same_stiffness(wrench: str):
    chain = vjm.load("planar-2r")
    case = LoadCase("bent", 1.0, "load", loads=(Load(WRENCHES[wrench]),), free=COMPONENTS, steps=2)
    expected = vjm.stiffness(chain, "bent", wrench=WRENCHES[wrench])
    point = vjm.trace(chain, case).points[-1]
    # two solvers of the same equations: the path's has the pose of a support among them, 5e-9 mm off
    assert apart(point.stiffness, expected.loaded) < 1e-8
    assert point.displacement == pytest.approx(expected.displacement, rel=1e-8, abs=5e-8)


def test_what_cannot_move_is_infinitely_stiff():
    """The stretched UR10: six joints do not deflect in all directions there."""
    chain = vjm.load("ur10")
    case = LoadCase("stretched", 1.0, "load", loads=(Load(WRENCHES["force"]),), free=COMPONENTS, steps=1)
    for engine in ("vjm", "exudyn"):
        assert np.all(np.isinf(vjm.trace(chain, case, engine=engine).points[0].stiffness))


STRESSED = model_text(
    "stressed",
    part_text("actuated", "turn", axis="y", compliance_rad_per_Nmm=1e-7),
    part_text("beam", "upper", length_mm=300.0, section=section_of("round_tube", 50.0, 3.0)),
    part_text("joint", "slide", axis="z", motion="slides", stiffness_N_per_mm=100.0, rest_mm=10.0),
    postures={"bent": {"turn": 0.3, "slide": 20.0}},
)


def test_without_a_load_a_stressed_machine_moves_its_free_end(tmp_path):
    """The slide's spring is 10 mm from its rest: at its end nothing holds it, so that it goes there."""
    (tmp_path / "stressed.toml").write_text(STRESSED)
    machine = vjm.load(str(tmp_path / "stressed.toml"))
    for engine in ("exudyn", "vjm"):
        found = vjm.stiffness(machine, "bent", wrench=(0.0,) * 6, engine=engine)
        assert np.all(found.wrench == 0.0)
        # along the slide, which the turn of 0.3 rad about y has tilted: the shaft bears no force
        expected = 10.0 * np.array([-np.sin(0.3), 0.0, -np.cos(0.3)])
        # 1e-8 mm is what the load that stands for none, 1e-9 N, and both solvers' residuals come to
        assert found.displacement[:3] == pytest.approx(expected, abs=1e-7), engine
