"""Postures of a tool pose: all of a planar arm's and a UR10's, and what is out of reach."""

import numpy as np
import pytest

from vjm.io.model_file import load_chain
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset
from vjm.rotations import AXES, translation
from vjm.tree.equilibria import unloaded_frames
from vjm.tree.inverse_kinematics import ReachError, postures_of
from vjm.tree.model import TreeModel


def planar() -> TreeModel:
    parts: list = []
    for name, length in (("shoulder", 500.0), ("elbow", 400.0)):
        parts.append(Joint(name, AXES["z"], compliance=1e-8))
        parts.append(RigidOffset(f"after-{name}", translation([length, 0.0, 0.0])))
    return TreeModel(Machine("planar", tuple(parts)))


def test_a_planar_arm_has_two_elbows():
    found = postures_of(planar(), np.array([600.0, 300.0, 0.0]))
    # the law of cosines
    elbow = np.arccos((600.0**2 + 300.0**2 - 500.0**2 - 400.0**2) / (2.0 * 500.0 * 400.0))
    assert sorted(q[1] for q in found) == pytest.approx([-elbow, elbow], abs=1e-8)


def test_out_of_reach_is_said_with_the_distance():
    with pytest.raises(ReachError, match=r"out of reach.* misses it by 100 mm"):
        postures_of(planar(), np.array([0.0, 1000.0, 0.0]))


def test_ur10_takes_a_pose_in_eight_ways():
    chain = load_chain("ur10")
    model = TreeModel(chain)
    R, p = unloaded_frames(model, model.posture("work"))
    found = postures_of(model, p[0, 0], R[0, 0])
    # limits of a whole turn either way: what differs by one is one
    assert len(found) == 8
    for q in found:
        R1, p1 = unloaded_frames(model, q)
        assert p1 == pytest.approx(p, abs=1e-5)
        assert R1 == pytest.approx(R, abs=1e-8)
    assert min(np.abs(q - model.posture("work")).max() for q in found) < 1e-6


def test_an_unknown_end_frame_is_said():
    with pytest.raises(ValueError, match="no end frame 'hand'"):
        postures_of(planar(), np.zeros(3), end="hand")
