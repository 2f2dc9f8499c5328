"""``validate import`` and ``export``: what they say, what they refuse, and that nothing half-written is left."""

import subprocess
import sys
import types

import numpy as np
import pytest
from helpers.command import refused, validate
from helpers.serial_arms import end_of
from helpers.urdf_arm import arm, joint, link, written

from vjm.io.machine_file import load_model


def test_import_says_all_that_the_file_says_at_its_head(tmp_path):
    file = written(tmp_path, arm(l2='<link name="l2"/>\n', more="<lnik/>"))
    out = tmp_path / "arm.toml"
    said = validate("import", file, "--out", out).out
    for line in (
        "left out: not understood: <lnik> in <robot> (line 10)",
        "doubtful: moving links without mass: l2; they weigh nothing",
        "left out: forces, speeds, damping and friction of joints: effort (2), velocity (2)",
    ):
        assert line in said
        assert f"# {line}" in out.read_text()
    assert load_model(out).held_joints[0].name == "j1"
    assert "to be filled in, placeholders now: the compliance of j1, j2" in said


def test_what_is_repaired_is_said_or_refused(tmp_path):
    odd = arm(
        j1=joint("j1", "base", "l1", "floating"), j2=joint("j2", "l1", "l2", more='<limit lower="1.5" upper="-2"/>')
    )
    file = str(written(tmp_path, odd))
    assert "is floating, and a machine stands on its base: --fix-base" in refused(
        "import", file, "--out", tmp_path / "a.toml"
    )
    assert "reversed: give lower below upper" in refused(
        "import", file, "--fix-base", "--strict", "--out", tmp_path / "a.toml"
    )
    assert (
        "doubtful: joint 'j2' has the limits 1.5 to -2 rad, reversed: taken as none"
        in validate("import", file, "--fix-base", "--as-is", "--out", tmp_path / "a.toml").out
    )
    said = validate("import", file, "--fix-base", "--out", tmp_path / "b.toml").out
    assert "changed: joint 'j2' has the limits 1.5 to -2 rad, reversed: they were exchanged" in said
    assert load_model(tmp_path / "b.toml").held_joints[0].limits == (-2.0, 1.5)


def test_without_a_tip_the_ends_are_proposed(tmp_path):
    text = arm(more=link("cam") + joint("c", "l1", "cam"))
    assert (
        "ends: tool, cam; --tip takes the way to one of them"
        in validate("import", written(tmp_path, text), "--out", tmp_path / "a.toml").out
    )
    said = validate("import", written(tmp_path, text), "--tip", "tool", "--out", tmp_path / "b.toml").out
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
def test_a_refusal_is_one_line_and_writes_nothing(tmp_path, words, says):
    file = written(tmp_path, arm())
    names = {"FILE": str(file), "FOLDER": str(tmp_path), "NONE": str(tmp_path / "none.urdf")}
    out = tmp_path / "out.toml"
    line = refused("import", *(names.get(word, word) for word in words), "--out", out)
    assert says in line
    assert not out.exists()


def test_a_refused_robot_leaves_no_file(tmp_path):
    out = tmp_path / "out.toml"
    assert "link 'l2' has a mass of -1 kg" in refused(
        "import", written(tmp_path, arm(l2=link("l2", "-1"))), "--out", out
    )
    assert not out.exists()


def test_a_machine_without_mass_is_doubted_under_its_weight(tmp_path):
    nothing = {name: f'<link name="{name}"/>' for name in ("base", "l1", "l2")}
    out = str(tmp_path / "light.toml")
    assert (
        "moving links without mass: l1, l2"
        in validate("import", written(tmp_path, arm(**nothing)), "--out", out).out
    )
    words = ["stiffness", out, "--posture", "home"]
    assert "mass" not in validate(*words).err
    assert (
        "no part has a mass, so that under --gravity it weighs nothing"
        in validate(*words, "--gravity", "0,0,-9.81").err
    )
    validate(*words, "--gravity", "0,0,-9.81", "--strict", status=2)
    heavy = str(tmp_path / "heavy.toml")
    validate("import", written(tmp_path, arm()), "--out", heavy)
    validate("stiffness", heavy, "--posture", "home", "--gravity", "0,0,-9.81", "--strict")


def test_xacro_is_expanded_with_its_arguments(tmp_path):
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
    said = validate("import", file, "--out", out).out
    assert "not understood: <xacro:hand> in <robot>" in said
    assert "--xacro expands it" in said
    out.unlink()
    assert "not understood" not in validate("import", file, "--xacro-argument", "mass=3", "--out", out).out
    assert next(part.mass for part in load_model(out).parts if part.name == "hand-mass") == 6.0
    broken = str(written(tmp_path, arm(robot=robot, more="<xacro:nothing/>")))
    assert "its xacro macros cannot be expanded" in refused(
        "import", broken, "--xacro", "--out", tmp_path / "b.toml"
    )


def test_a_description_comes_from_the_cache_or_is_refused(tmp_path, monkeypatch):
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
    assert "the files of 'arm_description' are not in the cache" in refused(*words, "arm")
    (tmp_path / "cache/one/.git").mkdir(parents=True)
    assert "robot_descriptions has no robot 'leg'" in refused(*words, "leg")
    validate(*words, "arm")
    assert load_model(tmp_path / "arm.toml").name == "arm"


def test_the_real_package_says_what_is_not_in_its_cache(tmp_path, monkeypatch):
    pytest.importorskip(
        "robot_descriptions",
        reason="robot_descriptions is not installed: pip install 'vjm-stiffness[descriptions]'",
    )
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    assert "'panda_description' are not in the cache" in refused("import", "--from-description", "panda")
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


def test_export_writes_both_formats_or_neither(tmp_path):
    urdf, mjcf = tmp_path / "a.urdf", tmp_path / "a.xml"
    said = validate("export", "ur10", "--urdf", urdf, "--mjcf", mjcf).out
    assert "left out: what is elastic in shoulder-pan" in said
    assert "left out: where the springs of shoulder-pan" in said
    assert mjcf.read_text().startswith("<mujoco")
    urdf.unlink()
    assert "give another --mjcf, or --force" in refused("export", "ur10", "--urdf", urdf, "--mjcf", mjcf)
    assert not urdf.exists()
    assert (
        "give the file to write: --format FORMAT, --urdf FILE, --mjcf FILE, --stiffness FILE, or several"
        in refused("export", "ur10")
    )


@pytest.mark.parametrize("name", ["orthoglide", "delta", "3-puu", "par2", "isoglide"])
def test_closed_loops_are_refused_by_name(tmp_path, name):
    said = refused("export", name, "--urdf", tmp_path / "a")
    assert f"of {name} close loops, and a URDF is a tree. Give --mjcf instead" in said
    assert list(tmp_path.iterdir()) == []
    validate("export", name, "--mjcf", tmp_path / "a.xml")


OPEN = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/><geom size=".1"/></body>
<body name="b" pos="1 0 0"><joint name="k" axis="0 1 0"/><geom size=".1"/></body></worldbody>
<equality><weld name="far" body1="a" body2="b" relpose="0 0 0 1 0 0 0"/></equality>
<actuator><motor joint="j"/></actuator></mujoco>"""


def test_what_makes_no_machine_is_said_of_the_file_that_was_read(tmp_path):
    """No model file was written, and none is named."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")
    file, out = tmp_path / "open.xml", tmp_path / "out.toml"
    file.write_text(OPEN)
    line = refused("import", file, "--out", out)
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


def test_joints_whose_stiffness_is_known_are_counted_too(tmp_path):
    (tmp_path / "arm.csv").write_text(TABLE)
    (tmp_path / "arm.stiffness.csv").write_text("joint,stiffness [Nm/rad]\nhip,50000\n")
    said = validate("import", tmp_path / "arm.csv", "--out", tmp_path / "arm.toml").out
    assert "4 parts, 2 actuated joints" in said
    assert "the compliance of knee" in said


def test_tables_and_calibrations_are_imported(tmp_path):
    (tmp_path / "arm.csv").write_text(TABLE)
    out = tmp_path / "arm.toml"
    said = validate("import", tmp_path / "arm.csv", "--out", out).out
    assert "4 parts, 2 actuated joints" in said
    assert "to be filled in, placeholders now: the compliance of hip, knee" in said
    assert [joint.name for joint in load_model(out).held_joints] == ["hip", "knee"]
    (tmp_path / "calibration.conf").write_text(CONF)
    conf = ["import", str(tmp_path / "calibration.conf"), "--out", str(tmp_path / "ur5e.toml")]
    assert "name the arm's type, --ur-type ur5e" in refused(*conf)
    assert not (tmp_path / "ur5e.toml").exists()
    assert (
        "changed: offsets of 150.001 m lead along nearly parallel axes and back"
        in validate(*conf, "--ur-type", "ur5e").out
    )
    for option in (["--tip", "hip"], ["--ur-type", "ur5e"]):
        assert f"leave {'out --tip' if '--tip' in option else 'it out'}" in refused(
            "import", tmp_path / "arm.csv", *option, "--out", tmp_path / "b.toml"
        )
    assert "--ur-type goes with a controller's calibration.conf" in refused(
        "import", "--from-description", "ur5", "--ur-type", "ur5e"
    )


@pytest.mark.parametrize("name", ["dh", "mdh", "ur-kinematics", "urdf", "mjcf"])
def test_export_writes_every_format_and_import_reads_it(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    printed = validate("export", "ur10", "--format", name).out
    (file,) = tmp_path.iterdir()
    endings = {"dh": ".dh.toml", "mdh": ".mdh.toml", "ur-kinematics": ".kinematics.yaml", "mjcf": ".xml"}
    assert file.name == f"ur10{endings.get(name, '.urdf')}"
    assert "left out: " in printed
    assert "exists already" in refused("export", "ur10", "--format", name)
    validate("import", file, "--out", "back.toml")
    there, back = (
        end_of(one, dict(zip([joint.name for joint in one.moving], (0.1, -1.0, 1.2, 0.3, 0.4, 0.5), strict=True)))
        for one in (load_model("ur10"), load_model("back.toml"))
    )
    assert np.abs(there - back).max() < 1e-9


def test_export_of_a_table_says_what_it_does_not_hold(tmp_path):
    out = str(tmp_path / "a.csv")
    said = validate("export", "ur10", "--format", "dh", "--out", out).out
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
def test_what_no_table_holds_is_refused_and_nothing_written(tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused("export", *arguments)
    assert not list(tmp_path.iterdir())


def test_a_tree_s_way_to_one_end_is_a_table(tmp_path):
    text = arm(more=link("cam") + joint("c", "l1", "cam"))
    validate("import", written(tmp_path, text), "--out", tmp_path / "a.toml")
    export = ["export", str(tmp_path / "a.toml"), "--format", "mdh", "--out"]
    said = validate(*export, tmp_path / "cam.csv", "--end", "cam").out
    assert "cam.csv: 2 joints" in said
    assert "left out: joints that are not on the way to the end: j2" in said
    assert [line.split(",")[0] for line in (tmp_path / "cam.csv").read_text().splitlines()[-2:]] == ["j1", "c"]
