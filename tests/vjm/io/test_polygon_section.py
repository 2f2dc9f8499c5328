"""Polygons against closed forms, against the shapes of right angles, and what is refused."""

import numpy as np
import pytest

import vjm
from vjm.io.saint_venant import polygon_constants

SQUARE = ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0))
HOLE = ((4.0, 4.0), (36.0, 4.0), (36.0, 36.0), (4.0, 36.0))
ANGLE = ((0.0, 0.0), (60.0, 0.0), (60.0, 6.0), (6.0, 6.0), (6.0, 60.0), (0.0, 60.0))
# what a mesh of half the width changes, of torsion: the error that is told
TOLD = 2e-3


def turned(loop, angle, shift=(7.0, -3.0)):
    c, s = np.cos(angle), np.sin(angle)
    return tuple((c * y - s * z + shift[0], s * y + c * z + shift[1]) for y, z in loop)


def test_an_equilateral_triangle_in_closed_form():
    side = 30.0
    high = side * np.sqrt(3.0) / 2.0
    found = polygon_constants((((0.0, 0.0), (high, side / 2), (high, -side / 2)),), 0.3)
    assert found.area == pytest.approx(np.sqrt(3.0) / 4.0 * side**2, rel=1e-12)
    assert found.inertias == pytest.approx((side**4 / (32.0 * np.sqrt(3.0)),) * 2, rel=1e-12)
    # Saint-Venant: J = √3 a⁴/80; the mesh tells 1.5e-4 and is off by 8e-6
    assert found.torsion == pytest.approx(np.sqrt(3.0) / 80.0 * side**4, rel=5e-5)
    assert found.errors["torsion"] < 3e-4
    # by symmetry
    assert found.shear_centre == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_rectangle_is_that_of_the_series(angle):
    exact = vjm.shape("rectangle", width_mm=50.0, thickness_mm=20.0)
    found = polygon_constants((turned(((0.0, 0.0), (20.0, 0.0), (20.0, 50.0), (0.0, 50.0)), angle),), 0.3)
    assert found.area == pytest.approx(exact.area, rel=1e-12)
    assert sum(found.inertias) == pytest.approx(sum(exact.inertias), rel=1e-12)
    # Mohr's circle
    assert found.product == pytest.approx(
        0.5 * (exact.inertias[1] - exact.inertias[0]) * np.sin(2.0 * angle), rel=1e-9, abs=1e-7
    )
    # the second mesh is off by a fifth of what the first one is off by: 1.1e-4, 2e-6 and 6e-4 here
    assert found.torsion == pytest.approx(exact.torsion_constant, rel=TOLD)
    assert found.warping == pytest.approx(exact.warping_constant, rel=TOLD)
    if not angle:
        assert found.shear_areas == pytest.approx(exact.shear_areas, rel=TOLD)
    assert max(found.errors.values()) < TOLD


def test_a_tube_is_that_of_the_quarter():
    exact = vjm.shape("square_tube", width_mm=40.0, wall_mm=4.0)
    # steel as there; the hole may run either way
    polygon = vjm.shape("polygon", outline_mm=SQUARE, holes_mm=[HOLE[::-1]])
    own, other = polygon.stiffness(), exact.stiffness()
    assert (own.EA, own.EIy, own.EIz) == pytest.approx((other.EA, other.EIy, other.EIz), rel=1e-12)
    assert own.GJ == pytest.approx(other.GJ, rel=5e-5)
    assert polygon.warping_constant == pytest.approx(exact.warping_constant, rel=5e-4)
    assert polygon.shear_areas == pytest.approx(exact.shear_areas, rel=5e-5)
    assert polygon.section_moduli == pytest.approx(exact.section_moduli, rel=1e-12)
    (places, areas), (_, others) = polygon.fibres(), exact.fibres()
    assert areas.sum() == pytest.approx(others.sum(), rel=1e-12)
    assert 2.0 * float(areas @ places**2) == pytest.approx(exact.inertias[1], rel=1e-12)


def test_an_angle_twists_about_the_crossing_of_its_legs():
    found = polygon_constants((ANGLE,), 0.3)
    crossing = np.array(found.centroid) + found.shear_centre
    # of thin legs at the crossing of their middle lines, 3 mm from both faces; these have a tenth of their length
    assert crossing == pytest.approx([3.0, 3.0], abs=0.3)
    # b t³/3 of both legs, whose corner adds some per cent and whose free ends take some away
    assert found.torsion == pytest.approx((60.0 + 54.0) * 6.0**3 / 3.0, rel=0.05)
    assert found.errors["torsion"] < TOLD
    with pytest.raises(ValueError, match=r"principal axes are turned by 0\.785"):
        vjm.shape("polygon", outline_mm=ANGLE).stiffness()


def test_a_channel_is_no_section_of_a_beam():
    channel = (
        (0.0, 0.0),
        (40.0, 0.0),
        (40.0, 3.0),
        (3.0, 3.0),
        (3.0, 57.0),
        (40.0, 57.0),
        (40.0, 60.0),
        (0.0, 60.0),
    )
    shape = vjm.shape("polygon", outline_mm=channel)
    # thin walls: e = 3 b² t/(h t + 6 b t) beside the web's middle line, b = 38.5 and h = 57
    e = 3.0 * 38.5**2 / (57.0 + 6.0 * 38.5)
    constants = shape.constants
    assert 1.5 - constants.centroid[0] - constants.shear_centre[0] == pytest.approx(e, rel=0.02)
    with pytest.raises(ValueError, match="shear centre lies"):
        shape.stiffness()


@pytest.mark.parametrize(
    ("outline", "holes", "said"),
    [
        (SQUARE[:2], [], "needs three corners"),
        ((SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]), [], "crosses or touches itself"),
        (SQUARE, [((50.0, 4.0), (60.0, 4.0), (55.0, 9.0))], "does not lie in the material"),
        (SQUARE, [((30.0, 4.0), (60.0, 4.0), (55.0, 9.0))], "crosses or touches hole 1"),
        (SQUARE, [HOLE, ((10.0, 10.0), (20.0, 10.0), (15.0, 15.0))], "does not lie in the material"),
        (((0.0, 0.0), (1000.0, 0.0), (1000.0, 2.0), (0.0, 2.0)), [], "thinner than a hundredth"),
    ],
)
def test_what_is_no_profile_is_refused(outline, holes, said):
    with pytest.raises(vjm.ModelFileError, match=said):
        vjm.shape("polygon", outline_mm=outline, holes_mm=holes)


def test_a_file_has_a_polygon_and_refuses_an_angle(tmp_path):
    text = """
format = 1
name = "bar"
title = "A cantilever"
source = "made up"
units = { length = "mm", force = "N", angle = "rad" }
[[parts]]
kind = "beam"
name = "bar"
length_mm = 500.0
[parts.section]
shape = "polygon"
outline_mm = OUTLINE
youngs_modulus_MPa = 2.1e5
poissons_ratio = 0.3
[postures]
here = {}
"""
    file = tmp_path / "bar.toml"
    file.write_text(text.replace("OUTLINE", "[[0, 0], [20, 0], [20, 50], [0, 50]]"))
    found = vjm.stiffness(vjm.load(file), wrench=(0.0, -100.0, 0.0, 0.0, 0.0, 0.0))
    # PL³/3EI, large deflections change it by 1e-6
    assert found.displacement[1] == pytest.approx(
        -100.0 * 500.0**3 / (3.0 * 2.1e5 * 50.0 * 20.0**3 / 12.0), rel=1e-5
    )
    file.write_text(text.replace("OUTLINE", str([list(corner) for corner in ANGLE])))
    with pytest.raises(vjm.ModelFileError, match=r"bar\.toml.*principal axes"):
        vjm.load(file)
