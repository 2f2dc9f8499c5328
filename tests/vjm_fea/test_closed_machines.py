"""Finite elements of machines with branches and closed loops: against the energy and one another."""

import numpy as np
import pytest
from helpers.closed_machines import MACHINES, apart, truth

from vjm.baselines import MsaEngine
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.rotations import rotation_from_vector
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine

ENGINES = [ExudynEngine(4, shear=False), OpenSeesEngine(4)]


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.label)
@pytest.mark.parametrize("name", MACHINES)
def test_stiffness_is_that_of_the_energy(engine, name):
    chain = MACHINES[name]().rigid_in_shear()
    point = engine.problem(chain, LoadCase("p", 1e-6, steps=1)).unloaded()
    # corrected elements are exact for small loads; their forces are rounded, and joints differenced
    assert apart(point.stiffness, truth(chain)) < 1e-6
    assert point.unstable == 0


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.label)
@pytest.mark.parametrize("name", MACHINES)
def test_small_loads_and_weights_move_it_as_a_linear_model(engine, name):
    """A dead force, a follower and the weight of all parts, a thousandth of what they are."""
    chain, small = MACHINES[name]().rigid_in_shear(), 1e-3
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


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.label)
@pytest.mark.parametrize("name", ["bridged_tree", "four_bar", "two_legs", "coupled"])
def test_loaded_stiffness_is_that_of_differences(engine, name):
    """Far from where it is linear, the wrench's slope is the stiffness, of closures, couplings and springs too."""
    chain = MACHINES[name]().rigid_in_shear()
    to = np.array([4.0, -3.0, 5.0, 0.02, -0.01, 0.03])
    load_case = LoadCase("p", 1.0, tuple(to), steps=4)
    problem = engine.problem(chain, load_case)
    point = problem.unloaded()
    for s in (0.25, 0.5, 0.75, 1.0):
        point = problem.solve(s, point)
    assert apart(point.stiffness, problem.unloaded().stiffness) > 1e-3
    for direction in (to, np.array([1.0, 2.0, -1.0, -0.01, 0.02, 0.01])):
        d = 1e-3 * direction
        ahead, behind = (problem.solve_pose(to + sign * d, point) for sign in (1.0, -1.0))
        slope = 0.5 * (ahead.wrench - behind.wrench)
        # a rotation vector's change is a small turn by the derivative of the exponential
        foreseen = point.stiffness @ np.concatenate([d[:3], spin(to[3:], d[3:])])
        size = np.abs(slope).reshape(2, 3).max(axis=1).repeat(3)
        # central differences: the square of a step of a thousandth
        assert np.abs((foreseen - slope) / size).max() < 1e-4


def spin(vector, change):
    """Small turn, world axes, by which a rotation vector's rotation changes."""
    ahead, behind = (rotation_from_vector(vector + sign * change) for sign in (1.0, -1.0))
    D = 0.5 * ahead @ behind.T
    return np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]]) / 2.0
