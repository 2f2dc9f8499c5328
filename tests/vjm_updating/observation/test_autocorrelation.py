"""Autocorrelations of made-up noise are found, whether a model is right or not."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_updating.observation.autocorrelation import USUAL, estimate_memory
from vjm_updating.observation.noise import memory_of


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.85])
@pytest.mark.parametrize("gaps", [0.0, 0.1])
def test_memory_is_found_below_any_trend(rho, gaps):
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
        memory = estimate_memory(
            memory_of(np.zeros(n, dtype=int), present), error + trend[:, None], shapes, present
        )
        found.append(memory.rho)
    # 36 estimates, each with a standard error of about √((1 − ρ²)/400) ≤ 0.05
    assert float(np.mean(found)) == pytest.approx(rho, abs=0.04)


def test_readings_without_noise_have_the_usual_memory():
    n = 100
    t = np.linspace(-1.0, 1.0, n)
    shapes = np.repeat(np.stack([t**k for k in range(3)], axis=-1)[:, None, :], 6, axis=1)
    present = np.ones((n, 6), dtype=bool)
    misfit = np.repeat((3.0 * np.sin(6.0 * t))[:, None], 6, axis=1)
    memory = estimate_memory(memory_of(np.zeros(n, dtype=int), present), misfit, shapes, present)
    assert memory.rho.tolist() == [USUAL] * 6
