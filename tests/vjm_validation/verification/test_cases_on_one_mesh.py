"""Every case with a known answer on one mesh of every engine; `validate all` runs all meshes, with orders."""

from __future__ import annotations

import pytest

from vjm_validation.verification.judging import case_rows
from vjm_validation.verification.library import library
from vjm_validation.verification.runner import answered

ITEMS = [(case, family) for case in library() for family in case.file.engines if family in ("vjm", "exudyn")]
COARSE = 0.02
"""Relative error of a coarsest mesh at most; four elements of a column with springs at its ends have 0.016."""


@pytest.mark.quick_cases(12)
@pytest.mark.parametrize(
    ("case", "family"), [pytest.param(*item, id=f"{item[0].name}-{item[1]}") for item in ITEMS]
)
def test_an_engine_has_an_answer_on_the_coarsest_mesh(case, family):
    meshes = case.file.engines[family].meshes[:1]
    answers = answered(case, family, meshes)
    assert answers.refused == ""
    for row in case_rows([case], [answers]):
        assert row.not_run == ""
        # without a mesh there is nothing to refine
        assert row.error <= (COARSE if meshes else row.tolerance)
