"""``validate new``, ``check`` and ``import``: templates run as they are, every error is listed with its line."""

from __future__ import annotations

import json

import pytest
from helpers.command import validate

from vjm.io.machine_file import load_model
from vjm.io.model_report import elastic_parts, errors_of, line_of
from vjm.model.load_case import LoadCase
from vjm.vjm_engine import VjmEngine
from vjm_updating.experiment.sheet import read_sheet
from vjm_validation.cli.main import run


@pytest.mark.parametrize("kind", ["chain", "arm", "platform"])
def test_a_template_runs_as_it_is(kind, tmp_path, capsys):
    file = tmp_path / "my-own.toml"
    assert run(["new", kind, str(file)]) == 0
    assert load_model(file).name == "my-own"
    assert run(["check", str(file)]) == 0
    assert "my-own" in capsys.readouterr().out
    # never over somebody's work
    assert run(["new", kind, str(file)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_commands_take_the_arm(tmp_path):
    file = tmp_path / "arm.toml"
    assert run(["new", "arm", str(file)]) == 0
    for command in (
        ["stiffness", str(file), "--posture", "home", "--wrench", "0,0,-100,0,0,0"],
        ["curve", str(file), "--posture", "home", "--axis", "load", "--to", "1", "--load", "0,0,-100",
         "--free", "x,y,z,rx,ry,rz", "--gravity", "0,0,-9.81", "--engine", "exudyn"],
        ["buckling", str(file), "--posture", "stretched", "--to", "1", "--segments", "upper=4"],
    ):  # fmt: skip
        finished = validate(*command)
        assert (finished.status, finished.err.count("Traceback")) == (0, 0), finished.err


def test_check_prints_what_the_machine_is(tmp_path):
    finished = validate("check", "planar-2r")
    assert finished.status == 0
    for text in ("2: shoulder, elbow", "beam of 500 mm, section", "posture bent", "elbow 1.2 rad", "kg"):
        assert text in finished.out
    assert elastic_parts(load_model("ur10"))[0] == ("shoulder-pan", "1.1e-8 rad/(N mm)")


def test_check_lists_every_error_with_its_line(tmp_path):
    file = tmp_path / "arm.toml"
    assert run(["new", "arm", str(file)]) == 0
    text = file.read_text()
    broken = text.replace("length_mm = 500.0", "lenght_mm = 500.0").replace("mass_kg = 3.0", 'mass_kg = "3"')
    file.write_text(broken)
    lines = broken.splitlines()
    finished = validate("check", str(file))
    assert finished.status == 2
    wrong = 1 + next(i for i, line in enumerate(lines) if line.startswith("lenght_mm"))
    mass = 1 + next(i for i, line in enumerate(lines) if line.startswith("mass_kg"))
    assert f"arm.toml:{wrong}: part 'upper': unknown key 'lenght_mm'; did you mean 'length_mm'?" in finished.err
    assert f"arm.toml:{mass}: part 'fore': mass_kg must be a number, got '3'" in finished.err
    assert finished.err.count("validate:") == 3  # and length_mm is missing


def test_an_error_of_the_whole_machine_has_the_line_of_what_it_names(tmp_path):
    file = tmp_path / "arm.toml"
    assert run(["new", "arm", str(file)]) == 0
    file.write_text(file.read_text().replace("home = { shoulder = -0.5,", "home = { shoulder = -30.0,"))
    (said,) = errors_of(file)
    assert "posture 'home': shoulder = -30 rad is beyond ±2π" in said
    assert line_of("a = 1\n[units]\nlength = 2\n", ("units", "length")) == 3


def test_import_writes_a_model_file(tmp_path, capsys):
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    link = '<link name="{}"><inertial><mass value="1"/>' + inertia + "</inertial></link>"
    joint = '<joint name="q" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint>'
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(f'<robot name="tiny">{link.format("a")}{link.format("b")}{joint}</robot>')
    out = tmp_path / "tiny.toml"
    assert run(["import", str(urdf), "--out", str(out)]) == 0
    assert "the compliance of q" in capsys.readouterr().out
    assert load_model(out).held_joints[0].name == "q"
    assert run(["import", str(tmp_path / "none.urdf")]) == 2
    assert "cannot be read" in capsys.readouterr().err


def test_export_writes_a_urdf_and_refuses_loops(tmp_path, capsys):
    out = tmp_path / "arm.urdf"
    assert run(["export", "planar-2r", "--urdf", str(out)]) == 0
    assert "left out: what is elastic in shoulder, upper, elbow, fore" in capsys.readouterr().out
    assert out.read_text().startswith("<?xml")
    assert run(["export", "planar-2r", "--urdf", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run(["export", "orthoglide", "--urdf", str(tmp_path / "o.urdf")]) == 2
    assert "a URDF is a tree" in capsys.readouterr().err
    assert not (tmp_path / "o.urdf").exists()


@pytest.mark.slow
def test_a_sheet_is_read_as_it_is_and_goes_with_readings(tmp_path):
    file, data = tmp_path / "my-test.toml", tmp_path / "readings.csv"
    assert run(["new", "sheet", str(file)]) == 0
    sheet = read_sheet(file)
    assert sheet.test.title == "my-test"
    assert set(sheet.postures) == {"A", "B"}
    # readings of the model itself: nothing is wrong with them
    model = load_model(sheet.test.model)
    rows = ["posture,ux_mm,fx_N"]
    for label in sheet.postures:
        path = VjmEngine(12).trace(model, LoadCase(label, 0.4, steps=8))
        rows += [f"{label},{point.ramp:.4f},{point.wrench[0]:.2f}" for point in path.points]
    data.write_text("\n".join(rows) + "\n")
    assert run(["diagnose", str(data), "--sheet", str(file), "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text())["verdict"] == "none"


def test_a_platform_that_does_not_reach_its_pose_or_does_not_close_is_an_error(tmp_path):
    file = tmp_path / "robot.toml"
    assert validate("new", "platform", str(file)).status == 0
    text = file.read_text()
    file.write_text(text.replace("Q2 = [126.35, 126.35, 126.35]", "Q2 = [1263.5, 126.35, 126.35]"))
    done = validate("check", str(file))
    assert (done.status, done.out) == (2, "")
    assert "the pose 1263.5,126.35,126.35,0,0,0 is out of reach" in done.err
    file.write_text(text.replace("[0.0, -310.0, 0.0]", "[0.0, -31.0, 0.0]"))
    done = validate("check", str(file))
    assert done.status == 2
    assert "closure 'y' does not close at home" in done.err
    assert len(done.err.splitlines()) == 1


def test_check_says_what_a_machine_with_loops_can_do():
    done = validate("check", "palletiser")
    assert done.status == 0
    rows = dict(line.strip().split("  ", 1) for line in done.out.splitlines() if "  " in line.strip())
    rows = {name: value.strip() for name, value in rows.items()}
    # a planar loop of four hinges: three of its six rows say what its plane says already
    assert rows["closed loops"] == "1: parallelogram"
    assert rows["freedom"] == "3 of the end-effector, 3 held joints"
    assert rows["redundant constraints"] == "3"
    assert rows["idle motions"] == "none"
