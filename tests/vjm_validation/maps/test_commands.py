"""Every command that takes a model takes a manipulator."""

import json

import numpy as np
import pytest

from vjm_validation.cli import run


def test_curve_walks_the_whole_robot(capsys, tmp_path):
    file = tmp_path / "path.csv"
    arguments = ["--posture", "isotropic", "--to", "1.2", "--engine", "vjm-paper", "--csv", str(file)]
    assert run(["curve", "orthoglide", *arguments]) == 0
    out = capsys.readouterr().out
    assert "bifurcation at 0.813131, force 2696.2" in out
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
        (["curve", "orthoglide", "--to", "1", "--posture", "A"], "has no posture 'A'"),
        (["curve", "orthoglide", "--to", "1", "--engine", "msa"], "walks single chains only"),
        (["curve", "orthoglide", "--to", "1", "--gravity", "0,0,-9.81"], "no weight"),
        (["stiffness", "orthoglide", "--displacement", "900,0,0,0,0,0"], "is out of reach: orthoglide's longest"),
    ],
)
def test_what_a_manipulator_cannot_do_is_one_line(arguments, words, capsys):
    assert run(arguments) == 2
    assert words in " ".join(capsys.readouterr().err.split())


def test_the_list_names_the_manipulators(capsys):
    assert run(["list"]) == 0
    assert "orthoglide-parallelograms" in capsys.readouterr().out
