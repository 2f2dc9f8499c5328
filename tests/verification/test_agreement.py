"""Lumped springs, geometrically exact and corotational beams agree on the paper's own chain."""

import pytest

from vjm.engines import engine_by_name
from vjm.io.model_file import load_chain
from vjm.model.load_case import Direction, LoadCase, ramp_end
from vjm_fea.opensees.beams import MISSING, available
from vjm_validation.acceptance import agreement_rows
from vjm_validation.studies.chain import SECOND, Key


def traced(postures, directions, engines):
    chain = load_chain("orthoglide-chain")
    return {
        Key(posture, way, name): engine_by_name(name).trace(chain, LoadCase(posture, ramp_end(chain, posture, way)))
        for posture in postures
        for way in directions
        for name in engines
    }


@pytest.fixture(scope="module")
def paths():
    return traced("A", [Direction.COMPRESSION], ["vjm-16f16", "exudyn", "exudyn-footspring"])


def test_springs_and_exact_beams_agree_in_a(paths):
    rows = agreement_rows(paths)
    assert len(rows) == 6
    assert [row for row in rows if not row.passed] == []
    # an independent prototype found 8849 N, whose last digit is 1e-4 of it; 16 elements err by 1e-5
    assert paths[Key("A", Direction.COMPRESSION, "exudyn")].critical.force == pytest.approx(8849.1, rel=1e-4)


def test_another_law_of_the_foot_is_no_agreement(paths):
    first, second, other = (paths[key] for key in paths)
    rows = agreement_rows(dict(zip(paths, (first, other, second), strict=True)))
    # the critical displacement moves by 0.8 %, the force by nothing
    failed = [row.name for row in rows if row.passed is False]
    assert "agreement of vjm-16f16 and exudyn: critical displacements" in failed
    assert "agreement of vjm-16f16 and exudyn: critical forces" not in failed


def test_an_engine_that_is_not_there_fails_nothing(paths):
    last = agreement_rows(paths, second=True)[-1]
    assert (last.name, last.passed) == (f"agreement with {SECOND}", None)
    assert MISSING in last.value
    assert agreement_rows({}) == []


@pytest.mark.slow
def test_three_engines_agree_everywhere():
    if not available():
        pytest.skip(MISSING)
    rows = agreement_rows(traced("ABCD", list(Direction), ["vjm-16f16", "exudyn", SECOND]))
    assert len(rows) == 3 * 6
    assert [row for row in rows if not row.passed] == []
