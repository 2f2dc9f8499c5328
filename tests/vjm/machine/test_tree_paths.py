"""Equilibrium paths and buckling of machines with branches and with springs between points."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.closed_machines import MACHINES
from helpers.random_machines import GRAVITY, random_machine
from helpers.virtual_work import Statics, posture_values

import vjm
from vjm.compensation import compensated_arm
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine, engine_by_name
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.machine.inverse_kinematics import ClosedPostures, ReachError, postures_of
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.load_case import COMPONENTS, Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, JointCoupling, PointSpring, RigidOffset, Section
from vjm.postures import in_posture
from vjm.rotations import AXES, frame, rotation_from_vector, translation

DOWN = (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def arm():
    section = Section(EA=2e8, GJ=1e9, EIy=2e10, EIz=1e9)
    bend = frame(rotation_from_vector(np.array([0.1, 0.2, 0.3])), [30.0, 5.0, 2.0])
    parts = (Joint("drive", AXES["z"], compliance=1e-7), Beam("first", 400.0, section=section),
             RigidOffset("bend", bend, mass=2.0), Beam("second", 300.0, section=section))  # fmt: skip
    return Machine("arm", parts, postures={"-": np.zeros(0)}, held={"-": {"drive": 0.3}})


@pytest.mark.parametrize(
    "case",
    [
        LoadCase("-", -3.0, gravity=(0.0, 0.0, -9.81)),
        LoadCase("-", 3.0, axis="y", free=("x", "rz")),
        LoadCase("-", 4000.0, axis="load", free=COMPONENTS, loads=(
            Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), follower=True),
            Load((0.0, 0.0, 0.0, 0.0, 0.0, 100.0), "first", 0.5, ramped=False))),
        LoadCase("-", 20.0, axis="load", free=COMPONENTS, loads=(Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0)),),
                 control=PointControl("first", 1.0, (0.0, 1.0, 0.0))),
        LoadCase("-", 4000.0, axis="load", free=COMPONENTS, loads=(Load((-1.0, 0.1, 0.0, 0.0, 0.0, 0.0)),),
                 control="arc"),
    ],
    ids=["pose-and-weight", "free", "followers", "gauge", "arc"],
)  # fmt: skip
def test_a_chain_written_as_a_tree_goes_the_same_path(case):
    chain = arm()
    names = [part.name for part in chain.parts]
    tree = replace(chain, after=dict(zip(names[1:], names, strict=False)))
    one, other = (engine_by_name("vjm-2").trace(machine, case) for machine in (chain, tree))
    assert not one.stopped
    assert not other.stopped
    assert len(one.points) == len(other.points)
    a, b = one.points[-1], other.points[-1]
    # two solvers of the same equations, each to 1e-11 of its scale
    assert b.wrench == pytest.approx(a.wrench, rel=1e-9, abs=1e-6)
    assert b.shape == pytest.approx(a.shape, rel=1e-9, abs=1e-9)
    assert b.tangent == pytest.approx(a.tangent, rel=1e-8)
    assert b.eigenvalue == pytest.approx(a.eigenvalue, rel=1e-6)
    assert b.unstable == a.unstable


# machine 5 does not bear its weight in its posture
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6])
def test_a_random_tree_is_where_its_energy_is_least(seed):
    chain, values = random_machine(seed)
    chain = replace(chain, ends={}, postures={"-": np.zeros(0)}, held={"-": values})
    force = np.random.default_rng(seed).normal(size=3) * 2.0
    load = Load((*force, 0.0, 0.0, 0.0))
    case = LoadCase("-", 1.0, axis="load", free=COMPONENTS, loads=(load,), gravity=GRAVITY, steps=2)
    last = engine_by_name("vjm-paper").trace(chain, case).points[-1]
    own = Statics(chain, values, gravity=GRAVITY, loads=(load,)).solve()
    moved = own.displacements[""][:3]
    # the bound that equilibria of random machines keep to
    assert np.abs(last.displacement[:3] - moved).max() < 1e-7 * max(1.0, np.abs(moved).max())
    assert last.unstable == 0


@pytest.mark.parametrize("seed", [1, 4, 8])
def test_the_stiffness_of_a_held_tree_is_that_of_its_energy(seed):
    chain, values = random_machine(seed)
    chain = replace(chain, ends={}, postures={"-": np.zeros(0)}, held={"-": values})
    case = LoadCase("-", 1.0, axis="x", free=("y", "z", "rx", "ry", "rz"), gravity=GRAVITY, steps=1)
    path = engine_by_name("vjm-paper").trace(chain, case)
    last = path.points[-1]
    own = Statics(chain, values, gravity=GRAVITY, wrenches={"": (*last.wrench[:3], 0.0, 0.0, 0.0)}).solve()
    assert own.displacements[""][:3] == pytest.approx(last.displacement[:3], abs=1e-7)
    # all but x is free: the reciprocal of the compliance
    assert last.tangent == pytest.approx(1.0 / own.compliance[""][0, 0], rel=1e-7)


def strutted(stiffness=3.0, height=400.0, reach=250.0, length=1000.0):
    """A rigid column on a hinge, held upright by a strut that is free of stress."""
    points = np.array([[0.0, reach, 0.0], [height, 0.0, 0.0]])
    strut = PointSpring("strut", ("", "column"), points, stiffness, reach)
    points = points.copy()
    points[0, 0] = height
    strut = replace(strut, points=points)
    parts = (Joint("hinge", AXES["z"], passive=True), RigidOffset("column", translation([length, 0.0, 0.0])))
    return Machine("strutted", parts, postures={"-": np.zeros(1)}, point_springs=(strut,))


def test_a_column_on_a_strut_buckles_at_its_closed_form():
    case = LoadCase("-", 600.0, axis="load", free=COMPONENTS, loads=(Load(DOWN),))
    path = engine_by_name("vjm-paper").trace(strutted(), case)
    assert path.events[0].kind is EventKind.BIFURCATION
    # ½ k (a θ)² against P L θ²/2: P = k a² / L
    assert path.events[0].force == pytest.approx(3.0 * 400.0**2 / 1000.0, rel=1e-9)


def test_branches_that_hang_on_a_column_lower_its_critical_load_by_their_weight():
    # a sprung hinge k with a branch of weight W at the height a: P L + W a = k
    stiffness, length, height, mass = 5e5, 1000.0, 300.0, 20.0
    parts = (
        Joint("hinge", AXES["z"], passive=True, compliance=1.0 / stiffness),
        RigidOffset("lower", translation([height, 0.0, 0.0])),
        RigidOffset("upper", translation([length - height, 0.0, 0.0])),
        RigidOffset("weight", np.eye(4), mass=mass),
        Joint("tip", AXES["z"], compliance=1e-9),
        RigidOffset("end", translation([0.0, 0.0, 0.0])),
    )
    chain = Machine("laden", parts, postures={"-": np.zeros(0)}, held={"-": {"hinge": 0.0, "tip": 0.0}},
                  after={"weight": "lower", "tip": "upper"})  # fmt: skip
    case = LoadCase("-", 600.0, axis="load", free=COMPONENTS, loads=(Load(DOWN),), gravity=(-9.81, 0.0, 0.0))
    path = engine_by_name("vjm-paper").trace(chain, case)
    assert path.events[0].kind is EventKind.BIFURCATION
    assert path.events[0].force == pytest.approx((stiffness - mass * 9.81 * height) / length, rel=1e-9)


def test_a_branch_that_nothing_holds_is_refused():
    chain = strutted()
    parts = (*chain.parts[:1], Joint("loose", AXES["z"], passive=True), *chain.parts[1:])
    loose = replace(chain, parts=parts, after={"column": "hinge"}, postures={"-": np.zeros(2)})
    with pytest.raises(ValueError, match="is singular: some of its passive joints move without moving the tool"):
        engine_by_name("vjm-paper").trace(loose, LoadCase("-", 1.0, axis="y"))


def test_a_coupling_as_bent_reaches_over_a_beam():
    # the second joint turns back by what the first bends: the far link keeps its direction but for the beam's
    section = Section(EA=2e8, GJ=1e9, EIy=2e10, EIz=1e9)
    parts = (
        Joint("first", AXES["z"], compliance=1e-6),
        Beam("between", 400.0, section=section),
        Joint("second", AXES["z"], coupling=JointCoupling((("first", -1.0),))),
        RigidOffset("far", translation([300.0, 0.0, 0.0])),
    )
    chain = Machine("parallel", parts, postures={"-": np.zeros(0)}, held={"-": {"first": 0.0}})
    load, length, arm = 1.0, 400.0, 300.0
    case = LoadCase("-", load, axis="load", free=COMPONENTS, loads=(Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0)),), steps=1)
    last = engine_by_name("vjm-4").trace(chain, case).points[-1]
    # the joint's torque is the force times the way of the tool by its turn, the beam's length
    turn = 1e-6 * load * length
    bend = load * (length**2 / 2.0 + arm * length) / 1e9
    sag = load * (length**3 / 3.0 + arm * length**2 + arm**2 * length) / 1e9
    # linear theory: the angles' squares, 3e-7, are left out
    assert last.displacement[5] == pytest.approx(bend, rel=1e-6)
    assert last.displacement[1] == pytest.approx(sag + turn * length, rel=1e-6)


# Machines with closed loops: postures by pose and by drives, compensation, and paths of a free end under load.


CLOSED = 1e-9
"""mm and rad: loops and poses are closed to 1e-11 of some hundred mm."""


@pytest.fixture(scope="module")
def palletiser() -> Mechanism:
    return VjmEngine(1).model(vjm.load("palletiser"))


def gaps(model: Mechanism, q: np.ndarray) -> np.ndarray:
    return RigidMechanism(model.chain).linearised(q[None])[0]


def test_a_tool_position_is_reached_with_the_loop_closed(palletiser):
    place = unloaded_frames(palletiser, palletiser.posture("home"))[1][0, 0] + [12.0, -7.0, 20.0]
    (q,) = postures_of(palletiser, place)
    assert unloaded_frames(palletiser, q)[1][0, 0] == pytest.approx(place, abs=CLOSED)
    assert np.abs(gaps(palletiser, q)).max() < CLOSED


def test_drives_take_the_passive_joints_along(palletiser):
    closed = ClosedPostures(palletiser, palletiser.posture("home"))
    q = closed.driven({"shoulder": -1.2, "lever-drive": 0.3})
    assert q[palletiser.joints.index("shoulder")] == -1.2
    # the rod stays parallel to the upper arm, and the forearm to the lever
    assert q[palletiser.joints.index("elbow")] == pytest.approx(1.5, abs=1e-8)
    assert np.abs(gaps(palletiser, q)).max() < CLOSED
    with pytest.raises(ReachError, match="lever-drive = 5 exceeds its limit"):
        closed.driven({"lever-drive": 5.0})


def test_a_pose_of_fewer_freedoms_lets_the_end_turn():
    machine, label = in_posture(vjm.load("palletiser"), (5.0, 3.0, -4.0))
    model = Mechanism(machine)
    moved, home = (unloaded_frames(model, model.posture(each))[1][0, 0] for each in (label, "home"))
    assert moved - home == pytest.approx([5.0, 3.0, -4.0], abs=CLOSED)


def test_drives_put_the_loaded_end_of_a_closed_machine_right(palletiser):
    home = unloaded_frames(palletiser, palletiser.posture("home"))[1][0, 0]
    places = home + np.array([[0.0, 0.0, 0.0], [10.0, 5.0, 0.0]])
    found = compensated_arm(palletiser, places, None, np.zeros((2, 6)), gravity=(0.0, 0.0, -9.81))
    assert np.linalg.norm(found.rigid[:, :3], axis=1).min() > 0.1
    assert np.abs(found.loaded[:, :3]).max() < 1e-7
    for q in found.q_loaded:
        assert np.abs(gaps(palletiser, q)).max() < CLOSED
    at = equilibria(palletiser, found.q_loaded, gravity=(0.0, 0.0, -9.81))
    assert at.position[:, 0] == pytest.approx(places, abs=1e-7)


@pytest.mark.parametrize("name", ["four_bar", "two_legs", "coupled"])
def test_a_path_of_a_free_end_moves_it_as_virtual_work_does(name: str):
    chain = MACHINES[name]()
    push = np.array([3.0, -5.0, 4.0, 0.0, 0.0, 0.0])
    case = LoadCase("p", 1.0, "load", loads=(Load(tuple(push)),), free=COMPONENTS, steps=2)
    point = vjm.trace(chain, case, "vjm-paper").points[-1]
    own = Statics(chain, posture_values(chain, "p"), wrenches={"": push}).solve()
    size = np.repeat(np.abs(own.displacements[""].reshape(2, 3)).max(axis=1), 3)
    # residuals of 1e-11, times a condition of 1e5
    assert np.abs((point.displacement - own.displacements[""]) / size).max() < 1e-6
    assert point.stiffness == pytest.approx(own.stiffness[""], rel=1e-5, abs=1e-6 * np.abs(own.stiffness[""]).max())
