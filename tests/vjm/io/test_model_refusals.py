"""Every refusal of a model file: one line that names the file, the key and the remedy."""

import copy
import math
import tomllib
from typing import Any

import numpy as np
import pytest
from helpers.file_texts import model_text, part_text, table_text
from pydantic import TypeAdapter, ValidationError

from vjm.io.manipulator_file import machines, manipulators
from vjm.io.model_file import ModelFileError, build_chain, library, load_chain, read_document
from vjm.io.shapes import SHAPES, AnySection
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism

# ruff: noqa: E501 (a message is easier to judge on one line)


ORTHOGLIDE = read_document("orthoglide-chain").content
COLUMN = read_document("pinned-column").content
FOOT, Q1, Q2, LINK = 1, 2, 3, 4


def refusal(original: dict[str, Any], path: str, value: Any) -> str:
    """What is said of a document with one entry changed, added, or (value ...) left out."""
    content = copy.deepcopy(original)
    *parents, last = [int(step) if step.isdigit() else step for step in path.split("/")]
    table: Any = content
    for step in parents:
        table = table[step]
    if value is ...:
        del table[last]
    else:
        table[last] = value
    return refusal_of(content)


def refusal_of(content: dict[str, Any]) -> str:
    """What is said of a document, in one line, behind the file's name."""
    with pytest.raises(ModelFileError) as caught:
        build_chain(content, "m.toml")
    name, text = str(caught.value).split(": ", 1)
    assert name == "m.toml"
    assert "\n" not in text
    return text


def changed(rows: list[list[float]], entries: dict[tuple[int, int], float]) -> list[list[float]]:
    """A matrix with entries changed, 1-based."""
    matrix = copy.deepcopy(rows)
    for (i, j), value in entries.items():
        matrix[i - 1][j - 1] = value
    return matrix


BAR = ORTHOGLIDE["parts"][LINK]["compliance"]
METRES = (np.array(BAR) * np.kron([[1e-3, 1.0], [1.0, 1e3]], np.ones((3, 3)))).tolist()
THREE = changed(np.diag([1e-3] * 3 + [1e-7] * 3).tolist(), {(1, 2): -9e-4, (1, 3): -9e-4, (2, 3): -9e-4,
                (2, 1): -9e-4, (3, 1): -9e-4, (3, 2): -9e-4})  # fmt: skip

REFUSALS = {
    # keys and types
    "unknown key": ("parts/4/lenght_mm", 310.0, "part 'link': unknown key 'lenght_mm'; did you mean 'length_mm'?"),
    "unknown top key": (
        "zzz", 1,
        "unknown key 'zzz'; known are format, name, title, source, units, base, springs, parts, postures, "
        "point_springs, ends, closures, couplings, poses, workspace, calibrated",
    ),
    "unknown unit key": ("units/mass", "kg", "[units]: unknown key 'mass'; known are length, force, angle"),
    "unknown turn key": (
        "parts/4/own_axes/0/angle_rad", 1.0,
        "part 'link': unknown key 'angle_rad' in own_axes entry 1; did you mean 'angle_deg'?",
    ),
    "key below the section": (
        "parts/4/section/compliance", BAR,
        "part 'link': unknown key 'compliance' in section: it belongs to the part, so write it above [parts.section]",
    ),
    "missing": ("parts/4/length_mm", ..., "part 'link': length_mm is missing: add it"),
    "missing in section": ("parts/4/section/EA_N", ..., "part 'link': section.EA_N is missing: add it"),
    "missing top": ("units", ..., "units is missing: add it"),
    "no number": ("parts/4/length_mm", "310", "part 'link': length_mm must be a number, got '310'"),
    "bool": ("parts/4/length_mm", True, "part 'link': length_mm must be a number, got True"),
    "nan": ("parts/4/section/EA_N", math.nan, "part 'link': section.EA_N must be finite, got nan"),
    "inf in matrix": (
        "parts/4/compliance/1/5", math.inf, "part 'link': compliance (2,6) must be finite, got inf",
    ),
    "nan in axis": ("parts/2/axis", [math.nan, 0.0, 1.0],
        "part 'q1': axis must be 'x', 'y', 'z' or a unit vector [x, y, z], got [nan, 0.0, 1.0]"),
    "nan in posture": ("postures/A/1", math.nan, "posture 'A': entry 2 must be finite, got nan"),
    "negative stiffness": ("parts/4/section/EA_N", -1.0, "part 'link': section.EA_N must be at least 1e-3, got -1"),
    # what an extended model says
    "bow in metres": (
        "parts/4/bow_mm", [70.0, 0.0],
        "part 'link': has bow_mm = [70.0, 0.0], above a fifth of length_mm = 310: give mm",
    ),
    "bow of three": ("parts/4/bow_mm", [1.0, 0.0, 0.0], "part 'link': bow_mm must have at most 2 entries, got 3"),
    "bow without section": (
        "parts/4", {k: v for k, v in ORTHOGLIDE["parts"][LINK].items() if k != "section"} | {"bow_mm": [1.0, 0.0]},
        "part 'link': has bow_mm but no [parts.section]: it is spread along a section",
    ),
    "negative mass": ("parts/4/mass_kg", -1.0, "part 'link': mass_kg must be at least 0, got -1"),
    "no springs": ("springs", {"link_segments": 0}, "[springs]: link_segments must be at least 1, got 0"),
    "half a spring": ("springs", {"link_segments": 1.5}, "[springs]: link_segments must be a whole number, got 1.5"),
    "springs of a link": ("springs", {"segments": 4}, "[springs]: unknown key 'segments'; did you mean 'link_segments'?"),
    "soft mount": (
        "parts/0", {"kind": "mount", "name": "frame", "axis": "x"},
        "part 'frame': has no compliance: give compliance_mm_per_N, or compliance_rad_per_Nmm if it turns about its axis",
    ),
    "mount that slides and turns": (
        "parts/0",
        {"kind": "mount", "name": "frame", "axis": "x", "compliance_mm_per_N": 1e-5, "compliance_rad_per_Nmm": 1e-9},
        "part 'frame': slides and turns: give compliance_mm_per_N, or compliance_rad_per_Nmm if it turns about its axis",
    ),
    "format": ("format", 2, "format must be 1, got 2: this release reads no other"),
    "kind": (
        "parts/2/kind", "hinge",
        "part 'q1': kind must be one of 'offset', 'link', 'payload', 'actuator', 'mount', 'beam', 'joint', "
        "'actuated', 'coupled', got 'hinge'",
    ),
    "no kind": ("parts/2/kind", ..., "part 'q1': kind is missing: add it"),
    "part name": (
        "parts/2/name", "q 1",
        "part 'q 1': name must start with a letter and go on with letters, digits, '_' or '-', got 'q 1'",
    ),
    "nameless part": ("parts/2/name", ..., "part 3: name is missing: add it"),
    "short vector": (
        "parts/1/end_offset_mm", [1.0, 2.0], "part 'foot': end_offset_mm must have at least 3 entries, got 2",
    ),
    "long limits": (
        "parts/2/limits_rad", [0.0, 1.0, 2.0], "part 'q1': limits_rad must have at most 2 entries, got 3",
    ),
    "section no table": ("parts/4/section", "rectangle", "part 'link': section must be a table, got 'rectangle'"),
    "count": ("parts/4/count", 0, "part 'link': count must be at least 1, got 0"),
    "count no integer": ("parts/4/count", 1.5, "part 'link': count must be a whole number, got 1.5"),
    "angle": ("parts/4/own_axes/0/angle_deg", 720.0,
        "part 'link': own_axes entry 1.angle_deg must be at most 360, got 720"),
    "parts no list": ("parts", {}, "parts must be a list [...], got {}"),
    "title": ("title", 3, "title must be a text in quotes, got 3"),
    "empty title": ("title", "", "title must not be empty"),
    # units
    "metres": ("units/length", "m", "[units]: length must be 'mm', got 'm': convert the numbers"),
    "degrees": ("units/angle", "deg", "[units]: angle must be 'rad', got 'deg': convert the numbers"),
    "newtons": ("units/force", "kN", "[units]: force must be 'N', got 'kN': convert the numbers"),
    "short length": ("parts/4/length_mm", 0.031,
        "part 'link': length_mm = 0.031 is below 0.1 mm: is it in metres? Write it in mm"),
    "negative length": ("parts/4/length_mm", -310.0, "part 'link': length_mm must be above 0, got -310"),
    "long length": ("parts/4/length_mm", 310000.0,
        "part 'link': length_mm = 310000 is above 100000 mm: is it in µm? Write it in mm"),
    "far base": ("base/position_mm", [2e5, 0.0, 0.0],
        "[base]: position_mm = [200000.0, 0.0, 0.0] goes beyond 100000 mm: write it in mm"),
    "EI in N m2": ("parts/4/section/EIz_Nmm2", 43.1,
        "part 'link': section has a radius of gyration √(EIz/EA) of 2.53e-3 mm, less than 1/20000 of "
        "length_mm = 310: is EI in N m²? Give mm, N and N mm²"),
    "GJ": ("parts/4/section/GJ_Nmm2", 1.07e13,
        "part 'link': section has GJ = 1.07e13, 43000 times EIy + EIz, where an isotropic beam has at most "
        "half of it: is the unit right? Give N mm²"),
    "compliance against section": ("parts/4/section/EIz_Nmm2", 4.31e5,
        "part 'link': compliance (2,2) = 0.23 but the section gives 23.0402, so it is 0.01 times beam theory: "
        "is the unit right (mm/N, 1/N and rad/(N mm))?"),
    "compliance in metres": ("parts/4/compliance", METRES,
        "part 'link': compliance sums to 2.81e-4 over its first three diagonal entries, but its rotations over "
        "310 mm make 3620: is it in metres? Give mm/N, 1/N and rad/(N mm)"),
    "compliance turned": ("parts/4/compliance", changed(BAR, {(2, 6): -11e-4, (6, 2): -11e-4}),
        "part 'link': compliance (2,6) = -1.1e-3 but the section gives 1.116e-3, of the other sign: "
        "do both use the part's own axes?"),
    # the compliance matrix
    "five rows": ("parts/4/compliance", BAR[:5], "part 'link': compliance must be 6×6, got 5 rows"),
    "short row": ("parts/4/compliance", [*BAR[:2], BAR[2][:5], *BAR[3:]],
        "part 'link': compliance must be 6×6, but row 3 has 5 entries"),
    "no matrix": ("parts/4/compliance", 3.0, "part 'link': compliance must be a list [...], got 3.0"),
    "misprint of (20)": ("parts/4/compliance", changed(BAR, {(2, 6): 11e-5}),
        "part 'link': compliance is not symmetric: (2,6) = 1.1e-4 but (6,2) = 1.1e-3; make them equal"),
    "negative diagonal": ("parts/4/compliance", changed(BAR, {(3, 3): -51e-3}),
        "part 'link': compliance has (3,3) = -0.051 on its diagonal: it must be above 0, as a load moves its "
        "point its own way"),
    "indefinite pair": ("parts/4/compliance", changed(BAR, {(2, 6): 2e-3, (6, 2): 2e-3}),
        "part 'link': compliance is not positive definite: its smallest eigenvalue, scaled to a unit diagonal, "
        "is -0.554; (2,6) = 2e-3 must stay below 1.28686e-3 in size, √((2,2)·(6,6))"),
    "indefinite three": ("parts/4/compliance", THREE,
        "part 'link': compliance is not positive definite: its smallest eigenvalue, scaled to a unit diagonal, "
        "is -0.8; check the entries among rows 1, 2, 3"),
    # parts
    "no stiffness": ("parts/4", {k: v for k, v in ORTHOGLIDE["parts"][LINK].items()
        if k not in ("section", "compliance")},
        "part 'link': needs a [parts.section], a compliance, or both"),
    "duplicate": ("parts/2/name", "q2", "part name 'q2' stands twice, as parts 3 and 4: rename one"),
    "no beam": ("parts", [ORTHOGLIDE["parts"][Q1]],
        "nothing deflects: no part has kind = 'beam', no joint a compliance, and no spring holds a point; add one"),
    "no parts": ("parts", [], "parts must have at least 1 entry, got 0"),
    "actuator": ("parts/0/compliance_mm_per_N", -1e-6,
        "part 'actuator': compliance_mm_per_N must be at least 0, got -1e-6"),
    "axis name": ("parts/2/axis", "w", "part 'q1': axis must be 'x', 'y', 'z' or a unit vector [x, y, z], got 'w'"),
    "axis zero": ("parts/2/axis", [0, 0, 0],
        "part 'q1': axis = [0, 0, 0] gives no direction: write 'x', 'y', 'z' or a unit vector"),
    "axis not unit": ("parts/2/axis", [1.0, 1.0, 0.0],
        "part 'q1': axis = [1.0, 1.0, 0.0] has length 1.41421: write the unit vector [0.7071068, 0.7071068, 0]"),
    # postures
    "no postures": ("postures", {}, "postures must have at least 1 entry, got 0"),
    "posture label": ("postures/A B", [0.0] * 4,
        "posture 'A B': its label must start with a letter and go on with letters, digits, '_' or '-', got 'A B'"),
    "coordinates": ("postures/A", [0.0] * 3, "posture 'A': 3 coordinates for 4 passive joints (q1, q2, q3, q4): give one each"),
    "beyond pi": ("postures/B/1", 30.0, "posture 'B': q2 = 30 rad is beyond ±π: is it in degrees?"),
    "limits": ("parts/2/limits_rad", [1.0, -1.0], "part 'q1': limits_rad = [1.0, -1.0] must be [lower, upper]"),
    "above limit": ("parts/3/limits_rad", [-0.5, 0.5],
        "posture 'B': out of reach: q2 = 0.523599 exceeds its limit 0.5 by 0.0236 rad"),
    "below limit": ("parts/5/limits_rad", [-0.5, 0.5],
        "posture 'B': out of reach: q3 = -0.523599 is below its limit -0.5 by 0.0236 rad"),
    "same line": ("parts/2/axis", "z",
        "posture 'A': joints q1 and q2 turn about the same line: the chain folds; change the posture or leave "
        "one joint out"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSALS)
def test_refusal(name):
    path, value, expected = REFUSALS[name]
    assert refusal(ORTHOGLIDE, path, value) == expected


def test_every_shape_is_read_by_its_name():
    section = TypeAdapter(AnySection)
    for name, table in SHAPES.items():
        # of what every shape has all is there: only its own lengths are missing, so that the name was known
        with pytest.raises(ValidationError) as caught:
            section.validate_python({"shape": name, "youngs_modulus_MPa": 7e4, "poissons_ratio": 0.3})
        missing = {error["loc"] for error in caught.value.errors()}
        own = {key for key, field in table.model_fields.items() if field.is_required()}
        assert missing == {(name, key) for key in own - {"shape", "youngs_modulus_MPa"}}


SHAPE_REFUSALS = {
    "shape": ("shape", "circle",
        "part 'link': section has an unknown shape: write 'rectangle', 'square_tube', 'rectangular_tube', 'round_bar', 'round_tube', 'i_beam' or 'polygon', or no shape but EA_N, "
        "GJ_Nmm2, EIy_Nmm2 and EIz_Nmm2"),
    "width in metres": ("width_mm", 0.0254,
        "part 'link': section.width_mm = 0.0254 is below 0.1 mm: is it in metres? Write it in mm"),
    "modulus in Pa": ("youngs_modulus_MPa", 6.8948e10,
        "part 'link': section.youngs_modulus_MPa = 6.8948e10 is outside 0.1 to 2e6 MPa: is it in Pa or GPa? "
        "Write it in MPa (steel 2.1e5)"),
    "modulus in GPa": ("youngs_modulus_MPa", 68.948,
        "part 'link': section has yield_stress_MPa = 241.3, above a tenth of youngs_modulus_MPa = 68.948: "
        "is one of them in another unit? Write both in MPa"),
    "density": ("density_kg_per_m3", 2.7,
        "part 'link': section.density_kg_per_m3 = 2.7 is outside 10 to 25000 kg/m³: is it in g/cm³? "
        "Write it in kg/m³ (steel 7850)"),
    "two moduli": ("shear_modulus_MPa", 26000.0,
        "part 'link': section needs either poissons_ratio or shear_modulus_MPa, and not both"),
    "no shear": ("poissons_ratio", ...,
        "part 'link': section needs either poissons_ratio or shear_modulus_MPa, and not both"),
    "poisson": ("poissons_ratio", 0.6, "part 'link': section.poissons_ratio must be at most 0.5, got 0.6"),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPE_REFUSALS)
def test_shape_refusal(name):
    key, value, expected = SHAPE_REFUSALS[name]
    assert refusal(COLUMN, f"parts/1/section/{key}", value) == expected


def test_tube_without_hole():
    section = {k: v for k, v in COLUMN["parts"][1]["section"].items() if k != "thickness_mm"}
    section |= {"shape": "square_tube", "width_mm": 6.35, "wall_mm": 3.175}
    assert refusal(COLUMN, "parts/1/section", section) == (
        "part 'link': section has wall_mm = 3.175, which leaves no hole in width_mm = 6.35: "
        "give a thinner wall, or shape = 'rectangle'"
    )


def test_more_errors_are_counted():
    content = copy.deepcopy(ORTHOGLIDE)
    del content["title"]
    del content["source"]
    content["parts"][LINK]["lenght_mm"] = content["parts"][LINK].pop("length_mm")
    assert refusal_of(content) == "part 'link': unknown key 'lenght_mm'; did you mean 'length_mm'? (and 3 more)"


def planar(postures: dict[str, list[float]], *lengths: float) -> dict[str, Any]:
    """Joints about z, each followed by a beam along x."""
    parts: list[dict[str, Any]] = []
    for i, length in enumerate(lengths, 1):
        parts += [
            {"kind": "joint", "name": f"q{i}", "axis": "z"},
            {"kind": "beam", "name": f"beam{i}", "length_mm": length,
             "section": {"EA_N": 1e7, "GJ_Nmm2": 1e8, "EIy_Nmm2": 1e8, "EIz_Nmm2": 1e8}},
        ]  # fmt: skip
    units = {"length": "mm", "force": "N", "angle": "rad"}
    head = {"format": 1, "name": "planar", "title": "t", "source": "s", "units": units}
    return {**head, "parts": parts, "postures": postures}


SNAPS = (
    "can turn together with the tool held: the chain is not determined; change the posture or leave one joint out"
)


@pytest.mark.parametrize(
    ("posture", "lengths", "says"),
    [
        # q3 lands on q1's line where q2 folds the second of two equal links back on the first
        ([0.0, math.pi, 0.0], [200.0] * 3,
         "joints q1 and q3 turn about the same line: the chain folds; change the posture or leave one joint out"),
        # three parallel hinges in one plane: the middle one can snap through with the tool held
        ([0.0, 0.0, 0.0], [200.0, 300.0, 200.0], f"joints q1, q2, q3 {SNAPS}"),
        # more joints than the tool has freedoms
        ([0.3] * 7, [100.0] * 7, f"joints q1, q2, q3, q4, q5, q6, q7 {SNAPS}"),
    ],
)  # fmt: skip
def test_a_posture_that_leaves_a_motion_is_refused(posture, lengths, says):
    open_posture = {"open": [0.0, 1.0, 0.0]} if len(lengths) == 3 else {}
    assert refusal_of(planar({**open_posture, "S": posture}, *lengths)) == f"posture 'S': {says}"


# --- files --------------------------------------------------------------------------------------------------


def said_of(path: Any) -> str:
    with pytest.raises(ModelFileError) as caught:
        load_chain(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_file_that_is_no_model(tmp_path):
    file = tmp_path / "m.toml"
    file.write_text("format = 1\nname \n")
    assert said_of(file).startswith("m.toml: not valid TOML: ")
    assert "line 2" in said_of(file)
    file.write_text("a = 1\na = 2\n")
    assert said_of(file).startswith("m.toml: not valid TOML: Cannot overwrite a value")
    file.write_text(" \n")
    assert said_of(file) == "m.toml: the file is empty; start from the library's orthoglide-chain.toml"
    file.write_bytes("format = 1\ntitle = 'é'".encode("latin-1"))
    assert said_of(file) == "m.toml: not UTF-8 text (line 2); save it as UTF-8"


def test_missing_file_and_directory(tmp_path):
    names = [*library(), *manipulators(), *machines()]
    known = ", ".join(entry.name for entry in names)
    assert {"orthoglide-chain", "ur10", "orthoglide", "hexapod"} <= {entry.name for entry in names}
    missing = tmp_path / "none.toml"
    assert said_of(missing) == f"{missing}: no such file; give a path to a TOML file or one of {known}"
    assert said_of(str(missing)) == said_of(missing)
    assert said_of(tmp_path) == f"{tmp_path}: is a directory; give the model file in it"


def test_unknown_library_name():
    said = said_of("orthoglid-chain")
    assert said.startswith(
        "no model 'orthoglid-chain' in the library, which has compensated-arm, orthoglide-chain, pinned-column"
    )
    assert said.endswith("; did you mean 'orthoglide-chain'?")
    assert "did you mean" not in said_of("quadruped")


def test_a_path_works_wherever_a_name_does(tmp_path):
    text = (
        'format = 1\nname = "cantilever"\ntitle = "t"\nsource = "s"\n'
        'units = { length = "mm", force = "N", angle = "rad" }\n'
        '[[parts]]\nkind = "beam"\nname = "beam"\nlength_mm = 100\n'
        "section = { EA_N = 1e7, GJ_Nmm2 = 1e8, EIy_Nmm2 = 1e8, EIz_Nmm2 = 2e8 }\n"
        "[postures]\nonly = []\n"
    )
    file = tmp_path / "mine.toml"
    file.write_bytes(b"\xef\xbb\xbf" + text.encode())  # some editors put a byte order mark first
    chain = load_chain(str(file))
    assert chain.name == "cantilever"
    assert chain.beams[0].tip_compliance()[1, 1] == pytest.approx(100.0**3 / (3 * 2e8))
    assert chain.posture("only").shape == (0,)


# Model files of arms and trees: what they say, and what is refused in one line.


TEXT = model_text(
    "torso",
    part_text(
        "actuated",
        "tilt",
        axis="y",
        compliance_rad_per_Nmm=1e-8,
        lateral_rad_per_Nmm=[2e-9, 0.0],
        limits_rad=[-2.0, 2.0],
    ),
    part_text("link", "spine", translation_mm=[0.0, 0.0, 300.0], mass_kg=5.0, centre_of_mass_mm=[0.0, 10.0, 150.0]),
    part_text("coupled", "chest", axis="y", to={"tilt": -1.0}),
    part_text("actuated", "left", axis="x", motion="slides", compliance_mm_per_N=1e-4),
    part_text("link", "left-arm", translation_mm=[0.0, 200.0, 0.0]),
    part_text("payload", "cup", mass_kg=1.0, centre_of_mass_mm=[0.0, 0.0, 50.0]),
    part_text("joint", "right", axis="x", after="chest", stiffness_Nmm_per_rad=5e5, preload_Nmm=1e3),
    part_text(
        "link", "right-arm", translation_mm=[0.0, -200.0, 0.0], mass_kg=2.0, centre_of_mass_mm=[0.0, -100.0, 0.0]
    ),
    table_text(
        "[point_springs]",
        name="balance",
        between=["", "spine"],
        points_mm=[[0.0, 0.0, -100.0], [0.0, 0.0, 100.0]],
        stiffness_N_per_mm=2.0,
        free_length_mm=50.0,
    ),
    table_text("ends", **{"left-hand": "left-arm", "right-hand": "right-arm"}),
    postures={"home": {"tilt": 0.5, "left": 20.0, "right": 0.0}, "row": [0.5, 20.0, 0.0]},
)
CONTENT = tomllib.loads(TEXT)


def test_a_file_of_a_tree_is_the_machine_that_it_says():
    chain = build_chain(CONTENT, "m.toml")
    tilt, chest, right = (next(part for part in chain.parts if part.name == n) for n in ("tilt", "chest", "right"))
    assert [joint.kind for joint in (tilt, chest, right)] == ["actuated", "coupled", "sprung"]
    assert (tilt.compliance, tilt.lateral, tilt.limits) == (1e-8, (2e-9, 0.0), (-2.0, 2.0))
    assert chest.coupling.as_deflected
    assert right.preload == 1e3
    model = Mechanism(chain.split())
    assert model.joints == ("tilt", "left", "right")
    assert model.ends == ("left-hand", "right-hand")
    assert model.posture("home") == pytest.approx(model.posture("row"))
    found = equilibria(model, model.posture("home"), gravity=(0.0, 0.0, -9.81))
    assert found.converged.all()
    # 8 kg and a spring of some 300 N tilt the torso by thousandths
    assert 1e-4 < np.abs(found.x).max() < 1.0


TREE_REFUSALS = {
    "axis of length zero": ("parts/0/axis", [0.0, 0.0, 0.0], "axis = [0.0, 0.0, 0.0] gives no direction"),
    "coupling to itself": ("parts/2/to", {"chest": 1.0}, "part 'chest': is coupled to itself: name another joint"),
    "coupling to nothing": ("parts/2/to", {"tlit": 1.0}, "joint 'chest' is coupled to 'tlit', which is no"),
    "mass without centre": ("parts/1/centre_of_mass_mm", ..., "part 'spine': has mass_kg but no centre_of_mass_mm"),
    "a parent behind it": ("parts/1/after", "right-arm", "part 'spine' begins after 'right-arm', which is no part"),
    "unknown spring key": ("point_springs/0/stifness", 1.0, "unknown key 'stifness'"),
    "spring of no part": ("point_springs/0/between", ["", "nobody"], "spring 'balance' is fixed to 'nobody'"),
    "end of no part": ("ends/left-hand", "nobody", "end frame 'left-hand' lies behind 'nobody', which is no part"),
    "missing coordinate": ("postures/home", {"tilt": 0.5, "left": 1.0}, "no coordinate for the joint 'right'"),
    "unknown coordinate": (
        "postures/home", {"tilt": 0.5, "left": 1.0, "right": 0.0, "chest": 0.1}, "no joint 'chest' to be given",
    ),
    "degrees": ("postures/home/tilt", 30.0, "tilt = 30 rad is beyond ±2π: is it in degrees?"),
    "beyond its limit": ("postures/home/tilt", 2.5, "out of reach: tilt = 2.5 exceeds its limit 2"),
    "too few": ("postures/row", [0.5, 20.0], "2 coordinates for 3 joints (tilt, left, right): give one each"),
    "compliance of the other motion": (
        "parts/0/compliance_mm_per_N", 1e-4,
        "part 'tilt': has compliance_mm_per_N, but it turns: give compliance_rad_per_Nmm",
    ),
    "preload without spring": ("parts/6/stiffness_Nmm_per_rad", 0.0, "has a preload or a rest position"),
    "two compliances": (
        "parts/0/compliance", np.eye(6).tolist(), "part 'tilt': has a 6×6 compliance and another one: give one",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("path", "value", "says"), TREE_REFUSALS.values(), ids=TREE_REFUSALS)
def test_refusal_of_a_tree(path, value, says):
    assert says in refusal(CONTENT, path, value)


def test_a_rigid_arm_is_refused():
    content = copy.deepcopy(CONTENT)
    content["parts"] = [{"kind": "actuated", "name": "q", "axis": "z"}]
    content |= {"postures": {"home": [0.0]}, "ends": {}, "point_springs": []}
    with pytest.raises(ModelFileError, match="nothing deflects"):
        build_chain(content, "m.toml")


def test_sixty_joints_are_one_machine():
    content = copy.deepcopy(CONTENT)
    joint = {"kind": "actuated", "axis": "y", "compliance_rad_per_Nmm": 1e-9}
    link = {
        "kind": "link",
        "translation_mm": [20.0, 0.0, 0.0],
        "mass_kg": 0.1,
        "centre_of_mass_mm": [10.0, 0.0, 0.0],
    }
    content["parts"] = [part for i in range(60) for part in ({**joint, "name": f"q{i}"}, {**link, "name": f"l{i}"})]
    content |= {"postures": {"home": [0.01] * 60}, "ends": {}, "point_springs": []}
    model = Mechanism(build_chain(content, "m.toml").split())
    assert equilibria(model, model.posture("home"), gravity=(0.0, 0.0, -9.81)).converged.all()


MATERIAL = {"youngs_modulus_MPa": 1000.0, "poissons_ratio": 0.0}


@pytest.mark.parametrize(
    ("shape", "A", "J", "Iy", "Iz"),
    [
        # π d²/4, π d⁴/32, π d⁴/64
        ({"shape": "round_bar", "diameter_mm": 20.0}, 314.159265, 15707.9633, 7853.98163, 7853.98163),
        ({"shape": "round_tube", "diameter_mm": 20.0, "wall_mm": 5.0}, 235.619449, 14726.2156, 7363.108, 7363.108),
        # IPE 200 without its fillets: A 2726, Iz 1.846e7, Iy 1.419e6 by hand; J by sectionproperties
        (
            {"shape": "i_beam", "width_mm": 100.0, "height_mm": 200.0, "flange_mm": 8.5, "web_mm": 5.6},
            2724.8, 50645.4, 1.4193e6, 1.8458e7,
        ),
        # 60 by 40 by 4 with sharp corners; J by sectionproperties
        (
            {"shape": "rectangular_tube", "width_mm": 60.0, "thickness_mm": 40.0, "wall_mm": 4.0},
            736.0, 369066.0, 345045.33, 178005.33,
        ),
    ],
)  # fmt: skip
def test_sections_have_the_handbooks_values(shape, A, J, Iy, Iz):
    content = copy.deepcopy(CONTENT)
    content["parts"] = [{"kind": "beam", "name": "b", "length_mm": 500.0, "section": {**shape, **MATERIAL}}]
    content |= {"postures": {"home": []}, "ends": {}, "point_springs": []}
    section = build_chain(content, "m.toml").beams[0].section
    # E = 1000, G = 500; the handbook's digits
    found = (section.EA / 1000, section.GJ / 500, section.EIy / 1000, section.EIz / 1000)
    assert found == pytest.approx((A, J, Iy, Iz), rel=2e-3)
