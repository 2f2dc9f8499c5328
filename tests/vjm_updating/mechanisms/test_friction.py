"""Friction in the joints: one joint in closed form, and the chain with joints that stand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, tabulate
from vjm_updating.mechanisms.hysteresis import friction_torques
from vjm_updating.mechanisms.modified_chain import ModifiedChain


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


def test_joints_deflect_reciprocally():
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


def masing(amplitudes, give, limit, presliding, way=60):
    """Torques along a course between reversals, by Masing's rule (1926) from the first loading, and its steps.

    The first loading of spring and slider in series on an elastic chain is a straight line up to the limit; every
    branch behind a reversal is the first loading at twice its size, once the loop is closed.
    """
    rate = 1.0 / (give + presliding / limit)
    course, torque = [np.linspace(0.0, amplitudes[0], way)], []
    torque.append(-np.minimum(rate * course[0], limit))
    for start, end in itertools.pairwise(amplitudes):
        course.append(np.linspace(start, end, way))
        gone = 0.5 * np.abs(course[-1] - start)
        torque.append(torque[-1][-1] + np.sign(start - end) * 2.0 * np.minimum(rate * gone, limit))
    return np.concatenate(course), np.concatenate(torque)


def test_an_elastic_contact_has_prandtls_loop():
    give, limit, presliding, amplitude = 0.25, 4.0, 0.6, 3.0
    free, expected = masing([amplitude, -amplitude, amplitude], give, limit, presliding)
    n = len(free)
    tau = friction_torques(
        free[:, None], np.full((n, 1, 1), give), limit, np.arange(n) == 0, np.zeros((n, 1)), presliding
    )[:, 0]
    # straight lines: rounding
    np.testing.assert_allclose(tau, expected, atol=1e-12)
    # the joint turns as the spring of its contact does before it slips, and back, from rest without a torque
    turn = free + give * tau
    assert tau[1] / turn[1] == pytest.approx(-limit / presliding, rel=1e-12)
    back = n // 3
    assert (tau[back + 1] - tau[back]) / (turn[back + 1] - turn[back]) == pytest.approx(
        -limit / presliding, rel=1e-9
    )
    # a parallelogram 2 μ high; the slip is the turn but for the spring's, to and fro
    loop = slice(n // 3, n)
    area = -np.trapezoid(tau[loop], turn[loop])
    slip = 2.0 * (amplitude - give * limit - presliding)
    # a corner is cut by the steps, 60 over 6 rad: half a step times what the torque changes in it, at two corners
    step, rate = 2.0 * amplitude / 59, 1.0 / (give + presliding / limit)
    assert area == pytest.approx(2.0 * limit * slip, abs=2 * 0.5 * step * step * rate)


def test_elastic_contacts_dissipate_only_where_they_slip():
    rng = np.random.default_rng(5)
    free = np.cumsum(0.7 * rng.standard_normal((60, 3)), axis=0)
    root = rng.standard_normal((3, 3))
    give = np.tile(root @ root.T + 0.3 * np.eye(3), (60, 1, 1))
    limit, presliding = np.array([0.4, 0.7, 1.2]), 0.5
    tau = friction_torques(free, give, limit, np.arange(60) == 0, np.zeros((60, 3)), presliding)
    turn = free + np.einsum("nij,nj->ni", give, tau)
    slip = np.diff(np.vstack([np.zeros(3), turn + tau * presliding / limit]), axis=0)
    slips = np.abs(slip) > 1e-6
    assert 20 < slips.sum() < 160
    # the iteration ends at 1e-9 of the torques
    np.testing.assert_allclose(tau[slips], (-np.sign(slip) * limit)[slips], atol=1e-8)
    assert np.abs(tau).max() <= 1.2 + 1e-12


def test_stiff_contacts_are_coulombs():
    rng = np.random.default_rng(2)
    free = np.cumsum(rng.standard_normal((40, 3)), axis=0)
    root = rng.standard_normal((3, 3))
    give = np.tile(root @ root.T + np.eye(3), (40, 1, 1))
    own = (0.7, np.arange(40) == 0, np.zeros((40, 3)))
    rigid = friction_torques(free, give, *own)
    for presliding in (1e-2, 1e-4, 1e-6):
        error = np.abs(friction_torques(free, give, *own, presliding) - rigid).max()
        # of first order in the presliding; A is 1 at least and torques are 0.7, and three joints share them
        assert presliding * 0.01 < error < presliding * 3.0
