"""Loads that turn with a body, and moments that do not, against dead forces: their tangent is not symmetric."""

import time

import numpy as np
import pytest

from vjm.engines import engine_by_name
from vjm.model.load_case import Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Section

FREE = ("x", "y", "z", "rx", "ry", "rz")
DEAD = Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0))
LOADS = {
    "follower": Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), follower=True),
    "moment": Load((0.0, 0.0, 0.0, 0.0, 0.0, 100.0)),
}


@pytest.mark.parametrize("springs", [16, 64])
@pytest.mark.parametrize("kind", LOADS)
def test_time_over_that_of_a_dead_force(kind, springs, record):
    ratio = seconds(LOADS[kind], springs) / seconds(DEAD, springs)
    record(f"{kind}_over_dead_{springs}_springs", ratio, "", "<= 2", ratio <= 2.0)


def seconds(load, springs):
    """Processor time of a path of ten steps, the least of three."""
    section = Section(EA=2e7, GJ=1e6, EIy=2e7, EIz=1e6)
    chain = Machine("bar", (Beam("bar", 100.0, section=section),), postures={"straight": np.zeros(0)})
    case = LoadCase("straight", 300.0, axis="load", free=FREE, steps=10, loads=(load,))
    engine = engine_by_name(f"vjm-{springs}")
    engine.trace(chain, case)
    taken = []
    for _ in range(3):
        started = time.process_time()
        assert engine.trace(chain, case).complete
        taken.append(time.process_time() - started)
    return min(taken)
