"""Commands that answer one question agree, on random machines of every kind.

No test here knows what is right. Two ways to an answer that differ are a failure, and so is a refusal whose reason
is not listed in `contradictions.answers.REASONS`.
"""

from pathlib import Path

import pytest

from contradictions.answers import Asked, Between, Value, judge
from contradictions.machines import KINDS, drawn
from contradictions.questions import QUESTIONS, asked_of
from vjm.model import mechanism
from vjm.rank import Rank

SEED = 20261128
TIMES = 8
"""As often a machine of every kind is drawn and asked all questions."""
DIFFERED = ((SEED, 129), (811204, 41), (5150912, 33), (5150912, 62))
"""Machines by seed and number whose ways once differed. 129: springs that stiffen under first loads, and a limit
far behind, that was denied. 41: a limit on another sheet of equilibria, to which no growing force leads, was the
map's least force. 33: a solver leaves some of the mode beside the bifurcation of a straight coupler, and no
derivative was told. 62: of cables so taut rounding leaves more than Newton's tolerance: a neighbour was said to be
unstable."""


def disagreements(number: int, folder: Path, *, slow: bool, seed: int = SEED) -> list[str]:
    """What ways differ in."""
    asked = Asked(drawn(seed, number), folder)
    questions = asked_of(asked.machine, slow=slow)
    return [str(each) for one in questions for each in judge(one, asked, slow=slow).contradictions]


@pytest.mark.parametrize("number", range(len(KINDS)), ids=list(KINDS))
def test_cheap_ways_agree(number: int, tmp_path: Path):
    assert disagreements(number, tmp_path, slow=False) == []


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "number"), DIFFERED)
def test_machines_whose_ways_once_differed_agree(seed: int, number: int, tmp_path: Path):
    assert disagreements(number, tmp_path, slow=True, seed=seed) == []


@pytest.mark.slow
@pytest.mark.parametrize("turn", range(TIMES))
def test_all_ways_agree(turn: int, tmp_path: Path):
    found = []
    for number in range(turn * len(KINDS), (turn + 1) * len(KINDS)):
        folder = tmp_path / str(number)
        folder.mkdir()
        found += disagreements(number, folder, slow=True)
    assert found == []


@pytest.mark.slow
def test_finite_elements_agree_on_every_kind(tmp_path: Path):
    found = []
    for number in range(len(KINDS)):
        folder = tmp_path / str(number)
        folder.mkdir()
        asked = Asked(drawn(SEED, number), folder)
        for question in QUESTIONS:
            if question.elements and question.fits(asked.machine):
                found += [str(each) for each in judge(question, asked, slow=True, elements=True).contradictions]
    assert found == []


def test_a_wrong_rank_is_a_contradiction(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Redundant closures counted as if each held a motion: the number of free coordinates is then too small."""
    number = list(KINDS).index("planar loop, redundant")
    (question,) = [each for each in QUESTIONS if each.name == "critical load"]
    before, after = tmp_path / "right", tmp_path / "wrong"
    before.mkdir()
    after.mkdir()
    assert judge(question, Asked(drawn(SEED, number), before), slow=False).contradictions == ()
    monkeypatch.setattr(mechanism, "rank_of", lambda rows: Rank(len(rows), float("inf")))
    found = judge(question, Asked(drawn(SEED, number), after), slow=False).contradictions
    assert any("critical load" in each.question for each in found)


def test_statements_that_differ_do_not_agree():
    one = Value([1.0, 2.0], 1e-6)
    assert one.agrees(Value([1.0, 2.0 + 1e-7], 1e-6))
    assert not one.agrees(Value([1.0, 2.1], 1e-6))
    assert Between(5.0, 5.0).agrees(Between(4.9, float("inf")))
    assert not Between(5.0, 5.0).agrees(Between(6.0, float("inf")))
