"""How sure a saving is, and which readings are outliers."""

import numpy as np
import pytest

from vjm_updating.poses.held_out import as_good, saved, surely_saved
from vjm_updating.poses.state import Errors
from vjm_updating.poses.study import outlying

SIGMA = np.ones((200, 1, 6))


def errors(mean, seed=0):
    """Distances of 200 postures with a scatter of 0.1: their mean has a standard error of 0.007."""
    drawn = mean + 0.1 * np.random.default_rng(seed).standard_normal((3, 200, 1))
    return Errors(*drawn)


def test_a_saving_is_as_sure_as_its_standard_error_says():
    rng = np.random.default_rng(3)
    before = np.abs(rng.standard_normal((400, 1))) + 2.0
    # differences of mean 0.1 and standard deviation 0.5: a standard error of 0.025
    after, sigma = before - 0.1 - 0.5 * rng.standard_normal(before.shape), np.ones((400, 1, 6))
    assert surely_saved(before, after, sigma) == pytest.approx(4.0, abs=1.5)  # the mean's own error is one and more
    assert saved(before, after) == pytest.approx(0.1 / before.mean(), abs=3.0 * 0.025 / before.mean())
    assert (saved(before, before), surely_saved(before, before, sigma)) == (0.0, 0.0)
    assert surely_saved(before, before - 0.5, sigma) > 1e6  # the same in each posture
    assert as_good(errors(1.0), errors(1.0, 1), SIGMA)
    assert not as_good(errors(1.1), errors(1.0, 1), SIGMA)
    assert as_good(errors(1.0), errors(1.1, 1), SIGMA)


def test_of_a_heavy_tail_none_is_outlying_and_what_is_far_beyond_is():
    rng = np.random.default_rng(11)
    alarms = 0
    for _ in range(500):
        # three errors of Student's distribution with four degrees of freedom
        scale = np.sqrt(rng.chisquare(4.0, (150, 1, 1)) / 4.0)
        misfit = np.linalg.norm(rng.standard_normal((150, 1, 3)) / scale, axis=2)
        alarms += bool(outlying(misfit).any())
    assert alarms <= 8  # two of 500 by the rate of false alarms; eight and more once in a thousand times
    misfit[7] = 50.0 * np.median(misfit)
    misfit[9] = np.nan
    assert outlying(misfit)[7]
    assert not outlying(misfit)[9]
