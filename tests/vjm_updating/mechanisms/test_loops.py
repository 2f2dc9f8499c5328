"""Machines with closed loops: what drives, links, lengths and the frame below do to the platform."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model, machine_document
from vjm.io.model_file import build_chain
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam
from vjm.rotations import Array, displacement_between
from vjm_updating.mechanisms.drives import ActuatorCompliance, DriveSite
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, tabulate
from vjm_updating.mechanisms.joint_motions import braced, joint_motions
from vjm_updating.mechanisms.modified_chain import ModifiedMachine
from vjm_updating.mechanisms.series_elements import History, balance
from vjm_updating.mechanisms.structure import BaseCompliance

ENGINE = VjmEngine(2)
STEP = 1e-3
"""mm or rad by which rigid machines are moved: errors of its square, 1e-6."""
ALONG_X = np.eye(6)[0]


def rigid(chain: Machine, posture: str, end_at: dict[str, float] | None = None) -> Array:
    """Frame ``(4, 4)`` of the end-effector of the rigid machine, its drives moved, its loops closed."""
    closing = LoopClosure(replace(chain, poses={}), posture)
    held = closing.posture(closing.home)[1]
    moved = {name: value + (end_at or {}).get(name, 0.0) for name, value in held.items()}
    return closing.tree.end_frames(closing.held(moved)[None])[0]


@pytest.mark.parametrize("name", ["orthoglide", "delta", "palletiser"])
def test_a_drive_moves_the_platform_as_the_rigid_machine_does(name: str):
    chain = load_model(name)
    posture = list(chain.postures)[-1]
    found = joint_motions(ModifiedMachine(chain, ENGINE), posture)
    for joint in chain.held_joints:
        there, back = (rigid(chain, posture, {joint.name: sign * STEP}) for sign in (1.0, -1.0))
        expected = displacement_between(back, there) / (2.0 * STEP)
        np.testing.assert_allclose(
            found[joint.name], expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max(), err_msg=joint.name
        )


@pytest.mark.parametrize(("name", "part"), [("orthoglide", "y/link"), ("delta", "rod-b1/rod")])
def test_a_longer_link_moves_the_platform_as_the_rigid_machine_does(name: str, part: str):
    chain = load_model(name)
    posture = list(chain.postures)[-1]
    ends = []
    for by in (STEP, -STEP):
        parts = tuple(
            replace(p, length=p.length + by) if isinstance(p, Beam) and p.name == part else p for p in chain.parts
        )
        ends.append(rigid(replace(chain, parts=parts), posture))
    expected = displacement_between(ends[1], ends[0]) / (2.0 * STEP)
    found = joint_motions(ModifiedMachine(chain, ENGINE), posture)[part]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())


def test_one_of_two_parallel_bars_is_braced_by_the_other():
    machine = ModifiedMachine(load_model("orthoglide-parallelograms"), ENGINE)
    assert braced(machine, ["Q2"]) == {f"bar-{axis}{k}/bar" for axis in "xyz" for k in (1, 2)}


def test_a_drive_in_series_is_the_drive_in_the_machine():
    """A law in series with the platform and a spring in the leg are two models of one soft drive."""
    chain = load_model("orthoglide")
    machine, compliance = ModifiedMachine(chain, ENGINE), 1e-4
    drive = DriveSite("y", "y")
    effect = ActuatorCompliance("y", drive)
    built = effect.built(chain, [compliance])
    assert next(j.compliance for j in built.held_joints if j.name == "y") == compliance
    # both are linear to the first order in the displacement over the length, 2e-5
    at = np.array([0.002, 0.005, -0.003, 0.0, 0.0, 0.0])
    states = {}
    for label, one in (("series", machine), ("built", ModifiedMachine(built, ENGINE))):
        states[label] = tabulate(one, HalfRay.of("Q2", at / np.linalg.norm(at), float(np.linalg.norm(at))), ())
    table, nothing = states["series"], np.zeros((1, 3))
    K = table.stiffness[0]
    motions = {name: one[None] for name, one in joint_motions(machine, "Q2").items()}
    history = History(np.zeros(1), np.ones(1, dtype=bool), nothing, nothing + 1.0, {}, motions)
    found = balance(lambda u: (u @ K, K[None]), at[None], effect.elements(machine, [compliance]), history)
    expected = states["built"].wrench[-1]
    # what is softer by a sixth, and of first order in the displacement
    assert abs(table.wrench[-1][1] / expected[1] - 1.0) > 0.05
    np.testing.assert_allclose(found.wrench[0], expected, atol=2e-4 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("name", "part"),
    [("orthoglide", "x/link"), ("orthoglide", "y/link"), ("orthoglide-parallelograms", "bar-y1/bar")],
)
def test_displacements_count_from_where_the_machine_stands_as_built(name: str, part: str):
    """Whether joints take the length up or the rest is strained, nothing holds the platform before the test."""
    machine = ModifiedMachine(load_model(name), ENGINE).longer(part, 0.2)
    table = tabulate(machine, HalfRay.of("isotropic", ALONG_X, 0.1), ())
    assert np.abs(table.wrench[-1][:3]).max() > 100.0
    assert np.abs(table.wrench[0][:3]).max() < 1e-6
    assert np.abs(table.wrench[0][3:]).max() < 1e-3


def test_the_frame_below_carries_every_leg():
    """In series with the base the compliances of frame and machine add up, as built and as written."""
    chain = load_model("orthoglide")
    effect, c = BaseCompliance(), 1e-4
    values = [c, 2.0, 0.5, 0.0, 1.0, 1.0]
    document = machine_document("orthoglide").content
    effect.write(document, chain, values)
    expected = np.linalg.inv(stiffness(chain))
    expected[:3, :3] += np.diag([c, 2.0 * c, 0.5 * c])
    for one in (effect.built(chain, values), build_chain(document, "written")):
        np.testing.assert_allclose(
            np.linalg.inv(stiffness(one)), expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()
        )


def stiffness(chain: Machine) -> Array:
    path = ENGINE.trace(chain, LoadCase("isotropic", 1e-6, steps=1))
    result = path.points[0].stiffness
    assert result is not None
    return result
