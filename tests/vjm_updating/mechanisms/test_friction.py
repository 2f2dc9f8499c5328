"""Friction in the joints: one joint in closed form, and the chain with joints that stand."""

import itertools

import numpy as np
import pytest
from helpers import pinned_bar

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, tabulate
from vjm_updating.mechanisms.hysteresis import Creep, friction_torques
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, beam_of
from vjm_updating.mechanisms.relaxation import Relaxation, relaxing
from vjm_updating.mechanisms.series_elements import History, balance


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
    machine = ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(4))
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


# A beam that relaxes against closed forms, the softer beam, and an independent bar that is integrated in time.


PUSH = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def machine():
    return ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(8))


class Rig:
    """A machine pushed and pulled along x in one posture."""

    def __init__(self, machine, posture, reach, back=0.01):
        self.machine, self.posture = machine, posture
        self.tables = [
            tabulate(machine, HalfRay(posture, tuple(sign * PUSH), far), pulls=True)
            for sign, far in ((1.0, reach), (-1.0, back))
        ]

    def history(self, time):
        return History(
            time,
            np.arange(len(time)) == 0,
            np.tile(self.machine.line(self.posture), (len(time), 1)),
            np.zeros((len(time), 3)),
        )

    def relaxed(self, time, s, relaxation):
        """Fall of the force that pushes ``(n,)`` at places on the ray."""
        ray = (np.arange(len(s)), PUSH, *self.tables)
        return -relaxing([ray], self.history(time), relaxation)(np.outer(s, PUSH)) @ PUSH


@pytest.mark.parametrize("fraction", [0.01, 0.4])
def test_a_beam_in_a_linear_chain_is_a_spring_in_series_with_a_standard_linear_solid(machine, fraction):
    # 2 µm: the chain is linear up to 1e-5
    rig = Rig(machine, "A", 2e-3)
    time, rate, tau = np.linspace(0.0, 40.0, 21), 1e-4, 7.0
    s = rate * np.minimum(time, 20.0)
    beam = beam_of(machine.nominal, "link")
    k = rig.tables[0].stiffness[0, 0, 0]
    alpha = k * beam.length / beam.effective_section().EA
    assert 0.05 < alpha < 0.5
    # N = k (u − x), x' = (c φ/(1 − φ) N − x) (1 − φ)/τ, c the link's own compliance
    relaxes = (1.0 - fraction * (1.0 - alpha)) / tau
    most = alpha * fraction / tau / relaxes
    ramp = lambda t: rate * (t - (1.0 - np.exp(-relaxes * t)) / relaxes)  # noqa: E731
    late = np.maximum(time - 20.0, 0.0)
    up = ramp(np.minimum(time, 20.0))
    x = most * (s[-1] + (up - s[-1]) * np.exp(-relaxes * late)) * (time > 20.0) + most * up * (time <= 20.0)
    found = rig.relaxed(time, s, Relaxation("link", (fraction,), (tau,)))
    # the sum of exponentials is exact for ramps; the table's own curvature is the residual
    np.testing.assert_allclose(found, k * x, rtol=0.0, atol=1e-4 * k * x.max())


def test_two_terms_in_a_chain_relax_to_the_end_and_begin_as_they_must():
    shares, times = Relaxation("link", (0.2, 0.1), (5.0, 60.0)).within(0.3)
    # Laplace: M/(1 − 0.7 M) with M = 0.2/(1 + 5p) + 0.1/(1 + 60p), at p = 0, p → ∞ and between; rounding
    for p in (0.0, 0.01, 0.3, 1e7):
        M = 0.2 / (1.0 + 5.0 * p) + 0.1 / (1.0 + 60.0 * p)
        assert np.sum(shares / (1.0 + times * p)) == pytest.approx(M / (1.0 - 0.7 * M), rel=1e-9)
    # a part that is all the chain has relaxes by its own times
    np.testing.assert_allclose(sorted(Relaxation("link", (0.2, 0.1), (5.0, 60.0)).within(1.0)[1]), [5.0, 60.0])


@pytest.mark.parametrize("fraction", [pytest.param(0.03, marks=pytest.mark.slow), 0.3])
def test_a_relaxing_drive_is_the_drive_with_an_element(machine, fraction):
    c = 1e-4
    built_in = ModifiedMachine(machine.nominal.with_actuator_compliance(c), machine.engine)
    rig = Rig(built_in, "B", 1.0)
    time = np.linspace(0.0, 60.0, 31)
    s = np.interp(time, [0.0, 20.0, 40.0, 60.0], [0.0, 1.0, 1.0, 0.0])
    drive = built_in.drive
    values = (fraction, 6.0, 0.25, 6.0)
    elements = Creep("actuator", c).elements(built_in, values)

    def look(u):
        W, K = rig.tables[0].at(u @ PUSH)
        return W + np.einsum("nij,nj->ni", K, u - np.outer(u @ PUSH, PUSH)), K

    with_element = balance(look, np.outer(s, PUSH), elements, rig.history(time)).wrench
    fall = look(np.outer(s, PUSH))[0] @ PUSH - with_element @ PUSH
    found = rig.relaxed(time, s, Relaxation(drive.name, (0.75 * fraction, 0.25 * fraction), (6.0, 36.0)))
    # measured 0.0020 and 0.026, of second order: the drive's share of the compliance changes with the load
    np.testing.assert_allclose(found, fall, rtol=0.0, atol=0.11 * fraction * fall.max())


@pytest.mark.parametrize(("posture", "bifurcates"), [("A", True), ("B", False)])
@pytest.mark.parametrize("part", ["foot", "link"])
def test_what_has_relaxed_is_the_softer_beam(machine, posture, bifurcates, part):
    rig = Rig(machine, posture, 3.0)
    s = np.linspace(0.0, 2.85, 40)[1:]
    fraction = 0.01
    softer = Rig(machine.times(part, 1.0 / (1.0 - fraction)), posture, 3.0)
    fall = (rig.tables[0].at(s)[0] - softer.tables[0].at(s)[0]) @ PUSH
    found = rig.relaxed(1e3 * np.arange(1.0, len(s) + 1.0), s, Relaxation(part, (fraction,), (1e-3,)))
    ends = sorted(table.bifurcation for table in (rig.tables[0], softer.tables[0]))
    assert np.isfinite(ends[0]) == bifurcates
    # a link that is relaxed buckles earlier than a fresh one, which stays straight until then
    same = (s < ends[0]) | (s > ends[1]) | (part == "foot")
    assert (s > ends[1]).sum() == (2 if bifurcates else 0)
    # measured 4e-5 for the foot, 1e-3 and, behind the bifurcation, 5e-3 for the link: of second order in 0.01; the
    # first reading is fresh
    np.testing.assert_allclose(found[same][1:], fall[same][1:], rtol=0.0, atol=0.01 * fall.max())


@pytest.fixture(scope="module")
def bar():
    """What the bar lacks against an elastic one, beyond buckling and back, by share."""
    time = np.linspace(0.0, 80.0, 801)
    s = np.interp(time, [0.0, 20.0, 40.0, 60.0], [0.0, 0.1, 0.1, 0.0])
    elastic = pinned_bar.push(time, s)
    times = (8.0, 48.0)
    falls = {f: elastic - pinned_bar.push(time, s, (0.7 * f, 0.3 * f), times) for f in (0.003, 0.01, 0.1)}
    return time[::10], s[::10], {f: fall[::10] for f, fall in falls.items()}, times


@pytest.mark.parametrize(("fraction", "error"), [(0.003, 0.015), (0.01, 0.015), (0.1, 0.03)])
def test_a_bar_beyond_buckling_relaxes_as_one_that_is_integrated_in_time(bar, fraction, error):
    time, s, falls, times = bar
    rig = Rig(ModifiedMachine(load_chain("pinned-column"), VjmEngine(16)), "straight", 0.105)
    found = rig.relaxed(time, s, Relaxation("link", (0.7 * fraction, 0.3 * fraction), times))
    fall = falls[fraction]
    # measured 0.006, 0.009 and 0.017: 0.005 is of the two bars, whose buckling loads differ by 0.0004, the rest of
    # second order in the share
    np.testing.assert_allclose(found, fall, rtol=0.0, atol=error * fall.max())
    # led back through the bifurcation its bow takes most; by its force alone a straight bar would lack 0.4 of that
    assert 50.0 <= time[np.argmax(fall)] <= 56.0
    straight = 0.5 * fraction * pinned_bar.BUCKLES * pinned_bar.EA / pinned_bar.LENGTH
    assert fall.max() > 2.0 * straight
