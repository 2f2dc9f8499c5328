"""URDFs: the imported machine against Pinocchio's reading of the same file, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.toml_text import toml_text
from vjm.io.urdf import import_urdf
from vjm.tree.equilibria import equilibria, unloaded_frames
from vjm.tree.model import TreeModel

DATA = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots"
ROBOTS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", "tool0"),
    "panda": ("panda_description/urdf/panda.urdf", "panda_link8"),
    "z1": ("z1_description/urdf/z1.urdf", "link06"),
    "tiago": ("tiago_description/robots/tiago.urdf", "wrist_ft_tool_link"),
    "talos": ("talos_data/robots/talos_left_arm.urdf", "gripper_left_base_link"),
}
WEIGHT = (0.0, 0.0, -9.81)


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_stand_and_weigh_what_pinocchio_says(name: str):
    file, tip = DATA / ROBOTS[name][0], ROBOTS[name][1]
    found = import_urdf(file)
    document = found.document
    # a tip of one's own, to compare
    document["ends"] = {"tip": import_end(document, file, tip)}
    model = TreeModel(build_chain(document, "m.toml"))
    robot = pinocchio.buildModelFromUrdf(str(file), mimic=True)
    robot.gravity.linear = np.array(WEIGHT)
    data = robot.createData()
    rng = np.random.default_rng(0)
    angles = {joint: rng.uniform(-1.0, 1.0) for joint in model.joints}
    q = model.coordinates(angles)[0]
    pinocchio.framesForwardKinematics(robot, data, configuration(robot, angles))
    expected = data.oMf[robot.getFrameId(tip)]
    R, p = unloaded_frames(model, q)
    # URDFs are read to 1e-9 mm
    assert p[0, 0] == pytest.approx(1e3 * expected.translation, abs=1e-6)
    assert R[0, 0] == pytest.approx(expected.rotation, abs=1e-9)
    # an arm without mimics: its torques, the springs' deflections being made small by a light world
    light = 1e-9
    torques = equilibria(model, q, gravity=(0.0, 0.0, -9.81 * light)).torques[0] / light
    gravity = pinocchio.computeGeneralizedGravity(robot, data, configuration(robot, angles))
    for joint, torque in zip(model.joints, torques, strict=True):
        index = robot.getJointId(joint)
        if index < robot.njoints and robot.joints[index].nv == 1:
            unit = 1.0 if robot.joints[index].shortname().startswith("JointModelP") else 1e3
            assert torque == pytest.approx(
                unit * gravity[robot.joints[index].idx_v], abs=1e-5 * np.abs(torques).max()
            )


def configuration(robot, angles):
    q = pinocchio.neutral(robot)
    for name, angle in angles.items():
        joint = robot.joints[robot.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        else:
            q[joint.idx_q] = angle / 1e3 if joint.shortname().startswith("JointModelP") else angle
    return q


def import_end(document, file, tip):
    """The last part on the way to a link: that of an import which ends there."""
    return import_urdf(file, tip).document["parts"][-1]["name"]


def write(tmp_path: Path, joints: str, links: str = "") -> Path:
    file = tmp_path / "robot.urdf"
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    body = "".join(
        f'<link name="{n}"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>{inertia}</inertial></link>'
        for n in "abc"
    )
    file.write_text(f'<robot name="r">{body}{links}{joints}</robot>')
    return file


def joint(name, parent, child, kind="revolute", more='<axis xyz="0 0 1"/>'):
    limit = '<limit lower="-1" upper="2" effort="1" velocity="1"/>' if kind in ("revolute", "prismatic") else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0 0" rpy="0 0 0.5"/>{limit}{more}</joint>'
    )


def test_a_mimic_joint_is_coupled(tmp_path):
    more = '<axis xyz="0 0 1"/><mimic joint="one" multiplier="-2" offset="0.1"/>'
    found = import_urdf(write(tmp_path, joint("one", "a", "b") + joint("two", "b", "c", more=more)))
    chain = build_chain(found.document, "m.toml")
    assert toml_text(found.document)
    two = next(part for part in chain.parts if part.name == "two")
    assert (two.ratios, two.offset) == ((("one", -2.0),), 0.1)
    assert found.to_fill_in == ["one"]
    one = next(part for part in chain.parts if part.name == "one")
    assert one.limits == (-1.0, 2.0)


def test_a_missing_mesh_is_left_out_and_said(tmp_path):
    mesh = '<link name="d"><visual><geometry><mesh filename="package://no/such.stl"/></geometry></visual></link>'
    joints = joint("one", "a", "b") + joint("two", "b", "c") + joint("three", "c", "d", "fixed", "")
    found = import_urdf(write(tmp_path, joints, mesh))
    assert any("meshes" in line for line in found.left_out)
    assert build_chain(found.document, "m.toml").name == "r"


@pytest.mark.parametrize(
    ("joints", "says"),
    [
        (joint("one", "a", "b") + joint("two", "b", "c", "floating", ""), "joint 'two' is floating"),
        (joint("one", "a", "b") + joint("two", "b", "c") + joint("three", "a", "c"), "link 'c' has two parents"),
        (joint("one", "a", "b"), "has 2 links without a parent"),
        (joint("one", "a", "b") + joint("two", "c", "c"), "its own ancestor"),
        (joint("one", "a", "b") + joint("two", "b", "d"), "names the link 'd', which is not there"),
        (joint("one", "a", "b") + joint("two", "b", "c", more='<axis xyz="0 0 0"/>'), "axis of length zero"),
        (
            joint("one", "a", "b") + joint("two", "b", "c", more='<axis xyz="0 0 1"/><mimic joint="two"/>'),
            "joint 'two' mimics itself",
        ),
        ("<joint", "is no XML that can be read"),
    ],
)
def test_refusal(tmp_path, joints, says):
    with pytest.raises(ModelFileError) as caught:
        import_urdf(write(tmp_path, joints))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_tip_is_said(tmp_path):
    with pytest.raises(ModelFileError, match="no link 'bb'; did you mean 'b'"):
        import_urdf(write(tmp_path, joint("one", "a", "b") + joint("two", "b", "c")), "bb")
