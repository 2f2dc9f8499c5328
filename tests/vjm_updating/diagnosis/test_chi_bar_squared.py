"""What mixtures of trials explain: the projection by another algorithm, and its chances in noise of one's own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.stats import chi2

from vjm_updating.diagnosis.evidence import Cone


def trials(d, k, *, narrow=1.0, seed=0):
    rng = np.random.default_rng(seed)
    return np.eye(d)[:, :1] + narrow * rng.standard_normal((d, k))


@pytest.mark.parametrize(("d", "k"), [(1, 1), (2, 2), (2, 4), (3, 3), (3, 5), (4, 4)])
def test_projection_is_that_of_non_negative_least_squares(d, k):
    edges = trials(d, k)
    cone = Cone.of(edges, one_sided=True, vector=False)
    z = np.random.default_rng(1).standard_normal((d, 200))
    wanted = [float(residual @ residual) - nnls(edges, residual)[1] ** 2 for residual in z.T]
    # rounding: 1e-16 of squares up to 30, times the conditions of these faces, 3e3 at most
    np.testing.assert_allclose(cone.explained(z), wanted, rtol=0.0, atol=1e-10)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("one_sided", [True, False])
@pytest.mark.parametrize(("d", "k", "narrow"), [(1, 1, 1.0), (2, 2, 0.2), (3, 4, 0.4), (4, 4, 0.7)])
def test_chances_are_those_of_noise(d, k, narrow, one_sided):
    cone = Cone.of(trials(d, k, narrow=narrow), one_sided=one_sided, vector=False)
    draws = 200_000
    p = cone.chance(cone.explained(np.random.default_rng(2).standard_normal((d, draws))))
    for rate in (0.05, 0.003):
        # three standard errors of these draws; and of the weights' 4000, which know what one trial alone explains
        # to 5 %, and the rarer others to 12 % and more of a smaller part
        error = 3.0 / np.sqrt(rate * draws) + 0.07
        assert np.mean(p < rate) == pytest.approx(rate, rel=error)


def test_one_way_is_half_as_likely_as_both():
    one, both = (Cone.of(np.array([[2.0]]), one_sided=own, vector=False) for own in (True, False))
    assert one.chance(np.array([16.0]))[0] == pytest.approx(0.5 * chi2.sf(16.0, 1))
    assert both.chance(np.array([16.0]))[0] == pytest.approx(chi2.sf(16.0, 1))
    assert one.explained(np.array([[-4.0]]))[0] == 0.0
    assert both.explained(np.array([[-4.0]]))[0] == pytest.approx(16.0)


def test_a_narrow_cone_is_hardly_more_than_one_direction():
    cone = Cone.of(trials(3, 4, narrow=0.01), one_sided=False, vector=False)
    # of a width of 0.03 it adds twice that share of a circle in two directions, 0.06 / 2π exp(-8) of 6.3e-5: 5 %;
    # three standard errors of the drawn weight are another 5 %
    assert cone.chance(np.array([16.0]))[0] == pytest.approx(chi2.sf(16.0, 1), rel=0.1)
    assert chi2.sf(16.0, 3) > 10.0 * chi2.sf(16.0, 1)


def test_of_a_vector_all_directions_count():
    cone = Cone.of(trials(2, 3), one_sided=False, vector=True)
    z = np.random.default_rng(3).standard_normal((2, 50))
    np.testing.assert_allclose(cone.explained(z), np.sum(z**2, axis=0))
    np.testing.assert_allclose(cone.chance(cone.explained(z)), chi2.sf(np.sum(z**2, axis=0), 2))


def test_a_trial_and_its_opposite_are_one_where_both_signs_make_sense():
    edges = np.array([[1.0, -1.0], [0.1, -0.1]])
    same, single = (Cone.of(own, one_sided=False, vector=False) for own in (edges, edges[:, :1]))
    z = np.random.default_rng(4).standard_normal((2, 50))
    np.testing.assert_allclose(same.explained(z), single.explained(z))
    # the weight of one direction is drawn: 4000 draws know one half to 1.6 %: three times that
    assert same.chance(np.array([9.0]))[0] == pytest.approx(chi2.sf(9.0, 1), rel=0.05)
