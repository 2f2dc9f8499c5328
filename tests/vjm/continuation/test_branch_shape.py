"""Which way a branch leaves: by formulas, by a potential of fourth order, and where rounding hides it."""

import numpy as np
import pytest

from vjm.continuation.branch_shape import Leaving, branch_shape
from vjm.errors import NoConvergenceError


@pytest.mark.parametrize(
    ("slope", "curvature", "leaving"),
    [
        (0.0, 0.3, Leaving.SUPERCRITICAL),
        (0.0, -0.3, Leaving.SUBCRITICAL),
        (2.0, 0.3, Leaving.ASYMMETRIC),
        (-2.0, 0.3, Leaving.ASYMMETRIC),
    ],
)
def test_a_branch_is_told_by_its_coefficients(slope, curvature, leaving):
    # the fourth power stands for what follows
    found = branch_shape(lambda a: 7.0 + slope * a + curvature * a**2 + a**4, 1e-3, 0.2)
    assert found.leaving is leaving
    # the fourth power shifts an estimate by 5/4 of the square of the last amplitude
    wanted = slope or curvature
    assert (found.slope or found.curvature) == pytest.approx(wanted, abs=1e-3)
    assert str(leaving) in str(found)


def test_rounding_alone_decides_nothing():
    rng = np.random.default_rng(0)
    for _ in range(50):
        found = branch_shape(lambda _: 7.0 + 1e-9 * rng.standard_normal(), 1e-3, 0.2)
        assert found.leaving is Leaving.UNDECIDED
        assert "undecided" in str(found)


def test_rounding_is_outgrown():
    rng = np.random.default_rng(1)
    found = branch_shape(lambda a: 7.0 - 0.3 * a**2 + 1e-6 * rng.standard_normal(), 1e-3, 0.2)
    assert found.leaving is Leaving.SUBCRITICAL
    assert found.curvature == pytest.approx(-0.3, rel=0.1)


def test_a_branch_that_is_not_found_is_undecided_and_says_why():
    def lost(a):
        raise NoConvergenceError("no such point")

    found = branch_shape(lost, 1e-3, 0.2)
    assert found.leaving is Leaving.UNDECIDED
    assert "no such point" in str(found)
