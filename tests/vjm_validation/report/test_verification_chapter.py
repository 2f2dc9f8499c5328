"""The chapter on verification: fewest digits, orders, pairs of engines, and what missed."""

import pytest

from vjm_validation.report.chapter_figures import convergence_picture, digits_table, verified
from vjm_validation.report.page import write_report
from vjm_validation.report.words import Tone
from vjm_validation.verification.judging import TriangulationRow, case_rows
from vjm_validation.verification.library import case_by_name
from vjm_validation.verification.runner import answered

CASES = [case_by_name("column-pinned"), case_by_name("cantilever-tip-force")]


@pytest.fixture(scope="module")
def rows():
    return [row.model_dump(mode="json") for row in case_rows(CASES, [answered(case, "vjm") for case in CASES])]


@pytest.fixture
def checked(run, rows):
    pair = TriangulationRow(
        posture="A", direction="compression", quantity="critical force, N", engines=("vjm", "exudyn"),
        values=(8849.1, 8849.0), extrapolated=(8849.1, 8849.1), difference=1.1e-5, estimate=2e-5, within=True,
        tolerance=1e-3, passed=True,
    )  # fmt: skip
    away = pair.model_copy(update={"passed": None, "not_run": "opensees: not installed", "difference": None})
    run.summary["verification"] = rows
    run.summary["triangulation"] = [pair.model_dump(mode="json"), away.model_dump(mode="json")]
    return run


def test_the_table_gives_the_fewest_digits_and_the_orders(checked):
    table = {row["case"]: row for row in digits_table(checked)}
    assert table["column-pinned"]["vjm"] == {"digits": "7.6", "order": "10.0 (10)", "failed": False}
    assert table["cantilever-tip-force"]["vjm"]["order"] == "4.0 (4)"
    assert table["column-pinned"]["exudyn"]["digits"] == ""


def test_the_finding_counts_and_names_what_missed(checked):
    finding = verified(checked)
    assert finding.tone is Tone.AGREES
    assert "critical forces 1.1×10⁻⁵" in " ".join(finding.sentences)
    checked.summary["verification"][0] = {**checked.summary["verification"][0], "passed": False}
    finding = verified(checked)
    assert finding.tone is Tone.FAILED
    assert "column-pinned, vjm" in finding.sentences[-1]


def test_the_page_has_the_chapter(checked, bare, tmp_path):
    page = write_report(checked, tmp_path).read_text()
    assert '<details class="chapter" id="verification">' in page
    assert (tmp_path / "figures" / "verification.png").stat().st_size > 10_000
    assert "opensees: not installed" in page
    assert "no engine here" in page


def test_without_cases_there_is_no_chapter(run):
    run.summary["verification"] = []
    assert convergence_picture(run) is None
    assert verified(run) is None
    assert digits_table(run) == []
