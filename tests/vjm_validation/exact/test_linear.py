"""Linear frames: closed forms against the unit load integrals taken numerically."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_validation.exact.linear import (
    Bar,
    cantilever,
    cantilever_on_springs,
    l_frame_in_plane,
    l_frame_out_of_plane,
    springs_in_series,
)

FIRST = Bar(400.0, EI=3e8, EA=6e6, GA=2e6, GJ=2e8)
SECOND = Bar(250.0, EI=1e8, EA=4e6, GA=1e6, GJ=7e7)


def tip_compliance(*bars):
    """Six by six, of bars (direction, bar) one behind the other, by ∫ Gᵀ C G ds with G the section's wrench.

    Gauss's rule with four points is exact for the integrand's second degree.
    """
    points, weights = np.polynomial.legendre.leggauss(4)
    ends = np.cumsum([np.zeros(3)] + [bar.length * np.array(d) for d, bar in bars], axis=0)
    C = np.zeros((6, 6))
    for (direction, bar), start in zip(bars, ends[:-1], strict=True):
        along = np.array(direction)
        across = np.eye(3) - np.outer(along, along)
        section = np.zeros((6, 6))
        section[:3, :3] = np.outer(along, along) / bar.EA + across / bar.GA
        section[3:, 3:] = np.outer(along, along) / bar.GJ + across / bar.EI
        for s, w in zip(0.5 * bar.length * (points + 1.0), 0.5 * bar.length * weights, strict=True):
            arm = ends[-1] - start - s * along
            G = np.eye(6)
            G[3:, :3] = [[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]]
            C += w * G.T @ section @ G
    return C


def test_cantilever():
    C = tip_compliance(((1.0, 0.0, 0.0), FIRST))
    assert cantilever(FIRST) == pytest.approx(C[np.ix_([1, 5], [1, 5])], rel=1e-13)
    assert cantilever(Bar(2.0, 3.0)) == pytest.approx(np.array([[8.0 / 9.0, 2.0 / 3.0], [2.0 / 3.0, 2.0 / 3.0]]))


def test_l_frame():
    C = tip_compliance(((1.0, 0.0, 0.0), FIRST), ((0.0, 1.0, 0.0), SECOND))
    inside, outside = [0, 1, 5], [2, 3, 4]
    assert l_frame_in_plane(FIRST, SECOND) == pytest.approx(C[np.ix_(inside, inside)], rel=1e-13)
    assert l_frame_out_of_plane(FIRST, SECOND) == pytest.approx(C[np.ix_(outside, outside)], rel=1e-13, abs=1e-25)
    assert pytest.approx(0.0, abs=1e-25) == C[np.ix_(inside, outside)]


def test_root_springs():
    bar = Bar(300.0, 2e8)
    assert cantilever_on_springs(bar, 1e3, 1e7) == pytest.approx(300.0**3 / 6e8 + 1e-3 + 300.0**2 / 1e7, rel=1e-14)
    assert cantilever_on_springs(bar, float("inf"), float("inf")) == cantilever(bar)[0, 0]


def test_springs_in_series():
    assert springs_in_series([3.0, 6.0]) == pytest.approx(2.0, rel=1e-15)
    assert springs_in_series([5.0, float("inf")]) == 5.0


def test_out_of_range_is_refused():
    with pytest.raises(ValueError, match="EI is 0"):
        Bar(1.0, 0.0)
    with pytest.raises(ValueError, match="both must be above 0"):
        cantilever_on_springs(Bar(1.0, 1.0), 0.0, 1.0)
    for bad in ([], [1.0, -1.0]):
        with pytest.raises(ValueError, match="springs in series"):
            springs_in_series(bad)
