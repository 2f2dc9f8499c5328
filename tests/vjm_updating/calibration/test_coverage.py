"""Whether 95 % intervals cover the truth in 95 % of all tests: many made-up ones of one machine, all dice fixed."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtri

from vjm_updating.calibration.fit import problem_of, solve
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.profile import profile_interval

from . import synthetic
from .conftest import ENGINE, RAMPS, TRUTH

REPETITIONS = 400
LENGTH_MM = 0.2
"""Tolerance of the link's length."""


def balanced(repetitions: int) -> np.ndarray:
    """Standard normal numbers ``(repetitions, 15)`` for the nuisances, each column in equal shares of probability.

    A Latin hypercube: the sheet's nuisances make most of an interval, and a few hundred plain throws of them are by
    chance too wide or too narrow by more than what is tested here.
    """
    rng = np.random.default_rng(17)
    shares = (np.arange(repetitions) + 0.5) / repetitions
    columns = [rng.permutation(ndtri(shares)) for _ in range(2 * len(synthetic.COLUMNS) + 3)]
    return np.column_stack(columns)


def covered(test: tuple[int, np.ndarray], rho: float, outliers: float, steps: int) -> list[bool]:
    """Which intervals of one test hold the truth.

    Args:
        test: its number, and standard normal numbers for its nuisances: the link's length, zeros and scales.
        rho: autocorrelation of the noise.
        outliers: share of readings that are outliers.
        steps: readings of a ramp.
    """
    number, drawn = test
    rng = np.random.default_rng([17, number])
    machine = synthetic.lengthened(synthetic.changed(TRUTH, ENGINE), "link", LENGTH_MM * drawn[0])
    trace = synthetic.of_model(machine, ENGINE)
    rows = synthetic.readings(trace, RAMPS, steps, rng, rho=rho, outliers=outliers, drawn=drawn[1:].tolist())
    sheet = synthetic.sheet_text(foot=1, link=4, tolerance=f"link_length_mm = {LENGTH_MM}")
    with tempfile.TemporaryDirectory() as folder:
        files = synthetic.write(Path(folder), rows, sheet)
        measurement = read_measurement(files.data, files.sheet)
    found = solve(problem_of(measurement, tuple(TRUTH)))
    ends = [profile_interval(found.fitter, found.fit, i, found.covariance) for i in range(len(TRUTH))]
    return [end.low <= z <= end.high for end, z in zip(ends, TRUTH.values(), strict=True)]


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    z, p = 1.96, hits / of
    middle = (p + z**2 / (2 * of)) / (1 + z**2 / of)
    half = z / (1 + z**2 / of) * np.sqrt(p * (1 - p) / of + z**2 / (4 * of**2))
    return middle - half, middle + half


def check(results: list[list[bool]]) -> None:
    for name, hits in zip(TRUTH, np.sum(results, axis=0), strict=True):
        low, high = wilson(int(hits), len(results))

        assert low <= 0.95 <= high, f"{name}: {hits} of {len(results)}"


def test_wilson_of_a_textbook():
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)  # Newcombe 1998, table I


@pytest.mark.slow
def test_intervals_cover():
    check([covered(test, rho=0.0, outliers=0.0, steps=12) for test in enumerate(balanced(REPETITIONS))])
