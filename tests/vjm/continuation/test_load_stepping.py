"""How paths are followed: branches, grids, ends, and what must not change them."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from helpers.file_texts import model_text, part_text, section_of

from vjm.continuation.load_grid import trace_grid
from vjm.continuation.load_stepping import follow
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium, EventKind
from vjm.engines import VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.files import parse_toml
from vjm.io.model_file import build_chain
from vjm.model.load_case import Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, frame, rotate_matrix6, rotation_from_vector, turn
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


# The steps that an engine takes by itself are those that are taken one by one.


CASES = [("A", -4.0, 4), ("A", 2.0, None), ("B", 4.0, 4), ("C", -1.0, 4), ("D", -4.0, None)]


@pytest.mark.parametrize(("posture", "to", "segments"), CASES)
def test_the_same_path_is_found_step_by_step(chain, monkeypatch, posture, to, segments):
    engine, load_case = VjmEngine(segments), LoadCase(posture, to)
    problem, taken = engine.problem(chain, load_case), []
    own = LumpedProblem.plain_steps

    def counted(self, *arguments):
        found, step = own(self, *arguments)
        taken.extend(found)
        return found, step

    monkeypatch.setattr(LumpedProblem, "plain_steps", counted)
    path = follow(problem, load_case)
    assert 2 * len(taken) > len(path.points)

    monkeypatch.setattr(LumpedProblem, "plain_steps", lambda self, known, limits, origin, step: ([], step))
    one_by_one = follow(engine.problem(chain, load_case), load_case)
    assert len(path.points) == len(one_by_one.points)
    # the same arithmetic but for the order of sums: rounding, enlarged by the steps that follow one another
    assert path.s == pytest.approx(one_by_one.s, rel=1e-12)
    assert path.stopped == one_by_one.stopped
    assert [e.kind for e in path.events] == [e.kind for e in one_by_one.events]
    # events are located to 1e-9 of themselves
    assert [e.s for e in path.events] == pytest.approx([e.s for e in one_by_one.events], rel=1e-9)
    unit = problem.model.wrench_scale
    for mine, other in zip(path.points, one_by_one.points, strict=True):
        assert mine.residual < 1e-11
        assert mine.unstable == other.unstable
        assert mine.iterations == other.iterations
        # residuals are below 1e-11, which a branch's softness enlarges
        assert np.abs((mine.wrench - other.wrench) / unit).max() < 1e-9 * max(
            1.0, np.abs(other.wrench / unit).max()
        )
        # a branch's amplitude is the root of the distance from its bifurcation: just behind it rounding of 1e-14
        # leaves some 3e-7 mm of the shape, and 4e-9 of the stiffness
        assert mine.shape == pytest.approx(other.shape, rel=1e-9, abs=1e-6)
        assert mine.displacement == pytest.approx(other.displacement, rel=1e-12, abs=1e-15)
        assert mine.stiffness == pytest.approx(other.stiffness, rel=1e-7, abs=1e-7 * np.abs(other.stiffness).max())


# Paths that the displacement of a point controls: where they go on, and why they end where they do.


DOWN = (0.0, -1.0, 0.0, 0.0, 0.0, 0.0)


def lee():
    """Lee's frame in centimetres and newtons."""
    section = Section(EA=4.32e7, GJ=1.44e10, EIy=1.44e10, EIz=1.44e7)
    quarter = turn(AXES["z"], 0.5 * np.pi)
    parts = (
        Joint("base", AXES["z"], passive=True), Beam("column", 120.0, section=section),
        RigidOffset("corner", np.linalg.inv(quarter)), Beam("near", 24.0, section=section),
        Beam("far", 96.0, section=section), Joint("end", AXES["z"], passive=True),
    )  # fmt: skip
    return Machine("lee", parts, base=quarter, postures={"drawn": np.zeros(2)})


def toggle():
    """Half of a truss of 20 over 100 mm, its apex free to sink."""
    rise = turn(AXES["z"], float(np.arctan(0.2)))
    section = Section(EA=1e5, GJ=1e8, EIy=1e8, EIz=1e8)
    parts = (Joint("base", AXES["z"], passive=True), Beam("bar", float(np.hypot(100.0, 20.0)), section=section),
             Joint("apex", AXES["z"], passive=True))  # fmt: skip
    return Machine("toggle", parts, base=rise, postures={"drawn": np.zeros(2)})


def column():
    section = Section(EA=2e7, GJ=1e6, EIy=2e7, EIz=1e6)
    return Machine("column", (Beam("bar", 100.0, section=section),), base=frame(np.eye(3)),
                 postures={"drawn": np.zeros(0)})  # fmt: skip


def test_a_gauge_that_begins_with_the_load_squared_is_followed_to_the_limit():
    load = Load(DOWN, part="near", at=1.0)
    case = LoadCase("drawn", 90.0, axis="load", loads=(load,), control=PointControl("near", 1.0, (1.0, 0.0, 0.0)))
    path = engine_by_name("vjm-16").trace(lee(), case)
    limit = path.events[-1]
    assert limit.kind is EventKind.LIMIT
    # by shooting, see the verification case lee-frame; sixteen springs err by 3.7e-6
    assert limit.force == pytest.approx(18556.7275, rel=1e-5)
    assert "the controlled displacement is not held" in path.stopped


@pytest.mark.parametrize("steps", [None, 20])
def test_a_toggle_controlled_by_its_drop_goes_through_to_its_mirror_image(steps):
    case = LoadCase(
        "drawn", 40.0, axis="load", steps=steps, free=("y",), loads=(Load(DOWN, part="bar"),),
        control=PointControl("bar", 1.0, (0.0, -1.0, 0.0)),
    )  # fmt: skip
    path = engine_by_name("vjm-1").trace(toggle(), case)
    assert path.complete, path.stopped
    # of 148 N what rounding leaves, 3e-12
    assert path.points[-1].ramp == pytest.approx(0.0, abs=1e-8)
    limit = next(event for event in path.events if event.kind is EventKind.LIMIT)
    # the largest EA (1/l - 1/L) h over the apex' height h; fixed steps find its place to 4e-10
    assert limit.force == pytest.approx(148.02588, rel=1e-6)


def test_a_gauge_across_a_perfect_column_is_told_to_be_still():
    case = LoadCase(
        "drawn", -5.0, axis="load", free=("x", "y", "rz"), loads=(Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),),
        control=PointControl("bar", 1.0, (0.0, 1.0, 0.0)),
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = engine_by_name("vjm-4").trace(column(), case)
    assert "the controlled displacement does not change along the path" in path.stopped


# What must not change a path: where the base stands, in which units and own axes the parts are given.


@pytest.mark.parametrize(("posture", "to", "segments"), [("A", 2.0, None), ("B", 4.0, None), ("D", -10.0, 4)])
@pytest.mark.parametrize("seed", [1, 2])
def test_turned_base_turns_the_path_with_it(chain, trace, posture, to, segments, seed):
    R = rotation_from_vector(np.random.default_rng(seed).standard_normal(3))
    turned = replace(chain, base=frame(R) @ chain.base)
    axis = (*(float(v) for v in R[:, 0]), 0.0, 0.0, 0.0)
    path = VjmEngine(segments).trace(turned, LoadCase(posture, to, axis, steps=20))
    original = trace(posture, to, segments, steps=20)
    assert path.critical.kind is original.critical.kind
    # the grid's points: beside them, the entry to the branch depends on the event to 1e-9 of the path
    grid = np.linspace(0.0, abs(to), 21)
    here, there = (p.force[[np.abs(p.s - s).argmin() for s in grid]] for p in (path, original))
    # the solver's tolerance of 1e-11 of 1e4 N, over forces of 1e3 N
    assert here == pytest.approx(there, rel=1e-9, abs=1e-6)
    assert path.critical.force == pytest.approx(original.critical.force, rel=1e-10)


def in_metres(part):
    """A part with its lengths in m: mm/N, rad/N and rad/(N mm) become m/N, rad/N and rad/(N m)."""
    match part:
        case RigidOffset():
            return replace(part, transform=frame(part.transform[:3, :3], part.transform[:3, 3] / 1000.0))
        case Beam():
            unit = np.sqrt(np.repeat([1e-3, 1e3], 3))
            s = part.section
            return replace(
                part, length=part.length / 1000.0, end_offset=part.end_offset / 1000.0,
                compliance=None if part.compliance is None else part.compliance * np.outer(unit, unit),
                section=Section(s.EA, s.GJ / 1e6, s.EIy / 1e6, s.EIz / 1e6, s.GAy, s.GAz),
            )  # fmt: skip
    return part


@pytest.mark.parametrize(("posture", "to", "segments"), [("A", 2.0, None), ("D", 3.0, None), ("C", -1.0, 4)])
def test_metres_give_the_forces_that_millimetres_give(chain, trace, posture, to, segments):
    base = frame(chain.base[:3, :3], chain.base[:3, 3] / 1000.0)
    metric = replace(chain, parts=tuple(in_metres(part) for part in chain.parts), base=base)
    path = VjmEngine(segments).trace(metric, LoadCase(posture, to / 1000.0, steps=20))
    original = trace(posture, to, segments, steps=20)
    grid = np.linspace(0.0, abs(to), 21)
    here, there = (
        p.force[[np.abs(p.s * unit - s).argmin() for s in grid]] for p, unit in ((path, 1000.0), (original, 1.0))
    )
    assert here == pytest.approx(there, rel=1e-9, abs=1e-6)
    # the error measured is rounding alone
    assert path.critical.force == pytest.approx(original.critical.force, rel=1e-10)
    # the error measured is rounding alone
    assert path.tangent[-1] / 1000.0 == pytest.approx(original.tangent[-1], rel=1e-10)


def test_rotating_a_matrix_part_and_its_frame_changes_nothing(chain, trace):
    """The same compliance given in other own axes is the same part in the posture that does not twist it."""
    R = rotation_from_vector([np.pi / 2.0, 0.0, 0.0])
    parts = tuple(
        replace(part, own_frame=part.own_frame @ R.T, section_frame=R @ part.section_frame,
                compliance=rotate_matrix6(part.compliance, R))
        if part in chain.beams[1:] else part
        for part in chain.parts
    )  # fmt: skip
    path = VjmEngine().trace(replace(chain, parts=parts), LoadCase("A", 2.0))
    assert path.critical.force == pytest.approx(trace("A", 2.0).critical.force, rel=1e-10)


# The paper's own grid: 0.001 mm in posture A. Slow chains of small steps find what adaptive ones find.


def leg(angle, **spring):
    """A bar between two hinges, the first one with a spring, askew by an angle."""
    text = model_text(
        "leg",
        part_text("actuator", "drive", axis="x", compliance_mm_per_N=2e-6),
        part_text("joint", "q1", axis="z", **spring),
        part_text("beam", "bar", length_mm=300.0, count=2, section=section_of("rectangle", 25.0, 6.0)),
        part_text("joint", "q2", axis="z"),
        postures={"bent": {"q1": angle, "q2": -angle}},
    )
    return build_chain(parse_toml(text), "leg.toml")


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
    problem = VjmEngine.of(8, 1).problem(leg(0.5), LoadCase("bent", -2.141))
    coarse, fine = (trace_grid(problem, np.linspace(0.0, 2.141, n)) for n in (5, 161))
    assert (coarse.stopped, fine.stopped) == ("", "")
    # the branch is one curve: to Newton's tolerance
    np.testing.assert_allclose(coarse.wrench[:, :3], fine.wrench[::40, :3], rtol=1e-6, atol=1e-3)


STIFFENING = {
    "kind": "polynomial", "K1_Nmm_per_rad": 2e5, "K3_Nmm_per_rad3": 1e8, "range_rad": [-0.5, 0.5]
}  # fmt: skip


@pytest.mark.parametrize("steps", [4, 16])
def test_a_step_that_ends_on_another_branch_is_taken_in_shorter_ones(steps):
    """A leg whose hinge stiffens has a sharp knee at 0.1395 mm; the first step of a grid leads far beyond it."""
    problem = VjmEngine(12).problem(leg(0.4, law=STIFFENING), LoadCase("bent", -4.0))
    coarse, adaptive = trace_grid(problem, np.linspace(0.0, 4.0, steps + 1)), follow(problem, problem.load_case)
    assert coarse.stopped == ""
    knee = next(event for event in adaptive.events if event.kind is EventKind.STIFFNESS_KNEE)
    # to the digits given
    assert knee.s == pytest.approx(0.1395, abs=1e-4)
    # from the point of the adaptive path before each, to Newton's tolerance
    for s, wrench in zip(coarse.s[1:], coarse.wrench[1:], strict=True):
        near = adaptive.points[int(np.searchsorted(adaptive.s, s)) - 1]
        exact = problem.solve(float(s), near, np.zeros_like(near.state))
        np.testing.assert_allclose(wrench[:3], exact.wrench[:3], rtol=1e-6, atol=1e-3)


# Columns alone: closed forms, round bars whose two modes buckle together, single springs, and no joints at all.


EA = 1e6
EULER = 1000.0
"""π²EI/L², N, of every column here; 100 mm long, shear-rigid."""
EI = EULER * 100.0**2 / np.pi**2


def critical_load(euler):
    """P of P (1 − P/EA) = P_E: an extensible, shear-rigid column buckles on its shortened arc."""
    return 0.5 * EA * (1.0 - np.sqrt(1.0 - 4.0 * euler / EA))


def universal_column(EIy):
    """A column on universal joints, y and z at both ends."""
    joints = [Joint(name, AXES[axis], passive=True) for name, axis in zip("abcd", "yzzy", strict=True)]
    beam = Beam("link", 100.0, section=Section(EA, EI, EIy, EI))
    return Machine("column", (*joints[:2], beam, *joints[2:]), postures={"straight": np.zeros(4)})


def clamped_column(EIy):
    beam = Beam("link", 100.0, section=Section(EA, EI, EIy, EI))
    return Machine("clamped", (beam,), postures={"straight": np.zeros(0)})


def test_pinned_column_alone_buckles_at_the_closed_form(column):
    path = VjmEngine(16).trace(column, LoadCase("straight", -0.2))
    # tenth order (docs/virtual-springs.md): sixteen springs err by 3e-11
    assert path.critical.force == pytest.approx(critical_load(EULER), rel=6e-10)
    # before buckling a bar, EA/L; just behind, the elastica's F = P_E (1 + δ/2L) in series with the bar
    assert path.tangent[0] == pytest.approx(EA / 100.0, rel=1e-10)
    assert path.critical.stiffness_after == pytest.approx(1.0 / (100.0 / EA + 200.0 / EULER), rel=0.02)


def test_clamped_column_buckles_at_four_times_the_pinned_load():
    # two half-waves, clamped: the pinned column's error with half the springs, and fourth order again
    error = []
    n = np.array([8, 16, 32])
    for segments in n:
        engine = VjmEngine(int(segments), placement="two-thirds")
        path = engine.trace(clamped_column(20.0 * EI), LoadCase("straight", -0.6))
        assert path.critical.kind is EventKind.BIFURCATION
        error.append(critical_load(4.0 * EULER) - path.critical.force)
    assert error[-1] < 3e-5 * 4.0 * EULER
    assert -np.polyfit(np.log(n), np.log(error), 1)[0] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("to", [-1.0, -10.0, -40.0])
def test_a_critical_load_is_located_as_well_on_a_long_path(to):
    # each is located to 1e-9 of itself; of 40 mm that would be 1e-7 of the 0.4 mm at which it buckles
    short, long = (VjmEngine(8).trace(clamped_column(20.0 * EI), LoadCase("straight", end)) for end in (-0.6, to))
    assert long.critical.s == pytest.approx(short.critical.s, rel=2e-9)


def test_clamped_column_of_eight_beam_column_springs_is_within_a_hundredth_of_a_per_cent():
    path = VjmEngine(8).trace(clamped_column(20.0 * EI), LoadCase("straight", -0.6))
    # half a wave on four springs, as the pinned column with four: some 3e-5
    assert path.critical.force == pytest.approx(critical_load(4.0 * EULER), rel=1e-4)


@pytest.mark.parametrize("placement", ["end", "middle", "two-thirds", "best"])
@pytest.mark.parametrize("segments", [2, 3, 4, 5, 8])
def test_round_bar_buckles_in_two_modes_at_once(segments, placement):
    """The bowed round bar turns freely about its chord: its branch has a neutral mode and is not unstable."""
    engine = VjmEngine(segments, placement=placement)
    round_bar = engine.trace(universal_column(EI), LoadCase("straight", -1.0))
    flat_bar = engine.trace(universal_column(2.0 * EI), LoadCase("straight", -1.0))
    assert (round_bar.critical.multiplicity, flat_bar.critical.multiplicity) == (2, 1)
    # the same mode: located to 1e-9 of 1 mm at 0.1 mm
    assert round_bar.critical.force == pytest.approx(flat_bar.critical.force, rel=1e-10)
    assert round_bar.complete, round_bar.stopped
    assert flat_bar.complete, flat_bar.stopped
    # the error measured is rounding alone
    assert round_bar.force[-1] == pytest.approx(flat_bar.force[-1], rel=1e-10)


@pytest.mark.parametrize("placement", ["end", "middle", "two-thirds", "best"])
@pytest.mark.parametrize("to", [-1.0, -8.0, 8.0])
def test_one_spring_a_column_ends_in_a_path_and_not_in_an_error(placement, to):
    """One spring between four joints leaves exactly singular systems: they are said, or passed, not raised."""
    path = VjmEngine(1, placement=placement).trace(universal_column(2.0 * EI), LoadCase("straight", to))
    assert path.complete or path.stopped
    assert np.all(path.unstable <= 0)


@pytest.mark.parametrize("segments", [None, 1, 2])
def test_cantilever_without_joints_can_be_traced(segments):
    """With one spring nothing is left to become unstable once the pose is held."""
    path = VjmEngine(segments).trace(clamped_column(EI), LoadCase("straight", 0.01, "y"))
    # 12 EI/L³ with the end's turn held; its axial stretch needs force of the order of (0.01/100)²
    assert path.tangent[0] == pytest.approx(12.0 * EI / 100.0**3, rel=1e-10)
    assert np.all(path.unstable == 0)
    assert path.complete


def test_joints_that_undo_each_other_change_nothing():
    """A column between joints whose axes it does not use is the pinned column."""
    plain = universal_column(2.0 * EI)
    swapped = replace(plain, parts=(*plain.parts[:3], plain.parts[4], plain.parts[3]))
    loads = [VjmEngine(4).trace(chain, LoadCase("straight", -0.5)).critical.force for chain in (plain, swapped)]
    # the error measured is rounding alone
    assert loads[0] == pytest.approx(loads[1], rel=1e-10)
