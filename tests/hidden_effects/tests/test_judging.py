"""What counts as right, on verdicts made up for it."""

import numpy as np
import pytest
from hidden_effects.__main__ import main
from hidden_effects.judging import admitted, column, principal, right
from hidden_effects.page import page
from hidden_effects.score import RIVALS, score
from hidden_effects.statistics import calibration_error, rate, reliability, wilson
from hidden_effects.table import BEGIN, END, Part, markdown, rows, with_table


def truth(causes=("creep",), group="single", admits=(), omitted=(), strength=10.0, held_out=True, **more):
    hidden = [
        {"cause": c, "label": "", "size": 1.0, "strength": strength, "parameter": f"{c}.fraction", "value": 0.1}
        for c in causes
    ]
    return {"set": 1, "group": group, "held_out": held_out, "causes": sorted(causes), "hidden": hidden,
            "apart": 9.0, "omitted": list(omitted), "admitted": [sorted(a) for a in admits],
            "rivals": {name: {"causes": list(causes)} for name in RIVALS}} | more  # fmt: skip


def found(verdict, *candidates, confidence=0.9, **more):
    listed = [{"causes": list(c), "probability": 0.5, "parameters": {}} for c in candidates]
    causes = sorted({cause for c in candidates for cause in c})
    return {"verdict": verdict, "causes": causes, "candidates": listed, "confidence": confidence, "took": 4.0,
            "next_experiment": None} | more  # fmt: skip


@pytest.mark.parametrize(
    ("hidden", "said", "is_right"),
    [
        (truth([], "quiet"), found("none"), True),
        (truth([], "quiet"), found("unknown"), False),
        (truth(["creep"]), found("named", ["creep"]), True),
        (truth(["creep"]), found("named", ["gravity"]), False),
        (truth(["creep"]), found("none"), False),
        # one class with the truth, but named alone: the contract asks for exactly the hidden set
        (truth(["creep"], admits=[["creep"], ["gravity"]]), found("named", ["gravity"]), False),
        (truth(["creep"], admits=[["creep"], ["gravity"]]), found("class", ["gravity"], ["creep"]), True),
        (truth(["creep"], admits=[["creep"], ["gravity"]]), found("class", ["gravity"], ["link_bow"]), False),
        (truth(["creep"], admits=[["creep"]]), found("class", ["gravity"], ["creep"]), False),
        (truth(["creep", "gravity"], "pair"), found("named", ["gravity", "creep"]), True),
        (truth(["creep", "gravity"], "pair"), found("named", ["creep"]), False),
        (truth(["beat"], "outside"), found("unknown"), True),
        (truth(["beat"], "outside"), found("named", ["creep"]), False),
        (truth(["beat"], "outside", admits=[["creep"]]), found("named", ["creep"]), True),
        (truth(["creep"], "omitted", omitted=["creep"], admits=[["creep"], ["gravity"]]), found("unknown"), True),
        (truth(["creep"], "omitted", omitted=["creep"], admits=[["creep"]]), found("named", ["gravity"]), False),
        (truth(["creep"]), {"error": "ValueError"}, False),
    ],
)  # fmt: skip
def test_right_is_what_the_contract_says(hidden, said, is_right):
    assert right(hidden, said) is is_right


def test_a_cause_outside_the_catalogue_is_never_admitted():
    assert admitted(truth(["beat"], "outside", admits=[["creep"]])) == {frozenset(["creep"])}
    assert admitted(truth(["creep"], "omitted", omitted=["creep"], admits=[["creep"], ["gravity"]])) == {
        frozenset(["gravity"])
    }


def test_columns_of_the_confusion_matrix():
    said = [found("named", ["creep"]), found("named", ["creep", "gravity"]), found("class"), {"error": "none"}]
    assert [column(f) for f in said] == ["creep", "several", "class", "failed"]


def test_the_error_of_a_ratio_is_taken_on_what_it_exceeds_one_by():
    hidden = truth(["foot_compliance"])
    hidden["hidden"][0]["parameter"] = "foot_compliance.factor"
    said = found("named", ["foot_compliance"])
    said["candidates"][0]["parameters"] = {"foot_compliance.factor": {"value": 1.11, "interval95": [1.05, 1.17]}}
    still = found("named", ["foot_compliance"])
    still["candidates"][0]["parameters"] = {"foot_compliance.factor": {"value": 1.1, "interval95": [1.0, 1.2]}}
    result = principal(hidden, said, still)
    assert result["error"] == pytest.approx(0.1)
    assert result["inside"]
    assert principal(hidden, found("none"), still) is None


def test_wilson_interval():
    # Newcombe, Statistics in Medicine 17 (1998), table I: 81 of 263, 15 of 148, 0 of 20
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert wilson(15, 148) == pytest.approx((0.0624, 0.1605), abs=1e-4)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)
    assert rate([True, False])["rate"] == 0.5
    assert rate([])["rate"] is None


def test_calibration_error_sees_overconfidence_and_forgives_chance():
    rng = np.random.default_rng(2)
    said = rng.uniform(0.5, 1.0, 600)
    honest = (rng.random(600) < said).astype(float)
    assert calibration_error(said, honest)["interval95"][0] <= 0.03
    boast = (rng.random(600) < said - 0.25).astype(float)
    assert calibration_error(said, boast)["interval95"][0] > 0.15
    assert sum(row["sets"] for row in reliability(said, honest)) == 600


def results():
    return [
        {"truth": truth(["creep"]), "found": found("named", ["creep"], gain={
            "before_in_sigma": 11.0, "after_in_sigma": 1.5}), "still": found("named", ["creep"]),
         "told": found("named", ["creep"], gain={"before_in_sigma": 11.0, "after_in_sigma": 1.0})},
        {"truth": truth(["creep"], strength=4.0), "found": found("none")},
        {"truth": truth([], "quiet"), "found": found("none", confidence=0.99)},
        {"truth": truth([], "quiet", held_out=False), "found": found("unknown", confidence=0.99)},
        {"truth": truth(["beat"], "outside"), "found": found("named", ["creep"], confidence=0.95)},
        {"truth": truth(["creep"], "omitted", omitted=["creep"]),
         "found": {"error": "the finder has no option --without"}},
        {"truth": {"set": 9, "group": "single", "held_out": True, "causes": ["gravity"], "skipped": "not visible"}},
        {"truth": truth(["creep"], "inseparable", admits=[["creep"], ["gravity"]]),
         "found": found("class", ["creep"], ["gravity"], next_experiment={"path": "pull to 1 mm"}),
         "next": found("named", ["creep"])},
    ]  # fmt: skip


def test_the_score_counts_each_set_where_it_belongs():
    held = score(results(), held_out=True)
    assert held["sets"] == 5
    assert held["not_run"] == 1
    assert len(held["not_made"]) == 1
    assert held["right"]["strong"]["hits"] == held["right"]["strong"]["sets"] == 1
    assert held["right"]["by_strength"]["4"]["rate"] == 0.0
    assert held["false_alarms"]["hits"] == 0
    assert held["outside"]["wrongly_named_and_sure"]["rate"] == 1.0
    assert held["inseparable"]["resolved"]["rate"] == 1.0
    assert held["class_size"]["of_right_classes"] == 2.0
    assert held["gain"]["share_of_the_oracle"] == pytest.approx(0.95)
    assert held["confusion"]["creep"] == {"creep": 1}
    missed, misnamed = held["wrong"]
    assert (missed["hidden"], missed["said"], missed["candidates"]) == ({"creep": 4.0}, "none", [])
    assert (misnamed["group"], misnamed["candidates"]) == ("outside", [["creep"]])
    assert score(results(), held_out=False)["false_alarms"]["rate"] == 1.0
    assert score([], held_out=True)["right"]["strong"]["rate"] is None


def test_the_page_lists_wrong_verdicts():
    html = page(score(results(), held_out=True), score(results(), held_out=False))
    assert "beat 10" in html
    assert "named: creep" in html


def test_the_table_says_what_is_missed_and_goes_between_its_marks():
    held = score(results(), held_out=True)
    said = {row.name: row for row in rows(held)}
    assert said["cause outside the catalogue: wrongly named"].met is False
    assert said["right at strength 8 and more"].met is True
    assert said["both of a pair, each 8 and more, no other set alike"].met is None
    readme = f"before\n{BEGIN}\nstale words\n{END}\nafter\n"
    new = with_table(readme, held)
    assert new.startswith(f"before\n{BEGIN}\n5 sets")
    assert new.endswith(f"{END}\nafter\n")
    assert "stale" not in new
    assert with_table(new, held) == new
    assert with_table("no marks", held) == "no marks"
    assert markdown(score([])).count("–") > 10


def test_the_table_says_how_much_of_a_campaign_it_is_about():
    held = score(results(), held_out=True)
    assert "half; made by `make blind`." in markdown(held)
    cut = markdown(held, Part(share=0.5, finished=30, of=40))
    assert (
        'half of 50 % of a campaign, of which 30 of 40 sets were finished; made by `make blind ARGS="--share 0.5"`'
        in cut
    )


def test_nothing_is_scored_where_nothing_is_finished(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["blind", "--only-score", "--out", str(tmp_path / "none")])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "no set is finished" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_candidates_that_differ_in_the_part_alone_are_one():
    assert right(truth(["creep"]), found("named", ["creep"], ["creep"]))
