"""The stiffness matrices (5) and (18) against other formulas, finite differences and energy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vjm.model.mechanism import Mechanism
from vjm.rotations import displaced
from vjm.statics import loaded_stiffness, solve_newton, unloaded_stiffness

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
