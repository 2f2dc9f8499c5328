"""``validate section``: constants of shapes against closed forms, and what it refuses."""

import math
from pathlib import Path

import pytest
from helpers.command import json_of, refused, validate


def sections(*words: str) -> list[dict]:
    return json_of("section", *words)["sections"]


def test_a_round_tube_is_that_of_closed_forms():
    (row,) = sections("round_tube", "diameter_mm=50", "wall_mm=5")
    area, polar = math.pi / 4 * (50**2 - 40**2), math.pi / 32 * (50**4 - 40**4)
    assert row["area_mm2"] == pytest.approx(area)
    assert row["second_moments_mm4"] == pytest.approx([polar / 2, polar / 2])
    assert row["torsion_constant_mm4"] == pytest.approx(polar)
    assert row["warping_constant_mm6"] == 0.0
    # steel: 210 GPa, 7850 kg/m³
    assert row["EA_N"] == pytest.approx(2.1e5 * area)
    assert row["GJ_Nmm2"] == pytest.approx(2.1e5 / 2.6 * polar)
    assert row["mass_kg_per_m"] == pytest.approx(7850e-6 * area)


def test_a_rectangle_bends_softly_about_z_and_twists_as_tables_say():
    """J of a rectangle 2:1 is 0.229 b t³ (Timoshenko and Goodier, Theory of Elasticity, § 109: three digits)."""
    (row,) = sections(
        "rectangle", "width_mm=20", "thickness_mm=10", "youngs_modulus_MPa=7e4", "shear_modulus_MPa=26000"
    )
    assert row["second_moments_mm4"] == pytest.approx([10 * 20**3 / 12, 20 * 10**3 / 12])
    assert row["section_moduli_mm3"] == pytest.approx([10 * 20**2 / 6, 20 * 10**2 / 6])
    assert row["torsion_constant_mm4"] == pytest.approx(0.229 * 20 * 10**3, rel=0.0005 / 0.229)
    assert row["EI_Nmm2"][1] == pytest.approx(7e4 * 20 * 10**3 / 12)
    assert row["mass_kg_per_m"] == 0.0


def test_a_model_shows_its_shapes_and_a_picture(tmp_path: Path):
    rows = sections("planar-2r", "--plot", str(tmp_path / "a.png"))
    assert [row["name"] for row in rows]
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    first = rows[0]["name"]
    assert sections("planar-2r", "--part", first) == rows[:1]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["square_tube", "width_mm=60", "wall_mm=40"], "leaves no hole"),
        (["square_tube", "width=60", "wall_mm=4"], "width"),
        (["square_tube", "width_mm=x", "wall_mm=4"], "'x' is no number"),
        (["square_tube", "60"], "no key=value"),
        (["square_tub", "width_mm=60"], "did you mean 'square_tube'"),
        (["planar-2r", "--part", "no"], "no part 'no'"),
        (["ur10"], "no section has a shape"),
    ],
)
def test_what_is_no_shape_is_one_line(words, says):
    assert says in refused("section", *words)


def test_a_profile_is_read_from_files_of_points(tmp_path: Path):
    outline, hole = tmp_path / "outline.csv", tmp_path / "hole.csv"
    outline.write_text("y_mm,z_mm\n0,0\n40,0\n40,40\n0,40\n")
    hole.write_text("y_mm,z_mm\n4,4\n36,4\n36,36\n4,36\n")
    plot = tmp_path / "profile.png"
    printed = validate("section", "polygon", "--points", outline, hole, "--plot", plot).out
    for words in ("576 mm²", "errors of the mesh", "shear centre from the centroid"):
        assert words in printed
    assert "no section of a beam" not in printed
    assert plot.stat().st_size > 1000
    outline.write_text("y_mm,z_mm\n0,0\n60,0\n60,6\n6,6\n6,60\n0,60\n")
    (row,) = sections("polygon", "--points", str(outline))
    assert row["shear_centre_mm"][0] < -10.0
    assert "principal axes are turned" in row["no_beam"]


@pytest.mark.parametrize(
    ("text", "said"), [("y,z\n1,2\n", "begin with the line y_mm,z_mm"), ("y_mm,z_mm\n1\n", "row 1: write two")]
)
def test_points_that_are_none_are_refused(tmp_path: Path, text, said):
    (tmp_path / "a.csv").write_text(text)
    assert said in refused("section", "polygon", "--points", tmp_path / "a.csv")


def test_points_belong_to_a_polygon_and_a_polygon_needs_some():
    assert "give its corners" in refused("section", "polygon")
    assert "belong to the shape polygon" in refused("section", "rectangle", "--points", "a.csv")
