"""Two runs compared: what moved, what is missing, and the exit status."""

import json

import pytest

from vjm_validation.cli.main import run as command
from vjm_validation.run_difference import compared, document_of

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


def test_equal_runs_are_the_same_whatever_they_took(runs, capsys):
    first = runs("first")
    second = runs("second", lambda d: d["timings"].update(total=9.0))
    assert command(["compare", str(first), str(second)]) == 0
    assert "0 of 7 figures moved" in capsys.readouterr().out


def test_a_moved_figure_is_named_with_its_change(runs, capsys, tmp_path):
    first = runs("first")
    second = runs("second", lambda d: d["chain"]["A"]["tension"]["vjm-paper"].update(F_cr=2690.0))
    page = tmp_path / "page.html"
    assert command(["compare", str(first), str(second), "--report", str(page)]) == 1
    out = capsys.readouterr().out
    assert "F_cr" in out
    assert "0.037 %" in out  # 1 of 2691
    assert "chain / A / tension / vjm-paper / F_cr" in page.read_text()
    assert command(["compare", str(first), str(second), "--tolerance", "1e-3"]) == 0


def test_rows_are_known_by_what_they_are_of_and_not_by_their_number(runs):
    first = document_of(runs("first"))
    second = document_of(runs("second", lambda d: d["robots"]["critical"].reverse()))
    assert compared(first, second, 0.0).same


def test_a_flipped_verdict_and_a_lost_figure_count(runs):
    first = document_of(runs("first"))
    flipped = compared(first, document_of(runs("flipped", lambda d: d["acceptance"][0].update(passed=False))), 0.5)
    assert [move.name for move in flipped.moved] == ["acceptance / stability / passed"]
    without = document_of(runs("without", lambda d: d.pop("robots")))
    lost = compared(first, without, 0.5)
    assert not lost.same
    assert len(lost.lost) == 2
    # what only the second has fails nothing
    assert compared(without, first, 0.5).same


def test_what_is_no_run_is_refused(runs, tmp_path, capsys):
    assert command(["compare", str(tmp_path), str(tmp_path)]) == 2
    assert "no run: none of summary.json" in capsys.readouterr().err
    (tmp_path / "broken.json").write_text("{")
    assert command(["compare", str(tmp_path / "broken.json"), str(tmp_path / "broken.json")]) == 2
    assert "no JSON document" in capsys.readouterr().err
