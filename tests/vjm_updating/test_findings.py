"""Probabilities of causes, places and groups from weighed hypotheses, and the words that follow."""

import pytest

from vjm_updating.diagnosis.document import (
    FindingsRow,
    PosteriorSample,
    Word,
    acting,
    by_hypotheses,
    credible,
    findings_of,
    groups_of,
)


def hypothesis(probability: float, *places: str) -> PosteriorSample:
    causes: dict[str, list[str]] = {}
    for place in places:
        causes.setdefault(place.partition("(")[0], []).append(place)
    return PosteriorSample(causes, probability)


def found(
    *hypotheses: PosteriorSample, trusted: bool = True, nothing: float = 0.0, unknown: float | None = None
) -> FindingsRow:
    p, places = by_hypotheses(hypotheses)
    return findings_of(
        p,
        {},
        groups_of(hypotheses),
        explained=0.9,
        left=1.0,
        more_than_noise=False,
        trusted=trusted,
        places=places,
        nothing=nothing,
        unknown=unknown,
    )


def said(row: FindingsRow) -> dict[str, Word]:
    return {one.cause: one.word for one in row.causes}


def test_a_cause_has_the_sum_over_hypotheses_that_contain_it_and_so_has_a_place():
    p, places = by_hypotheses(
        [hypothesis(0.5, "creep(foot)"), hypothesis(0.3, "creep(link)", "bow"), hypothesis(0.2, "bow")]
    )
    assert p == pytest.approx({"creep": 0.8, "bow": 0.5})
    assert places["creep"] == pytest.approx({"creep(foot)": 0.5, "creep(link)": 0.3})


def test_a_cause_in_two_places_at_once_counts_once():
    both = [hypothesis(0.9, "creep(foot)", "creep(link)")]
    assert acting(both, ["creep"]) == pytest.approx(0.9)
    assert by_hypotheses(both)[1]["creep"] == pytest.approx({"creep(foot)": 0.9, "creep(link)": 0.9})


@pytest.mark.parametrize(("p", "word"), [(0.96, Word.ACTS), (0.94, Word.MAY)])
def test_a_cause_acts_from_95_in_a_hundred(p: float, word: Word):
    assert said(found(hypothesis(p, "bow"), nothing=1.0 - p)) == {"bow": word}


def test_causes_that_exchange_are_one_group():
    row = found(hypothesis(0.6, "bow"), hypothesis(0.38, "creep"), hypothesis(0.02, "play"))
    (group,) = row.groups
    assert group.causes == ["bow", "creep"]
    assert group.probability == pytest.approx(0.98)
    assert said(row) == {"bow": Word.ONE_OF, "creep": Word.ONE_OF}


def test_a_group_stands_beside_a_cause_that_acts():
    row = found(hypothesis(0.6, "bow", "creep"), hypothesis(0.4, "bow", "play"))
    assert said(row) == {"bow": Word.ACTS, "creep": Word.ONE_OF, "play": Word.ONE_OF}
    assert [group.causes for group in row.groups] == [["creep", "play"]]


def test_two_that_act_together_or_not_at_all_do_not_exchange():
    row = found(hypothesis(0.5, "bow", "creep"), nothing=0.5)
    assert row.groups == []
    assert said(row) == {"bow": Word.MAY, "creep": Word.MAY}


def test_causes_of_which_none_is_likely_are_no_group():
    row = found(hypothesis(0.5, "bow"), hypothesis(0.4, "creep"), nothing=0.1)
    assert row.groups == []


def test_nothing_is_said_to_act_where_the_whole_is_doubted():
    row = found(hypothesis(0.99, "bow"), trusted=False)
    assert said(row) == {"bow": Word.MAY}
    assert row.words[0].endswith("nothing is said to act")
    assert row.words[1:] == ["no answer, guesses of the catalogue with their probabilities: bow 0.99"]


def test_a_guess_is_as_probable_as_it_can_be_beside_what_no_catalogue_has():
    row = found(hypothesis(0.99, "bow"), trusted=False, unknown=0.9)
    assert [one.probability for one in row.causes] == pytest.approx([0.099])
    assert row.words[-1].endswith("bow 0.10")
    # of what is said to act the unknown is beside it
    assert found(hypothesis(0.99, "bow"), unknown=0.04).causes[0].probability == 0.99


def test_a_cause_that_explains_no_more_than_a_laws_error_says_whose_law():
    p = {"gravity": 1.0, "creep": 0.97, "thermal_drift": 0.3}
    row = findings_of(
        p, {"gravity": 0.9}, [], explained=1.0, left=1.0, more_than_noise=False, trusted=True,
        within_law={"thermal_drift": "gravity"},
    )  # fmt: skip
    assert said(row) == {"gravity": Word.ACTS, "creep": Word.ACTS, "thermal_drift": Word.MAY}
    assert row.words[:3] == [
        "gravity acts (1.00, 90% of what the nominal model misses); the main cause",
        "creep acts (0.97)",
        "thermal_drift may act (0.30); the law of gravity may be wrong by as much",
    ]


def test_the_words_name_places_and_shares():
    p, places = by_hypotheses([hypothesis(0.7, "creep(foot)"), hypothesis(0.3, "creep(link)")])
    row = findings_of(
        p, {"creep": 0.8}, [], explained=0.8, left=1.04, more_than_noise=False, trusted=True, places=places
    )
    assert row.words == [
        "creep acts (1.00, 80% of what the nominal model misses): creep(foot) 0.70, creep(link) 0.30",
        "explained: 80% of what the nominal model misses; residual: 1.04 sigma, no more than noise",
    ]


def test_the_fewest_sets_are_those_that_no_member_says_with_less():
    p = {"joints": 0.5, "springs": 0.3, "springs, gears": 0.16, "gears": 0.04}

    def more(one: str, rival: str) -> bool:
        return rival.count(",") > one.count(",")

    # what a smaller set says counts as said, whichever member of the class that set is
    assert credible("joints", p, more) == ["joints", "springs"]
    assert credible("springs, gears", p, more) == ["joints", "springs", "springs, gears"]
    assert credible("joints", p, most=1) == ["joints"]


def test_a_residual_that_a_laws_error_excuses_is_not_called_noise():
    p, places = by_hypotheses([hypothesis(1.0, "creep")])
    row = findings_of(
        p, {"creep": 0.9}, [], explained=0.9, left=3.5, more_than_noise=False, trusted=True, places=places,
        within_law_error=True,
    )  # fmt: skip
    assert row.words[-1].endswith(
        "residual: 3.50 sigma, more than noise, but no more than the laws of these causes may be wrong by"
    )
