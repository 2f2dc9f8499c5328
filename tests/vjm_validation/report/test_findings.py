"""The words follow the data: claims appear, change and vanish with it."""

from dataclasses import replace

import pytest

from vjm.io.findings import Finding, Grade
from vjm.model.load_case import Direction
from vjm_output.number_text import listed, number, percent
from vjm_validation.acceptance import model_rows
from vjm_validation.report.chapter_figures import PLACES, convergence_picture, digits_table, verified
from vjm_validation.report.findings import findings, tip_rotation
from vjm_validation.report.page import write_report, wrong_in_the_paper
from vjm_validation.report.words import Tone
from vjm_validation.studies.chain import Key
from vjm_validation.verification.judging import case_rows
from vjm_validation.verification.library import case_by_name
from vjm_validation.verification.runner import answered


def words(run, **kwargs):
    return "\n".join("\n".join([f.title, *f.sentences]) for f in findings(run, **kwargs))


def metric(run, direction, label):
    return run.summary["chain"]["A"][direction][label]


def without(run, *labels):
    run.paths = {key: path for key, path in run.paths.items() if key.engine not in labels}
    for rows in run.summary["chain"]["A"].values():
        for label in labels:
            rows.pop(label, None)


def test_the_artefact_is_named_with_its_cause(run):
    text = words(run)
    assert "link_lumping" in text
    assert "Pulled, exudyn has no critical point within 4 mm in A." in text
    assert "Cause: a translational spring at the end of a rigid link" in text
    paper, fe = metric(run, "tension", "vjm-paper"), metric(run, "compression", "exudyn")
    assert f"bifurcation at {paper['F_cr']:.0f} N" in text
    assert f"bifurcation at {fe['F_cr']:.0f} N" in text


def test_finite_elements_that_buckle_in_tension_end_the_claim(run):
    metric(run, "tension", "exudyn").update(critical="bifurcation", F_cr=2700.0, d_cr=0.8, K1=3300.0, K2=8.7)
    text = words(run)
    assert "Pulled, exudyn has no critical point" not in text
    assert "Pulled, exudyn has a critical point too: bifurcation at 2700 N, 0.8000 mm in A" in text
    assert "link_lumping" not in text
    assert "Cause: a translational spring" not in text


def test_a_paper_model_that_also_buckles_in_compression_ends_the_claim(run):
    metric(run, "compression", "vjm-paper").update(critical="limit", F_cr=9000.0, d_cr=3.0)
    assert "link_lumping" not in words(run)
    assert "never loses stability" not in words(run)


def test_without_finite_elements_nothing_is_said_about_them(run):
    without(run, "exudyn", "exudyn-footspring")
    run.lumping = ()
    text = words(run)
    assert "Nothing here is compared with finite elements" in text
    assert "link_lumping" not in text
    assert "Pulled, exudyn" not in text
    assert "agrees with the finite elements" not in text


def test_lumped_and_finite_elements_agree_until_they_do_not(run):
    assert "the lumped model agrees with the finite elements within" in words(run)
    metric(run, "compression", "vjm-16f16")["F_cr"] = 1.1 * metric(run, "compression", "exudyn")["F_cr"]
    assert "the lumped model differs from the finite elements by up to 10 %" in words(run)


def test_the_kind_of_critical_point_must_agree(run):
    metric(run, "compression", "vjm-16f16")["critical"] = "limit"
    text = words(run)
    assert "The kind of the first critical point differs: posture A in compression." in text
    assert "agrees with the finite elements within" not in text


def test_the_foot_as_a_beam_is_right_only_if_the_beams_agree(run):
    assert "the foot as a beam is right" in words(run)
    metric(run, "compression", "vjm-16f16")["d_cr"] *= 1.05
    text = words(run)
    assert "the foot as a beam is right" not in text
    assert "does not decide which law of the lumped foot is right" in text


def test_tip_rotation_is_that_of_the_foot(run):
    path = run.paths[Key("A", Direction.COMPRESSION, "vjm-16f16")]
    assert tip_rotation(path) == pytest.approx(0.036, abs=0.004)
    assert tip_rotation(run.paths[Key("A", Direction.TENSION, "exudyn")]) is None
    assert tip_rotation(None) is None


def test_the_paper_s_force_is_reproduced_or_not(run):
    assert "reproduces its published buckling force within" in words(run)
    run.summary["published"][0]["published"] = 2000.0
    text = words(run)
    assert "reproduces" not in text
    assert "misses the published one by up to" in text


def test_a_failed_acceptance_row_comes_first(run):
    run.summary["acceptance"].append(
        {"name": "agreement", "requirement": "within 1 %", "value": 0.25, "passed": False}
    )
    first = findings(run)[0]
    assert first.tone == "failed"
    assert first.title.startswith("1 of 2 acceptance rows failed")
    assert first.sentences == ("agreement: required within 1 %, found 0.2500.",)
    assert all(f.tone != "failed" for f in findings(run)[1:])


def test_a_doubtful_model_is_a_failed_row_and_ends_what_is_said_of_the_paper(run):
    noted, doubted = (Finding(grade, "model.toml: part 'bar', compliance", "1.5 times as compliant")
                      for grade in (Grade.NOTED, Grade.DOUBTFUL))  # fmt: skip
    assert [row.passed for row in model_rows([noted])] == [True]
    assert wrong_in_the_paper(run)
    (row,) = model_rows([noted, doubted])
    assert row.passed is False
    assert row.value == str(doubted)
    run.summary["acceptance"] = [row.model_dump()]
    assert wrong_in_the_paper(run) == ()


def test_table_ii_counts_only_what_can_be_compared(run):
    text = words(run)
    assert "1 of 2 comparable figures of Table II" in text
    assert "d_cr of A (published 0.82 mm" in text
    run.summary["published"][1]["inside"] = True
    assert "Not reached" not in words(run)


def test_table_ii_without_reach_claims_no_reach(run):
    for row in run.summary["published"]:
        row.update(reach_low=None, reach_high=None, inside=None)
    text = words(run)
    assert "lie within what the rounding" not in text
    assert "Ours differ from 2 comparable figures of Table II by up to" in text


def test_what_the_run_left_out_is_said(run):
    assert "Left out of this run" not in words(run)
    run.summary["notes"] = ["--quick: postures C and D were left out"]
    assert "Left out of this run\n--quick: postures C and D were left out." in words(run)


def test_a_run_without_one_side_claims_no_contradiction(run):
    del run.summary["chain"]["A"]["tension"]
    text = words(run)
    assert "link_lumping" not in text
    assert "do not show the published buckling to be an artefact" not in text


def test_an_empty_run_says_so_without_failing(run):
    run.paths, run.lumping, run.summary = {}, (), {}
    assert [f.title for f in findings(run)] == ["Nothing here is compared with finite elements"]


def test_missing_renders_are_said(run):
    assert "No renders" not in words(run)
    assert "exit status -11" in words(run, no_renders="exit status -11")


@pytest.mark.parametrize(
    ("value", "text"),
    [(8849.2, "8849"), (0.15443, "0.1544"), (3e-12, "3.00×10⁻¹²"), (9.999e-12, "1.00×10⁻¹¹"), (9.99996, "10.00"),
     (-0.43, "−0.4300"), (None, "–"), (float("nan"), "–"), (0.0, "0"), (7, "7"), (True, "yes"), ("limit", "limit")],
)  # fmt: skip
def test_numbers_as_people_write_them(value, text):
    assert number(value) == text


def test_percent_and_lists():
    assert percent(-0.0132) == "1.3 %"
    assert percent(1e-7) == "less than 0.001 %"
    assert (listed([]), listed(["A"]), listed(["A", "B", "C"])) == ("", "A", "A, B and C")


def test_every_placement_is_told_by_its_name(run):
    text = words(run)
    for name in PLACES.values():
        assert f"Posture A in compression, {name}: " in text
    assert "at the far end (the paper): with 1 none buckles; with 16 the critical force is" in text
    finest = {n: force for place, n, force in run.lumping[1].rows if place == "best"}[16]
    assert (
        f"from which the critical force is within 0.10 % of the converged {number(finest)} N: "
        "at the far end (the paper): more than 16; at the middle: more than 16; at two thirds: 8; "
        "beam-column spring (the suite's rule): 4."
    ) in text
    assert "at the far end (the paper) 2690 N with 1 and 10760 N with 2, none on the path from 4 on." in text


def test_placements_follow_the_study(run):
    tension, compression = run.lumping
    rows = tuple(row for row in compression.rows if row[0] == "middle")
    run.lumping = (replace(tension, rows=()), replace(compression, rows=(*rows, ("corner", 2, 5000.0))))
    text = words(run)
    assert "at two thirds" not in text
    assert "beam-column" not in text
    assert "Posture A in compression, corner: with 2 the critical force is 5000 N" in text
    assert "of the converged" not in text
    assert "moves away" not in text


# The chapter on verification: fewest digits, orders, and what missed.


CASES = [case_by_name("column-pinned"), case_by_name("cantilever-tip-force")]


@pytest.fixture(scope="module")
def rows():
    return [row.model_dump(mode="json") for row in case_rows(CASES, [answered(case, "vjm") for case in CASES])]


@pytest.fixture
def checked(run, rows):
    run.summary["verification"] = rows
    return run


def test_the_table_gives_the_fewest_digits_and_the_orders(checked):
    table = {row["case"]: row for row in digits_table(checked)}
    assert table["column-pinned"]["vjm"] == {"digits": "7.6", "order": "10.0 (10)", "failed": False}
    assert table["cantilever-tip-force"]["vjm"]["order"] == "4.0 (4)"
    assert table["column-pinned"]["exudyn"]["digits"] == ""


def test_the_finding_counts_and_names_what_missed(checked):
    finding = verified(checked)
    assert finding.tone is Tone.AGREES
    checked.summary["verification"][0] = {**checked.summary["verification"][0], "passed": False}
    finding = verified(checked)
    assert finding.tone is Tone.FAILED
    assert "column-pinned, vjm" in finding.sentences[-1]


def test_the_page_has_the_chapter(checked, bare, tmp_path):
    page = write_report(checked, tmp_path).read_text()
    assert '<details class="chapter" id="verification">' in page
    assert (tmp_path / "figures" / "verification.png").stat().st_size > 10_000
    assert "no engine here" in page


def test_without_cases_there_is_no_chapter(run):
    run.summary["verification"] = []
    assert convergence_picture(run) is None
    assert verified(run) is None
    assert digits_table(run) == []
