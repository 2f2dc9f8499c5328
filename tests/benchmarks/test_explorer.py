"""Processor time of `validate explore` from a slider to new numbers and a new drawing, without the browser."""

import pytest
from helpers.explored_speed import milliseconds

from vjm_validation.explore.state import Explorer

FASTEST_MS = 100.0
"""Ten answers a second."""


@pytest.mark.parametrize("name", ["hexapod", "par2", "delta"])
def test_time_of_an_answer(name, record):
    explorer = Explorer(name)
    for what in ("load", "posture", "size"):
        value = milliseconds(explorer, what)
        record(f"explore_{name}_{what}_ms", value, "ms", f"<= {FASTEST_MS:g}", value <= FASTEST_MS)
