"""Rigid bars and the two-bar truss: the algebra against energies, numerical maxima and limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from vjm_validation.exact.trusses import ProppedBar, TwoBarTruss, bar_on_rotational_spring

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


@pytest.mark.parametrize("inclination", [0.0, 0.01, 0.2])
def test_propped_bar_balances(inclination):
    L, k = 310.0, 7.0
    bar = ProppedBar(L, k, inclination)
    for angle in (inclination + 0.05, 0.6, 1.4):
        P = bar.load(angle)

        def energy(theta, P=P):
            return 0.5 * k * L**2 * (np.sin(theta) - np.sin(inclination)) ** 2 + P * L * np.cos(theta)

        # the derivative of a complex step is exact but for rounding
        assert by_complex_step(energy, angle) == pytest.approx(0.0, abs=1e-14 * k * L**2)


@pytest.mark.parametrize("inclination", [0.001, 0.05, 0.5])
def test_greatest_load_of_the_inclined_bar(inclination):
    bar = ProppedBar(310.0, 7.0, inclination)
    top = minimize_scalar(
        lambda t: -bar.load(t), bounds=(inclination, 1.57), options={"xatol": 1e-10}, method="bounded"
    )
    # flat: to the square of where it is
    assert bar.greatest_load == pytest.approx(-top.fun, rel=1e-12)
    assert bar.load(np.arcsin(np.sin(inclination) ** (1.0 / 3.0))) == pytest.approx(bar.greatest_load, rel=1e-13)


def test_perfect_bar_falls_from_its_critical_load():
    bar = ProppedBar(310.0, 7.0)
    assert bar.greatest_load == 310.0 * 7.0
    assert bar.load(1e-6) == pytest.approx(310.0 * 7.0, rel=1e-12)
    assert bar.load(0.5 * np.pi) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("inclination", [0.0, 0.1])
def test_bar_on_a_rotational_spring_balances(inclination):
    for load in (1.1, 2.0, 5.0):
        angle = brentq(
            lambda t, p=load: p * np.sin(t) - (t - inclination), inclination + 1e-3, np.pi - 1e-9, xtol=1e-15
        )
        assert bar_on_rotational_spring(angle, inclination) == pytest.approx(load, rel=1e-12)
    # P L/c = 1 + θ²/6 + …
    assert bar_on_rotational_spring(1e-3) == pytest.approx(1.0 + 1e-6 / 6.0, abs=1e-12)


def test_out_of_range_is_refused():
    with pytest.raises(ValueError, match="height is 0"):
        TwoBarTruss(1.0, 0.0, 1.0)
    with pytest.raises(ValueError, match="spring is 0"):
        TRUSS.snap_back_points(0.0)
    with pytest.raises(ValueError, match="spring is 0"):
        TRUSS.driven(1.0, 0.0)
    with pytest.raises(ValueError, match="inclination from 0"):
        ProppedBar(1.0, 1.0, -0.1)
    with pytest.raises(ValueError, match="at most π/2"):
        ProppedBar(1.0, 1.0).load(0.0)
    with pytest.raises(ValueError, match="must obey"):
        bar_on_rotational_spring(0.1, 0.2)
    with pytest.raises(ValueError, match="must obey"):
        bar_on_rotational_spring(0.0)
