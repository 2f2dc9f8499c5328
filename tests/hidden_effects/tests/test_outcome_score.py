"""Figures of sets by their probabilities: small sets counted by hand."""

import json

import numpy as np
import pytest
from hidden_effects import fresh
from hidden_effects.outcome import Found, Outcome, Truth, covered, found_of, of_given, of_poses
from hidden_effects.outcome_score import (
    both_right,
    chances,
    count,
    figures,
    main_right,
    markdown,
    outside_right,
    paired,
    paired_markdown,
    reliability,
    wrongly_said,
)
from hidden_effects.poses.plan import GROUPS, plans
from scipy.stats import poisson


def truth(group, *causes, strength=10.0, **more):
    return Truth("any", "1", group, frozenset(causes), strength, **more)


def row(cause, probability, share=None, word="acts"):
    return {"cause": cause, "probability": probability, "share": share, "word": word}


def found(verdict, *rows, groups=(), candidates=(), parameters=None):
    return found_of(
        {
            "verdict": verdict,
            "findings": {"causes": list(rows), "groups": [{"causes": list(g)} for g in groups]},
            "candidates": [{"causes": list(c)} for c in candidates],
            "parameters": parameters or {},
            "busy": 2.0,
        }
    )


class TestMain:
    def test_is_the_largest_share_and_not_the_largest_probability(self):
        said = found("named", row("creep", 1.0, 0.1), row("gravity", 0.96, 0.8))
        assert main_right(Outcome(truth("single", "gravity"), said))
        assert not main_right(Outcome(truth("single", "creep"), said))

    def test_is_right_by_its_group(self):
        rows = [row("creep", 0.6, 0.9, "one of these acts"), row("gravity", 0.4, 0.8, "one of these acts")]
        said = found("class", *rows, groups=[["creep", "gravity"]])
        assert main_right(Outcome(truth("single", "gravity"), said))

    def test_guesses_of_an_unknown_do_not_count(self):
        said = found("unknown", row("creep", 1.0, 0.9, "may act"))
        assert not main_right(Outcome(truth("single", "creep"), said))

    def test_offsets_stand_for_errors_of_frames(self):
        said = found("named", row("joint_offset", 0.99, 0.9))
        assert main_right(Outcome(truth("single", "frame_error"), said))


def test_two_versions_are_compared_on_the_same_sets():
    """Eight of ten sets differ: seven are right only by the second, one only by the first; 2 (1 + 8) / 2⁸."""
    one, quiet = truth("single", "creep"), truth("quiet")
    hit, miss = found("named", row("creep", 1.0, 1.0)), found("named", row("gravity", 1.0, 1.0))
    nothing = found("none")
    truths = [one] * 8 + [quiet] * 2 + [truth("single", "creep", strength=4.0)]
    before = [*[miss] * 7, hit, nothing, nothing, miss]
    after = [*[hit] * 7, miss, nothing, nothing, hit]
    by_group = paired([(Outcome(t, b), Outcome(t, a)) for t, b, a in zip(truths, before, after, strict=True)])
    assert list(by_group) == ["single", "quiet", "all"]
    every = by_group["all"]
    # the weak one is left out
    assert (every["sets"], every["before"], every["after"]) == (10, 3, 9)
    assert (every["better"], every["worse"]) == (7, 1)
    assert every["p_value"] == pytest.approx(18 / 2**8)
    assert by_group["quiet"]["p_value"] == 1.0
    assert "| all | 10 | 3 | 9 | 7 | 1 | 0.07 |" in paired_markdown(by_group)


class TestSaid:
    def test_one_cause_too_many_and_one_group_too_many(self):
        said = found("named", row("creep", 1.0), row("gravity", 0.97), groups=[["link_bow", "link_length"]])
        assert wrongly_said(truth("single", "creep"), said) == ["gravity", "link_bow or link_length"]

    def test_a_group_with_the_cause_is_not_wrong(self):
        assert wrongly_said(truth("single", "creep"), found("class", groups=[["creep", "gravity"]])) == []

    def test_both_of_a_pair_need_two_findings(self):
        pair = truth("pair", "creep", "gravity")
        assert both_right(Outcome(pair, found("named", row("creep", 1.0), row("gravity", 1.0))))
        assert both_right(Outcome(pair, found("class", row("creep", 1.0), groups=[["gravity", "link_bow"]])))
        # of one group one acts: it does not tell of both
        assert not both_right(Outcome(pair, found("class", groups=[["gravity", "creep"]])))
        assert both_right(Outcome(pair, found("class", groups=[["gravity", "creep"], ["creep", "link_bow"]])))

    def test_outside(self):
        strange = truth("outside", alike=frozenset([frozenset(["creep"])]))
        assert outside_right(Outcome(strange, found("unknown")))
        assert outside_right(Outcome(strange, found("named", candidates=[["creep"]])))
        assert not outside_right(Outcome(strange, found("class", candidates=[["creep"], ["gravity"]])))
        assert not outside_right(Outcome(strange, found("none")))
        assert not outside_right(Outcome(strange, Found(error="no end")))


class TestReliability:
    def test_of_probabilities_that_hold(self):
        pairs = [(0.25, k % 4 == 0) for k in range(400)] + [(0.75, k % 4 != 0) for k in range(400)]
        rows = reliability(pairs)
        assert rows["error"] == pytest.approx(0.0)
        assert rows["largest"] == 0.0
        assert [r["causes"] for r in rows["tenths"]] == [400, 400]

    def test_of_probabilities_that_are_too_high(self):
        # 0.95 said, six in ten act: off by 0.35; and 0.5 said, half act
        pairs = [(0.95, k % 10 < 6) for k in range(100)] + [(0.5, k % 2 == 0) for k in range(300)]
        rows = reliability(pairs)
        assert rows["error"] == pytest.approx(0.25 * 0.35)
        assert rows["largest"] == pytest.approx(0.35)

    def test_one_belongs_to_the_last_tenth(self):
        assert reliability([(1.0, True)])["tenths"][0]["from"] == 0.9

    def test_a_hidden_cause_counts_where_it_is_listed(self):
        said = Outcome(truth("single", "creep"), found("named", row("creep", 0.9), row("gravity", 0.1)))
        assert sorted(chances([said])) == [(0.1, False), (0.9, True)]


def test_interval_of_a_count_is_the_one_of_poisson():
    low, high = count(3, 1)["interval95"]
    assert poisson.sf(2, low) == pytest.approx(0.025)
    assert poisson.cdf(3, high) == pytest.approx(0.025)
    assert count(0, 10)["interval95"][0] == 0.0


def test_intervals_count_where_the_cause_is_right():
    known = truth("single", "creep", parameters={"creep.fraction": 0.3})
    said = {"creep.fraction": {"interval95": [0.2, 0.25]}, "creep.part": "foot"}
    assert covered(known, found("named", candidates=[["creep"]], parameters=said)) == [False]
    assert covered(known, found("named", candidates=[["gravity"]], parameters=said)) == []


def test_third_party_sets_have_the_nuisance_in_their_parameter():
    drawn = {"group": "single", "causes": ["foot_compliance"], "effect": ["foot_compliance"], "d": 12.0,
             "effects": [{"kind": "foot_compliance", "factor": 1.2}], "nuisances": {"mod_foot": 1.02}}  # fmt: skip
    known = of_given("blind_generator", "set_001", drawn)
    # a modulus that is higher makes the foot stiffer
    assert known.parameters == {"foot_compliance.factor": pytest.approx(1.2 / 1.02)}
    assert known.strength == 12.0


def test_figures_of_four_sets():
    outcomes = [
        Outcome(truth("single", "creep"), found("named", row("creep", 1.0, 1.0), candidates=[["creep"]])),
        Outcome(truth("single", "creep", strength=3.0), found("none")),
        Outcome(truth("quiet", strength=None), found("named", row("gravity", 1.0, 1.0))),
        Outcome(truth("outside", strength=50.0), found("unknown")),
    ]
    said = figures(outcomes)
    assert (said["main"]["hits"], said["main"]["sets"]) == (1, 1), "the weak one is not asked for"
    assert (said["alarms"]["hits"], said["alarms"]["sets"]) == (1, 1)
    assert (said["beside"]["hits"], said["beside"]["sets"]) == (1, 3)
    assert said["outside"]["rate"] == 1.0
    assert said["seconds"]["median"] == 2.0
    table = markdown({"any": said, "all": said})
    assert "| main cause right, strength of 8 and more | 80 % | 1/1, 21 to 100 % | 1/1, 21 to 100 % |" in table


def test_parts_of_all_generators_are_done_at_any_time():
    def some(generator, n):
        return [fresh.Set(None, None, None, Truth(generator, str(k), "quiet", frozenset())) for k in range(n)]

    order = [one.truth.generator for one in fresh.in_turn(some("a", 30), some("b", 10), some("c", 20))]
    for part in (12, 30, 48):
        made = [order[:part].count(name) for name in "abc"]
        assert np.allclose(np.array(made) / part, [0.5, 1 / 6, 1 / 3], atol=0.06)


def test_the_generator_of_other_authors_may_be_absent(tmp_path):
    assert fresh.others_sets(10, 1, tmp_path / "sets", tmp_path / "nowhere") == []


def test_document_says_what_is_left_out(tmp_path):
    outcomes = [Outcome(truth("quiet", strength=None), found("none"))]
    result = fresh.document(outcomes, 3, {"any": 1, "blind_generator": 0}, "The generator is not here.")
    assert set(result["figures"]) == {"any", "all"}
    assert "The generator is not here." in fresh.words(result, "command")
    json.dumps(result)


def test_every_group_of_tests_of_poses_is_scored_as_what_it_is():
    """A cause outside the catalogue has no right name: a group by another word would ask for one."""
    scored = {plan.group: of_poses(plan.number, plan.group, plan.causes) for plan in plans(20, 1)}
    assert set(scored) == set(GROUPS)
    assert {group: truth.group for group, truth in scored.items() if group in ("none", "outside")} == {
        "none": "quiet",
        "outside": "outside",
    }
    assert scored["outside"].causes == frozenset()
    assert scored["single"].causes
