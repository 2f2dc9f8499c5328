"""A beam that relaxes beside other elements, by what predicts the readings."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_updating.experiment import measurement as reading
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.parameters import coordinates, start
from vjm_updating.mechanisms.drives import ActuatorCompliance
from vjm_updating.mechanisms.hysteresis import Creep

DRIVE = 5e-5
"""mm/N."""


@pytest.mark.parametrize("part", ["foot", "link"])
def test_a_drive_in_series_is_the_drive_in_a_chain_that_relaxes(make, tmp_path, monkeypatch, part):
    # ones, of which no unit can be told
    monkeypatch.setattr(reading, "check_units", lambda *args: None)
    rows = make.load_case(("A", "B"), 1.5, 8)
    true = np.array([row[3] for row in rows])
    softer = make.SHEET.replace("[model]\n", f"[model]\nactuator_compliance_mm_per_N = {DRIVE}\n")

    def force(sheet, hypothesis, values):
        files = make.write(tmp_path, rows, np.ones((len(rows), 6)), true, sheet)
        found = coordinates([], hypothesis)
        at = Forward(observe_ramps(reading.read_measurement(files.data, files.sheet)))
        return at.evaluate(found, start(found, hypothesis, np.zeros(0), values), hypothesis).wrench[:, 0]

    creep, values = Creep(part), (0.05, 20.0, 0.25, 10.0)
    built_in = force(softer, (creep,), [values])
    relaxes = force(softer, (), []) - built_in
    in_series = force(make.SHEET, (creep, ActuatorCompliance()), [values, (DRIVE,)])
    assert np.abs(relaxes).max() > 5.0
    # measured 2e-5: rounds of what relaxes and of the drive, whose last change is of the third order in their sizes
    np.testing.assert_allclose(in_series, built_in, rtol=0.0, atol=1e-4 * np.abs(relaxes).max())
