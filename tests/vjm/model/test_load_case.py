import numpy as np
import pytest

from vjm.continuation.path import EventKind, Path
from vjm.model.load_case import COMPONENTS, Load, LoadCase, PointControl


@pytest.mark.parametrize(("bad", "said"), [
    ({"axis": "w"}, "none of x, y, z"),
    ({"axis": (1.0, 0.0)}, "six finite numbers"),
    ({"axis": (0.0,) * 6}, "not all zero"),
    ({"axis": (np.nan, 1.0, 0.0, 0.0, 0.0, 0.0)}, "six finite numbers"),
    ({"to": 0.0}, "other than zero"),
    ({"to": np.inf}, "finite displacement"),
    ({"to": np.nan}, "finite displacement"),
    ({"steps": 0}, "at least one step"),
    ({"steps": -3}, "at least one step"),
    ({"control": "time"}, "none of ramp, arc"),
    ({"control": "arc", "steps": 3}, "not an arc"),
    ({"imperfection": -1.0}, "zero or more"),
    ({"free": ("w",)}, "none of x, y, z"),
    ({"free": ("y", "y")}, "only once"),
    ({"free": ("x",)}, "free and driven at once"),
    ({"axis": "load"}, "needs a load"),
    ({"loads": (Load((1, 0, 0, 0, 0, 0)),)}, "needs the axis 'load'"),
    ({"gravity": (0.0, np.nan, 0.0)}, "three finite numbers"),
    ({"branch": 0}, "needs the arc"),
    ({"branch": 2}, "+1, -1 or 0"),
])  # fmt: skip
def test_impossible_ramps_are_refused(bad, said):
    with pytest.raises(ValueError) as refusal:
        LoadCase(**{"posture": "A", "to": 1.0, **bad})
    assert said in str(refusal.value)


@pytest.mark.parametrize("axis", COMPONENTS)
@pytest.mark.parametrize("to", [2.0, -2.0])
def test_ramp_ends_where_it_says(axis, to):
    ramp = LoadCase("A", to, axis)
    assert ramp.length == 2.0
    end = ramp.displacement(ramp.length)
    assert end[COMPONENTS.index(axis)] == to
    assert np.count_nonzero(end) == 1
    # a resisted ramp's force is counted positive whichever way it goes
    assert ramp.direction @ end > 0.0
    assert not np.any(np.signbit(ramp.displacement(0.0)))


def test_oblique_ramp_goes_its_own_way():
    axis = (0.6, 0.0, 0.8, 0.0, 0.0, 0.01)
    ramp = LoadCase("A", -3.0, axis)
    assert ramp.displacement(3.0) == pytest.approx(-3.0 * np.array(axis), rel=1e-15)


@pytest.mark.parametrize(("posture", "to"), [("A", 2.0), ("B", 4.0)])
def test_arrays_of_a_path_are_those_of_its_points(trace, posture, to):
    path: Path = trace(posture, to)
    n = len(path.points)
    assert path.wrench.shape == path.displacement.shape == (n, 6)
    assert np.array_equal(path.displacement[:, 0], path.s)
    assert np.array_equal(path.force, path.wrench[:, 0])
    assert path.eigenvalue_relative[0] == 1.0
    assert path.force[0] == path.s[0] == 0.0
    assert path.s[-1] == to
    # the tangent is the force's derivative: central differences where the path is smooth, to their truncation
    inner = slice(1, -1)
    slope = np.gradient(path.force, path.s)[inner]
    smooth = np.abs(np.diff(path.tangent, 2)) < 0.01 * path.tangent[inner]
    assert slope[smooth] == pytest.approx(path.tangent[inner][smooth], rel=0.02)
    assert np.count_nonzero(smooth) > n / 2


def test_compression_counts_force_and_displacement_as_magnitudes(trace):
    path = trace("A", -3.5, 4)
    assert path.displacement[-1, 0] == -3.5
    assert path.wrench[-1, 0] < 0.0 < path.force[-1]
    assert path.critical.kind is EventKind.BIFURCATION
    assert path.critical.force > 0.0
    assert path.critical.s > 0.0


@pytest.mark.parametrize("wrench", [(0.0,) * 6, (1.0, 0.0), (np.nan, 0, 0, 0, 0, 0)])
def test_impossible_loads_are_refused(wrench):
    with pytest.raises(ValueError, match="six finite numbers"):
        Load(wrench)


def test_a_point_needs_a_direction():
    with pytest.raises(ValueError, match="three finite numbers"):
        PointControl("link", 1.0, (0.0, 0.0, 0.0))
