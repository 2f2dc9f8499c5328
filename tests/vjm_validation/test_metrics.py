from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm_validation.metrics import force_at, path_metrics


@pytest.fixture(scope="module")
def path(chain):
    return VjmEngine().trace(chain, LoadCase("A", 2.0))


def test_metrics_are_read_where_they_are_defined(chain, path):
    metrics = path_metrics(path)
    fine = VjmEngine().trace(chain, LoadCase("A", 2.0, steps=2000))
    # central differences on a grid of 0.001 mm: 3e-10 of K1 and 2e-9 of K2, most of it rounding of forces
    before = np.searchsorted(fine.s, 0.99 * metrics.d_cr)
    after = np.searchsorted(fine.s, 1.01 * metrics.d_cr)
    slope = np.gradient(fine.force, fine.s)
    assert metrics.critical is EventKind.BIFURCATION
    assert metrics.K1 == pytest.approx(slope[before], rel=2e-8)
    assert metrics.K2 == pytest.approx(slope[after], rel=1e-7)
    assert metrics.F_end == pytest.approx(fine.force[-1], rel=1e-9)
    assert metrics.d_end == 2.0


def test_force_between_points_is_that_of_a_finer_path(chain, path):
    fine = VjmEngine().trace(chain, LoadCase("A", 2.0, steps=500))
    apart = [abs(force_at(path, s) - f) for s, f in zip(fine.s, fine.force, strict=True)]
    # cubic Hermite through points at most 0.04 mm apart, the kink at the critical point being a node
    assert max(apart) < 1e-4 * fine.force.max()


def test_force_beyond_the_end_is_refused(path):
    with pytest.raises(ValueError, match=r"the path ends at 2, before 2\.1"):
        force_at(path, 2.1)


def test_a_path_without_events_has_no_critical_point(path):
    metrics = path_metrics(replace(path, events=()))
    assert metrics.critical is None
    assert (metrics.K1, metrics.F_cr, metrics.d_cr, metrics.K2) == (None, None, None, None)


def test_a_stiffness_knee_has_no_stiffness_beside_it(chain):
    metrics = path_metrics(VjmEngine().trace(chain, LoadCase("B", 4.0)))
    assert metrics.critical is EventKind.STIFFNESS_KNEE
    assert metrics.K1 is None
    assert metrics.K2 is None
    # the definition: the tangent has fallen to half of the unloaded one there
    assert metrics.F_cr == pytest.approx(2336, rel=1e-3)
