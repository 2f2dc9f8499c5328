"""Derivatives of end frames against differences of equilibria, and against a closed form."""

import numpy as np
import pytest

from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.kernels.derivatives import frame_derivatives
from vjm.machine.equilibria import equilibria, free_equilibria
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, RigidOffset
from vjm.rotations import AXES, frame

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
