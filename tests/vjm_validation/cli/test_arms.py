"""Commands on arms and trees: free ends under weight and loads, and postures in which no stiffness exists."""

import csv
import json

import numpy as np
import pytest
from helpers.command import json_of, refused, validate
from helpers.file_texts import model_text, part_text

from vjm.io.model_file import load_chain
from vjm_validation.compensation import CompensationDocument

C = (1e-8, 2e-8, 4e-8)
L = (300.0, 200.0, 100.0)


@pytest.fixture
def planar(tmp_path):
    """Three hinges about z in a row, the links along x."""
    tables = (
        part_text("actuated", f"j{i}", axis="z", compliance_rad_per_Nmm=C[i])
        + part_text(
            "link", f"l{i}", translation_mm=[L[i], 0.0, 0.0], mass_kg=2.0, centre_of_mass_mm=[0.5 * L[i], 0.0, 0.0]
        )
        for i in range(3)
    )
    file = tmp_path / "planar.toml"
    file.write_text(model_text("planar", *tables, postures={"straight": dict.fromkeys(("j0", "j1", "j2"), 0.0)}))
    return file


def test_a_posture_without_a_stiffness_has_a_compliance(planar):
    """The force on the tip turns each hinge by its own lever; three hinges move it in three directions only."""
    force = 0.5
    found = json_of("stiffness", planar, "--wrench", f"0,{force},0,0,0,0")
    levers = np.array([600.0, 300.0, 100.0])
    # the second order of the turn, 2e-5 rad squared, over some ten
    assert list(found["torques"].values()) == pytest.approx(-force * levers, rel=1e-9)
    assert found["displacement"][1] == pytest.approx(force * float(np.array(C) @ levers**2), rel=1e-9)
    assert found["stiffness_loaded"] is None
    assert found["stiffness_unloaded"] is None
    # linear: rounding only
    assert np.array(found["compliance_unloaded"])[1, 1] == pytest.approx(float(np.array(C) @ levers**2), rel=1e-12)
    # in the straight posture no hinge moves x, which makes four directions with z, rx and ry
    unloaded = np.linalg.matrix_rank(np.array(found["compliance_unloaded"]), tol=1e-14)
    assert unloaded == 2
    straight = json_of("stiffness", planar, "--wrench", "0,0,0,0,0,0")
    assert np.linalg.matrix_rank(np.array(straight["rigid"])) == 4
    # where the load has deflected the arm, its hinges move x too, however little
    assert np.linalg.matrix_rank(np.array(found["rigid"])) == 3


def test_weight_and_a_load_on_a_part_bend_an_arm(planar):
    words = ("--gravity", "0,-9.81,0", "--load", "l1@0.5:0,-20,0", "--json")
    found = json.loads(validate("stiffness", planar, *words).out)
    torques = [9.81 * 2.0 * (150 + 400 + 550) + 20.0 * 400, 9.81 * 2.0 * (100 + 250) + 20.0 * 100, 9.81 * 2.0 * 50]
    # the lever arms shorten by the turn squared, 2e-4 rad
    assert list(found["torques"].values()) == pytest.approx(torques, rel=1e-6)
    assert found["gravity"] == [0.0, -9.81, 0.0]
    assert found["residual"] < 1e-12


def test_every_posture_of_the_ur10_has_an_answer():
    """Its first posture is singular: only the compliance exists there."""
    shown = validate("stiffness", "ur10", "--wrench", "0,0,-100,0,0,0").out
    assert "no 6×6 stiffness where a wrench moves nothing" in shown
    assert "held by" in shown
    assert "not moved by" in validate("stiffness", "ur10", "--posture", "upright").out
    assert "K^F loaded" in validate("stiffness", "ur10", "--posture", "work", "--gravity", "0,0,-9.81").out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("ur10", "--end", "hand"), "ur10 has no end frame 'hand'"),
        (("ur10", "--gravity", "0,9"), "--gravity: '0,9' is not three numbers"),
        (("ur10", "--load", "hand:1,0,0"), "no part 'hand' with points on it"),
        (
            ("orthoglide-chain", "--gravity", "0,0,-9.81", "--engine", "exudyn"),
            "are for a free end and engines vjm",
        ),
    ],
)
def test_what_no_arm_takes_is_refused(words, said):
    result = validate("stiffness", *words, status=2)
    assert said in result.err
    # a chain whose parts have no mass is doubted under gravity before that
    assert len([line for line in result.err.splitlines() if "warning:" not in line]) == 1


def test_weight_and_a_load_change_what_a_bent_arm_bears():
    """The load on a part stays while the force grows, so that the stiffness at the beginning is another."""
    words = (
        "planar-2r",
        "--posture",
        "bent",
        "--force",
        "--to",
        "200",
        "--free",
        "x,y,z,rx,ry,rz",
        "--direction=-",
        "--json",
    )
    plain, loaded = (
        json.loads(validate("buckling", *words, *more).out)["chain"]["bent"]["compression"]["vjm-16"]["K0"]
        for more in ((), ("--gravity", "0,-9.81,0", "--load", "upper@0.5:0,-400,0"))
    )
    # 50 N and 400 N turn the joints by up to a tenth of a radian
    assert 1e-3 < abs(loaded / plain - 1.0) < 0.2


# A user's planar arm of two beams, `upper` and `fore`: every command works, and no part is taken for another.


FREE = "x,y,z,rx,ry,rz"


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """The file, in a folder of its own."""
    from importlib import resources

    text = resources.files("vjm").joinpath("models", "planar-2r.toml").read_text("utf-8")
    file = tmp_path_factory.mktemp("arm") / "mine.toml"
    file.write_text(text.replace('name = "planar-2r"', 'name = "mine"'))
    return file


COMMANDS = [
    "check MODEL", "show MODEL --out DIR/view.html", "postures MODEL --tool 600,300,0",
    "curve MODEL --axis y --to -3 --csv DIR/curve.csv",
    "curve MODEL --axis y --to -1 --engine vjm-paper", "curve MODEL --axis y --to -1 --engine vjm-linear",
    "curve MODEL --axis y --to -1 --engine msa",
    f"curve MODEL --axis load --load 0,-50,0 --to 1 --free {FREE} --gravity 0,-9.81,0 --engine exudyn",
    "buckling MODEL --posture bent --direction - --json",
    f"buckling MODEL --posture bent --force --to 500 --free {FREE} --direction -",
    "stiffness MODEL --segments upper=3,fore=5 --load upper@0.5:0,-9,0", "stiffness MODEL --engine msa",
    "stiffness MODEL --posture bent --displacement 0,-1,0,0,0,0",
    "map MODEL --grid elbow=0.2:2:4 --out DIR/map",
]  # fmt: skip


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("words", COMMANDS)
def test_a_command_takes_it(words, arm, tmp_path):
    command = [word.replace("MODEL", str(arm)).replace("DIR", str(tmp_path)) for word in words.split()]
    validate(*command)


@pytest.mark.slow
@pytest.mark.parametrize("part", ["upper", "fore"])
def test_a_beam_is_identified_by_its_own_name(part, arm):
    found = json_of("identify", arm, "--part", part)
    beam = next(beam for beam in load_chain(arm).beams if beam.name == part)
    # the axial entry is L/EA, whatever the engine's shear
    assert found["compliance"][0][0] == pytest.approx(beam.length / beam.section.EA, rel=1e-6)


def test_no_part_is_taken_for_the_paper_s(arm):
    """Names of the paper's chain are refused, and the two beams are told apart."""
    assert "no beam 'foot' to split; it has fore, upper" in refused(
        "curve", arm, "--axis", "y", "--to", "-1", "--engine", "vjm-16f16"
    )
    tips = []
    for part in ("upper", "fore"):
        tips.append(json_of("stiffness", arm, "--load", f"{part}@1.0:0,-20,0"))
    # 20 N at 500 and 900 mm of the shoulder, 0 and 400 of the elbow; levers shorten by 1 - cos of 0.017 rad, 1.5e-4
    assert [tip["torques"]["shoulder"] for tip in tips] == pytest.approx([1e4, 1.8e4], rel=5e-4)
    assert [tip["torques"]["elbow"] for tip in tips] == pytest.approx([0.0, 8e3], abs=4.0)


# ``validate compensate``: a path of an arm and of a platform, and files that are wrong.


PATH_HEAD = "x_mm,y_mm,z_mm,fx_N,fy_N,fz_N\n"


@pytest.fixture
def square(tmp_path):
    file = tmp_path / "square.csv"
    corners = [(500, 300), (600, 300), (600, 400)]
    file.write_text("# a comment\n" + PATH_HEAD + "".join(f"{x},{y},0,0,-100,0\n" for x, y in corners))
    return file


def test_an_arm_s_path(square, tmp_path):
    out, plot = tmp_path / "out.csv", tmp_path / "out.png"
    words = [
        "compensate",
        "planar-2r",
        str(square),
        "--gravity",
        "0,-9.81,0",
        "--out",
        str(out),
        "--plot",
        str(plot),
        "--report",
        str(tmp_path / "page.html"),
    ]
    document = CompensationDocument.model_validate(json_of(*words))
    assert document.joints == ["shoulder", "elbow"]
    left = document.left
    assert left["loaded"].largest_mm < 1e-6 < left["linear"].largest_mm < 0.1 * left["rigid"].largest_mm
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert len(rows) == document.poses == 3
    assert float(rows[1]["loaded.elbow"]) == pytest.approx(document.commands["loaded"][1][1], abs=1e-11)
    # twelve digits are written
    left_over = np.linalg.norm(document.errors["rigid"][2][:3])
    assert float(rows[2]["rigid.error_mm"]) == pytest.approx(left_over, rel=1e-11)
    assert plot.stat().st_size > 5000
    page = (tmp_path / "page.html").read_text()
    assert "error of the loaded end at 3 poses" in page
    assert f"the rigid {left['rigid'].largest_mm:.3g} mm" in page


def test_a_platform_s_path(tmp_path):
    file = tmp_path / "path.csv"
    file.write_text(PATH_HEAD + "0,0,0,0,0,-500\n20,10,5,300,0,0\n")
    left = json_of("compensate", "orthoglide", file, "--engine", "vjm-paper")["left"]
    assert left["loaded"]["largest_mm"] < 1e-6 < left["linear"]["largest_mm"] < 0.2 * left["rigid"]["largest_mm"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no path; give a line of columns"),
        (PATH_HEAD, "no path; give a line of columns"),
        ("x_mm,y_mm\n1,2\n", ":1: column 'z_mm' is missing"),
        ("x_mm,y_mm,z_mm,rx_rad\n1,2,3,4\n", ":1: column 'ry_rad' is missing"),
        ("x,y_mm,z_mm\n1,2,3\n", ":1: unknown column 'x'"),
        ("x_mm,y_mm,z_mm\n1,2\n", ":2: 2 values for 3 columns"),
        ("x_mm,y_mm,z_mm\n1,2,3\n1,nan,3\n", ":3: y_mm: 'nan' is no finite number"),
        ("x_mm,y_mm,z_mm\n5000,0,0\n", "row 1 of the path: planar-2r: out of reach"),
    ],
)
def test_a_wrong_path_is_refused_in_one_line(text, said, tmp_path):
    file = tmp_path / "path.csv"
    file.write_text(text)
    assert said in refused("compensate", "planar-2r", file, "--out", tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


def test_a_mechanism_is_refused(square):
    assert "its passive joints leave the end a mechanism" in refused("compensate", "orthoglide-chain", square)
