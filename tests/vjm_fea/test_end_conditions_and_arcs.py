"""Finite elements against the lumped model: free components, loads anywhere, arcs; the deep arch's limit load."""

from functools import cache

import numpy as np
import pytest
from helpers.elements import either

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import ARC, COMPONENTS, Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, frame, rotation_from_vector, turn
from vjm_fea.exudyn.engine import ExudynEngine, ExudynStatics
from vjm_validation.exact import arches

PUSH = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
# wrenches in units of 300 mm, so that forces and moments weigh the same
ARM = np.array([1.0, 1.0, 1.0, 300.0, 300.0, 300.0])


@pytest.fixture(scope="module")
def crooked():
    """Two heavy bars and rigid pieces, nothing along an axis, that give way in every direction."""
    section = Section(6e6, 1e7, 2e8, 4e7, mass=2e-3)
    R = rotation_from_vector
    parts = (
        RigidOffset("base", frame(R([0.2, 0.1, -0.3]), [20.0, -10.0, 5.0]), mass=0.5),
        Beam("first", 200.0, own_frame=R([0.1, 0.5, 0.2]), section_frame=R([0.3, 0.0, 0.4]),
             end_offset=np.array([5.0, 20.0, -10.0]), section=section),
        Beam("second", 150.0, own_frame=R([-0.4, 0.2, 0.9]), section=section),
        RigidOffset("tool", frame(R([0.7, 0.1, 0.3]), [0.0, 20.0, 30.0]), mass=1.0),
    )  # fmt: skip
    return Machine(
        "crooked", parts, base=frame(R([0.3, -0.2, 0.5]), [10.0, 20.0, 30.0]), postures={"-": np.zeros(0)}
    )


LOADS = (
    Load((30.0, -20.0, 10.0, 500.0, -800.0, 300.0), ramped=False),
    Load((100.0, 50.0, -200.0, 0.0, 0.0, 0.0), "first", 0.4, follower=True, ramped=False),
    Load((50.0, 0.0, -20.0, 0.0, 0.0, 1000.0), "tool", 0.5, ramped=False),
)
HANDS = [
    (("x",), "rz", 0.1),
    (("ry",), "rz", 0.1),
    (("rx", "ry"), "y", 3.0),
    (("y", "rx"), "rz", 0.1),
    (("rx", "ry", "rz"), "z", 5.0),
    (("x", "y", "rx", "ry", "rz"), "z", 5.0),
]


@pytest.mark.quick_cases(3)
@either
@pytest.mark.parametrize(("free", "axis", "to"), HANDS, ids=lambda value: str(value))
def test_whatever_the_hand_lets_go_is_as_in_the_lumped_model(crooked, engine, free, axis, to):
    """Every kind of load, weight, hinges in their order, slides in the axes of a support that turns."""
    load_case = LoadCase("-", to, axis, free=free, loads=LOADS, gravity=(0.0, 0.0, -981.0), steps=2)
    lumped, ours = (e.trace(crooked, load_case).points[-1] for e in (VjmEngine(32), engine(16)))
    size = np.abs(lumped.wrench / ARM).max()
    # two discretisations: measured up to 1.6e-3 of the wrench and 3e-4 of the motion with 16 elements, and a
    # quarter to a sixteenth of that with 32
    assert ours.wrench / ARM / size == pytest.approx(lumped.wrench / ARM / size, abs=3e-3)
    moved = lumped.displacement * ARM
    assert ours.displacement * ARM == pytest.approx(moved, abs=1e-3 * np.abs(moved).max())
    K = np.abs(lumped.stiffness / np.outer(ARM, ARM)).max()
    difference = (ours.stiffness - lumped.stiffness) / np.outer(ARM, ARM) / K
    assert difference == pytest.approx(0.0, abs=3e-3)
    assert ours.unstable == lumped.unstable == 0


@either
def test_the_loaded_tangent_is_the_residual_s_derivative(crooked, engine):
    """With followers, moments and forces at stations and on rigid pieces, away from equilibrium too."""
    load_case = LoadCase("-", 0.1, "rz", free=("x", "ry"), loads=LOADS, gravity=(0.0, 0.0, -9810.0))
    statics = engine(3).problem(crooked, load_case).statics
    rng = np.random.default_rng(5)
    missing = []
    for size in (0.0, 0.02):
        motion = size * rng.standard_normal(len(statics.unit)) / statics.unit
        motion[statics.motions :] = 0.0
        turns = np.tile([False] * 3 + [True] * 3, statics.states.bodies)
        motion[: len(turns)][~turns] *= 10.0
        state = statics.moved(statics.initial, motion)
        J = statics.tangent(state).J
        own = statics.tangent(statics.initial).J
        columns = [c for c in statics.free[::5] if c < statics.motions]
        for column in columns:
            step = np.zeros(len(statics.unit))
            step[column] = 2e-5
            ahead, behind = (statics.residual(statics.moved(state, sign * step)) for sign in (1.0, -1.0))
            missing.append(np.abs((ahead - behind) / 4e-5 - J[:, column]).max() / np.abs(own[:, column]).max())
    assert len(missing) > 10
    # differences are good to 1e-8; OpenSees leaves out what is of second order in a node's turn against its element
    assert max(missing[: len(missing) // 2]) < 1e-7
    assert max(missing) < (1e-7 if isinstance(statics, ExudynStatics) else 1e-3)


PROGRAMMES = {
    "free turns, displacement": LoadCase("B", -8.5, free=("rx", "ry", "rz"), steps=4),
    "free turn and x, dead loads": LoadCase(
        "D", 3000.0, "load", free=("x", "rx"), steps=3,
        loads=(PUSH, Load((0.0, 20.0, 30.0, 500.0, 200.0, 300.0), ramped=False)),
    ),
    "loads along the bar": LoadCase(
        "B", 200.0, "load", steps=3,
        loads=(Load((0.0, 1.0, 2.0, 0.0, 0.0, 0.0), "link", 0.5),
               Load((0.0, 1.0, 0.2, 0.0, 0.0, 0.0), "link", 0.25, follower=True)),
    ),
}  # fmt: skip


@pytest.mark.slow
@either
@pytest.mark.parametrize("name", PROGRAMMES)
def test_the_paper_s_chain_answers_as_the_lumped_model(orthoglide, engine, name):
    load_case = PROGRAMMES[name]
    lumped, ours = (e.trace(orthoglide, load_case) for e in (VjmEngine(16, 16), engine(16)))
    assert ours.complete
    assert lumped.complete
    scale = np.abs(lumped.wrench / ARM).max()
    # measured 3e-5 behind the bend, and half of that in a follower's share
    assert ours.wrench / ARM / scale == pytest.approx(lumped.wrench / ARM / scale, abs=2e-4)
    assert ours.displacement == pytest.approx(
        lumped.displacement, abs=2e-4 * np.abs(lumped.displacement).max() + 1e-9
    )
    # the driven stiffness, or the load's, is where the wrench's error has grown
    assert ours.tangent == pytest.approx(lumped.tangent, rel=2e-3)


@pytest.mark.slow
@either
def test_free_turns_under_a_dead_load_buckle_as_the_lumped_model(orthoglide, engine):
    """Posture B with the tool free to turn: locked it bends over, free it has a bifurcation."""
    load_case = LoadCase("B", -7600.0, "load", free=("x", "rx", "ry", "rz"), loads=(PUSH,), control=ARC)
    lumped, ours = (
        trace(e.problem(orthoglide, load_case), load_case, ArcControl(last=EventKind.BIFURCATION))
        for e in (VjmEngine(16, 16), engine(16))
    )
    # measured 1e-5 apart, 3e-6 with OpenSees
    assert ours.critical.kind is lumped.critical.kind is EventKind.BIFURCATION
    assert ours.critical.force == pytest.approx(lumped.critical.force, rel=3e-5)


@pytest.mark.quick_cases(1)
@either
def test_a_chain_s_own_slide_is_one_of_the_hand_s(engine):
    """A bar on a slide that leans over, pushed: the slide at its root against the lumped model's."""
    section = Section(1e7, 1e6, 2e6, 1e6)
    lean = np.array([0.0, np.cos(0.3), np.sin(0.3)])
    parts = (Joint("slide", lean, slides=True, passive=True), Beam("bar", 100.0, section=section))
    chain = Machine("slider", parts, postures={"-": np.array([7.0])})
    load = Load((0.0, 2.0, -1.0, 50.0, 0.0, 0.0), "bar", 0.5, ramped=False)
    load_case = LoadCase("-", 3.0, "z", free=("rx", "rz"), loads=(load,), steps=2)
    lumped, ours = (e.trace(chain, load_case).points[-1] for e in (VjmEngine(32), engine(16)))
    # fourth order: measured 4.6e-5 with 16 elements
    scale = np.abs(lumped.wrench / ARM).max()
    assert ours.wrench / ARM / scale == pytest.approx(lumped.wrench / ARM / scale, abs=1e-4)
    assert ours.displacement == pytest.approx(lumped.displacement, abs=1e-5)
    # the error measured is 1e-5
    assert ours.shape[0] == pytest.approx(lumped.shape[0], abs=2e-4)


def test_a_foot_known_by_its_matrix_bears_loads_as_in_the_lumped_model(orthoglide):
    """One spring a foot on either side; their laws differ by the square of its turn."""
    apart = []
    for size in (1.0, 0.1):
        loads = (
            Load((20.0 * size, -10.0 * size, 30.0 * size, 0.0, 0.0, 0.0), "foot", 0.5, ramped=False),
            Load((0.0, 3.0 * size, 2.0 * size, 0.0, 0.0, 0.0), "link", 0.5, ramped=False),
            PUSH,
        )
        load_case = LoadCase("D", 50.0 * size, "load", free=("x", "rx"), loads=loads, steps=1)
        engines = (VjmEngine(16), ExudynEngine(foot_spring=True))
        lumped, ours = (e.trace(orthoglide, load_case).points[-1] for e in engines)
        # the error measured is 3e-5
        assert ours.wrench == pytest.approx(lumped.wrench, abs=5e-4 * size)
        apart.append(np.abs(ours.displacement - lumped.displacement).max())
    # turns of 7e-4 on an arm of 146 mm, squared
    assert apart[0] < 1e-4
    assert apart[1] < 0.02 * apart[0]


def test_a_mechanism_is_refused(orthoglide):
    with pytest.raises(ValueError, match="posture A: with y free the chain is a mechanism"):
        ExudynEngine().problem(orthoglide, LoadCase("A", -1.0, free=("y",)))


# --- limit points -------------------------------------------------------------------------------------


def arch(sides: int) -> Machine:
    """The arch of 120° with radius 100 as a polygon with its corners on it, clamped and hinged."""
    angle = np.deg2rad(120.0) / sides
    section = Section(1e8, GJ=1e9, EIy=1e9, EIz=1e6)
    parts: list = []
    for i in range(sides):
        parts.append(RigidOffset(f"corner-{i}", turn(AXES["z"], -angle if i else -0.5 * angle)))
        parts.append(Beam(f"side-{i + 1}", 200.0 * np.sin(0.5 * angle), section=section))
    parts.append(Joint("hinge", AXES["z"], passive=True))
    return Machine("arch", tuple(parts), base=turn(AXES["z"], np.deg2rad(60.0)), postures={"-": np.zeros(1)})


@cache
def arch_path(sides: int):
    crown = Load((0.0, -1.0, 0.0, 0.0, 0.0, 0.0), f"side-{sides // 2}")
    load_case = LoadCase("-", 1600.0, "load", loads=(crown,), control=ARC)
    engine = ExudynEngine(elements=1)
    return trace(engine.problem(arch(sides), load_case), load_case, ArcControl(last=EventKind.LIMIT))


@pytest.mark.slow
def test_the_limit_load_of_the_deep_arch():
    """P a²/EI = 13.2132; DaDeppo and Schmidt, *Journal of Applied Mechanics* 42 (1975), print 13.21."""
    exact = arches.limit_load(np.deg2rad(60.0), axial=1e-6)
    errors = []
    for sides in (6, 12, 24):
        event = arch_path(sides).events[-1]
        assert event.kind is EventKind.LIMIT
        errors.append(event.force / 100.0 / exact - 1.0)
    # a polygon's second order lies under the elements' fourth: measured 4.4e-2, 5.7e-3, 1.1e-3, and 2.5e-4 with 48
    observed = np.log2(np.abs(np.array(errors[:-1]) / errors[1:]))
    assert np.all(observed > 1.9)
    assert abs(errors[-1]) < 1.5e-3


@pytest.mark.slow
def test_behind_its_limit_the_arch_is_unstable_and_a_device_holds_it():
    """The same states, stable where the crown's depth is imposed, unstable under the dead load."""
    path = arch_path(6)
    force = Load((0.0, -1.0, 0.0, 0.0, 0.0, 0.0), "side-3")
    depth = 60.0
    control = PointControl("side-3", 1.0, (0.0, -1.0, 0.0))
    load_case = LoadCase("-", depth, "load", loads=(force,), steps=30, control=control)
    held = ExudynEngine(elements=1).trace(arch(6), load_case)
    limits = [event for event in held.events if event.kind is EventKind.LIMIT]
    assert held.complete
    assert set(held.unstable) == {0}
    # the error measured is rounding alone
    assert limits[0].force == pytest.approx(path.events[-1].force, rel=1e-9)
    assert held.force[-1] < 0.99 * limits[0].force
    dead = LoadCase("-", 1600.0, "load", loads=(force,), control=ARC)
    problem = ExudynEngine(elements=1).problem(arch(6), dead)
    crossed = trace(problem, dead, ArcControl(points=len(path.points) + 25))
    counts = crossed.unstable
    assert counts[0] == 0
    assert counts[-1] == 1
    assert np.all(np.diff(counts) >= 0)
    # it is stable as far as the load grows, and the limit lies between two points
    grows = np.diff(crossed.ramp) > 0.0
    assert np.count_nonzero((counts[:-1] == 0) != grows) <= 1


@pytest.mark.slow
@either
def test_a_cantilever_without_a_limit_keeps_to_its_ramp(engine):
    """By the arc and by the ramp: the same equilibria."""
    section = Section(1e7, 1e6, 2e6, 1e6)
    chain = Machine("cantilever", (Beam("link", 100.0, section=section),), postures={"-": np.zeros(0)})
    load = Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0))
    by_arc, by_ramp = (
        engine(4).trace(chain, LoadCase("-", 150.0, "load", free=COMPONENTS, loads=(load,), **how))
        for how in ({"control": ARC}, {"steps": 3})
    )
    assert by_arc.complete
    assert by_arc.points[-1].ramp == pytest.approx(150.0, abs=1e-6)
    assert by_arc.points[-1].displacement == pytest.approx(by_ramp.points[-1].displacement, abs=1e-7)
    assert not by_arc.events


@pytest.mark.slow
def test_a_path_that_begins_with_the_load_squared_goes_to_the_side_of_its_load():
    # Lee's frame, its loaded point watched sideways: both signs of the load move it there
    section, quarter = Section(EA=4.32e7, GJ=1.44e10, EIy=1.44e10, EIz=1.44e7), turn(AXES["z"], 0.5 * np.pi)
    parts = (
        Joint("base", AXES["z"], passive=True), Beam("column", 120.0, section=section),
        RigidOffset("corner", np.linalg.inv(quarter)), Beam("near", 24.0, section=section),
        Beam("far", 96.0, section=section), Joint("end", AXES["z"], passive=True),
    )  # fmt: skip
    frame_of_lee = Machine("lee", parts, base=quarter, postures={"-": np.zeros(2)})
    load = Load((0.0, -1.0, 0.0, 0.0, 0.0, 0.0), part="near", at=1.0)
    watched = PointControl("near", 1.0, (1.0, 0.0, 0.0))
    path = ExudynEngine(elements=8).trace(
        frame_of_lee, LoadCase("-", 90.0, axis="load", loads=(load,), control=watched)
    )
    assert path.events[-1].kind is EventKind.LIMIT
    # by shooting, see the verification case lee-frame; eight elements a beam err by 1.6e-4
    assert path.events[-1].force == pytest.approx(18556.7275, rel=5e-4)
    assert "the controlled displacement is not held" in path.stopped


@either
def test_a_gauge_across_a_perfect_column_is_named_as_what_does_not_move(engine):
    bar = Beam("bar", 100.0, section=Section(EA=2e7, GJ=1e6, EIy=2e7, EIz=1e6))
    column = Machine("column", (bar,), postures={"-": np.zeros(0)})
    across = PointControl("bar", 1.0, (0.0, 1.0, 0.0))
    load = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    case = LoadCase("-", 20.0, axis="load", free=COMPONENTS, loads=(load,), control=across)
    assert "the controlled displacement does not change along the path" in engine(4).trace(column, case).stopped
