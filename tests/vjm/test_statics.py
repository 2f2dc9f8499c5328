"""Newton-Raphson and the paper's iteration (13): the same equilibria, each with its own convergence."""

import contextlib
import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.paper_iteration import solve_paper
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space

from vjm import statics as equilibrium
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint
from vjm.rotations import AXES, displaced, translation
from vjm.statics import (
    TOLERANCE,
    Configuration,
    critical_modes,
    loaded_stiffness,
    residual,
    solve_newton,
    solve_under_wrench,
    stability,
    unloaded_stiffness,
)

CRITICAL_FORCE = 2696.0
"""Posture A in tension, four digits."""
BEFORE = {"A": 0.7, "B": 1.0, "C": 0.13, "D": 1.0}
"""Displacements in mm before the critical point or the stiffness knee."""


@pytest.fixture
def residuals(monkeypatch):
    """The scaled residuals of all iterations of the solvers, as they come."""
    seen = []
    measure = equilibrium.scaled_norm

    def record(*args):
        seen.append(measure(*args))
        return seen[-1]

    monkeypatch.setattr(equilibrium, "scaled_norm", record)
    return seen


def pulled(chain, posture, to):
    """Lumped model of the paper, its unloaded coordinates, and the pose pulled along x."""
    model = Mechanism(chain)
    x = model.configuration(chain.posture(posture))
    return model, x, displaced(model.kinematics(x).end, [to, 0, 0, 0, 0, 0])


def scaled_difference(a, b):
    """Largest difference of two configurations in their own units."""
    dx = np.abs((a.x - b.x) / a.model.coordinate_scale).max()
    return max(dx, np.abs((a.wrench - b.wrench) / a.model.wrench_scale).max())


@pytest.mark.parametrize("posture", BEFORE)
def test_newton_leaves_no_residual_of_statics_or_geometry(chain, posture):
    model, x, target = pulled(chain, posture, BEFORE[posture])
    found = solve_newton(model, target, x, np.zeros(6))
    _, statics, gap = residual(model, found.x, found.wrench, target)
    # (9): virtual torques against the largest of them; passive torques, and the pose, against zero
    torque = np.abs(model.stiffness @ found.x * model.coordinate_scale).max()
    assert np.abs(statics * model.coordinate_scale).max() < 1e-9 * torque
    assert np.abs(gap[:3]).max() < 1e-8  # mm: TOLERANCE times the length of 310 mm, and rounding
    assert np.abs(gap[3:]).max() < 1e-10  # rad
    assert found.residual < TOLERANCE


@pytest.mark.parametrize("posture", BEFORE)
def test_newton_converges_quadratically(chain, posture):
    model, x, target = pulled(chain, posture, BEFORE[posture])
    at = solve_newton(model, target, x, np.zeros(6))
    rng = np.random.default_rng(3)
    dx = model.coordinate_scale * rng.uniform(-1, 1, model.size)
    dw = model.wrench_scale * rng.uniform(-1, 1, 6)
    sizes = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    after = []
    for size in sizes:
        there, wrench, *_ = model.compiled.newton(target, at.x + size * dx, at.wrench + size * dw, 0.0, 0.0, 1)
        after.append(model.compiled.residual(there, wrench, target)[2])
    order = np.polyfit(np.log(sizes), np.log(after), 1)[0]
    # cubic terms are below one per cent of the quadratic ones for turns below 4 mrad times their levers
    assert order == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("far", [0.0, 1e6])
@pytest.mark.parametrize("posture", BEFORE)
def test_what_newton_cannot_take_away_is_rounding_and_what_it_can_is_not(chain, posture, far):
    """Of a machine at the world's origin, and of one a kilometre away, where distances lose seven digits."""
    away = replace(chain, base=translation([far, -far, far]) @ chain.base)
    model, x, target = pulled(away, posture, BEFORE[posture])
    at = solve_newton(model, target, x, np.zeros(6))
    x, wrench = at.x, at.wrench
    for _ in range(4):
        statics, gap, _ = model.compiled.residual(x, wrench, target)
        dx, dF = model.compiled.response(x, wrench, statics, gap)
        x, wrench = x + dx, wrench + dF
    statics, gap, error = model.compiled.residual(x, wrench, target)
    assert model.compiled.rounded(x, statics, gap)
    # a state that is off by ten thousand times the rounding of its largest distance
    off = 1e4 * np.finfo(float).eps * (1.0 + far / model.coordinate_scale.max())
    moved = x + off * model.coordinate_scale
    statics, gap, worse = model.compiled.residual(moved, wrench, target)
    assert worse > error
    assert not model.compiled.rounded(moved, statics, gap)


@pytest.mark.parametrize("posture", BEFORE)
def test_iteration_13_and_newton_agree_before_the_critical_point(chain, posture):
    model, x, target = pulled(chain, posture, BEFORE[posture])
    paper = solve_paper(model, target, x, max_iterations=2000)
    newton = solve_newton(model, target, paper.x, paper.wrench)
    # at a contraction of up to 0.9 the error is ten times the last change, over the
    # smallest stiffness that the residual is measured with
    assert scaled_difference(paper, newton) < 1e4 * TOLERANCE
    # and it is the state that Newton reaches from the unloaded one
    assert scaled_difference(paper, solve_newton(model, target, x, np.zeros(6))) < 1e4 * TOLERANCE


@pytest.mark.parametrize("force", [1323.0, 2652.0])
def test_iteration_13_contracts_by_the_load_over_the_critical_load(chain, residuals, straight, force):
    assert observed_factor(chain, residuals, straight, force) == pytest.approx(force / CRITICAL_FORCE, abs=1e-3)


def test_iteration_13_diverges_from_the_straight_branch_beyond_the_critical_point(chain, residuals, straight):
    factor = observed_factor(chain, residuals, straight, 3500.0)
    assert factor > 1.25
    assert factor == pytest.approx(3500.0 / CRITICAL_FORCE, abs=1e-3)


def observed_factor(chain, residuals, straight, force):
    """Ratio of successive residuals of (13), started a little beside the straight state at a force."""
    s = force / 3300.3
    for _ in range(5):  # the straight branch is nearly linear: a secant gives the displacement at the force
        at = straight(s)
        s *= force / at.wrench[0]
    model, _, target = pulled(chain, "A", s)
    residuals.clear()
    # some iterations show the factor before rounding is reached; converging or not does not matter
    with contextlib.suppress(NoConvergenceError):
        solve_paper(model, target, at.x + 1e-6 * critical_modes(at)[0], max_iterations=8)
    # the first ratio still holds the other modes, which contract much faster; the critical force depends a
    # little on the displacement, since the foot turns: 1e-4
    return residuals[6] / residuals[5]


@pytest.mark.parametrize("seed", range(4))
def test_iteration_13_finds_the_buckled_branch_with_noise(chain, state, seed):
    model, x, target = pulled(chain, "A", 2.0)
    found = solve_paper(model, target, x, noise=1e-2, rng=np.random.default_rng(seed))
    # either of the two mirrored branches
    branches = [state("A", 2.0, branch=branch) for branch in (1, -1)]
    # the contraction is 0.25 here, but the branch is soft: its stiffness is a hundredth of the units'
    assert min(scaled_difference(found, branch) for branch in branches) < 1e3 * TOLERANCE
    assert abs(found.x[model.passive[0]]) > 0.05  # rad; the straight branch has a thousandth


def test_iteration_13_contracts_on_the_buckled_branch(chain, residuals, state):
    model, _, target = pulled(chain, "A", 2.0)
    at = state("A", 2.0)
    residuals.clear()
    solve_paper(model, target, at.x + 1e-4 * critical_modes(at)[0])
    # REFERENCE figure with two digits: 0.25 at 2 mm
    assert residuals[4] / residuals[3] == pytest.approx(0.25, abs=0.005)


def test_noise_is_repeatable_and_refused_without_a_generator(chain):
    model, x, target = pulled(chain, "A", 2.0)
    with pytest.raises(ValueError) as refusal:
        solve_paper(model, target, x, noise=1e-3)
    assert "generator" in str(refusal.value)
    twice = [solve_paper(model, target, x, noise=1e-3, rng=np.random.default_rng(7)).x for _ in range(2)]
    assert np.array_equal(*twice)


def test_out_of_reach_is_said_and_not_answered():
    # a drive along x and a hinge about z never leave their line
    chain = Machine(
        "stub",
        (Joint("a", AXES["x"], slides=True, fixed=True, compliance=1e-4), Joint("q", AXES["z"], passive=True)),
    )
    model = Mechanism(chain)
    target = displaced(np.eye(4), [0, 10.0, 0, 0, 0, 0])
    with pytest.raises(NoConvergenceError):
        solve_newton(model, target, np.zeros(2), np.zeros(6))
    with pytest.raises(NoConvergenceError):
        solve_paper(model, target, np.zeros(2))


def test_pose_a_half_turn_away_is_said_to_be_out_of_reach(chain):
    model, x, target = pulled(chain, "A", 0.1)
    target = displaced(target, [0, 0, 0, np.pi, 0, 0])
    with pytest.raises(NoConvergenceError) as failure:
        solve_newton(model, target, x, np.zeros(6))
    assert "neighbourhood" in str(failure.value)


def test_failure_says_how_far_the_solver_came(chain):
    model, x, target = pulled(chain, "B", 3.0)
    for solve in (lambda: solve_newton(model, target, x, np.zeros(6), max_iterations=1),
                  lambda: solve_paper(model, target, x, max_iterations=1)):  # fmt: skip
        with pytest.raises(NoConvergenceError) as failure:
            solve()
        left = float(re.search(r"residual of (\S+)$", str(failure.value)).group(1))
        assert TOLERANCE < left < 1.0


@pytest.mark.parametrize(("posture", "force"), [("A", 2000.0), ("A", -5000.0), ("C", -1000.0)])
def test_dead_wrench_and_imposed_pose_are_each_others_converse(chain, posture, force):
    """A force along the pin-to-pin line is balanced; held in the pose that it leads to, the chain asks for it."""
    model = Mechanism(chain)
    x = model.configuration(chain.posture(posture))
    angle = 0.0 if posture == "A" else np.pi / 6  # of the bar against x, about y
    direction = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    wrench = np.concatenate([force * direction, np.zeros(3)])
    free = solve_under_wrench(model, wrench, x)
    k, statics, _ = residual(model, free.x, wrench, np.eye(4))
    assert np.abs(statics * model.coordinate_scale).max() < TOLERANCE * 5e6  # the model's unit of energy, N mm
    held = solve_newton(model, k.end, free.x, np.zeros(6))
    # the wrench of the held pose, to the solvers' tolerance in units of 1.6e4 N; along the bar only, since
    # across it the free chain is moved by a force of a thousandth of its own as its stiffness
    assert held.wrench[:3] == pytest.approx(wrench[:3], abs=2e-8)


@pytest.mark.parametrize("component", range(6))
@pytest.mark.parametrize("far", [100.0, 1_000.0, 10_000.0])
def test_poses_far_beyond_the_machine_are_met_or_refused(chain, component, far):
    """The springs are linear, so that even 10 m may have an equilibrium; what counts is that none is made up."""
    model, x, target = pulled(chain, "A", 0.0)
    # metres in mm, and up to 2.5 rad
    target = displaced(target, np.eye(6)[component] * (far if component < 3 else far / 4000.0))
    try:
        found = solve_newton(model, target, x, np.zeros(6))
    except NoConvergenceError:
        return
    _, statics, gap = residual(model, found.x, found.wrench, target)
    assert np.abs(gap[:3]).max() < 1e-8  # mm
    assert np.abs(gap[3:]).max() < 1e-10  # rad
    # TOLERANCE in the model's unit of energy, some 5e6 N mm, and under more than a unit of wrench relative to it
    heavy = max(1.0, np.abs(found.wrench / model.wrench_scale).max())
    assert np.abs(statics * model.coordinate_scale).max() < TOLERANCE * 5e6 * heavy


def test_newton_gives_up_ten_metres_aside(chain):
    """Along x the linear springs would stretch; across it nothing leads there from the unloaded posture."""
    model, x, target = pulled(chain, "A", 0.0)
    with pytest.raises(NoConvergenceError):
        solve_newton(model, displaced(target, [0, 10_000.0, 0, 0, 0, 0]), x, np.zeros(6))


# The second variation on the constraints' null space, against another way to compute it.


def reduced_second_variation(at):
    """K − H on an orthonormal basis of the null space of J from the SVD, in the model's units; and the basis."""
    model = at.model
    unit = model.coordinate_scale
    J = at.kinematics.jacobian * unit / np.repeat([model.chain.characteristic_length, 1.0], 3)[:, None]
    N = null_space(J, rcond=1e-10)
    A = (at.stiffness - at.hessian) * unit[:, None] * unit / model.wrench_scale[3]
    return N.T @ (0.5 * (A + A.T)) @ N, N


def configuration(model, point):
    """The configuration of a point of a path."""
    m = model.size
    return Configuration(model, point.state[:m], point.state[m : m + 6], point.residual, point.iterations)


STATES = [("A", 0.6, None), ("A", 2.0, None), ("B", 4.0, None), ("C", 0.3, None), ("D", 3.0, None),
          ("A", -4.0, 4), ("B", -10.0, 4), ("D", -12.0, 4)]  # fmt: skip


@pytest.mark.parametrize(("posture", "to", "segments"), STATES)
def test_eigenvalue_agrees_with_the_null_space_from_the_svd(state, posture, to, segments):
    at = state(posture, to, segments)
    values = np.linalg.eigvalsh(reduced_second_variation(at)[0])
    verdict = stability(at)
    # eigenvalues are wrong by the rounding of the largest
    assert verdict.eigenvalue == pytest.approx(values[0], abs=1e-13 * values[-1])
    assert verdict.unstable == np.count_nonzero(values < 0.0) == 0


def test_one_mode_is_unstable_on_the_straight_branch_beyond_the_critical_point(straight):
    # the critical displacement is 0.813 mm
    before, beyond = straight(0.80), straight(0.83)
    assert (stability(before).unstable, stability(beyond).unstable) == (0, 1)
    for at in (before, beyond):
        values = np.linalg.eigvalsh(reduced_second_variation(at)[0])
        assert stability(at).eigenvalue == pytest.approx(values[0], abs=1e-13 * values[-1])
    assert stability(beyond).eigenvalue < 0.0 < stability(before).eigenvalue


def test_critical_mode_solves_the_eigenproblem(trace, state):
    at = state("A", trace("A", 2.0).critical.s * 0.999)
    model = at.model
    mode = critical_modes(at)[0] / model.coordinate_scale
    assert np.linalg.norm(mode) == pytest.approx(1.0, rel=1e-14)
    J = at.kinematics.jacobian * model.coordinate_scale / np.repeat([310.0, 1.0], 3)[:, None]
    assert np.abs(J @ mode).max() < 1e-14  # the end-effector stays: rounding of entries of order one
    reduced, N = reduced_second_variation(at)
    values = np.linalg.eigvalsh(reduced)
    assert np.abs(N @ (N.T @ mode) - mode).max() < 1e-13
    # at the critical point the smallest eigenvalue is 1e-5 and the residual rounding of the largest
    residual = reduced @ (N.T @ mode) - values[0] * (N.T @ mode)
    assert np.abs(residual).max() < 1e-13 * values[-1]


@pytest.mark.parametrize(("segments", "to"), [(4, -4.0), (None, 2.0)], ids=["4 springs", "paper"])
def test_critical_mode_shows_its_largest_deflection_positive(chain, trace, segments, to):
    """On branch +1 the buckled shape moves the way that the mode's sign says, and visibly so."""
    critical = trace("A", to, segments).critical.point
    at = configuration(VjmEngine(segments).model(chain), critical)
    mode = critical_modes(at)[0]
    # one spring a link: its stations are the joints, which stand still while the bar kinks between them
    deflection = mode / at.model.coordinate_scale if segments is None else at.model.shape_rate(at.kinematics, mode)
    largest = deflection.ravel()[np.argmax(np.abs(deflection))]
    # the mode has length one in units of 310 mm and a radian, over 16 or 28 coordinates
    assert largest > (0.2 if segments is None else 1.0)


@pytest.mark.parametrize(("segments", "to"), [(4, -4.0), (None, 2.0)], ids=["4 springs", "paper"])
def test_sign_of_the_critical_mode_does_not_hang_on_rounding(chain, trace, segments, to):
    critical = trace("A", to, segments).critical.point
    model = VjmEngine(segments).model(chain)
    at = configuration(model, critical)
    modes = [critical_modes(at)[0]]
    for change in (-1e-6, 1e-6):
        pose = displaced(at.kinematics.end, change * critical.displacement)
        modes.append(critical_modes(solve_newton(model, pose, at.x, at.wrench))[0])
    unit = model.coordinate_scale
    # a millionth of the displacement turns the mode by about as little
    assert [float((modes[0] / unit) @ (mode / unit)) for mode in modes] == pytest.approx([1.0] * 3, abs=1e-9)


def test_a_push_along_the_mode_grows_into_the_branch_that_the_follower_takes(chain, trace):
    """Newton from a state beyond the critical point, pushed along the mode, finds the followed branch."""
    path = trace("A", -4.0, 4)
    critical, followed = path.critical.point, path.points[-1]
    at = configuration(VjmEngine(4).model(chain), critical)
    target = displaced(at.kinematics.end, followed.displacement - critical.displacement)
    unit, mode = at.model.coordinate_scale, critical_modes(at)[0]
    state = configuration(at.model, followed)
    amplitude = float(mode @ ((state.x - at.x) / unit**2))
    assert amplitude > 0.0
    found = solve_newton(at.model, target, at.x + 0.9 * amplitude * mode, at.wrench)
    # the same state, to the solver's tolerance over the soft mode's eigenvalue
    assert np.abs((found.x - state.x) / unit).max() < 1e-8


# The stiffness matrices (5) and (18) against other formulas, finite differences and energy.


LENGTH = 310.0


def dimensionless(K, length=LENGTH):
    """Stiffness (6, 6) with translations counted in units of length, so that its entries compare: N mm."""
    unit = np.repeat([length, 1.0], 3)
    return K * unit[:, None] * unit


def rank(K, relative=1e-9):
    """Rank of a stiffness; rounding leaves 1e-14 of the largest singular value, loads at least 1e-7."""
    singular = np.linalg.svd(dimensionless(K), compute_uv=False)
    return int(np.count_nonzero(singular > relative * singular[0]))


@given(data=st.data())
def test_unloaded_stiffness_is_the_inverse_compliance_without_the_passive_motions(chains, data):
    chain = data.draw(chains)
    model, q = Mechanism(chain), chain.posture("p")
    J = model.kinematics(model.configuration(q)).jacobian
    J_theta, J_q = J[:, model.elastic], J[:, model.passive]
    inverse = np.linalg.inv(J_theta @ model.compliance @ J_theta.T)
    # K = C⁻¹ − C⁻¹ J_q (J_qᵀ C⁻¹ J_q)⁻¹ J_qᵀ C⁻¹
    expected, condition = inverse, np.linalg.cond(dimensionless(inverse))
    if J_q.size:
        passive = J_q.T @ inverse @ J_q
        expected = inverse - inverse @ J_q @ np.linalg.solve(passive, J_q.T @ inverse)
        condition *= np.linalg.cond(passive)
    # rounding, times what the two inversions of the formula make of it
    error = np.abs(dimensionless(unloaded_stiffness(model, q) - expected)).max()
    assert error < 1e-14 * condition * np.abs(dimensionless(inverse)).max()


@pytest.mark.parametrize("posture", "ABCD")
def test_unloaded_rank_is_what_four_passive_joints_leave(chain, posture):
    assert rank(unloaded_stiffness(Mechanism(chain), chain.posture(posture))) == 2


@pytest.mark.parametrize(("posture", "to", "expected"), [
    ("A", 0.6, 4), ("A", 2.0, 4), ("B", 1.0, 5), ("B", 4.0, 5),
    ("C", 0.1, 4), ("C", 0.3, 4), ("D", 1.0, 5), ("D", 3.0, 5),
])  # fmt: skip
def test_loaded_rank(state, posture, to, expected):
    assert rank(loaded_stiffness(state(posture, to))) == expected


def differenced_stiffness(at, step):
    """Central differences of the wrench by the displacement from a loaded state; step in L mm and in rad."""
    pose = at.kinematics.end
    unit = np.repeat([LENGTH, 1.0], 3)
    columns = []
    for d in np.diag(step * unit):
        ahead, behind = (solve_newton(at.model, displaced(pose, way), at.x, at.wrench) for way in (d, -d))
        columns.append((ahead.wrench - behind.wrench) / (2.0 * step))
    return unit[:, None] * np.array(columns).T


@pytest.mark.parametrize(("posture", "to"), [
    ("A", 0.6), ("A", 2.0), ("C", 0.1), ("C", 0.3), ("B", 1.0), ("B", 4.0), ("D", 1.0), ("D", 3.0),
    ("A", -4.0), ("C", -1.0), ("B", -10.0), ("D", -12.0),
])  # fmt: skip
@pytest.mark.parametrize("segments", [None, 4], ids=["paper", "4 springs"])
def test_loaded_stiffness_is_the_derivative_of_the_wrench(state, posture, to, segments):
    at = state(posture, to, segments)
    K = dimensionless(loaded_stiffness(at))
    # steps of 0.03 and 0.09 mm, or 0.1 and 0.3 mrad: truncation goes with the step squared, and rounding
    # (1e-14 in forces over a step of 1e-4) stays below it or below 1e-9
    error = [np.abs(differenced_stiffness(at, step) - K).max() / np.abs(K).max() for step in (1e-4, 3e-4)]
    assert error[0] < 2e-4
    assert error[0] < 1e-8 or np.log(error[1] / error[0]) / np.log(3.0) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("posture", "to"), [("B", 4.0), ("D", 3.0)])
def test_world_moments_make_the_loaded_stiffness_slightly_asymmetric(state, posture, to):
    K = dimensionless(loaded_stiffness(state(posture, to)))
    asymmetry = np.abs(K - K.T).max() / np.abs(K).max()
    # of the order of 0.1 %: a one-digit statement
    assert 5e-4 < asymmetry < 5e-3


@pytest.mark.parametrize(("posture", "to"), [("A", 0.6), ("A", 2.0), ("C", 0.1), ("C", 0.3)])
def test_loaded_stiffness_is_symmetric_where_no_moment_acts(state, posture, to):
    at = state(posture, to)
    # the end's two joints turn about y and z, and the chain does not twist: rounding of 1e7 N mm
    assert np.abs(at.wrench[3:]).max() < 1e-6
    K = dimensionless(loaded_stiffness(at))
    assert np.abs(K - K.T).max() < 1e-10 * np.abs(K).max()


@pytest.mark.parametrize(("posture", "to"), [("A", 0.7), ("B", 4.0), ("C", 0.14), ("D", 3.0), ("B", -10.0)])
def test_work_done_on_the_end_effector_is_stored_in_the_springs(trace, state, posture, to):
    """Only the force works along a pure shift, whatever moments the held orientation needs."""
    segments = 4 if to < 0 else None
    # linear springs, whose energy is known without integrating along their own path
    path = trace(posture, to, segments, placement="two-thirds", steps=200)
    s, force, slope = path.s, path.force, path.tangent
    h = np.diff(s)
    # the trapezoidal rule with end corrections, which takes force and slope as exact: error of order h⁴
    work = np.sum(h * (force[1:] + force[:-1]) / 2 - h**2 * np.diff(slope) / 12)
    at = state(posture, to, segments, placement="two-thirds", steps=200)
    stored = 0.5 * at.x @ at.model.stiffness @ at.x
    # 200 steps through a bend of a tenth of the path: (h/bend)⁴/720 is some 1e-8
    assert work == pytest.approx(stored, rel=9e-9)
