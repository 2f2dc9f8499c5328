"""The score of sets that others made."""

import numpy as np
import pytest
from hidden_effects.third_party_sets import chosen, figures, right

CREEP = {"group": "single", "causes": ["creep"], "class": ["creep", "link_bow"], "d": 40.0}
QUIET = {"group": "none", "causes": [], "class": [], "d": 0.0}
PAIR = {"group": "pair", "causes": ["creep", "gravity"], "class": [["creep", "gravity"]], "d": 9.0}


def said(verdict, *candidates, busy=1.0):
    return {"verdict": verdict, "candidates": [{"causes": list(c)} for c in candidates], "busy": busy}


@pytest.mark.parametrize(
    ("truth", "found", "counts"),
    [
        (CREEP, said("named", ["creep"]), True),
        # one of its class alone is another cause
        (CREEP, said("named", ["link_bow"]), False),
        (CREEP, said("class", ["creep"], ["link_bow"]), True),
        (CREEP, said("class", ["creep"], ["gravity"]), False),
        (CREEP, said("class", ["link_bow"]), False),
        (CREEP, {"error": "no end", "busy": 240.0}, False),
        (PAIR, said("named", ["gravity", "creep"]), True),
        (PAIR, said("named", ["creep"]), False),
        (QUIET, said("none"), True),
        (QUIET, said("unknown"), False),
    ],
)
def test_what_counts_as_right(truth, found, counts):
    assert right(truth, found) is counts


def test_table_counts_each_set_where_it_belongs():
    truths = {"a": CREEP, "b": CREEP, "c": QUIET, "d": PAIR}
    found = {"a": said("named", ["creep"]), "b": said("unknown"), "c": said("unknown"), "d": said("none", busy=9.0)}
    table = figures(truths, found)
    assert table["single causes, strength ≥ 8: right"] == "1/2"
    assert table["pairs: right"] == "0/1"
    assert table["quiet: alarms"] == "1/1"
    assert table["known, strength ≥ 30, called `unknown`"] == "1/2"
    assert (table["median seconds of a processor"], table["longest"]) == ("1.0", "9")


def test_thirds_part_the_sets_and_stay_the_same():
    names = [f"set_{k:03d}" for k in range(75)]
    thirds = [chosen(names, third) for third in (1, 2, 3)]
    assert sorted(np.concatenate(thirds).tolist()) == names
    assert chosen(names[::-1], 1) == thirds[0]
    assert chosen(names, None) == names
