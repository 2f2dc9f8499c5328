"""Linear frames: closed forms against the unit load integrals taken numerically."""

import numpy as np
import pytest
from scipy.optimize import brentq

from vjm_validation.exact import columns, frames, space, trusses
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


# Frames against closed forms, printed figures and a frame's own energy.


STRIP = {"EI": 71240.0 * 0.54, "GJ": 27191.0 * 2.16}


def test_one_bar_is_prandtls_strip():
    found = frames.lateral_buckling([frames.FrameBar(100.0)], 1e6, 5e5, (200.0, 400.0), (0.0, -1.0))
    assert found == pytest.approx(columns.lateral_strip(100.0, 1e6, 5e5), rel=1e-9)


def test_a_corner_that_turns_by_nothing_is_none():
    halves = [frames.FrameBar(60.0), frames.FrameBar(40.0)]
    found = frames.lateral_buckling(halves, 1e6, 5e5, (200.0, 400.0), (0.0, -1.0))
    assert found == pytest.approx(columns.lateral_strip(100.0, 1e6, 5e5), rel=1e-9)


def test_the_right_angle_frame_has_the_printed_loads():
    # Simo and Vu-Quoc 1986: 1.088; Argyris and others 1979: 622
    legs = [frames.FrameBar(240.0), frames.FrameBar(240.0, -90.0)]
    assert frames.lateral_buckling(legs, bracket=(0.3, 2.0), force=(1.0, 0.0), **STRIP) == pytest.approx(
        1.088, rel=2e-3
    )
    assert frames.pure_bending(240.0, **STRIP) == pytest.approx(622.0, rel=5e-4)


@pytest.fixture(scope="module")
def toggle():
    rise, half = 0.386, 12.943
    bar = frames.FrameBar(float(np.hypot(half, rise)), float(np.rad2deg(np.arctan2(rise, half))))
    return frames.PlaneFrame([bar], 9270.0, 1885000.0, "clamped", "guided", 1)


@pytest.mark.parametrize(
    ("guess", "load"), [([631.6, 16.93, -61.0, 16.93], 33.86123), ([630.5, 15.63, -103.0, 15.63], 31.26258)]
)
def test_williams_toggle_has_the_limit_loads_of_other_solvers(toggle, guess, load):
    # both digits as another author's shooting and energy solvers print them
    assert 2.0 * toggle.turning_load(guess) == pytest.approx(load, abs=6e-6)


def test_no_turning_point_is_said(toggle):
    with pytest.raises(RuntimeError, match="no turning point near"):
        toggle.turning_load([1.0, 100.0, 0.0, 100.0])


def test_two_sprung_links_by_the_quadratic():
    # (c1 + c2 − P l1)(c2 − P l2) = c2²
    l1, l2, c1, c2 = 400.0, 300.0, 1e6, 5e5
    a, b, c = l1 * l2, -(l2 * (c1 + c2) + l1 * c2), c1 * c2
    exact = (-b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    assert frames.sprung_links([l1, l2], [c1, c2]) == pytest.approx(exact, rel=1e-12)


def test_a_steep_truss_leaves_its_axis_where_its_energy_is_flat_sideways():
    truss = trusses.TwoBarTruss(100.0, 300.0, 1e5)
    load = truss.sideways_load()
    assert load == pytest.approx(24776.3843, abs=1e-4)
    l0 = truss.bar_length

    def energy(x, v):
        lengths = np.hypot(100.0 + np.array([x, -x]), 300.0 - v)
        return float(np.sum(0.5 * 1e5 / l0 * (lengths - l0) ** 2)) - load * v

    apex = brentq(lambda v: truss.load(v) - load, 0.0, 60.0)
    slope = (energy(0.0, apex + 1e-3) - energy(0.0, apex - 1e-3)) / 2e-3
    sideways = energy(1e-1, apex) - 2.0 * energy(0.0, apex) + energy(-1e-1, apex)
    assert abs(slope) < 1e-5 * load
    assert abs(sideways) < 1e-4 * 1e5 / l0 * 1e-2


def test_a_flat_truss_is_stiff_sideways():
    with pytest.raises(ValueError, match="stiff sideways all the way"):
        trusses.TwoBarTruss(100.0, 20.0, 1e5).sideways_load()


def test_a_twisted_bar_bends_across_a_small_load_too():
    # ∫ (L − s)² c(s) ds with the compliance across, 1/EIy cos² + 1/EIz sin² and the coupling of both
    L, F, EI, twist = 100.0, 1e-3, (1e6, 12e6), 0.5 * np.pi / 100.0
    tip = space.dead_force(L, (0.0, 0.0, F), EI, 8e5, twist=twist)
    s = np.linspace(0.0, L, 20001)
    angle = twist * s
    along = np.trapezoid((L - s) ** 2 * (np.cos(angle) ** 2 / EI[0] + np.sin(angle) ** 2 / EI[1]), s)
    across = np.trapezoid((L - s) ** 2 * np.sin(angle) * np.cos(angle) * (1.0 / EI[1] - 1.0 / EI[0]), s)
    assert tip.z == pytest.approx(F * along, rel=1e-6)
    assert tip.y == pytest.approx(F * across, rel=1e-6)
