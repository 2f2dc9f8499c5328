"""Observed order, Richardson's limit and the error estimate, on sequences that are known by construction."""

import numpy as np
import pytest

from vjm_validation.verification.judging import EXACT, SAME, TOO_FEW, convergence, fitted_order, three_mesh_order

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
