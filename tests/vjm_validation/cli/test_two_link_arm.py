"""A user's planar arm of two beams, `upper` and `fore`: every command works, and no part is taken for another."""

from __future__ import annotations

import json

import pytest

from vjm.io.model_file import load_chain
from vjm_validation.cli.main import run

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
    "curve MODEL --axis y --to -1 --engine msa", "curve MODEL --axis y --to -1 --engine vjm-unloaded-jacobian",
    f"curve MODEL --axis load --load 0,-50,0 --to 1 --free {FREE} --gravity 0,-9.81,0 --engine exudyn",
    "buckling MODEL --posture bent --direction - --json",
    f"buckling MODEL --posture bent --force --to 500 --free {FREE} --direction -",
    "stiffness MODEL --segments upper=3,fore=5 --load upper@0.5:0,-9,0", "stiffness MODEL --engine msa",
    "stiffness MODEL --posture bent --displacement 0,-1,0,0,0,0",
    "map MODEL --grid elbow=0.2:2:4 --out DIR/map",
]  # fmt: skip


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("words", COMMANDS)
def test_a_command_takes_it(words, arm, tmp_path, capsys):
    command = [word.replace("MODEL", str(arm)).replace("DIR", str(tmp_path)) for word in words.split()]
    assert run(command) == 0, capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("part", ["upper", "fore"])
def test_a_beam_is_identified_by_its_own_name(part, arm, capsys):
    assert run(["identify", str(arm), "--part", part, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    beam = next(beam for beam in load_chain(arm).beams if beam.name == part)
    # the axial entry is L/EA, whatever the engine's shear
    assert found["compliance"][0][0] == pytest.approx(beam.length / beam.section.EA, rel=1e-6)


def test_no_part_is_taken_for_the_paper_s(arm, capsys):
    """Names of the paper's chain are refused, and the two beams are told apart."""
    assert run(["curve", str(arm), "--axis", "y", "--to", "-1", "--engine", "vjm-16f16"]) == 2
    assert "no beam 'foot' to split; it has fore, upper" in capsys.readouterr().err
    tips = []
    for part in ("upper", "fore"):
        assert run(["stiffness", str(arm), "--load", f"{part}@1.0:0,-20,0", "--json"]) == 0
        tips.append(json.loads(capsys.readouterr().out))
    # 20 N at 500 and 900 mm of the shoulder, 0 and 400 of the elbow; levers shorten by 1 - cos of 0.017 rad, 1.5e-4
    assert [tip["torques"]["shoulder"] for tip in tips] == pytest.approx([1e4, 1.8e4], rel=5e-4)
    assert [tip["torques"]["elbow"] for tip in tips] == pytest.approx([0.0, 8e3], abs=4.0)
