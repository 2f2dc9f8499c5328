"""Drawings in models as commands use them: yield beside the critical load, weight, the beam in the part's place.

What the finite elements would find is written beside the drawing beforehand: a rectangular bar by beam theory.
"""

import json
import re

import numpy as np
import pytest
from helpers.command import json_of, refused, validate

from vjm.io.model_file import load_chain
from vjm.io.solid_compliance import SolidResult, SolidTable, kept_file
from vjm.model.parts import Section

LENGTH, HEIGHT, WIDTH, E, NU, LIMIT = 200.0, 6.0, 8.0, 70000.0, 0.33, 250.0
AREA = HEIGHT * WIDTH
DENSITY = 2700.0
"""kg/m³."""
G = 0.5 * E / (1.0 + NU)
SECTION = Section(
    E * AREA, G * 0.2 * HEIGHT**3 * WIDTH, E * HEIGHT * WIDTH**3 / 12.0, E * WIDTH * HEIGHT**3 / 12.0,
    5.0 / 6.0 * G * AREA, 5.0 / 6.0 * G * AREA,
)  # fmt: skip
MODEL = """
format = 1
name = "bar"
title = "A bar from a drawing"
source = "a test"

[units]
length = "mm"
force = "N"
angle = "rad"

[[parts]]
kind = "beam"
name = "bar"
length_mm = 200.0
{keys}
compliance = {{ from = "bar.step", youngs_modulus_MPa = 70000, poissons_ratio = 0.33, base = "1", tip = "2"{more} }}

[postures]
home = []
"""


def forms():
    """Of the corners at the root, the middle and the tip."""
    points, rows = [], []
    for x in (0.0, 0.5 * LENGTH, LENGTH):
        for y in (-0.5 * HEIGHT, 0.5 * HEIGHT):
            for z in (-0.5 * WIDTH, 0.5 * WIDTH):
                Iy, Iz, arm = HEIGHT * WIDTH**3 / 12.0, WIDTH * HEIGHT**3 / 12.0, LENGTH - x
                s = np.array([1.0 / AREA, -y * arm / Iz, -z * arm / Iy, 0.0, z / Iy, -y / Iz])
                points.append([x, y, z])
                rows.append(np.outer(s, s)[np.triu_indices(6)].tolist())
    return points, rows


def model(folder, more="", keys="", centre=(90.0, 1.0, 0.0)):
    """A model file with a drawing whose matrix is kept beside it."""
    drawing = folder / "bar.step"
    drawing.write_text("a drawing\n")
    file = folder / "bar.toml"
    file.write_text(MODEL.format(more=more, keys=keys))
    table = SolidTable.model_validate(
        {"from": "bar.step", "youngs_modulus_MPa": E, "poissons_ratio": NU, "base": "1", "tip": "2"}
    )
    made_of = table.made_of(drawing.read_bytes())
    points, rows = forms()
    result = SolidResult(
        drawing="bar.step", compliance=SECTION.compliance(LENGTH).tolist(), reach_mm=[LENGTH, 0.0, 0.0],
        interval=np.zeros((6, 6)).tolist(), unknowns=1, bodies=1,
        buckling_N=float(np.pi**2 * SECTION.EIz / (4.0 * LENGTH**2)),
        volume_mm3=LENGTH * AREA, centre_of_mass_mm=list(centre),
        thickness_mm=6.0, stress_at_mm=points, stress_forms=rows,
    )  # fmt: skip
    made_of.keep(kept_file(drawing, made_of), result.model_dump())
    return file


def test_yield_beside_the_critical_load(tmp_path):
    """A cantilever is squeezed: Euler's load, and the load at which force over area is the yield stress."""
    file = model(tmp_path, f", yield_stress_MPa = {LIMIT}, as_beam = true")
    options = ["--free", "y,z,rx,ry,rz", "--direction", "-", "--to", "1", "--segments", "8"]
    page = tmp_path / "page.html"
    text = " ".join(validate("buckling", file, *options, "--report", page).out.split())
    (row,) = json_of("buckling", file, *options)["yields"]
    euler = np.pi**2 * SECTION.EIz / (4.0 * LENGTH**2)
    assert row["critical_N"] == pytest.approx(euler, rel=0.01)
    assert row["yields_N"] is None
    share = 100.0 * euler / (LIMIT * AREA)
    said = (
        f"the material does not yield: not before: {share:.0f} % of the yield stress is reached at the bifurcation"
    )
    assert said in text
    assert said in " ".join(re.sub(r"<[^>]*>", " ", page.read_text()).split())
    # a softer material yields first
    soft = 0.5 * euler / AREA
    file = model(tmp_path, f", yield_stress_MPa = {soft}, as_beam = true")
    text = " ".join(validate("buckling", file, *options).out.split())
    (ratio,) = re.findall(r"yields first at [\d.e+]+ N, on the way, in bar: ([\d.]+) of the critical", text)
    assert float(ratio) == pytest.approx(0.5, abs=0.01)


def test_one_spring_yields_too(tmp_path):
    file = model(tmp_path, f", yield_stress_MPa = {LIMIT}", "segments = 1")
    options = ["--free", "y,z,rx,ry,rz", "--to", "1", "--direction", "+", "--json"]
    (row,) = json.loads(validate("buckling", file, *options).out)["yields"]
    assert row["yields_N"] == pytest.approx(LIMIT * AREA, rel=1e-2)
    assert row["critical_N"] is None


def test_weight_acts_at_the_centre_of_mass(tmp_path):
    """The same as a payload of that mass, where the part begins."""
    mass = 1e-9 * DENSITY * LENGTH * AREA
    before = """segments = 1

[[parts]]
kind = "beam"
name = "after"
length_mm = 200.0
segments = 1
"""
    link = f"compliance = {json.dumps(SECTION.compliance(LENGTH).tolist())}"
    own = model(tmp_path, f", density_kg_per_m3 = {DENSITY}", link + "\n" + before)
    weight = """segments = 1

[[parts]]
kind = "payload"
name = "weight"
mass_kg = %r
centre_of_mass_mm = [90.0, 1.0, 0.0]

[[parts]]
kind = "beam"
name = "after"
length_mm = 200.0
segments = 1
"""
    (tmp_path / "other").mkdir()
    other = model(tmp_path / "other", "", link + "\n" + weight % mass)
    found = []
    for file in (own, other):
        found.append(
            json_of("stiffness", file, "--gravity", "0,0,-9.81", "--wrench", "0,0,0,0,0,0")["displacement"]
        )
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert abs(found[0][2]) > 1e-3
    assert load_chain(own).beams[-1].mass == pytest.approx(mass)


def test_the_beam_in_its_place_is_the_bar(tmp_path):
    chain = load_chain(model(tmp_path, f", as_beam = true, density_kg_per_m3 = {DENSITY}"))
    (bar,) = chain.beams
    for name in ("EA", "GJ", "EIy", "EIz", "GAy", "GAz"):
        assert getattr(bar.section, name) == pytest.approx(getattr(SECTION, name), rel=1e-9)
    assert bar.mass == pytest.approx(1e-9 * DENSITY * LENGTH * AREA)


def test_what_is_before_the_root_is_rigid(tmp_path):
    """A base of 4 mm that the drawing has and the beam has not."""
    offset = 'name = "bar"\nlength_mm = 200.0'
    file = model(tmp_path, ", as_beam = true, root_mm = [4.0, 0.0, 0.0]")
    file.write_text(file.read_text().replace(offset, 'name = "bar"\nlength_mm = 196.0'))
    (bar,) = load_chain(file).beams
    assert bar.tip == pytest.approx([196.0, 0.0, 0.0])
    assert bar.section.EIz != pytest.approx(SECTION.EIz, rel=1e-3)


@pytest.mark.parametrize(
    ("more", "keys", "words"),
    [
        (", as_beam = true", "segments = 1", "as_beam = true: the part has segments already"),
        (", density_kg_per_m3 = 2.7", "", "is it in g/cm³? Write it in kg/m³"),
        (", density_kg_per_m3 = 2700, as_beam = true", "mass_kg = 1.0", "the part has a mass already"),
        (", yield_stress_MPa = 2.5e8", "", "above a tenth of youngs_modulus_MPa"),
        (", root_mm = [4.0, 0.0, 0.0]", "", "section_axes, end_offset_mm and root_mm put it at [204, 0, 0]"),
    ],
)
def test_bad_keys_of_a_drawing(tmp_path, more, keys, words):
    assert words in refused("check", model(tmp_path, more, keys))


def test_what_is_said_of_a_part_from_a_drawing(tmp_path):
    """One spring does not buckle by itself; what would is said, with its load."""
    said = validate("check", model(tmp_path, "", "segments = 1")).err
    euler = np.pi**2 * SECTION.EIz / (4.0 * LENGTH**2)
    assert f"free at its tip, does at {euler:.3g} N of compression" in said
    # two millimetres of an end offset that the drawing has not: the beam is not like it any more
    file = model(tmp_path, ", as_beam = true", "end_offset_mm = [120.0, 0.0, 0.0]")
    file.write_text(file.read_text().replace("length_mm = 200.0", "length_mm = 80.0"))
    assert "the nearest beam misses" in validate("check", file).err
    validate("check", file, "--strict", status=2)
