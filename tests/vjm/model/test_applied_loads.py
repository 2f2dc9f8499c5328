"""Loads on bodies of the chain: their tangent, and closed forms under tip loads, followers and weight."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import jv

from vjm.continuation.arc_length import trace
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import EventKind, Path
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import ARC, COMPONENTS, RAMP, Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.mechanism import AppliedLoads, Mechanism
from vjm.model.parts import Beam, Placement, RigidOffset, Section
from vjm.rotations import translation
from vjm.statics import without_neutral

EI, LENGTH = 1e6, 100.0
EA = 1e9
PLANE = ("x", "y", "rz")
MATTIASSON = [(1.0, 0.30172, 0.05643), (2.0, 0.49346, 0.16064), (5.0, 0.71379, 0.38763)]
"""PL²/EI, deflection and shortening over L, five digits: Int. J. Num. Meth. Eng. 17 (1981)."""


def cantilever(mass: float = 0.0) -> Machine:
    """A clamped bar along x, 100 mm long, practically inextensible, stiffer out of the plane than in it."""
    section = Section(EA, GJ=EI, EIy=2.0 * EI, EIz=EI, mass=mass)
    return Machine("cantilever", (Beam("link", LENGTH, section=section),), postures={"straight": np.zeros(0)})


def tip(force, *, follower=False, ramped=True):
    return Load((*force, 0.0, 0.0, 0.0), follower=follower, ramped=ramped)


def random_loading(model: Mechanism, rng: np.random.Generator, kind: str) -> AppliedLoads:
    """Four wrenches at random places on random bodies, of springs' size."""
    bodies = sorted({piece.joint for piece in model.pieces if piece.joint >= 0})
    joints = np.sort(rng.choice(bodies, 4))
    wrench = 0.02 * model.wrench_scale * rng.standard_normal((4, 6))
    if kind == "forces":
        wrench[:, 3:] = 0.0
    follows = np.full(4, kind == "followers")
    return AppliedLoads(joints, 50.0 * rng.standard_normal((4, 3)), follows, wrench, 0.3 * wrench[::-1])


@pytest.mark.parametrize("kind", ["forces", "moments", "followers"])
@given(seed=st.integers(0, 10_000))
@settings(max_examples=10)
def test_the_loaded_tangent_is_the_residuals_derivative(chain, kind, seed):
    rng = np.random.default_rng(seed)
    model = VjmEngine(3, 2, Placement.END).model(chain)
    model = model.under(random_loading(model, rng, kind))
    unit, wrench_unit = model.coordinate_scale, model.wrench_scale
    x = model.configuration(chain.posture("B")) + 0.03 * unit * rng.standard_normal(model.size)
    wrench = 0.02 * wrench_unit * rng.standard_normal(6)
    dx, dF = unit * rng.standard_normal(model.size), wrench_unit * rng.standard_normal(6)
    pose = model.kinematics(x).end

    def lacking(step):
        statics, gap, _ = model.compiled.residual(x + step * dx, wrench + step * dF, pose, load=0.7)
        return statics, gap

    # linear springs, because away from equilibrium the others' residual K (θ(t) − θ) changes with K too; central
    # differences of the fourth order
    step = 1e-3
    stencil = [(2.0, -1.0 / 12.0), (1.0, 2.0 / 3.0), (-1.0, -2.0 / 3.0), (-2.0, 1.0 / 12.0)]
    statics = -sum(weight * lacking(k * step)[0] for k, weight in stencil) / step
    gap = -sum(weight * lacking(k * step)[1] for k, weight in stencil) / step
    found_x, found_F = model.compiled.response(x, wrench, statics, gap, 0.7)
    assert np.abs((found_x - dx) / unit).max() < 1e-4
    assert np.abs((found_F - dF) / wrench_unit).max() < 1e-4


@pytest.mark.parametrize(("load", "w", "u"), MATTIASSON)
def test_cantilever_under_a_dead_tip_force_follows_the_elastica(load, w, u):
    force = load * EI / LENGTH**2
    load_case = LoadCase("straight", force, "load", free=COMPONENTS, loads=(tip((0.0, 1.0, 0.0)),))
    path = VjmEngine(16).trace(cantilever(), load_case)
    end = path.points[-1]
    assert path.complete
    assert end.unstable == 0
    assert end.ramp == path.force[-1] == force
    # half a digit of the table, and sixteen springs' own 1e-5
    assert end.displacement[1] / LENGTH == pytest.approx(w, abs=1.5e-5)
    assert -end.displacement[0] / LENGTH == pytest.approx(u, abs=1.5e-5)
    assert end.wrench == pytest.approx([0.0, force, 0.0, 0.0, 0.0, 0.0], abs=1e-9 * force)
    # by the law of Castigliano the tangent is the load's derivative by its own deflection
    deflection = path.displacement[:, 1]
    slope = np.gradient(path.force, deflection, edge_order=2)
    assert path.tangent[5:-5] == pytest.approx(slope[5:-5], rel=2e-3)


@pytest.mark.parametrize(
    ("kind", "ramped", "taken"),
    [("forces", False, True), ("forces", True, False), ("moments", False, False), ("followers", False, False)],
)
def test_a_grid_is_marched_under_constant_forces_that_keep_their_direction(kind, ramped, taken):
    bare = VjmEngine(4).model(cantilever())
    applied_loads = random_loading(bare, np.random.default_rng(3), kind)
    applied_loads = applied_loads if ramped else replace(applied_loads, ramped=np.zeros((4, 6)))
    model = bare.under(applied_loads)
    at = LoadCase("straight", 1.0)
    problem = LumpedProblem(model, at, "")
    args = problem.target(0.0), at.direction, np.zeros(1), np.zeros(model.size), np.zeros(6), 1e-9, 10
    if taken:
        found = model.compiled.march(*args)
        assert found.good == 1
        # round-off of one and the same factorisation
        alone = model.compiled.end_stiffness(args[3], args[4])
        np.testing.assert_allclose(found.stiffness[0], alone, rtol=1e-12, atol=1e-12 * np.abs(alone).max())
    else:
        with pytest.raises(ValueError, match="keep their direction"):
            model.compiled.march(*args)


@pytest.mark.parametrize("follower", [False, True])
def test_a_tip_moment_rolls_the_cantilever_into_a_circle(follower):
    moment = Load((0.0, 0.0, 0.0, 0.0, 0.0, 1.0), follower=follower)
    load_case = LoadCase("straight", 2.0 * np.pi * EI / LENGTH, "load", free=PLANE, loads=(moment,))
    path = VjmEngine(8).trace(cantilever(), load_case)
    # springs under pure bending are exact: each takes its share of the turn
    assert path.complete
    assert np.abs(path.points[-1].displacement - [-LENGTH, 0.0, 0.0, 0.0, 0.0, 0.0]).max() < 1e-9
    quarter = np.array([p.displacement[5] for p in path.points if p.ramp < 0.49 * path.force[-1]])
    assert quarter == pytest.approx(path.force[: len(quarter)] * LENGTH / EI, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("EIy", "GJ"), [(1e2, 1e-2), (2.0, 0.1), (0.5, 0.8), (1.0, 0.01)])
@pytest.mark.parametrize("control", [RAMP, pytest.param(ARC, marks=pytest.mark.slow)])
def test_a_moment_of_fixed_direction_never_makes_a_cantilever_unstable(EIy, GJ, control):
    """Every section bears the applied moment itself, M: R' = R [C Rᵀ M] from the clamp on has one solution.

    So there is no other equilibrium at any moment, however soft the bar is in torsion, and no static loss of
    stability. Its eigenvalues are another matter: without a potential pairs of them become negative, one of a pair
    as small as rounding.
    """
    section = Section(EA, GJ=GJ * EI, EIy=EIy * EI, EIz=EI)
    bar = Machine("cantilever", (Beam("link", LENGTH, section=section),), postures={"straight": np.zeros(0)})
    moment = Load((0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    steps = 20 if control == RAMP else None
    full = 2.0 * np.pi * EI / LENGTH
    load_case = LoadCase("straight", full, "load", steps=steps, free=COMPONENTS, loads=(moment,), control=control)
    path = VjmEngine(8).trace(bar, load_case)
    assert path.complete, path.stopped
    assert not path.events
    assert set(path.unstable) == {0}
    # it closes to a circle
    assert np.abs(path.points[-1].displacement[:3] - [-LENGTH, 0.0, 0.0]).max() < 1e-7


@pytest.mark.parametrize(("negative", "neutral", "conservative", "counted"), [
    (1, 1, True, 0), (2, 1, True, 1), (2, 1, False, 2), (1, 1, False, 0), (3, 1, False, 2), (0, 0, False, 0),
])  # fmt: skip
def test_of_a_pair_none_is_neutral(negative, neutral, conservative, counted):
    assert without_neutral(negative, neutral, conservative) == counted


@pytest.mark.parametrize("share", [0.0, 0.25, 0.45])
def test_partly_following_load_loses_stability_where_it_should(share):
    """At cos kL = η/(η − 1) for shares η up to one half (Ziegler, *Principles of Structural Stability*, 1968)."""
    critical = np.arccos(share / (share - 1.0)) ** 2 * EI / LENGTH**2
    loads = [tip((1.0 - share, 0.0, 0.0))] + ([tip((share, 0.0, 0.0), follower=True)] if share else [])
    load_case = LoadCase("straight", -1.2 * critical, "load", free=PLANE, loads=tuple(loads))
    path = VjmEngine(8).trace(cantilever(), load_case)
    assert path.critical.kind is EventKind.BIFURCATION
    assert path.complete
    # the column is shorter by P/EA = 6e-7 when it buckles
    assert path.critical.force == pytest.approx(critical, rel=1e-6)


def test_a_fully_following_load_never_diverges():
    """Beck's column has no static instability: flutter at 20.05 EI/L² needs masses, which statics has not."""
    load = tip((1.0, 0.0, 0.0), follower=True)
    load_case = LoadCase("straight", -30.0 * EI / LENGTH**2, "load", free=PLANE, loads=(load,))
    path = VjmEngine(8).trace(cantilever(), load_case)
    assert path.complete
    assert not path.events
    assert set(path.unstable) == {0}


@pytest.mark.parametrize("control", [RAMP, ARC])
@pytest.mark.parametrize(("segments", "load"), [(4, 97.0), (16, 45.0)])
def test_negative_eigenvalues_that_come_in_pairs_are_no_event(segments, load, control):
    """The determinant of Beck's column is the same at all loads, in the lumped model too."""
    follower = tip((1.0, 0.0, 0.0), follower=True)
    load_case = LoadCase(
        "straight", -load * EI / LENGTH**2, "load", free=COMPONENTS, loads=(follower,), control=control
    )
    problem = LumpedProblem(VjmEngine(segments).model(cantilever()), load_case, "vjm")
    path = trace(problem, load_case)
    assert path.complete
    assert not path.events
    assert set(path.unstable) == {0}
    if segments == 4:
        # the engine's own count has them: it is not that none is there
        assert problem.equilibrium(0.0, problem.configuration(path.points[-1]), 0.0).unstable == 2


def test_a_column_under_its_own_weight_buckles_at_greenhills_load():
    """(q L)_cr = (9/4) j² EI/L², j the first zero of the Bessel function J_{−1/3} (Greenhill 1881)."""
    j = brentq(lambda z: jv(-1.0 / 3.0, z), 1.0, 2.5, xtol=1e-14)
    weight = 2.25 * j**2 * EI / LENGTH**2
    error = []
    for n in (4, 8, 16):
        heavy = cantilever(mass=weight / LENGTH / 9.81)
        load_case = LoadCase("straight", 1.1, "load", free=COMPONENTS, gravity=(-9.81, 0.0, 0.0))
        path = VjmEngine(n).trace(heavy, load_case)
        assert path.critical.kind is EventKind.BIFURCATION
        error.append(abs(path.critical.force - 1.0))
    # fourth order until the shortening by the weight shows, 3e-7
    assert error[0] < 5e-4
    assert np.log2(error[0] / error[1]) == pytest.approx(4.0, abs=0.2)
    assert error[2] < 2e-6


def test_weight_bends_a_cantilever_as_beam_theory_says():
    mass = 1e-5
    q = mass * 9.81
    chain = cantilever(mass=mass)
    held_up = LoadCase(
        "straight", 1e-6, "load", free=COMPONENTS, gravity=(0.0, -9.81, 0.0), loads=(tip((0.0, 1.0, 0.0)),)
    )
    for n in (1, 2, 5):
        start = VjmEngine(n).problem(chain, held_up).unloaded()
        # the nodes of a segment under its own weight are where beam theory has them, by however many springs
        assert start.displacement[1] == pytest.approx(-q * LENGTH**4 / (8.0 * EI), rel=1e-8)
        assert start.displacement[5] == pytest.approx(-q * LENGTH**3 / (6.0 * EI), rel=4e-10)
        assert start.unstable == 0


def test_a_mass_on_a_rigid_piece_hangs_at_its_middle():
    arm = RigidOffset("arm", translation([0.0, 40.0, 0.0]), mass=2.0)
    chain = Machine("arm", (*cantilever().parts, arm), postures={"straight": np.zeros(0)})
    load_case = LoadCase("straight", 1e-3, "load", free=COMPONENTS, gravity=(0.0, 0.0, -9.81))
    path = VjmEngine(4).trace(chain, load_case)
    # the weight's lever about the bar's axis is half of the arm
    twist = path.points[-1].displacement[3]
    assert twist == pytest.approx(-1e-3 * 2.0 * 9.81 * 20.0 * LENGTH / EI, rel=4e-8)


def test_what_the_chain_cannot_bear_is_said():
    chain = cantilever(mass=1.0)
    load_case = LoadCase(
        "straight", 1.0, "load", free=COMPONENTS, gravity=(-9810.0, 0.0, 0.0), loads=(tip((0.0, 1.0, 0.0)),)
    )
    with pytest.raises(NoConvergenceError, match="does not bear its constant loads: stable up to"):
        VjmEngine(4).trace(chain, load_case)


@pytest.mark.parametrize(("part", "at", "said"), [("lever", 1.0, "no part 'lever'"), ("link", 1.5, "from 0 to 1")])
def test_loads_need_a_place(part, at, said):
    load = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), part, at)
    with pytest.raises(ValueError, match=said):
        VjmEngine(2).trace(cantilever(), LoadCase("straight", 1.0, "load", free=COMPONENTS, loads=(load,)))


def test_the_base_cannot_control_a_path():
    load_case = LoadCase("straight", 1.0, "load", free=COMPONENTS, loads=(tip((0.0, 1.0, 0.0)),),
                          control=PointControl("link", 0.0, (0.0, 1.0, 0.0)))  # fmt: skip
    with pytest.raises(ValueError, match="fixed to the base"):
        VjmEngine(2).trace(cantilever(), load_case)


@pytest.mark.parametrize(("bad", "said"), [
    ({"axis": "w"}, "none of x, y, z"),
    ({"axis": (1.0, 0.0)}, "six finite numbers"),
    ({"axis": (0.0,) * 6}, "not all zero"),
    ({"axis": (np.nan, 1.0, 0.0, 0.0, 0.0, 0.0)}, "six finite numbers"),
    ({"to": 0.0}, "other than zero"),
    ({"to": np.inf}, "finite displacement"),
    ({"to": np.nan}, "finite displacement"),
    ({"steps": 0}, "at least one step"),
    ({"steps": -3}, "at least one step"),
    ({"control": "time"}, "none of ramp, arc"),
    ({"control": "arc", "steps": 3}, "not an arc"),
    ({"imperfection": -1.0}, "zero or more"),
    ({"free": ("w",)}, "none of x, y, z"),
    ({"free": ("y", "y")}, "only once"),
    ({"free": ("x",)}, "free and driven at once"),
    ({"axis": "load"}, "needs a load"),
    ({"loads": (Load((1, 0, 0, 0, 0, 0)),)}, "needs the axis 'load'"),
    ({"gravity": (0.0, np.nan, 0.0)}, "three finite numbers"),
    ({"branch": 0}, "needs the arc"),
    ({"branch": 2}, "+1, -1 or 0"),
])  # fmt: skip
def test_impossible_ramps_are_refused(bad, said):
    with pytest.raises(ValueError) as refusal:
        LoadCase(**{"posture": "A", "to": 1.0, **bad})
    assert said in str(refusal.value)


@pytest.mark.parametrize("axis", COMPONENTS)
@pytest.mark.parametrize("to", [2.0, -2.0])
def test_ramp_ends_where_it_says(axis, to):
    ramp = LoadCase("A", to, axis)
    assert ramp.length == 2.0
    end = ramp.displacement(ramp.length)
    assert end[COMPONENTS.index(axis)] == to
    assert np.count_nonzero(end) == 1
    # a resisted ramp's force is counted positive whichever way it goes
    assert ramp.direction @ end > 0.0
    assert not np.any(np.signbit(ramp.displacement(0.0)))


def test_oblique_ramp_goes_its_own_way():
    axis = (0.6, 0.0, 0.8, 0.0, 0.0, 0.01)
    ramp = LoadCase("A", -3.0, axis)
    assert ramp.displacement(3.0) == pytest.approx(-3.0 * np.array(axis), rel=1e-15)


@pytest.mark.parametrize(("posture", "to"), [("A", 2.0), ("B", 4.0)])
def test_arrays_of_a_path_are_those_of_its_points(trace, posture, to):
    path: Path = trace(posture, to)
    n = len(path.points)
    assert path.wrench.shape == path.displacement.shape == (n, 6)
    assert np.array_equal(path.displacement[:, 0], path.s)
    assert np.array_equal(path.force, path.wrench[:, 0])
    assert path.eigenvalue_relative[0] == 1.0
    assert path.force[0] == path.s[0] == 0.0
    assert path.s[-1] == to
    # the tangent is the force's derivative: central differences where the path is smooth, to their truncation
    inner = slice(1, -1)
    slope = np.gradient(path.force, path.s)[inner]
    smooth = np.abs(np.diff(path.tangent, 2)) < 0.01 * path.tangent[inner]
    assert slope[smooth] == pytest.approx(path.tangent[inner][smooth], rel=0.02)
    assert np.count_nonzero(smooth) > n / 2


def test_compression_counts_force_and_displacement_as_magnitudes(trace):
    path = trace("A", -3.5, 4)
    assert path.displacement[-1, 0] == -3.5
    assert path.wrench[-1, 0] < 0.0 < path.force[-1]
    assert path.critical.kind is EventKind.BIFURCATION
    assert path.critical.force > 0.0
    assert path.critical.s > 0.0


@pytest.mark.parametrize("wrench", [(0.0,) * 6, (1.0, 0.0), (np.nan, 0, 0, 0, 0, 0)])
def test_impossible_loads_are_refused(wrench):
    with pytest.raises(ValueError, match="six finite numbers"):
        Load(wrench)


def test_a_point_needs_a_direction():
    with pytest.raises(ValueError, match="three finite numbers"):
        PointControl("link", 1.0, (0.0, 0.0, 0.0))
