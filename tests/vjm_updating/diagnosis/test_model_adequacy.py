"""What a fit leaves without a name is seen: waves of any period, jumps at any time; noise is not."""

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.diagnosis import preprocess as preparation
from vjm_updating.diagnosis.discrepancy import DRAWS, Block, least_p_values, misfit
from vjm_updating.diagnosis.evidence import Cone
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.ramp_kind import knee
from vjm_updating.diagnosis.screening import NEAR_BY, Projection, Score, best_pairs, signatures, threshold
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.verdict import judge
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference import refit
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.instruments import InstrumentScale, InstrumentZero
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
    residual = null.evaluation.residual.copy()
    residual[:, 0] += np.where(fitter.whitening.present[:, 0], force, 0.0)
    return misfit(fitter, replace(null, evaluation=replace(null.evaluation, residual=residual)))


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
    force = np.zeros(len(observed.imposed))
    force[own[int(share * len(own)) :]] = FORCE
    rest = with_more(prepared, force)
    assert rest.p < RARE
    assert rest.left > 10.0


def test_an_oscillation_in_one_channel_is_seen(prepared):
    # a pump next door, in time and not along the ramp; of all channels together the residual is hardly larger
    rest = with_more(
        prepared, 0.6 * FORCE * np.sin(2.0 * np.pi * np.arange(len(prepared.null.evaluation.place)) / 9.3)
    )
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


# Outliers that have pulled the fit by which they are to be found.


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


@pytest.mark.slow
def test_outliers_are_found_though_they_have_pulled_the_fit(quiet, monkeypatch):
    # a residual that is steep at the turns hides them from their neighbours
    monkeypatch.setattr(preparation, "standing_out", lambda _, r, factors: np.zeros(r.shape, dtype=bool))
    prepared = preparation.prepare(observe_ramps(read_measurement(quiet.data, quiet.sheet)))
    null, fitter = prepared.null, prepared.fitter
    assert fitter.forward.observed.outliers == 0
    assert fitter.whitening.autoregression.rho[0] == 0.0
    z = null.evaluation.z.copy()
    z[next(i for i, c in enumerate(null.parameters) if (c.kind, c.subject) == ("scale", "fx_N"))] += BENT
    other = replace(null, evaluation=fitter.evaluate(null.parameters, z, ()))
    again = preparation.refresh(prepared, other, prepared.aside)
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
    assert preparation.refresh(prepared, null, prepared.aside) is None
    assert fitter.objective(null.parameters, null.evaluation) == null.objective


@pytest.mark.parametrize(("stiffness", "renewed"), [(0.95, False), (0.3, True)])
def test_noise_is_found_anew_about_a_model_of_another_stiffness(make, tmp_path, monkeypatch, stiffness, renewed):
    # near a critical point; what the displacement's noise makes of forces goes with the stiffness
    files = make.made_up(tmp_path, {}, 8, monkeypatch)
    prepared = preparation.prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    null = prepared.null
    best = replace(null, evaluation=replace(null.evaluation, stiffness=stiffness * null.evaluation.stiffness))
    assert (preparation.refresh(prepared, best, prepared.aside) is not None) == renewed


def test_signatures_about_a_null_serve_others_near_by(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path, {}, 8, monkeypatch)
    prepared = preparation.prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    fitter, null, signed = prepared.fitter, prepared.null, prepared.signed
    assert signed.serves(fitter, null)
    z = null.evaluation.z.copy()
    scale = next(i for i, c in enumerate(null.parameters) if (c.kind, c.subject) == ("scale", "ux_mm"))
    z[scale] += 0.9 * NEAR_BY
    near = replace(null, evaluation=replace(null.evaluation, z=z))
    assert signed.serves(fitter, near)
    for kept, anew in zip(signed.signatures, signatures(fitter, near, prepared.effects), strict=True):
        assert (kept.effect, kept.values) == (anew.effect, anew.values)
        if kept.change is not None:
            had, has = (fitter.whitening.flat(one.change) for one in (kept, anew))
            # the sheet's scale is known to 0.1 %; where the model is curved an effect changes by a few times that
            assert np.linalg.norm(had - has) < 0.01 * np.linalg.norm(has)
    z[scale] += NEAR_BY
    assert not signed.serves(fitter, replace(null, evaluation=replace(null.evaluation, z=z)))
    # of samples that come back nothing is known
    assert not replace(signed, present=signed.present & (np.arange(len(signed.present)) > 0)[:, None]).serves(
        fitter, null
    )


# Thresholds and noise: what is promised of them holds in simulations of its own.


def score(directions, effect=None):
    cone = Cone.of(np.eye(directions.shape[1]), one_sided=False, vector=True)
    return Score(effect, 0.0, 0.0, ((),), directions, cone)


def test_independent_effects_share_the_rate():
    basis = np.linalg.qr(np.random.default_rng(0).standard_normal((200, 20)))[0]
    found = [score(basis[:, [k]]) for k in range(20)]
    # the least of 20 independent p-values; 40 of 10 000 draws lie below, known to 16 %: 2.5 standard errors
    assert threshold(found) == pytest.approx(1.0 - (1.0 - 0.004) ** (1.0 / 20.0), rel=0.4)


def test_one_effect_many_times_is_one_effect():
    direction = np.linalg.qr(np.random.default_rng(0).standard_normal((50, 1)))[0]
    # 2.5 standard errors of 40 draws; twelve effects counted as different would have 12 times less
    assert threshold([score(direction)] * 12) == pytest.approx(0.004, rel=0.4)


def test_a_pair_explains_what_least_squares_do():
    rng = np.random.default_rng(4)
    residual, common = rng.standard_normal(60), rng.standard_normal((60, 1))
    # the first two share a direction, but for a hundredth of it, which counts as none
    shared = np.hstack([common, common + 0.01 * rng.standard_normal((60, 1))])
    columns = [
        np.hstack([shared[:, [0]], rng.standard_normal((60, 1))]),
        np.hstack([shared[:, [1]], rng.standard_normal((60, 2))]),
        rng.standard_normal((60, 2)),
    ]
    effects = InstrumentZero(part="Fx_N"), InstrumentScale(part="Fx_N"), InstrumentZero(part="Fy_N")
    found = [score(np.linalg.qr(own)[0], effect) for own, effect in zip(columns, effects, strict=True)]
    pairs = best_pairs(Projection(np.zeros((60, 0)), residual, 60, {}), found, 9)
    # two zeros are one cause
    assert {(a.effect, b.effect) for a, b, _ in pairs} == {(effects[0], effects[1]), (effects[1], effects[2])}
    for a, b, worth in pairs:
        both = np.hstack([a.directions, b.directions])
        if a.effect == effects[0]:
            # of the shared direction the mean
            both = np.linalg.svd(both, full_matrices=False)[0][:, :4]
        left = residual - both @ np.linalg.lstsq(both, residual, rcond=None)[0]
        # round-off, over squares of singular values of which 1/400 of the largest still counts
        assert worth == pytest.approx(residual @ residual - left @ left - 2.0 * both.shape[1], rel=1e-11)
    assert pairs[0][2] == max(worth for *_, worth in pairs)


def test_the_least_p_of_blocks_is_exact_below_a_level():
    basis = np.linalg.qr(np.random.default_rng(1).standard_normal((80, 30)))[0]
    blocks = [Block("", basis[:, 3 * k : 3 * k + 3]) for k in range(10)]
    whole, tail = least_p_values(blocks, 1.0), least_p_values(blocks, 0.04)
    np.testing.assert_array_equal(tail[whole < 0.04], whole[whole < 0.04])
    assert (tail[whole > 0.04] == 1.0).all()
    # of ten independent blocks; three standard errors of as many draws, a seventh of what is expected
    expected = 1.0 - (1.0 - 0.01) ** 10
    error = (expected * (1.0 - expected) / DRAWS) ** 0.5
    assert np.mean(whole < 0.01) == pytest.approx(expected, abs=3.0 * error)


def test_the_knee_is_where_the_lines_meet():
    s = np.linspace(0.0, 2.0, 41)
    force = np.minimum(1000.0 * s, 1200.0 + 20.0 * (s - 1.2))
    # one of the places is where the lines meet
    assert knee(s, force)[1] == pytest.approx(1200.0, rel=1e-10)
    assert knee(s, 1000.0 * s) is None
