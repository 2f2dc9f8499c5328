"""Model files that are well-formed and wrong: each mistake is named, and no model of the library is doubted."""

import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from vjm.io.findings import Grade, ImplausibleError, refuse
from vjm.io.machine_file import load_model
from vjm.io.manipulator_file import manipulators
from vjm.io.model_file import ModelFileError, library, load_chain
from vjm.io.model_plausibility import findings_of
from vjm.model.mechanism import Mechanism

BEAM = """
format = 1
name = "arm"
title = "an arm"
source = "made up"
[units]
length = "mm"
force = "N"
angle = "rad"
[[parts]]
kind = "actuated"
name = "shoulder"
axis = "z"
compliance_rad_per_Nmm = 1e-8
limits_rad = [-3.1, 3.1]
[[parts]]
kind = "beam"
name = "tube"
length_mm = 400.0
mass_kg = 1.5
end_offset_mm = [20.0, -10.0, 0.0]
# a square tube of aluminium, 60 by 3 mm
[parts.section]
EA_N = 4.788e7
GJ_Nmm2 = 1.48e10
EIy_Nmm2 = 2.6e10
EIz_Nmm2 = 2.6e10
[[parts]]
kind = "link"
name = "wrist"
translation_mm = [0.0, 0.0, 80.0]
mass_kg = 2.0
centre_of_mass_mm = [0.0, 0.0, 40.0]
[[parts]]
kind = "payload"
name = "tool"
mass_kg = 1.0
centre_of_mass_mm = [0.0, 0.0, 50.0]
[postures]
home = { shoulder = 0.3 }
"""


TEMPLATES = Path(__file__).parents[3] / "validation/vjm_validation/cli/templates"


def library_text(name: str) -> str:
    if name.startswith("new "):
        return (TEMPLATES / f"{name[4:]}.toml").read_text(encoding="utf-8").replace('"NAME"', '"machine"')
    return resources.files("vjm").joinpath("models", f"{name}.toml").read_text(encoding="utf-8")


def said_of(text: str, folder) -> list[str]:
    """Grades and findings, or why the file is refused."""
    file = folder / "model.toml"
    file.write_text(text, encoding="utf-8")
    try:
        load_chain(file)
        return [f"{finding.grade}: {finding}" for finding in findings_of(file)]
    except ModelFileError as refused:
        return [f"refused: {refused}"]


def swapped(text: str, a: str, b: str) -> str:
    return text.replace(a, "\0").replace(b, a).replace("\0", b)


def scaled(text: str, factors: dict[str, float]) -> str:
    """Every number behind a key, times a factor."""
    for key, factor in factors.items():
        text = re.sub(rf"(?m)^{key} = (\S+)", lambda m, f=factor, k=key: f"{k} = {float(m[1]) * f!r}", text)
    return text


@pytest.mark.parametrize("name", [entry.name for entry in (*library(), *manipulators())])
def test_no_model_of_the_library_is_doubted(name):
    assert findings_of(name) == []


def test_the_sound_arm_is_not_doubted(tmp_path):
    assert said_of(BEAM, tmp_path) == []


def test_a_length_in_metres_is_doubted_and_a_joint_spring_noted(tmp_path):
    (said,) = said_of(BEAM.replace("length_mm = 400.0\nmass_kg = 1.5\nend_offset_mm = [20.0, -10.0, 0.0]",
                                   "length_mm = 0.4"), tmp_path)  # fmt: skip
    assert said.startswith("noted")
    assert "it is a spring" in said
    (said,) = said_of(BEAM.replace("length_mm = 400.0\nmass_kg = 1.5\nend_offset_mm = [20.0, -10.0, 0.0]",
                                   "length_mm = 20.0"), tmp_path)  # fmt: skip
    assert said.startswith("doubtful")
    assert "is it in metres" in said


def test_a_part_may_be_rigid_in_directions(tmp_path):
    rows = [[0.0] * 6 for _ in range(6)]
    rows[5][5] = 2e-8
    beam = BEAM[BEAM.index('[[parts]]\nkind = "beam"') : BEAM.index('[[parts]]\nkind = "link"')]
    file = tmp_path / "rigid.toml"
    spring = f'[[parts]]\nkind = "beam"\nname = "tube"\nsegments = 1\nlength_mm = 400.0\ncompliance = {rows}\n'
    file.write_text(BEAM.replace(beam, spring), encoding="utf-8")
    chain = load_chain(file)
    model = Mechanism(chain.at("home"))
    k = model.kinematics(model.configuration(np.zeros(0)))
    J = k.jacobian[:, model.elastic]
    # the shoulder's 1e-8 and the tube's 2e-8 rad/(N mm) are all that turns about z
    assert (J @ model.compliance @ J.T)[5, 5] == pytest.approx(3e-8, rel=1e-12)
    assert np.linalg.matrix_rank(model.compliance) == len(model.elastic) == 2


STIFFNESSES = ("EA_N", "GJ_Nmm2", "EIy_Nmm2", "EIz_Nmm2")


@pytest.mark.parametrize("factor", [1e-3, 1e-6])
@pytest.mark.parametrize(
    "keys", [STIFFNESSES, STIFFNESSES[:1], STIFFNESSES[1:2], STIFFNESSES[1:]], ids=lambda keys: "+".join(keys)
)
def test_stiffnesses_in_kilonewtons_or_square_metres(keys, factor, tmp_path):
    found = said_of(scaled(BEAM, dict.fromkeys(keys, factor)), tmp_path)
    assert any("kN" in line or "N m²" in line or "metres" in line or "GJ" in line for line in found), found


MISTAKES = {
    "drive in mm/kN": (
        "orthoglide-chain", 'compliance_mm_per_N = 0.0', "compliance_mm_per_N = 1000.0", "no drive is so soft"
    ),
    "own axes in rad": ("orthoglide-chain", "angle_deg = -90.0", "angle_deg = -1.5708", "-90° in rad"),
    "own axes in rad, three digits": ("orthoglide-chain", "angle_deg = 90.0", "angle_deg = 1.57", "in rad"),
    "foot offset in m": (
        "orthoglide-chain", "end_offset_mm = [17.57, -8.74, 0.0]", "end_offset_mm = [0.01757, -0.00874, 0.0]",
        "metres",
    ),
    "posture in degrees": ("orthoglide-chain", "A = [0.0, 0.0, 0.0, 0.0]", "A = [0.0, 3.0, 0.0, 0.0]", "degrees"),
    "limits in degrees": ("planar-2r", "limits_rad = [-3.0, 3.0]", "limits_rad = [-170.0, 170.0]", "degrees"),
    "whole degrees": (
        "planar-2r", "bent = { shoulder = 0.5, elbow = 1.2 }", "bent = { shoulder = 3.0, elbow = 2.0 }", "degrees"
    ),
    "Poisson": ("planar-2r", "poissons_ratio = 0.33", "poissons_ratio = -0.99", "negative"),
    "foam": ("planar-2r", "poissons_ratio = 0.33", "poissons_ratio = -0.33", "was the sign meant"),
    "shear modulus": ("planar-2r", "poissons_ratio = 0.33", "shear_modulus_MPa = 60000.0", "youngs_modulus"),
    "payload of 10 t": ("planar-2r", "mass_kg = 2.0", "mass_kg = 10000.0", "is it in g"),
    "link in g": ("ur10", "mass_kg = 7.778", "mass_kg = 7778.0", "is it in g"),
    "gear in rad/(N m)": (
        "ur10", "compliance_rad_per_Nmm = 1.1e-08\nsource", "compliance_rad_per_Nmm = 1.1e-05\nsource", "rad/(N m)"
    ),
    "gear in degrees": (
        "planar-2r", "compliance_rad_per_Nmm = 5e-7", "compliance_rad_per_Nmm = 5e-2", "no drive is so soft"
    ),
    "drive as stiffness": (
        "orthoglide-chain", 'compliance_mm_per_N = 0.0', "compliance_mm_per_N = 2e-12", "stiffer than a block"
    ),
}  # fmt: skip


MODULUS, LENGTH, GEAR = (
    "youngs_modulus_MPa = 70000.0", "length_mm = 500.0", "compliance_rad_per_Nmm = 5e-8"
)  # fmt: skip
MISTAKES |= {
    "modulus in GPa": ("new arm", MODULUS, "youngs_modulus_MPa = 70.0", "is it in GPa"),
    "modulus in Pa": ("new arm", MODULUS, "youngs_modulus_MPa = 7e10", "in Pa or GPa"),
    "modulus in ksi": ("new chain", MODULUS, "youngs_modulus_MPa = 10150.0", "ksi"),
    "modulus in kgf/mm²": ("new chain", MODULUS, "youngs_modulus_MPa = 7138.0", "kgf/mm²"),
    "steel's density": (
        "new arm", "density_kg_per_m3 = 2700.0", "density_kg_per_m3 = 7850.0", "the density another material's"
    ),
    "density in g/cm³": ("new arm", "density_kg_per_m3 = 2700.0", "density_kg_per_m3 = 2.7", "g/cm³"),
    "length in m": ("new arm", LENGTH, "length_mm = 0.5", "is it in metres"),
    "length in cm": ("new arm", LENGTH, "length_mm = 50.0", "cm or inches"),
    "column in inches": ("pinned-column", "length_mm = 299.085", "length_mm = 11.775", "cm or inches"),
    "strip in inches": (
        "pinned-column", "width_mm = 25.4              # 1 in\nthickness_mm = 3.175",
        "width_mm = 1.0\nthickness_mm = 0.125", "as of a wire",
    ),
    "tube in cm": (
        "new arm", "diameter_mm = 80.0\nwall_mm = 4.0", "diameter_mm = 8.0\nwall_mm = 0.4", "under the weight"
    ),
    "gear in deg": ("new arm", GEAR, "compliance_rad_per_Nmm = 2.9e-6", "or degrees"),
    "bearing as stiffness": (
        "new arm", "lateral_rad_per_Nmm = [1e-9, 1e-9]", "lateral_rad_per_Nmm = [1e9, 1e9]", "sag"
    ),
    "payload in g": ("new arm", "mass_kg = 5.0", "mass_kg = 5000.0", "is it in g"),
    "base in m": ("new arm", "position_mm = [0.0, 0.0, 0.0]", "position_mm = [0.0, 0.0, 0.8]", "is it in metres"),
    "link in m": ("ur10", "[-612.0, 0.0, 0]", "[-0.612, 0.0, 0.0]", "is it in metres"),
    "centre in 0.1 mm": (
        "new arm", "centre_of_mass_mm = [180.0, 0.0, 0.0]", "centre_of_mass_mm = [1800.0, 0.0, 0.0]", "another unit"
    ),
    "small degrees": (
        "new chain", "bent = { q1 = 0.4, q2 = -0.4 }", "bent = { q1 = 2.0, q2 = -2.0 }", "is it in degrees"
    ),
    "preload": (
        "new chain", "# stiffness_Nmm_per_rad = 1e5\n# preload_Nmm = 2e3", "stiffness_Nmm_per_rad = 100.0\n"
        "preload_Nmm = 2e3", "in N m",
    ),
    "yield stress in GPa": ("pinned-column", "yield_stress_MPa = 241.3", "yield_stress_MPa = 0.2413", "in GPa"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_a_library_model_is_named(name, tmp_path):
    model, old, new, words = MISTAKES[name]
    text = library_text(model)
    assert old in text
    found = said_of(text.replace(old, new, 1), tmp_path)
    assert any(words in line for line in found), found


def test_section_axes_against_the_matrix(tmp_path):
    text = library_text("orthoglide-chain")
    link = text.index('name = "link"')
    found = said_of(text[:link] + swapped(text[link:], "EIy_Nmm2", "EIz_Nmm2"), tmp_path)
    assert any("swapped" in line and "'link'" in line for line in found), found
    foot = text[: text.index('name = "q1"')]
    found = said_of(swapped(foot, "EIy_Nmm2", "EIz_Nmm2") + text[len(foot) :], tmp_path)
    assert any("swapped" in line and "'foot'" in line for line in found), found


@pytest.mark.parametrize("factor", [1.5, 1 / 1.5])
def test_a_matrix_of_another_modulus_than_its_section(factor, tmp_path):
    rows = (factor * compliance_of_link()).tolist()
    (said,) = said_of(with_link_matrix(rows), tmp_path)
    assert said.startswith("doubtful")
    # (20) has 1.06 of what its section gives in one of the four entries, which makes 1.015 of their mean
    told = float(re.search(r"is (\S+) times as compliant in bending", said)[1])
    assert told == pytest.approx(1.015 * factor, rel=2e-3)  # three digits are printed
    assert "modulus" in said


def test_a_matrix_that_differs_in_one_direction_from_its_section(tmp_path):
    matrix = compliance_of_link().copy()
    # bending in one plane only, as if the bar were less deep
    for i, j in ((2, 2), (2, 4), (4, 2), (4, 4)):
        matrix[i, j] *= 2.0
    (said,) = said_of(with_link_matrix(matrix.tolist()), tmp_path)
    assert "(3,3) is 2.1" in said  # (20) has 1.06 of what its section gives there


def compliance_of_link():
    (link,) = (beam for beam in load_chain("orthoglide-chain").beams if beam.name == "link")
    return link.compliance


def with_link_matrix(rows):
    """The paper's chain with another matrix of its link."""
    text = library_text("orthoglide-chain")
    link = text.index('name = "link"')
    start = text.index("compliance = [", link)
    end = text.index("\n]\n", start)
    return f"{text[:start]}compliance = {rows}{text[end + 2 :]}"


def test_a_tube_of_ten_tonnes_is_impossible(tmp_path):
    found = said_of(BEAM.replace("mass_kg = 1.5", "mass_kg = 10000.0"), tmp_path)
    assert found[0].startswith("refused")
    assert "more than any metal" in found[0]
    found = said_of(BEAM.replace("mass_kg = 1.5", "mass_kg = 0.0015"), tmp_path)
    assert any("is it in t" in line for line in found), found


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[20.0, -10.0, 0.0]", "[0.02, -0.01, 0.0]"),
        ("[0.0, 0.0, 80.0]", "[0.0, 0.0, 0.08]"),
        ("[0.0, 0.0, 50.0]", "[0.0, 0.0, 0.05]"),
    ],
)
def test_a_vector_in_metres(old, new, tmp_path):
    found = said_of(BEAM.replace(old, new), tmp_path)
    assert any("is it in metres" in line for line in found), found


def test_a_correction_beside_its_link_is_not_in_metres(tmp_path):
    """As calibrations write the errors of a joint's frame; alone between two joints it is doubted."""
    piece = '[[parts]]\nkind = "link"\nname = "correction"\ntranslation_mm = [0.1, 0.0, -0.04]\n'
    before = BEAM.index('[[parts]]\nkind = "link"')
    assert said_of(BEAM[:before] + piece + BEAM[before:], tmp_path) == []
    first = BEAM.index("[[parts]]")
    (said,) = said_of(BEAM[:first] + piece + BEAM[first:], tmp_path)
    assert "'correction'" in said
    # what a fit leaves of a zero is no length in any unit
    left = piece.replace("0.1,", "4e-9,").replace("-0.04", "0.0")
    assert said_of(BEAM[:first] + left + BEAM[first:], tmp_path) == []


TWELFTH = "translation_mm = [500.0, 0.0, 0.0]\nturns = [{ turn_about = [0.0, 1.0, 0.0], angle_deg = 0.2617994 }]"


@pytest.mark.parametrize(
    ("numbers", "source", "doubted"),
    [
        ("translation_mm = [0.5, 0.0, 0.0]", "a data sheet", True),
        # as `validate calibrate` writes the error of a frame before a joint that stands alone
        ("translation_mm = [0.5, 0.0, 0.0]", "calibrated: errors of the joint's frame and zero", False),
        # nobody gives half a metre to the nanometre
        ("translation_mm = [0.499999999214, 0.0, 0.0]", "a data sheet", False),
        (TWELFTH, "a data sheet", True),
        (TWELFTH, "calibrated: errors of the joint's frame and zero", False),
    ],
)
def test_a_fitted_correction_alone_between_two_joints_is_in_mm_and_degrees(numbers, source, doubted, tmp_path):
    piece = f'[[parts]]\nkind = "link"\nname = "frame"\n{numbers}\nsource = "{source}"\n'
    first = BEAM.index("[[parts]]")
    said = said_of(BEAM[:first] + piece + BEAM[first:], tmp_path)
    assert any("is it in metres" in line or "in rad: give degrees" in line for line in said) is doubted, said


@pytest.mark.parametrize(("after", "doubted"), [("", False), ("wrist", True), ("tool", True)])
def test_a_joint_carries_the_branches_behind_it_alone(after, doubted, tmp_path):
    """A shoulder of 3e-7 rad/(N mm) sags by 0.005 rad under its own arm, by 0.3 rad with 100 kg more."""
    other = (
        f'[[parts]]\nkind = "actuated"\nname = "other"\naxis = "z"\nafter = "{after}"\n'
        '[[parts]]\nkind = "link"\nname = "heavy"\ntranslation_mm = [1000.0, 0.0, 0.0]\nmass_kg = 100.0\n'
        "centre_of_mass_mm = [500.0, 0.0, 0.0]\n"
    )
    text = BEAM.replace("[postures]", other + "[postures]").replace("shoulder = 0.3", "shoulder = 0.3, other = 0.0")
    said = said_of(text.replace("_Nmm = 1e-8", "_Nmm = 3e-7"), tmp_path)
    assert [("'shoulder'" in line, "sag" in line) for line in said] == [(True, True)] * doubted, said


@pytest.mark.parametrize(
    ("posture", "doubted"),
    [
        ("{ q1 = 2.356194490192345, q2 = -0.4 }", False),
        ("{ q1 = 2.36, q2 = -0.41 }", False),
        ("{ q1 = 2.5, q2 = -0.4 }", True),
        ("{ q1 = 3.0, q2 = 1.5 }", True),
    ],
)
def test_a_passive_joint_at_135_degrees_is_no_mistake_and_one_typed_in_degrees_is(posture, doubted, tmp_path):
    text = library_text("new chain").replace("{ q1 = 0.4, q2 = -0.4 }", posture)
    assert any("is it in degrees" in line for line in said_of(text, tmp_path)) is doubted


@pytest.mark.parametrize("stands", [False, True])
def test_only_the_postures_in_which_legs_stand_are_looked_at(stands, tmp_path):
    """A posture more in degrees of the example's strut: doubted where a leg stands in it."""
    example = resources.files("vjm_validation") / "examples/platform"
    straight = "straight = { q1 = 0.0, q2 = 0.0, q3 = 0.0, q4 = 0.0 }"
    strut = (example / "strut.toml").read_text(encoding="utf-8")
    assert straight in strut
    folded = "folded = { q1 = 2.5, q2 = 0.5, q3 = -0.5, q4 = 1.0 }"
    (tmp_path / "strut.toml").write_text(strut.replace(straight, f"{straight}\n{folded}"), encoding="utf-8")
    text = (example / "platform.toml").read_text(encoding="utf-8")
    if stands:
        text = text.replace('posture = "straight"', 'posture = "folded"', 1)
    (tmp_path / "platform.toml").write_text(text, encoding="utf-8")
    said = [str(finding) for finding in findings_of(tmp_path / "platform.toml")]
    assert any("is it in degrees" in line for line in said) is stands, said


def test_strict_refuses_what_is_doubtful(tmp_path):
    file = tmp_path / "model.toml"
    file.write_text(BEAM.replace("[0.0, 0.0, 80.0]", "[0.0, 0.0, 0.08]"))
    findings = findings_of(file)
    assert [finding.grade for finding in findings] == [Grade.DOUBTFUL]
    refuse(findings)
    with pytest.raises(ImplausibleError, match=r"metres.*--strict"):
        refuse(findings, strict=True)


PLATFORM = (
    ("min_mm = [-73.65, -73.65, -73.65]\nmax_mm = [126.35, 126.35, 126.35]",
     "min_mm = [126.35, 126.35, 126.35]\nmax_mm = [-73.65, -73.65, -73.65]", "are they swapped"),
    ("min_mm = [-73.65, -73.65, -73.65]\nmax_mm = [126.35, 126.35, 126.35]",
     "min_mm = [-0.07, -0.07, -0.07]\nmax_mm = [0.12, 0.12, 0.12]", "is it in metres"),
    ("Q1 = [-73.65, -73.65, -73.65]", "Q1 = [-0.07365, -0.07365, -0.07365]", "is it in metres"),
    ("Q1 = [-73.65, -73.65, -73.65]", "Q1 = [0.0, 0.0, 0.0, 30.0, 0.0, 0.0]", "is it in degrees"),
    ("position_mm = [-310.0, 0.0, 0.0]", "position_mm = [-0.31, 0.0, 0.0]", "is it in metres"),
)  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), PLATFORM)
def test_a_mistake_in_a_platform_is_named(old, new, words, tmp_path):
    text = library_text("manipulators/orthoglide")
    assert old in text
    file = tmp_path / "platform.toml"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    try:
        load_model(file)
        said = [str(finding) for finding in findings_of(file)]
    except ModelFileError as refused:
        said = [str(refused)]
    assert any(words in line for line in said), said


def test_struts_that_share_a_weight_are_not_doubted(tmp_path):
    """Each would bend by 0.9 rad if it bore the plate alone and lay on its side; closures hold it upright."""
    section = "{ EA_N = 1e7, GJ_Nmm2 = 1e7, EIy_Nmm2 = 1e7, EIz_Nmm2 = 1e7 }"
    struts = "".join(
        f'[[beams]]\nname = "s{k}"\nbetween = ["ground", "top"]\nfrom_mm = [{x}, {y}, 0.0]\n'
        f'to_mm = [{x}, {y}, 300.0]\ny_axis = "y"\nsection = {section}\n'
        for k, (x, y) in enumerate(((100.0, 0.0), (-50.0, 86.6), (-50.0, -86.6)))
    )
    plate = '[[bodies]]\nname = "top"\nmass_kg = 20.0\ncentre_of_mass_mm = [0.0, 0.0, 300.0]\n'
    head = (
        'format = 1\nkind = "bodies"\nname = "plate"\ntitle = "three struts"\nsource = "a test"\n'
        'units = { length = "mm", force = "N", angle = "rad" }\nend = { body = "top", at_mm = [0.0, 0.0, 300.0] }\n'
    )
    assert said_of(head + plate + struts, tmp_path) == []
