"""The clamped, hinged arch: collocation against integration and shooting, and against print."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from vjm_validation.exact import arches
from vjm_validation.exact.arches import Arch, limit_load
from vjm_validation.exact.rod import integrate, slope
from vjm_validation.exact.trusses import TwoBarTruss


def end_of(arch, state, integrator=integrate):
    """The hinge's state by integration from the clamp over the crown."""
    a = arch.half_angle
    H, V = state.thrust
    crown = integrator(np.array([0.0, 0.0, a, state.moment]), (H, V), (0.0, a), arch.axial, arch.shear, -1.0)
    end = integrator(crown, (H, V + state.load), (a, 2.0 * a), arch.axial, arch.shear, -1.0)
    return crown, end


@pytest.fixture(scope="module")
def limits():
    return {d: (arch, arch.limit()) for d in (60.0, 90.0, 107.5, 120.0) for arch in [Arch(np.radians(d))]}


# 60, 107.5 and 120 degrees: half a unit of the last printed digit. 90 degrees: 10.27534 would be rounded to 10.28;
# the printed 10.27 has its digits cut off or is wrong by half a unit, and is only known to one unit.
@pytest.mark.parametrize(
    ("degrees", "printed", "unit"), [(60.0, 13.21, 0.5), (90.0, 10.27, 1.0), (107.5, 8.97, 0.5), (120.0, 4.47, 0.5)]
)
def test_dadeppo_and_schmidt(limits, degrees, printed, unit):
    assert limits[degrees][1].load == pytest.approx(printed, abs=unit * 1e-2)


# Our own figures, kept so that a change shows; the docstring quotes them.
@pytest.mark.parametrize(
    ("degrees", "load"),
    [(60.0, 13.21315948334), (90.0, 10.27534436644), (107.5, 8.97308996972), (120.0, 4.46667959902)],
)
def test_limit_loads(limits, degrees, load):
    assert limits[degrees][1].load == pytest.approx(load, abs=2e-11)


@pytest.mark.parametrize("degrees", [60.0, 90.0, 107.5, 120.0])
def test_limit_state_is_an_equilibrium_of_the_integrated_rod(limits, degrees):
    arch, state = limits[degrees]
    crown, end = end_of(arch, state)
    # integration is correct to 1e-13 times the growth of errors along the rod; a residual r leaves a load wrong by
    # about r, since the conditions' sensitivities to the load are of order one
    assert end[[0, 1, 3]] == pytest.approx([2.0 * np.sin(arch.half_angle), 0.0, 0.0], abs=2e-11)
    top = np.array([np.sin(arch.half_angle), 1.0 - np.cos(arch.half_angle)])
    assert crown[:2] - top == pytest.approx([state.sway, -state.depth], abs=1e-11)


@pytest.mark.parametrize("degrees", [60.0, 90.0, 107.5, 120.0])
def test_limit_state_is_singular_under_a_dead_load(limits, degrees):
    # The hinge's errors by what is unknown at the clamp, (M, H, V), at a constant load, by complex steps through
    # the integrated rod: singular at a limit point, and the load is correct to the square of the residual.
    arch, state = limits[degrees]
    a, tiny = arch.half_angle, 1e-30
    columns = []
    for unit in np.eye(3) * 1j * tiny:
        force = (state.thrust[0] + unit[1], state.thrust[1] + unit[2])
        y = np.array([0.0, 0.0, a, state.moment + unit[0]])
        for span, n in (((0.0, a), force), ((a, 2.0 * a), (force[0], force[1] + state.load))):
            # the imaginary part is beyond the error control's reach: short steps of the eighth order
            y = solve_ivp(
                lambda _, y, n=n: slope(y, n, curvature=-1.0), span, y, method="DOP853", rtol=1e-12, max_step=0.03
            ).y[:, -1]
        columns.append(y[[0, 1, 3]].imag / tiny)
    singular = np.linalg.svd(np.array(columns).T, compute_uv=False)
    assert singular[-1] / singular[0] < 1e-8


@pytest.mark.parametrize("degrees", [60.0, 107.5, 120.0])
def test_no_equilibrium_is_lost_before_the_limit(limits, degrees):
    # Under an imposed depth the Jacobian keeps its sign: no bifurcation, and the limit is the first critical point.
    arch, limit = limits[degrees]
    states = arch.path(np.linspace(0.0, limit.depth, 60)[1:])
    signs = {np.linalg.slogdet(arch._linearised(s.unknowns, s.depth)[1])[0] for s in states}
    assert len(signs) == 1
    loads = np.array([s.load for s in states])
    assert np.all(np.diff(loads) > 0.0)
    assert loads[-1] == pytest.approx(limit.load, rel=1e-12)


def test_slope_of_the_path_is_its_derivative():
    arch = Arch(np.radians(107.5))
    h = 1e-3
    before, here, after = arch.path(np.append(np.arange(0.02, 0.19, 0.02), [0.2 - h, 0.2, 0.2 + h]))[-3:]
    # central difference: third derivative times h²/6
    assert here.slope == pytest.approx((after.load - before.load) / (2.0 * h), rel=1e-5)


def test_initial_slope_is_castiglianos():
    # The unloaded half circle: a unit load at the crown, the redundant (H, V) from no displacement of the hinge.
    # Moments at the polar angle t from the hinge: sin t by H, 1 − cos t by V, beyond the crown −cos t by the load.
    t, w = np.polynomial.legendre.leggauss(40)
    lower, upper = 0.25 * np.pi * (t + 1.0), 0.25 * np.pi * (t + 3.0)
    angles, weights = np.concatenate([lower, upper]), 0.25 * np.pi * np.concatenate([w, w])
    arms = np.array([np.sin(angles), 1.0 - np.cos(angles), np.where(angles > 0.5 * np.pi, -np.cos(angles), 0.0)])
    F = (arms * weights) @ arms.T
    flexibility = F[2, 2] - F[2, :2] @ np.linalg.solve(F[:2, :2], F[:2, 2])
    assert Arch(0.5 * np.pi).unloaded().slope == pytest.approx(1.0 / flexibility, rel=1e-11)


@pytest.mark.parametrize(("axial", "shear"), [(1e-4, 0.0), (1e-3, 2.6e-3)])
def test_extensible_arch(limits, axial, shear):
    arch = Arch(np.radians(107.5), axial, shear)
    state = arch.limit()
    _, end = end_of(arch, state)
    assert end[[0, 1, 3]] == pytest.approx([2.0 * np.sin(arch.half_angle), 0.0, 0.0], abs=2e-11)
    # softness changes the load in proportion to it, to first order
    slightly = limit_load(arch.half_angle, 0.01 * axial, 0.01 * shear)
    rigid = limits[107.5][1].load
    assert (slightly - rigid) / (state.load - rigid) == pytest.approx(0.01, rel=0.1)


def test_points_suffice(limits, monkeypatch):
    monkeypatch.setattr(arches, "POINTS", 40)
    assert limit_load(np.radians(107.5)) == pytest.approx(limits[107.5][1].load, abs=2e-10)


def test_out_of_range_is_refused():
    for half_angle in (0.5, 2.7):
        with pytest.raises(ValueError, match="from π/6 to 5π/6"):
            Arch(half_angle)
    with pytest.raises(ValueError, match="cannot be negative"):
        Arch(1.0, axial=-1.0)
    with pytest.raises(RuntimeError, match="no equilibrium at depth"):
        Arch(1.0).path([1.9])


# Rigid bars and the two-bar truss: the algebra against energies, numerical maxima and limits.


TRUSS = TwoBarTruss(half_span=1000.0, height=120.0, EA=5e5)
STEP = 1e-20


def by_complex_step(energy, x):
    """Derivative to the last digit."""
    return (energy(x + 1j * STEP)).imag / STEP


@pytest.mark.parametrize("apex", [-30.0, 10.0, 60.0, 120.0, 170.0, 240.0, 300.0])
def test_load_is_the_energys_derivative(apex):
    def energy(v):
        bar = np.sqrt(TRUSS.half_span**2 + (TRUSS.height - v) ** 2)
        return TRUSS.EA / TRUSS.bar_length * (bar - TRUSS.bar_length) ** 2

    # a load of up to 1 kN is a difference of bar forces of 5e5 N times 1e-2
    assert TRUSS.load(apex) == pytest.approx(by_complex_step(energy, apex), abs=1e-7)


def test_limit_points_are_the_extremes():
    first, second = TRUSS.limit_points()
    top = minimize_scalar(
        lambda v: -TRUSS.load(v), bounds=(0.0, TRUSS.height), options={"xatol": 1e-9}, method="bounded"
    )
    # a maximum is flat: its value is exact to the square of where it is
    assert first.load == pytest.approx(-top.fun, rel=1e-12)
    # its place to the root of the rounding errors
    assert first.displacement == pytest.approx(top.x, rel=1e-6)
    # the truss snaps through into its mirror image
    assert second.load == pytest.approx(-first.load, rel=1e-12)
    assert first.apex + second.apex == pytest.approx(2.0 * TRUSS.height, rel=1e-14)
    assert TRUSS.load(TRUSS.height) == 0.0
    assert TRUSS.load(2.0 * TRUSS.height) == pytest.approx(0.0, abs=1e-9)


def test_a_shallow_truss_tends_to_its_cubic():
    # P = EA (h/b)³ · v̄ (1 − v̄)(2 − v̄), v̄ = v/h, greatest 2/(3√3) at v̄ = 1 − 1/√3; the next terms are of (h/b)²
    shallow = TwoBarTruss(1000.0, 1.0, 1e9)
    first, _ = shallow.limit_points()
    assert first.load == pytest.approx(1e9 * 1e-9 * 2.0 / (3.0 * np.sqrt(3.0)), rel=1e-5)
    assert first.apex == pytest.approx(1.0 - 1.0 / np.sqrt(3.0), rel=1e-5)


def test_snap_back_where_the_drives_spring_is_soft():
    spring = 4.0
    first, second = TRUSS.snap_back_points(spring)
    for point in (first, second):
        assert point.load == TRUSS.load(point.apex)
        assert point.displacement == pytest.approx(point.apex + point.load / spring, rel=1e-14)

    def driven(v):
        return TRUSS.driven(v, spring)

    span = np.linspace(first.apex, second.apex, 200)
    assert np.all(np.diff([driven(v) for v in span]) < 0.0)
    for point in (first, second):
        # central differences of the fourth order
        h = 0.5
        slope = (8.0 * (driven(point.apex + h) - driven(point.apex - h))) / (12.0 * h)
        slope -= (driven(point.apex + 2 * h) - driven(point.apex - 2 * h)) / (12.0 * h)
        assert slope == pytest.approx(0.0, abs=1e-6)


def test_snap_back_ends_at_the_steepest_fall():
    # P'(h) = −2 EA (1/b − 1/l₀), the steepest
    steepest = 2.0 * TRUSS.EA * (1.0 / TRUSS.half_span - 1.0 / TRUSS.bar_length)
    assert TRUSS.snap_back_points(1.0001 * steepest) is None
    first, second = TRUSS.snap_back_points(0.9999 * steepest)
    assert second.apex - first.apex < 0.05 * TRUSS.height
    # a rigid drive, k → ∞, has none; a soft one, k → 0, turns where the load does
    soft, _ = TRUSS.snap_back_points(1e-9)
    assert soft.apex == pytest.approx(TRUSS.limit_points()[0].apex, rel=1e-9)


def test_trusses_out_of_range_are_refused():
    with pytest.raises(ValueError, match="height is 0"):
        TwoBarTruss(1.0, 0.0, 1.0)
    with pytest.raises(ValueError, match="spring is 0"):
        TRUSS.snap_back_points(0.0)
    with pytest.raises(ValueError, match="spring is 0"):
        TRUSS.driven(1.0, 0.0)
