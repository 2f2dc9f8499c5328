"""The rod in space, against what is known of it in a plane and of small loads, and a chain of column pieces."""

import numpy as np
import pytest

from vjm_validation.exact import columns, elastica, reissner, space
from vjm_validation.exact.columns import Column

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
