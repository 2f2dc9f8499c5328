"""What a fit leaves without a name is seen: waves of any period, jumps at any time; noise is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.diagnosis.discrepancy import misfit
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.verdict import judge
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.model_error import driven_place

FORCE = 8.0
"""Four standard deviations of a reading, N."""
RARE = 1e-3
"""Chance of noise that would look so, from which on a shape counts as seen here."""


@pytest.fixture(scope="module")
def prepared(make, tmp_path_factory):
    with pytest.MonkeyPatch.context() as monkeypatch:
        files = make.made_up(tmp_path_factory.mktemp("quiet"), {}, 8, monkeypatch)
    return prepare(observe_ramps(read_measurement(files.data, files.sheet)))


def with_more(prepared, force):
    """The null's fit had the first channel read so much more, N ``(n,)``."""
    fitter, null = prepared.fitter, prepared.null
    residual = null.at.residual.copy()
    residual[:, 0] += np.where(fitter.whitening.present[:, 0], force, 0.0)
    return misfit(fitter, replace(null, at=replace(null.at, residual=residual)))


def test_noise_is_nothing(prepared):
    rest = with_more(prepared, 0.0)
    assert rest.p > 0.05
    assert rest.worst == ""


# of no period that is looked for; the last is lost between two readings
@pytest.mark.parametrize(("period", "seen"), [(0.37, True), (0.23, True), (0.05, False)])
def test_a_wave_along_the_ramp_is_seen(prepared, period, seen):
    place = driven_place(prepared.fitter.forward.observed)
    rest = with_more(prepared, FORCE * np.sin(2.0 * np.pi * place / period + 1.0))
    assert (rest.p < RARE) is seen
    assert ("fx_N: a wave" in rest.worst) is seen


@pytest.mark.parametrize("share", [0.3, 0.55, 0.8])
def test_a_jump_in_one_posture_is_seen(prepared, share):
    observed = prepared.fitter.forward.observed
    own = np.flatnonzero(observed.readings.posture == "B")
    force = np.zeros(len(observed.pose))
    force[own[int(share * len(own)) :]] = FORCE
    rest = with_more(prepared, force)
    assert rest.p < RARE
    assert rest.left > 10.0


def test_an_oscillation_in_one_channel_is_seen(prepared):
    # a pump next door, in time and not along the ramp; of all channels together the residual is hardly larger
    rest = with_more(prepared, 0.6 * FORCE * np.sin(2.0 * np.pi * np.arange(len(prepared.null.at.place)) / 9.3))
    # alone it counts from 1 in 1000; of all channels together it would be 5 in 1000
    assert rest.p < 0.001
    assert rest.left > 50.0


@pytest.mark.slow
# readings that know the zero twenty times as well as the sheet: no shape tells what the sheet does not allow
@pytest.mark.parametrize(("sigmas", "verdict"), [(1.5, "none"), (8.0, "unknown")])
def test_a_fit_that_needs_one_nuisance_far_off_the_sheet_is_not_right(make, tmp_path, monkeypatch, sigmas, verdict):
    sheet = make.SHEET.replace("noise = 2.0\nzero = 3.0", "noise = 2.0\nzero = 20.0")
    files = make.made_up(tmp_path, {}, 3, monkeypatch)
    readings = read_measurement(files.data, files.sheet).readings
    wrench = np.nan_to_num(readings.wrench)
    wrench[:, 0] += 20.0 * sigmas
    files = make.write(tmp_path, make.load_case(("A", "B"), 1.5, 10), wrench, readings.pose[:, 0], sheet)
    prepared = prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    search = Search(prepared.fitter, prepared.null, [], 100.0)
    found = judge(search, search.run())
    assert found.kind == verdict
    assert found.rest.p > RARE
    assert (found.rest.prior_p < 1e-6) is (verdict == "unknown")
    # the drawing's own zero, a tenth of a sigma or 2 N, on top
    assert ("zero fx_N 8.1 sigma" in found.rest.farthest) is (verdict == "unknown")
