"""Outliers that have pulled the fit by which they are to be found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.diagnosis import preprocess as preparation
from vjm_updating.diagnosis.screening import NEAR_BY, signatures
from vjm_updating.experiment import read_measurement
from vjm_updating.inference import refit
from vjm_updating.inference.forward import observe_ramps

BENT = 2.0
"""Sigmas of 0.003 that the force's scale is off: at the turns, at 5 kN, fifteen of a reading's noise."""


@pytest.fixture
def quiet(make, tmp_path, monkeypatch):
    """A test with nothing hidden and outliers of the force, three of them beside turns of the ramp."""
    files = make.made_up(tmp_path, {}, 3, monkeypatch)
    header, *lines = files.data.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    force = header.split(",").index("fx_N")
    # both sides of where the second posture begins, and the first turn
    for row, off in ((9, -60.0), (len(rows) // 2 - 1, 90.0), (len(rows) // 2 + 1, -80.0)):
        rows[row][force] = f"{float(rows[row][force]) + off:.4f}"
    files.data.write_text("\n".join([header, *map(",".join, rows)]) + "\n")
    return files


def test_outliers_are_found_though_they_have_pulled_the_fit(quiet, monkeypatch):
    # a residual that is steep at the turns hides them from their neighbours
    monkeypatch.setattr(preparation, "standing_out", lambda _, r, factors: np.zeros(r.shape, dtype=bool))
    prepared = preparation.prepare(observe_ramps(read_measurement(quiet.data, quiet.sheet)))
    null, fitter = prepared.null, prepared.fitter
    assert fitter.forward.observed.outliers == 0
    assert fitter.whitening.autoregression.rho[0] == 0.0
    z = null.at.z.copy()
    z[next(i for i, c in enumerate(null.found) if (c.kind, c.subject) == ("scale", "fx_N"))] += BENT
    again = preparation.refresh(prepared, replace(null, at=fitter.evaluate(null.found, z, ())))
    assert again is not None
    left_out = prepared.all.present & ~again.fitter.forward.observed.present
    # two that every made-up test has
    rows, channels = np.nonzero(left_out)
    assert set(channels) == {0}
    assert {9, 87, 89} < set(rows)
    assert len(rows) == 5
    # what the noise was made with; some 170 readings know it to √(0.75/170) = 0.07: three times that
    assert again.fitter.whitening.autoregression.rho[0] == pytest.approx(0.5, abs=0.2)


def test_a_refresh_that_changes_nothing_leaves_what_objectives_rest_on(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path, {}, 8, monkeypatch)
    prepared = preparation.prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    fitter, null = prepared.fitter, prepared.null
    # by hardly more than found before: the same
    found = fitter.whitening.autoregression.rho + 0.04
    monkeypatch.setattr(
        refit, "estimate_autocorrelation", lambda autoregression, *_: replace(autoregression, rho=found)
    )
    assert preparation.refresh(prepared, null) is None
    assert fitter.objective(null.found, null.at) == null.objective


@pytest.mark.parametrize(("stiffness", "renewed"), [(0.95, False), (0.3, True)])
def test_noise_is_found_anew_about_a_model_of_another_stiffness(make, tmp_path, monkeypatch, stiffness, renewed):
    # near a critical point; what the displacement's noise makes of forces goes with the stiffness
    files = make.made_up(tmp_path, {}, 8, monkeypatch)
    prepared = preparation.prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    null = prepared.null
    best = replace(null, at=replace(null.at, stiffness=stiffness * null.at.stiffness))
    assert (preparation.refresh(prepared, best) is not None) == renewed


def test_signatures_about_a_null_serve_others_near_by(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path, {}, 8, monkeypatch)
    prepared = preparation.prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    fitter, null, signed = prepared.fitter, prepared.null, prepared.signed
    assert signed.serves(fitter, null)
    z = null.at.z.copy()
    scale = next(i for i, c in enumerate(null.found) if (c.kind, c.subject) == ("scale", "ux_mm"))
    z[scale] += 0.9 * NEAR_BY
    near = replace(null, at=replace(null.at, z=z))
    assert signed.serves(fitter, near)
    for kept, anew in zip(signed.found, signatures(fitter, near, prepared.effects), strict=True):
        assert (kept.effect, kept.values) == (anew.effect, anew.values)
        if kept.change is not None:
            had, has = (fitter.whitening.flat(one.change) for one in (kept, anew))
            # the sheet's scale is known to 0.1 %; where the model is curved an effect changes by a few times that
            assert np.linalg.norm(had - has) < 0.01 * np.linalg.norm(has)
    z[scale] += NEAR_BY
    assert not signed.serves(fitter, replace(null, at=replace(null.at, z=z)))
    # of samples that come back nothing is known
    assert not replace(signed, present=signed.present & (np.arange(len(signed.present)) > 0)[:, None]).serves(
        fitter, null
    )
