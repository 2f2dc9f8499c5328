"""A noisy thermometer: what is smoothed away, and what stays."""

import numpy as np
import pytest

from vjm_updating.inference.observed import smoothed

NOISE = 0.05


def test_without_noise_the_readings_stay():
    readings = np.array([21.0, 21.3, 20.9])
    assert smoothed(readings, 0.0) is readings


def test_a_constant_temperature_becomes_nearly_constant():
    readings = 21.0 + NOISE * np.random.default_rng(3).standard_normal(400)
    assert np.std(smoothed(readings, NOISE)) < 0.5 * NOISE


def test_the_error_of_a_slow_course_falls():
    """A day's course of 2 K: the smoothed temperature is at least twice as near to it as the readings are."""
    truth = 21.0 + np.sin(np.linspace(0.0, np.pi, 400)) * 2.0
    readings = truth + NOISE * np.random.default_rng(5).standard_normal(400)
    error = np.sqrt(np.mean((smoothed(readings, NOISE) - truth) ** 2))
    assert error < 0.5 * NOISE


def test_it_is_the_least_squares_solution_of_a_random_walk():
    """The smoother solves min Σ (x − y)² + Σ Δx²/q for one q, the walk's variance over the noise's."""
    y = np.cumsum(np.random.default_rng(7).standard_normal(60)) * 0.3 + 20.0
    found = smoothed(y, NOISE)
    D = np.diff(np.eye(60), axis=0)
    # q from the solution's own normal equations, its first row; then all other rows must hold
    q = (found[1] - found[0]) / (found[0] - y[0])
    dense = np.linalg.solve(np.eye(60) + D.T @ D / q, y)
    # rounding, magnified by the difference of neighbours from which q is taken
    # the same sum in another order: rounding
    assert found == pytest.approx(dense, rel=1e-13)
