"""The world's axes do not show: a chain on a turned base answers the same, turned."""

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.rotations import rotation_from_vector
from vjm_validation.verification.library import BASELINES, case_by_name, library
from vjm_validation.verification.study import TOLERANCE, TURN, difference, invariance_rows, turned

FAST = ("column-pinned", "cantilever-tip-force", "linear-l-frame", "toggle", "bend-45", "lumped-dead-follower")


def judged(rows):
    assert rows
    for row in rows:
        assert row.tolerance == TOLERANCE == 1e-9
        assert row.passed, (row.name, row.error, row.not_run)


def test_the_papers_chain_and_cases_are_invariant():
    judged(invariance_rows([case_by_name(name) for name in FAST], chains=("vjm",)))


@pytest.mark.slow
def test_every_case_and_every_engine_is_invariant():
    judged(invariance_rows(library()))


def test_a_preferred_axis_would_show():
    chain = load_chain("orthoglide-chain")
    load_case = LoadCase("A", -3.0, steps=4)
    here = VjmEngine(4).trace(chain, load_case)
    other, moved = turned(chain, load_case, TURN)
    # the base turned a little further than the load case: what a mixed-up frame would do
    spoilt = turned(other, moved, np.eye(3))[0]
    askew = rotation_from_vector([0.0, 1e-4, 0.0])
    there = VjmEngine(4).trace(turned(spoilt, moved, askew)[0], moved)
    assert difference(here, there, TURN) > 1e3 * TOLERANCE


def test_partly_free_load_cases_are_refused():
    chain = load_chain("orthoglide-chain")
    with pytest.raises(ValueError, match="cannot be turned"):
        turned(chain, LoadCase("A", -1.0, free=("ry",)), TURN)


def test_linear_families_are_not_turned():
    rows = invariance_rows([case_by_name("linear-cantilever")], families=BASELINES, chains=())
    assert rows == []
