"""Whether 95 % intervals cover the truth in 95 % of all tests: many made-up ones of one machine, all dice fixed."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from vjm.batch import map_all
from vjm_validation.calibration.fit import fit
from vjm_validation.calibration.problem import problem_of
from vjm_validation.calibration.profile import profile_interval
from vjm_validation.measurement import read_measurement

from . import synthetic
from .conftest import ENGINE, RAMPS, TRUTH

REPETITIONS, FEW = 400, 24
LENGTH_MM = 0.2
"""Tolerance of the link's length."""


def covered(seed: int, rho: float, wild: float, steps: int) -> list[bool]:
    """Which intervals of one test hold the truth.

    The nuisances are drawn anew, as the sheet allows: zeros and scales of the channels, the link's length.
    """
    rng = np.random.default_rng([17, seed])
    machine = synthetic.lengthened(synthetic.changed(TRUTH, ENGINE), "link", LENGTH_MM * rng.standard_normal())
    rows = synthetic.readings(synthetic.of_model(machine, ENGINE), RAMPS, steps, rng, rho=rho, wild=wild)
    sheet = synthetic.sheet_text(foot=1, link=4, tolerance=f"link_length_mm = {LENGTH_MM}")
    with tempfile.TemporaryDirectory() as folder:
        files = synthetic.write(Path(folder), rows, sheet)
        measurement = read_measurement(files.data, files.sheet)
    found = fit(problem_of(measurement, tuple(TRUTH)))
    ends = [profile_interval(found, i) for i in range(len(TRUTH))]
    return [low <= z <= high for (low, high), z in zip(ends, TRUTH.values(), strict=True)]


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


def test_a_few_intervals_cover():
    check([covered(seed, rho=0.0, wild=0.0, steps=12) for seed in range(FEW)])


@pytest.mark.slow
@pytest.mark.parametrize(("rho", "wild", "steps"), [(0.0, 0.0, 12), (0.6, 0.02, 30)], ids=["white", "red and wild"])
def test_intervals_cover(rho: float, wild: float, steps: int):
    check(map_all(partial(covered, rho=rho, wild=wild, steps=steps), range(REPETITIONS), 2))
