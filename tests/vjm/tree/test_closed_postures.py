"""Machines with closed loops: postures by pose and by drives, compensation, and paths of a free end under load."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.closed_machines import MACHINES
from helpers.virtual_work import Statics, posture_values

import vjm
from vjm.compensation import compensated_arm
from vjm.engines import VjmEngine
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.machine.inverse_kinematics import ClosedPostures, ReachError, postures_of
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.mechanism import Mechanism
from vjm.postures import in_posture

CLOSED = 1e-9
"""mm and rad: loops and poses are closed to 1e-11 of some hundred mm."""


@pytest.fixture(scope="module")
def palletiser() -> Mechanism:
    return VjmEngine(1).model(vjm.load("palletiser"))


def gaps(model: Mechanism, q: np.ndarray) -> np.ndarray:
    return RigidMechanism(model.chain).linearised(q[None])[0]


def test_a_tool_position_is_reached_with_the_loop_closed(palletiser):
    place = unloaded_frames(palletiser, palletiser.posture("home"))[1][0, 0] + [12.0, -7.0, 20.0]
    (q,) = postures_of(palletiser, place)
    assert unloaded_frames(palletiser, q)[1][0, 0] == pytest.approx(place, abs=CLOSED)
    assert np.abs(gaps(palletiser, q)).max() < CLOSED


def test_drives_take_the_passive_joints_along(palletiser):
    closed = ClosedPostures(palletiser, palletiser.posture("home"))
    q = closed.driven({"shoulder": -1.2, "lever-drive": 0.3})
    assert q[palletiser.joints.index("shoulder")] == -1.2
    # the rod stays parallel to the upper arm, and the forearm to the lever
    assert q[palletiser.joints.index("elbow")] == pytest.approx(1.5, abs=1e-8)
    assert np.abs(gaps(palletiser, q)).max() < CLOSED
    with pytest.raises(ReachError, match="lever-drive = 5 exceeds its limit"):
        closed.driven({"lever-drive": 5.0})


def test_a_pose_of_fewer_freedoms_lets_the_end_turn():
    machine, label = in_posture(vjm.load("palletiser"), (5.0, 3.0, -4.0))
    model = Mechanism(machine)
    moved, home = (unloaded_frames(model, model.posture(each))[1][0, 0] for each in (label, "home"))
    assert moved - home == pytest.approx([5.0, 3.0, -4.0], abs=CLOSED)


def test_drives_put_the_loaded_end_of_a_closed_machine_right(palletiser):
    home = unloaded_frames(palletiser, palletiser.posture("home"))[1][0, 0]
    places = home + np.array([[0.0, 0.0, 0.0], [10.0, 5.0, 0.0]])
    found = compensated_arm(palletiser, places, None, np.zeros((2, 6)), gravity=(0.0, 0.0, -9.81))
    assert np.linalg.norm(found.rigid[:, :3], axis=1).min() > 0.1
    assert np.abs(found.loaded[:, :3]).max() < 1e-7
    for q in found.q_loaded:
        assert np.abs(gaps(palletiser, q)).max() < CLOSED
    at = equilibria(palletiser, found.q_loaded, gravity=(0.0, 0.0, -9.81))
    assert at.position[:, 0] == pytest.approx(places, abs=1e-7)


@pytest.mark.parametrize("name", ["four_bar", "two_legs", "coupled"])
def test_a_path_of_a_free_end_moves_it_as_virtual_work_does(name: str):
    chain = MACHINES[name]()
    push = np.array([3.0, -5.0, 4.0, 0.0, 0.0, 0.0])
    case = LoadCase("p", 1.0, "load", loads=(Load(tuple(push)),), free=COMPONENTS, steps=2)
    point = vjm.trace(chain, case, "vjm-paper").points[-1]
    own = Statics(chain, posture_values(chain, "p"), wrenches={"": push}).solve()
    size = np.repeat(np.abs(own.displacements[""].reshape(2, 3)).max(axis=1), 3)
    # residuals of 1e-11, times a condition of 1e5
    assert np.abs((point.displacement - own.displacements[""]) / size).max() < 1e-6
    assert point.stiffness == pytest.approx(own.stiffness[""], rel=1e-5, abs=1e-6 * np.abs(own.stiffness[""]).max())
