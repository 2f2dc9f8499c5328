"""``validate import`` and ``export``: what they say, what they refuse, and that nothing half-written is left."""

import subprocess
import sys
import types

import numpy as np
import pytest
from helpers.serial_arms import end_of
from helpers.urdf_arm import arm, joint, link, written

from vjm.io.machine_file import load_model
from vjm_validation.cli.main import run


def test_import_says_all_that_the_file_says_at_its_head(tmp_path, capsys):
    file = written(tmp_path, arm(l2='<link name="l2"/>\n', more="<lnik/>"))
    out = tmp_path / "arm.toml"
    assert run(["import", str(file), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    for line in (
        "left out: not understood: <lnik> in <robot> (line 10)",
        "doubtful: moving links without mass: l2; they weigh nothing",
        "left out: forces, speeds, damping and friction of joints: effort (2), velocity (2)",
    ):
        assert line in said
        assert f"# {line}" in out.read_text()
    assert load_model(out).held_joints[0].name == "j1"
    assert "to be filled in, placeholders now: the compliance of j1, j2" in said


def test_what_is_repaired_is_said_or_refused(tmp_path, capsys):
    odd = arm(
        j1=joint("j1", "base", "l1", "floating"), j2=joint("j2", "l1", "l2", more='<limit lower="1.5" upper="-2"/>')
    )
    file = str(written(tmp_path, odd))
    assert run(["import", file, "--out", str(tmp_path / "a.toml")]) == 2
    assert "is floating, and a machine stands on its base: --fix-base" in capsys.readouterr().err
    assert run(["import", file, "--fix-base", "--strict", "--out", str(tmp_path / "a.toml")]) == 2
    assert "reversed: give lower below upper" in capsys.readouterr().err
    assert run(["import", file, "--fix-base", "--as-is", "--out", str(tmp_path / "a.toml")]) == 0
    assert "doubtful: joint 'j2' has the limits 1.5 to -2 rad, reversed: taken as none" in capsys.readouterr().out
    assert run(["import", file, "--fix-base", "--out", str(tmp_path / "b.toml")]) == 0
    said = capsys.readouterr().out
    assert "changed: joint 'j2' has the limits 1.5 to -2 rad, reversed: they were exchanged" in said
    assert load_model(tmp_path / "b.toml").held_joints[0].limits == (-2.0, 1.5)


def test_without_a_tip_the_ends_are_proposed(tmp_path, capsys):
    text = arm(more=link("cam") + joint("c", "l1", "cam"))
    assert run(["import", str(written(tmp_path, text)), "--out", str(tmp_path / "a.toml")]) == 0
    assert "ends: tool, cam; --tip takes the way to one of them" in capsys.readouterr().out
    assert run(["import", str(written(tmp_path, text)), "--tip", "tool", "--out", str(tmp_path / "b.toml")]) == 0
    said = capsys.readouterr().out
    assert "left out: links that are not on the way to 'tool': cam" in said
    assert "ends:" not in said


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "give a robot's file, or --from-description NAME"),
        (["FILE", "--from-description", "panda"], "not both"),
        (["--from-description", "panda", "--xacro"], "--xacro and --xacro-argument go with a file"),
        (["FILE", "--tip", "toll"], "no link 'toll'; did you mean 'tool'"),
        (["FILE", "--strict", "--as-is"], "--strict refuses what --as-is leaves out: give one of them"),
        (["FILE", "--xacro-argument", "a"], "--xacro-argument a: write NAME=VALUE"),
        (["FOLDER"], "is a directory"),
        (["NONE"], "cannot be read"),
    ],
)
def test_a_refusal_is_one_line_and_writes_nothing(tmp_path, capsys, words, says):
    file = written(tmp_path, arm())
    names = {"FILE": str(file), "FOLDER": str(tmp_path), "NONE": str(tmp_path / "none.urdf")}
    out = tmp_path / "out.toml"
    assert run(["import", *(names.get(word, word) for word in words), "--out", str(out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line
    assert not out.exists()


def test_a_refused_robot_leaves_no_file(tmp_path, capsys):
    out = tmp_path / "out.toml"
    assert run(["import", str(written(tmp_path, arm(l2=link("l2", "-1")))), "--out", str(out)]) == 2
    assert "link 'l2' has a mass of -1 kg" in capsys.readouterr().err
    assert not out.exists()


def test_a_machine_without_mass_is_doubted_under_its_weight(tmp_path, capsys):
    nothing = {name: f'<link name="{name}"/>' for name in ("base", "l1", "l2")}
    out = str(tmp_path / "light.toml")
    assert run(["import", str(written(tmp_path, arm(**nothing))), "--out", out]) == 0
    assert "moving links without mass: l1, l2" in capsys.readouterr().out
    words = ["stiffness", out, "--posture", "home"]
    assert run(words) == 0
    assert "mass" not in capsys.readouterr().err
    assert run([*words, "--gravity", "0,0,-9.81"]) == 0
    assert "no part has a mass, so that under --gravity it weighs nothing" in capsys.readouterr().err
    assert run([*words, "--gravity", "0,0,-9.81", "--strict"]) == 2
    heavy = str(tmp_path / "heavy.toml")
    assert run(["import", str(written(tmp_path, arm())), "--out", heavy]) == 0
    capsys.readouterr()
    assert run(["stiffness", heavy, "--posture", "home", "--gravity", "0,0,-9.81", "--strict"]) == 0


def test_xacro_is_expanded_with_its_arguments(tmp_path, capsys):
    pytest.importorskip("xacro", reason="xacro is not installed: pip install 'vjm-stiffness[xacro]'")
    macros = (
        '<xacro:arg name="mass" default="1"/><xacro:property name="m" value="$(arg mass)"/>'
        '<xacro:macro name="hand" params="parent">'
        '<link name="hand"><inertial><mass value="${2*m}"/></inertial></link>'
        '<joint name="wrist" type="continuous"><parent link="${parent}"/><child link="hand"/><axis xyz="0 0 1"/>'
        '</joint></xacro:macro><xacro:hand parent="l2"/>'
    )
    robot = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
    file, out = str(written(tmp_path, arm(robot=robot, more=macros))), tmp_path / "arm.toml"
    assert run(["import", file, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "not understood: <xacro:hand> in <robot>" in said
    assert "--xacro expands it" in said
    out.unlink()
    assert run(["import", file, "--xacro-argument", "mass=3", "--out", str(out)]) == 0
    assert "not understood" not in capsys.readouterr().out
    assert next(part.mass for part in load_model(out).parts if part.name == "hand-mass") == 6.0
    broken = str(written(tmp_path, arm(robot=robot, more="<xacro:nothing/>")))
    assert run(["import", broken, "--xacro", "--out", str(tmp_path / "b.toml")]) == 2
    assert "its xacro macros cannot be expanded" in capsys.readouterr().err


def test_a_description_comes_from_the_cache_or_is_refused(tmp_path, capsys, monkeypatch):
    """A made-up package in place of the real one, whose robots are downloaded."""
    file = written(tmp_path, arm())
    package = types.ModuleType("robot_descriptions")
    package.__path__ = []
    listed = types.SimpleNamespace(repository="one")
    modules = {
        "robot_descriptions": package,
        "robot_descriptions._descriptions": types.SimpleNamespace(DESCRIPTIONS={"arm_description": listed}),
        "robot_descriptions._repositories": types.SimpleNamespace(
            REPOSITORIES={"one": types.SimpleNamespace(cache_path="one")}
        ),
        "robot_descriptions.arm_description": types.SimpleNamespace(URDF_PATH=str(file)),
    }
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    words = ["import", "--out", str(tmp_path / "arm.toml"), "--from-description"]
    assert run([*words, "arm"]) == 2
    assert "the files of 'arm_description' are not in the cache" in capsys.readouterr().err
    (tmp_path / "cache/one/.git").mkdir(parents=True)
    assert run([*words, "leg"]) == 2
    assert "robot_descriptions has no robot 'leg'" in capsys.readouterr().err
    assert run([*words, "arm"]) == 0
    assert load_model(tmp_path / "arm.toml").name == "arm"


def test_the_real_package_says_what_is_not_in_its_cache(tmp_path, capsys, monkeypatch):
    pytest.importorskip(
        "robot_descriptions",
        reason="robot_descriptions is not installed: pip install 'vjm-stiffness[descriptions]'",
    )
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    assert run(["import", "--from-description", "panda"]) == 2
    assert "'panda_description' are not in the cache" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "extra", "words"),
    [
        ("mujoco", "mjcf", ["ROBOT.xml"]),
        ("xacro", "xacro", ["ROBOT.urdf", "--xacro"]),
        ("robot_descriptions", "descriptions", ["--from-description", "panda"]),
    ],
)
def test_an_extra_that_is_lacking_is_named(tmp_path, module, extra, words):
    (tmp_path / "ROBOT.xml").write_text("<mujoco/>")
    (tmp_path / "ROBOT.urdf").write_text(arm())
    program = (
        f"import sys; sys.modules[{module!r}] = None\n"
        "from vjm_validation.cli.main import run\nsys.exit(run(sys.argv[1:]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "import", *words], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 2
    assert f"this needs {module}, which is not installed: pip install 'vjm-stiffness[{extra}]'" in done.stderr


def test_export_writes_both_formats_or_neither(tmp_path, capsys):
    urdf, mjcf = tmp_path / "a.urdf", tmp_path / "a.xml"
    assert run(["export", "ur10", "--urdf", str(urdf), "--mjcf", str(mjcf)]) == 0
    said = capsys.readouterr().out
    assert "left out: what is elastic in shoulder-pan" in said
    assert "left out: where the springs of shoulder-pan" in said
    assert mjcf.read_text().startswith("<mujoco")
    urdf.unlink()
    assert run(["export", "ur10", "--urdf", str(urdf), "--mjcf", str(mjcf)]) == 2
    assert "give another --mjcf, or --force" in capsys.readouterr().err
    assert not urdf.exists()
    assert run(["export", "ur10"]) == 2
    assert (
        "give the file to write: --format FORMAT, --urdf FILE, --mjcf FILE, --stiffness FILE, or several"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("name", ["orthoglide", "delta", "3-puu", "par2", "isoglide"])
def test_closed_loops_are_refused_by_name(tmp_path, capsys, name):
    assert run(["export", name, "--urdf", str(tmp_path / "a")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"of {name} close loops, and a URDF is a tree. Give --mjcf instead" in said
    assert list(tmp_path.iterdir()) == []
    assert run(["export", name, "--mjcf", str(tmp_path / "a.xml")]) == 0


OPEN = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/><geom size=".1"/></body>
<body name="b" pos="1 0 0"><joint name="k" axis="0 1 0"/><geom size=".1"/></body></worldbody>
<equality><weld name="far" body1="a" body2="b" relpose="0 0 0 1 0 0 0"/></equality>
<actuator><motor joint="j"/></actuator></mujoco>"""


def test_what_makes_no_machine_is_said_of_the_file_that_was_read(tmp_path, capsys):
    """No model file was written, and none is named."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")
    file, out = tmp_path / "open.xml", tmp_path / "out.toml"
    file.write_text(OPEN)
    assert run(["import", str(file), "--out", str(out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "open.xml: what it describes makes no machine, so nothing is written: posture 'home'" in line
    assert "closure 'far' does not close" in line
    assert "out.toml" not in line
    assert not out.exists()


TABLE = """# convention = "dh"
# units = { length = "mm", angle = "deg" }
name,a,d,alpha,theta
hip,0,300,90,0
knee,400,0,0,0
"""
CONF = """[mounting]
delta_theta = [0, 0.1, 0, 0, 0, 0]
delta_a = [0, 0, 0, 0, 0, 0]
delta_d = [0, 150.0, -150.0, 0, 0, 0]
delta_alpha = [0, 0, 0, 0, 0, 0]
"""


def test_joints_whose_stiffness_is_known_are_counted_too(tmp_path, capsys):
    (tmp_path / "arm.csv").write_text(TABLE)
    (tmp_path / "arm.stiffness.csv").write_text("joint,stiffness [Nm/rad]\nhip,50000\n")
    assert run(["import", str(tmp_path / "arm.csv"), "--out", str(tmp_path / "arm.toml")]) == 0
    said = capsys.readouterr().out
    assert "4 parts, 2 actuated joints" in said
    assert "the compliance of knee" in said


def test_tables_and_calibrations_are_imported(tmp_path, capsys):
    (tmp_path / "arm.csv").write_text(TABLE)
    out = tmp_path / "arm.toml"
    assert run(["import", str(tmp_path / "arm.csv"), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "4 parts, 2 actuated joints" in said
    assert "to be filled in, placeholders now: the compliance of hip, knee" in said
    assert [joint.name for joint in load_model(out).held_joints] == ["hip", "knee"]
    (tmp_path / "calibration.conf").write_text(CONF)
    conf = ["import", str(tmp_path / "calibration.conf"), "--out", str(tmp_path / "ur5e.toml")]
    assert run(conf) == 2
    assert "name the arm's type, --ur-type ur5e" in capsys.readouterr().err
    assert not (tmp_path / "ur5e.toml").exists()
    assert run([*conf, "--ur-type", "ur5e"]) == 0
    assert "changed: offsets of 150.001 m lead along nearly parallel axes and back" in capsys.readouterr().out
    for option in (["--tip", "hip"], ["--ur-type", "ur5e"]):
        assert run(["import", str(tmp_path / "arm.csv"), *option, "--out", str(tmp_path / "b.toml")]) == 2
        assert f"leave {'out --tip' if '--tip' in option else 'it out'}" in capsys.readouterr().err
    assert run(["import", "--from-description", "ur5", "--ur-type", "ur5e"]) == 2
    assert "--ur-type goes with a controller's calibration.conf" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["dh", "mdh", "ur-kinematics", "urdf", "mjcf"])
def test_export_writes_every_format_and_import_reads_it(tmp_path, capsys, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    assert run(["export", "ur10", "--format", name]) == 0
    (file,) = tmp_path.iterdir()
    endings = {"dh": ".dh.toml", "mdh": ".mdh.toml", "ur-kinematics": ".kinematics.yaml", "mjcf": ".xml"}
    assert file.name == f"ur10{endings.get(name, '.urdf')}"
    assert "left out: " in capsys.readouterr().out
    assert run(["export", "ur10", "--format", name]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run(["import", str(file), "--out", "back.toml"]) == 0
    capsys.readouterr()
    there, back = (
        end_of(one, dict(zip([joint.name for joint in one.moving], (0.1, -1.0, 1.2, 0.3, 0.4, 0.5), strict=True)))
        for one in (load_model("ur10"), load_model("back.toml"))
    )
    assert np.abs(there - back).max() < 1e-9


def test_export_of_a_table_says_what_it_does_not_hold(tmp_path, capsys):
    out = str(tmp_path / "a.csv")
    assert run(["export", "ur10", "--format", "dh", "--out", out]) == 0
    said = capsys.readouterr().out
    for what in ("what is elastic in shoulder-pan", "masses of link-1", "the postures stretched, upright, work"):
        assert f"left out: {what}" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["delta", "--format", "dh"], "--format dh: delta: the closures rod-a2, "),
        (["ur10", "--format", "dh", "--out", "a.txt"], "formats by the file's ending: give .toml or .csv"),
        (["ur10", "--format", "ur-kinematics", "--out", "a.toml"], "give .yaml or .yml"),
        (["planar-2r", "--format", "ur-kinematics"], "have six joints that turn, and this machine has 2 joints"),
        (["ur10", "--format", "ur-kinematics", "--parallel", "offsets"], "--parallel goes with --format dh or mdh"),
        (["ur10", "--format", "dh", "--end", "hand"], "no end 'hand'; there are none"),
        (["ur10", "--out", "a.csv"], "--out a.csv: say in which --format: urdf, mjcf, dh, mdh, ur-kinematics"),
        (["ur10", "--urdf", "a.urdf", "--parallel", "offsets"], "--parallel and --end go with --format dh, mdh or"),
        (["ur10", "--format", "urdf", "--urdf", "a.urdf"], "--format urdf and --urdf are the same"),
        (["delta", "--format", "urdf"], "close loops, and a URDF is a tree"),
    ],
)  # fmt: skip
def test_what_no_table_holds_is_refused_and_nothing_written(tmp_path, capsys, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert run(["export", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_tree_s_way_to_one_end_is_a_table(tmp_path, capsys):
    text = arm(more=link("cam") + joint("c", "l1", "cam"))
    assert run(["import", str(written(tmp_path, text)), "--out", str(tmp_path / "a.toml")]) == 0
    export = ["export", str(tmp_path / "a.toml"), "--format", "mdh", "--out"]
    assert run([*export, str(tmp_path / "cam.csv"), "--end", "cam"]) == 0
    said = capsys.readouterr().out
    assert "cam.csv: 2 joints" in said
    assert "left out: joints that are not on the way to the end: j2" in said
    assert [line.split(",")[0] for line in (tmp_path / "cam.csv").read_text().splitlines()[-2:]] == ["j1", "c"]
