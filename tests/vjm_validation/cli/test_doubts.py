"""What is doubtful is a warning and in the JSON of every command that takes a model; --strict refuses it."""

from __future__ import annotations

import json
from importlib import resources

import pytest

from vjm_validation.cli.main import run


@pytest.fixture
def arm(tmp_path):
    """An arm whose tool weighs ten tonnes."""
    text = resources.files("vjm").joinpath("models", "planar-2r.toml").read_text(encoding="utf-8")
    file = tmp_path / "arm.toml"
    file.write_text(text.replace("mass_kg = 2.0", "mass_kg = 10000.0"), encoding="utf-8")
    return str(file)


COMMANDS = {
    "check": [],
    "stiffness": ["--posture", "bent", "--json"],
    "buckling": ["--posture", "stretched", "--to", "0.1", "--direction", "+", "--json"],
    "curve": ["--posture", "bent", "--to", "0.1"],
    "postures": ["--tool", "500,300,0", "--json"],
    "identify": ["--part", "upper", "--json"],
    "export": ["--urdf", "TMP/arm.urdf", "--force"],
    "show": ["--posture", "bent", "--out", "TMP/view.html"],
}


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_doubt_is_said_and_refused_under_strict(command, arm, capsys, tmp_path):
    options = [word.replace("TMP", str(tmp_path)) for word in COMMANDS[command]]
    assert run([command, arm, *options]) == 0
    said = capsys.readouterr()
    assert "warning: arm.toml: part 'tool', mass_kg: 10000 kg" in said.err
    if command in ("stiffness", "buckling", "identify", "postures"):
        doubts = json.loads(said.out)["doubts"]
        assert {"doubtful"} == {doubt["grade"] for doubt in doubts}
        assert any("mass_kg" in doubt["where"] for doubt in doubts)
    assert run([command, arm, *options, "--strict"]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert "--strict" in said.err


def test_a_compensation_holds_the_doubts(arm, capsys, tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("x_mm,y_mm,z_mm\n500,300,0\n", encoding="utf-8")
    assert run(["compensate", arm, str(path), "--json"]) == 0
    doubts = json.loads(capsys.readouterr().out)["doubts"]
    assert {doubt["grade"] for doubt in doubts} == {"doubtful"}


def test_the_report_of_a_machine_refuses_a_doubt_under_strict(arm, capsys, tmp_path):
    assert run(["all", arm, "--strict", "--out", str(tmp_path / "run")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_a_sound_model_has_none(capsys):
    assert run(["stiffness", "planar-2r", "--posture", "bent", "--json", "--strict"]) == 0
    assert json.loads(capsys.readouterr().out)["doubts"] == []
