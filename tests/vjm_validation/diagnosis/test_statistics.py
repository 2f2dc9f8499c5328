"""Thresholds and noise: what is promised of them holds in simulations of its own."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_validation.calibration.noise import memory_of
from vjm_validation.diagnosis.cones import Cone
from vjm_validation.diagnosis.critical import knee
from vjm_validation.diagnosis.noise_model import USUAL, estimate_memory
from vjm_validation.diagnosis.screening import Score, threshold


def score(directions):
    cone = Cone.of(np.eye(directions.shape[1]), one_sided=False, vector=True)
    return Score(None, 0.0, 0.0, 1.0, ((),), directions, cone)


def test_independent_effects_share_the_rate():
    basis = np.linalg.qr(np.random.default_rng(0).standard_normal((200, 20)))[0]
    found = [score(basis[:, [k]]) for k in range(20)]
    # the least of 20 independent p-values; 40 of 10 000 draws lie below, known to 16 %: 2.5 standard errors
    assert threshold(found) == pytest.approx(1.0 - (1.0 - 0.004) ** (1.0 / 20.0), rel=0.4)


def test_one_effect_many_times_is_one_effect():
    direction = np.linalg.qr(np.random.default_rng(0).standard_normal((50, 1)))[0]
    # 2.5 standard errors of 40 draws; twelve effects counted as different would have 12 times less
    assert threshold([score(direction)] * 12) == pytest.approx(0.004, rel=0.4)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.85])
def test_memory_is_found_below_any_trend(rho):
    n = 400
    found = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        error = rng.standard_normal((n, 6))
        for k in range(1, n):
            error[k] = rho * error[k - 1] + np.sqrt(1.0 - rho**2) * error[k]
        t = np.linspace(-1.0, 1.0, n)
        shapes = np.repeat(np.stack([t**k for k in range(6)], axis=-1)[:, None, :], 6, axis=1)
        present = np.ones((n, 6), dtype=bool)
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


def test_the_knee_is_where_the_lines_meet():
    s = np.linspace(0.0, 2.0, 41)
    force = np.minimum(1000.0 * s, 1200.0 + 20.0 * (s - 1.2))
    assert knee(s, force) == pytest.approx(1200.0, rel=0.01)
    assert knee(s, 1000.0 * s) is None
