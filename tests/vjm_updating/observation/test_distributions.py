"""The tails against scipy.stats, which has them by other means."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from vjm_updating.inference import significance as d

SAME = {"rtol": 1e-12, "atol": 0.0}


@pytest.mark.parametrize("freedom", [1, 2, 3.7, 12, 288])
def test_chi_squared(freedom):
    x = np.array([0.0, 1e-9, 0.3, 1.0, 5.0, 40.0, 300.0, 1400.0])
    np.testing.assert_allclose(d.chi2_sf(x, freedom), stats.chi2.sf(x, freedom), **SAME)
    assert float(d.chi2_sf(-1.0, freedom)) == 1.0
    assert np.isnan(float(d.chi2_sf(1.0, 0)))
    for chance in (0.9, 0.5, 0.004, 1e-9):
        assert d.chi2_isf(chance, freedom) == pytest.approx(stats.chi2.isf(chance, freedom), rel=1e-12)


def test_normal():
    x = np.array([-9.0, -1.0, 0.0, 0.5, 3.0, 9.0, 30.0])
    np.testing.assert_allclose(d.normal_sf(x), stats.norm.sf(x), **SAME)
    assert float(d.normal_sf(3.0)) == pytest.approx(1.3498980316300946e-3, rel=1e-12)
    for chance in (0.7, 0.3, 0.002, 1e-12, 1e-300):
        assert d.normal_isf(chance) == pytest.approx(stats.norm.isf(chance), rel=1e-12)
    chances = np.array([[0.1, 0.5], [0.975, 1e-8]])
    np.testing.assert_allclose(d.normal_quantile(chances), stats.norm.ppf(chances), **SAME)


@pytest.mark.parametrize(("above", "below"), [(1, 4), (3, 100), (17, 2)])
def test_f(above, below):
    for x in (0.0, 0.2, 1.0, 30.0, 1e4):
        assert d.f_logsf(x, above, below) == pytest.approx(stats.f.logsf(x, above, below), rel=1e-12, abs=1e-15)
    assert d.f_logsf(1e9, 40, 400) == -np.inf


@pytest.mark.parametrize(("count", "samples"), [(0, 5), (1, 1), (2, 30), (30, 288), (288, 288), (7, 6)])
def test_beta_binomial(count, samples):
    ours = d.rare_share_sf(count, samples, 49.0)
    # its own upper tail is one less a sum, which has lost digits where little is left
    assert ours == pytest.approx(
        stats.betabinom.pmf(range(count, samples + 1), samples, 1.0, 49.0).sum(), rel=1e-12
    )
    assert ours == pytest.approx(stats.betabinom.sf(count - 1, samples, 1.0, 49.0), abs=1e-12)


@pytest.mark.parametrize(("total", "marked"), [(1, 1), (20, 20), (12, 5), (288, 40), (288, 250), (600, 3)])
def test_hypergeometric(total, marked):
    drawn = np.arange(1, total + 1)
    for count in (0, 1, 2, marked // 2, marked):
        counts = np.full(total, count)
        ours, theirs = d.drawn_sf(counts, total, marked, drawn), stats.hypergeom.sf(count - 1, total, marked, drawn)
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-300)
    assert d.drawn_sf(np.array([2]), 4, 2, np.array([2]))[0] == pytest.approx(1.0 / 6.0, rel=1e-15)


def test_latin_hypercube():
    np.testing.assert_array_equal(d.latin_hypercube(50, 3, 0), stats.qmc.LatinHypercube(3, rng=0).random(50))


@pytest.mark.slow
def test_no_command_waits_for_scipy_stats():
    module = "vjm_validation.cli.measured_data"
    code = f"import sys, {module}; print([name for name in ('scipy.stats', 'matplotlib') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
