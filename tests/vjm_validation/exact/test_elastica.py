"""The cantilever in large bending: elliptic integrals against integration, quadrature, limits and print."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from vjm_validation.exact import columns, elastica, reissner, space
from vjm_validation.exact.columns import Column
from vjm_validation.exact.rod import integrate

# Two routes of double precision agree to the integration's relative tolerance of 1e-13, times the growth of an
# error over a rod of ω = √load
TWO_ROUTES = 1e-11


def as_array(tip):
    return np.array([tip.x, tip.y, tip.theta])


# Half a unit of the fifth printed digit.
@pytest.mark.parametrize(
    ("load", "w", "u"),
    [(1.0, 0.30172, 0.05643), (2.0, 0.49346, 0.16064), (5.0, 0.71379, 0.38763), (10.0, 0.81061, 0.55500)],
)
def test_mattiasson_confirmed_to_every_printed_digit(load, w, u):
    tip = elastica.dead_force(load)
    assert tip.y == pytest.approx(w, abs=0.5e-5)
    assert 1.0 - tip.x == pytest.approx(u, abs=0.5e-5)


@pytest.mark.parametrize("load", [0.01, 1.0, 10.0, 50.0])
@pytest.mark.parametrize("angle", [0.2, 0.5 * np.pi, 2.0, 3.0])
def test_dead_force_elliptic_integrals_are_the_shot_rod(load, angle):
    assert as_array(reissner.dead_force(load, angle)) == pytest.approx(
        as_array(elastica.dead_force(load, angle)), abs=TWO_ROUTES
    )


@pytest.mark.parametrize("load", [0.01, 3.0, 30.0, 50.0])
@pytest.mark.parametrize("angle", [0.3, 0.5 * np.pi, 2.5])
def test_follower_force_elliptic_integrals_are_the_integrated_rod(load, angle):
    assert as_array(reissner.follower_force(load, angle)) == pytest.approx(
        as_array(elastica.follower_force(load, angle)), abs=TWO_ROUTES
    )


@pytest.mark.parametrize("tip_of", [elastica.dead_force, elastica.follower_force])
def test_small_forces_bend_as_in_linear_theory(tip_of):
    load = 1e-4
    tip = tip_of(load)
    # the next terms are of the third order in the load for y and θ and of the fourth for x; 1e-16/ω is rounding
    assert tip.y == pytest.approx(load / 3.0, abs=load**3)
    assert tip.theta == pytest.approx(load / 2.0, abs=load**3)
    assert 1.0 - tip.x == pytest.approx(load**2 / 15.0, abs=1e-13)


def test_a_dead_force_is_a_follower_where_the_tip_has_arrived():
    dead = elastica.dead_force(7.0, 1.9)
    assert as_array(elastica.follower_force(7.0, 1.9 - dead.theta)) == pytest.approx(as_array(dead), abs=1e-13)


def test_a_slanting_compression_tends_to_the_buckled_column():
    # Beyond π²/4 a compression that hardly slants bends the rod as the dead axial load of the buckled column does;
    # the residual is of the order of the slant.
    tip = elastica.dead_force(3.0, np.pi - 1e-9)
    k2 = brentq(lambda m: _complete(m) - np.sqrt(3.0), 0.01, 0.9, xtol=1e-14)
    assert tip.theta == pytest.approx(2.0 * np.arcsin(np.sqrt(k2)), abs=1e-8)


def _complete(m):
    return quad(lambda p: 1.0 / np.sqrt(1.0 - m * np.sin(p) ** 2), 0.0, 0.5 * np.pi, epsabs=1e-13, epsrel=1e-13)[0]


def test_end_moment_is_a_circle_also_for_an_extensible_rod():
    for moment in (1e-9, 1.0, 2.0 * np.pi, 9.0):
        end = integrate(np.array([0.0, 0.0, 0.0, moment]), (0.0, 0.0), (0.0, 1.0), axial=0.1, shear=0.3)
        assert as_array(elastica.end_moment(moment)) == pytest.approx(end[:3], abs=1e-12)
    assert as_array(elastica.end_moment(2.0 * np.pi)) == pytest.approx([0.0, 0.0, 2.0 * np.pi], abs=1e-15)
    # tip of the quarter circle at 2/π
    assert elastica.end_moment(0.5 * np.pi).x == pytest.approx(2.0 / np.pi, abs=1e-15)


@pytest.mark.parametrize(("axial", "shear"), [(0.01, 0.0), (0.0, 0.02), (0.01, 0.02), (0.02, 0.001)])
@pytest.mark.parametrize("angle", [0.5 * np.pi, 2.4])
def test_extensible_rod_keeps_its_first_integral(axial, shear, angle):
    # ½ θ'² + N + ½ axial N² + ½ shear Q² is constant along the rod; with it length and position are quadratures in
    # θ. θ = θ_tip (1 − t²) takes out the root singularity at the tip.
    load = 4.0
    tip = reissner.dead_force(load, angle, axial, shear)

    def forces(theta):
        return load * np.cos(angle - theta), load * np.sin(angle - theta)

    def potential(theta):
        N, Q = forces(theta)
        return N + 0.5 * axial * N**2 + 0.5 * shear * Q**2

    def along(value):
        def integrand(t):
            theta = tip.theta * (1.0 - t**2)
            rate = np.sqrt(2.0 * (potential(tip.theta) - potential(theta)))
            return value(theta) * 2.0 * tip.theta * t / rate

        return quad(integrand, 1e-7, 1.0, epsabs=1e-12, epsrel=1e-12)[0] + integrand(1e-4) * 1e-7

    def x_rate(theta):
        N, Q = forces(theta)
        return (1.0 + axial * N) * np.cos(theta) - shear * Q * np.sin(theta)

    def y_rate(theta):
        N, Q = forces(theta)
        return (1.0 + axial * N) * np.sin(theta) + shear * Q * np.cos(theta)

    # the difference of potentials near the tip has lost four digits, over a short piece
    assert along(lambda _: 1.0) == pytest.approx(1.0, abs=1e-10)
    assert along(x_rate) == pytest.approx(tip.x, abs=1e-10)
    assert along(y_rate) == pytest.approx(tip.y, abs=1e-10)


def test_small_forces_on_a_soft_rod_bend_as_timoshenko():
    tip = reissner.dead_force(1e-5, axial=0.3, shear=0.4)
    assert tip.y == pytest.approx(1e-5 * (1.0 / 3.0 + 0.4), abs=1e-13)


@pytest.mark.parametrize(("load", "angle"), [(0.0, 1.0), (-1.0, 1.0), (2e4, 1.0), (1.0, 0.0), (1.0, np.pi)])
def test_forces_out_of_range_are_refused(load, angle):
    for tip_of in (elastica.dead_force, elastica.follower_force):
        with pytest.raises(ValueError, match="must be"):
            tip_of(load, angle)


def test_negative_flexibilities_are_refused():
    for tip_of in (reissner.dead_force, reissner.follower_force):
        with pytest.raises(ValueError, match="cannot be negative"):
            tip_of(1.0, 1.0, axial=-1e-3)
        for load in (0.0, 51.0):
            with pytest.raises(ValueError, match="above 0 and at most"):
                tip_of(load)


# The rod in space, against what is known of it in a plane and of small loads, and a chain of column pieces.


STIFF = {"bending": (1e6, 1e6), "torsion": 1e6}


@pytest.mark.slow
@pytest.mark.parametrize("load", [1.0, 5.0])
def test_in_a_plane_it_is_the_elastica(load):
    tip = space.dead_force(100.0, (0.0, 100.0 * load, 0.0), **STIFF)
    exact = elastica.dead_force(load)
    assert (tip.x / 100.0, tip.y / 100.0) == pytest.approx((exact.x, exact.y), abs=1e-9)
    assert tip.z == 0.0


def test_with_stretch_and_shear_it_is_reissners_rod():
    tip = space.dead_force(100.0, (0.0, 200.0, 0.0), axial=1e4, shear=(5e3, 5e3), **STIFF)
    exact = reissner.dead_force(2.0, axial=1e6 / (1e4 * 1e4), shear=1e6 / (5e3 * 1e4))
    assert (tip.x / 100.0, tip.y / 100.0) == pytest.approx((exact.x, exact.y), abs=1e-9)


@pytest.mark.slow
def test_no_axis_is_preferred_where_the_section_has_none():
    R = np.array([0.0, np.cos(0.7), np.sin(0.7)])
    flat = space.dead_force(100.0, (0.0, 300.0, 0.0), **STIFF)
    oblique = space.dead_force(100.0, tuple(300.0 * R), **STIFF)
    assert oblique.x == pytest.approx(flat.x, abs=1e-8)
    assert (oblique.y, oblique.z) == pytest.approx(tuple(flat.y * R[1:]), abs=1e-8)


def test_a_small_load_across_a_quarter_circle_bends_and_twists_it():
    # Timoshenko, Strength of Materials II, section 80: F R³ [π/4EI + (3π/4 − 2)/GJ] across the plane
    F, R, EI, GJ = 1e-3, 100.0, 1e6, 5e5
    tip = space.dead_force(0.5 * np.pi * R, (0.0, 0.0, F), (EI, EI), GJ, curvature=1.0 / R)
    assert tip.z == pytest.approx(F * R**3 * (np.pi / 4.0 / EI + (0.75 * np.pi - 2.0) / GJ), rel=1e-6)
    assert (tip.x, tip.y) == pytest.approx((R, R), abs=1e-5)


def test_a_chain_of_one_column_is_the_clamped_column_however_it_is_cut():
    whole = Column(1000.0, 1e9, 1e7)
    exact = columns.critical_load(whole, columns.CLAMPED, columns.CLAMPED)
    halves = [Column(300.0, 1e9, 1e7), Column(700.0, 1e9, 1e7)]
    assert columns.clamped_chain([whole]) == pytest.approx(exact, rel=1e-12)
    # a rigid piece and its opposite are nothing
    assert columns.clamped_chain([halves[0], 50.0, -50.0, halves[1]]) == pytest.approx(exact, rel=1e-9)


def test_short_soft_pieces_tend_to_turning_springs():
    bar, c = Column(1000.0, 1e9, 1e7), 5e6
    limit = columns.critical_load(bar, columns.Support(rotational=c), columns.Support(rotational=c))
    errors = []
    for e in (10.0, 1.0):
        hinge = Column(e, c * e, 1e9)
        load = columns.clamped_chain([-e / 2, hinge, -e / 2, bar, -e / 2, hinge, -e / 2])
        errors.append(load / limit - 1.0)
    assert errors[0] == pytest.approx(2.6e-3, rel=0.05)
    assert errors[1] == pytest.approx(0.1 * errors[0], rel=0.02)


def test_a_chain_without_columns_is_refused():
    with pytest.raises(ValueError, match="nothing buckles"):
        columns.clamped_chain([1.0])
