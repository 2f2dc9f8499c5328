"""The command line's words for a load case, and what `validate` makes of them."""

import json

import pytest
from helpers.command import validate

from vjm.io.path_files import read_curve
from vjm.model.load_case import Load, LoadCase, PointControl
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
    finished = validate(
        "curve", "pinned-column", "--posture", "straight", "--to", "-20", "--force", "--free", "rx,ry,rz",
        "--load", "link@0.5:0,0.05,0", "--csv", str(file),
    )  # fmt: skip
    assert finished.status == 0, finished.err
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
    finished = validate(*common, "--force", "--free", "rx,ry,rz", "--to", "9000", "--jobs", "2")
    assert finished.status == 0, finished.err
    free = json.loads(finished.out)["chain"]
    locked = json.loads(validate(*common).out)["chain"]
    # locked, B only has a stiffness knee; let go, it buckles, and collapses soon behind
    assert locked["B"]["compression"]["vjm-16"]["critical"] == "stiffness-knee"
    assert free["B"]["compression"]["vjm-16"]["critical"] == "bifurcation"
    assert free["B"]["compression"]["vjm-16"]["F_end"] < 9000.0
    # in A the bar buckles between its own joints, whatever holds the end-effector; events are located to 1e-9
    of_a = [chain["A"]["compression"]["vjm-16"]["F_cr"] for chain in (locked, free)]
    assert of_a[1] == pytest.approx(of_a[0], rel=5e-9)


def test_force_control_needs_a_reach():
    finished = validate("buckling", "orthoglide-chain", "--posture", "A", "--force")
    assert finished.status == 2
    assert "--to: with --force say up to how many N" in finished.err
