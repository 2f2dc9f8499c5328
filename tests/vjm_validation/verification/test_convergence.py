"""Observed order, Richardson's limit and the error estimate, on sequences that are known by construction."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm_validation.acceptance import verification_rows
from vjm_validation.metrics import force_at, path_metrics
from vjm_validation.verification.judging import (
    EXACT,
    SAME,
    TOO_FEW,
    case_rows,
    convergence,
    fitted_order,
    matching_digits,
    three_mesh_order,
)
from vjm_validation.verification.library import case_by_name
from vjm_validation.verification.runner import AnswerStore, answered, run_cases

LIMIT = 3.0


def values(meshes, order, size=1.0):
    return [LIMIT + size * n**-order for n in meshes]


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0, 10.0])
@pytest.mark.parametrize("meshes", [(2, 4, 8), (3, 4, 6), (8, 12, 16)])
def test_three_meshes_give_order_and_limit_without_the_answer(order, meshes):
    given = values(meshes, order, size=meshes[0] ** order)
    found = convergence(meshes, given, LIMIT, order)
    assert found.order == pytest.approx(order, rel=1e-6)
    assert found.extrapolated == pytest.approx(LIMIT, abs=1e-9)
    # the estimate is 1.25 times the error
    assert found.gci == pytest.approx(1.25 * abs(given[-1] - LIMIT), rel=1e-4)
    assert found.flag == ""


def test_with_the_answer_all_errors_above_the_floor_are_fitted():
    meshes = (2, 4, 8, 16)
    errors = [1e-2, 1e-4, 1e-6, 3e-9]
    assert fitted_order(meshes, errors) == pytest.approx(np.log2(100.0))
    assert fitted_order(meshes, [1e-4, 1e-6, 9e-9, 1e-9]) is None
    found = convergence(meshes, [LIMIT * (1.0 + e) for e in errors], LIMIT, 4.0, exact=LIMIT)
    assert found.flag == "faster than theory"
    assert not found.as_theory_says(4.0)
    assert found.as_theory_says(6.7)


def test_what_is_exact_needs_no_order_and_what_hides_it_fails():
    meshes = (4, 8, 16)
    exact = convergence(meshes, [LIMIT * (1.0 + e) for e in (9e-9, 1e-12, 0.0)], LIMIT, 4.0, exact=LIMIT)
    assert exact.flag == EXACT
    assert exact.as_theory_says(4.0)
    few = convergence(meshes, [LIMIT * (1.0 + e) for e in (1e-5, 1e-7, 1e-9)], LIMIT, 4.0, exact=LIMIT)
    assert few.flag == TOO_FEW
    assert not few.as_theory_says(4.0)
    same = convergence(meshes, [LIMIT * (1.0 + 1e-6)] * 3, LIMIT, None, exact=LIMIT)
    assert (same.order, same.flag) == (None, SAME)
    assert same.as_theory_says(None)
    assert not same.as_theory_says(4.0)


def test_the_tolerance_of_the_order_is_absolute():
    meshes = (4, 8, 16)
    for order, holds in ((3.81, True), (4.19, True), (3.79, False), (4.21, False)):
        found = convergence(meshes, values(meshes, order), LIMIT, 4.0, exact=LIMIT)
        assert found.as_theory_says(4.0) is holds


def test_values_that_oscillate_or_stall_have_no_order():
    assert convergence((4, 8, 16), [1.0, 3.0, 2.0], 3.0, 2.0).flag == "oscillates"
    assert three_mesh_order((4, 8, 16), 1.0, -0.5) is None
    # growing differences: no order up to 16 fits
    assert three_mesh_order((4, 8, 16), 1.0, 2.0) is None
    assert convergence((4, 8, 16), [1.0, 2.0, 2.0 + 1e-10], 3.0, 2.0).flag == "at the rounding floor"


def test_a_lucky_order_does_not_shrink_the_estimate():
    meshes = (4, 8, 16)
    # order 8 where theory says 2: the estimate is that of order 2
    found = convergence(meshes, values(meshes, 8.0), LIMIT, 2.0)
    fine = abs(np.diff(values(meshes, 8.0))[-1])
    assert found.gci == pytest.approx(1.25 * fine / 3.0)


def test_fewer_than_three_meshes_say_nothing():
    found = convergence((4, 8), [1.0, 2.0], 2.0, 2.0)
    assert (found.order, found.extrapolated, found.gci) == (None, None, None)


# Rows: what fails, what does not count, and what a refusal says.


CASE = case_by_name("column-pinned")


@pytest.fixture(scope="module")
def answers():
    return answered(CASE, "vjm")


def spoilt(answers, factors):
    values = [[value * factor for value, factor in zip(row, factors, strict=True)] for row in answers.values]
    return answers.model_copy(update={"values": values})


def test_a_good_answer_passes_with_its_order_and_digits(answers):
    (row,) = case_rows([CASE], [answers])
    assert row.passed
    assert row.order == pytest.approx(10.0, abs=0.2)
    assert row.digits > 7.0
    assert row.meshes == [3, 4, 6, 8]
    assert row.gci == pytest.approx(1.25 * row.error, rel=0.3)


def test_an_error_on_the_finest_mesh_fails(answers):
    (row,) = case_rows([CASE], [spoilt(answers, [1.0, 1.0, 1.0, 1.0 + 2e-5])])
    assert row.passed is False


def test_a_wrong_order_fails_though_the_error_is_small(answers):
    # the coarsest answer better than the springs': order 7
    (row,) = case_rows([CASE], [spoilt(answers, [1.0 - 4.3e-4, 1.0, 1.0, 1.0])])
    assert row.error < row.tolerance
    assert row.passed is False


def test_a_solver_that_gave_up_fails_and_one_that_is_not_there_does_not(answers):
    none = answers.model_copy(update={"values": [[None] * 4], "failures": ["no bifurcation on the path"]})
    (row,) = case_rows([CASE], [none])
    assert row.passed is False
    assert row.not_run == "gave up: no bifurcation on the path"
    refused = answers.model_copy(update={"values": [[]], "refused": "not installed"})
    (row,) = case_rows([CASE], [refused])
    assert row.passed is None
    assert row.not_run == "refused: not installed"
    assert verification_rows([row]) == []


def test_acceptance_names_what_missed(answers):
    rows = case_rows([CASE], [spoilt(answers, [1.0, 1.0, 1.0, 1.1])])
    (verdict,) = verification_rows(rows)
    assert not verdict.passed
    assert "column-pinned, vjm" in verdict.value


def test_digits_are_capped_by_those_of_a_double():
    assert matching_digits(0.0) == 15.0
    assert matching_digits(1e-4) == pytest.approx(4.0)
    assert matching_digits(3.0) == 0.0


def test_answers_are_kept_and_used_again(tmp_path, monkeypatch):
    first = run_cases([CASE], families=("vjm",), folder=tmp_path)
    monkeypatch.setattr("vjm_validation.verification.runner.answered", lambda *_: pytest.fail("computed anew"))
    assert run_cases([CASE], families=("vjm",), folder=tmp_path) == first
    # another file under the same name is another question
    assert AnswerStore(tmp_path).find(CASE.name, {f"{CASE.name}.toml": "0" * 64}, "vjm") is None


@pytest.fixture(scope="module")
def path(chain):
    return VjmEngine().trace(chain, LoadCase("A", 2.0))


def test_metrics_are_read_where_they_are_defined(chain, path):
    metrics = path_metrics(path)
    fine = VjmEngine().trace(chain, LoadCase("A", 2.0, steps=2000))
    # central differences on a grid of 0.001 mm: 3e-10 of K1 and 2e-9 of K2, most of it rounding of forces
    before = np.searchsorted(fine.s, 0.99 * metrics.d_cr)
    after = np.searchsorted(fine.s, 1.01 * metrics.d_cr)
    slope = np.gradient(fine.force, fine.s)
    assert metrics.critical is EventKind.BIFURCATION
    assert metrics.K1 == pytest.approx(slope[before], rel=2e-8)
    assert metrics.K2 == pytest.approx(slope[after], rel=1e-7)
    assert metrics.F_end == pytest.approx(fine.force[-1], rel=1e-9)
    assert metrics.d_end == 2.0


def test_force_between_points_is_that_of_a_finer_path(chain, path):
    fine = VjmEngine().trace(chain, LoadCase("A", 2.0, steps=500))
    apart = [abs(force_at(path, s) - f) for s, f in zip(fine.s, fine.force, strict=True)]
    # cubic Hermite through points at most 0.04 mm apart, the kink at the critical point being a node
    assert max(apart) < 1e-4 * fine.force.max()


def test_force_beyond_the_end_is_refused(path):
    with pytest.raises(ValueError, match=r"the path ends at 2, before 2\.1"):
        force_at(path, 2.1)


def test_a_path_without_events_has_no_critical_point(path):
    metrics = path_metrics(replace(path, events=()))
    assert metrics.critical is None
    assert (metrics.K1, metrics.F_cr, metrics.d_cr, metrics.K2) == (None, None, None, None)


def test_a_stiffness_knee_has_no_stiffness_beside_it(chain):
    metrics = path_metrics(VjmEngine().trace(chain, LoadCase("B", 4.0)))
    assert metrics.critical is EventKind.STIFFNESS_KNEE
    assert metrics.K1 is None
    assert metrics.K2 is None
    # the definition: the tangent has fallen to half of the unloaded one there
    assert metrics.F_cr == pytest.approx(2336, rel=1e-3)
