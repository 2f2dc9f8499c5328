"""A calibration of what a diagnosis frees says the same of it: one inference for both."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

from vjm_updating.calibration.fit import problem_of, solve
from vjm_updating.diagnosis.evidence import estimates
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.fitting import best_fit
from vjm_updating.inference.forward import observe_ramps

PARTS = ("foot", "link")


def test_calibration_and_diagnosis_find_the_same_springs():
    folder = Path(str(resources.files("vjm_validation") / "examples/soft-springs"))
    measurement = read_measurement(folder / "readings.csv", folder / "sheet.toml")

    calibrated = solve(problem_of(measurement, [f"{part}.factor" for part in PARTS]))
    unknowns = calibrated.problem.unknowns
    values = [unknown.value(z) for unknown, z in zip(unknowns.sought, calibrated.z, strict=False)]
    deviations = [value * calibrated.covariance[i, i] ** 0.5 for i, value in enumerate(values)]

    prepared = prepare(observe_ramps(measurement))
    causes = {effect.label: effect for effect in prepared.effects}
    hypothesis = tuple(causes[f"{part}_compliance"] for part in PARTS)
    fit = best_fit(prepared.fitter, hypothesis, prepared.null.at.z, [[1.0], [1.0]])
    assert fit is not None
    found = estimates(prepared.fitter, fit, 0.0)
    for part, value, deviation in zip(PARTS, values, deviations, strict=True):
        diagnosed = found[f"{part}_compliance.factor"]
        # a diagnosis takes lines in time for the displacement and interpolates: some hundredths of a deviation
        assert diagnosed.value == pytest.approx(value, abs=0.2 * deviation)
        assert diagnosed.std == pytest.approx(deviation, rel=0.05)
