"""The two files of a test of poses: orientation by every convention, and one line for what cannot be used."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from helpers.from_files import prepared
from helpers.small_machines import GRIPPER
from helpers.urdf_arm import arm, import_urdf, joint
from hidden_effects.poses.injector import Hidden, rest
from hidden_effects.poses.robots import PLANAR, SEVEN, document, sheet_text

from vjm.io.files import toml_text
from vjm.io.findings import Grade
from vjm.io.model_file import build_chain
from vjm.machine.equilibria import unloaded_frames
from vjm.model.mechanism import Mechanism
from vjm.rotations import rotation_from_vector, rotation_vector
from vjm_updating.poses.kinds import read_test
from vjm_updating.poses.measurement import rotation_by
from vjm_updating.poses.plausibility import considered
from vjm_updating.poses.state import Hypothesis

NOISE_RAD = 1e-4


def test_conventions_of_orientation():
    a, b, c = 0.3, -0.7, 1.1
    X, Y, Z = (rotation_from_vector(v) for v in np.diag([a, b, c]))
    assert np.allclose(rotation_by("fixed xyz", np.array([a, b, c])), Z @ Y @ X, atol=1e-14)
    assert np.allclose(rotation_by("moving xyz", np.array([a, b, c])), X @ Y @ Z, atol=1e-14)
    # half the angle about z as a unit quaternion, scaled by two
    assert np.allclose(
        rotation_by("quaternion", 2.0 * np.array([np.cos(c / 2), 0, 0, np.sin(c / 2)])), Z, atol=1e-14
    )
    with pytest.raises(ValueError, match="length zero"):
        rotation_by("quaternion", np.zeros(4))


def test_tracked_orientation_fits_to_its_noise(tmp_path):
    rng = np.random.default_rng(2)
    q = rng.uniform(-1.9, 1.9, (40, 7))
    T = rest(SEVEN, Hidden.nothing(7), q)
    view, own = rotation_from_vector([0.4, -1.0, 0.8]), rotation_from_vector([1.0, 0.5, -0.3])
    rows = []
    for posture, frame in zip(q, T, strict=True):
        turned = rotation_from_vector(rng.normal(0.0, NOISE_RAD, 3)) @ view @ frame[:3, :3] @ own
        rows.append(
            [
                *posture,
                *(view @ frame[:3, 3] + [5.0, 6.0, 7.0] + rng.normal(0.0, 0.05, 3)),
                *rotation_vector(turned),
            ]
        )
    header = [*(f"joint-{i}.q_rad" for i in range(1, 8)), *(f"target.{n}" for n in ("x_mm", "y_mm", "z_mm"))]
    header += [f"target.r{a}_rad" for a in "xyz"]
    text = "\n".join(",".join(map(repr, map(float, row))) for row in rows)
    (tmp_path / "readings.csv").write_text(",".join(header) + "\n" + text + "\n")
    (tmp_path / "model.toml").write_text(toml_text(document(SEVEN)))
    sheet = sheet_text(SEVEN, 0.05).replace("sigma_mm = 200.0", 'sigma_mm = 200.0\norientation = "rotation vector"')
    (tmp_path / "sheet.toml").write_text(sheet + f"noise_rad = {NOISE_RAD}\n")
    _, study = prepared(tmp_path / "readings.csv", tmp_path / "sheet.toml")
    state = study.gauss_newton(Hypothesis())
    # 120 angles, six of them spent on frames: the estimate's own standard deviation is 7 %
    assert np.sqrt(np.mean(state.linearised.residual[..., 3:] ** 2)) == pytest.approx(NOISE_RAD, rel=0.25)
    assert np.sqrt(np.mean(state.linearised.residual[..., :3] ** 2)) == pytest.approx(0.05, rel=0.25)


CSV = "joint-1.q_rad,joint-2.q_rad,target.x_mm,target.y_mm,target.z_mm\n0.1,0.2,1,2,3\n"


@pytest.mark.parametrize(
    ("csv", "change", "said"),
    [
        (CSV.replace("joint-2", "joint-3"), None, "readings.csv: column 'joint-3.q_rad': the model has no joint"),
        (CSV.replace("joint-2.q_rad", "joint-2.q_mm"), None, "column 'joint-2.q_rad' is missing, which turns"),
        (CSV.replace("target.x_mm,", "tarket.x_mm,"), None, "no marker 'tarket': add [markers.tarket]"),
        (CSV.replace("0.1,0.2", "0.1,x"), None, "row 2, column joint-2.q_rad: 'x' is no number"),
        (CSV.replace("0.1,0.2", "0.1,"), None, "no row has all joints and a marker"),
        (
            CSV.replace("z_mm", "z_mm,target.x_std_mm").replace("1,2,3", "1,2,3,-0.1"),
            None,
            "row 2, column target.x_std_mm: a standard deviation is not negative",
        ),
        (
            CSV.replace(",target.z_mm", "").replace("1,2,3", "1,2"),
            None,
            "readings.csv: column 'target.z_mm' is missing: without it the tracker's frame cannot be found: add it",
        ),
        (CSV.replace("1,2,3", "1,,3"), None, "readings.csv: column 'target.y_mm' is blank"),
        (CSV, ("noise_mm", "nose_mm"), "sheet.toml: "),
        (
            CSV,
            ("sigma_mm = 200.0", 'on = "hand"'),
            "sheet.toml: [markers.target] on = 'hand' is no part of the model",
        ),
        (CSV, ('"model.toml"', '"robot.urdf"'), "sheet.toml: [test] model: no file robot.urdf beside the sheet"),
        (CSV, ("gravity = [0.0, -9.81, 0.0]", "gravity = [0.0, -9810.0, 0.0]"), "write it in m/s²"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(csv, change, said, tmp_path):
    (tmp_path / "readings.csv").write_text(csv)
    (tmp_path / "model.toml").write_text(toml_text(document(PLANAR)))
    sheet = sheet_text(PLANAR, 0.05)
    if change:
        assert change[0] in sheet
        sheet = sheet.replace(*change)
    (tmp_path / "sheet.toml").write_text(sheet)
    with pytest.raises(ValueError) as caught:
        prepared(tmp_path / "readings.csv", tmp_path / "sheet.toml")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def urdf_test(folder, second: str) -> None:
    """A robot of two joints, the second one as given, with a sheet and readings of it."""
    (folder / "robot.urdf").write_text(arm(j1=joint("joint-1", "base", "l1", axis="0 0 1"), j2=second))
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (30, 2))
    robot = Mechanism(build_chain(import_urdf(folder / "robot.urdf").document, "m").split())
    stands = unloaded_frames(robot, q)[1][:, 0]
    rows = "".join(",".join(map(repr, map(float, row))) + "\n" for row in np.hstack([q, stands]))
    (folder / "readings.csv").write_text(CSV.split("\n")[0] + "\n" + rows)
    (folder / "sheet.toml").write_text(sheet_text(PLANAR, 0.05).replace('"model.toml"', '"robot.urdf"'))


def test_what_is_doubtful_in_a_urdf_is_doubted_of_the_test(tmp_path):
    urdf_test(tmp_path, joint("joint-2", "l1", "l2", origin='<origin xyz="0.3 0 0" rpy="90 0 0"/>'))
    measurement, study = prepared(tmp_path / "readings.csv", tmp_path / "sheet.toml")
    assert ["is beyond a whole turn" in doubt for doubt in measurement.model.doubts] == [True]
    found = [str(one) for one in considered(measurement, study) if one.grade is Grade.DOUBTFUL]
    assert any("sheet.toml, model robot.urdf: joint 'joint-2'" in line for line in found)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("robot.stiffness.toml", "[joints.joint-1]\nstiffness_Nm_per_rad = 25000.0\n"),
        ("robot.stiffness.csv", "joint,stiffness [Nm/rad]\njoint-1,25000\n"),
    ],
)
def test_the_stiffness_beside_a_urdf_is_that_of_the_sheet_s_robot(tmp_path, name, text):
    urdf_test(tmp_path, joint("joint-2", "l1", "l2"))
    (tmp_path / name).write_text(text)
    measurement, study = prepared(tmp_path / "readings.csv", tmp_path / "sheet.toml")
    compliances = {one.name: one.compliance for one in measurement.model.chain.held_joints}
    assert compliances["joint-1"] == pytest.approx(4e-8, rel=1e-14)
    found = [str(one) for one in considered(measurement, study) if one.grade is Grade.NOTED]
    assert any(f"the stiffness of joint-1 is that of {name}" in line for line in found)
    assert set(measurement.model.chain.files) >= {"robot.urdf", name}


def test_a_mimic_stands_beside_its_master_as_logs_have_it(tmp_path):
    (tmp_path / "robot.urdf").write_text(GRIPPER)
    sheet = tmp_path / "sheet.toml"
    sheet.write_text(
        'kind = "poses"\n[test]\nmodel = "robot.urdf"\nrigid = true\n[markers.target]\n[tracker]\nnoise_mm = 0.1\n'
    )
    q = np.linspace(-1.0, 1.0, 12)
    rows = [f"{a:.6f},{0.1 - a:.6f},{300 * np.cos(a):.6f},{20 * a:.6f},{-300 * np.sin(a):.6f}" for a in q]
    header = "lift.q_rad,level.q_rad,target.x_mm,target.y_mm,target.z_mm\n"
    (tmp_path / "readings.csv").write_text(header + "\n".join(rows) + "\n")
    measurement, _ = prepared(tmp_path / "readings.csv", sheet)
    assert measurement.data.joints == ("lift",)
    assert measurement.data.q[:, 0] == pytest.approx(q, abs=1e-6)  # six digits were written
    rows[4] = rows[4].replace(f"{0.1 - q[4]:.6f}", f"{0.3 - q[4]:.6f}")
    (tmp_path / "readings.csv").write_text(header + "\n".join(rows) + "\n")
    with pytest.raises(ValueError, match=r"readings\.csv: row 6, column 'level\.q_rad': .* of lift: correct"):
        prepared(tmp_path / "readings.csv", sheet)


def test_postures_drawn_keep_the_limits_of_a_coupled_joint(tmp_path):
    low, high = -0.5, 0.5
    parts = GRIPPER.rpartition('lower="-3" upper="3"')
    (tmp_path / "robot.urdf").write_text(f'{parts[0]}lower="{low}" upper="{high}"{parts[2]}')
    sheet = tmp_path / "sheet.toml"
    sheet.write_text(
        'kind = "poses"\n[test]\nmodel = "robot.urdf"\nrigid = true\n[markers.target]\n[tracker]\nnoise_mm = 0.1\n'
    )
    q = np.linspace(-1.0, 1.0, 12)
    rows = [f"{a:.6f},{300 * np.cos(a):.6f},{20 * a:.6f},{-300 * np.sin(a):.6f}" for a in q]
    header = "lift.q_rad,target.x_mm,target.y_mm,target.z_mm\n"
    (tmp_path / "readings.csv").write_text(header + "\n".join(rows) + "\n")
    study = read_test(tmp_path / "readings.csv", sheet).study
    lift = study.drawn(np.random.default_rng(1), 200).q[:, 0]
    assert len(lift) == 200
    level = 0.1 - lift
    assert low <= level.min() < 0.9 * low
    assert 0.9 * high < level.max() <= high


def test_a_candidate_beyond_a_joints_limits_is_refused_by_name(tmp_path):
    """The UR10's joints go a whole turn either way: 2π = 6.28319 rad."""
    example = resources.files("vjm_validation") / "examples/ur10-poses"
    test = read_test(Path(str(example / "readings.csv")), Path(str(example / "sheet.toml")))
    file = tmp_path / "next.csv"
    header = ",".join(f"{joint}.q_rad" for joint in test.study.machine.joints)
    file.write_text(f"{header}\n0,0,0,0,0,0\n0,0,6.2,0,0,0\n", encoding="utf-8")
    assert test.candidates(file).q[1, 2] == 6.2
    file.write_text(f"{header}\n0,0,0,0,0,0\n0,0,6.5,0,0,0\n", encoding="utf-8")
    with pytest.raises(
        ValueError, match=r"posture 2: out of reach: elbow = 6.5 exceeds its limit 6.28319 by 0.2168"
    ):
        test.candidates(file)
