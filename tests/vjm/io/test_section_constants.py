"""Constants of shapes: against sectionproperties, closed forms at the limits, and each other."""

import json
from pathlib import Path

import numpy as np
import pytest

import vjm
from vjm.io.model_plausibility import model_findings
from vjm.io.saint_venant import THINNEST, polygon_constants
from vjm.io.shapes import SHAPES, Shape

MATERIAL = {"youngs_modulus_MPa": 1000.0, "poissons_ratio": 0.3}
# made by `python tests/helpers/make_section_constants.py`
ROWS = json.loads((Path(__file__).parent / "section_constants.json").read_text(encoding="utf-8"))
CORNER = 1e-3
"""What sectionproperties' two meshes, extrapolated, leave of the re-entrant corner: 3.5e-4 at most here."""


def made(section: dict, nu: float = 0.3) -> Shape:
    return SHAPES[section["shape"]].model_validate({**section, **MATERIAL, "poissons_ratio": nu})


def i_beam(width: float, height: float, flange: float, web: float, nu: float = 0.3) -> Shape:
    return made({"shape": "i_beam", "width_mm": width, "height_mm": height, "flange_mm": flange, "web_mm": web}, nu)


def tube(width: float, thickness: float, wall: float, nu: float = 0.3) -> Shape:
    return made({"shape": "rectangular_tube", "width_mm": width, "thickness_mm": thickness, "wall_mm": wall}, nu)


def rectangle(width: float, thickness: float, nu: float = 0.3) -> Shape:
    return made({"shape": "rectangle", "width_mm": width, "thickness_mm": thickness}, nu)


def words(row: dict) -> str:
    sides = "-".join(f"{value:g}" for value in row["section"].values() if isinstance(value, float))
    return f"{row['section']['shape']}-{sides}-{row['poissons_ratio']}"


@pytest.mark.parametrize("row", ROWS, ids=words)
def test_sectionproperties_finds_the_same(row):
    shape = made(row["section"], row["poissons_ratio"])
    # its circles are polygons of 720 corners, whose area is 1.3e-5 low and whose inertia is 2.5e-5 low
    exact = 4e-5 if shape.rounded else 1e-9
    assert (shape.area, *shape.inertias) == pytest.approx((row["area"], row["Iy"], row["Iz"]), rel=exact)
    assert shape.torsion_constant == pytest.approx(row["J"], rel=CORNER)
    assert shape.shear_areas == pytest.approx((row["Ay"], row["Az"]), rel=CORNER)
    if not shape.rounded:
        # a thin square tube warps at its corners alone: two meshes of the reference are 1 % apart there
        assert shape.warping_constant == pytest.approx(row["Iw"], rel=1e-2)


def test_the_table_holds_every_shape_thin_and_stubby():
    assert {row["section"]["shape"] for row in ROWS} == SHAPES.keys() - {"polygon"}
    # what two of its meshes differ by is more than the error after extrapolation
    assert max(row["meshes_apart"] for row in ROWS) < 6e-3


@pytest.mark.parametrize("b", [10.0, 100.0, 1000.0, 4900.0])
def test_thin_open_sections_are_strips(b):
    """Three strips; an end takes 0.105 t⁴, a joint adds 0.1059 D⁴, D = 5/4 t (El Darwish and Johnston, fitted)."""
    shape = i_beam(b, 2.0 * b, 1.0, 1.0)
    strips = (2.0 * b + 2.0 * b - 2.0) / 3.0
    # what their fit is good to: an eighth of what two joints add
    assert shape.torsion_constant == pytest.approx(strips - 4.0 * 0.105 + 2.0 * 0.1059 * 1.25**4, abs=0.07)
    # flanges that bend against each other
    assert shape.warping_constant == pytest.approx(b**3 / 12.0 * (2.0 * b - 1.0) ** 2 / 2.0, rel=2.0 / b)


@pytest.mark.parametrize(("w", "t"), [(100.0, 100.0), (1000.0, 500.0), (5000.0, 1000.0)])
def test_thin_tubes_follow_bredt(w, t):
    shape, s = tube(w, t, 0.5), 0.5
    cell = (w - s) * (t - s)
    bredt = 4.0 * cell**2 * s / (2.0 * (w + t - 2.0 * s))
    own = 2.0 / 3.0 * (w + t - 2.0 * s) * s**3
    # corners add as much as the walls' own torsion
    assert bredt < shape.torsion_constant < bredt + 4.0 * own + 4.0 * s * bredt / (w + t)
    # shear flow q = V Q/I of a thin box: 1/A_s = ∮ Q²/s ds/I², with Q from the flanges' middle on
    B, H, (y, weight) = w - s, t - s, np.polynomial.legendre.leggauss(8)
    flange, web = s * 0.5 * H * 0.25 * B * (y + 1.0), s * 0.25 * B * H + 0.125 * s * H**2 * (1.0 - y**2)
    energy = (4.0 * 0.25 * B * flange**2 + 2.0 * 0.5 * H * web**2) @ weight / s
    Iz = 2.0 * B * s * 0.25 * H**2 + 2.0 * s * H**3 / 12.0
    # the walls' thickness is left out: s/H of it
    assert tube(w, t, s, 0.0).shear_areas[0] == pytest.approx(Iz**2 / energy, rel=2.0 * s / t)


@pytest.mark.parametrize(("w", "t"), [(40.0, 40.0), (400.0, 10.0), (10.0, 400.0)])
def test_walls_that_nearly_fill_the_box_make_a_rectangle(w, t):
    """A hole of a ten-thousandth in the middle, where torsion has no stress, takes nothing but its area."""
    solid = rectangle(w, t)
    hole = 1e-4 * min(w, t)
    filled = tube(w, t, 0.5 * (min(w, t) - hole))
    slit = hole + abs(w - t)
    if w == t:
        assert filled.torsion_constant == pytest.approx(solid.torsion_constant, rel=1e-5)
        assert filled.shear_areas == pytest.approx(solid.shear_areas, rel=1e-4)
    else:
        # the hole is a slit along the middle: the sides that are left glide, but where the ends join them
        assert filled.area == pytest.approx(solid.area - hole * slit, rel=1e-12)
        assert filled.torsion_constant < solid.torsion_constant
    # grooves of a ten-thousandth on both sides
    grooved = i_beam(w, t, 0.5 * t - hole, w - 2.0 * hole)
    assert grooved.torsion_constant == pytest.approx(solid.torsion_constant, rel=2e-3)
    assert grooved.shear_areas == pytest.approx(solid.shear_areas, rel=2e-3)


def test_a_turned_section_has_the_same_constants():
    one, other = tube(60.0, 40.0, 4.0), tube(40.0, 60.0, 4.0)
    assert one.torsion_constant == pytest.approx(other.torsion_constant, rel=1e-12)
    assert one.shear_areas == pytest.approx(other.shear_areas[::-1], rel=1e-10)
    flat, upright = rectangle(50.0, 10.0), rectangle(10.0, 50.0)
    assert flat.shear_areas == pytest.approx(upright.shear_areas[::-1], rel=1e-10)
    # and in another unit
    small = tube(6.0, 4.0, 0.4)
    assert small.torsion_constant == pytest.approx(1e-4 * one.torsion_constant, rel=1e-10)


def test_a_narrow_rectangle_has_five_sixths_along_its_depth():
    """The energy of the parabola is 6/5 for a force along the depth; Poisson's ratio adds nothing."""
    for nu in (0.0, 0.49):
        assert rectangle(1.0, 1000.0, nu).shear_areas[0] == pytest.approx(1000.0 * 5.0 / 6.0, rel=1e-5)
    # without Poisson's ratio whatever the proportion
    assert rectangle(70.0, 30.0, 0.0).shear_areas == pytest.approx((1750.0, 1750.0), rel=1e-9)


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.5])
def test_round_bars_and_thin_tubes_in_shear(nu):
    """6 (1 + ν)²/(7 + 14 ν + 8 ν²) of a circle (Renton 1991), a half of a thin tube."""
    bar = made({"shape": "round_bar", "diameter_mm": 20.0}, nu)
    assert bar.shear_areas[0] / bar.area == pytest.approx(
        6.0 * (1 + nu) ** 2 / (7 + 14 * nu + 8 * nu**2), rel=1e-12
    )
    thin = made({"shape": "round_tube", "diameter_mm": 1000.0, "wall_mm": 0.1}, nu)
    assert thin.shear_areas[1] / thin.area == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("row", ROWS[::3], ids=words)
def test_fibres_are_the_sections(row):
    shape = made(row["section"])
    y, area = shape.fibres()
    # Gauss points meet a circle's steep end with a relative error of 3e-6
    assert 2.0 * area.sum() == pytest.approx(shape.area, rel=1e-5)
    assert 2.0 * (y**2 * area).sum() == pytest.approx(shape.inertias[1], rel=1e-5)
    assert y.min() > 0.0
    assert y.max() < 0.5 * shape.sides[0]


def test_shear_is_computed_where_it_is_asked_for():
    section = {
        "shape": "i_beam",
        "width_mm": 100.0,
        "height_mm": 200.0,
        "flange_mm": 8.5,
        "web_mm": 5.6,
        **MATERIAL,
    }
    G = 1000.0 / 2.6
    plain, given, own = (
        SHAPES["i_beam"].model_validate({**section, **more}).stiffness()
        for more in ({}, {"shear_factor": 0.5}, {"shear_factor": "computed"})
    )
    assert np.isinf([plain.GAy, plain.GAz]).all()
    assert (given.GAy, given.GAz) == pytest.approx((0.5 * G * 2724.8,) * 2)
    row = next(row for row in ROWS if row["section"].get("web_mm") == 5.6 and row["poissons_ratio"] == 0.3)
    assert (own.GAy, own.GAz) == pytest.approx((G * row["Ay"], G * row["Az"]), rel=CORNER)
    for wrong in ("cowper", 0.0, 1.2, True, float("nan")):
        with pytest.raises(ValueError, match="shear_factor"):
            SHAPES["i_beam"].model_validate({**section, "shear_factor": wrong})


def test_a_shear_modulus_stands_for_poissons_ratio():
    isotropic = rectangle(50.0, 10.0, 0.3)
    given = {**{k: v for k, v in MATERIAL.items() if k != "poissons_ratio"}, "shear_modulus_MPa": 1000.0 / 2.6}
    same = SHAPES["rectangle"].model_validate(
        {"shape": "rectangle", "width_mm": 50.0, "thickness_mm": 10.0, **given}
    )
    assert same.shear_areas == pytest.approx(isotropic.shear_areas, rel=1e-12)


@pytest.mark.parametrize("shape", [
    {"shape": "square_tube", "width_mm": 2000.0, "wall_mm": 0.1},
    {"shape": "rectangular_tube", "width_mm": 2000.0, "thickness_mm": 10.0, "wall_mm": 0.1},
    {"shape": "i_beam", "width_mm": 10.0, "height_mm": 2000.0, "flange_mm": 1.0, "web_mm": 0.1},
])  # fmt: skip
def test_foils_are_refused(shape):
    assert 0.1 < THINNEST * 2000.0
    with pytest.raises(ValueError, match="below a ten-thousandth of its side of 2000 mm"):
        made(shape)


def model(section: dict, length: float) -> dict:
    return {
        "format": 1, "name": "m", "title": "m", "source": "made up",
        "units": {"length": "mm", "force": "N", "angle": "rad"}, "postures": {"home": []},
        "parts": [{"kind": "beam", "name": "b", "length_mm": length,
                   "section": {**section, "youngs_modulus_MPa": 2.1e5, "poissons_ratio": 0.3}}],
    }  # fmt: skip


def test_warping_that_matters_is_said():
    section = {"shape": "i_beam", "width_mm": 100.0, "height_mm": 200.0, "flange_mm": 8.5, "web_mm": 5.6}
    (said,) = [f for f in model_findings(model(section, 2000.0), "m.toml") if "warp" in f.description]
    # √(2.6 I_w/J) with sectionproperties' constants
    row = next(row for row in ROWS if row["section"].get("web_mm") == 5.6 and row["poissons_ratio"] == 0.3)
    length = np.sqrt(2.6 * row["Iw"] / row["J"])
    assert f"is {length:.3g} of 2000 mm" in said.description
    # Vlasov: k − tanh k with k = L/λ for one end
    k = 2000.0 / length
    assert f"by {100.0 * (k / (k - np.tanh(k)) - 1.0):.0f} %, with both" in said.description
    for quiet in ({"shape": "round_tube", "diameter_mm": 80.0, "wall_mm": 4.0},
                  {"shape": "square_tube", "width_mm": 60.0, "wall_mm": 3.0}):  # fmt: skip
        assert not [f for f in model_findings(model(quiet, 400.0), "m.toml") if "warp" in f.description]
    # thirty times as long it does not matter
    assert not [f for f in model_findings(model(section, 60000.0), "m.toml") if "warp" in f.description]


# Polygons against closed forms, against the shapes of right angles, and what is refused.


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
    constants = shape.geometry
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
