"""Elements in series against the same thing built into the chain, and laws against their closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from vjm.continuation.load_grid import trace_grid
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.io.model_file import load_chain
from vjm.kernels.machine_solver import MachineSolver
from vjm.model.load_case import LoadCase
from vjm.statics import TOLERANCE
from vjm_updating.mechanisms.contacts import ActuatorBacklash, ContactCompliance, JointClearance
from vjm_updating.mechanisms.drives import ActuatorCompliance
from vjm_updating.mechanisms.effect import foot
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, beside, tabulate
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, bowed
from vjm_updating.mechanisms.series_elements import (
    AlongLine,
    History,
    SeriesElement,
    balance,
    force_on,
    memoryless,
    retarded,
    together,
    yielding,
)
from vjm_updating.mechanisms.structure import BaseCompliance, FootCompliance

X = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def machine():
    return ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(8))


def history_of(machine, posture, n, step=1.0):
    begins = np.zeros(n, dtype=bool)
    begins[0] = True
    line, lever = (np.tile(v, (n, 1)) for v in (machine.line(posture), machine.lever(posture)))
    return History(step * np.arange(n), begins, line, lever)


def look_of(machine, posture, reach):
    table = tabulate(machine, HalfRay(posture, X, reach), pulls=True)

    def look(u):
        W, K = table.at(u[:, 0])
        off = u - np.outer(u[:, 0], X)
        return W + np.einsum("nij,nj->ni", K, off), K

    return look


@pytest.mark.parametrize("posture", ["A", "B"])
def test_actuator_in_series_is_the_actuator_in_the_chain(machine, posture):
    c = 3e-5
    u = np.outer(np.linspace(0.05, 2.0, 12), X)
    chain = machine.nominal.with_actuator_compliance(c)
    built_in, K = look_of(ModifiedMachine(chain, machine.engine), posture, 2.2)(u)
    elements = ActuatorCompliance().elements(machine, (c,))
    found = balance(look_of(machine, posture, 2.2), u, elements, history_of(machine, posture, len(u)))
    # tables interpolate: 6e-5 N of some thousand, 7e-7 of the stiffness
    np.testing.assert_allclose(found.wrench[:, :3], built_in[:, :3], atol=3e-3)
    np.testing.assert_allclose(found.stiffness[:, 0, 0], K[:, 0, 0], rtol=3e-5)


def test_a_base_in_series_adds_its_compliance_at_the_end_of_the_lever():
    rng = np.random.default_rng(4)
    root = rng.standard_normal((6, 6)) * np.repeat([30.0, 3000.0], 3)[:, None]
    K = root @ root.T
    u = rng.standard_normal((7, 6)) * np.repeat([1.0, 0.01], 3)
    lever = 200.0 * rng.standard_normal((7, 3))
    history = History(np.zeros(7), np.arange(7) == 0, np.zeros((7, 3)), lever)
    machine = ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(8))
    elements = BaseCompliance().elements(machine, (1e-4, 2.0, 0.5, 6.0, 1.5, 0.7))
    found = balance(lambda v: (v @ K, np.tile(K, (len(v), 1, 1))), u, elements, history)
    about = 6e-4 / machine.nominal.characteristic_length**2
    base = np.diag([1e-4, 2e-4, 5e-5, about, 1.5 * about, 0.7 * about])
    for k, (x, y, z) in enumerate(lever):
        # a twist (shift, turn) of the base moves the tool by shift + turn × lever
        moved = np.eye(6)
        moved[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
        stiffness = np.linalg.inv(np.linalg.inv(K) + moved @ base @ moved.T)
        wrench = stiffness @ u[k]
        # of N and of 1e2 N mm alike; the condition of K, 1e7, times rounding
        error = (found.wrench[k] - wrench) / np.repeat([1.0, 100.0], 3)
        assert np.abs(error).max() < 1e-7 * np.abs(wrench[:3]).max()
        np.testing.assert_allclose(found.stiffness[k], stiffness, rtol=0.0, atol=1e-8 * np.abs(stiffness).max())


@pytest.mark.parametrize("posture", ["A", "B"])
def test_softer_foot_in_series_is_the_softer_foot(machine, posture):
    u = np.outer(np.linspace(0.05, 1.0, 8), X)
    softer = FootCompliance().machine(machine, (1.05,))
    built_in, _ = look_of(softer, posture, 1.1)(u)
    law = memoryless(lambda N: (0.05 * N, np.full_like(N, 0.05)))
    element = SeriesElement(foot(machine), law)
    found = balance(look_of(machine, posture, 1.1), u, [element], history_of(machine, posture, len(u)))
    change = built_in[:, 0] - look_of(machine, posture, 1.1)(u)[0][:, 0]
    # first order in the turns of foot and link
    np.testing.assert_allclose(found.wrench[:, 0] - built_in[:, 0], 0.0, atol=0.03 * np.abs(change).max())


def test_play_is_half_the_travel_lost(machine):
    look = look_of(machine, "A", 2.0)
    u = np.outer(np.linspace(0.5, 1.5, 5), X)
    for effect in (ActuatorBacklash(), JointClearance()):
        elements = effect.elements(machine, (0.04, 0.0, 5.0, 0.0))
        found = balance(look, u, elements, history_of(machine, "A", len(u)))
        expected, _ = look(u - np.outer(np.full(5, 0.02), X))
        np.testing.assert_allclose(found.wrench[:, 0], expected[:, 0], atol=0.1)


def test_play_bears_nothing_within_its_travel(machine):
    look = look_of(machine, "A", 2.0)
    u = np.outer(np.linspace(0.001, 0.015, 6), X)
    found = balance(
        look, u, ActuatorBacklash().elements(machine, (0.04, 0.0, 2.0, 0.0)), history_of(machine, "A", 6)
    )
    # by tanh(N/2) the travel is used up to 0.015/0.02 at 2 N
    assert np.abs(found.wrench[:, 0]).max() < 3.0


def test_ends_of_a_play_yield_like_contacts(machine):
    effect = ActuatorBacklash(force=1000.0)
    history = history_of(machine, "A", 6)
    N = np.array([-900.0, -30.0, -1.0, 0.5, 200.0, 1000.0])
    laws = [effect.elements(machine, (0.04, 0.1, 2.0, ends))[0].law for ends in (0.0, 0.25)]
    (hard, _), (soft, slope) = (law(N, history) for law in laws)
    # by a quarter of the travel at 1000 N; the force that crosses it rounds the power off at none
    expected = 0.25 * 0.04 * np.sign(N) * (np.abs(N) / 1000.0) ** (2.0 / 3.0)
    far = np.abs(N) > 20.0
    np.testing.assert_allclose((soft - hard)[far], expected[far], rtol=(2.0 / 20.0) ** 2)
    ahead, behind = (laws[1](N + h, history)[0] for h in (1e-4, -1e-4))
    np.testing.assert_allclose(slope, (ahead - behind) / 2e-4, rtol=1e-5)


@pytest.mark.parametrize("power", [1.3, 1.5, 1.8])
def test_a_play_that_ends_in_contacts_is_nearer_to_a_play_than_to_a_contact(machine, power):
    """Ends whose force grows as a power of how far they are pressed in: by a fifth of the travel at 1000 N."""
    N = np.concatenate([-np.geomspace(1000.0, 2.0, 30), np.geomspace(2.0, 1000.0, 30)])
    history = history_of(machine, "A", len(N))
    truth = np.sign(N) * (0.015 * np.tanh(np.abs(N) / 5.0) + 0.006 * (np.abs(N) / 1000.0) ** (1.0 / power))

    def off(effect, begin):
        quantities = effect.quantities()
        low, high = ([getattr(q, end) for q in quantities] for end in ("low", "high"))

        def missed(values):
            (element,) = effect.elements(machine, tuple(values))
            return 1e3 * (element.law(N, history)[0] - truth)

        found = least_squares(missed, begin, bounds=(low, high), x_scale=np.maximum(np.abs(begin), 0.1))
        return float(np.sqrt(np.mean(found.fun**2))), found.x

    play, values = off(ActuatorBacklash(force=1000.0), [0.02, 0.0, 10.0, 0.1])
    contact, _ = off(ContactCompliance(), [0.02, 0.5])
    # thousandths of a millimetre: less than a gauge's noise, against as much as the ends yield by
    assert play < 0.2
    assert contact > 10.0 * play
    assert values[0] == pytest.approx(0.03, rel=0.05)


@pytest.mark.parametrize("many", [6, 40])
def test_every_reading_is_in_balance_whenever_the_others_are(machine, many):
    # hard ends: readings come into balance one after another, and those that are wait for the last
    look = look_of(machine, "A", 2.0)
    (element,) = ActuatorBacklash().elements(machine, (0.04, 0.0, 2.0, 0.0))
    history = history_of(machine, "A", many)
    found = balance(look, np.outer(np.linspace(0.001, 0.015, many), X), [element], history)
    wanted, _ = element.law(force_on(element.place, found.wrench, history), history)
    # mm: what `balance` promises, a ten-thousandth of a gauge's noise; what was thrown out is off by 1e-3 and more
    np.testing.assert_allclose(found.extension[:, 0], wanted, rtol=0.0, atol=1e-7)


def test_a_balance_that_begins_at_itself_stays(machine):
    look, history = look_of(machine, "A", 2.0), history_of(machine, "A", 6)
    u = np.outer(np.linspace(0.001, 0.015, 6), X)
    elements = ActuatorBacklash().elements(machine, (0.04, 0.0, 2.0, 0.0))
    found, looks = balance(look, u, elements, history), []

    def looked(pose):
        looks.append(pose)
        return look(pose)

    again = balance(looked, u, elements, history, found.extension)
    assert len(looks) == 1
    # of displacements below a millimetre rounding alone
    np.testing.assert_allclose(again.pose, found.pose, rtol=0.0, atol=1e-15)
    np.testing.assert_array_equal(again.extension, found.extension)


def test_a_balance_that_is_not_found_is_none(machine):
    # at no force does a travel that jumps meet a chain that deflects steadily
    jump = SeriesElement(
        AlongLine(), memoryless(lambda N: (np.where(N > 5.0, 0.02, 0.0), np.zeros_like(N))), most=0.03
    )
    with pytest.raises(NoConvergenceError, match="off balance"):
        balance(look_of(machine, "A", 2.0), np.outer([0.01, 0.02], X), [jump], history_of(machine, "A", 2))


def test_retarded_element_is_the_closed_form():
    time = np.array([0.0, 1.0, 2.0, 5.0, 9.0])
    begins = np.array([True, False, False, False, False])
    history = History(time, begins, np.tile([1.0, 0.0, 0.0], (5, 1)), np.zeros((5, 3)))
    force = np.array([0.0, 10.0, 20.0, 20.0, 20.0])
    x, slope = retarded(0.5, 3.0)(force, history)
    # a ramp of 10 N/s for 2 s, then held
    ramp = lambda t: 0.5 * 10.0 * (t - 3.0 * (1.0 - np.exp(-t / 3.0)))  # noqa: E731
    at_2 = ramp(2.0)
    expected = [0.0, ramp(1.0), at_2, *(10.0 + (at_2 - 10.0) * np.exp(-np.array([3.0, 7.0]) / 3.0))]
    # sums of a few numbers: rounding
    np.testing.assert_allclose(x, expected, rtol=1e-13, atol=1e-15)
    assert 0.0 < slope[1] < 0.5


def test_yielding_leaves_a_set_and_yields_back_later():
    force = np.array([0.0, 80.0, 150.0, 0.0, -40.0, -100.0])
    history = History(np.zeros(6), np.arange(6) == 0, np.tile([1.0, 0.0, 0.0], (6, 1)), np.zeros((6, 3)))
    x, slope = yielding(100.0, 1e-3)(force, history)
    # kinematic hardening: the elastic range of 200 N has moved by 50 N
    np.testing.assert_allclose(x, [0.0, 0.0, 0.05, 0.05, 0.05, 0.0], atol=1e-12)
    assert slope[1] == 0.0
    assert slope[2] == 1e-3


def test_isotropic_hardening_widens_the_elastic_range_on_both_sides():
    force = np.array([0.0, 150.0, 0.0, -140.0, -150.0, -170.0])
    history = History(np.zeros(6), np.arange(6) == 0, np.tile([1.0, 0.0, 0.0], (6, 1)), np.zeros((6, 3)))
    x, _ = yielding(100.0, 1e-3, grows=1.0)(force, history)
    # 150 N have made it 150 N wide each way; 20 N beyond that slip back; sums of six numbers, so to rounding
    # sums of a few numbers: rounding
    np.testing.assert_allclose(x, [0.0, 0.05, 0.05, 0.05, 0.05, 0.03], rtol=1e-13, atol=1e-15)


def test_laws_together_add_their_extensions():
    force = np.array([0.0, 150.0, 250.0])
    history = History(np.zeros(3), np.arange(3) == 0, np.tile([1.0, 0.0, 0.0], (3, 1)), np.zeros((3, 3)))
    x, slope = together(yielding(100.0, 1e-3), yielding(200.0, 2e-3))(force, history)
    # 50 and 150 N beyond the one, 50 N beyond the other: to rounding
    np.testing.assert_allclose(x, [0.0, 0.05, 0.15 + 0.1], atol=1e-12)
    np.testing.assert_allclose(slope, [0.0, 1e-3, 3e-3], atol=1e-15)


def test_the_line_is_that_of_the_force(machine):
    history = history_of(machine, "B", 2)
    wrench = np.zeros((2, 6))
    wrench[0, :3] = -300.0 * history.line[0]
    place = AlongLine()
    assert force_on(place, wrench, history)[0] == pytest.approx(-300.0)
    np.testing.assert_allclose(place.motion(history)[:, :3], history.line, atol=1e-12)


# Tables against the march itself, and machines with something built in.

BACK = tuple(-v for v in X)


@pytest.mark.parametrize(
    ("posture", "direction", "reach"), [("A", BACK, 4.0), ("A", X, 3.0), ("B", BACK, 8.0), ("C", BACK, 0.9)]
)
def test_lookup_is_the_march_between_its_nodes(machine, posture, direction, reach):
    table = tabulate(machine, HalfRay(posture, direction, reach), pulls=direction is X)
    s = np.sort(np.random.default_rng(3).uniform(0.0, reach, 60))
    # in the kink itself, between the nodes at its two sides, there is no smooth curve to be met
    s = s[np.abs(s / table.bifurcation - 1.0) > 1.5e-3]
    path = trace_grid(table.problem, np.concatenate([[0.0], s]))
    at = np.isin(path.s, s)
    wrench, _ = table.at(path.s[at])
    # what `FINE` allows, in N; moments by an arm of 100 mm
    assert np.abs(wrench - path.wrench[at])[:, :3].max() < 0.05
    assert np.abs(wrench - path.wrench[at])[:, 3:].max() < 5.0


@pytest.mark.parametrize(("posture", "direction", "reach"), [("A", BACK, 4.0), ("A", X, 3.0), ("C", BACK, 0.9)])
@pytest.mark.parametrize("change", [5e-4, -5e-4])
def test_a_machine_near_by_changes_as_one_that_is_traced(machine, posture, direction, reach, change):
    half, pulls = HalfRay(posture, direction, reach), direction is X
    here = tabulate(machine, half, pulls)
    for other in (
        machine.times("link", 1.0 + change),
        machine.times("foot", 1.0 + change),
        machine.longer("link", change),
    ):
        near, traced = beside(other, half, pulls, here), tabulate(other, half, pulls)
        assert near is not None
        s = here.s[(np.abs(here.s / here.bifurcation - 1.0) > 1.5e-3) & (here.s <= traced.s[-1])]
        found, exact = (table.at(s)[0] - here.at(s)[0] for table in (near, traced))
        # beside the change what two tables with other nodes may differ by, see `FINE`
        assert np.abs(found - exact)[:, :3].max() < 0.02 * np.abs(exact)[:, :3].max() + 0.05


def test_no_neighbour_is_made_of_a_machine_of_other_stability(machine):
    half = HalfRay("A", BACK, 4.0)
    here = tabulate(machine, half, pulls=False)
    # the foot's softness moves the bifurcation, across nodes that stand beside it
    assert beside(machine.times("foot", 1.3), half, False, here) is None
    # and from states this far off Newton's method does not converge, from the fourth on
    assert beside(machine.times("link", 100.0), half, False, here) is None


def test_bifurcation_stands_where_the_path_has_it(machine):
    table = tabulate(machine, HalfRay("A", BACK, 4.0), pulls=False)
    # given to four digits
    assert table.bifurcation == pytest.approx(2.7232, abs=1e-4)
    assert np.count_nonzero(np.abs(table.s / table.bifurcation - 1.0) < 0.02) >= 4


def test_bowed_column_follows_the_exact_amplification():
    # a pinned column with a half-sine bow a of its own carries P at a mid deflection a P/(P_E − P) beyond a
    chain = load_chain("pinned-column")
    machine = ModifiedMachine(chain, VjmEngine(16), bow=((chain.beams[0].name, 0.5, 0.0),))
    table = tabulate(machine, HalfRay("straight", BACK, 0.08), pulls=False)
    section = chain.beams[0].effective_section()
    L = chain.beams[0].length
    euler = np.pi**2 * section.EIz / L**2
    P = -table.wrench[:, 0]
    ratio = P / euler
    # shortening: elastic, and of the arc ∫½(v'² − v₀'²) with v = a/(1 − P/P_E)
    predicted = P * L / section.EA + 0.25 * np.pi**2 / L * 0.25 * ((1.0 / (1.0 - ratio)) ** 2 - 1.0)
    below = ratio < 0.8
    assert below.sum() > 5
    # slopes and strains count to first order there; near Euler's load 1/(1 − P/P_E) makes ten times of it
    np.testing.assert_allclose(predicted[below], table.s[below], rtol=5e-3, atol=1e-6)


@pytest.mark.parametrize(("along_y", "along_z"), [(0.001, 0.0), (0.0085, 0.02), (0.02, 0.16)])
def test_small_bow_is_followed_across_its_knee(machine, along_y, along_z):
    # behind the straight bar's critical point the shortening bends it to w = 2/π √(L Δs), and P = P_c (1 − a/w)
    straight = tabulate(machine, HalfRay("A", BACK, 4.0), pulls=False)
    bowed_one = tabulate(replace(machine, bow=(("link", along_y, along_z),)), HalfRay("A", BACK, 4.0), pulls=False)
    s = np.array([3.2, 3.6, 4.0])
    P, Q = straight.at(s)[0][:, 0], bowed_one.at(s)[0][:, 0]
    w = 2.0 / np.pi * np.sqrt(310.0 * (s - straight.bifurcation))
    # of the deficit: terms of (w/L)², and what the tables allow, 0.05 N of the least, 0.8 N
    np.testing.assert_allclose(1.0 - Q / P, along_y / w, rtol=0.07)


def test_bow_keeps_the_ends_in_place(machine):
    model = machine.engine.model(machine.nominal)
    x = bowed(model, "A", (("link", 0.7, -0.3),))
    start = model.configuration(machine.nominal.posture("A"))
    before, after = model.kinematics(start).end, model.kinematics(start + x).end
    # the chord of the bow is shorter by a²π²/4L
    assert np.linalg.norm(after[:3, 3] - before[:3, 3]) < 1.1 * (0.7**2 + 0.3**2) * np.pi**2 / (4.0 * 310.0)
    # two turns after one another twist by their product
    assert np.abs(after[:3, :3] - before[:3, :3]).max() < 0.7 * 0.3 * (np.pi / 310.0) ** 2


def test_weight_is_borne_by_both_ends(machine):
    heavy = replace(machine, weight=(("link", 4.0),))
    table = tabulate(heavy, HalfRay("A", X, 1.0), pulls=True)
    # half of the link's weight hangs on the end-effector, which is held up; what sags shifts it by 3e-6
    assert table.wrench[0, 2] == pytest.approx(0.5 * 4.0 * 9.80665, rel=1e-4)


def test_weight_agrees_with_the_suites_own_path(machine):
    heavy = replace(machine, weight=(("link", 4.0),))
    table = tabulate(heavy, HalfRay("B", BACK, 2.0), pulls=False)
    path = machine.engine.trace(heavy.chain(), LoadCase("B", -2.0, steps=4, gravity=(0.0, 0.0, -9.80665)))
    wrench, _ = table.at(np.array([p.s for p in path.points]))
    # both solve the same equations: 2.5e-10 N, where Newton stops
    np.testing.assert_allclose(wrench[:, :3], [p.wrench[:3] for p in path.points], atol=1e-8)


def test_weight_is_followed_where_the_march_stumbles(machine, monkeypatch):
    heavy = replace(machine, weight=(("link", 4.0),))
    whole = tabulate(heavy, HalfRay("B", BACK, 2.0), pulls=False)
    march, given_up = MachineSolver.march, []

    def stumbles(*args):
        found = march(*args)
        given_up.append(len(found.x))
        return found._replace(good=5, why="Newton did not converge")

    monkeypatch.setattr(MachineSolver, "march", stumbles)
    step_by_step = tabulate(heavy, HalfRay("B", BACK, 2.0), pulls=False)
    assert given_up
    # both residuals are below the solver's tolerance in the model's units, 1e-7 N and 3e-5 N mm
    unit = heavy.model("B").wrench_scale
    assert np.abs((step_by_step.wrench - whole.wrench) / unit).max() < TOLERANCE
    assert np.abs(step_by_step.stiffness - whole.stiffness).max() < TOLERANCE * np.abs(whole.stiffness).max()


def test_asymmetry_has_a_stiffness_in_each_direction(machine):
    other = replace(machine, asymmetry=(("foot", 1.21),))
    pull, push = (tabulate(other, HalfRay("A", d, 0.1), pulls=d is X) for d in (X, BACK))
    same = tabulate(machine, HalfRay("A", X, 0.1), pulls=True)
    soft, stiff = push.slope[0] @ BACK, pull.slope[0] @ X
    # the foot in series with the link, whose share does not change
    k = same.slope[0] @ X
    link = 310.0 / (2.0 * 6.7391304e6)
    # the factors are exact: rounding alone, 4e-15
    assert 1.0 / stiff - link == pytest.approx((1.0 / k - link) / 1.1, rel=1e-12)
    assert 1.0 / soft - link == pytest.approx((1.0 / k - link) * 1.1, rel=1e-12)


@pytest.mark.parametrize(("length", "reach"), [(12.6, 3.072), (0.0, 8.0)])
def test_table_stays_on_its_branch_behind_a_bifurcation(machine, length, reach):
    table = tabulate(machine.longer("link", length), HalfRay("A", BACK, reach), pulls=False)
    behind = table.s > table.bifurcation
    assert table.s[-1] == reach
    # the coordinate that moves farthest tells the two mirrored branches apart
    moved = table.x[behind] - table.x[~behind][-1]
    side = moved[:, np.argmax(np.abs(moved).max(axis=0))]
    assert behind.sum() > 10
    assert np.all(side * side[0] > 0.0)
