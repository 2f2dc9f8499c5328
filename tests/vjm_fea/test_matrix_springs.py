"""Joints with a whole 6×6 compliance in Exudyn: against the lumped model of the same law, and differences."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.engines import engine_by_name
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, JointCoupling, RigidOffset, Section
from vjm.rotations import AXES, frame, rotation_from_vector
from vjm_fea.common.states import quaternion
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.exudyn.joints import MatrixSpring


def compliance(seed):
    """Positive definite, every direction coupled with every other."""
    rng = np.random.default_rng(seed)
    A = 0.4 * rng.normal(size=(6, 6)) + np.eye(6)
    unit = np.repeat([200.0, 1.0], 3) * 1e-4
    return A @ A.T * unit[:, None] * unit


def arm(*, beam, rigid=()):
    bend = frame(rotation_from_vector(np.array([0.3, -0.2, 0.5])), [250.0, 40.0, -30.0])
    section = Section(EA=2e9, GJ=1e11, EIy=2e11, EIz=1e11)
    last = Beam("last", 300.0, section=section) if beam else RigidOffset("last", bend)
    wrist = compliance(2)
    wrist[list(rigid)] = wrist[:, list(rigid)] = 0.0
    parts = (
        Joint("base", AXES["z"], matrix=compliance(1)),
        RigidOffset("link", bend, mass=3.0),
        Joint("wrist", AXES["y"], matrix=wrist),
        last,
    )
    return Machine("arm", parts, postures={"-": np.zeros(0)}, held={"-": {"base": 0.4, "wrist": -0.7}})


def case(factor):
    load = Load((30.0, -200.0, 120.0, 0.0, 0.0, 0.0))
    return LoadCase("-", factor, axis="load", free=COMPONENTS, loads=(load,), gravity=(0.0, 0.0, -9.81), steps=4)


@pytest.mark.parametrize("rigid", [(), (0, 4), (0, 1, 2)])
def test_a_rigid_arm_on_such_joints_is_the_lumped_one(rigid):
    chain = arm(beam=False, rigid=rigid)
    one = engine_by_name("vjm-paper").trace(chain, case(20.0)).points[-1]
    other = ExudynEngine().trace(chain, case(20.0)).points[-1]
    # the same equations in other coordinates
    assert np.abs(one.displacement[3:]).max() > 0.01
    assert other.displacement == pytest.approx(one.displacement, rel=1e-8, abs=1e-9)
    assert other.tangent == pytest.approx(one.tangent, rel=1e-6)
    assert other.unstable == one.unstable == 0


def test_an_arm_with_a_beam_behind_such_joints_is_the_lumped_one():
    chain = arm(beam=True)
    one = engine_by_name("vjm-16").trace(chain, case(20.0)).points[-1]
    other = ExudynEngine(elements=16).trace(chain, case(20.0)).points[-1]
    # what remains is the beam's share, a thousandth of the deflection, by the square of the element
    assert other.displacement == pytest.approx(one.displacement, rel=1e-6, abs=1e-8)


def test_forces_are_differences_of_the_energy_and_the_tangent_of_the_forces():
    rng = np.random.default_rng(4)
    frames = np.array([frame(rotation_from_vector(rng.normal(size=3)), 50.0 * rng.normal(size=3)) for _ in (0, 1)])
    spring = MatrixSpring((0, 1), frames, np.linalg.inv(compliance(3)))
    T = frame(rotation_from_vector(np.array([0.2, 0.1, -0.3])), [5.0, 3.0, -2.0])
    # the second node where the spring is shifted and turned by T
    first = frame(rotation_from_vector(rng.normal(size=3)), [100.0, 20.0, 30.0])
    second = first @ frames[0] @ T @ np.linalg.inv(frames[1])

    def at(motion):
        moved = []
        for k, node in enumerate((first, second)):
            shift, turn = motion[6 * k : 6 * k + 3], motion[6 * k + 3 : 6 * k + 6]
            moved.append(frame(rotation_from_vector(turn) @ node[:3, :3], node[:3, 3] + shift))
        return moved

    def energy(motion):
        a, b = at(motion)
        R = np.linalg.inv(a @ frames[0]) @ b @ frames[1]
        y = np.arcsin(R[0, 2])
        theta = np.array([*R[:3, 3], np.arctan2(-R[1, 2], R[2, 2]), y, np.arctan2(-R[0, 1], R[0, 0])])
        return 0.5 * theta @ spring.stiffness @ theta

    def places(motion):
        rows = [[*node[:3, 3], *quaternion(node[:3, :3])] for node in at(motion)]
        return np.array([*rows, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])

    unit = np.tile(np.repeat([1e-3, 1e-5], 3), 2)
    steps = np.diag(unit)
    slopes = np.array([(energy(s) - energy(-s)) / 2.0 for s in steps]) / unit
    forces = spring.gradient(places(np.zeros(12))).ravel()
    # differences of the energy: rounding 1e-16 over a relative change of 1e-5
    assert forces == pytest.approx(slopes, rel=1e-6, abs=1e-6 * np.abs(forces).max())
    K = np.array([(spring.gradient(places(s)) - spring.gradient(places(-s))).ravel() / 2.0 for s in steps]).T / unit
    found = spring.second(places(np.zeros(12)))
    assert found == pytest.approx(K, rel=1e-6, abs=1e-7 * np.abs(K).max())


@pytest.mark.parametrize("slides", [False, True])
def test_couplings_as_bent_pass_on_what_bends(slides):
    size = 2e-4 if slides else 5e-8
    parts = (
        Joint("first", AXES["z"], compliance=4e-8, lateral=(1e-8, 2e-8)),
        RigidOffset("upper", frame(rotation_from_vector(np.array([0.1, 0.4, 0.0])), [300.0, 20.0, 50.0]), mass=2.0),
        Joint("second", AXES["y"], slides, compliance=size),
        RigidOffset("middle", frame(p=[200.0, 0.0, 10.0]), mass=1.0),
        Joint(
            "third", AXES["x"], slides, compliance=size, lateral=(3e-8, 0.0),
            coupling=JointCoupling((("first", 100.0 if slides else -0.7), ("second", 0.4))),
        ),
        RigidOffset("lower", frame(p=[250.0, 30.0, 0.0]), mass=1.5),
        Joint("fourth", AXES["y"], coupling=JointCoupling((("first", -1.0),))),
        Beam("last", 200.0, section=Section(EA=2e9, GJ=1e10, EIy=2e10, EIz=1e10)),
    )  # fmt: skip
    values = {"first": 0.3, "second": 0.2}
    chain = Machine("coupled", parts, postures={"-": np.zeros(0)}, held={"-": values})
    one = engine_by_name("vjm-8").trace(chain, case(4.0)).points[-1]
    other = ExudynEngine(elements=16).trace(chain, case(4.0)).points[-1]
    # what remains is the beam's share by the square of the element
    assert other.displacement == pytest.approx(one.displacement, rel=1e-5, abs=1e-7)
    assert other.tangent == pytest.approx(one.tangent, rel=1e-5)
    assert other.unstable == one.unstable == 0
    without = replace(parts[4], coupling=replace(parts[4].coupling, as_deflected=False))
    chain = replace(chain, parts=(*parts[:4], without, *parts[5:]))
    commanded = engine_by_name("vjm-8").trace(chain, case(4.0)).points[-1]
    assert np.abs(commanded.displacement - one.displacement).max() > 1e-3
