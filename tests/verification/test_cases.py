"""Every case with a known answer on every engine: the answer within its tolerance, and by theory's order.

Cases and engines that take longer than a few seconds are marked slow. What is judged here is what `validate all`
judges; references are closed forms, other programs' or printed figures, never an engine's own stored output.
"""

import pytest

from vjm_fea.opensees.beams import MISSING, available
from vjm_validation.verification.judging import case_rows
from vjm_validation.verification.library import library
from vjm_validation.verification.runner import answered

SLOW = {
    "vjm": {"coil-spring"},
    # elements on a refined arc, in space, or many of them
    "exudyn": {
        "arch-120", "arch-180", "arch-215", "arch-240", "princeton-13-3", "princeton-8-9", "bend-45",
        "column-pinned-shear", "column-clamped-pinned-shear", "column-end-springs", "postbuckling-pinned-shear",
        "cantilever-tip-moment", "cantilever-follower-large", "column-partly-following",
        "postbuckling-clamped-free", "column-clamped-free", "cantilever-tip-force-shear", "strip-lateral",
        "lee-frame", "williams-toggle", "right-angle-frame-force", "right-angle-frame-moment", "twisted-cantilever",
        "coil-spring", "toggle-snap-back",
    },
    "opensees": {case.name for case in library()} - {"toggle", "column-pinned", "cantilever-tip-force"},
}  # fmt: skip


def pairs():
    for case in library():
        for family in case.file.engines:
            slow = case.name in SLOW.get(family, ())
            yield pytest.param(case, family, id=f"{case.name}-{family}", marks=[pytest.mark.slow] if slow else [])


@pytest.mark.quick_cases(16)
@pytest.mark.parametrize(("case", "family"), list(pairs()))
def test_the_answer_is_met(case, family):
    if family == "opensees" and not available():
        pytest.skip(MISSING)
    rows = case_rows([case], [answered(case, family)])
    assert len(rows) == len(case.questions)
    for row in rows:
        if case.name in REFUSED.get(family, ()):
            assert row.passed is None
            assert row.not_run.startswith("refused"), row
        else:
            assert row.passed, (row.quantity, row.errors, row.tolerance, row.order, row.flag, row.not_run)


REFUSED = {
    # corotational beams without shear cannot be asked for it
    "opensees": {"column-pinned-shear", "column-clamped-pinned-shear", "postbuckling-pinned-shear"}
}
"""What an engine cannot express, and says so."""


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
