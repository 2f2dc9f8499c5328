"""The command line's words for a load case, and what `validate` makes of them."""

import io
import json
import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from helpers.command import json_of, refused, validate
from helpers.file_texts import model_text, part_text, stiffness_of
from PIL import Image
from scipy.special import ellipe, ellipk

import vjm
from vjm.io.path_files import read_curve
from vjm.model.load_case import Load, LoadCase, PointControl
from vjm_validation.cli.main import joined
from vjm_validation.cli.options import parsed_load_case


def test_a_bare_ramp():
    assert parsed_load_case("A", -4.0) == LoadCase("A", -4.0)


def test_driven_force_frees_its_own_component():
    load_case = parsed_load_case("A", -9000.0, force=True, free="rx, ry,rz")
    assert load_case == LoadCase(
        "A", -9000.0, "load", free=("x", "rx", "ry", "rz"), loads=(Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),)
    )


@pytest.mark.parametrize(("text", "load"), [
    ("0,0,-50", Load((0, 0, -50, 0, 0, 0), ramped=False)),
    ("0,0,-50,1,2,3", Load((0, 0, -50, 1, 2, 3), ramped=False)),
    ("link:0,5,0", Load((0, 5, 0, 0, 0, 0), "link", 1.0, ramped=False)),
    ("link@0.5:0,5,0:follower", Load((0, 5, 0, 0, 0, 0), "link", 0.5, follower=True, ramped=False)),
])  # fmt: skip
def test_loads_beside_a_driven_displacement_act_in_full(text, load):
    assert parsed_load_case("A", 1.0, loads=(text,)).loads == (load,)


def test_loads_are_ramped_by_the_load_factor_unless_constant():
    load_case = parsed_load_case("A", 1.0, axis="load", free="x", loads=("1,0,0", "link:0,5,0:follower:constant"))
    assert [(load.ramped, load.follower) for load in load_case.loads] == [(True, False), (False, True)]


def test_weight_control_and_imperfection():
    load_case = parsed_load_case(
        "A", -1.0, free="rx", gravity="0,0,-9.81", control="link@0.5:0,3,0", imperfection=0.1
    )
    assert load_case.gravity == (0.0, 0.0, -9.81)
    assert load_case.control == PointControl("link", 0.5, (0.0, 1.0, 0.0))
    assert load_case.imperfection == 0.1


@pytest.mark.parametrize(("options", "message"), [
    ({"loads": ("1,2",)}, "--load 1,2: write"),
    ({"loads": ("1,2,z",)}, "'1,2,z' is not three or six numbers"),
    ({"loads": ("a:b:1,2,3",)}, "--load a:b:1,2,3: write"),
    ({"loads": ("link@half:1,2,3",)}, "'half' is no fraction"),
    ({"loads": ("0,0,0",)}, "not all zero"),
    ({"gravity": "0,0"}, "--gravity: '0,0' is not three numbers"),
    ({"control": "length"}, "--control length: write ramp, arc, limit or"),
    ({"control": "link@0.5:1,0"}, "--control: '1,0' is not three numbers"),
    ({"free": "q"}, "free component 'q'"),
    ({"free": "x"}, "driven"),
    ({"axis": "load", "force": True}, "--force: it drives a force along --axis"),
    ({"axis": "load"}, "load"),
])  # fmt: skip
def test_senseless_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        parsed_load_case("A", 1.0, **options)


def test_curve_under_a_driven_force_writes_the_load_factor(tmp_path):
    file = tmp_path / "force.csv"
    validate(
        "curve",
        "pinned-column",
        "--posture",
        "straight",
        "--to",
        "-20",
        "--force",
        "--free",
        "rx,ry,rz",
        "--load",
        "link@0.5:0,0.05,0",
        "--csv",
        file,
    )
    path = read_curve(file)
    assert path.load_case.loads[0] == Load((0, 0.05, 0, 0, 0, 0), "link", 0.5, ramped=False)
    assert path.load_case.load_driven
    assert path.points[-1].ramp == 20.0
    # a dead force is its own factor on the unit load, and nothing is solved for
    assert path.wrench[-1, 0] == pytest.approx(-20.0, rel=1e-14)
    assert file.read_text().splitlines()[1].endswith(",load_factor")


@pytest.mark.slow
def test_buckling_under_force_with_free_rotations():
    common = ("buckling", "orthoglide-chain", "--direction", "-", "--json", "--posture", "A", "--posture", "B")
    free = json.loads(validate(*common, "--force", "--free", "rx,ry,rz", "--to", "9000", "--jobs", "2").out)[
        "chain"
    ]
    locked = json.loads(validate(*common).out)["chain"]
    # locked, B only has a stiffness knee; let go, it buckles, and collapses soon behind
    assert locked["B"]["compression"]["vjm-16"]["critical"] == "stiffness-knee"
    assert free["B"]["compression"]["vjm-16"]["critical"] == "bifurcation"
    assert free["B"]["compression"]["vjm-16"]["F_end"] < 9000.0
    # in A the bar buckles between its own joints, whatever holds the end-effector; events are located to 1e-9
    of_a = [chain["A"]["compression"]["vjm-16"]["F_cr"] for chain in (locked, free)]
    assert of_a[1] == pytest.approx(of_a[0], rel=5e-9)


def test_force_control_needs_a_reach():
    finished = validate("buckling", "orthoglide-chain", "--posture", "A", "--force", status=2)
    assert "--to: with --force say up to how many N" in finished.err


# Where a path leads a joint beyond its limit, the command says at which load and displacement.


LENGTH, LIMIT = 299.085, 0.5
EI = 68948.0 * 25.4 * 3.175**3 / 12.0
EA = 68948.0 * 25.4 * 3.175


@pytest.fixture
def column(tmp_path):
    """The library's pinned bar, its hinges with limits."""
    text = (files("vjm") / "models/pinned-column.toml").read_text("utf-8")
    file = tmp_path / "column.toml"
    file.write_text(text.replace('axis = "z"', f'axis = "z"\nlimits_rad = [{-LIMIT}, {LIMIT}]'))
    return str(file)


def elastica():
    """Force, N, and shortening, mm, of a pinned column whose ends have turned by the limit; with axial strain."""
    m = np.sin(0.5 * LIMIT) ** 2
    force = EI * (2.0 * ellipk(m) / LENGTH) ** 2
    return force, LENGTH * (2.0 - 2.0 * ellipe(m) / ellipk(m)) + force * LENGTH / EA


@pytest.mark.parametrize(
    "words", [["curve", "--to", "-30", "--steps", "60"], ["buckling", "--to", "30", "--direction=-"]]
)
def test_passive_joints_of_a_buckled_column(column, words):
    command, *options = words
    finished = validate(command, column, *options, "--json")
    force, shortening = elastica()
    found = re.findall(
        r"joint '(q\d)' reaches its limit 0.5 rad at a displacement of (\S+) mm and force (\S+) N", finished.err
    )
    assert [name for name, *_ in found] == ["q1", "q2"]
    for _, at, driven in found:
        # 16 springs miss the elastica by π²/(12·16²), and a straight line between points by less
        assert float(at) == pytest.approx(shortening, rel=4e-3)
        assert float(driven) == pytest.approx(force, rel=4e-3)
    assert sum("reaches its limit" in row["found"] for row in json.loads(finished.out)["doubts"]) == 2
    # in strict use it is refused, and a path that ends before says nothing
    validate(command, column, *options, "--strict", status=2)
    short = [option.replace("30", "15") for option in options]
    assert "limit" not in validate(command, column, *short, "--json").err


def test_a_drive_that_yields(tmp_path):
    """A lever of length L on a drive of compliance c turns by θ under F = θ / (c L cos θ)."""
    c, lever, limit = 1e-5, 100.0, 0.1
    file = tmp_path / "lever.toml"
    file.write_text(
        'format = 1\nname = "lever"\ntitle = "a lever"\nsource = "test"\n'
        'units = { length = "mm", force = "N", angle = "rad" }\n'
        '[[parts]]\nkind = "actuated"\nname = "drive"\naxis = "z"\n'
        f"compliance_rad_per_Nmm = {c}\nlimits_rad = [-1.0, {limit}]\n"
        f'[[parts]]\nkind = "link"\nname = "bar"\ntranslation_mm = [{lever}, 0.0, 0.0]\n'
        "[postures]\nhome = { drive = 0.0 }\n"
    )
    words = ["--axis", "load", "--load=0,1,0", "--free", "x,y,z,rx,ry,rz", "--to", "200", "--steps", "50"]
    (force,) = re.findall(
        r"joint 'drive' reaches its limit 0.1 rad at force (\S+) N", validate("curve", file, *words).err
    )
    assert float(force) == pytest.approx(limit / (c * lever * np.cos(limit)), rel=1e-4)


# Shear that a file states, in every engine or in none; and what is said under loads without a potential.


MODEL = model_text(
    "sheared",
    part_text("joint", "q1", axis="z"),
    part_text(
        "beam",
        "link",
        length_mm=100.0,
        section={"EA_N": 1e6, "GJ_Nmm2": 2e6, "EIy_Nmm2": 3e6, "EIz_Nmm2": 1e6, "GAy_N": 2e3, "GAz_N": 2e3},
    ),
    part_text("joint", "q2", axis="z"),
    postures={"straight": [0.0, 0.0]},
)
EULER = np.pi**2 * 1e6 / 100.0**2


@pytest.fixture
def model(tmp_path):
    file = tmp_path / "sheared.toml"
    file.write_text(MODEL)
    return str(file)


def critical(model, engine, *options):
    finished = validate(
        "buckling",
        model,
        "--force",
        "--to",
        "1500",
        "--free",
        "x",
        "--direction",
        "-",
        "--engine",
        engine,
        *options,
        "--json",
    )
    (found,) = json.loads(finished.out)["chain"]["straight"]["compression"].values()
    return found["F_cr"], finished.err


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "apart"), [("vjm-16", 1e-9), ("exudyn", 4e-3)])
def test_shear_that_the_file_states_counts_in_every_engine(model, engine, apart):
    # Reissner's column: P (1 + P/GA − P/EA) = P_E
    flexibility = 1.0 / 2e3 - 1e-6
    sheared = 2.0 * EULER / (1.0 + np.sqrt(1.0 + 4.0 * flexibility * EULER))
    rigid = 2.0 * EULER / (1.0 + np.sqrt(1.0 - 4e-6 * EULER))
    # springs have it exactly; 16 elements miss it by 1.9e-3, by terms of second order in P/GA
    found, words = critical(model, engine)
    assert found == pytest.approx(sheared, rel=apart)
    assert words == ""
    assert critical(model, engine, "--no-shear")[0] == pytest.approx(
        rigid, rel=1e-4 if engine == "exudyn" else 1e-9
    )


@pytest.mark.slow
def test_the_old_option_is_taken_with_a_line(model):
    found, words = critical(model, "vjm-8", "--shear")
    assert found == pytest.approx(critical(model, "vjm-8")[0], rel=1e-12)
    assert words.count("\n") == 1
    assert "--shear" in words


def test_an_engine_without_shear_says_how_to_leave_it_out(model):
    finished = validate("buckling", model, "--engine", "opensees", "--direction", "-", status=2)
    assert "--no-shear" in finished.err


def test_under_a_follower_the_output_says_what_was_not_examined():
    words = ["curve", "pinned-column", "--axis", "load", "--to", "1", "--free", "x", "--load"]
    assert (
        "flutter is not examined: it is examined where the end is free in all six components"
        in validate(*words, "link@0.5:0,5,0:follower").out
    )
    assert "flutter" not in validate(*words, "link@0.5:0,5,0").out


def beck(folder: Path, **of_rod: float) -> Path:
    """M. Beck, ZAMP 3 (1952) 225: a cantilever under a follower at its tip flutters at 20.051 EI / L²."""
    file = folder / "beck.toml"
    rod = part_text("beam", "rod", length_mm=1000.0, **of_rod, section=stiffness_of(1e8, 1e9, 1e9, 1e10))
    file.write_text(model_text("beck", rod, postures={"straight": {}}), encoding="utf-8")
    return file


FREE = ("--axis", "load", "--free", "x,y,z,rx,ry,rz", "--segments", "8")


def test_becks_column_flutters_on_its_path(tmp_path):
    """It has no static loss of stability; its masses say that it flutters at 20.051 kN."""
    file = beck(tmp_path, mass_kg=1.0)
    words = ("curve", str(file), *FREE, "--load", "rod@1:-1000,0,0:follower")
    assert (
        "no static loss of stability; flutter begins between 20 and 20.5"
        in validate(*words, "--to", "22", "--steps", "44").out
    )
    assert "no flutter at the 20 stable points of the path" in validate(*words, "--to", "19", "--steps", "19").out


def test_without_masses_it_is_said_why_flutter_is_not_examined(tmp_path):
    file = beck(tmp_path)
    finished = validate(
        "curve", str(file), *FREE, "--load", "rod@1:-1000,0,0:follower", "--to", "2", "--steps", "2"
    )
    assert "flutter is not examined: beck: no part that moves has a mass" in finished.out


# Postures by coordinates in every command and in Python, axes of buckling, negative values, labels.


BENT = {"shoulder": 0.5, "elbow": 1.2}
"""The posture `bent` of `planar-2r`."""
PATH = "x_mm,y_mm,z_mm,fx_N\n500,400,0,10\n"


@pytest.mark.parametrize("posture", ["0.5,1.2", "elbow=1.2,shoulder=0.5"])
def test_coordinates_are_the_posture_of_that_label(posture):
    words = ("--wrench", "-10,-20,0,0,0,0", "--json")
    by_label, by_numbers = (
        json.loads(validate("stiffness", "planar-2r", "--posture", each, *words).out) for each in ("bent", posture)
    )
    assert by_numbers.pop("posture") == "0.5,1.2"
    assert by_label.pop("posture") == "bent"
    assert by_numbers == by_label


@pytest.mark.parametrize("posture", [BENT, (0.5, 1.2), "0.5,1.2"])
def test_python_takes_them_too(posture):
    arm = vjm.load("planar-2r")
    asked = {"displacement": (0.0, -1.0, 0.0, 0.0, 0.0, 0.0)}
    found, known = (vjm.stiffness(arm, each, **asked) for each in (posture, "bent"))
    assert np.array_equal(found.loaded, known.loaded)
    standing, label = vjm.in_posture(arm, posture)
    paths = [vjm.trace(m, vjm.LoadCase(p, 1.0, "y"), engine="vjm-2") for m, p in ((standing, label), (arm, "bent"))]
    assert paths[0].points[-1].tangent == paths[1].points[-1].tangent
    along = {"directions": ["tension"], "engine": "vjm-2", "axis": "y", "to": 1.0}
    rows = [vjm.buckling(arm, [p], **along).rows()[0] for p in (posture, "bent")]
    assert rows[0]["K0"] == rows[1]["K0"]


@pytest.mark.parametrize("command", ["stiffness", "curve", "buckling", "map", "compensate", "show", "all"])
@pytest.mark.parametrize(
    ("posture", "said"),
    [
        ("0.5,2.7", "elbow = 2.7 exceeds its limit 2.6 by 0.1 rad"),
        ("-3.2,0", "shoulder = -3.2 is below its limit -3 by 0.2 rad"),
        ("30,40", "is it in degrees?"),
        ("0.5", "1 coordinates for 2 joints"),
        ("wrist=1,elbow=1", "no joint 'wrist'"),
        ("elbow=1", "no coordinate for 'shoulder'"),
        ("bend", "no posture 'bend' (it has stretched, bent, folded)"),
    ],
)
def test_every_command_refuses_what_the_joints_cannot(command, posture, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "path.csv").write_text(PATH)
    more = {
        "curve": ["--to", "1"],
        "compensate": [],
        "map": ["--grid", "elbow=0:1:2", "--out", "map"],
        "all": ["--out", "run"],
    }
    first = ["path.csv"] if command == "compensate" else []
    done = validate(command, "planar-2r", *first, "--posture", posture, *more.get(command, []), status=2)
    assert said in done.err
    assert done.err.strip().count("\n") == 0
    assert not (tmp_path / "run").exists()
    assert not (tmp_path / "map").exists()


def test_a_path_beyond_a_limit_and_one_near_the_stretched_arm(tmp_path):
    """Of the second the two exact answers are those of the loaded arm, residual 1e-14."""
    (tmp_path / "limit.csv").write_text("x_mm,y_mm,z_mm\n200,100,0\n")
    done = validate("compensate", "planar-2r", tmp_path / "limit.csv", "--posture", "bent", status=2)
    assert re.search(r"row 1 .*elbow = -?2\.69057 .* by 0\.09057 rad", done.err)
    (tmp_path / "near.csv").write_text("x_mm,y_mm,z_mm,fx_N,fy_N\n899.99,0,0,50,-100\n")
    words = ("--posture", "bent", "--gravity", "0,-9.81,0", "--json", "--out", str(tmp_path / "out.csv"))
    document = json.loads(validate("compensate", "planar-2r", str(tmp_path / "near.csv"), *words).out)
    (q,) = document["commands"]["loaded"]
    # to the digits in which they are known
    assert min(np.abs(np.subtract(q, known)).max() for known in ((0.05305, 0.06047), (0.06192, 0.04026))) < 6e-6
    assert document["left"]["loaded"]["largest_mm"] < 1e-7
    header, row = (line.split(",") for line in (tmp_path / "out.csv").read_text().splitlines())
    shown = float(row[header.index("loaded.error_rad")])
    assert document["left"]["loaded"]["largest_rad"] == pytest.approx(shown, rel=1e-9)
    assert shown > 0.01


def test_buckling_along_an_axis_is_the_curve_along_it():
    asked = ("--posture", "0.5,1.2", "--axis", "y", "--engine", "vjm-2")
    found = json_of("buckling", "planar-2r", "--to", "1", "--direction", "+", *asked)
    curve = json_of("curve", "planar-2r", "--to", "1", *asked)
    assert found["chain"]["0.5,1.2"]["tension"]["vjm-2"]["K0"] == pytest.approx(curve["points"][0]["stiffness"])
    assert "--to: with --axis rz say up to how many" in refused("buckling", "planar-2r", "--axis", "rz")


COLUMN = ("curve", "pinned-column", "--axis", "load", "--free", "x", "--control", "limit", "--engine", "vjm-8")


def test_a_driven_force_is_labelled_in_newtons():
    """As a force of 1 N times its factor, as ten of them, and as `--force` drives it: one critical force."""
    one = validate(*COLUMN, "--load", "-1,0,0", "--to", "3000").out
    force = re.search(r"bifurcation at \S+ mm, force (\S+) N", one)
    assert force
    ten = validate(*COLUMN, "--load", "-10,0,0", "--to", "300").out
    factor = re.search(r"bifurcation at \S+ mm, load factor (\S+) \((\S+) N\)", ten)
    assert factor
    # both are printed to six digits
    assert float(factor[2]) == pytest.approx(float(force[1]), rel=1e-5)
    assert float(factor[1]) == pytest.approx(0.1 * float(force[1]), rel=1e-5)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("identify --base -1,-60,0 --tip 2,0,0", "identify --base=-1,-60,0 --tip 2,0,0"),
        ("curve m --to -4 --json", "curve m --to=-4 --json"),
        ("map m --gravity -.1,0,0", "map m --gravity=-.1,0,0"),
        ("buckling m --posture 0.1,1 -0.1,1", "buckling m --posture 0.1,1 --posture=-0.1,1"),
        ("all m --direction -x --to -1", "all m --direction -x --to=-1"),
        ("simulate m --ramp A:1 A:-2", "simulate m --ramp A:1 A:-2"),
        ("curve m --load=-1,0,0", "curve m --load=-1,0,0"),
    ],
)
def test_values_that_begin_with_a_minus_are_values(words, expected):
    assert joined(words.split()) == expected.split()


@pytest.mark.parametrize("spring", ["", "stiffness_Nmm_per_rad = 1e5"])
def test_limits_of_passive_joints_hold_by_label_and_by_numbers(spring, tmp_path):
    template = tmp_path / "chain.toml"
    validate("new", "chain", str(template))
    free = 'name = "q1"\naxis = "z"\n'
    text = template.read_text().replace(free, f"{free}limits_rad = [-0.5, 0.5]\n{spring}\n")
    said = "out of reach: q1 = 0.6 exceeds its limit 0.5 by 0.1 rad"
    template.write_text(text)
    assert said in refused("stiffness", template, "--posture", "0.6,-0.6")
    template.write_text(text.replace("bent = { q1 = 0.4", "bent = { q1 = 0.6"))
    assert said in refused("stiffness", template, "--posture", "bent")


# ``--plot`` and ``--report``: what they write, and what they refuse.


CALLS = {
    "curve": ["curve", "pinned-column", "--to", "-1"],
    "buckling": ["buckling", "pinned-column", "--direction", "-", "--to", "1"],
    "stiffness": ["stiffness", "orthoglide-chain", "--posture", "A", "--displacement", "0.2,0,0,0,0,0"],
    "identify": ["identify", "--matrix", "foot-19"],
}


# what fits beams to a matrix takes half a minute
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n == "identify" else ()) for n in CALLS]
)
def test_a_command_draws_and_writes_its_page(name, tmp_path):
    plot, page = tmp_path / "plot.png", tmp_path / "page.html"
    out = validate(*CALLS[name], "--plot", plot, "--report", page).out
    pixels = np.asarray(Image.open(io.BytesIO(plot.read_bytes())).convert("L"))
    assert 0.005 < np.mean(pixels < 200)
    text = page.read_text()
    assert "<h1>" in text
    assert "Content-Security-Policy" in text
    assert text.count("<figure") == 1
    assert not re.search(r"(?:src|href)=\"(?!data:|#)", text)
    assert f"figure: {plot}" in out
    assert f"page: {page}" in out


def test_a_path_is_drawn_as_svg(tmp_path):
    plot = tmp_path / "plot.svg"
    validate(*CALLS["curve"], "--plot", plot)
    assert plot.read_text().startswith("<?xml")
    assert "tangent stiffness, N/mm" in plot.read_text()


def test_another_ending_is_refused_before_anything_is_computed(tmp_path):
    plot = tmp_path / "plot.docx"
    assert "write a file that ends in .png or .svg" in refused(*CALLS["curve"], "--plot", plot)
    assert not plot.exists()


def test_a_curve_against_its_axis_says_that_it_prints_magnitudes():
    assert "magnitudes: the ramp goes against its axis" in validate(*CALLS["curve"]).out


def test_a_matrix_has_labels_and_its_asymmetry_a_reason():
    call = ["stiffness", "orthoglide-chain", "--posture", "B", "--displacement", "-3,0,0,0,0,0"]
    out = validate(*call).out
    assert re.search(r"ux +┃ +uy +┃ +uz", out)
    assert "It is not symmetric" in out


def test_a_pdf_without_a_chromium_is_refused_before_anything_is_computed(tmp_path, monkeypatch):
    monkeypatch.setattr("vjm_validation.cli.all.chromium", lambda: "")
    assert "--pdf: no Chromium is installed" in refused("all", "--pdf", "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("stiffness", "planar-2r", "--posture=stretched"),
        ("modes", "planar-2r", "--number=1"),
        ("sensitivity", "planar-2r", "--by=upper.length_mm"),
        ("sweep", "planar-2r", "--vary=tool.mass_kg=1:2:2"),
        ("map", "planar-2r", "--grid=shoulder=0:1:2", "--quantity=deflection"),
    ],
    ids=lambda words: words[0],
)
def test_a_result_says_under_which_loads_it_is(tmp_path, words):
    out = (f"--out={tmp_path / 'map'}",) if words[0] == "map" else ()
    loads = ("--wrench=0,-5,0,0,0,0", "--gravity=0,-9.81,0", "--load=upper@0.5:1,0,0")
    document = json_of(*words, *loads, *out)
    assert document["loads"] == [
        "wrench 0,-5,0,0,0,0 N, N mm on the end",
        "load upper@0.5:1,0,0 N, N mm",
        "weight by 0,-9.81,0 m/s²",
    ]
    assert f"Under {'; '.join(document['loads'])}." in validate(*words, *loads, *out).out
