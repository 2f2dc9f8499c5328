"""Every command that takes a model takes a manipulator."""

import csv
import json
import re

import numpy as np
import pytest
from helpers.command import json_of, refused, validate


def test_curve_traces_the_whole_robot(tmp_path):
    file = tmp_path / "path.csv"
    arguments = ["--posture", "isotropic", "--to", "1.2", "--engine", "vjm-paper", "--csv", str(file)]
    out = validate("curve", "orthoglide", *arguments).out
    assert "bifurcation at 0.813131 mm, force 2696.2 N" in out
    assert file.read_text(encoding="utf-8").startswith("# ")


def test_buckling_of_the_whole_robot():
    arguments = ["--posture", "isotropic", "--direction", "+", "--engine", "vjm-paper", "--to", "1.0", "--json"]
    found = json.loads(validate("buckling", "orthoglide", *arguments).out)["chain"]["isotropic"]["tension"][
        "vjm-paper"
    ]
    assert found["critical"] == "bifurcation"
    assert found["F_cr"] == pytest.approx(2696.2, rel=1e-4)


@pytest.mark.parametrize("name", ["orthoglide", "3-puu", "delta", "par2", "orthoglide-parallelograms"])
def test_stiffness_of_every_machine_of_the_library(name):
    arguments = ["--wrench", "5,-3,2,0,0,0", "--engine", "vjm-1", "--json"]
    found = json.loads(validate("stiffness", name, *arguments).out)
    assert found["stable"]
    K, d = np.array(found["stiffness_unloaded"]), np.array(found["displacement"])
    assert (K @ d)[:3] == pytest.approx([5.0, -3.0, 2.0], rel=0.02)


@pytest.mark.parametrize("name", ["orthoglide", "delta"])
def test_an_imposed_displacement_of_a_platform(name):
    found = json_of("stiffness", name, "--displacement", "0.01,0,0,0,0,0", "--engine", "vjm-1")
    assert found["wrench"][0] == pytest.approx(0.01 * found["stiffness_unloaded"][0][0], rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["curve", "orthoglide", "--to", "1", "--posture", "A"],
            "no posture 'A' (it has isotropic, Q1, Q2); or give coordinates",
        ),
        (["stiffness", "parallelogram", "--wrench", "0,0,1,0,0,0"], "is a mechanism"),
        (["curve", "delta", "--to", "1", "--control", "rod@0.5:0,1,0"], "no part 'rod' with points on it"),
        (["curve", "par2", "--to", "1", "--imperfection", "0.1", "--engine", "exudyn"], "not take imperfections"),
        (["stiffness", "orthoglide", "--posture", "400,0,0"], "is out of reach: closure"),
        (
            ["map", "orthoglide-chain", "--grid", "3"],
            "its passive joints leave the end a mechanism, which has no map",
        ),
        (["stiffness", "orthoglide", "--displacement", "900,0,0,0,0,0"], "is out of reach: orthoglide's longest"),
    ],
)
def test_what_a_manipulator_cannot_do_is_one_line(arguments, words):
    assert words in " ".join(refused(*arguments).split())


def test_a_pose_may_be_given_by_its_coordinates():
    found = []
    for posture in ("Q1", "-73.65,-73.65,-73.65"):
        found.append(
            json_of("stiffness", "orthoglide", "--posture", posture, "--engine", "vjm-1")["stiffness_unloaded"]
        )
    assert np.abs(np.array(found[0]) - found[1]).max() < 1e-9 * np.abs(found[0]).max()
    arguments = ["--posture", "-70,-60,-73", "--to", "0.2", "--engine", "vjm-paper"]
    validate("curve", "orthoglide", *arguments)
    assert "10,0,0" in validate("buckling", "orthoglide", "--posture", "10,0,0", *arguments[2:]).out
    assert "2 coordinates are no pose of it: give x,y,z of the end-effector from home" in " ".join(
        refused("curve", "orthoglide", "--posture", "1,2", "--to", "1").split()
    )


def test_a_platform_with_a_hinge_and_with_a_bow():
    validate("curve", "orthoglide", "--to", "-0.5", "--free", "rz", "--engine", "vjm-4")
    arguments = ["--posture", "isotropic", "--to", "-1", "--imperfection", "0.2", "--engine", "vjm-4"]
    validate("curve", "orthoglide", *arguments)


def test_a_part_is_identified_of_one_chain():
    assert "delta.toml: is a whole manipulator, and this takes one chain" in " ".join(
        refused("identify", "delta", "--part", "rod").split()
    )


def test_the_list_names_the_manipulators():
    assert "orthoglide-parallelograms" in validate("list").out


def rows(folder):
    """Values by place of a written map."""
    with (folder / "map.csv").open(encoding="utf-8") as stream:
        next(stream)
        return [{k: float(v) for k, v in row.items() if k.endswith("_mm") and v} for row in csv.DictReader(stream)]


def test_a_map_about_a_posture_is_that_about_home(tmp_path):
    """One goes pose by pose in a batch of legs, the other over the tree of parts."""
    asked = ["map", "delta", "--grid", "x=-60:60:2,z=-40:20:2", "--quantity", "deflection", "--wrench", "5,0,-10"]
    validate(*asked, "--out", tmp_path / "legs")
    validate(*asked, "--posture", "home", "--out", tmp_path / "tree")
    legs, tree = rows(tmp_path / "legs"), rows(tmp_path / "tree")
    assert len(legs) == len(tree) == 4
    for one, other in zip(legs, tree, strict=True):
        for name in ("ux_mm", "uy_mm", "uz_mm"):
            # the files have nine digits
            assert one[name] == pytest.approx(other[name], rel=1e-7, abs=1e-10)


def test_a_platform_sags_under_its_weight_over_its_workspace(tmp_path):
    """The weight of the platform alone, which is its only mass, as a force on it at its centre."""
    model = tmp_path / "planar.toml"
    validate("new", "platform", model)
    leg = tmp_path / "planar-leg.toml"
    leg.write_text(re.sub(r"(?m)^(section\.)?density.*$", "", leg.read_text(encoding="utf-8")), encoding="utf-8")
    leg.write_text(re.sub(r", density_kg_per_m3 = [0-9.]+", "", leg.read_text(encoding="utf-8")), encoding="utf-8")
    asked = ["map", str(model), "--grid", "3", "--quantity", "deflection"]
    validate(*asked, "--gravity", "0,0,-10", "--out", tmp_path / "weight")
    validate(*asked, "--wrench", "0,0,-30", "--out", tmp_path / "force")
    weight, force = rows(tmp_path / "weight"), rows(tmp_path / "force")
    assert len(weight) == len(force) == 9
    for one, other in zip(weight, force, strict=True):
        assert one["uz_mm"] == pytest.approx(other["uz_mm"], rel=1e-7)
        assert one["uz_mm"] < -1e-3


def test_weight_without_masses_is_doubted(tmp_path):
    assert (
        "no part has a mass, so that under --gravity it weighs nothing"
        in validate("stiffness", "delta", "--gravity", "0,0,-9.81", "--engine", "vjm-1").err
    )


def test_an_arm_needs_a_grid(tmp_path):
    assert "planar-2r has no [workspace]: write x=from:to:count" in refused(
        "map", "planar-2r", "--out", tmp_path / "map"
    )
    assert not (tmp_path / "map").exists()
