"""Lumped springs, geometrically exact and corotational beams agree on the paper's own chain."""

import pytest

from vjm_fea.opensees.beams import MISSING, available
from vjm_validation.verification import study as module
from vjm_validation.verification.study import BEHIND, CRITICAL, CURVE, triangulation


def judged(rows):
    for row in rows:
        assert row.passed, (row.posture, row.direction, row.quantity, row.engines, row.difference, row.not_run)


def test_springs_and_exact_beams_agree_in_a_and_b():
    rows = triangulation(quick=True, families=("vjm", "exudyn"))
    assert [(row.posture, row.quantity) for row in rows] == [("A", CRITICAL), ("A", BEHIND), ("B", CURVE)]
    judged(rows)
    assert rows[0].tolerance == 1e-3
    assert rows[1].tolerance == 2e-3
    assert rows[2].tolerance == 5e-3
    # an independent prototype found 8849 N
    assert rows[0].values[0] == pytest.approx(8849.1, rel=1e-5)
    assert all(row.estimate < 1e-4 for row in rows)


@pytest.mark.slow
def test_three_engines_agree_everywhere():
    if not available():
        pytest.skip(MISSING)
    rows = triangulation()
    # A and C: two quantities in compression and a curve in tension; B and D: two curves; three pairs each
    assert len(rows) == 3 * (2 * 3 + 2 * 2)
    judged(rows)


def test_an_engine_that_is_not_there_fails_nothing(monkeypatch):
    def missing(family, mesh, **_):
        raise ImportError("not installed")

    real = module.engine
    monkeypatch.setattr(
        module, "engine", lambda family, *a, **k: (missing if family == "opensees" else real)(family, *a, **k)
    )
    rows = triangulation(quick=True, families=("vjm", "opensees"))
    assert all(row.passed is None and "not installed" in row.not_run for row in rows)
