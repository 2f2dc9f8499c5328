"""Buckled columns: elliptic integrals, quadrature and shooting of the rod agree."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_validation.exact.columns import CLAMPED, FREE, PINNED, Column, critical_load
from vjm_validation.exact.postbuckling import STEEPEST, Ends, at_angle, at_shortening, elastica
from vjm_validation.exact.rod import integrate

HELD = {Ends.CLAMPED_FREE: (CLAMPED, FREE), Ends.PINNED: (PINNED, PINNED), Ends.CLAMPED: (CLAMPED, CLAMPED)}
SOFT = [(0.0, 0.0), (1e-3, 0.0), (1e-3, 2.6e-3), (0.0, 4e-3)]


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


@pytest.mark.parametrize(("axial", "shear"), SOFT)
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


@pytest.mark.parametrize(("axial", "shear"), SOFT)
def test_clamped_column_integrated_from_end_to_end(axial, shear):
    state = at_angle(0.8, Ends.CLAMPED, axial, shear)
    # moment of the thrust about the inflection, half of the greatest deflection away
    start = np.array([0.0, 0.0, 0.0, 0.5 * state.force * state.deflection])
    end = integrate(start, (-state.force, 0.0), (0.0, 1.0), axial, shear)
    assert end[:3] == pytest.approx([1.0 - state.shortening, 0.0, 0.0], abs=1e-10)


@pytest.mark.parametrize("ends", Ends)
@pytest.mark.parametrize(("axial", "shear"), SOFT)
def test_branch_leaves_the_straight_column_at_its_critical_load(ends, axial, shear):
    column = Column(1.0, 1.0, *(1.0 / f if f else np.inf for f in (axial, shear)))
    critical = critical_load(column, *HELD[ends])
    start = at_angle(0.0, ends, axial, shear)
    assert start.force == pytest.approx(critical, rel=1e-13)
    assert start.shortening == pytest.approx(axial * critical, abs=1e-15)


@pytest.mark.parametrize("ends", Ends)
@pytest.mark.parametrize(("axial", "shear"), SOFT)
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


def test_out_of_range_is_refused():
    with pytest.raises(ValueError, match="from 0 to"):
        elastica(3.1)
    with pytest.raises(ValueError, match="cannot be negative"):
        at_angle(0.1, axial=-1.0)
    with pytest.raises(ValueError, match="above 0"):
        at_shortening(0.0)
    with pytest.raises(ValueError, match="wound up"):
        at_shortening(1.9)
    with pytest.raises(ValueError, match="no buckled shape"):
        at_angle(0.1, axial=0.1)
