"""Table II with an offset behind the foot: the figures that are reported, and that they are said to be a fit."""

import pytest

from vjm.io.model_file import load_chain
from vjm.model.parts import RigidOffset
from vjm_validation.studies.table2 import OFFSET_MM, offset_finding, offset_fit, with_offset


@pytest.fixture(scope="module")
def chain():
    return load_chain("orthoglide-chain")


def test_the_offset_lies_behind_the_foot_and_moves_the_tool_by_itself(chain):
    moved = with_offset(chain, OFFSET_MM)
    foot = [part.name for part in chain.parts].index("foot")
    assert isinstance(moved.parts[foot + 1], RigidOffset)
    assert tuple(moved.parts[foot + 1].transform[:3, 3]) == OFFSET_MM


def test_the_other_way_round_the_table_is_missed_by_more(chain):
    printed, fitted, opposite = (offset_fit(chain, (x, 0.0, 0.0)) for x in (0.0, -8.0, 8.0))
    assert fitted.within > printed.within > opposite.within
    assert fitted.largest_miss < 0.3 * printed.largest_miss < 0.3 * opposite.largest_miss
    assert fitted.sharp == printed.sharp == ("A", "C")


def test_it_is_said_to_be_no_evidence(chain):
    said = offset_finding(chain)
    assert "from 15.6 to 4.4 %" in said
    assert "21 instead of 16 of 28" in said
    assert "no evidence" in said
