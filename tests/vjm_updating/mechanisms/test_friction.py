"""Friction in the joints: one joint in closed form, and the chain with joints that stand."""

from __future__ import annotations

import numpy as np
import pytest

from vjm.io.model_file import load_chain
from vjm.vjm_engine import VjmEngine
from vjm_updating.mechanisms.friction_loop import friction_torques
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.path_table import HalfRay, tabulate


def test_one_joint_sticks_slips_and_sticks_again():
    free = np.array([0.0, 1.0, 3.0, 2.5, 1.0, -3.0])[:, None]
    give = np.full((6, 1, 1), 0.5)
    begins = np.arange(6) == 0
    tau = friction_torques(free, give, 4.0, begins, np.zeros((6, 1)))[:, 0]
    # stands to 1 (torque 2), slips at 4; back: q = 1, stands until the torque has turned, then slips at −4… +4
    np.testing.assert_allclose(tau, [0.0, -2.0, -4.0, -3.0, 0.0, 4.0], atol=1e-6)


def test_torque_never_exceeds_the_limit_and_opposes_the_turn():
    rng = np.random.default_rng(1)
    free = np.cumsum(rng.standard_normal((40, 3)), axis=0)
    root = rng.standard_normal((3, 3))
    give = np.tile(root @ root.T + np.eye(3), (40, 1, 1))
    tau = friction_torques(free, give, 0.7, np.arange(40) == 0, np.zeros((40, 3)))
    assert np.abs(tau).max() <= 0.7 + 1e-12
    q = free + np.einsum("nij,nj->ni", give, tau)
    turn = np.diff(np.vstack([np.zeros(3), q]), axis=0)
    turning = np.abs(turn) > 1e-6
    # dissipation: a joint that turns is at its limit against the turn
    np.testing.assert_allclose(tau[turning], -0.7 * np.sign(turn[turning]), atol=1e-6)


def test_joints_give_way_reciprocally():
    machine = ModifiedChain(load_chain("orthoglide-chain"), VjmEngine(4))
    table = tabulate(machine, HalfRay("B", (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0), pulls=True)
    q, A, B = table.yielding
    # rounding, 8e-15
    np.testing.assert_allclose(A, A.transpose(0, 2, 1), rtol=0.0, atol=1e-13 * np.abs(A).max())
    assert np.linalg.eigvalsh(A).min() > -1e-12
    # Betti: a torque's wrench along x is the joints' turn by a displacement along x, turned
    rate = np.gradient(q, table.s, axis=0)
    np.testing.assert_allclose(B[5:-5, 0], -rate[5:-5], rtol=5e-3, atol=1e-7)


def test_no_friction_no_torque():
    assert not friction_torques(np.ones((3, 2)), np.ones((3, 2, 2)), 0.0, np.zeros(3, bool), np.zeros((3, 2))).any()


@pytest.mark.parametrize("limit", [1e6])
def test_strong_friction_holds_the_joints(limit):
    free = np.array([[0.0, 0.0], [0.1, -0.2]])
    give = np.tile(np.array([[2.0, 0.5], [0.5, 1.0]]), (2, 1, 1))
    tau = friction_torques(free, give, limit, np.array([True, False]), np.zeros((2, 2)))
    # 1.3e-11 of torques of 1e3 N mm
    np.testing.assert_allclose(free[1] + give[1] @ tau[1], 0.0, atol=1e-9)
