"""Calibrations of Universal Robots: their driver's kinematics and their controller's offsets are one machine."""

import math

import numpy as np
import pytest
from helpers.serial_arms import about_y, dh_matrix, end_by_hand, end_of, postures, rpy_frame

from vjm.io.dh_table import DhRow, SerialChain, dh_table
from vjm.io.errors import ModelFileError
from vjm.io.machine_file import load_model
from vjm.io.model_file import build_chain
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import serial_chain
from vjm.io.ur_calibration import JOINTS, LINKS, kinematics_text, nominal_table, not_held, read_nested
from vjm.model.machine import Machine

NAMES = [f"{joint}_joint" for joint in JOINTS]
UR5E = """kinematics:
  shoulder:
    x: 0
    y: 0
    z: 0.1625
    roll: -0
    pitch: 0
    yaw: -0
  upper_arm: {x: 0, y: 0, z: 0, roll: 1.570796327, pitch: 0, yaw: 0}
  forearm: {x: -0.425, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}
  wrist_1: {x: -0.3922, y: 0, z: 0.1333, roll: 0, pitch: 0, yaw: 0}
  # the two that follow were made by ur_calibration, with its rounding
  wrist_2: {x: 0, y: -0.0997, z: -2.044881182297852e-11, roll: 1.570796327, pitch: 0, yaw: 0}
  wrist_3:
    x: 0
    y: 0.0996
    z: -2.042830148012698e-11
    roll: 1.570796326589793
    pitch: 3.141592653589793
    yaw: 3.141592653589793
  hash: calib_12788084448423163542
"""
"""The nominal UR5e as ur_description has it, m and rad."""


def imported(file, **options) -> Machine:
    return build_chain(import_robot(Description(file, **options)).document, file.name)


def calibrated(seed: int) -> SerialChain:
    """A UR5e whose frames are off by tenths of a millimetre and of a milliradian, as built."""
    rng = np.random.default_rng(seed)
    steps = [step.frame for step in nominal_table("ur5e").steps()]
    for step in steps[1:-1]:
        step[:] = step @ rpy_frame(rng.normal(size=3) * 0.3, rng.normal(size=3) * 4e-4)
    return SerialChain("ur5e", tuple(DhRow(name) for name in NAMES), tuple(steps))


def end_of_chain(chain: SerialChain, q) -> np.ndarray:
    T = chain.steps[0]
    for name, step in zip(NAMES, chain.steps[1:], strict=True):
        T = T @ rpy_frame([0.0] * 3, [0.0, 0.0, q[name]]) @ step
    return T


def offsets(chain: SerialChain) -> tuple[str, list[dict[str, float]]]:
    """The controller's file of a calibrated arm, and the rows that it makes, mm and rad."""
    rows, nominal = dh_table(chain, "dh", "offsets").rows, nominal_table("ur5e").rows
    deltas = {
        key: [(getattr(row, key) - getattr(one, key)) / unit for row, one in zip(rows, nominal, strict=True)]
        for key, unit in (("theta", 1.0), ("a", 1e3), ("d", 1e3), ("alpha", 1.0))
    }
    text = "[mounting]\n" + "".join(f"delta_{key} = [ {', '.join(map(repr, d))} ]\n" for key, d in deltas.items())
    text += "joint_checksum = [ 0xb3, 0xb1 ]\ncalibration_status = 2 # 2 == Linearised\n"
    made = [
        {key: getattr(one, key) + deltas[key][k] * (1e3 if key in "ad" else 1.0) for key in deltas}
        for k, one in enumerate(nominal)
    ]
    return text, made


@pytest.mark.parametrize("seed", range(10))
def test_a_controller_s_offsets_are_read_without_loss(tmp_path, seed):
    """Hundreds of metres cancel: by the textbooks' matrices in more digits, and as the arm was built."""
    chain = calibrated(seed)
    text, rows = offsets(chain)
    assert max(abs(row["d"]) for row in rows) > 1e4
    file = tmp_path / "calibration.conf"
    file.write_text(text)
    found = import_robot(Description(file, ur_type="ur5e"))
    machine = build_chain(found.document, file.name)
    for q in postures(machine, np.random.default_rng(seed), 10):
        ours = end_of(machine, q)
        by_hand = end_by_hand("dh", rows, [q[name] for name in NAMES], [False] * 6).astype(float)
        # the file's offsets of 1e6 mm are doubles, rounded by 1e-10 mm
        assert np.abs(ours - by_hand).max() < 1e-9
        assert np.abs(ours - end_of_chain(chain, q)).max() < 1e-8
    # links are of the arm's size: a2, a3 and d4 of the nominal arm, but for what it is off by
    links = {part["name"]: part["translation_mm"] for part in found.document["parts"] if part["kind"] == "link"}
    long = [np.linalg.norm(links[f"{name}-origin"]) for name in NAMES[1:]]
    assert long == pytest.approx([162.5, 425.0, 392.2, 133.3, 99.7], abs=2.0)
    (said,) = [line for line in found.notes.changed if "nearly parallel" in line]
    assert "the frames of elbow_joint, wrist_1_joint were moved" in said
    assert "left out: [mounting] joint_checksum, calibration_status" in found.notes.lines()
    assert not any("is it in" in line for line in found.notes.lines())


def test_the_driver_s_nominal_kinematics_are_the_maker_s_table(tmp_path):
    (tmp_path / "default_kinematics.yaml").write_text(UR5E)
    found = import_robot(Description(tmp_path / "default_kinematics.yaml"))
    machine = build_chain(found.document, "m.toml")
    assert [joint.name for joint in machine.moving] == NAMES
    assert "left out: the hash of the controller's calibration, calib_12788084448423163542" in found.notes.lines()
    a, d = [0.0, -425.0, -392.2, 0.0, 0.0, 0.0], [162.5, 0.0, 0.0, 133.3, 99.7, 99.6]
    alpha = [math.pi / 2, 0.0, 0.0, math.pi / 2, -math.pi / 2, 0.0]
    for q in postures(machine, np.random.default_rng(0), 20):
        T = np.eye(4)
        for k, name in enumerate(NAMES):
            T = T @ dh_matrix(q[name], d[k], a[k], alpha[k])
        # their file has a quarter turn with ten digits
        assert np.abs(end_of(machine, q) - T.astype(float)).max() < 1e-6


def test_the_nominal_ur10_is_that_of_the_library():
    found = dh_table(serial_chain(load_model("ur10")), "dh").rows
    for row, nominal in zip(found, nominal_table("ur10").rows, strict=True):
        for key in ("a", "d", "alpha", "theta"):
            assert getattr(row, key) == pytest.approx(getattr(nominal, key), abs=1e-12)


def test_the_nominal_ur30_is_that_of_ur_description(tmp_path):
    text = UR5E
    # config/ur30/default_kinematics.yaml
    for old, new in (("0.1625", "0.2363"), ("0.425", "0.637"), ("0.3922", "0.5037"), ("0.1333", "0.201"),
                     ("0.0997", "0.1593"), ("0.0996", "0.1543")):  # fmt: skip
        text = text.replace(old, new)
    (tmp_path / "ur30.yaml").write_text(text)
    for row, nominal in zip(
        dh_table(serial_chain(imported(tmp_path / "ur30.yaml")), "dh").rows, nominal_table("ur30").rows, strict=True
    ):
        for key in ("a", "d", "alpha", "theta"):
            # their file has a quarter turn with ten digits, and metres with 1e-11 of rounding
            assert getattr(row, key) == pytest.approx(getattr(nominal, key), abs=1e-6)


def test_urcontrol_conf_has_the_table_itself(tmp_path):
    file = tmp_path / "urcontrol.conf"
    text = (
        "[DH]\na = [0.00000, -0.42500, -0.3922, 0, 0, 0]\nd = [0.1625, 0, 0, 0.1333, 0.0997, 0.0996]\n"
        "alpha = [ 1.5707963267948966, 0, 0, 1.5707963267948966, -1.5707963267948966, 0 ]\n"
        "q_home_offset = [0, -1.570796327, 0, -1.570796327, 0, 0]\n"
    )
    file.write_text(text)
    found = import_robot(Description(file))
    machine = build_chain(found.document, file.name)
    chain = serial_chain(machine)
    assert dh_table(chain, "dh").rows == nominal_table("ur5e").rows
    assert "left out: [DH] q_home_offset" in found.notes.lines()
    assert "doubtful: the file has no [mounting]: this is the nominal arm" in found.notes.lines()
    # the two files in one
    arm = calibrated(4)
    file.write_text(text + offsets(arm)[0])
    q = dict(zip(NAMES, [0.1, -1.2, 1.3, 0.4, 0.5, 0.6], strict=True))
    assert np.abs(end_of(imported(file), q) - end_of_chain(arm, q)).max() < 1e-8


def test_kinematics_come_back_and_are_yaml(tmp_path):
    yaml = pytest.importorskip("yaml", reason="PyYAML, the other reader of the file, is not installed")
    arm = calibrated(5)
    text = kinematics_text(arm)
    tables = yaml.safe_load(text)["kinematics"]
    assert list(tables) == [*LINKS, "hash"]
    file = tmp_path / "calibration.yaml"
    file.write_text(text)
    machine = imported(file)
    for q in postures(machine, np.random.default_rng(5), 10):
        T = np.eye(4)
        for link, name in zip(LINKS, NAMES, strict=True):
            one = tables[link]
            where = [1e3 * one[key] for key in "xyz"]
            T = T @ rpy_frame(where, [one[key] for key in ("roll", "pitch", "yaw")])
            T = T @ rpy_frame([0.0] * 3, [0.0, 0.0, q[name]])
        assert np.abs(T - end_of_chain(arm, q)).max() < 1e-9
        assert np.abs(end_of(machine, q) - T).max() < 1e-9
    # as ur_calibration has it: no offset between nearly parallel axes
    assert tables["forearm"]["z"] == 0.0
    assert kinematics_text(serial_chain(machine)).splitlines()[-1].startswith("  hash: vjm_")


def test_a_tool_that_kinematics_do_not_hold_is_said():
    chain = calibrated(6)
    tool = rpy_frame([10.0, 0.0, 100.0], [0.2, 0.0, 0.0])
    with_tool = SerialChain("ur5e", chain.joints, (*chain.steps[:-1], chain.steps[-1] @ tool))
    assert not any("tool" in line for line in not_held(chain))
    (said,) = [line for line in not_held(with_tool) if "tool" in line]
    assert said.startswith("the tool behind wrist_3, at ")


@pytest.mark.parametrize("count", [5, 7])
def test_another_number_of_joints_is_no_arm_of_theirs(count):
    joints = tuple(DhRow(f"j{k}", slides=k == 4) for k in range(count))
    with pytest.raises(ValueError, match=f"has {count} joints, of which j4 slide"):
        kinematics_text(SerialChain("arm", joints, (np.eye(4),) * (count + 1)))


CONF = "[mounting]\n" + "".join(f"delta_{key} = [0, 0, 0, 0, 0, 0]\n" for key in ("theta", "a", "d", "alpha"))


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (CONF, {}, "name the arm's type, --ur-type ur5e"),
        (CONF, {"ur_type": "ur50"}, "no type 'ur50' is known; did you mean 'ur5"),
        (CONF.replace("delta_a ", "delta_b "), {"ur_type": "ur5"}, "[mounting] delta_a is missing: add it"),
        (CONF.replace("[0, 0, 0, 0, 0, 0]", "[0, 0, 0]", 1), {"ur_type": "ur5"}, "must be a list of six numbers"),
        (CONF.replace("[0, ", "[x, ", 1), {"ur_type": "ur5"}, "delta_theta is 'x', which is no number"),
        (CONF.replace("[0, ", "[inf, ", 1), {"ur_type": "ur5"}, "delta_theta is 'inf', which is no number"),
        ("[Hardware]\na = 1\n", {}, "has neither [mounting] with delta_theta"),
        ("a = 1\n", {}, "File contains no section headers"),
        (CONF + "[DH]\na = [0, 0, 0, 0, 0, 0]\n", {"ur_type": "ur5"}, "leave out --ur-type"),
        (CONF + "[DH]\na = [0, 0, 0, 0, 0, 0]\n", {}, "[DH] d is missing: add it"),
    ],
)  # fmt: skip
def test_a_wrong_conf_is_refused_in_one_line(tmp_path, text, options, said):
    refused(tmp_path / "calibration.conf", text, options, said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (UR5E.replace("kinematics", "dynamics"), "has no 'kinematics' with the frames shoulder, upper_arm"),
        (UR5E.replace("forearm", "fore_arm"), "kinematics has no 'forearm': give its x, y, z"),
        (UR5E.replace("    z: 0.1625\n", ""), "shoulder has no z: add it"),
        (UR5E.replace("z: 0.1625", "z: 0,1625"), "shoulder: z is '0,1625', which is no number"),
        (UR5E.replace("z: 0.1625", "z:"), "shoulder has no z: add it"),
        (UR5E.replace("    z: 0.1625", "    z 0.1625"), "line 5: 'z 0.1625' is not read: write 'key: value'"),
        (UR5E.replace("    y: 0", "    x: 0"), "line 4: 'x' stands twice"),
        (UR5E.replace("    y: 0", "    w: 0"), "shoulder has the unknown key 'w'"),
        (UR5E.replace("    y: 0", "\ty: 0"), "line 4: 'y: 0' is not read"),
        (UR5E.replace("z: 0, roll: 1.570796327, pitch: 0, yaw: 0}", "z: 0,", 1), "line 9: a table in braces"),
        (UR5E.replace("{x: 0, y: 0", "{x 0, y: 0", 1), "line 9: 'x 0' is not read"),
        ("", "has no 'kinematics'"),
    ],
)  # fmt: skip
def test_a_wrong_yaml_is_refused_in_one_line(tmp_path, text, said):
    refused(tmp_path / "calibration.yaml", text, {}, said)


def refused(file, text, options, said):
    file.write_text(text)
    with pytest.raises(ModelFileError) as error:
        import_robot(Description(file, **options))
    assert said in str(error.value)
    assert str(error.value).startswith(file.name)


def test_what_is_read_of_yaml_is_what_a_yaml_reader_reads():
    yaml = pytest.importorskip("yaml", reason="PyYAML, the other reader of the file, is not installed")

    def texts(table):
        return {key: texts(one) if isinstance(one, dict) else one for key, one in table.items()}

    text = "---\n" + UR5E + "  more:\n      deep: 'quoted'  # said\nother: \"x\"\n"
    assert read_nested(text, "a") == texts(yaml.load(text, yaml.BaseLoader))


def test_hayati_s_angle_by_hand():
    """A row's β stands behind its α: a turn about the y that α has left."""
    T = end_by_hand("dh", [{"theta": 0.0, "d": 0.0, "a": 1.0, "alpha": 0.3, "beta": 0.2}], [0.0], [False])
    assert np.allclose(T.astype(float), (dh_matrix(0.0, 0.0, 1.0, 0.3) @ about_y(0.2)).astype(float), atol=0.0)
