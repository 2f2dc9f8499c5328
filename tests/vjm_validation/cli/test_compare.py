"""Two runs compared: what moved, what is missing, and the exit status."""

import json
import math

import pytest
from helpers.command import refused, validate

from vjm_validation.cli.compare import compared, document_of

RUN = {
    "command": "validate all",
    "chain": {"A": {"tension": {"vjm-paper": {"K0": 3298.0, "F_cr": 2691.0, "critical": "bifurcation"}}}},
    "robots": {
        "critical": [
            {"pose": "Q1", "engine": "exudyn", "F_cr": 5000.0},
            {"pose": "Q2", "engine": "exudyn", "F_cr": None},
        ]
    },
    "timings": {"total": 1.0},
    "acceptance": [{"name": "stability", "value": "all", "passed": True}],
}


@pytest.fixture
def runs(tmp_path):
    def written(name, change=lambda document: None):
        document = json.loads(json.dumps(RUN))
        change(document)
        (tmp_path / name).mkdir()
        (tmp_path / name / "summary.json").write_text(json.dumps(document))
        return tmp_path / name

    return written


def test_equal_runs_are_the_same_whatever_they_took(runs):
    first = runs("first")
    second = runs("second", lambda d: d["timings"].update(total=9.0))
    assert "0 of 7 figures moved" in validate("compare", first, second).out


def test_a_moved_figure_is_named_with_its_change(runs, tmp_path):
    first = runs("first")
    second = runs("second", lambda d: d["chain"]["A"]["tension"]["vjm-paper"].update(F_cr=2690.0))
    page = tmp_path / "page.html"
    out = validate("compare", first, second, "--report", page, status=1).out
    assert "F_cr" in out
    assert "0.037 %" in out  # 1 of 2691
    assert "chain / A / tension / vjm-paper / F_cr" in page.read_text()
    validate("compare", first, second, "--tolerance", "1e-3")


def test_old_words_of_a_document_are_read_and_said(runs):
    """A run of before the words were changed has the figures of one that is written now."""
    words = {
        "old": ("ladder", "bend-over", "backlash.elbow"),
        "new": ("selection", "stiffness-knee", "actuator_backlash.elbow"),
    }

    def edit(document, key, critical, cause):
        document["chain"]["A"]["tension"]["vjm-paper"].update(
            {"critical": critical, key: [{"cause": cause, "fitted_mm": 1.0}]}
        )

    old, new = (runs(age, lambda d, said=said: edit(d, *said)) for age, said in words.items())
    said = validate("compare", old, new)
    assert "0 of 9 figures moved" in said.out
    for before, now in zip(*words.values(), strict=True):
        assert f"note: {old}/summary.json: '{before}' is now called '{now}'; the old word is read until" in said.err
    assert str(new) not in said.err


def test_rows_are_known_by_what_they_are_of_and_not_by_their_number(runs):
    first, _ = document_of(runs("first"))
    second, _ = document_of(runs("second", lambda d: d["robots"]["critical"].reverse()))
    assert compared(first, second, 0.0).same


def test_a_flipped_verdict_and_a_lost_figure_count(runs):
    first, _ = document_of(runs("first"))
    changed, _ = document_of(runs("flipped", lambda d: d["acceptance"][0].update(passed=False)))
    flipped = compared(first, changed, 0.5)
    assert [move.name for move in flipped.moved] == ["acceptance / stability / passed"]
    without, _ = document_of(runs("without", lambda d: d.pop("robots")))
    lost = compared(first, without, 0.5)
    assert not lost.same
    assert len(lost.lost) == 2
    # what only the second has fails nothing
    assert compared(without, first, 0.5).same


def test_what_is_no_run_is_refused(runs, tmp_path):
    assert "no run: none of summary.json" in refused("compare", tmp_path, tmp_path)
    (tmp_path / "broken.json").write_text("{")
    assert "no JSON document" in refused("compare", tmp_path / "broken.json", tmp_path / "broken.json")


NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("before", "after", "change"),
    [
        (2.0, 3.0, 0.5), (2.0, 20.0, 9.0), (1.0, -1.0, 2.0), (-4.0, -3.0, 0.25), (3, 3.0, 0.0), (5.0, 0.0, 1.0),
        (0.0, 0.0, 0.0), (0.0, -0.0, 0.0), (0.0, 1e-300, INF), (INF, INF, 0.0), (INF, -INF, INF), (INF, 1.0, INF),
        (1.0, INF, INF), (NAN, NAN, 0.0), (NAN, None, 0.0), (None, NAN, 0.0), (NAN, 1.0, INF), (None, "turns", INF),
        (True, True, 0.0), (True, 1, INF), (1, True, INF), (0, False, INF),
        ("1", 1, INF), ("a", "a", 0.0), ("a", "b", INF),
        (10**400, 10**400, 0.0), (10**400, 1.5, INF), (1.5, 10**400, INF),
    ],
    ids=lambda v: str(v)[:8],
)  # fmt: skip
def test_change_is_relative_to_the_reference(before, after, change):
    found = compared({"x": before, "y": 1}, {"x": after, "y": 1}, 0.0)
    assert [move.change for move in found.moved] == ([change] if change else [])
    assert not found.lost
    assert found.same == (change == 0.0)
    assert found.largest == 0.0


@pytest.mark.parametrize("before", [1.0, 0.0, INF, "bifurcation", True])
@pytest.mark.parametrize("after", [NAN, None])
def test_a_value_that_becomes_none_is_lost(before, after):
    for tolerance in (0.0, 0.9):
        found = compared({"x": before, "y": 1.0}, {"x": after, "y": 1.0}, tolerance)
        assert (found.lost, found.moved, found.same) == (["x"], [], False)


def test_lists_of_another_length_have_moved():
    assert [m.name for m in compared({"x": [1.0, 2.0]}, {"x": [1.0, 2.0, 3.0]}, 0.9).moved] == ["x / entries"]
    shorter = compared({"x": [1.0, 2.0]}, {"x": [1.0]}, 0.9)
    assert (shorter.lost, shorter.same) == (["x / 1"], False)
    assert not compared({"x": [], "y": 1}, {"x": [0.0], "y": 1}, 0.9).same
    assert not compared({"x": [[1.0]]}, {"x": [[1.0, 0.0]]}, 0.9).same
    assert not compared({"x": [1.0], "y": 1}, {"x": None, "y": 1}, 0.9).same
    # a row more has a name, and loses nothing
    assert compared(
        {"x": [{"name": "a", "F": 1.0}]}, {"x": [{"name": "a", "F": 1.0}, {"name": "b", "F": 1.0}]}, 0.0
    ).same


def test_a_real_number_in_a_row_is_a_figure_and_no_name():
    rows = [{"channel": "z", "size": 1.0}], [{"channel": "z", "size": 1.1}]
    found = compared({"x": rows[0]}, {"x": rows[1]}, 0.05)
    assert [(move.name, pytest.approx(move.change)) for move in found.moved] == [("x / z / size", 0.1)]
    assert compared({"x": rows[0]}, {"x": rows[1]}, 0.2).same


def test_an_absolute_scale_takes_zeros_that_are_rounding(runs):
    first = runs("zero", lambda d: d["chain"]["A"]["tension"]["vjm-paper"].update(K0=0.0))
    second = runs("rounded", lambda d: d["chain"]["A"]["tension"]["vjm-paper"].update(K0=3e-13))
    assert "from 0" in validate("compare", first, second, status=1).out
    validate("compare", first, second, "--absolute", "1e-9")
    validate("compare", first, second, "--absolute", "1e-13", status=1)
    for wrong in ("nan", "inf", "-1"):
        validate("compare", first, second, f"--absolute={wrong}", status=2)


def test_a_figure_that_grows_tenfold_is_printed_so_and_nan_is_named(runs):
    def change(document):
        document["chain"]["A"]["tension"]["vjm-paper"].update(F_cr=26910.0, K0=NAN)

    out = validate("compare", runs("first"), runs("second", change), "--tolerance", "0.5", status=1).out
    assert "900.0 %" in out or "900 %" in out
    assert "only in the first: chain / A / tension / vjm-paper / K0" in out
