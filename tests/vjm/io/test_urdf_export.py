"""A machine written as a URDF: Pinocchio finds the same frames and torques in it as in the file it came from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from vjm.io.manipulator_file import load_model
from vjm.io.model_file import build_chain
from vjm.io.urdf import import_urdf
from vjm.io.urdf_text import left_out, urdf_text
from vjm.tree.equilibria import unloaded_frames
from vjm.tree.model import TreeModel

DATA = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots"
# what a file of ours keeps of a URDF's lengths and axes: 1e-9 mm
LENGTH = 1e-9
# a slider that follows a turn, 30 mm for each radian, and a turn that follows a slider
MIXED = """<robot name="mixed"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
<joint name="one" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="two" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
<mimic joint="one" multiplier="0.03" offset="0.2"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="three" type="revolute"><parent link="c"/><child link="d"/><axis xyz="0 1 0"/>
<mimic joint="one" multiplier="-2" offset="0.1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>"""


def random_configuration(robot, rng):
    angles = {name: rng.uniform(-0.5, 0.5) for name in robot.names[1:]}
    q = pinocchio.neutral(robot)
    for name, angle in angles.items():
        joint = robot.joints[robot.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        elif joint.nq == 1:
            q[joint.idx_q] = angle
    return q


@pytest.mark.parametrize(
    "file",
    [
        "ur_description/urdf/ur10_robot.urdf",
        "panda_description/urdf/panda.urdf",
        "tiago_description/robots/tiago.urdf",
    ],
)
def test_the_robot_written_is_the_robot_read(tmp_path, file):
    chain = build_chain(import_urdf(DATA / file).document, "m.toml")
    (tmp_path / "written.urdf").write_text(urdf_text(chain))
    read, written = (
        pinocchio.buildModelFromUrdf(str(path), mimic=True) for path in (DATA / file, tmp_path / "written.urdf")
    )
    assert set(written.names) == set(read.names)
    data = read.createData(), written.createData()
    rng = np.random.default_rng(1)
    q = random_configuration(read, rng)
    q2 = pinocchio.neutral(written)
    for name in read.names[1:]:
        one, other = read.joints[read.getJointId(name)], written.joints[written.getJointId(name)]
        if one.nq == 2:  # a continuous joint, written with limits of a whole turn
            q2[other.idx_q] = np.arctan2(q[one.idx_q + 1], q[one.idx_q])
        elif one.nq == 1:
            q2[other.idx_q] = q[one.idx_q]
    pinocchio.forwardKinematics(read, data[0], q)
    pinocchio.forwardKinematics(written, data[1], q2)
    torques = [
        pinocchio.computeGeneralizedGravity(m, d, v) for m, d, v in zip((read, written), data, (q, q2), strict=True)
    ]
    for name in read.names[1:]:
        i, j = read.getJointId(name), written.getJointId(name)
        assert np.abs(data[0].oMi[i].translation - data[1].oMi[j].translation).max() < LENGTH
        if read.joints[i].nv == 1:
            ours, theirs = torques[1][written.joints[j].idx_v], torques[0][read.joints[i].idx_v]
            assert ours == pytest.approx(theirs, abs=1e-9 * np.abs(torques[0]).max())


def test_couplings_of_a_slider_with_a_turn_keep_their_units(tmp_path):
    (tmp_path / "mixed.urdf").write_text(MIXED)
    chain = build_chain(import_urdf(tmp_path / "mixed.urdf").document, "m.toml")
    (tmp_path / "written.urdf").write_text(urdf_text(chain))
    again = build_chain(import_urdf(tmp_path / "written.urdf").document, "m.toml")
    frames = [
        unloaded_frames(model := TreeModel(c), model.coordinates({"one": 0.4})[0])[1][0] for c in (chain, again)
    ]
    # two = 200 + 30·0.4 = 212 mm along x, turned by 0.4
    assert frames[0][0] == pytest.approx([212.0 * np.cos(0.4), 212.0 * np.sin(0.4), 0.0], abs=1e-9)
    assert frames[1][0] == pytest.approx(frames[0][0], abs=1e-9)


def test_what_is_left_out_is_said():
    said = " ".join(left_out(load_model("planar-2r")))
    for part in ("shoulder", "upper", "elbow", "fore"):
        assert part in said
    assert "inertia" in said
    assert "stretched" in said
