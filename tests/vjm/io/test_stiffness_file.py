"""Files of joint stiffness beside robots' descriptions."""

from __future__ import annotations

import pytest
from helpers.urdf_arm import arm, written

from vjm.io.errors import ModelFileError
from vjm.io.machine_file import load_model
from vjm.io.model_file import build_chain
from vjm.io.robot_document import PLACEHOLDER
from vjm.io.robot_file import Description, import_robot
from vjm_validation.cli.main import run

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


def test_the_command_takes_another_file(tmp_path, capsys):
    file = written(tmp_path, arm())
    other = tmp_path / "gears.toml"
    other.write_text(GIVEN)
    assert run(["import", str(file), "--stiffness", str(other), "--out", str(tmp_path / "a.toml")]) == 0
    said = capsys.readouterr().out
    assert "the stiffness of j1, j2 is that of gears.toml" in said
    assert "to be filled in" not in said
    assert run(["import", str(file), "--stiffness", str(tmp_path / "no"), "--out", str(tmp_path / "b.toml")]) == 2
    assert "cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["ur10", "planar-2r"])
def test_a_urdf_and_its_file_bring_the_drives_back(tmp_path, name, capsys):
    files = tmp_path / "robot.urdf", tmp_path / "robot.stiffness.toml"
    assert run(["export", name, "--urdf", str(files[0]), "--stiffness", str(files[1])]) == 0
    assert "robot.stiffness.toml: what deflects in the drives" in capsys.readouterr().out
    again = build_chain(import_robot(Description(files[0])).document, "robot.toml")
    given = [(j.name, j.compliance, j.lateral, j.rotor) for j in load_model(name).held_joints]
    assert any(compliance for _, compliance, _, _ in given)
    assert [(j.name, j.compliance, j.lateral, j.rotor) for j in again.held_joints] == given
