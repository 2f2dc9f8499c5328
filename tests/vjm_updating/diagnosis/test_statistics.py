"""Thresholds and noise: what is promised of them holds in simulations of its own."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_updating.diagnosis.discrepancy import DRAWS, Block, least_p_values
from vjm_updating.diagnosis.evidence import Cone
from vjm_updating.diagnosis.ramp_kind import knee
from vjm_updating.diagnosis.screening import Projection, Score, best_pairs, threshold
from vjm_updating.inference.instruments import InstrumentScale, InstrumentZero


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
    assert knee(s, force) == pytest.approx(1200.0, rel=1e-10)
    assert knee(s, 1000.0 * s) is None
