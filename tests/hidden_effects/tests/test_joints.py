"""Joints with hidden causes: a few sets of `hidden_effects.joints`, and a calibration that writes a law."""

import numpy as np
import pytest
from helpers.from_files import CALIBRATED, calibrate
from hidden_effects.fresh import joint_set, outcome_of
from hidden_effects.joints.injector import HiddenJoint, drawn, write
from hidden_effects.outcome_score import wrongly_said
from hidden_effects.plan import STRONG

import vjm


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", [9, 14, 6, 1, 7, 8, 10, 11])
def test_what_was_hidden_is_found(tmp_path, seed):
    """None, stiffness, hardening, three slopes (of which one kink is reached or both), friction."""
    outcome = outcome_of(joint_set(seed, tmp_path))
    truth, found = outcome.truth, outcome.found
    assert truth.strength is None or truth.strength > STRONG
    assert truth.causes in found.named if truth.causes else found.verdict == "none"
    assert wrongly_said(truth, found) == []


def test_the_injectors_spring_bears_its_load():
    """Its torque at an angle against its wind-up under that torque, which are two ways."""
    for spring, bend in (("straight", 0.0), ("three slopes", 0.0), ("cubic", 0.3), ("hyperbolic", 0.3)):
        joint = HiddenJoint(spring=spring, bend=bend, slopes=(1.0, 1.5, 2.0))
        torque = np.linspace(-joint.torque, joint.torque, 41)
        # reason: a table of 4000 places, and halves of a range to 64 bits
        np.testing.assert_allclose(joint.spring_torque(joint.wound(torque)), torque, atol=1e-6 * joint.torque)


@pytest.mark.slow
def test_a_calibrated_model_has_the_three_slopes_as_its_law(tmp_path):
    joint = drawn(8)
    calibrate(*write(tmp_path, joint, 8), tmp_path / "out")
    (elbow, _) = vjm.load(tmp_path / "out" / CALIBRATED).parts
    wanted = [share * joint.stiffness for share in joint.slopes]
    # reason: the cell's scale is known to 0.5 %; three of that, and what noise adds
    assert [elbow.law.K1, elbow.law.K2] == pytest.approx(wanted[:2], rel=0.02)
    assert elbow.law.T1 == pytest.approx(joint.kinks[0], rel=0.03)
