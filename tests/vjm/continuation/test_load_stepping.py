"""How paths are followed: branches, grids, ends, and what must not change them."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.load_stepping import follow
from vjm.continuation.path import Equilibrium, EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam
from vjm.statics import stability

# --- branches -------------------------------------------------------------------------------------


def deflection_from_chord(path):
    """Distances (k, 3) of the link's stations from the line between its ends, at the end of the path."""
    rows = [i for i, station in enumerate(path.stations) if station.part == "link"]
    points = path.points[-1].shape[rows]
    chord = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    from_root = points - points[0]
    return from_root - np.outer(from_root @ chord, chord)


@pytest.mark.parametrize(("posture", "to"), [("A", -4.0), ("C", -1.0)])
def test_both_branches_are_mirrored_and_carry_the_same_force(trace, posture, to):
    plus, minus = (trace(posture, to, 4, steps=50, branch=branch) for branch in (1, -1))
    bows = [deflection_from_chord(path) for path in (plus, minus)]
    assert np.abs(bows[0]).max() > 5.0  # mm: it has buckled
    # both are solved to 1e-11; the soft mode's stiffness is a hundredth of the model's unit
    assert np.abs(bows[0] + bows[1]).max() < 1e-6
    # the first points behind the bifurcation may differ in s: compare at the grid's
    common = np.linspace(0.0, abs(to), 51)
    forces = [path.force[[np.abs(path.s - s).argmin() for s in common]] for path in (plus, minus)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-10)


@pytest.mark.parametrize(("posture", "to", "segments"), [("A", 2.0, None), ("C", 0.3, None), ("A", -4.0, 4)])
def test_every_point_of_a_followed_path_is_stable(trace, posture, to, segments):
    path = trace(posture, to, segments)
    assert path.critical.kind is EventKind.BIFURCATION
    assert np.all(path.unstable == 0)
    assert np.all(np.diff(path.s) > 0.0)
    assert np.all(np.array([p.residual for p in path.points]) < 1e-11)
    # the eigenvalue grows again on the new branch: beyond one per cent behind the event it is clearly positive
    behind = path.s > 1.01 * path.critical.s
    assert path.eigenvalue_relative[behind].min() > 1e-3


def test_primary_branch_is_unstable_where_the_followed_one_is_not(trace, straight):
    critical = trace("A", 2.0).critical
    assert stability(straight(1.01 * critical.s)).unstable == 1
    assert stability(straight(0.99 * critical.s)).unstable == 0
    # and the followed branch is softer: it lies below
    path = trace("A", 2.0)
    assert straight(2.0).wrench[0] > 2.0 * path.force[-1]


def test_event_is_where_the_eigenvalue_vanishes(trace):
    critical = trace("A", 2.0).critical
    # located to 1e-9 of 2 mm, over a critical displacement of 0.8 mm
    assert abs(critical.point.eigenvalue / trace("A", 2.0).points[0].eigenvalue) < 1e-8


@pytest.mark.parametrize("segments", [None, 2, 4, 8, 16])
@pytest.mark.parametrize("placement", ["end", "middle", "best"])
@pytest.mark.parametrize("posture", "AC")
def test_a_sharp_point_is_reported_as_a_bifurcation_only(trace, posture, placement, segments):
    """The tangent jumps at the bifurcation: no stiffness knee is to be seen in the jump."""
    if segments is None:
        path = trace(posture, 2.0)
    else:
        path = trace(
            posture, -7.0 if posture == "A" and placement == "end" else -3.5, segments, placement=placement
        )
    assert path.critical.kind is EventKind.BIFURCATION
    assert [event.kind for event in path.events].count(EventKind.STIFFNESS_KNEE) == 0


def test_a_free_component_has_no_events(trace):
    """About y the end-effector turns freely on its last joint: there is no force to have a maximum."""
    path = trace("B", 0.5, axis="ry")
    assert np.abs(path.force).max() < 1e-9  # N mm: rounding of moments of 1e5
    assert path.events == ()


# --- grids ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("posture", "to", "steps"), [("B", 4.0, 40), ("A", 2.0, 40), ("A", 2.0, 7)])
def test_fixed_steps_visit_every_grid_point(trace, posture, to, steps):
    path = trace(posture, to, steps=steps)
    for s in np.linspace(0.0, to, steps + 1):
        assert np.abs(path.s - s).min() <= 1e-12 * to


@pytest.mark.parametrize(("posture", "to", "steps", "entries"), [
    ("B", 1.0, 10, 0), ("B", 4.0, 40, 0), ("A", 2.0, 40, 1),
])  # fmt: skip
def test_fixed_steps_visit_nothing_but_the_grid_and_the_branch_entry(trace, posture, to, steps, entries):
    path = trace(posture, to, steps=steps)
    assert len(path.points) == steps + 1 + entries


def test_adaptive_and_fixed_steps_meet(trace):
    adaptive, fixed = trace("B", 4.0), trace("B", 4.0, steps=100)
    # both ends are solved to 1e-11 of forces of 1e4 N, whatever way led there
    assert adaptive.force[-1] == pytest.approx(fixed.force[-1], rel=2e-10)
    assert adaptive.critical.s == pytest.approx(fixed.critical.s, abs=2e-9 * 4.0)


# --- ends -----------------------------------------------------------------------------------------


def test_subcritical_bifurcation_ends_the_path_with_its_reason(column):
    """A column so stocky that it shortens by a third before it buckles snaps instead of bowing."""
    (beam,) = column.beams
    stocky = replace(beam, section=replace(beam.section, EA=4200.0))
    parts = tuple(stocky if part is beam else part for part in column.parts)
    path = VjmEngine(8).trace(replace(column, parts=parts), LoadCase("straight", -49.0))
    assert not path.complete
    assert "subcritical" in path.stopped
    assert path.critical.kind is EventKind.BIFURCATION
    assert not path.critical.switched
    assert path.critical.stiffness_after is None
    assert len(path.points) > 10
    assert path.s[-1] <= path.critical.s
    assert np.all(path.unstable == 0)


def test_path_that_loses_its_equilibrium_keeps_what_it_has(trace):
    """Folded far beyond its buckling, the chain of four springs snaps through to no neighbouring state."""
    path = trace("A", -500.0, 4, placement="two-thirds")
    assert path.stopped
    assert not path.complete
    assert 200.0 < path.s[-1] < 500.0
    assert path.critical.force == pytest.approx(8813, abs=0.5)


class Toy:
    """Forces and eigenvalues by formula, to see the follower alone: shape and state are s."""

    label = "toy"
    stations = ()
    conservative = True

    def __init__(self, force, tangent, eigenvalue=lambda s: 1.0, end=np.inf, after=None):
        self.force, self.slope, self.eigenvalue, self.end, self.after = force, tangent, eigenvalue, end, after

    def point(self, s, *, switched=False):
        value = 1.0 if switched else self.eigenvalue(s)
        return Equilibrium(
            s, s * np.eye(6)[0], self.force(s) * np.eye(6)[0], self.slope(s), value, int(value < 0.0), 1, 0.0,
            np.array([[s, 0.0, 0.0]]), np.array([s, float(switched)]),
        )  # fmt: skip

    def unloaded(self):
        return self.point(0.0)

    def solve(self, s, start, slope=None):
        if s > self.end:
            raise NoConvergenceError("the toy ends here")
        return self.point(s, switched=bool(start.state[1]))

    def tangent(self, point, along=None):
        return np.array([1.0, 0.0])

    def growth(self, point, change):
        return change[0]

    def scaled(self, change):
        return change

    def across(self, start, slope, step):
        return self.solve(start.s + step, start)

    def nearest_product(self, point):
        return float("nan")

    def switch(self, critical, s, sign):
        if self.after is None:
            raise NoConvergenceError("nothing crosses")
        return self.after(self, s)


def test_end_of_the_equilibria_is_found_to_the_smallest_step():
    path = follow(Toy(lambda s: s, lambda s: 1.0, end=0.7), LoadCase("p", 1.0))
    # steps are halved down to 1e-6 of the path
    assert path.s[-1] == pytest.approx(0.7, abs=2e-6)
    assert path.stopped.endswith("the toy ends here")


def test_limit_and_stiffness_knee_are_located_where_the_formula_has_them():
    # F = sin s: half of the unloaded stiffness at π/3, the maximum at π/2
    path = follow(Toy(np.sin, np.cos), LoadCase("p", 2.0))
    kinds = [(event.kind, event.s, event.force) for event in path.events]
    assert kinds[0][0] is EventKind.STIFFNESS_KNEE
    assert kinds[1][0] is EventKind.LIMIT
    # the promised 1e-9 of the path
    assert [s for _, s, _ in kinds] == pytest.approx([np.pi / 3, np.pi / 2], abs=2e-9)
    assert [f for _, _, f in kinds] == pytest.approx([np.sin(np.pi / 3), 1.0], abs=2e-9)
    limit = path.events[1]
    # the error measured is rounding alone
    assert limit.stiffness_before == pytest.approx(np.cos(0.99 * np.pi / 2), abs=1e-9)
    # the error measured is rounding alone
    assert limit.stiffness_after == pytest.approx(np.cos(1.01 * np.pi / 2), abs=1e-9)


def test_bifurcation_is_located_and_left_on_the_crossing_branch():
    toy = Toy(lambda s: s, lambda s: 1.0, lambda s: 0.6 - s, after=lambda self, s: self.point(s, switched=True))
    path = follow(toy, LoadCase("p", 1.0))
    (event,) = path.events
    assert event.switched
    assert event.s == pytest.approx(0.6, abs=2e-9)
    assert path.complete
    assert path.points[-1].state[1] == 1.0


@pytest.mark.parametrize(("after", "said"), [
    (None, "nothing crosses"), (lambda self, s: self.point(s), "branch that leads on is unstable"),
])  # fmt: skip
def test_bifurcation_without_a_stable_branch_ends_the_path(after, said):
    toy = Toy(lambda s: s, lambda s: 1.0, lambda s: 0.6 - s, after=after)
    path = follow(toy, LoadCase("p", 1.0))
    assert said in path.stopped
    assert path.events[0].s == pytest.approx(0.6, abs=2e-9)
    assert not path.events[0].switched
    assert path.s[-1] <= 0.6


def test_progress_runs_to_one(chain):
    seen = []
    VjmEngine().trace(chain, LoadCase("B", 1.0), seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0, abs=1e-12)


def test_chain_without_a_posture_or_section_is_refused_before_it_is_traced(chain):
    with pytest.raises(KeyError):
        VjmEngine().trace(chain, LoadCase("Z", 1.0))
    bare = Machine("bare", (Beam("b", 1.0, compliance=np.eye(6)),), postures={"p": np.zeros(0)})
    with pytest.raises(ValueError) as refusal:
        VjmEngine(2).trace(bare, LoadCase("p", 1.0))
    assert "no section" in str(refusal.value)


def test_labels_of_engines():
    assert [VjmEngine().label, VjmEngine(16).label, VjmEngine(8, 4).label, VjmEngine(2, placement="end").label] == [
        "vjm-paper", "vjm-16", "vjm-8f4", "vjm-2-end",
    ]  # fmt: skip
