"""Which families pay, which are rivals, which of those that pay is added, and what a saving is."""

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.poses.fit import PoseSolution
from vjm_updating.poses.selection import LEAST_EVIDENCE, SURE, Saving, Trial, as_good, chosen, saving
from vjm_updating.poses.state import Errors
from vjm_updating.poses.study import outlying

SIGMA = np.ones((200, 1, 6))


def errors(mean, seed=0):
    """Distances of 200 postures with a scatter of 0.1: their mean has a standard error of 0.007."""
    drawn = mean + 0.1 * np.random.default_rng(seed).standard_normal((3, 200, 1))
    return Errors(*drawn)


def trial(**changes):
    solution = PoseSolution(np.zeros(0), {}, 0.0, np.zeros((0, 0)), np.zeros(0), np.zeros(0), {}, 1.0)
    given = {"random": Saving(0.05, 10.0), "region": Saving(0.05, 10.0), "evidence": 50.0, "errors": errors(1.0)}
    return Trial("gear_error", solution, **given | changes)


@pytest.mark.parametrize(
    ("changes", "pays", "rivals"),
    [
        ({}, True, False),
        ({"random": Saving(0.05, SURE - 0.1)}, False, True),
        ({"random": Saving(0.05, SURE - 1.5)}, False, False),
        ({"evidence": LEAST_EVIDENCE - 0.5}, False, True),
        ({"evidence": -5.0}, False, False),
        ({"region": Saving(-0.001, -0.5)}, False, True),
        ({"region": Saving(-0.05, -4.0)}, False, False),
        ({"ends": Saving(0.01, SURE - 1.5)}, False, False),
        ({"ends": Saving(0.01, SURE - 0.5)}, False, True),
        ({"ends": Saving(0.02, SURE)}, True, False),
        ({"gain_beside": -0.01}, False, False),
    ],
)
def test_rivals_within_the_noise_of_a_threshold_are_rivals(changes, pays, rivals):
    one = trial(**changes)
    assert (one.pays, one.rivals) == (pays, rivals)


def test_of_functions_of_the_posture_the_one_with_the_most_evidence_is_added():
    gears, encoders = trial(), replace(trial(evidence=80.0), name="encoder_scale")
    assert chosen([gears, encoders]) is encoders
    # one of the first order comes before them, the first of the table where they save alike
    springs = replace(trial(), name="lateral_compliance")
    joints = replace(trial(region=Saving(0.045, 9.0)), name="joint_compliance")
    assert chosen([gears, encoders, springs, joints]) is joints
    # where it saves less than errors of the laws allow it does not
    worse = replace(joints, region=Saving(0.02, 4.0))
    assert chosen([gears, encoders, springs, worse]) is springs
    assert chosen([replace(trial(), evidence=0.0)]) is None


def test_a_saving_is_as_sure_as_its_standard_error_says():
    rng = np.random.default_rng(3)
    before = np.abs(rng.standard_normal((400, 1))) + 2.0
    # differences of mean 0.1 and standard deviation 0.5: a standard error of 0.025
    found = saving(before, before - 0.1 - 0.5 * rng.standard_normal(before.shape), np.ones((400, 1, 6)))
    assert found.sure == pytest.approx(4.0, abs=1.5)  # the mean differs by one standard error or so
    assert found.share == pytest.approx(0.1 / before.mean(), abs=3.0 * 0.025 / before.mean())
    assert saving(before, before, np.ones((400, 1, 6))) == Saving(0.0, 0.0)
    assert saving(before, before - 0.5, np.ones((400, 1, 6))).sure > 1e6  # the same in each posture
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
