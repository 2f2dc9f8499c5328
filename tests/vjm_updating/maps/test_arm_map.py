"""Maps of arms: against equilibria one by one and a closed form, and what is out of reach."""

import csv
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from helpers.command import json_of, refused, validate
from helpers.file_texts import model_text, part_text
from helpers.maps import mapped

import vjm
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.machine.critical_force import CriticalForce
from vjm.machine.equilibria import equilibria
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, JointCoupling, RigidOffset
from vjm.rotations import AXES, translation
from vjm_updating.maps.evaluate import MapQuantity
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.output import write_map
from vjm_validation.schemas import schemas

C, L = 1e-8, 400.0


def two_links() -> Machine:
    """Two rigid links of 400 mm on gears about z."""
    parts = [
        part
        for i in range(2)
        for part in (Joint(f"j{i}", AXES["z"], compliance=C), RigidOffset(f"l{i}", translation([L, 0.0, 0.0])))
    ]
    return Machine("two", tuple(parts), postures={"bent": np.zeros(0)}, held={"bent": {"j0": 0.0, "j1": 1.0}})


def test_a_stiffness_over_a_joint_is_the_closed_form():
    found = mapped(two_links(), VjmEngine(), MapQuantity.STIFFNESS, "j1=0.2:2.8:14", "bent")
    assert found.map.points.q[:, 1] == pytest.approx(np.linspace(0.2, 2.8, 14))
    for q, row in zip(found.map.points.q[:, 1], found.values, strict=True):
        far = np.array([[-L * np.sin(q), L + L * np.cos(q)], [-L * np.sin(q), L * np.cos(q)]])
        compliance = C * far.T @ far
        # what lies out of the plane is rigid, so that the largest stiffness is infinite
        assert row[0] == pytest.approx(1.0 / np.linalg.eigvalsh(compliance)[1], rel=1e-9)
        assert np.isinf(row[1])
        assert row[2] == pytest.approx(0.5 / C, rel=1e-9)


def test_a_deflection_over_the_tool_s_place_is_that_of_the_posture_there():
    chain = load_chain("planar-2r")
    wrench = (30.0, -50.0, 0.0, 0.0, 0.0, 0.0)
    words = (chain, VjmEngine(2), MapQuantity.DEFLECTION, "y=-100:100:3,x=500:920:5", "bent")
    found = mapped(*words, wrench=wrench, gravity=(0.0, -9.81, 0.0))
    # the whole arm is 900 mm long
    lost = np.array([why.startswith("out of reach: ") for why in found.why])
    assert lost.tolist() == [x == 920 for x in (500, 605, 710, 815, 920) for _ in range(3)]
    model = Mechanism(chain.refined(2).split())
    for q, tool, row in zip(
        found.map.points.q[~lost], found.map.points.places[~lost], found.values[~lost], strict=True
    ):
        at = equilibria(model, q, wrench=np.array(wrench), gravity=(0.0, -9.81, 0.0))
        assert row[:6] == pytest.approx(at.deflection[0, 0], abs=1e-9)
        assert row[6] == pytest.approx(np.linalg.norm(at.deflection[0, 0, :3]), rel=1e-9)
        assert np.abs(tool[0] - np.array([500.0, 605.0, 710.0, 815.0])).min() < 1e-6
    assert np.isnan(found.values[lost]).all()


def test_a_point_beyond_a_joints_limits_has_no_value_and_says_which_and_by_how_much():
    """planar-2r's elbow goes to 2.6 rad: its tool comes as near as the law of cosines says."""
    chain, words = load_chain("planar-2r"), (VjmEngine(2), MapQuantity.STIFFNESS)
    over_joints = mapped(chain, *words, "elbow=2.2:2.8:4", "bent")
    assert list(over_joints.why[:3]) == ["ok"] * 3
    assert over_joints.why[3] == "out of reach: elbow = 2.8 exceeds its limit 2.6 by 0.2 rad"
    assert np.isfinite(over_joints.values[:3, 0]).all()
    assert np.isnan(over_joints.values[3]).all()
    nearest = np.sqrt(500.0**2 + 400.0**2 + 2.0 * 500.0 * 400.0 * np.cos(2.6))
    inside, outside = nearest - 20.0, nearest + 20.0
    over_places = mapped(chain, *words, f"x={inside}:{outside}:2,y=0", "bent")
    elbow = np.arccos((inside**2 - 500.0**2 - 400.0**2) / (2.0 * 500.0 * 400.0))
    assert over_places.why[1] == "ok"
    assert f"elbow = {elbow:.6g} exceeds its limit 2.6 by {elbow - 2.6:.4g} rad" in over_places.why[0]
    assert "misses it by 20 mm" in over_places.why[0]
    assert abs(over_places.map.points.q[1, 1]) < 2.6


def test_the_limits_of_a_joint_that_follows_others_count_too():
    follower = Joint("j2", AXES["z"], limits=(-1.0, 1.0), coupling=JointCoupling((("j1", 2.0),), offset=0.1))
    chain = two_links()
    chain = replace(chain, parts=(*chain.parts, follower))
    found = mapped(chain, VjmEngine(), MapQuantity.STIFFNESS, "j1=0.4:0.5:2", "bent")
    assert list(found.why) == ["ok", "out of reach: j2 = 1.1 exceeds its limit 1 by 0.1 rad"]


def test_its_files(tmp_path):
    found = mapped(two_links(), VjmEngine(), MapQuantity.STIFFNESS, "j0=0:1:3,j1=0.5:2:4", "bent")
    files, left_out = write_map(found, tmp_path)
    assert [file.name for file in files] == ["map.csv", "map.png"]
    assert left_out == []
    lines = files[0].read_text().splitlines()
    rows = list(csv.DictReader(lines[1:]))
    assert lines[0].startswith("# model=two engine=vjm-paper quantity=stiffness")
    assert len(rows) == 12
    assert float(rows[5]["kt_min_N_per_mm"]) == pytest.approx(found.values[5, 0], rel=1e-8)
    assert files[1].stat().st_size > 5000


def test_the_command_takes_an_arm(tmp_path):
    words = ["map", "ur10", "--posture", "work", "--grid", "elbow=1:2:5", "--out", str(tmp_path / "map")]
    assert "ur10, vjm-4, stiffness: 5 of 5 poses" in validate(*words).out


def test_a_map_as_a_document_under_a_load_on_a_part(tmp_path):
    words = ["map", "planar-2r", "--posture", "bent", "--grid", "elbow=0.5:1.5:3", "--quantity", "deflection"]
    document = json_of(*words, "--load", "fore@0.5:0,-40,0", "--out", tmp_path / "map")
    jsonschema.validate(document, schemas()["map-rows.schema.json"])
    model = Mechanism(load_chain("planar-2r").refined(4).split())
    assert document["status"] == ["ok"] * 3
    for k, elbow in enumerate((0.5, 1.0, 1.5)):
        q = model.posture("bent").copy()
        q[model.joints.index("elbow")] = elbow
        at = equilibria(model, q, loads=[Load((0.0, -40.0, 0.0, 0.0, 0.0, 0.0), "fore", 0.5)])
        assert document["joints"]["elbow"][k] == elbow
        assert document["values"][k][:6] == pytest.approx(at.deflection[0, 0].tolist(), abs=1e-9)


def test_the_page_of_a_map_has_joints_and_units(tmp_path):
    page = tmp_path / "map.html"
    words = ["map", "planar-2r", "--posture", "bent", "--grid", "elbow=0.5:1.5:3", "--report", str(page)]
    validate(*words, "--out", tmp_path / "map")
    text = page.read_text()
    for word in (
        "3 of 3 poses have an answer; smallest stiffness against a force from",
        ">elbow<",
        ">kt_min, N/mm<",
    ):
        assert word in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--grid", "wrist=0:1:3"],
            "'wrist=0:1:3' is not NAME=from:to:count with x, y, z or a joint (shoulder-pan",
        ),
        (["--grid", "x=0:1:3,elbow=1"], "give joints or coordinates of the tool, not both"),
        (["--grid", "elbow=2:1:3"], "'2:1:3' must run upwards"),
        (["--grid", "elbow=0:1:3", "--quantity", "deflection"], "--wrench: a map of the deflection needs one"),
        (["--grid", "elbow=0:1:3", "--end", "hand"], "no end frame 'hand'"),
    ],
)
def test_bad_words_are_refused(words, said, tmp_path):
    assert said in refused("map", "ur10", *words, "--out", tmp_path / "map")
    assert not (tmp_path / "map" / "map.csv").exists()


def test_a_grid_over_a_passive_joint_is_refused_and_tool_positions_leave_it_where_it_is():
    parts = (
        Joint("j1", AXES["z"], compliance=1e-8),
        RigidOffset("arm", translation([300.0, 0.0, 0.0])),
        Joint("p", AXES["z"], passive=True, compliance=1e-06, rest=0.0),
        Joint("j2", AXES["x"], slides=True, compliance=1e-5),
    )
    held = {"bent": {"j1": 0.1, "p": 0.2, "j2": 200.0}}
    chain = Machine("arm", parts, postures={"bent": np.zeros(0)}, held=held)
    with pytest.raises(ValueError, match="joint 'p' is passive: nothing sets it"):
        mapped(chain, VjmEngine(), MapQuantity.STIFFNESS, "p=-1:1:3", "bent")
    found = mapped(chain, VjmEngine(), MapQuantity.STIFFNESS, "x=480:500:3,y=100", "bent")
    assert list(found.why) == ["ok"] * 3
    assert list(found.map.points.q[:, 1]) == [0.2] * 3
    # a rounding of 500 mm
    places = found.map.points.places[:, :2]
    assert places == pytest.approx(np.array([[480.0, 100.0], [490.0, 100.0], [500.0, 100.0]]), abs=5e-12)


# Maps of the smallest critical force of arms, and their command.


def test_a_map_of_critical_forces_and_its_command(tmp_path):
    found = mapped(vjm.load("planar-2r"), VjmEngine(2), MapQuantity.CRITICAL, "elbow=0.4:2.8:3", "bent")
    assert list(found.why) == ["ok", "ok", "out of reach: elbow = 2.8 exceeds its limit 2.6 by 0.2 rad"]
    model = VjmEngine(2).model(vjm.load("planar-2r"))
    for q, row in zip(found.map.points.q[:2], found.values[:2], strict=True):
        alone = CriticalForce(model, 0, 20_000.0).weakest(q)
        assert row == pytest.approx([alone.force, *alone.direction])
    words = ["map", "planar-2r", "--posture", "bent", "--grid", "elbow=0.4:1.6:2", "--quantity", "critical"]
    document = json_of(*words, "--engine", "vjm-2", "--out", tmp_path / "map")
    assert document["columns"][0] == "F_cr_N"
    assert document["values"][0] == pytest.approx(found.values[0].tolist())
    assert (tmp_path / "map" / "map.png").stat().st_size > 5000


# Joints that are called x, y or z, and grids of the tool's places: both can be asked, and bare names are said.


# a joint x that turns the tool's arm of 300 mm in the plane, and a slide y along it
CRANE = model_text(
    "crane",
    part_text("actuated", "x", axis="z", compliance_rad_per_Nmm=1e-8),
    part_text("link", "jib", translation_mm=[300.0, 0.0, 0.0]),
    part_text("actuated", "y", axis="x", motion="slides", compliance_mm_per_N=1e-5),
    postures={"home": {"x": 0.0, "y": 0.0}},
)


@pytest.fixture
def crane(tmp_path):
    file = tmp_path / "crane.toml"
    file.write_text(CRANE)
    return file


def points(file, text):
    model = VjmEngine().model(load_model(file))
    grid = parsed_grid(text, model)
    return grid, points_of(model, grid, "home")


def test_tool_and_joint_are_both_asked(crane):
    grid, of_joint = points(crane, "joint.x=0:1:3,joint.y=50")
    assert (grid.tool, grid.read_as) == (False, "")
    np.testing.assert_allclose(of_joint.q, [[0.0, 50.0], [0.5, 50.0], [1.0, 50.0]])
    angle = np.array([0.0, 0.5, 1.0])
    np.testing.assert_allclose(of_joint.places[:, :2], 350.0 * np.column_stack([np.cos(angle), np.sin(angle)]))
    grid, of_tool = points(crane, "tool.x=300:320:3,tool.y=100")
    assert (grid.tool, grid.read_as) == (True, "")
    assert list(of_tool.why) == ["", "", ""]
    places = np.array([[300.0, 100.0], [310.0, 100.0], [320.0, 100.0]])
    np.testing.assert_allclose(of_tool.places[:, :2], places, atol=1e-6)
    # polar coordinates of the place
    np.testing.assert_allclose(of_tool.q[:, 0], np.arctan2(places[:, 1], places[:, 0]), atol=1e-9)
    np.testing.assert_allclose(of_tool.q[:, 1], np.hypot(*places.T) - 300.0, atol=1e-6)


def test_a_bare_name_is_the_joints_and_that_is_said(crane, tmp_path):
    grid, of_joint = points(crane, "x=0:1:3")
    assert not grid.tool
    assert of_joint.q[:, 0].tolist() == [0.0, 0.5, 1.0]
    assert grid.read_as == "--grid: x: the joint's, and tool.x is the tool's"
    assert (
        "note: --grid: x: the joint's, and tool.x is the tool's"
        in validate("map", crane, "--grid", "x=0:1:2", "--out", tmp_path / "out").err
    )
    lines = (tmp_path / "out" / "map.csv").read_text().splitlines()
    header = next(csv.reader(lines[1:2]))
    assert len(set(header)) == len(header)


def test_a_bare_name_is_the_tools_where_places_count_from_home():
    model = VjmEngine().model(load_model("orthoglide"))
    grid = parsed_grid("x=-10:10:3", model)
    assert grid.tool
    assert grid.read_as == "--grid: x: the tool's, and joint.x is the joint's"
    by_drive = parsed_grid("joint.x=-10:10:3", model)
    assert (by_drive.tool, list(by_drive.axes)) == (False, ["x"])
    found = points_of(model, by_drive, next(iter(model.chain.postures)))
    np.testing.assert_allclose(found.q[:, model.joints.index("x")], [-10.0, 0.0, 10.0], atol=1e-8)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x=0:1:2,z=0", "not both; x is a joint here, tool.x is the tool's"),
        ("joint.x=0:1:2,tool.y=0", "not both"),
        ("joint.z=0:1:2", "is not NAME=from:to:count"),
        ("tool.w=0:1:2", "is not NAME=from:to:count"),
        ("tool.x=0:1:2,x=1", "given twice"),
    ],
)
def test_what_is_not_clear_is_refused(crane, text, said):
    with pytest.raises(ValueError, match="--grid") as error:
        points(crane, text)
    assert said in str(error.value)
