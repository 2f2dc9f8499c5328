"""Normal distributions that bounds truncate, against another solver, quadrature and scipy's truncated normal."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import lsq_linear
from scipy.stats import norm, truncnorm

from vjm_updating.inference.bounded_normal import log_beyond, log_share, mode, truncated_draws


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("condition", [10.0, 1e6])
def test_the_mode_is_that_of_another_solver(seed, condition):
    """Against scipy's bounded least squares (Stark and Parker), and the conditions of Karush, Kuhn and Tucker."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 40))
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    root = np.geomspace(1.0, condition**-0.5, n)[:, None] * Q.T
    root /= np.linalg.norm(root, axis=0)
    y = 3.0 * rng.normal(size=n)
    low = np.where(rng.random(n) < 0.3, -np.inf, -rng.random(n))
    high = np.where(rng.random(n) < 0.3, np.inf, rng.random(n))
    A, b = root.T @ root, root.T @ y
    z, free = mode(A, b, low, high)
    slope = b - A @ z
    # rounding of a solution of this condition
    tiny = 1e-15 * condition * n * np.abs(z).max() + 1e-9
    assert ((z >= low) & (z <= high)).all()
    assert np.abs(slope[free]).max(initial=0.0) < tiny
    assert (slope[~free & (z == low)] < tiny).all()
    assert (slope[~free & (z == high)] > -tiny).all()
    other = lsq_linear(root, y, (low, high), method="bvls", tol=1e-14, max_iter=1000).x
    # the other solver ends where squares fall by 1e-14: an error of 1e-7 along what is seen best
    assert 0.5 * z @ A @ z - b @ z <= 0.5 * other @ A @ other - b @ other + 1e-9


def test_the_mode_of_a_matrix_that_is_singular_to_rounding_is_within_the_bounds():
    z, free = mode(np.ones((2, 2)), np.array([1.0, 1.0]), np.full(2, -0.1), np.full(2, 0.8))
    # any split of the sum is a best one; a slope off a bound of 1e-9 of the largest is none, and rounding
    assert z.sum() == pytest.approx(1.0, abs=1e-6)
    assert ((z >= -0.1) & (z <= 0.8)).all()
    assert free.any()


@pytest.mark.parametrize("slope", [0.1, 1.0, 5.0, 30.0])
def test_what_lies_beyond_a_bound(slope):
    left = quad(lambda t: np.exp(-slope * t - 0.5 * t * t), 0.0, np.inf)[0] / np.sqrt(2.0 * np.pi)
    # quadrature's own tolerance, 1.5e-8 of the integral, which is 0.01 at least
    assert log_beyond(np.array([slope]))[0] == pytest.approx(np.log(left), abs=1e-5)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 2.0), (20.0, 21.0), (-21.0, -20.0), (-np.inf, 0.3)])
def test_the_share_between_two_ends_keeps_its_digits(low, high):
    there = quad(lambda t: norm.pdf(t) / norm.pdf(max(min(0.0, high), low)), max(low, -30.0), high, epsabs=1e-14)[0]
    expected = np.log(there) + norm.logpdf(max(min(0.0, high), low))
    # quadrature's tolerance
    assert log_share(np.array([low]), np.array([high]))[0] == pytest.approx(expected, abs=1e-7)


def test_marginals_of_a_truncated_pair():
    # x1 with mean -1 above 0 is a truncated normal; x2 follows by its regression, slope 0.9
    C = np.array([[1.0, 0.9], [0.9, 1.0]])
    x = truncated_draws(
        np.array([-1.0, 0.0]), C, np.array([0.0, -np.inf]), np.full(2, np.inf), np.array([0.1, 0.0])
    )
    one = truncnorm(1.0, np.inf, loc=-1.0)
    mean, var = one.mean(), one.var()
    # 8,000 draws: 1.1 % of a standard deviation, times three
    assert x.mean(axis=0) == pytest.approx([mean, 0.9 * (mean + 1.0)], abs=0.04)
    assert x.std(axis=0) == pytest.approx([np.sqrt(var), np.sqrt(0.19 + 0.81 * var)], rel=0.04)
    # a quantile of so rare an event: 0.0017 of probability over a density of 0.074, 1.4 % of it, times three
    assert np.quantile(x[:, 0], 0.975) == pytest.approx(one.ppf(0.975), rel=0.05)


def test_draws_of_coordinates_without_variance_stay_and_none_are_made_without_a_bound_near():
    C = np.diag([1.0, 0.0])
    x = truncated_draws(np.array([0.5, 7.0]), C, np.array([0.0, -np.inf]), np.full(2, np.inf), np.array([0.5, 7.0]))
    assert x is not None
    assert np.ptp(x[:, 1]) == 0.0
    assert x[:, 0].min() >= 0.0
    far = np.full(2, 50.0)
    assert truncated_draws(np.zeros(2), np.eye(2), -far, far, np.zeros(2)) is None
