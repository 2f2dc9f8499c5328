"""The paper's own grid: 0.001 mm in posture A. Slow chains of small steps find what adaptive ones find."""

import numpy as np
import pytest

from vjm.continuation.load_grid import trace_grid
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.files import parse_toml
from vjm.io.model_file import build_chain
from vjm.model.load_case import LoadCase

LEG = """format = 1
name = "leg"
title = "A bar between two hinges on a drive"
source = "made up"
units = { length = "mm", force = "N", angle = "rad" }
[[parts]]
kind = "actuator"
name = "drive"
axis = "x"
compliance_mm_per_N = 2e-6
[[parts]]
kind = "joint"
name = "q1"
axis = "z"
[[parts]]
kind = "beam"
name = "bar"
length_mm = 300.0
count = 2
[parts.section]
shape = "rectangle"
width_mm = 25.0
thickness_mm = 6.0
youngs_modulus_MPa = 70000.0
poissons_ratio = 0.33
[[parts]]
kind = "joint"
name = "q2"
axis = "z"
[postures]
bent = { q1 = 0.5, q2 = -0.5 }
"""


def test_the_papers_own_grid_finds_the_event_where_adaptive_steps_do(trace):
    fine, adaptive = trace("A", 4.0, steps=4000), trace("A", 4.0)
    assert [event.kind for event in fine.events] == [EventKind.BIFURCATION]
    # each locates it to 1e-9 of itself
    assert fine.critical.s == pytest.approx(adaptive.critical.s, rel=2e-9)
    assert fine.critical.force == pytest.approx(adaptive.critical.force, rel=2e-10)
    assert fine.force[-1] == pytest.approx(adaptive.force[-1], rel=1e-10)
    # the tangents at 0.99 and 1.01 of the event do not depend on the grid either
    assert fine.critical.stiffness_before == pytest.approx(adaptive.critical.stiffness_before, rel=1e-10)
    assert fine.critical.stiffness_after == pytest.approx(adaptive.critical.stiffness_after, rel=1e-6)


def test_tangent_on_the_papers_own_grid_is_the_slope_of_the_force(trace):
    path = trace("A", 4.0, steps=4000)
    s, force = path.s, path.force
    # central differences over two steps of 0.001 mm: truncation h²/6 of a third derivative of some 10 N/mm³, and
    # 1e-11 of 1e4 N over the step; pairs of unequal steps, at the branch's entry, are left out
    equal = np.abs(np.diff(s, 2)) < 1e-9
    slope = (force[2:] - force[:-2])[equal] / (s[2:] - s[:-2])[equal]
    assert slope == pytest.approx(path.tangent[1:-1][equal], rel=1e-4, abs=1e-4)
    assert np.count_nonzero(equal) > 3900


def test_a_step_that_is_too_long_for_newtons_method_is_taken_in_halves():
    """A bar between two hinges askew that has buckled at 0.12 mm: against a grid of fortieths of the steps."""
    chain = build_chain(parse_toml(LEG), "leg.toml")
    problem = VjmEngine.of(8, 1).problem(chain, LoadCase("bent", -2.141))
    coarse, fine = (trace_grid(problem, np.linspace(0.0, 2.141, n)) for n in (5, 161))
    assert (coarse.stopped, fine.stopped) == ("", "")
    # the branch is one curve: to Newton's tolerance
    np.testing.assert_allclose(coarse.wrench[:, :3], fine.wrench[::40, :3], rtol=1e-6, atol=1e-3)
