"""Autocorrelations of made-up noise are found, whether a model is right or not."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from vjm_updating.experiment import Instrument, Sheet
from vjm_updating.inference import significance as d
from vjm_updating.inference.noise import noise_of, rounding_step, uncorrelated_noise
from vjm_updating.inference.refit import STATIONARY, USUAL, estimate_autocorrelation, silent
from vjm_updating.inference.significance import (
    FALSE_ALARMS,
    NOISE_KNOWN,
    PairedGain,
    Worth,
    paired_gain,
    student_isf,
)


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


# Steps to which readings are rounded are told from steps that a test takes.


def measured(noise, **channels):
    known = {name: Instrument(noise=noise) for name in channels}
    sheet = Sheet(test={"model": "orthoglide-chain"}, instrument=known, file="sheet.toml")
    return SimpleNamespace(readings=SimpleNamespace(values=channels), sheet=sheet)


def test_rounding_is_seen_where_values_are_read_twice():
    rng = np.random.default_rng(1)
    force = np.linspace(0.0, 100.0, 300) + rng.standard_normal(300)
    assert rounding_step(force) == 0.0
    # most values are different ones; round-off of numbers of some hundred over the step
    fine = 0.25 * np.round(force / 0.25)
    assert len(np.unique(fine)) > 150
    assert rounding_step(fine) == pytest.approx(0.25, rel=1e-12)
    # a channel that reads next to nothing has two levels
    assert rounding_step(400.0 * np.round(force / 400.0 + 0.375)) == 400.0
    # steps of a test, each read once
    assert rounding_step(np.arange(0.0, 100.0, 5.0)) == 0.0


@pytest.mark.parametrize(("step", "rounded"), [(3.4, True), (3.5, False)])
def test_a_gauge_rounds_to_no_more_than_its_own_noise(step, rounded):
    # even errors of half a step have a standard deviation of a step over √12
    place = step * np.tile(np.arange(10.0), 4)
    noise = noise_of(measured(1.0, ux_mm=place))
    assert noise.quantum == ({"ux_mm": pytest.approx(step)} if rounded else {})
    assert noise.pose[0] == pytest.approx(np.hypot(1.0, step / np.sqrt(12.0)) if rounded else 1.0)


def test_a_force_without_noise_has_that_of_its_rounding():
    force = 25.0 * np.tile(np.arange(10.0), 4)
    # round-off
    assert noise_of(measured(0.0, fx_N=force)).wrench[0] == pytest.approx(25.0 / np.sqrt(12.0), rel=1e-12)
    with pytest.raises(ValueError, match="fx_N"):
        noise_of(measured(0.0, fx_N=np.linspace(0.0, 1.0, 40) ** 2))


# The tails against scipy.stats, which has them by other means.


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
    for chance in (0.7, 0.3, 0.002, 1e-12, 1e-300):
        assert d.normal_isf(chance) == pytest.approx(stats.norm.isf(chance), rel=1e-12)


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


# Whether a prediction is better beyond noise, by blocks of readings that err alike.


BLOCKS, EACH = 5, 40
BLOCK = np.repeat(np.arange(BLOCKS), EACH)


def drawn(rng, shift, scatter):
    """Errors of two predictions: their ratio is what each block has in common, of a mean and a scatter."""
    was = np.sqrt(rng.uniform(0.5, 1.5, (BLOCKS * EACH, 1)))
    common = shift + scatter * rng.standard_normal(BLOCKS)
    return was, was * np.exp(-0.5 * common[BLOCK][:, None])


@pytest.mark.parametrize("shift", [0.0, 0.15], ids=["alike", "better"])
def test_of_predictions_that_are_alike_five_in_a_hundred_seem_not(shift):
    rng = np.random.default_rng(4)
    found = []
    for _ in range(2000):
        was, now = drawn(rng, shift, 0.1)
        found.append(paired_gain(was, now, BLOCK, np.ones_like(was)).worth)
    shares = [np.mean([one is worth for one in found]) for worth in (Worth.BETTER, Worth.WORSE)]
    if shift:
        # 1.5 of the blocks' scatter, five of them: the noncentral t distribution says 0.74
        assert shares[0] == pytest.approx(0.74, abs=0.05)
    else:
        # standard errors of the shares are 0.0035
        assert shares == pytest.approx([0.025, 0.025], abs=0.014)


def test_readings_of_a_block_are_no_independent_witnesses():
    """Were they, differences that each block has in common would be sure of the wrong sign in most tests."""
    rng = np.random.default_rng(5)
    alone = np.arange(BLOCKS * EACH)
    by_block, by_reading = [], []
    for _ in range(300):
        was, now = drawn(rng, 0.0, 0.1)
        for found, block in ((by_block, BLOCK), (by_reading, alone)):
            found.append(paired_gain(was, now, block, np.ones_like(was)).worth is not Worth.ALIKE)
    assert np.mean(by_reading) > 0.5
    assert np.mean(by_block) < 0.1


def test_the_gain_by_hand():
    was, now = np.array([[3.0], [1.0], [2.0], [np.nan]]), np.array([[1.0], [1.0], [1.0], [5.0]])
    found = paired_gain(was, now, np.array([0, 0, 1, 2]), np.array([[1.0], [2.0], [1.0], [1.0]]))
    # blocks of weights 3 and 1 with the squares 11 and 4 before, 3 and 1 after
    ratio = np.log([11.0 / 3.0, 4.0])
    mean = (3.0 * ratio[0] + ratio[1]) / 4.0
    assert found == PairedGain(
        pytest.approx(np.sqrt(15.0 / 4.0)), 1.0, pytest.approx(mean),
        pytest.approx(np.sqrt(2.0 * ((3.0 * (ratio[0] - mean)) ** 2 + (ratio[1] - mean) ** 2)) / 4.0), 2,
    )  # fmt: skip
    assert student_isf(0.025, 4) == pytest.approx(2.776, abs=5e-4)


def test_a_gain_in_every_block_is_one_though_the_blocks_differ_by_factors():
    was = np.array([1.0, 2.0, 5.0, 10.0, 30.0])[:, None]
    found = paired_gain(was, np.full((5, 1), 0.1), np.arange(5), np.ones((5, 1)))
    assert found.worth is Worth.BETTER
    # all errors together must say so, too
    was[:4], now = 1.0, np.array([0.5, 0.5, 0.5, 0.5, 31.0])[:, None]
    assert paired_gain(was, now, np.arange(5), np.ones((5, 1))).worth is Worth.ALIKE


def test_the_noise_is_what_decides():
    found = PairedGain(2.0, 1.5, 0.5, 0.1, 5)
    assert found.worth is Worth.BETTER
    assert found.saved > found.noise
    assert found.saved == pytest.approx(1.0 - np.exp(-0.25))
    assert PairedGain(2.0, 1.8, 0.2, 0.1, 5).worth is Worth.ALIKE
    assert PairedGain(1.5, 2.0, -0.5, 0.1, 5).worth is Worth.WORSE


def test_of_one_block_nothing_is_known():
    assert paired_gain(np.full((4, 1), 2.0), np.ones((4, 1)), np.zeros(4, dtype=int), np.ones((4, 1))).worth is (
        Worth.ALIKE
    )
    assert paired_gain(np.full((2, 1), np.nan), np.ones((2, 1)), np.arange(2), np.ones((2, 1))) is None
