"""Joints that are called x, y or z, and grids of the tool's places: both can be asked, and bare names are said."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_validation.cli.main import run

# a joint x that turns the tool's arm of 300 mm in the plane, and a slide y along it
CRANE = """format = 1
name = "crane"
title = "a turning and a sliding axis"
source = "test"
units = { length = "mm", force = "N", angle = "rad" }
[[parts]]
kind = "actuated"
name = "x"
axis = "z"
compliance_rad_per_Nmm = 1e-8
[[parts]]
kind = "link"
name = "jib"
translation_mm = [300.0, 0.0, 0.0]
[[parts]]
kind = "actuated"
name = "y"
axis = "x"
motion = "slides"
compliance_mm_per_N = 1e-5
[postures]
home = { x = 0.0, y = 0.0 }
"""


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


def test_a_bare_name_is_the_joints_and_that_is_said(crane, tmp_path, capsys):
    grid, of_joint = points(crane, "x=0:1:3")
    assert not grid.tool
    assert of_joint.q[:, 0].tolist() == [0.0, 0.5, 1.0]
    assert grid.read_as == "--grid: x: the joint's, and tool.x is the tool's"
    assert run(["map", str(crane), "--grid", "x=0:1:2", "--out", str(tmp_path / "out")]) == 0
    assert "note: --grid: x: the joint's, and tool.x is the tool's" in capsys.readouterr().err
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
