"""Autocorrelations of made-up noise are found, whether a model is right or not."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_updating.observation.autocorrelation import (
    STATIONARY,
    USUAL,
    estimate_autocorrelation,
    silent,
)
from vjm_updating.observation.noise import uncorrelated_noise
from vjm_updating.observation.significance import FALSE_ALARMS, NOISE_KNOWN


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
