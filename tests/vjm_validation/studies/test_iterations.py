"""The study of iterations: its counts are those of the solvers, its contraction that of the theory."""

from dataclasses import astuple

import numpy as np
import pytest
from helpers.paper_iteration import solve_paper

from vjm import statics as equilibrium
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.rotations import displacement_between
from vjm.statics import residual, scaled_norm, solve_newton
from vjm_validation.studies import chain as iterations
from vjm_validation.studies.chain import (
    LIMIT,
    LOOSE,
    STEP_MM,
    THINNING,
    contraction,
    count,
    iteration_study,
    newton_step,
    paper_step,
    residual_history,
)

COARSE_MM = 0.1


@pytest.fixture(scope="module")
def study(chain):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(iterations, "STEP_MM", COARSE_MM)
        return iteration_study(chain, "A")


@pytest.fixture(scope="module")
def traced(chain):
    """Model, path on the study's grid, and the frame imposed at each displacement."""
    load_case = LoadCase("A", 4.0, steps=round(4.0 / COARSE_MM))
    engine = VjmEngine()
    model = engine.model(chain)
    return model, engine.trace(chain, load_case), LumpedProblem(model, load_case, "").target


def neighbours(traced, s):
    """Start and end of the step that ends at a displacement."""
    _, path, _ = traced
    i = int(np.argmin(np.abs(path.s - s)))
    assert path.s[i] == pytest.approx(s)
    return path.points[i - 1], path.points[i]


@pytest.mark.parametrize("s", [0.4, 1.2, 2.9])
def test_one_point_by_a_loop_by_hand(study, traced, s):
    """(13) written out, unscaled, in lengths of a metre so that its matrix is not too skewed."""
    model, _, target = traced
    start, wanted = neighbours(traced, s)
    frame, x = target(wanted.s), start.state[: model.size]
    unit = np.diag([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])  # N, N m
    found = {}
    for iteration in range(1, LIMIT + 1):
        k = model.kinematics(x)
        J = np.linalg.inv(unit) @ k.jacobian
        J_theta, J_q = J[:, model.elastic], J[:, model.passive]
        n_q = len(model.passive)
        matrix = np.block([[J_theta @ model.compliance @ J_theta.T, J_q], [J_q.T, np.zeros((n_q, n_q))]])
        moved = np.linalg.inv(unit) @ displacement_between(k.end, frame) + J @ x
        solution = np.linalg.solve(matrix, np.concatenate([moved, np.zeros(n_q)]))
        x = np.zeros(model.size)
        x[model.passive] = solution[6:]
        x[model.elastic] = model.compliance @ J_theta.T @ solution[:6]
        wrench = np.linalg.inv(unit) @ solution[:6]
        _, statics, gap = residual(model, x, wrench, frame)
        error = scaled_norm(model, statics, gap, wrench)
        for tolerance in (LOOSE, equilibrium.TOLERANCE):
            if error < tolerance:
                found.setdefault(tolerance, iteration)
        if error < equilibrium.TOLERANCE:
            break
    point = min(study.points, key=lambda p: abs(p.s - s))
    assert point.s == pytest.approx(s)
    assert (point.paper_loose, point.paper) == (found[LOOSE], found[equilibrium.TOLERANCE])


def test_counts_are_those_of_the_solvers(study, traced, monkeypatch):
    model, _, target = traced
    for point in study.points:
        if point.s == pytest.approx(study.d_cr, rel=1e-3):
            continue
        start, wanted = neighbours(traced, point.s)
        x, wrench = start.state[: model.size], start.state[model.size : model.size + 6]
        frame = target(wanted.s)
        for tolerance, paper, newton in (
            (1e-11, point.paper, point.newton),
            (LOOSE, point.paper_loose, point.newton_loose),
        ):
            monkeypatch.setattr(equilibrium, "TOLERANCE", tolerance)
            try:
                assert solve_paper(model, frame, x).iterations == paper
            except NoConvergenceError:
                assert paper is None
            assert solve_newton(model, frame, x, wrench).iterations == newton


def test_points_lie_apart_and_no_step_crosses_the_bifurcation(study):
    s = np.array([point.s for point in study.points])
    assert s[0] == pytest.approx(COARSE_MM)
    behind = int(np.searchsorted(s, study.d_cr))
    assert 0 < behind < len(s)
    for part in (s[:behind], s[behind:]):
        assert np.all(part[1:] >= THINNING * part[:-1] * (1.0 - 1e-9))
    # a first step across it would lead (13) and Newton to the straight, unstable branch
    assert all((point.predicted is not None) == (point.s < study.d_cr) for point in study.points)
    assert STEP_MM < COARSE_MM


def test_contraction_is_the_force_over_the_critical_force(study):
    before = [point for point in study.points if point.predicted is not None]
    for point in before:
        assert point.contraction == pytest.approx(point.predicted, rel=1e-3)
        assert point.predicted == pytest.approx(point.force / 2696.18, rel=1e-5)
    assert len(before) > 5


def test_a_disturbed_start_fades_at_the_rate_of_the_contraction(traced):
    model, _, target = traced
    _, wanted = neighbours(traced, 0.4)
    frame = target(wanted.s)
    x, wrench = wanted.state[: model.size], wanted.state[model.size : model.size + 6]
    rate = contraction(model, frame, (x, wrench))
    noise = 1e-3 * model.coordinate_scale * np.random.default_rng(1).standard_normal(model.size)
    history, (end, _) = residual_history(paper_step, model, frame, (x + noise, wrench))
    ratios = np.array(history[6:]) / np.array(history[5:-1])
    np.testing.assert_allclose(ratios, rate, rtol=0.02)
    np.testing.assert_allclose(end / model.coordinate_scale, x / model.coordinate_scale, atol=1e-8)
    assert history[-1] < equilibrium.TOLERANCE


def test_disturbed_counts_come_from_one_and_the_same_noise(chain, study, monkeypatch):
    monkeypatch.setattr(iterations, "STEP_MM", COARSE_MM)
    assert [astuple(p) for p in iteration_study(chain, "A").points] == [astuple(p) for p in study.points]
    before = [point for point in study.points if point.predicted is not None]
    assert all(point.disturbed > point.paper for point in before if point.disturbed is not None)


def test_the_limit_and_lost_iterations_are_failures(traced):
    model, _, target = traced
    start, wanted = neighbours(traced, 1.0)
    state = start.state[: model.size], start.state[model.size : model.size + 6]
    history, _ = residual_history(paper_step, model, target(wanted.s), state, limit=3)
    assert len(history) == 3
    assert count(history, equilibrium.TOLERANCE) is None
    assert count([1e-3, 1e-7, 1e-8, 1e-12], LOOSE) == 2
    far = (state[0] + 3.0, state[1])
    history, _ = residual_history(newton_step, model, target(wanted.s), far)
    assert len(history) <= LIMIT
