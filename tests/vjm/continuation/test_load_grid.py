"""The paper's own grid: 0.001 mm in posture A. Slow chains of small steps find what adaptive ones find."""

import numpy as np
import pytest

from vjm.continuation.path import EventKind


def test_the_papers_own_grid_finds_the_event_where_adaptive_steps_do(trace):
    fine, adaptive = trace("A", 4.0, steps=4000), trace("A", 4.0)
    assert [event.kind for event in fine.events] == [EventKind.BIFURCATION]
    # each locates it to 1e-9 of 4 mm
    assert fine.critical.s == pytest.approx(adaptive.critical.s, abs=2e-9 * 4.0)
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
