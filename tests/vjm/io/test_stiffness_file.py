"""Files of joint stiffness beside robots' descriptions."""

import pytest
from helpers.command import refused, validate
from helpers.urdf_arm import arm, joint, written

from vjm.io.errors import ModelFileError
from vjm.io.machine_file import load_model
from vjm.io.model_file import build_chain
from vjm.io.robot_document import PLACEHOLDER
from vjm.io.robot_file import Description, import_robot

GIVEN = """[joints.j1]
stiffness_Nm_per_rad = 25000.0
source = "data sheet"
[joints.j2]
compliance_rad_per_Nmm = 3e-8
lateral_rad_per_Nmm = [2e-9, 1e-9]
rotor_kg_mm2 = 4e5
"""


def read(folder, text, stiffness=None, robot=None):
    file = written(folder, robot or arm())
    (folder / "arm.stiffness.toml").write_text(text)
    return import_robot(Description(file), stiffness=stiffness)


def test_the_file_beside_a_urdf_is_read(tmp_path):
    found = read(tmp_path, GIVEN)
    joints = {joint.name: joint for joint in build_chain(found.document, "arm.toml").held_joints}
    assert joints["j1"].compliance == pytest.approx(1.0 / 25e6, rel=1e-15)
    assert (joints["j2"].compliance, joints["j2"].lateral, joints["j2"].rotor) == (3e-8, (2e-9, 1e-9), 4e5)
    assert found.to_fill_in == []
    assert "the stiffness of j1, j2 is that of arm.stiffness.toml" in found.notes.changed
    assert found.document["source"] == "arm.urdf and arm.stiffness.toml"
    assert next(part for part in found.document["parts"] if part["name"] == "j1")["source"] == "data sheet"


def test_joints_that_it_does_not_name_are_to_be_filled_in(tmp_path):
    found = read(tmp_path, GIVEN.split("[joints.j2]")[0] + "[joints.j22]\nrotor_kg_mm2 = 1.0\n")
    assert found.to_fill_in == ["j2"]
    assert (
        next(p for p in found.document["parts"] if p["name"] == "j2")["compliance_rad_per_Nmm"]
        == (PLACEHOLDER["turns"])
    )
    assert "names the joint 'j22', which is not in the machine; did you mean 'j2'?" in " ".join(
        found.notes.doubtful
    )
    assert found.document["source"].endswith("placeholders, to be filled in")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[joints.j1]\nstiffness_N_per_mm = 3.0\n", "joint 'j1' has stiffness_N_per_mm, but it turns"),
        ("[joints.j1]\nstiffness_Nm_per_rad = -3.0\n", "must be above 0"),
        ("[joints.j1]\nstifness_Nm_per_rad = 3.0\n", "did you mean 'stiffness_Nm_per_rad'"),
        (
            "[joints.j1]\nstiffness_Nm_per_rad = 3.0\ncompliance_rad_per_Nmm = 1e-8\n",
            "has stiffness_Nm_per_rad and compliance_rad_per_Nmm: give one of them",
        ),
        ("joints = 3 4", "arm.stiffness.toml: "),
    ],
)
def test_a_refusal_is_one_line(tmp_path, text, says):
    with pytest.raises(ModelFileError) as refused:
        read(tmp_path, text)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_command_takes_another_file(tmp_path):
    file = written(tmp_path, arm())
    other = tmp_path / "gears.toml"
    other.write_text(GIVEN)
    said = validate("import", file, "--stiffness", other, "--out", tmp_path / "a.toml").out
    assert "the stiffness of j1, j2 is that of gears.toml" in said
    assert "to be filled in" not in said
    assert "cannot be read" in refused("import", file, "--stiffness", tmp_path / "no", "--out", tmp_path / "b.toml")


@pytest.mark.parametrize("name", ["ur10", "planar-2r"])
def test_a_urdf_and_its_file_bring_the_drives_back(tmp_path, name):
    files = tmp_path / "robot.urdf", tmp_path / "robot.stiffness.toml"
    assert (
        "robot.stiffness.toml: what deflects in the drives"
        in validate("export", name, "--urdf", files[0], "--stiffness", files[1]).out
    )
    again = build_chain(import_robot(Description(files[0])).document, "robot.toml")
    given = [(j.name, j.compliance, j.lateral, j.rotor) for j in load_model(name).held_joints]
    assert any(compliance for _, compliance, _, _ in given)
    assert [(j.name, j.compliance, j.lateral, j.rotor) for j in again.held_joints] == given


# --- tables -----------------------------------------------------------------------------------------------------


def table(folder, text, robot=None):
    (folder / "arm.stiffness.csv").write_text(text, encoding="utf-8")
    return import_robot(Description(written(folder, robot or arm())))


def test_a_table_beside_the_description_is_read_as_the_file_is(tmp_path):
    columns = "joint,stiffness_Nm_per_rad,compliance_rad_per_Nmm,lateral_1_rad_per_Nmm,lateral_2_rad_per_Nmm,"
    rows = "j1,25000,,,,,data sheet\n\n# not measured yet: j3\nj2,,3e-8,2e-9,1e-9,4e5,\n"
    found = table(tmp_path, f"{columns}rotor_kg_mm2,source\n{rows}")
    (tmp_path / "arm.stiffness.csv").unlink()
    (tmp_path / "arm.stiffness.toml").write_text(GIVEN)
    assert found.document["parts"] == import_robot(Description(tmp_path / "arm.urdf")).document["parts"]
    assert "the stiffness of j1, j2 is that of arm.stiffness.csv" in found.notes.changed
    assert found.to_fill_in == []


@pytest.mark.parametrize(
    ("column", "value", "compliance"),
    [
        ("stiffness [Nm/rad]", 2e4, 5e-8),
        ("Stiffness (N mm / rad)", 2e7, 5e-8),
        # gears' data sheets: 1 N m in an arc minute is 10800/π N m/rad
        ("stiffness [Nm/arcmin]", 2e4 * 3.141592653589793 / 10800.0, 5e-8),
        ("compliance_rad_per_Nm", 5e-5, 5e-8),
        ("compliance [rad/Nmm]", 5e-8, 5e-8),
    ],
)
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_the_header_says_the_unit(tmp_path, column, value, compliance, mark):
    found = table(tmp_path, f"\ufeffjoint{mark}{column}\r\nj2{mark}{value!r}\r\n")
    part = next(part for part in found.document["parts"] if part["name"] == "j2")
    assert part["compliance_rad_per_Nmm"] == pytest.approx(compliance, rel=1e-14)


def test_a_sliding_joint_has_its_own_columns(tmp_path):
    sliding = arm(j2=joint("j2", "l1", "l2", "prismatic"))
    found = table(tmp_path, "joint,stiffness [N/m],rotor [kg]\nj2,5e6,7\n", sliding)
    part = next(part for part in found.document["parts"] if part["name"] == "j2")
    assert (part["compliance_mm_per_N"], part["rotor_kg"]) == (pytest.approx(2e-4, rel=1e-14), 7.0)


HEAD = "joint,stiffness_Nm_per_rad,stiffness_N_per_mm,lateral_1_rad_per_Nmm,lateral_2_rad_per_Nmm\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "arm.stiffness.csv: is empty: begin with a line of columns"),
        ("joint,stifness_Nm_per_rad\n", "line 1: the column 'stifness_Nm_per_rad' is not known; did you mean"),
        ("joint,stiffness\n", "line 1: the column 'stiffness' is not known"),
        ("stiffness_Nm_per_rad\n", "line 1: the columns stiffness_Nm_per_rad: give joint, and each one once"),
        (f"{HEAD}j1,soft\n", "line 2, column stiffness_Nm_per_rad: 'soft' is no number: write it as 31000.5"),
        (f"{HEAD}j1,nan\n", "line 2, column stiffness_Nm_per_rad: "),
        (f"{HEAD}j1,-3\n", "line 2, column stiffness_Nm_per_rad: "),
        (f"{HEAD}j1,3,4\n", "line 2: has stiffness_Nm_per_rad and stiffness_N_per_mm: give one of them"),
        (f"{HEAD}j1,,4\n", "joint 'j1' has stiffness_N_per_mm, but it turns"),
        (f"{HEAD}j1,3,,1e-9\n", "line 2: has lateral_1_rad_per_Nmm alone: give both lateral columns"),
        (f"{HEAD}j1,3,,1e-9,-1\n", "line 2, column lateral_2_rad_per_Nmm: '-1' must be finite and not"),
        (f"{HEAD}j1,3\n\nj1,4\n", "line 4, column joint: 'j1' is there already: give each joint one line"),
        (f"{HEAD},3\n", "line 2, column joint: is empty: name the joint"),
        (f"{HEAD}j1,1,2,3,4,5\n", "line 2: has 6 cells, and the table has 5 columns"),
    ],
)
def test_a_refusal_of_a_table_names_line_and_column(tmp_path, text, says):
    with pytest.raises(ModelFileError) as refused:
        table(tmp_path, text)
    assert says in str(refused.value)
    assert str(refused.value).startswith("arm.stiffness.csv: ")
    assert "\n" not in str(refused.value)


def test_two_files_beside_one_description_are_refused(tmp_path):
    (tmp_path / "arm.stiffness.toml").write_text(GIVEN)
    (tmp_path / "arm.stiffness.csv").write_text(f"{HEAD}j1,3\n")
    file = str(written(tmp_path, arm()))
    assert "arm.stiffness.toml and arm.stiffness.csv both stand beside arm.urdf: keep one" in refused(
        "import", file, "--out", tmp_path / "a.toml"
    )
    words = ["import", file, "--stiffness", str(tmp_path / "arm.stiffness.csv"), "--out", str(tmp_path / "a.toml")]
    validate(*words)
