"""Tables that stand for a joint's spring and all that sits in series with it."""

import numpy as np
import pytest

from vjm.model.laws import StrainWave
from vjm_updating.calibration.calibrated_model import TABLE_ERROR, tabulated

GEAR = StrainWave(K1=3e7, K2=5e7, K3=6e7, T1=1.5e4, T2=5e4)


def wound_up(torque):
    """A gear behind a free travel, rad."""
    return np.array([GEAR.deflection(t) for t in torque.tolist()]) + 2e-4 * np.sign(torque)


def test_a_table_keeps_the_corners_of_what_it_stands_for():
    law = tabulated(wound_up, 8e4)
    torque = np.linspace(-8e4, 8e4, 4001)
    torque = torque[torque != 0.0]
    found = np.array([law.deflection(t) for t in torque.tolist()])
    assert np.abs(found - wound_up(torque)).max() < 4.0 * TABLE_ERROR * np.ptp(wound_up(torque))
    # the tangent beside a corner is that of its own side; a cubic's slope errs by more than its place, 0.2 % here
    for t in (1.4e4, 1.6e4, 4.8e4, 5.2e4):
        assert law.tangent(law.deflection(t)) == pytest.approx(GEAR.tangent(GEAR.deflection(t)), rel=5e-3)


def test_there_is_none_where_more_load_would_deflect_less():
    assert tabulated(lambda torque: 1e-8 * torque - 1e-3 * np.sign(torque), 8e4) is None


def test_it_counts_from_no_load_whatever_rounding_says():
    law = tabulated(lambda torque: 1e-8 * torque + 1e-16 * len(torque), 8e4)
    assert float(law.force(0.0)) == 0.0
    # rounding of pairs of 1e-14 beside deflections of 1e-4
    assert law.deflection(4e4) == pytest.approx(4e-4, rel=1e-9)
