"""A machine written as a URDF and read again is the machine: axes, frames, masses, limits, couplings."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from helpers.as_pinocchio import ROBOTS
from helpers.command import validate
from helpers.same_machine import masses, same
from helpers.urdf_arm import LIMIT, arm, import_urdf, imported, joint, link, parts, said, written

from vjm.design.modes import modes
from vjm.io.errors import ModelFileError
from vjm.io.machine_file import build_machine, load_model
from vjm.io.manipulator_file import legs_folder
from vjm.io.model_file import build_chain, library, read_document
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import mjcf_text, urdf_text
from vjm.io.robot_text import urdf_leaves_out as left_out
from vjm.model.machine import Machine

FILES = sorted(file.relative_to(ROBOTS).as_posix() for file in ROBOTS.rglob("*.urdf"))
NO_MACHINES = ("alex_psyonic_hands", "iris_simple", "quadrotor_base", "ur3")
CHAINS = [entry.name for entry in library()]
ROUNDTRIPS = {".urdf": urdf_text, ".xml": mjcf_text}


def again(tmp_path: Path, chain: Machine, suffix: str) -> Machine:
    file = tmp_path / f"written{suffix}"
    file.write_text(ROUNDTRIPS[suffix](chain), encoding="utf-8")
    return build_chain(import_robot(Description(file)).document, file.name)


@pytest.mark.parametrize("name", CHAINS)
def test_a_library_machine_comes_back(tmp_path, name):
    chain = load_model(name)
    assert isinstance(chain, Machine)
    back = again(tmp_path, chain, ".urdf")
    same(chain, back)
    assert masses(back) == masses(chain)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("file", [file for file in FILES if Path(file).stem not in NO_MACHINES])
def test_an_imported_robot_comes_back(tmp_path, file):
    chain = build_chain(import_urdf(ROBOTS / file).document, "m.toml")
    back = again(tmp_path, chain, ".urdf")
    same(chain, back)
    assert masses(back) == masses(chain)


@pytest.mark.parametrize(
    "text",
    [
        arm(j2=joint("j2", "l1", "l2", more='<mimic joint="j1" multiplier="0.1" offset="0.3"/>')),
        arm(
            j2=joint(
                "j2", "l1", "l2", "prismatic", more=LIMIT + '<mimic joint="j1" multiplier="0.07" offset="0.1"/>'
            )
        ),
        arm(j1=joint("j1", "base", "l1", more='<mimic joint="j2" multiplier="-0.5"/>' + LIMIT)),
        arm(j2=joint("j2", "l1", "l2", "prismatic", more="")),
        arm(j2=joint("j2", "l1", "l2", "prismatic", more='<limit lower="-0.07" upper="0.14"/>')),
        arm(j2=joint("j2", "l1", "l2", axis="-1 0.3 0.7")),
        arm(more=link("base-body") + joint("tool-fixed", "l2", "base-body", "fixed", axis="", more="")),
    ],
)
def test_an_odd_machine_comes_back(tmp_path, text):
    chain = build_chain(import_urdf(written(tmp_path, text)).document, "m.toml")
    back = again(tmp_path, chain, ".urdf")
    same(chain, back)
    assert masses(back) == masses(chain)


def test_pinocchio_reads_what_is_written(tmp_path):
    """Of the machine with two arms, which has the most joints with limits, mimics and continuous ones."""
    file = next(ROBOTS.rglob("tiago_dual.urdf"))
    chain = build_chain(import_urdf(file).document, "m.toml")
    (tmp_path / "written.urdf").write_text(urdf_text(chain))
    read, back = (pinocchio.buildModelFromUrdf(str(path)) for path in (file, tmp_path / "written.urdf"))
    assert set(back.names) == set(read.names)
    datas = read.createData(), back.createData()
    rng = np.random.default_rng(1)
    q, q2 = pinocchio.neutral(read), pinocchio.neutral(back)
    for name in read.names[1:]:
        angle = rng.uniform(-0.5, 0.5)
        for model, values in ((read, q), (back, q2)):
            one = model.joints[model.getJointId(name)]
            values[one.idx_q : one.idx_q + one.nq] = [angle] if one.nq == 1 else [np.cos(angle), np.sin(angle)]
    torques = [
        pinocchio.computeGeneralizedGravity(model, data, values)
        for model, data, values in zip((read, back), datas, (q, q2), strict=True)
    ]
    for name in read.names[1:]:
        i, j = read.getJointId(name), back.getJointId(name)
        pinocchio.forwardKinematics(read, datas[0], q)
        pinocchio.forwardKinematics(back, datas[1], q2)
        assert datas[0].oMi[i].translation == pytest.approx(datas[1].oMi[j].translation, abs=1e-14)
        ours, theirs = torques[1][back.joints[j].idx_v], torques[0][read.joints[i].idx_v]
        assert ours == pytest.approx(theirs, abs=1e-12 * np.abs(torques[0]).max())


def test_what_is_left_out_is_said():
    said = " ".join(left_out(load_model("planar-2r")))
    for part in ("shoulder", "upper", "elbow", "fore"):
        assert part in said
    assert "inertia" in said
    assert "stretched" in said
    assert "q1, q2, q3, q4 move freely" in " ".join(left_out(load_model("orthoglide-chain")))


# Rotors and gains of URDFs: transmissions of ROS, ROS 2, the PR2 and Drake, and Pinocchio's list.


ROUNDED = 1e-15
"""Relative: two products of doubles."""
SIMPLE = (
    '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="j2"/>'
    '<actuator name="m"><mechanicalReduction>-50</mechanicalReduction><rotorInertia>4e-5</rotorInertia></actuator>'
    "</transmission>"
)
ROS2 = (
    '<ros2_control name="r" type="system"><transmission name="t"><plugin>x</plugin>'
    '<actuator name="m" role="a"><motor_inertia>4e-5</motor_inertia></actuator>'
    '<joint name="j2" role="j"><mechanical_reduction>50</mechanical_reduction></joint></transmission>'
    "</ros2_control>"
)
PR2 = (
    '<transmission type="SimpleTransmission" name="t"><actuator name="m"/>'
    '<joint name="j2"/>'
    "<mechanicalReduction>50</mechanicalReduction><motorInertia>4e-5</motorInertia></transmission>"
)
DRAKE = (
    '<transmission><type>SimpleTransmission</type><joint name="j2"/><actuator name="m">'
    '<drake:gear_ratio value="50"/>'
    '<drake:rotor_inertia value="4e-5"/></actuator></transmission>'
)
PINOCCHIO = '<rotor_params><joint name="j2" mass="4e-5" gear_ratio="50"/></rotor_params>'


@pytest.mark.parametrize("given", [SIMPLE, ROS2, PR2, DRAKE, PINOCCHIO])
def test_a_rotor_counts_with_the_squared_ratio(tmp_path, given):
    found = imported(tmp_path, arm(more=given))
    # 4e-5 kg m² times 2500
    assert parts(found)["j2"]["rotor_kg_mm2"] == pytest.approx(0.1e6, rel=ROUNDED)
    assert "rotor_kg_mm2" not in parts(found)["j1"]
    assert (
        "changed: joint 'j2' has the inertia of its rotor, 4e-5 kg m² times the squared gear ratio 50, 0.1"
        in said(found)
    )
    for tag in ("nertia>", "eduction>", "gear_ratio>"):
        assert tag not in said(found)


def test_a_rotor_is_the_armature_that_pinocchio_reads(tmp_path):
    """Of the robot Talos, whose rotors its SRDF gives; Pinocchio adds them to the diagonal of the mass matrix."""
    srdf = (ROBOTS / "talos_data/srdf/talos.srdf").read_text()
    params = srdf[srdf.index("<rotor_params>") : srdf.index("</rotor_params>") + len("</rotor_params>")]
    urdf = ROBOTS / "talos_data/robots/talos_left_arm.urdf"
    robot = pinocchio.buildModelFromUrdf(str(urdf))
    pinocchio.loadRotorParameters(robot, str(ROBOTS / "talos_data/srdf/talos.srdf"))
    found = imported(tmp_path, urdf.read_text().replace("</robot>", f"{params}</robot>"))
    rotors = {one.name: one.rotor for one in build_chain(found.document, "t").held_joints}
    theirs = {
        name: 1e6 * robot.rotorInertia[robot.joints[k].idx_v] * robot.rotorGearRatio[robot.joints[k].idx_v] ** 2
        for k, name in enumerate(robot.names)
        if k
    }
    assert sum(map(bool, theirs.values())) > 3
    np.testing.assert_allclose([rotors[name] for name in theirs], list(theirs.values()), rtol=1e-15)


def test_a_sliding_joint_feels_a_mass(tmp_path):
    sliding = joint("j2", "l1", "l2", "prismatic")
    found = imported(tmp_path, arm(j2=sliding, more=SIMPLE))
    # 4e-5 kg m² at 50 rad/m
    assert parts(found)["j2"]["rotor_kg"] == pytest.approx(0.1, rel=ROUNDED)
    assert "squared gear ratio 50, 0.1 kg" in said(found)


def control(params: str, interface: str = "position", name: str = "j2") -> str:
    return (
        f'<ros2_control name="r" type="system"><joint name="{name}"><command_interface name="{interface}"/>{params}'
        "</joint></ros2_control>"
    )


def test_a_position_gain_is_the_compliance_of_the_drive(tmp_path):
    found = imported(tmp_path, arm(more=control('<param name="p">250</param><param name="i">3</param>')))
    # 250 N m/rad are 2.5e5 N mm/rad
    assert parts(found)["j2"]["compliance_rad_per_Nmm"] == pytest.approx(4e-6, rel=ROUNDED)
    assert found.to_fill_in == ["j1"]
    assert (
        "that of their controllers' position gains: j2 (kp 250, ki 3, which is not read). It has nothing"
        in said(found)
    )
    sliding = joint("j2", "l1", "l2", "prismatic")
    found = imported(tmp_path, arm(j2=sliding, more=control('<param name="kp">250</param>', "effort")))
    assert parts(found)["j2"]["compliance_mm_per_N"] == pytest.approx(4.0, rel=ROUNDED)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (SIMPLE.replace(">-50<", ">0<"), "the transmission 't' has a gear ratio of zero"),
        (SIMPLE.replace(">4e-5<", ">-4e-5<"), "has a rotor of -4e-5 kg m²: it must not be below zero"),
        (SIMPLE.replace(">4e-5<", ">4,5<"), "<rotorInertia>4,5</rotorInertia>, which is no number"),
        (SIMPLE.replace("<mechanicalReduction>-50</mechanicalReduction>", ""), "the ratio is taken as 1"),
        (SIMPLE.replace('<joint name="j2"/>', '<joint name="j2"/><joint name="j1"/>'), "has 2 joints: a rotor is"),
        (SIMPLE.replace('"j2"', '"j22"'), "names the joint 'j22', which is not there; did you mean 'j2'?"),
        (control('<param name="p">-3</param>'), "the ros2_control of joint 'j2' has a position gain of -3"),
        (control('<param name="p">3</param>', "velocity"), "has a gain, but takes velocity: no position is held"),
        (control('<param name="p">1e-9</param>'), "softer than any spring of a model file"),
    ],
)
def test_what_cannot_be_used_is_doubted_and_stops_no_import(tmp_path, given, says):
    found = imported(tmp_path, arm(more=given))
    assert says in said(found)
    assert "left out: arm.urdf: line 10: " in said(found) or "taken as 1" in says
    assert "j2" in found.to_fill_in


def test_a_ratio_alone_says_nothing_and_links_off_the_way_have_no_drive(tmp_path):
    plain = said(imported(tmp_path, arm()))
    alone = SIMPLE.replace("<rotorInertia>4e-5</rotorInertia>", "")
    assert "rotor" not in said(imported(tmp_path, arm(more=alone))) + plain
    found = imported(tmp_path, arm(more=SIMPLE), "l1")
    assert "rotor" not in " ".join(found.notes.changed)


def test_the_command_says_it(tmp_path):
    file = written(tmp_path, arm(more=SIMPLE + control('<param name="p">250</param>', name="j1")))
    heard = validate("import", file, "--out", tmp_path / "a.toml").out
    assert "j1 (kp 250)" in heard
    assert "to be filled in, placeholders now: the compliance of j2" in heard


# Moments of inertia in files: read, refused, written to a URDF and read again.


INERTIA = [900.0, 700.0, 400.0, 50.0, 20.0, -30.0]


def arm_with(**keys):
    """The library's arm of two joints, its tool with other keys."""
    content = deepcopy(read_document("planar-2r").content)
    tool = next(part for part in content["parts"] if part["name"] == "tool")
    tool.update(keys)
    return content


def test_a_payload_has_moments_of_inertia():
    chain = build_chain(arm_with(inertia_kg_mm2=INERTIA), "arm.toml")
    expected = [[900.0, 50.0, 20.0], [50.0, 700.0, -30.0], [20.0, -30.0, 400.0]]
    np.testing.assert_array_equal(chain.parts[-1].inertia, expected)
    # it turns with the tool
    light, heavy = (modes(c, "bent", number=3).frequencies for c in (build_chain(arm_with(), "arm.toml"), chain))
    assert np.all(heavy <= light * (1.0 + 1e-12))
    assert heavy[1] < light[1] * (1.0 - 1e-6)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([1.0, 1.0, 3.0, 0.0, 0.0, 0.0], "moments of no body"),
        ([-1.0, 1.0, 1.0, 0.0, 0.0, 0.0], "moments of no body"),
        ([1.0, 1.0, 1.0], "inertia_kg_mm2"),
    ],
)
def test_moments_that_no_body_has_are_refused(values, said):
    with pytest.raises(ModelFileError, match=said) as refused:
        build_chain(arm_with(inertia_kg_mm2=values), "arm.toml")
    assert "part 'tool'" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_moments_without_a_mass_are_refused():
    content = arm_with()
    content["parts"].append({"kind": "link", "name": "end", "inertia_kg_mm2": INERTIA})
    with pytest.raises(ModelFileError, match="has inertia_kg_mm2 but no mass_kg"):
        build_chain(content, "arm.toml")


def test_a_platform_has_moments_of_inertia():
    """With them a platform on six legs has six frequencies, without them three."""
    document = read_document("hexapod")
    content = deepcopy(document.content)
    content["platform"]["inertia_kg_mm2"] = [1e6, 1e6, 2e6, 0.0, 0.0, 0.0]
    machine = build_machine(document._replace(content=content), legs_folder("hexapod"))
    np.testing.assert_array_equal(machine.parts[-1].inertia, np.diag([1e6, 1e6, 2e6]))
    assert len(modes(machine).frequencies) == 6


def test_a_urdf_takes_and_gives_them_back(tmp_path):
    inertia = '<inertia ixx="0.02" ixy="0.002" ixz="-0.001" iyy="0.03" iyz="0.003" izz="0.025"/>'
    found = imported(tmp_path, arm(l2=link("l2", inertia=inertia)))
    chain = build_chain(found.document, "m.toml")
    again = build_chain(import_urdf(written(tmp_path, urdf_text(chain))).document, "m.toml")

    def moments(machine):
        return [part.inertia for part in machine.parts if getattr(part, "inertia", None) is not None]

    assert len(moments(chain)) == 2
    np.testing.assert_allclose(moments(again), moments(chain), rtol=1e-12)
    assert moments(chain)[1][0, 1] == 2000.0
    assert not any("inertia" in line for line in left_out(chain))
