"""Rows: what fails, what does not count, and what a refusal says."""

import pytest

from vjm_validation.acceptance import verification_rows
from vjm_validation.verification.judging import case_rows, matching_digits
from vjm_validation.verification.library import case_by_name
from vjm_validation.verification.runner import AnswerStore, answered, run_cases
from vjm_validation.verification.study import Verification

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
    assert verification_rows(Verification([row])) == []


def test_acceptance_names_what_missed(answers):
    rows = case_rows([CASE], [spoilt(answers, [1.0, 1.0, 1.0, 1.1])])
    (verdict,) = verification_rows(Verification(rows))
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
