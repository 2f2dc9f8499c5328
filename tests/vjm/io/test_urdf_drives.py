"""Rotors and gains of URDFs: transmissions of ROS, ROS 2, the PR2 and Drake, and Pinocchio's list."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest
from helpers.as_pinocchio import ROBOTS
from helpers.urdf_arm import arm, imported, joint, parts, said, written

from vjm.io.model_file import build_chain
from vjm_validation.cli.main import run

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


def test_the_command_says_it(tmp_path, capsys):
    file = written(tmp_path, arm(more=SIMPLE + control('<param name="p">250</param>', name="j1")))
    assert run(["import", str(file), "--out", str(tmp_path / "a.toml")]) == 0
    heard = capsys.readouterr().out
    assert "j1 (kp 250)" in heard
    assert "to be filled in, placeholders now: the compliance of j2" in heard
