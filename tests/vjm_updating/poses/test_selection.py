"""Which families pay, which are rivals, and which of those that pay is added."""

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.poses.fit import PoseSolution
from vjm_updating.poses.selection import LEAST_EVIDENCE, LEAST_GAIN, SURE, Trial, chosen
from vjm_updating.poses.study import Errors


def trial(**changes):
    solution = PoseSolution(np.zeros(0), {}, 0.0, np.zeros((0, 0)), np.zeros(0), np.zeros(0), {}, 1.0)
    errors = Errors(*(np.zeros((1, 1)),) * 3)
    given = {"gain_random": 0.05, "sure": 10.0, "gain_region": 0.05, "evidence": 50.0} | changes
    return Trial("gear_error", solution, errors, **given)


@pytest.mark.parametrize(
    ("changes", "pays", "rivals"),
    [
        ({}, True, False),
        ({"sure": SURE - 0.1}, False, True),
        ({"sure": SURE - 1.5}, False, False),
        ({"evidence": LEAST_EVIDENCE - 0.5}, False, True),
        ({"evidence": -5.0}, False, False),
        ({"gain_random": 0.9 * LEAST_GAIN, "gain_region": LEAST_GAIN, "sure": 4.0}, False, True),
        ({"gain_ends": 0.0}, False, False),
        ({"gain_ends": 0.02}, True, False),
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
    joints = replace(trial(gain_random=0.045, gain_region=0.045), name="joint_compliance")
    assert chosen([gears, encoders, springs, joints]) is joints
