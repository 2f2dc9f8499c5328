"""Autocorrelations of made-up noise are found, whether a model is right or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.inference.noise import uncorrelated_noise
from vjm_updating.inference.refit import STATIONARY, USUAL, estimate_autocorrelation, silent
from vjm_updating.inference.significance import FALSE_ALARMS, NOISE_KNOWN


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 0.5, 0.85])
@pytest.mark.parametrize("gaps", [0.0, 0.1])
def test_autocorrelation_is_found_below_any_trend(rho, gaps):
    n = 400
    found = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        error = rng.standard_normal((n, 6))
        for k in range(1, n):
            error[k] = rho * error[k - 1] + np.sqrt(1.0 - rho**2) * error[k]
        t = np.linspace(-1.0, 1.0, n)
        shapes = np.repeat(np.stack([t**k for k in range(6)], axis=-1)[:, None, :], 6, axis=1)
        present = rng.random((n, 6)) >= gaps
        trend = 50.0 * t**3 - 20.0 * t
        autoregression = estimate_autocorrelation(
            uncorrelated_noise(np.zeros(n, dtype=int), present), error + trend[:, None], shapes, present
        )
        found.append(autoregression.rho)
    # 36 estimates, each with a standard error of about √((1 − ρ²)/400) ≤ 0.05
    assert float(np.mean(found)) == pytest.approx(rho, abs=0.04)


@pytest.mark.slow
def test_noise_without_autocorrelation_is_found_to_have_none():
    """A small autocorrelation that chance makes of it would widen every interval."""
    n, tests = 40, 40
    rng = np.random.default_rng(3)
    present = np.ones((n, 6), dtype=bool)
    shapes = np.ones((n, 6, 1))
    found = [
        estimate_autocorrelation(
            uncorrelated_noise(np.zeros(n, dtype=int), present), rng.standard_normal((n, 6)), shapes, present
        )
        for _ in range(tests)
    ]
    # where it is not, the evidence says so with odds of more than one to one
    assert sum(not autoregression.rho.any() for autoregression in found) > tests // 2
    assert float(np.mean([autoregression.rho for autoregression in found])) < 0.02


def test_readings_without_noise_have_the_usual_autocorrelation():
    n = 100
    t = np.linspace(-1.0, 1.0, n)
    shapes = np.repeat(np.stack([t**k for k in range(3)], axis=-1)[:, None, :], 6, axis=1)
    present = np.ones((n, 6), dtype=bool)
    misfit = np.repeat((3.0 * np.sin(6.0 * t))[:, None], 6, axis=1)
    autoregression = estimate_autocorrelation(
        uncorrelated_noise(np.zeros(n, dtype=int), present), misfit, shapes, present
    )
    assert autoregression.rho.tolist() == [USUAL] * 6


@pytest.mark.parametrize("n", [20, 60, 300])
def test_noise_of_the_strongest_autocorrelation_is_hardly_ever_taken_for_none(n):
    rng = np.random.default_rng(n)
    draws = 4000
    # as much less than the sheet says as it may be
    error = rng.standard_normal((n, draws)) / np.sqrt(NOISE_KNOWN)
    for k in range(1, n):
        error[k] = STATIONARY * error[k - 1] + np.sqrt(1.0 - STATIONARY**2) * error[k]
    bends = np.diff(error, n=2, axis=0)
    # a third of them counts as independent, so that it is rarer; and three standard errors of as many draws
    alarms = float(np.mean([silent(b) for b in bends.T]))
    assert alarms < FALSE_ALARMS + 3.0 * np.sqrt(FALSE_ALARMS / draws)
    # a two-hundredth of the noise that the sheet says is none, whatever its autocorrelation
    assert silent(np.diff(0.005 * rng.standard_normal(n), n=2))


def correlated(rho, white, sequence):
    """Correlation ``(n, n)`` of a white part and one that is autocorrelated, by the distance between readings."""
    n = len(sequence)
    place = np.arange(n, dtype=float)
    result = (1.0 - white) * rho ** np.abs(place[:, None] - place) + white * np.eye(n)
    return np.where(sequence[:, None] == sequence, result, 0.0)


@pytest.mark.parametrize(("rho", "white"), [(0.6, 0.0), (0.9, 0.4), (0.0, 0.0), (0.97, 0.8)])
def test_the_filter_is_the_inverse_cholesky_factor_of_the_covariance(rho, white):
    rng = np.random.default_rng(7)
    sequence = np.repeat([0, 1, 2], [5, 9, 4])
    present = rng.random((len(sequence), 2)) > 0.2
    noise = replace(
        uncorrelated_noise(sequence, present), rho=np.array([rho, 0.5 * rho]), white=np.array([white, 0.0])
    )
    y = rng.standard_normal((len(sequence), 2, 3))
    free = noise.remove(y)
    new = rng.standard_normal((len(sequence), 2))
    back, squares = noise.back(new)
    for c, (own, share) in enumerate(zip(noise.rho, noise.white, strict=True)):
        on = present[:, c]
        C = correlated(own, share, sequence)[np.ix_(on, on)]
        inverse = np.linalg.inv(np.linalg.cholesky(C))
        # as exact as twenty readings' sums are rounded
        assert free[on, c] == pytest.approx(inverse @ y[on, c], abs=1e-10)
        assert back[on, c] == pytest.approx(inverse.T @ new[on, c], abs=1e-10)
        assert squares[on, c] == pytest.approx((inverse**2).sum(axis=0), abs=1e-10)
        assert noise.determinant[c] == pytest.approx(np.linalg.slogdet(C)[1], abs=1e-10)


def test_slow_noise_beside_white_is_found_and_its_trends_are_no_surprise():
    """With one autocorrelation alone, slow waves look like a smooth law that is missing."""
    n, slow, share = 300, 0.96, 0.35
    found, whole = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        wave = rng.standard_normal((n, 3))
        for k in range(1, n):
            wave[k] = slow * wave[k - 1] + np.sqrt(1.0 - slow**2) * wave[k]
        error = np.sqrt(share) * wave + np.sqrt(1.0 - share) * rng.standard_normal((n, 3))
        present = np.ones((n, 3), dtype=bool)
        noise = estimate_autocorrelation(
            uncorrelated_noise(np.zeros(n, dtype=int), present), error, np.ones((n, 3, 1)), present
        )
        found.append(noise.white)
        trend = np.cos(np.pi * (np.arange(n) + 0.5) / n)[:, None].repeat(3, axis=1)
        free, seen = noise.remove(trend), noise.remove(error)
        whole.append(np.sum(free * seen, axis=0) ** 2 / np.sum(free**2, axis=0))
    # twelve channels: each share is known to some tenths, their mean to a third of that
    assert float(np.mean(found)) == pytest.approx(1.0 - share, abs=0.12)
    # squares of twelve standard normal numbers: a mean beyond 2.4 is one in a thousand
    assert float(np.mean(whole)) < 2.4


def test_one_autocorrelation_is_not_taken_for_two():
    n, rho = 300, 0.7
    rng = np.random.default_rng(1)
    error = rng.standard_normal((n, 6))
    for k in range(1, n):
        error[k] = rho * error[k - 1] + np.sqrt(1.0 - rho**2) * error[k]
    present = np.ones((n, 6), dtype=bool)
    noise = estimate_autocorrelation(
        uncorrelated_noise(np.zeros(n, dtype=int), present), error, np.ones((n, 6, 1)), present
    )
    # one of six may be so by chance
    assert np.count_nonzero(noise.white) <= 1
