"""Paths through limit points, snap-back and subcritical branches, and imperfections: all with algebraic answers."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from vjm.continuation.arc_length import ArcControl, follow_arc
from vjm.continuation.events import root_between
from vjm.continuation.lumped_problem import imperfection_curve
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import ARC, COMPONENTS, TO_LIMIT, Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES

Z = AXES["z"]
BAR, RISE, EA = 100.0, np.deg2rad(20.0), 1e4
HEIGHT, HALF_SPAN = BAR * np.sin(RISE), BAR * np.cos(RISE)


def truss() -> Machine:
    """Two bars on three hinges, leaning against each other; they give way along themselves only."""
    stiff = Section(EA, 1e10, 1e10, 1e10)
    bars = [Beam(name, BAR, section=stiff) for name in ("left", "right")]
    joints = [Joint(name, Z, passive=True) for name in ("q1", "q2", "q3")]
    parts = (joints[0], bars[0], joints[1], bars[1], joints[2])
    return Machine("truss", parts, postures={"up": np.array([RISE, -2.0 * RISE, RISE])})


def truss_load(w):
    """Dead load on the crown against its depth: N = EA (l − l₀)/l₀ in either bar (von Mises 1923)."""
    length = np.hypot(HALF_SPAN, HEIGHT - w)
    return -2.0 * EA * (length / BAR - 1.0) * (HEIGHT - w) / length


@pytest.fixture(scope="module")
def truss_limit():
    top = minimize_scalar(
        lambda w: -truss_load(w), bounds=(0.0, HEIGHT), method="bounded", options={"xatol": 1e-10}
    )
    return -top.fun, top.x


def crown(path):
    """Depth of the crown at every point of a path."""
    where = next(i for i, s in enumerate(path.stations) if (s.part, s.fraction) == ("left", 1.0))
    return HEIGHT - np.array([p.shape[where][1] for p in path.points])


def crown_load_case(to, control):
    load = Load((0.0, -1.0, 0.0, 0.0, 0.0, 0.0), "left")
    return LoadCase("up", to, "load", loads=(load,), control=control)


def test_the_arc_leads_through_both_limit_points_of_a_truss(truss_limit):
    limit, depth = truss_limit
    path = VjmEngine(1).trace(truss(), crown_load_case(1.5 * limit, ARC))
    assert path.complete
    # the error measured is rounding alone
    assert path.points[-1].ramp == pytest.approx(1.5 * limit, rel=1e-10)
    w = crown(path)
    assert np.abs(path.force - truss_load(w)).max() < 1e-8 * limit
    assert w[-1] > 2.0 * HEIGHT
    first, second = path.events
    # a limit load is flat: it is as good as the square of its place's tolerance, 1e-9 of the arc, and rounding
    assert (first.kind, second.kind) == (EventKind.LIMIT, EventKind.LIMIT)
    assert first.force == pytest.approx(limit, rel=1e-8)
    assert second.force == pytest.approx(-limit, rel=1e-10)
    # between the limits, where the load falls, it is unstable
    falling = (w > depth) & (w < 2.0 * HEIGHT - depth)
    assert np.array_equal(path.unstable == 1, falling)
    assert set(path.unstable) == {0, 1}


def test_a_device_that_imposes_the_depth_keeps_the_truss_stable(truss_limit):
    limit, _ = truss_limit
    control = PointControl("left", 1.0, (0.0, -1.0, 0.0))
    path = VjmEngine(1).trace(truss(), crown_load_case(2.2 * HEIGHT, control))
    assert path.complete
    assert crown(path) == pytest.approx(path.s, abs=1e-9)
    assert np.abs(path.force - truss_load(path.s)).max() < 1e-8 * limit
    assert set(path.unstable) == {0}
    top = next(event for event in path.events if event.kind is EventKind.LIMIT)
    # the error measured is rounding alone
    assert top.force == pytest.approx(limit, rel=1e-10)


def test_a_gauge_that_only_watches_does_not_keep_the_truss_stable():
    """The load hangs on the crown, and what is watched is another point: beyond the limit the state is unstable."""
    control = PointControl("left", 0.5, (0.0, -1.0, 0.0))
    path = VjmEngine(1).trace(truss(), crown_load_case(0.6 * HEIGHT, control))
    assert not path.complete
    assert "stab" in path.stopped
    assert crown(path)[-1] < 0.45 * HEIGHT


def test_a_dead_load_ends_at_the_limit_and_says_so(truss_limit):
    limit, _ = truss_limit
    path = VjmEngine(1).trace(truss(), crown_load_case(1.5 * limit, "ramp"))
    assert path.stopped.startswith("the load is greatest at 163.7")
    assert path.stopped.endswith("Control 'arc' follows the path")
    assert path.events[-1].kind is EventKind.LIMIT
    # the load is flat at its limit: the error measured is rounding alone
    assert path.events[-1].force == pytest.approx(limit, rel=1e-10)


def soft_truss(compliance: float) -> Machine:
    """The truss, pushed at its crown through a spring: crown, spring, support."""
    stiff = Section(EA, 1e10, 1e10, 1e10)
    parts = (
        Joint("q1", Z, passive=True), Beam("left", BAR, section=stiff), Joint("q2", Z, passive=True),
        Joint("spring", AXES["y"], slides=True, fixed=True, compliance=compliance),
    )  # fmt: skip
    # one bar, its crown led along y by the held support: half of the symmetric truss
    return Machine("half", parts, postures={"up": np.array([RISE, -RISE])})


def test_a_driven_displacement_snaps_back_where_the_spring_is_soft():
    """δ = w + c P(w): it folds where 1 + c P'(w) = 0."""
    c = 0.3
    w = np.linspace(0.0, 2.0 * HEIGHT, 200001)
    driven = w + c * 0.5 * truss_load(w)
    folds = np.flatnonzero(np.diff(np.sign(np.diff(driven)))) + 1
    assert len(folds) == 2
    load_case = LoadCase("up", -1.1 * driven.max(), "y", control=ARC)
    path = VjmEngine(1).trace(soft_truss(c), load_case)
    assert path.complete
    found = [event for event in path.events if event.kind is EventKind.FOLD]
    # the table's own grid: flat at a fold, so the square of its step
    assert [event.point.ramp for event in found] == pytest.approx(driven[folds], rel=7e-10)
    assert [event.force for event in found] == pytest.approx(0.5 * truss_load(w[folds]), rel=2e-4)
    limits = [event for event in path.events if event.kind is EventKind.LIMIT]
    # the error measured is rounding alone
    assert limits[0].force == pytest.approx(0.5 * truss_load(w).max(), rel=1e-10)
    # stable up to the first fold and behind the second
    counts = path.unstable
    between = (path.s > found[0].s) & (path.s < found[1].s)
    assert np.array_equal(counts == 1, between)


K, HIGH = 3.0, 100.0


def propped_bar() -> Machine:
    """A practically rigid bar, hinged at its foot, its top held sideways by a spring that stays level."""
    bar = Beam("bar", HIGH, section=Section(1e9, 1e9, 1e9, 1e9))
    parts = (
        Joint("q1", Z, passive=True),
        bar,
        Joint("q2", Z, passive=True),
        Joint("spring", AXES["y"], slides=True, fixed=True, compliance=1.0 / K),
    )
    return Machine("propped", parts, postures={"straight": np.zeros(2)})


PROPPED = LoadCase(
    "straight", -1.01 * K * HIGH, "load", free=("x",), loads=(Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),), control=ARC
)


def test_a_subcritical_branch_is_followed_backwards():
    """P = k L cos θ behind the bifurcation at k L."""
    # its curve is closed and never reaches the ramp's end
    problem = VjmEngine(1).problem(propped_bar(), PROPPED)
    path = follow_arc(problem, PROPPED, ArcControl(points=110))
    assert path.stopped.startswith("the ramp had not reached its end after 110 points")
    event = path.critical
    assert event.kind is EventKind.BIFURCATION
    assert event.switched
    # the eigenvalue is found to the rounding of stiffnesses 1e9 apart
    assert event.force == pytest.approx(K * HIGH, rel=1e-6)
    branch = [p for p in path.points if p.s > event.s]
    assert len(branch) > 60
    assert branch[-1].displacement[0] < -HIGH
    fallen = np.array([p.displacement[0] for p in branch])
    cosine = 1.0 + fallen / HIGH
    # up to the bar's own compression
    assert np.array([p.ramp for p in branch]) == pytest.approx(K * HIGH * cosine, abs=2e-7 * K * HIGH)
    assert {p.unstable for p in branch} == {1}


def test_imperfections_cost_what_koiters_law_says():
    """P_max = k L (1 − sin^{2/3} θ₀)^{3/2} exactly; the mode's mm at the top are L θ₀."""
    sizes = np.array([0.01, 0.1, 1.0, 5.0])
    curve = imperfection_curve(partial(VjmEngine(1).problem, propped_bar()), PROPPED, sizes)
    exact = K * HIGH * (1.0 - np.sin(sizes / HIGH) ** (2.0 / 3.0)) ** 1.5
    # the bar's compression, P/EA
    assert curve.force == pytest.approx(exact, rel=1e-6)
    assert curve.limit.all()
    assert np.all(np.diff(curve.force) < 0.0)


def test_an_imperfect_column_bends_as_its_mode_grows(column):
    """Southwell: the deflection that is added is w₀ P/(P_E − P), while it is small."""
    size = 0.02
    load_case = LoadCase(
        "straight", -0.9e3, "load", free=("x",), loads=(Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),), imperfection=size
    )
    path = VjmEngine(8).trace(column, load_case)
    middle = next(i for i, s in enumerate(path.stations) if s.fraction == 0.5)
    bow = np.array([p.shape[middle][1] for p in path.points])
    # the mode's size is measured on the column as it buckles, shorter by P/EA = 1e-3
    assert bow[0] == pytest.approx(size, rel=1.1e-3)
    load = path.force
    # to the second order of a deflection of 0.2 % of the length, and the column's own shortening, P/EA = 1e-3
    assert bow == pytest.approx(size / (1.0 - load / 1000.0), rel=2e-2)
    assert bow[-1] > 9.0 * size
    assert set(path.unstable) == {0}
    # the error measured is rounding alone
    assert path.points[0].wrench == pytest.approx(np.zeros(6), abs=1e-9)
    other = VjmEngine(8).trace(column, replace(load_case, branch=-1))
    # the error measured is rounding alone
    assert other.points[0].shape[middle][1] == pytest.approx(-bow[0], rel=1e-10)


def test_an_imperfection_needs_a_mode(column):
    load_case = LoadCase("straight", 0.1, imperfection=0.1)
    with pytest.raises(ValueError, match="no bifurcation up to 8 times"):
        VjmEngine(4).trace(column, load_case)


def test_the_unstable_path_can_be_stayed_on(column):
    """Branch 0: the straight column goes on beyond its buckling, and meets the next mode at four times the load."""
    free = tuple(name for name in COMPONENTS if name == "x")
    load_case = LoadCase(
        "straight", -4.5e3, "load", free=free, loads=(Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),), control=ARC, branch=0
    )
    path = VjmEngine(8).trace(column, load_case)
    assert path.complete
    assert [event.kind for event in path.events] == [EventKind.BIFURCATION] * 2
    # P (1 − P/EA) = n² P_E; the second mode by eight springs
    for n, event, tolerance in zip((1, 2), path.events, (1e-6, 5e-5), strict=True):
        exact = 0.5e6 * (1.0 - np.sqrt(1.0 - 4.0 * n**2 * 1e3 / 1e6))
        assert event.force == pytest.approx(exact, rel=tolerance)
        assert not event.switched
    assert path.unstable[-1] == 2


def test_the_arc_can_end_at_the_first_limit(truss_limit):
    limit, _ = truss_limit
    path = VjmEngine(1).trace(truss(), crown_load_case(1.5 * limit, TO_LIMIT))
    assert path.complete
    assert [event.kind for event in path.events] == [EventKind.LIMIT]
    assert path.points[-1].ramp == pytest.approx(limit, rel=1e-9)


def test_a_closed_path_ends_where_it_began(chain):
    """A bar let go at its end swings round under a dead load, and comes back with its joints turned full circle."""
    free = ("x", "rx", "ry", "rz")
    force = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    load_case = LoadCase("B", -9000.0, "load", free=free, loads=(force,), control=ARC)
    path = VjmEngine(4).trace(chain, load_case)
    assert path.events[0].kind is EventKind.BIFURCATION
    assert "the path is closed: it comes back to the bifurcation" in path.stopped


# The root of a function against closed forms and SciPy's, step by step.


CASES = {
    "square root": (lambda x: x * x - 2.0, 0.0, 2.0, math.sqrt(2.0)),
    "cosine": (lambda x: math.cos(x) - x, 0.0, 1.0, 0.7390851332151607),
    # flat on one side, where interpolation alone creeps
    "steep exponential": (lambda x: math.expm1(40.0 * (x - 0.3)), 0.0, 1.0, 0.3),
    # a triple root, at which derivatives vanish
    "cube": (lambda x: (x - 0.7) ** 3, 0.0, 1.0, 0.7),
    "a jump": (lambda x: 1.0 if x > 0.25 else -1.0, 0.0, 1.0, 0.25),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("backwards", [False, True])
def test_the_root_lies_within_the_tolerance(name, backwards):
    function, a, b, root = CASES[name]
    asked = []

    def counted(x):
        asked.append(x)
        return function(x)

    ends = (b, a) if backwards else (a, b)
    found = root_between(counted, *ends, 1e-9)
    assert abs(found - root) <= 1e-9
    known = []
    brentq(lambda x: known.append(x) or function(x), *ends, xtol=1e-9, rtol=1e-12)
    assert asked == known


def test_a_root_at_an_end_is_taken_and_equal_signs_are_refused():
    assert root_between(lambda x: x - 1.0, 1.0, 2.0, 1e-9) == 1.0
    assert root_between(lambda x: x - 2.0, 1.0, 2.0, 1e-9) == 2.0
    with pytest.raises(ValueError) as refusal:
        root_between(lambda x: x * x + 1.0, -1.0, 1.0, 1e-9)
    assert "no change of sign between -1 and 1" in str(refusal.value)
