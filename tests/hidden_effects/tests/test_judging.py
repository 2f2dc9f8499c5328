"""What counts as right, on verdicts made up for it."""

import pytest
from hidden_effects.judging import admitted, principal, right, rival_right
from hidden_effects.statistics import rate, wilson


def truth(causes=("creep",), group="single", admits=(), **more):
    hidden = [
        {"cause": c, "label": "", "size": 1.0, "strength": 10.0, "parameter": f"{c}.fraction", "value": 0.1}
        for c in causes
    ]
    return {"set": 1, "group": group, "causes": sorted(causes), "hidden": hidden, "apart": 9.0,
            "admitted": [sorted(a) for a in admits]} | more  # fmt: skip


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
        (truth(["creep"]), {"error": "ValueError"}, False),
    ],
)  # fmt: skip
def test_right_is_what_the_contract_says(hidden, said, is_right):
    assert right(hidden, said) is is_right


def test_a_cause_outside_the_catalogue_is_never_admitted():
    assert admitted(truth(["beat"], "outside", admits=[["creep"]])) == {frozenset(["creep"])}


def test_the_likelihood_ratio_is_right_by_the_hidden_cause_or_its_class():
    said = {"causes": ["creep"], "alike": ["creep", "gravity"]}
    assert rival_right(truth(["creep"], likelihood_ratio={"causes": ["creep"], "alike": ["creep"]}))
    assert not rival_right(truth(["creep"], likelihood_ratio=said))
    assert rival_right(truth(["creep"], admits=[["gravity"]], likelihood_ratio=said))
    assert not rival_right(truth(["creep"], likelihood_ratio={"causes": []}))


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


def test_candidates_that_differ_in_the_part_alone_are_one():
    assert right(truth(["creep"]), found("named", ["creep"], ["creep"]))
