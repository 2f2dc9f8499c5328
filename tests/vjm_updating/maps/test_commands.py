"""Every command that takes a model takes a manipulator."""

import csv
import json
import re

import numpy as np
import pytest

from vjm_validation.cli.main import run


def test_curve_traces_the_whole_robot(capsys, tmp_path):
    file = tmp_path / "path.csv"
    arguments = ["--posture", "isotropic", "--to", "1.2", "--engine", "vjm-paper", "--csv", str(file)]
    assert run(["curve", "orthoglide", *arguments]) == 0
    out = capsys.readouterr().out
    assert "bifurcation at 0.813131 mm, force 2696.2 N" in out
    assert file.read_text(encoding="utf-8").startswith("# ")


def test_buckling_of_the_whole_robot(capsys):
    arguments = ["--posture", "isotropic", "--direction", "+", "--engine", "vjm-paper", "--to", "1.0", "--json"]
    assert run(["buckling", "orthoglide", *arguments]) == 0
    found = json.loads(capsys.readouterr().out)["chain"]["isotropic"]["tension"]["vjm-paper"]
    assert found["critical"] == "bifurcation"
    assert found["F_cr"] == pytest.approx(2696.2, rel=1e-4)


@pytest.mark.parametrize("name", ["orthoglide", "3-puu", "delta", "par2", "orthoglide-parallelograms"])
def test_stiffness_of_every_machine_of_the_library(name, capsys):
    arguments = ["--wrench", "5,-3,2,0,0,0", "--engine", "vjm-1", "--json"]
    assert run(["stiffness", name, *arguments]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["stable"]
    K, d = np.array(found["stiffness_unloaded"]), np.array(found["displacement"])
    assert (K @ d)[:3] == pytest.approx([5.0, -3.0, 2.0], rel=0.02)


@pytest.mark.parametrize("name", ["orthoglide", "delta"])
def test_an_imposed_displacement_of_a_platform(name, capsys):
    assert run(["stiffness", name, "--displacement", "0.01,0,0,0,0,0", "--engine", "vjm-1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
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
def test_what_a_manipulator_cannot_do_is_one_line(arguments, words, capsys):
    assert run(arguments) == 2
    assert words in " ".join(capsys.readouterr().err.split())


def test_a_pose_may_be_given_by_its_coordinates(capsys):
    found = []
    for posture in ("Q1", "-73.65,-73.65,-73.65"):
        assert run(["stiffness", "orthoglide", "--posture", posture, "--engine", "vjm-1", "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["stiffness_unloaded"])
    assert np.abs(np.array(found[0]) - found[1]).max() < 1e-9 * np.abs(found[0]).max()
    arguments = ["--posture", "-70,-60,-73", "--to", "0.2", "--engine", "vjm-paper"]
    assert run(["curve", "orthoglide", *arguments]) == 0
    assert run(["buckling", "orthoglide", "--posture", "10,0,0", *arguments[2:]]) == 0
    assert "10,0,0" in capsys.readouterr().out
    assert run(["curve", "orthoglide", "--posture", "1,2", "--to", "1"]) == 2
    assert "2 coordinates are no pose of it: give x,y,z of the end-effector from home" in " ".join(
        capsys.readouterr().err.split()
    )


def test_a_platform_with_a_hinge_and_with_a_bow(capsys):
    assert run(["curve", "orthoglide", "--to", "-0.5", "--free", "rz", "--engine", "vjm-4"]) == 0
    arguments = ["--posture", "isotropic", "--to", "-1", "--imperfection", "0.2", "--engine", "vjm-4"]
    assert run(["curve", "orthoglide", *arguments]) == 0


def test_a_part_is_identified_of_one_chain(capsys):
    assert run(["identify", "delta", "--part", "rod"]) == 2
    assert "delta.toml: is a whole manipulator, and this takes one chain" in " ".join(
        capsys.readouterr().err.split()
    )


def test_the_list_names_the_manipulators(capsys):
    assert run(["list"]) == 0
    assert "orthoglide-parallelograms" in capsys.readouterr().out


def rows(folder):
    """Values by place of a written map."""
    with (folder / "map.csv").open(encoding="utf-8") as stream:
        next(stream)
        return [{k: float(v) for k, v in row.items() if k.endswith("_mm") and v} for row in csv.DictReader(stream)]


def test_a_map_about_a_posture_is_that_about_home(tmp_path):
    """One goes pose by pose in a batch of legs, the other over the tree of parts."""
    asked = ["map", "delta", "--grid", "x=-60:60:2,z=-40:20:2", "--quantity", "deflection", "--wrench", "5,0,-10"]
    assert run([*asked, "--out", str(tmp_path / "legs")]) == 0
    assert run([*asked, "--posture", "home", "--out", str(tmp_path / "tree")]) == 0
    legs, tree = rows(tmp_path / "legs"), rows(tmp_path / "tree")
    assert len(legs) == len(tree) == 4
    for one, other in zip(legs, tree, strict=True):
        for name in ("ux_mm", "uy_mm", "uz_mm"):
            # the files have nine digits
            assert one[name] == pytest.approx(other[name], rel=1e-7, abs=1e-10)


def test_a_platform_sags_under_its_weight_over_its_workspace(capsys, tmp_path):
    """The weight of the platform alone, which is its only mass, as a force on it at its centre."""
    model = tmp_path / "planar.toml"
    assert run(["new", "platform", str(model)]) == 0
    leg = tmp_path / "planar-leg.toml"
    leg.write_text(re.sub(r"(?m)^(section\.)?density.*$", "", leg.read_text(encoding="utf-8")), encoding="utf-8")
    leg.write_text(re.sub(r", density_kg_per_m3 = [0-9.]+", "", leg.read_text(encoding="utf-8")), encoding="utf-8")
    asked = ["map", str(model), "--grid", "3", "--quantity", "deflection"]
    assert run([*asked, "--gravity", "0,0,-10", "--out", str(tmp_path / "weight")]) == 0
    assert run([*asked, "--wrench", "0,0,-30", "--out", str(tmp_path / "force")]) == 0
    weight, force = rows(tmp_path / "weight"), rows(tmp_path / "force")
    assert len(weight) == len(force) == 9
    for one, other in zip(weight, force, strict=True):
        assert one["uz_mm"] == pytest.approx(other["uz_mm"], rel=1e-7)
        assert one["uz_mm"] < -1e-3
    capsys.readouterr()


def test_weight_without_masses_is_doubted(capsys, tmp_path):
    assert run(["stiffness", "delta", "--gravity", "0,0,-9.81", "--engine", "vjm-1"]) == 0
    assert "no part has a mass, so that under --gravity it weighs nothing" in capsys.readouterr().err


def test_an_arm_needs_a_grid(capsys, tmp_path):
    assert run(["map", "planar-2r", "--out", str(tmp_path / "map")]) == 2
    assert "planar-2r has no [workspace]: write x=from:to:count" in capsys.readouterr().err
    assert not (tmp_path / "map").exists()
