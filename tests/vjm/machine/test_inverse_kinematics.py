"""Postures of a tool pose: all of a planar arm's and a UR10's, and what is out of reach."""

import numpy as np
import pytest

from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.kernels.derivatives import frame_derivatives
from vjm.machine.equilibria import equilibria, free_equilibria, unloaded_frames
from vjm.machine.inverse_kinematics import ReachError, postures_of
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, RigidOffset
from vjm.rotations import AXES, frame, translation


def planar() -> Mechanism:
    parts: list = []
    for name, length in (("shoulder", 500.0), ("elbow", 400.0)):
        parts.append(Joint(name, AXES["z"], compliance=1e-8))
        parts.append(RigidOffset(f"after-{name}", translation([length, 0.0, 0.0])))
    return Mechanism(Machine("planar", tuple(parts)).split())


def test_a_planar_arm_has_two_elbows():
    found = postures_of(planar(), np.array([600.0, 300.0, 0.0]))
    # the law of cosines
    elbow = np.arccos((600.0**2 + 300.0**2 - 500.0**2 - 400.0**2) / (2.0 * 500.0 * 400.0))
    assert sorted(q[1] for q in found) == pytest.approx([-elbow, elbow], abs=1e-8)


def test_out_of_reach_is_said_with_the_distance():
    with pytest.raises(ReachError, match=r"out of reach.* misses it by 100 mm"):
        postures_of(planar(), np.array([0.0, 1000.0, 0.0]))


def test_ur10_takes_a_pose_in_eight_ways():
    chain = load_chain("ur10")
    model = Mechanism(chain.split())
    R, p = unloaded_frames(model, model.posture("work"))
    found = postures_of(model, p[0, 0], R[0, 0])
    # limits of a whole turn either way: what differs by one is one
    assert len(found) == 8
    for q in found:
        R1, p1 = unloaded_frames(model, q)
        assert p1 == pytest.approx(p, abs=1e-5)
        assert R1 == pytest.approx(R, abs=1e-8)
    assert min(np.abs(q - model.posture("work")).max() for q in found) < 1e-6


def test_an_unknown_end_frame_is_said():
    with pytest.raises(ValueError, match="no end frame 'hand'"):
        postures_of(planar(), np.zeros(3), end="hand")


# rad: at a double root a residual of rounding, 1e-16, is a way of 1e-8 from it
DOUBLE_ROOT = 1e-6


@pytest.mark.parametrize("q", [
    pytest.param((1.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0), id="upright"),
    pytest.param((-0.4, -0.8, 0.0, -np.pi / 2, 1.0, 0.3), id="stretched-out"),
    pytest.param((2.0, -1.2, 0.0, 0.6, -0.9, -0.5), id="stretched-elbow"),
])  # fmt: skip
def test_a_stretched_ur10_is_found_once(q):
    """Both elbows are one there, and the way to it is a double root."""
    model = Mechanism(load_chain("ur10").split())
    R, p = unloaded_frames(model, np.array([q]))
    found = [row for row in postures_of(model, p[0, 0], R[0, 0]) if np.abs(row - q).max() < 0.5]
    assert len(found) == 1
    assert found[0] == pytest.approx(np.array(q), abs=DOUBLE_ROOT)


@pytest.mark.parametrize("elbow", [0.0, np.pi], ids=["stretched", "folded"])
def test_a_planar_arm_at_the_edge_of_its_reach(elbow):
    model = planar()
    _, p = unloaded_frames(model, np.array([[0.3, elbow]]))
    found = postures_of(model, p[0, 0])
    # folded, the elbow is at half a turn either way
    assert {round(abs(float(row[1])), 5) for row in found} == {round(elbow, 5)}
    assert len({tuple(np.round(np.cos(row), 5)) for row in found}) == 1
    assert np.cos([row[0] - 0.3 for row in found]) == pytest.approx(np.ones(len(found)), abs=1e-9)


def test_a_wrist_with_parallel_axes_is_solved():
    """Axes 4 and 6 of a UR10 are parallel where axis 5 is at zero: postures are endless, all listed are right."""
    model = Mechanism(load_chain("ur10").split())
    R, p = unloaded_frames(model, np.array([[0.3, -1.0, 0.8, -0.5, 0.0, 0.2]]))
    found = postures_of(model, p[0, 0], R[0, 0])
    assert found
    for row in found:
        R1, p1 = unloaded_frames(model, row)
        # mm: 1e-9 of a reach of 1.3 m
        assert p1 == pytest.approx(p, abs=2e-6)
        assert R1 == pytest.approx(R, abs=2e-9)


# Derivatives of end frames against differences of equilibria, and against a closed form.


GRAVITY = (0.0, 0.0, -9.81)
STEP = 1e-4


def test_by_values_are_the_differences_of_equilibria():
    model = Mechanism(load_chain("ur10").split())
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (20, 6))
    wrench = np.array([[[20.0, -30.0, 10.0, 5e3, 2e3, -4e3]]])
    found = equilibria(model, q, gravity=GRAVITY, wrench=wrench[0], compliance=False)
    arrays, commands, naturals = model.arrays(GRAVITY, moments=True), model.values(q), model.naturals(q)
    exact = frame_derivatives(arrays, commands, naturals, wrench, found.x)

    def position(values):
        x, closures = found.x.copy(), found.closures.copy()
        verdict, R, p = np.zeros(20, np.int64), np.zeros((20, 1, 3, 3)), np.zeros((20, 1, 3))
        free_equilibria(arrays, values, naturals, wrench, x, closures, verdict, np.zeros_like(values), R, p)
        return p

    for j in range(commands.shape[1]):
        step = np.eye(commands.shape[1])[j] * STEP
        differences = (position(commands + step) - position(commands - step)) / (2.0 * STEP)
        # central differences err by a sixth of the squared step times 1,300 mm: 2e-6 mm/rad
        assert np.abs(differences - exact.value[:, :, :3, j]).max() < 1e-5


def test_of_one_hinge_in_closed_form():
    # a hinge of compliance c bears the moment m g L cos(angle), whose derivative by the angle is -m g L sin(angle)
    c, mass, length = 1e-8, 10.0, 500.0
    tip = np.array([length, 0.0, 0.0])
    link = RigidOffset("link", frame(p=tip), mass, tip)
    chain = Machine("hinge", (Joint("q", AXES["y"], compliance=c), link))
    model = Mechanism(chain.split())
    q = np.array([[0.3]])
    found = equilibria(model, q, gravity=GRAVITY, compliance=False)
    exact = frame_derivatives(
        model.arrays(GRAVITY, moments=True), model.values(q), model.naturals(q), np.zeros((1, 1, 6)), found.x
    )
    angle, weight = 0.3 + found.x[0, 0], mass * 9.81
    moment = weight * length * np.cos(angle)
    tangent = 1.0 / c + weight * length * np.sin(angle)
    speed = -length * np.cos(angle)  # of z by the angle about y
    assert exact.force[0, 0, 2, 0] == pytest.approx(speed / tangent, rel=1e-10)
    assert exact.load[0, 0, 2, 0] == pytest.approx(speed * moment / tangent, rel=1e-10)
    assert exact.value[0, 0, 2, 0] == pytest.approx(
        speed * (1.0 - weight * length * np.sin(angle) / tangent), rel=1e-10
    )


def test_closed_loops_and_springs_between_points_have_exact_derivatives():
    model = Mechanism(load_model("palletiser").split())
    assert model.chain.closures
    assert model.chain.point_springs
    q = model.posture("home")[None]
    wrench = np.array([[[20.0, -30.0, 10.0, 5e3, 2e3, -4e3]]])
    found = equilibria(model, q, gravity=GRAVITY, wrench=wrench[0], compliance=False)
    arrays, commands, naturals = model.arrays(GRAVITY, moments=True), model.values(q), model.naturals(q)
    exact = frame_derivatives(arrays, commands, naturals, wrench, found.x, found.closures)

    def position(values):
        x, closures = found.x.copy(), found.closures.copy()
        verdict, R, p = np.zeros(1, np.int64), np.zeros((1, 1, 3, 3)), np.zeros((1, 1, 3))
        free_equilibria(arrays, values, naturals, wrench, x, closures, verdict, np.zeros_like(values), R, p)
        return p

    for name in ("waist", "shoulder", "lever-drive"):
        joint = model.driven_by(name)
        step = np.eye(commands.shape[1])[joint] * STEP
        differences = (position(commands + step) - position(commands - step)) / (2.0 * STEP)
        assert np.abs(exact.value[:, :, :3, joint]).max() > 100.0
        # central differences err by a sixth of the squared step times 1,000 mm: 2e-6 mm/rad
        assert np.abs(differences - exact.value[:, :, :3, joint]).max() < 1e-5
