"""Cases with a known answer: a few on their engines, and what the library as a whole has to hold.

All cases on all engines are what `validate all` judges; ``tests/vjm_validation/studies/test_run_all.py`` looks at a
whole run. References are closed forms, other programs' or printed figures, never an engine's own stored output.
"""

import pytest

from vjm_validation.verification.judging import case_rows
from vjm_validation.verification.library import case_by_name, library
from vjm_validation.verification.runner import answered


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("linear-cantilever", "vjm-linear"), ("linear-root-springs", "msa"), ("cantilever-tip-force", "exudyn"),
        ("sprung-arm", "vjm"), ("postbuckling-clamped", "vjm"), ("postbuckling-pinned-far", "vjm"),
        ("arch-180", "vjm"),
    ],
)  # fmt: skip
def test_the_answer_is_met(name, family):
    case = case_by_name(name)
    rows = case_rows([case], [answered(case, family)])
    assert len(rows) == len(case.questions)
    for row in rows:
        assert row.passed, (row.quantity, row.errors, row.tolerance, row.order, row.flag, row.not_run)


@pytest.mark.parametrize("case", [case for case in library() if case.file.kind == "exact"], ids=lambda c: c.name)
def test_exact_cases_demand_four_digits_of_springs_and_exact_beams(case):
    for family in {"vjm", "exudyn"} & set(case.file.engines):
        assert case.file.engines[family].tolerance <= 1e-4


def test_every_case_that_springs_and_beams_can_express_is_asked_of_both():
    lone = {case.name for case in library() if "exudyn" not in case.file.engines}
    # without beams Exudyn has no points by which it can name the branch behind a bifurcation
    assert lone == {"lumped-bar-buckled", "lumped-two-bars-buckled"}
    assert all("vjm" in case.file.engines for case in library())


def test_the_table_of_cases_is_complete():
    names = {case.name for case in library()}
    assert {
        *("cantilever-tip-force", "cantilever-tip-moment", "cantilever-tip-force-shear", "cantilever-follower"),
        *("column-pinned", "column-clamped-free", "column-clamped-pinned", "column-clamped-clamped"),
        *("column-end-springs", "column-lateral-spring", "column-pinned-shear"),
        *("postbuckling-pinned", "postbuckling-pinned-far", "bend-45", "princeton-8-9", "princeton-13-3"),
        *("arch-120", "arch-180", "arch-215", "arch-240", "lumped-bar", "lumped-two-bars", "toggle"),
        *("strip-lateral", "toggle-snap-back", "lumped-dead-follower", "linear-cantilever", "linear-l-frame"),
        *("lee-frame", "williams-toggle", "right-angle-frame-force", "right-angle-frame-moment"),
        *("steep-truss-sideways", "sprung-arm", "twisted-cantilever", "coil-spring"),
    } <= names
