"""``validate new``, ``check`` and ``import``: templates run as they are, every error is listed with its line."""

import json
from importlib import resources

import numpy as np
import pytest
from helpers.command import json_of, refused, validate

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.io.model_report import elastic_parts, errors_of, line_of
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.rotations import displacement_between
from vjm_updating import load_data
from vjm_updating.experiment.data_file import source_of_sheet, toml_of
from vjm_updating.experiment.measurement import planned_measurement
from vjm_updating.experiment.sheet import read_sheet, read_sheet_of
from vjm_updating.poses.measurement import PoseSheet
from vjm_updating.simulate import PlannedRamp, planned_readings
from vjm_validation.cli.main import run


@pytest.mark.parametrize("kind", ["chain", "arm", "platform"])
def test_a_template_runs_as_it_is(kind, tmp_path):
    file = tmp_path / "my-own.toml"
    validate("new", kind, file)
    assert load_model(file).name == "my-own"
    assert "my-own" in validate("check", file).out
    # never over somebody's work
    assert "exists already" in refused("new", kind, file)


def test_commands_take_the_arm(tmp_path):
    file = tmp_path / "arm.toml"
    validate("new", "arm", file)
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
    for text in ("2: shoulder, elbow", "beam of 500 mm, section", "posture bent", "elbow 1.2 rad", "kg"):
        assert text in finished.out
    assert elastic_parts(load_model("ur10"))[0] == ("shoulder-pan", "1.1e-8 rad/(N mm)")


def test_check_lists_every_error_with_its_line(tmp_path):
    file = tmp_path / "arm.toml"
    validate("new", "arm", file)
    text = file.read_text()
    broken = text.replace("length_mm = 500.0", "lenght_mm = 500.0").replace("mass_kg = 3.0", 'mass_kg = "3"')
    file.write_text(broken)
    lines = broken.splitlines()
    finished = validate("check", file, status=2)
    wrong = 1 + next(i for i, line in enumerate(lines) if line.startswith("lenght_mm"))
    mass = 1 + next(i for i, line in enumerate(lines) if line.startswith("mass_kg"))
    assert f"arm.toml:{wrong}: part 'upper': unknown key 'lenght_mm'; did you mean 'length_mm'?" in finished.err
    assert f"arm.toml:{mass}: part 'fore': mass_kg must be a number, got '3'" in finished.err
    assert finished.err.count("validate:") == 3  # and length_mm is missing


def test_an_error_of_the_whole_machine_has_the_line_of_what_it_names(tmp_path):
    file = tmp_path / "arm.toml"
    validate("new", "arm", file)
    file.write_text(file.read_text().replace("home = { shoulder = -0.5,", "home = { shoulder = -30.0,"))
    (said,) = errors_of(file)
    assert "posture 'home': shoulder = -30 rad is beyond ±2π" in said
    assert line_of("a = 1\n[units]\nlength = 2\n", ("units", "length")) == 3


def test_import_writes_a_model_file(tmp_path):
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    link = '<link name="{}"><inertial><mass value="1"/>' + inertia + "</inertial></link>"
    joint = '<joint name="q" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint>'
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(f'<robot name="tiny">{link.format("a")}{link.format("b")}{joint}</robot>')
    out = tmp_path / "tiny.toml"
    assert "the compliance of q" in validate("import", urdf, "--out", out).out
    assert load_model(out).held_joints[0].name == "q"
    assert "cannot be read" in refused("import", tmp_path / "none.urdf")


def test_export_writes_a_urdf_and_refuses_loops(tmp_path):
    out = tmp_path / "arm.urdf"
    assert (
        "left out: what is elastic in shoulder, upper, elbow, fore"
        in validate("export", "planar-2r", "--urdf", out).out
    )
    assert out.read_text().startswith("<?xml")
    assert "exists already" in refused("export", "planar-2r", "--urdf", out)
    assert "a URDF is a tree" in refused("export", "orthoglide", "--urdf", tmp_path / "o.urdf")
    assert not (tmp_path / "o.urdf").exists()


@pytest.mark.slow
def test_a_sheet_is_read_as_it_is_and_goes_with_readings(tmp_path):
    file, data = tmp_path / "my-test.toml", tmp_path / "readings.csv"
    validate("new", "sheet", file)
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
    validate("diagnose", data, "--sheet", file, "--out", tmp_path / "out")
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text())["verdict"] == "none"


def test_a_platform_comes_with_its_legs(tmp_path):
    file, leg = tmp_path / "robot.toml", tmp_path / "robot-leg.toml"
    leg.write_text("mine")
    assert "robot-leg.toml: exists already" in refused("new", "platform", file)
    # nothing half-written, and nothing of mine lost
    assert (file.exists(), leg.read_text()) == (False, "mine")
    leg.unlink()
    validate("new", "platform", file)
    assert isinstance(load_model(leg), Machine)
    # each leg is a drive and two bars of 25 × 6 mm, 70 GPa, 300 mm, which press along their line only
    bar = 300.0 / (2 * 25.0 * 6.0 * 70000.0)
    K = np.array(json_of("stiffness", file, "--posture", "home")["stiffness_unloaded"])
    # directions of the three bars in the plane, and their moments about the centre, 60 mm from it each
    A = np.array([[1.0, 0.0, -60.0], [0.0, 1.0, -60.0], [-1.0, 0.0, -60.0]])
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    # rounding of 1e8 N mm/rad
    np.testing.assert_allclose(K[plane], A.T @ A / (bar + 2e-6), rtol=1e-9, atol=1e-4)


def chains() -> list[str]:
    machines = {name: load_model(name) for name in ("orthoglide-chain", "pinned-column", "planar-2r", "ur10")}
    return [name for name, machine in machines.items() if isinstance(machine, Machine)]


@pytest.mark.parametrize("name", chains())
def test_a_sheet_for_a_machine_has_its_postures_or_joints(name, tmp_path):
    file, machine = tmp_path / "mine.toml", load_model(name)
    assert isinstance(machine, Machine)
    validate("new", "sheet", file, "--for", name)
    if machine.held_joints:
        assert toml_of(source_of_sheet(file))["kind"] == "poses"
        assert read_sheet_of(file, PoseSheet).test.model == name
        assert all(f"{joint.name}.q_rad" in file.read_text() for joint in machine.held_joints)
    else:
        sheet = read_sheet(file)
        assert sheet.test.model == name
        assert sheet.postures == {label: q.tolist() for label, q in machine.postures.items()}


@pytest.mark.parametrize("name", ["planar-2r", "ur10", "hexapod", "palletiser"])
def test_a_sheet_of_frequencies_goes_with_readings(name, tmp_path):
    file, machine = tmp_path / "mine.toml", load_model(name)
    validate("new", "sheet", file, "--for", name, "--test", "frequencies")
    columns = file.read_text().splitlines()[2].strip("# ")
    data = tmp_path / "readings.csv"
    where = [next(iter(machine.postures))] if machine.closes else ["0.1"] * len(machine.held_joints)
    data.write_text(f"{columns}\n{','.join(where)},10.0,20.0,30.0\n")
    found = load_data(data, file)
    assert (found.kind, len(found)) == ("frequencies", 1)


def test_a_kind_of_test_that_does_not_suit_is_refused(tmp_path):
    for words, said in (
        (("--test", "poses"), "--test goes with --for MODEL"),
        (("--for", "ur10", "--test", "displacements"), "ur10: drives move its end"),
        (("--for", "pinned-column", "--test", "poses"), "pinned-column: its drives alone do not set its pose"),
    ):
        assert said in refused("new", "sheet", tmp_path / "mine.toml", *words)
        assert not (tmp_path / "mine.toml").exists()


def test_a_sheet_for_a_file_finds_it_and_goes_with_readings(tmp_path):
    model, folder = tmp_path / "leg.toml", tmp_path / "tests"
    folder.mkdir()
    file, data = folder / "mine.toml", folder / "readings.csv"
    validate("new", "chain", model)
    validate("new", "sheet", file, "--for", model)
    leg = load_model(model)
    rows = ["posture,ux_mm,fx_N,fy_N,fz_N"]
    for label in leg.postures:
        path = VjmEngine(1).trace(leg, LoadCase(label, 0.1, steps=8))
        rows += [f"{label},{p.ramp:.4f}," + ",".join(f"{f:.2f}" for f in p.wrench[:3]) for p in path.points]
    data.write_text("\n".join(rows) + "\n")
    validate("calibrate", data, "--sheet", file, "--out", tmp_path / "out")
    fitted = json.loads((tmp_path / "out" / "calibration.json").read_text())
    # readings of the model itself: its factors are within their own uncertainty of one
    assert fitted["fit"]["fits"]


@pytest.mark.slow
def test_a_sheet_for_an_arm_goes_with_readings(tmp_path):
    model, file, data = tmp_path / "arm.toml", tmp_path / "mine.toml", tmp_path / "readings.csv"
    validate("new", "arm", model)
    validate("new", "sheet", file, "--for", model)
    text = file.read_text()
    header = next(line[2:].strip() for line in text.splitlines() if line.startswith("#     shoulder.q_rad"))
    rng = np.random.default_rng(5)
    arm = load_model(model)
    rows = [header]
    for q in rng.uniform(-1.2, 1.2, (40, 3)):
        # plane geometry of the template, rigid: links of 500 and 460 mm that turn about y, the wrist about x
        # the zero of the elbow is 2 mrad off
        a, b = q[0], q[0] + q[1] + 0.002
        x, z = 500.0 * np.cos(a) + 460.0 * np.cos(b), -500.0 * np.sin(a) - 460.0 * np.sin(b)
        noise = 0.05 * rng.standard_normal(3)
        rows.append(",".join(f"{v:.6f}" for v in (*q, x + noise[0], noise[1], z + noise[2])))
    assert len(arm.held_joints) == 3
    data.write_text("\n".join(rows) + "\n")
    out = str(tmp_path / "out")
    # the template's springs bend by a millimetre under its weight, and this arm is rigid: it does not sag at all
    gravity = next(line for line in text.splitlines() if line.startswith("gravity = "))
    file.write_text(text.replace(gravity, "gravity = [0.0, 0.0, 0.0]"))
    validate("calibrate", data, "--sheet", file, "--out", out, "--fit", "joint_offset")
    found = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert found["postures"] == 40


def test_a_sheet_for_a_platform_names_its_poses_and_takes_more(tmp_path):
    file = tmp_path / "mine.toml"
    validate("new", "sheet", file, "--for", "delta")
    assert "# The model has the postures home, side, low." in file.read_text()
    file.write_text(file.read_text().replace("# near =", "near ="))
    sheet = read_sheet(file)
    readings = planned_readings(sheet, [PlannedRamp("near", "x", 0.1)])
    chain = planned_measurement(sheet, readings).chain
    ends = [
        RigidMechanism(chain).end_frames(RigidMechanism(chain).posture(label)[None])[0]
        for label in ("home", "near")
    ]
    np.testing.assert_allclose(displacement_between(*ends), [10.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-8)


def test_a_sheet_is_for_a_model_that_there_is(tmp_path):
    file = tmp_path / "mine.toml"
    assert "no model 'palletizer' in the library" in refused("new", "sheet", file, "--for", "palletizer")
    assert "--for is for a sheet" in refused("new", "arm", file, "--for", "ur10")
    assert not file.exists()


def test_a_platform_that_does_not_reach_its_pose_or_does_not_close_is_an_error(tmp_path):
    file = tmp_path / "robot.toml"
    text = resources.files("vjm").joinpath("models", "manipulators", "orthoglide.toml").read_text("utf-8")
    file.write_text(text.replace("Q2 = [126.35, 126.35, 126.35]", "Q2 = [1263.5, 126.35, 126.35]"))
    assert "the pose 1263.5,126.35,126.35,0,0,0 is out of reach" in refused("check", file)
    file.write_text(text.replace("[0.0, -310.0, 0.0]", "[0.0, -31.0, 0.0]"))
    assert "closure 'y' does not close at home" in refused("check", file)


def test_check_says_what_a_machine_with_loops_can_do():
    rows = dict(
        line.strip().split("  ", 1)
        for line in validate("check", "palletiser").out.splitlines()
        if "  " in line.strip()
    )
    rows = {name: value.strip() for name, value in rows.items()}
    # a planar loop of four hinges: three of its six rows say what its plane says already
    assert rows["closed loops"] == "1: parallelogram"
    assert rows["freedom"] == "3 of the end-effector, 3 held joints"
    assert rows["redundant constraints"] == "3"
    assert rows["idle motions"] == "none"


COUPLED = """
format = 1
name = "coupled"
title = "a joint that follows another"
source = "made up"
units = { length = "mm", force = "N", angle = "rad" }
parts = [
  { kind = "actuated", name = "drive", axis = "z", compliance_rad_per_Nmm = 1e-8 },
  { kind = "link", name = "upper", translation_mm = [300.0, 0.0, 0.0] },
  { kind = "joint", name = "free", axis = "y" },
  { kind = "coupled", name = "follower", axis = "z", to = { %s = 1.0 } },
  { kind = "link", name = "fore", translation_mm = [200.0, 0.0, 0.0] },
]
postures = { home = { drive = 0.1, free = 0.2 } }
"""


@pytest.mark.parametrize(("to", "status"), [("drive", 0), ("free", 2), ("nothing", 2), ("fore", 2)])
def test_check_refuses_what_the_other_commands_refuse(tmp_path, capsys, to, status):
    """A joint follows one that is held, and no other: check says what stiffness says."""
    file = tmp_path / "coupled.toml"
    file.write_text(COUPLED % to)
    said = []
    for command in ("check", "modes", "stiffness"):
        done = run([command, str(file)])
        err = capsys.readouterr().err.strip().removeprefix("validate: ")
        if command == "check":
            assert done == status
        if status:
            assert done == 2
            said.append(err.partition(": ")[2])
    assert len(set(said)) == (1 if status else 0)
    assert all("posture 'home'" in one or "follower" in one for one in said)


# What is doubtful is a warning and in the JSON of every command that takes a model; --strict refuses it.


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
def test_a_doubt_is_said_and_refused_under_strict(command, arm, tmp_path):
    options = [word.replace("TMP", str(tmp_path)) for word in COMMANDS[command]]
    said = validate(command, arm, *options)
    assert "warning: arm.toml: part 'tool', mass_kg: 10000 kg" in said.err
    if command in ("stiffness", "buckling", "identify", "postures"):
        doubts = json.loads(said.out)["doubts"]
        assert {"doubtful"} == {doubt["grade"] for doubt in doubts}
        assert any("mass_kg" in doubt["where"] for doubt in doubts)
    said = validate(command, arm, *options, "--strict", status=2)
    assert said.err.count("\n") == 1
    assert "--strict" in said.err


def test_a_compensation_holds_the_doubts(arm, tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("x_mm,y_mm,z_mm\n500,300,0\n", encoding="utf-8")
    doubts = json_of("compensate", arm, path)["doubts"]
    assert {doubt["grade"] for doubt in doubts} == {"doubtful"}


def test_the_report_of_a_machine_refuses_a_doubt_under_strict(arm, tmp_path):
    assert refused("all", arm, "--strict", "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_sound_model_has_none():
    assert json_of("stiffness", "planar-2r", "--posture", "bent", "--strict")["doubts"] == []
