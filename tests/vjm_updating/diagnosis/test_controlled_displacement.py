"""A diagnosis of a test that was driven steadily: what it takes for the displacement, and for its errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.from_files import diagnose

from vjm_updating.diagnosis.experiment import propose
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment import measurement as reading
from vjm_updating.inference.fitting import best_fit
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.instruments import ThermalDrift
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates, start

PER = 12


def true_displacement(make) -> np.ndarray:
    return np.array([row[3] for row in make.load_case(("A", "B"), 1.5, PER)])


@pytest.fixture(scope="module")
def files(make, tmp_path_factory):
    """A test with nothing hidden, driven along straight lines."""
    with pytest.MonkeyPatch.context() as patch:
        return make.made_up(tmp_path_factory.mktemp("steady"), {}, 5, patch, per=PER)


def test_what_the_gauge_reads_beside_lines_is_its_noise(make, files):
    observed = observe_ramps(reading.read_measurement(files.data, files.sheet))
    off = observed.readings.pose[:, 0] - true_displacement(make)
    left = observed.pose[:, 0] - true_displacement(make)
    assert (observed.steady[0].moved == 0.0).all()
    # of the noise that is left which looks like lines; the file has six digits
    lines = observed.steady[0].lines
    assert np.abs(left - lines @ (lines.T @ off)).max() < 1e-6
    # of independent noise that is the share of the lines' parameters, known to √(2/s), a quarter of it
    share = lines.shape[1] / len(left)
    assert share < 0.3
    assert np.sum(left**2) == pytest.approx(share * np.sum(off**2), rel=0.3)


def test_of_a_gauge_that_drifts_the_drive_is_left(files):
    observed = observe_ramps(reading.read_measurement(files.data, files.sheet))
    # the reading's drift went through the same lines as its noise
    clock = observed.clock
    drift = 2e-5 * clock
    text = files.data.read_text().splitlines()
    at = text[0].split(",").index("ux_mm")
    rows = [line.split(",") for line in text[1:]]
    for row, more in zip(rows, drift, strict=True):
        row[at] = f"{float(row[at]) + more:.6f}"
    moved = files.data.with_name("drifting.csv")
    moved.write_text("\n".join([text[0], *(",".join(row) for row in rows)]) + "\n")
    drifting = observe_ramps(reading.read_measurement(moved, files.sheet))
    assert 0 in drifting.steady
    effect = ThermalDrift(part="ux_mm", by="s", span=float(np.ptp(clock)), since=0.0)
    nuisances = nuisance_coordinates(drifting)
    found = coordinates(nuisances, (effect,))
    z = start(found, (effect,), np.zeros(len(nuisances)), [[2e-5, 0.0]])
    place = Forward(drifting).evaluate(found, z, (effect,)).place[:, 0]
    expected = drifting.steady[0].regressed(observed.readings.pose[:, 0])
    # the file has six digits
    assert np.abs(place - expected).max() < 1e-6


@pytest.mark.slow
def test_noise_of_the_gauge_makes_no_drift_of_a_steady_ramp(make, tmp_path, monkeypatch):
    """A drift with the clock takes a steady ramp's place, and forces then need none of the gauge's noise."""
    hidden = {"actuator_compliance": (4e-5,)}
    files = make.made_up(tmp_path / "made", hidden, 2, monkeypatch, per=45, postures=("A",))
    names, *lines = files.data.read_text().splitlines()
    rows = [line.split(",") for line in lines[:45]]
    rng = np.random.default_rng(6)
    for row in rows:
        row[3] = f"{float(row[3]) + 0.01 * rng.standard_normal():.6f}"
    files.data.write_text("\n".join([names, *(",".join(row) for row in rows)]) + "\n")
    files.sheet.write_text(files.sheet.read_text().replace("noise = 0.001", "noise = 0.01"))
    found = diagnose(files.data, files.sheet, tmp_path / "out")
    assert not any("thermal_drift" in c.causes for c in found.candidates)


@pytest.mark.slow
def test_the_next_experiment_counts_on_being_driven_as_steadily(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path / "made", {"actuator_hardening": (1.5,)}, 4, monkeypatch, per=PER)
    prepared = prepare(observe_ramps(reading.read_measurement(files.data, files.sheet)))
    start_ = np.zeros(len(prepared.fitter.nuisances))
    fits = []
    for cause, values in (("actuator_compliance", [3e-5]), ("base_compliance", [3e-5, 1.0, 1.0, 1.0, 1.0, 1.0])):
        effect = next(e for e in prepared.effects if e.cause == cause)
        fits.append(best_fit(prepared.fitter, (effect,), start_, [values]))
    told = propose(prepared.fitter, fits)
    observed = prepared.fitter.forward.observed
    assert 0 in observed.steady
    prepared.fitter.forward.observed = replace(observed, steady={})
    blind = propose(prepared.fitter, fits)
    assert told is not None
    assert blind is not None
    assert told.strength > blind.strength
