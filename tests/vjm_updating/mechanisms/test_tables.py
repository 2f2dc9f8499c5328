"""Tables against the march itself, and machines with something built in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.load_grid import trace_grid
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.kernels.machine_solver import MachineSolver
from vjm.model.load_case import LoadCase
from vjm.statics import TOLERANCE
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, beside, tabulate
from vjm_updating.mechanisms.modified_chain import ModifiedChain, bowed

X = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
BACK = tuple(-v for v in X)


@pytest.fixture(scope="module")
def machine():
    return ModifiedChain(load_chain("orthoglide-chain"), VjmEngine(8))


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
    machine = ModifiedChain(chain, VjmEngine(16), bow=((chain.beams[0].name, 0.5, 0.0),))
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
