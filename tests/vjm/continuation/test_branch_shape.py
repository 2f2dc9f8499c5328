"""Which way a branch leaves: by formulas, by mechanisms with a closed form, and where it cannot be told."""

import numpy as np
import pytest

from vjm.continuation.branch_shape import Leaving, NoStableBranchError, branch_shape
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import Equilibrium, EventKind
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.joints import PassiveJoint, SprungJoint
from vjm.model.load_case import Load, LoadCase
from vjm.model.parts import Beam
from vjm.rotations import AXES
from vjm.vjm_engine import VjmEngine

SIZES = np.array([1e-3 * 2.0**k for k in range(8)])


def point(s, amplitude=0.0, unstable=0):
    """A state whose only coordinate is the amplitude."""
    state = np.array([amplitude, s])
    return Equilibrium(
        s, np.zeros(6), np.zeros(6), 0.0, -1.0 if unstable else 1.0, unstable, 0, 0.0,
        np.array([[0.0, 0.0, 0.0], [1.0, amplitude, 0.0]]), state,
    )  # fmt: skip


def shape_of(parameter, unstable=1):
    def along(amplitude, _):
        s = parameter(amplitude)
        return point(s, amplitude, unstable if s < 7.0 else 0)

    return branch_shape(along, point(7.0), np.array([1.0, 0.0]), 1e-9, SIZES)


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
    found = shape_of(lambda a: 7.0 + slope * a + curvature * a**2 + a**4)
    assert found.leaving is leaving
    # extrapolation takes the fourth power away; the critical value's resolution over the amplitude's square is left
    wanted = slope or curvature
    assert (found.slope or found.curvature) == pytest.approx(wanted, abs=2e-3)
    assert abs((found.slope or found.curvature) - wanted) <= found.error + 1e-12
    assert str(leaving) in str(found)


@pytest.mark.parametrize("offset", [1e-3, -1e-3, 1.0, -1.0])
@pytest.mark.parametrize("curvature", [0.3, -0.3, 900.0])
def test_points_of_another_branch_say_nothing(offset, curvature):
    # their differences are as regular as the branch's own: only the critical value tells
    found = shape_of(lambda a: 7.0 + offset + curvature * a**2)
    reach = abs(curvature) * SIZES[-1] ** 2
    # an offset of a hundredth of the change cannot turn the sign, and is in the error
    assert found.leaving is Leaving.UNDECIDED or abs(offset) < 0.01 * reach
    assert found.leaving is Leaving.UNDECIDED or abs(found.curvature - curvature) <= found.error


def test_a_shape_away_from_the_critical_one_says_nothing():
    def along(amplitude, _):
        there = point(7.0 - 0.3 * amplitude**2, amplitude, 1)
        return Equilibrium(**{**vars(there), "shape": there.shape + [[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]]})

    found = branch_shape(along, point(7.0), np.array([1.0, 0.0]), 1e-9, SIZES)
    assert found.leaving is Leaving.UNDECIDED
    assert "mm away" in str(found)


def test_a_falling_branch_that_is_stable_is_not_believed():
    found = shape_of(lambda a: 7.0 - 0.3 * a**2, unstable=0)
    assert found.leaving is Leaving.UNDECIDED
    assert "stable" in str(found)


def test_rounding_alone_decides_nothing():
    rng = np.random.default_rng(0)
    for _ in range(50):
        found = shape_of(lambda _: 7.0 + 1e-9 * rng.standard_normal())
        assert found.leaving is Leaving.UNDECIDED
        assert "undecided" in str(found)


def test_rounding_is_outgrown():
    rng = np.random.default_rng(1)
    found = shape_of(lambda a: 7.0 - 0.3 * a**2 + 1e-6 * rng.standard_normal())
    assert found.leaving is Leaving.SUBCRITICAL
    assert found.curvature == pytest.approx(-0.3, rel=0.1)
    assert abs(found.curvature + 0.3) <= 3.0 * found.error


def test_a_branch_that_is_not_found_is_undecided_and_says_why():
    def lost(_, __):
        raise NoConvergenceError("no such point")

    found = branch_shape(lost, point(7.0), np.array([1.0, 0.0]), 1e-9, SIZES)
    assert found.leaving is Leaving.UNDECIDED
    assert "no such point" in str(found)
