"""Critical loads: against the nonlinear rod linearised numerically, print and characteristic equations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from vjm_validation.exact.columns import (
    CLAMPED,
    FREE,
    PINNED,
    Column,
    LateralSpring,
    Support,
    critical_load,
    partially_following,
    stiffness,
    transfer,
)
from vjm_validation.exact.postbuckling import STEEPEST, Buckled, Ends, at_angle, at_shortening
from vjm_validation.exact.rod import integrate, slope

GUIDED = Support(lateral=0.0, rotational=float("inf"))
"""May shift sideways, may not turn."""
RIGID = Column(1.0, 1.0)
SOFT = Column(1.0, 1.0, EA=400.0, GA=150.0)
EXTENSIBLE = Column(1.0, 1.0, EA=400.0)
COLUMNS = [RIGID, SOFT, EXTENSIBLE]


def numerical_transfer(column, load, length):
    """Derivative of the *nonlinear* rod's end by its start, by complex steps about the straight state.

    Nothing of the linearisation in `beam_column` enters. The step's imaginary part is beyond the reach of the error
    control, hence the short largest step of a method of the eighth order.
    """
    tiny = 1e-30
    columns = []
    for start in np.eye(4):
        w, theta, V, M = 1j * tiny * start
        end = solve_ivp(
            lambda _, y, V=V: slope(y, (-load, V), 1.0 / column.EA, 1.0 / column.GA),
            (0.0, length),
            np.array([0.0, w, theta, M], dtype=complex),
            method="DOP853",
            rtol=1e-12,
            max_step=0.02,
        ).y[:, -1]
        columns.append([end[1].imag / tiny, end[2].imag / tiny, start[2], end[3].imag / tiny])
    return np.array(columns).T


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("load", [0.05, 9.0, 45.0])
def test_transfer_is_the_linearised_rod(column, load):
    expected = numerical_transfer(column, load, 0.8)
    # 40 steps of 0.02 with (0.02 k)⁸ each
    assert transfer(column, load, 0.8) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("column", COLUMNS)
def test_stiffness_is_symmetric_and_composes(column):
    load = 12.0
    K = stiffness(column, load, 1.0)
    assert pytest.approx(K.T, abs=1e-11) == K
    assert transfer(column, load, 0.7) @ transfer(column, load, 0.3) == pytest.approx(
        transfer(column, load, 1.0), abs=1e-13
    )


def test_unloaded_stiffness_is_timoshenkos_beam():
    EI, GA, L = 3.0, 40.0, 2.0
    phi = 12.0 * EI / (GA * L**2)
    K = stiffness(Column(9.0, EI, GA=GA), 0.0, L)
    assert K[0, 0] == pytest.approx(12.0 * EI / L**3 / (1.0 + phi), rel=1e-13)
    assert K[1, 1] == pytest.approx((4.0 + phi) / (1.0 + phi) * EI / L, rel=1e-13)
    assert K[1, 3] == pytest.approx((2.0 - phi) / (1.0 + phi) * EI / L, rel=1e-13)


def determinant(column, load, base, end):
    """Of the end conditions, with the numerically linearised rod; zero at a critical load. Rigid or free ends."""
    T = numerical_transfer(column, load, 1.0)
    held = {PINNED: (0, 3), CLAMPED: (0, 1), FREE: (2, 3), GUIDED: (1, 2)}
    starts = [i for i in range(4) if i not in held[base]]
    return np.linalg.det(T[np.ix_(held[end], starts)])


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("column", [SOFT, EXTENSIBLE])
@pytest.mark.parametrize(("base", "end"), [(PINNED, PINNED), (CLAMPED, FREE), (CLAMPED, PINNED), (CLAMPED, GUIDED)])
def test_critical_load_is_the_root_of_the_numerical_determinant(column, base, end):
    found = critical_load(column, base, end)
    root = brentq(lambda P: determinant(column, P, base, end), 0.9 * found, 1.05 * found, rtol=1e-13)
    assert found == pytest.approx(root, rel=1e-10)


@pytest.mark.parametrize("column", COLUMNS)
def test_both_clamped(column):
    # symmetric mode: λ P = 4 π² EI/L² whatever the shear
    found = critical_load(column, CLAMPED, CLAMPED)
    assert found == pytest.approx(column.load(2.0 * np.pi), rel=1e-12)
    assert (
        determinant(column, 0.999 * found, CLAMPED, CLAMPED) * determinant(column, 1.001 * found, CLAMPED, CLAMPED)
        < 0.0
    )


@pytest.mark.parametrize("column", COLUMNS)
def test_characteristic_equations_of_the_docstring(column):
    def ratio(P):
        return (1.0 - P / column.EA) / (1.0 - P / column.EA + P / column.GA)

    def wave(P):
        return np.sqrt((1.0 - P / column.EA + P / column.GA) * P)

    assert wave(critical_load(column)) == pytest.approx(np.pi, rel=1e-12)
    assert wave(critical_load(column, CLAMPED, FREE)) == pytest.approx(0.5 * np.pi, rel=1e-12)
    # free of poles: sin z − (μ/λ) z cos z
    propped = critical_load(column, CLAMPED, PINNED)
    z = wave(propped)
    assert np.sin(z) == pytest.approx(ratio(propped) * z * np.cos(z), abs=1e-12)
    # clamped, rigidly held in the middle: the antisymmetric mode of the column clamped at both ends
    double = critical_load(column, CLAMPED, CLAMPED, [LateralSpring(0.5, float("inf"))])
    z = 0.5 * wave(double)
    assert np.sin(z) == pytest.approx(ratio(double) * z * np.cos(z), abs=1e-12)


@pytest.mark.parametrize("column", COLUMNS)
def test_rotational_springs(column):
    # one spring c at the base of a pinned column
    c = 1.7
    P = critical_load(column, Support(rotational=c), PINNED)
    T = numerical_transfer(column, P, 1.0)
    start = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [c, 0.0]])
    assert np.linalg.det((T @ start)[[0, 3]]) == pytest.approx(0.0, abs=1e-10)
    # limits; a spring of 1e9 is stiffer than the column by 1e9
    assert critical_load(column, Support(rotational=0.0)) == pytest.approx(critical_load(column), rel=1e-13)
    stiff = Support(rotational=1e9)
    assert critical_load(column, stiff, stiff) == pytest.approx(critical_load(column, CLAMPED, CLAMPED), rel=1e-8)


def test_column_on_a_base_spring_and_free():
    # k L tan k L = c L/EI, by the same equilibrium as the clamped column's
    c = 0.8
    z = brentq(lambda z: z * np.sin(z) - c * np.cos(z), 0.1, 1.5, xtol=1e-15)
    assert critical_load(RIGID, Support(rotational=c), FREE) == pytest.approx(z**2, rel=1e-12)
    # a weak spring: the column is as good as rigid, P L = c
    assert critical_load(RIGID, Support(rotational=1e-6), FREE) == pytest.approx(1e-6, rel=1e-6)


@pytest.mark.parametrize("spring", [0.5, 3.0, 9.0, 12.0])
def test_end_lateral_spring_on_a_pinned_base(spring):
    # either the rigid column tilts at P = k L or it bends as the pinned one at π² EI/L²
    P = critical_load(RIGID, PINNED, Support(lateral=spring))
    assert P == pytest.approx(min(spring, np.pi**2), rel=1e-12)


def test_cantilever_with_an_end_lateral_spring():
    # tan z = z − z³/κ, κ = k L³/EI by the same equilibrium
    kappa = 5.0
    z = brentq(lambda z: np.sin(z) - (z - z**3 / kappa) * np.cos(z), 1.6, 4.4, xtol=1e-15)
    assert critical_load(RIGID, CLAMPED, Support(lateral=kappa)) == pytest.approx(z**2, rel=1e-12)


def equal_springs(count, stiffness):
    return tuple(LateralSpring(i / (count + 1), stiffness) for i in range(1, count + 1))


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_equal_springs_of_full_stiffness_act_as_supports(count):
    # threshold stiffnesses in P_cr/span, P_cr = π² EI/span²: 2 (1 + cos(π/m)), m spans (Timoshenko and Gere 1961,
    # section 2.6: 2, 3, 3.41, 3.62). Rigid bars are the bound there, and a little above it two modes are near.
    m = count + 1
    load = np.pi**2 * m**2
    threshold = 2.0 * (1.0 + np.cos(np.pi / m)) * load * m
    assert critical_load(RIGID, springs=equal_springs(count, 1.3 * threshold)) == pytest.approx(load, rel=1e-11)
    assert critical_load(RIGID, springs=equal_springs(count, 0.5 * threshold)) < 0.999 * load


def test_one_spring_at_mid_span_where_two_modes_meet():
    # the symmetric mode: 4 P/(κ) = 1 − tan(z/2)/(z/2), z = k L; it meets the antisymmetric one at κ = 16 π²
    kappa = 50.0
    z = brentq(lambda z: (4.0 * z**2 / kappa - 1.0) * np.cos(z / 2) + np.sin(z / 2) / (z / 2), 3.2, 6.2, xtol=1e-15)
    assert critical_load(RIGID, springs=[LateralSpring(0.5, kappa)]) == pytest.approx(z**2, rel=1e-11)
    both = critical_load(RIGID, springs=[LateralSpring(0.5, 16.0 * np.pi**2)])
    assert both == pytest.approx(4.0 * np.pi**2, rel=1e-11)


def test_effective_rule_of_the_pinned_column():
    column = Column(310.0, 4.3e7, 6.74e6, 2.1e6)
    P = critical_load(column)
    euler = np.pi**2 * column.EI / column.length**2
    assert P * (1.0 + P / column.GA - P / column.EA) == pytest.approx(euler, rel=1e-12)


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("fraction", [0.0, 0.2, 0.45])
def test_partial_follower(column, fraction):
    P = partially_following(column, fraction)
    # base clamped: unknown V and M there; at the end M = 0 and V = −η P θ
    T = numerical_transfer(column, P, 1.0)
    conditions = np.array([T[3, 2:], T[2, 2:] + fraction * P * T[1, 2:]])
    # rounding, 3e-16
    assert np.linalg.det(conditions) == pytest.approx(0.0, abs=1e-14)


def test_partial_follower_ends():
    assert partially_following(RIGID, 0.0) == pytest.approx(0.25 * np.pi**2, rel=1e-15)
    assert partially_following(RIGID, 0.5) == pytest.approx(np.pi**2, rel=1e-15)


def test_units_scale():
    mm = critical_load(Column(310.0, 4.3e7, 6.74e6, 2.1e6), Support(rotational=2e5), Support(lateral=50.0))
    m = critical_load(Column(0.310, 43.0, 6.74e6, 2.1e6), Support(rotational=2e2), Support(lateral=5e4))
    assert m == pytest.approx(mm, rel=1e-12)


def test_out_of_range_is_refused():
    with pytest.raises(ValueError, match="mechanism"):
        critical_load(RIGID, PINNED, FREE)
    with pytest.raises(ValueError, match="without buckling"):
        critical_load(Column(1.0, 1.0, EA=30.0))
    with pytest.raises(ValueError, match="too stubby"):
        Column(1.0, 1.0, EA=30.0).load(np.pi)
    with pytest.raises(ValueError, match="must be above 0"):
        Column(0.0, 1.0)
    with pytest.raises(ValueError, match="cannot be negative"):
        Support(lateral=-1.0)
    with pytest.raises(ValueError, match="between the ends"):
        LateralSpring(1.0, 3.0)
    with pytest.raises(ValueError, match="from 0 to ½"):
        partially_following(RIGID, 0.51)


# Buckled columns: elliptic integrals, quadrature and shooting of the rod agree.


HELD = {Ends.CLAMPED_FREE: (CLAMPED, FREE), Ends.PINNED: (PINNED, PINNED), Ends.CLAMPED: (CLAMPED, CLAMPED)}
SOFTNESSES = [(0.0, 0.0), (1e-3, 0.0), (1e-3, 2.6e-3), (0.0, 4e-3)]


def elastica(angle, ends=Ends.PINNED):
    """The inextensible, shear-rigid column in complete elliptic integrals: a quarter wave, scaled to the column."""
    k, waves = np.sin(0.5 * angle), ends.quarter_waves
    K, E = ellipk(k**2), ellipe(k**2)
    deflection = ends.amplitudes * 2.0 * k / K / waves
    return Buckled(K**2 * waves**2, 2.0 * (1.0 - E / K), deflection, angle)


def as_array(state):
    return np.array([state.force, state.shortening, state.deflection, state.angle])


@pytest.mark.parametrize("ends", Ends)
@pytest.mark.parametrize("angle", [0.0, 1e-3, 1.0, 2.5, STEEPEST])
def test_quadrature_is_the_elliptic_integral_for_a_rigid_section(ends, angle):
    assert as_array(at_angle(angle, ends)) == pytest.approx(as_array(elastica(angle, ends)), rel=1e-13, abs=1e-14)


# Timoshenko and Gere (1961), section 2.7, the clamped, free column: P/P_cr, x_a/l, y_a/l. Half a unit of the last
# printed digit and, in the table's own rounding, one more.
@pytest.mark.parametrize(
    ("degrees", "ratio", "x", "y"),
    [(20, 1.015, 0.970, 0.220), (40, 1.063, 0.881, 0.422), (60, 1.152, 0.741, 0.593), (80, 1.293, 0.560, 0.719)],
)
def test_timoshenko_and_gere_confirmed(degrees, ratio, x, y):
    state = elastica(np.radians(degrees), Ends.CLAMPED_FREE)
    assert state.force / (0.25 * np.pi**2) == pytest.approx(ratio, abs=1e-3)
    assert 1.0 - state.shortening == pytest.approx(x, abs=1e-3)
    assert state.deflection == pytest.approx(y, abs=1e-3)


@pytest.mark.parametrize(("axial", "shear"), SOFTNESSES)
@pytest.mark.parametrize("angle", [0.3, 1.4, 2.6])
def test_pinned_column_integrated_from_end_to_end(axial, shear, angle):
    # The rod's own differential equation from one hinge, at the turn and force found, ends in the other one: no
    # moment, on the line of thrust, with the turn reversed. Errors of 1e-13 grow along the rod.
    state = at_angle(angle, Ends.PINNED, axial, shear)
    force = (-state.force, 0.0)
    middle = integrate(np.array([0.0, 0.0, angle, 0.0]), force, (0.0, 0.5), axial, shear)
    end = integrate(middle, force, (0.5, 1.0), axial, shear)
    assert middle[:3] == pytest.approx([0.5 * (1.0 - state.shortening), state.deflection, 0.0], abs=1e-11)
    assert end == pytest.approx([1.0 - state.shortening, 0.0, -angle, 0.0], abs=1e-10)


@pytest.mark.parametrize(("axial", "shear"), SOFTNESSES)
def test_clamped_column_integrated_from_end_to_end(axial, shear):
    state = at_angle(0.8, Ends.CLAMPED, axial, shear)
    # moment of the thrust about the inflection, half of the greatest deflection away
    start = np.array([0.0, 0.0, 0.0, 0.5 * state.force * state.deflection])
    end = integrate(start, (-state.force, 0.0), (0.0, 1.0), axial, shear)
    assert end[:3] == pytest.approx([1.0 - state.shortening, 0.0, 0.0], abs=1e-10)


@pytest.mark.parametrize("ends", Ends)
@pytest.mark.parametrize(("axial", "shear"), SOFTNESSES)
def test_branch_leaves_the_straight_column_at_its_critical_load(ends, axial, shear):
    column = Column(1.0, 1.0, *(1.0 / f if f else np.inf for f in (axial, shear)))
    critical = critical_load(column, *HELD[ends])
    start = at_angle(0.0, ends, axial, shear)
    assert start.force == pytest.approx(critical, rel=1e-13)
    assert start.shortening == pytest.approx(axial * critical, abs=1e-15)


@pytest.mark.parametrize("ends", Ends)
@pytest.mark.parametrize(("axial", "shear"), SOFTNESSES)
def test_shortening_is_inverted(ends, axial, shear):
    state = at_angle(1.1, ends, axial, shear)
    # the slope of shortening by angle is of order one
    assert as_array(at_shortening(state.shortening, ends, axial, shear)) == pytest.approx(
        as_array(state), rel=1e-12
    )


def test_initial_postbuckling_stiffness_is_half_of_the_critical_load():
    # P/P_cr = 1 + Δ/2 + O(Δ²) for the inextensible pinned column (Koiter's expansion)
    small = 1e-5
    assert at_shortening(small).force / np.pi**2 - 1.0 == pytest.approx(0.5 * small, abs=small**2)


def test_straight_before_buckling():
    state = at_shortening(5e-3, axial=1e-3)
    assert as_array(state) == pytest.approx([5.0, 5e-3, 0.0, 0.0], rel=1e-15)


def test_postbuckling_out_of_range_is_refused():
    with pytest.raises(ValueError, match="from 0 to"):
        at_angle(3.1)
    with pytest.raises(ValueError, match="cannot be negative"):
        at_angle(0.1, axial=-1.0)
    with pytest.raises(ValueError, match="above 0"):
        at_shortening(0.0)
    with pytest.raises(ValueError, match="wound up"):
        at_shortening(1.9)
    with pytest.raises(ValueError, match="no buckled shape"):
        at_angle(0.1, axial=0.1)
