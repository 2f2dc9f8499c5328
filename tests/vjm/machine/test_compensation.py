"""Compensation of arms: what each model leaves, by orders of the load and by finite elements."""

import numpy as np
import pytest
from helpers.riding import EI, LENGTH, cantilever, on_rails

import vjm
from vjm.compensation import compensated_arm, difference
from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.machine.inverse_kinematics import ReachError, postures_of
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, PointSpring, RigidOffset
from vjm.rotations import AXES, translation

WEIGHT = (0.0, 0.0, -9.81)


def lever() -> Machine:
    """One elastic hinge about z and a bar of 500 mm."""
    parts = (Joint("hinge", AXES["z"], compliance=1e-7), RigidOffset("bar", translation([500.0, 0.0, 0.0])))
    return Machine("lever", parts, postures={"-": np.zeros(0)}, held={"-": {"hinge": 0.0}})


def test_a_lever_is_turned_back_by_what_its_hinge_gives():
    """Under a force F across the bar at the angle wanted the hinge turns by c F L cos q, wherever it is sent."""
    model, q, F, c = Mechanism(lever().split()), 0.3, 200.0, 1e-7
    wanted = 500.0 * np.array([[np.cos(q), np.sin(q), 0.0]])
    wrench = np.array([[0.0, F, 0.0, 0.0, 0.0, 0.0]])
    found = compensated_arm(model, wanted, None, wrench, start=np.array([0.2]))
    turn = c * F * 500.0 * np.cos(q)
    assert found.q[0, 0] == pytest.approx(q, abs=1e-12)
    assert found.q_loaded[0, 0] == pytest.approx(q - turn, abs=1e-12)
    # the linear model knows the same turn here, but lays it out as a straight shift, 1 - cos of it short
    assert found.q_linear[0, 0] == pytest.approx(q - turn, abs=turn**2)
    assert np.abs(found.loaded[0, :3]).max() < 1e-9
    assert 1e-5 < np.abs(found.linear[0, :3]).max() < 500.0 * turn**2
    # not compensated, it turns on: the lever shortens as it turns
    assert found.rigid[0, 1] == pytest.approx(500.0 * turn * np.cos(q), rel=2e-2)


@pytest.fixture(scope="module")
def path():
    """Five poses of the UR10, and those found for one and for half of the loads."""
    model = Mechanism(load_chain("ur10").split())
    q = model.posture("work") + np.linspace(0.0, 0.2, 5)[:, None] * np.array([1.0, -0.5, 1.0, 0.3, 0.5, 1.0])
    R, p = unloaded_frames(model, q)
    wrench = np.tile([80.0, -40.0, -300.0, 4e3, 0.0, 2e3], (5, 1))
    both = [
        compensated_arm(
            model, p[:, 0], R[:, 0], share * wrench, gravity=(0.0, 0.0, -9.81 * share), start=model.posture("work")
        )
        for share in (1.0, 0.5)
    ]  # fmt: skip
    return model, q, R[:, 0], p[:, 0], wrench, both


def test_the_loaded_model_leaves_nothing(path):
    model, q, R, p, wrench, (found, _) = path
    assert found.q == pytest.approx(q, abs=1e-9)
    at = equilibria(model, found.q_loaded, gravity=WEIGHT, wrench=wrench[:, None])
    assert np.abs(difference(at.position[:, 0], at.rotation[:, 0], p, R)).max() < 1e-9
    assert np.abs(found.loaded).max() < 1e-9


def test_the_linear_model_leaves_what_is_of_second_order(path):
    rigid, linear = ([np.abs(each[:, :3]).max() for each in pair] for pair in (
        [f.rigid for f in path[-1]], [f.linear for f in path[-1]]
    ))  # fmt: skip
    # half of the loads: half of the deflection, and a quarter of its change by the loads
    assert rigid[0] / rigid[1] == pytest.approx(2.0, rel=2e-2)
    assert linear[0] / linear[1] == pytest.approx(4.0, rel=5e-2)
    assert linear[0] < 0.01 * rigid[0]


def test_a_planar_arm_is_put_right_in_its_plane_only():
    chain = load_chain("planar-2r").refined(4)
    model = Mechanism(chain.split())
    q = model.posture("bent")
    _, p = unloaded_frames(model, q)
    wrench = np.array([[50.0, -30.0, -20.0, 0.0, 0.0, 0.0]])
    found = compensated_arm(model, p[:, 0], None, wrench, gravity=WEIGHT, start=q)
    assert np.abs(found.loaded[0, :2]).max() < 1e-7
    # no joint lifts it
    assert found.loaded[0, 2] == pytest.approx(found.rigid[0, 2], rel=1e-2)
    assert abs(found.loaded[0, 2]) > 0.1


def two_links(compliance: float = 1e-6, limit: float = 3.0) -> Mechanism:
    """Rigid links of 500 and 400 mm in a plane, on elastic gears."""
    parts: list = []
    for name, length in (("shoulder", 500.0), ("elbow", 400.0)):
        parts.append(Joint(name, AXES["z"], compliance=compliance, limits=(-limit, limit)))
        parts.append(RigidOffset(f"after-{name}", translation([length, 0.0, 0.0])))
    return Mechanism(Machine("two", tuple(parts)).split())


def exact(at: tuple[float, float], force: tuple[float, float], compliance: float, sign: float) -> np.ndarray:
    """Commands of `two_links` that put its loaded end at a point: statics there is known, as the point is."""
    x, y = at
    turned = sign * np.arccos((x * x + y * y - 500.0**2 - 400.0**2) / (2.0 * 500.0 * 400.0))
    first = np.arctan2(y, x) - np.arctan2(400.0 * np.sin(turned), 500.0 + 400.0 * np.cos(turned))
    knee = 500.0 * np.array([np.cos(first), np.sin(first)])
    moments = [x * force[1] - y * force[0], (x - knee[0]) * force[1] - (y - knee[1]) * force[0]]
    return np.array([first, turned]) - compliance * np.array(moments)


@pytest.mark.parametrize("x", [895.0, 899.99, 900.0 - 1e-5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_near_the_stretched_arm_one_of_the_two_solutions_is_found(x, sign):
    """Where the end stands is known, so are the gears' moments, and the commands in closed form, two for a point.

    The tolerance is what rounding of the end's place, 1e-12 mm, makes of the elbow near its stretched posture.
    """
    model, force = two_links(), (50.0, -100.0)
    wanted, wrench = np.array([[x, 0.0, 0.0]]), np.array([[*force, 0.0, 0.0, 0.0, 0.0]])
    found = compensated_arm(model, wanted, None, wrench, start=np.array([-0.2 * sign, 0.5 * sign]))
    both = [exact((x, 0.0), force, 1e-6, s) for s in (1.0, -1.0)]
    assert min(np.abs(found.q_loaded[0] - q).max() for q in both) < 1e-8
    assert np.abs(found.loaded[0, :2]).max() < 1e-7


def test_a_stretched_arm_that_only_its_load_lengthens_is_put_right():
    """The rigid arm cannot go outwards from there, the loaded one may have to come back."""
    model = Mechanism(load_chain("planar-2r").refined(8).split())
    wrench = np.array([[5000.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    found = compensated_arm(model, np.array([[900.0, 0.0, 0.0]]), None, wrench, start=np.zeros(2))
    assert found.q[0] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert found.rigid[0, 0] > 1e-2
    assert np.abs(found.loaded[0, :2]).max() < 1e-7


def test_what_the_loaded_arm_does_not_reach_is_said_with_the_distance():
    """Pressed together along itself by 500 N the arm's tubes are shorter by F L/EA: it comes no further."""
    areas = [60.0**2 - 54.0**2, 40.0**2 - 34.0**2]
    shorter = 500.0 * sum(length / (70000.0 * area) for length, area in zip((500.0, 400.0), areas, strict=True))
    wanted = np.array([[900.0 - 0.5 * shorter, 0.0, 0.0]])
    model = Mechanism(load_chain("planar-2r").refined(4).split())
    with pytest.raises(ReachError, match=r"row 1 of the path: .*out of reach of the loaded arm: ") as refused:
        compensated_arm(model, wanted, None, np.array([[-500.0, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    missed = float(str(refused.value).rsplit("by ", 1)[1].removesuffix(" mm"))
    # what is printed has four digits
    assert missed == pytest.approx(0.5 * shorter, rel=2e-3)


def test_no_command_goes_beyond_a_joints_limits():
    """The loaded elbow would have to be commanded beyond its limit, though the rigid one stands within."""
    force = (50.0, -100.0)
    wanted, wrench = np.array([[600.0, 300.0, 0.0]]), np.array([[*force, 0.0, 0.0, 0.0, 0.0]])
    q = exact((600.0, 300.0), force, 1e-6, -1.0)
    rigid = exact((600.0, 300.0), (0.0, 0.0), 1e-6, -1.0)
    limit = 0.5 * (abs(q[1]) + abs(rigid[1]))
    assert abs(q[1]) != pytest.approx(abs(rigid[1]), abs=1e-3)
    tight = two_links(limit=limit)
    for start in (rigid, -rigid):
        try:
            found = compensated_arm(tight, wanted, None, wrench, start=start)
        except ReachError as refused:
            assert "elbow" in str(refused)  # noqa: PT017  (either answer is right, and checked)
        else:
            assert np.abs(found.q_loaded[0, 1]) <= limit + 1e-9
            assert np.abs(found.q[0, 1]) <= limit + 1e-9


def test_a_joint_that_would_have_to_go_beyond_its_limit_is_named():
    model = Mechanism(load_chain("planar-2r").split())
    elbow = np.arccos((200.0**2 + 100.0**2 - 500.0**2 - 400.0**2) / (2.0 * 500.0 * 400.0))
    with pytest.raises(
        ReachError, match=rf"row 1 .*elbow = -?{elbow:.6g} .* its limit -?2.6 by {elbow - 2.6:.4g} rad"
    ):
        compensated_arm(model, np.array([[200.0, 100.0, 0.0]]), None, np.zeros((1, 6)), start=model.posture("bent"))


def test_a_pose_out_of_reach_is_named_by_its_row():
    model = Mechanism(lever().split())
    wanted = np.array([[500.0, 0.0, 0.0], [600.0, 0.0, 0.0]])
    with pytest.raises(ReachError, match=r"row 2 of the path: lever: out of reach: .* 100 mm"):
        compensated_arm(model, wanted, None, np.zeros((2, 6)))


def stressed(share: float) -> Machine:
    """An arm whose weights, compensator and preloaded joint have a share of their forces."""
    points = np.array([[-300.0, 0.0, 900.0], [200.0, 0.0, 100.0]])
    spring = PointSpring("compensator", ("", "upper"), points, 100.0 * share, 400.0)
    q = {"q2": -1.0, "q3": 1.2, "s": 0.3, "q5": 0.4}
    parts = (
        RigidOffset("column", translation([350.0, 0.0, 750.0])),
        Joint("q2", AXES["y"], compliance=3e-10),
        RigidOffset("upper", translation([1250.0, 0.0, 0.0]), 200.0 * share, np.array([500.0, 0.0, 0.0])),
        Joint("q3", AXES["y"], compliance=4e-10),
        Joint("s", AXES["z"], passive=True, compliance=5e-10, preload=4e5 * share),
        RigidOffset("fore", translation([1100.0, 0.0, 55.0]), 150.0 * share, np.array([400.0, 0.0, 0.0])),
        Joint("q5", AXES["y"], compliance=2e-9),
        RigidOffset("flange", translation([230.0, 0.0, 0.0]), 100.0 * share),
    )
    return Machine("arm", parts, postures={"-": np.zeros(0)}, held={"-": q}, point_springs=(spring,))


def test_springs_under_stress_are_loads_of_the_linear_model_too():
    """What the linear model leaves falls with the square of all forces, those of springs among them."""
    left = []
    for share in (1.0, 0.5):
        model = Mechanism(stressed(share).split())
        q = model.posture("-")
        _, p = unloaded_frames(model, q)
        wrench = share * np.array([[0.0, 100.0, -1000.0, 0.0, 0.0, 0.0]])
        found = compensated_arm(model, p[:, 0], None, wrench, gravity=WEIGHT, start=q)
        left.append([np.abs(each[:, :3]).max() for each in (found.rigid, found.linear)])
    (rigid, linear), (half_rigid, half_linear) = left
    assert rigid / half_rigid == pytest.approx(2.0, rel=1e-2)
    assert linear / half_linear == pytest.approx(4.0, rel=5e-2)
    assert linear < 2e-3 * rigid


def test_a_sprung_passive_joint_stays_where_the_posture_has_it_and_the_drives_are_solved_for():
    """A shoulder, a passive hinge with a spring and a boom: by the triangle of shoulder, hinge and tool."""
    L, p0, rest, k, turn, stretch = 300.0, 0.2, 0.1, 1e6, 1e-8, 1e-5
    parts = (
        Joint("shoulder", AXES["z"], compliance=turn),
        RigidOffset("arm", translation([L, 0.0, 0.0])),
        Joint("p", AXES["z"], passive=True, compliance=1.0 / k, rest=rest, limits=(-0.3, 0.3)),
        Joint("boom", AXES["x"], slides=True, compliance=stretch, limits=(50.0, 400.0)),
    )
    held = {"-": {"shoulder": 0.1, "p": p0, "boom": 200.0}}
    model = Mechanism(Machine("arm", parts, postures={"-": np.zeros(0)}, held=held).split())
    r, phi, F = 520.0, 0.4, np.array([30.0, -80.0])
    wanted = r * np.array([np.cos(phi), np.sin(phi)])

    def triangle(p):
        boom = np.sqrt(r**2 - (L * np.sin(p)) ** 2) - L * np.cos(p)
        return np.array([phi - np.arctan2(boom * np.sin(p), L + boom * np.cos(p)), p, boom])

    place, wrench = np.array([[*wanted, 0.0]]), np.array([[*F, 0.0, 0.0, 0.0, 0.0]])
    # steps are Newton's at last: 3e-12 mm is left of the pose, and under loads 1e-13 mm
    assert postures_of(model, place[0])[0] == pytest.approx(triangle(p0), abs=1e-10)
    bent = triangle(rest)
    # the hinge's moment changes its angle by some 2e-2 rad, and this the moment by 1e-4 of it
    for _ in range(20):
        hinge = L * np.array([np.cos(bent[0]), np.sin(bent[0])])
        arm = wanted - hinge
        bent = triangle(rest + (arm[0] * F[1] - arm[1] * F[0]) / k)
    along = np.array([np.cos(bent[0] + bent[1]), np.sin(bent[0] + bent[1])])
    moment = wanted[0] * F[1] - wanted[1] * F[0]
    drives = [bent[0] - turn * moment, p0, bent[2] - stretch * along @ F]
    for start in (model.posture("-"), None):
        found = compensated_arm(model, place, None, wrench, start=start)
        assert found.q[0] == pytest.approx(triangle(p0), abs=1e-10)
        assert found.q_loaded[0] == pytest.approx(drives, abs=5e-12)
        assert found.q_linear[0, 1] == p0


# A machine with a carriage in the commands of robots: postures, compensation.


def test_a_carriage_is_put_where_the_loaded_tool_should_be():
    """Along a cantilever under gravity-free load nothing sags along the beam; a soft drive gives c F along it."""
    c, force = 1e-4, 300.0
    machine = cantilever(compliance=c)
    places = [(100.0, 0.0, 0.0), (900.0, 0.0, 0.0)]
    found = vjm.compensate(machine, places, wrenches=[(force, 0.0, 0.0, 0.0, 0.0, 0.0)] * 2)
    assert found.q[:, 0] == pytest.approx([100.0, 900.0], abs=1e-9)
    # the drive deflects by c F, the beam before the carriage stretches by F x/EA = 3e-6 x
    stretched = force / 1e8
    exact = [(x - c * force) / (1.0 + stretched) for x in (100.0, 900.0)]
    assert found.q_loaded[:, 0] == pytest.approx(exact, abs=1e-6)
    assert found.largest_mm["loaded"] < 1e-6


def test_the_sag_of_a_bridge_is_put_right_by_what_moves_across_it():
    """A ram on the carriage takes out F x³/3EI of the cantilever that carries it."""
    force = 50.0
    base = cantilever()
    ram = vjm.Joint("w", vjm.axis("z"), slides=True, limits=(-100.0, 100.0))
    machine = vjm.build("crane", [*base.parts, ram], {"there": {"x": 400.0, "w": 0.0}})
    places = [(x, 0.0, 0.0) for x in (0.0, 250.0, 731.0, LENGTH)]
    found = vjm.compensate(machine, places, wrenches=[(0.0, 0.0, -force, 0.0, 0.0, 0.0)] * 4)
    exact = [force * x**3 / (3.0 * EI) for x, _, _ in places]
    # second order: the slope's square
    assert found.q_loaded[:, found.joints.index("w")] == pytest.approx(exact, rel=1e-4, abs=1e-9)
    assert found.largest_mm["loaded"] < 1e-6


def test_a_gantry_reaches_places_and_says_which_it_does_not():
    """Its ram hangs 300 mm below the bridge, u along the rails and w along the bridge give the place."""
    machine = on_rails()
    places = [(0.0, 0.0, -300.0), (300.0, 400.0, -300.0), (800.0, LENGTH, -300.0)]
    for place in places:
        (found,) = vjm.tool_postures(machine, place)
        assert (found["u"], found["w"]) == pytest.approx(place[:2], abs=1e-9)
    found = vjm.compensate(machine, places[1:2], wrenches=[(60.0, 40.0, -200.0, 0.0, 0.0, 0.0)])
    # only the sag remains, which neither drive moves
    assert np.abs(found.loaded[0, :2]).max() < 1e-6 < -found.loaded[0, 2]
    with pytest.raises(ReachError, match="u = 900 exceeds its limit 800"):
        vjm.compensate(machine, [(900.0, 400.0, -300.0)])
