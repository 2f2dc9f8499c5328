"""Finite elements of machines with branches and closed loops: against the energy, and the virtual joint method's."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.closed_machines import MACHINES, apart, truth

from vjm.baselines import MsaEngine
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm_fea.exudyn.engine import ExudynEngine

ENGINES = [ExudynEngine(4)]


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.label)
@pytest.mark.parametrize("name", MACHINES)
def test_stiffness_is_that_of_the_energy(engine, name):
    chain = MACHINES[name]()
    point = engine.problem(chain, LoadCase("p", 1e-6, steps=1)).unloaded()
    # corrected elements are exact for small loads; their forces are rounded, and joints differenced
    assert apart(point.stiffness, truth(chain)) < 1e-6
    assert point.unstable == 0


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.label)
@pytest.mark.parametrize("name", MACHINES)
def test_small_loads_and_weights_move_it_as_a_linear_model(engine, name):
    """A dead force, a follower and the weight of all parts, a thousandth of what they are."""
    chain, small = MACHINES[name](), 1e-3
    load_case = LoadCase(
        "p", 1.0, "load", free=COMPONENTS, gravity=(small, -2.0 * small, -9.81 * small), steps=1,
        loads=(
            Load(tuple(small * np.array([3.0, -4.0, 5.0, 200.0, -100.0, 50.0]))),
            Load((2.0 * small, small, -3.0 * small, 0.0, 0.0, 0.0), chain.beams[0].name, 0.5, follower=True),
        ),
    )  # fmt: skip
    found = engine.trace(chain, load_case).points[-1].displacement
    exact = MsaEngine().trace(chain, load_case).points[-1].displacement
    size = np.abs(exact).reshape(2, 3).max(axis=1).repeat(3)
    # turns of 1e-5 rad: what is not linear is of that size
    assert np.abs((found - exact) / size).max() < 1e-4
