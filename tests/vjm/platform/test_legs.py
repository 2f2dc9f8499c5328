"""Platforms whose legs slide passively, have no drive, or are rigid against some wrench."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.legs import Leg, joined

import vjm
from vjm.engines import VjmEngine
from vjm.machine.platforms import PlatformBatch
from vjm.machine.rigid_mechanism import PoseError
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.postures import in_posture
from vjm.rotations import AXES, frame, rotation_from_vector, translation
from vjm_updating.maps.evaluate import OK, MapQuantity, MapSetting
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.run import Map, run_map

SECTION = Section(EA=4e7, GJ=3e9, EIy=5e9, EIz=2e9)
DRIVE, BAR = 1e-4, 200.0


def cartesian(*, elastic: bool = True, turned: np.ndarray | None = None) -> Machine:
    """Three drives along x, y and z, each with a bar along it that ends in two passive slides across."""
    legs = []
    for a, b, c in ("xyz", "yzx", "zxy"):
        axes = np.column_stack([AXES[a], AXES[b], AXES[c]])
        bar = Beam("bar", BAR, own_frame=axes, section=SECTION)
        parts = (
            Joint("slide", AXES[a], slides=True, fixed=True, compliance=DRIVE),
            bar if elastic else RigidOffset("bar", translation(bar.tip)),
            Joint("u", AXES[b], slides=True, passive=True),
            Joint("v", AXES[c], slides=True, passive=True),
        )
        chain = Machine("leg", parts, postures={"h": np.zeros(2)})
        R = np.eye(4) if turned is None else turned
        drive = Joint("drive", AXES[a], slides=True)
        legs.append(
            Leg(
                a,
                chain,
                root=R @ translation(-bar.tip),
                attachment=R,
                drive=drive,
                before="slide",
                posture=[0.0, 0.0],
            )
        )
    return joined("cartesian", legs, {"h": np.zeros(6)})


@pytest.mark.parametrize("shift", [(50.0, 60.0, -70.0), (150.0, 0.0, 0.0), (400.0, -900.0, 80.0)])
def test_passive_slides_go_as_far_as_they_are_asked(shift):
    """Drives go along their own axes, slides along the others'; the stiffness is that of a bar and its drive."""
    robot, d = cartesian(), np.concatenate([shift, np.zeros(3)])
    label = ",".join(map(str, shift))
    posed, label = in_posture(robot, label)
    x, y, z = shift
    assert posed.held[label] == pytest.approx({"x": x, "y": y, "z": z}, abs=1e-9)
    assert posed.posture(label) == pytest.approx([y, z, z, x, x, y], abs=1e-9)
    K = vjm.stiffness(robot, ",".join(map(str, shift))).loaded
    assert np.diag(K)[:3] == pytest.approx(1.0 / (DRIVE + BAR / SECTION.EA), rel=1e-9)
    # and the batch's way to the same pose
    found = PlatformBatch(robot, VjmEngine(16)).equilibria(d[None], np.zeros(6))
    assert found.solved.all()
    assert found.stiffness[0] == pytest.approx(K, rel=1e-8, abs=1e-8 * np.abs(K).max())


def strut(i: int) -> tuple[Leg, np.ndarray, np.ndarray]:
    """A hexapod's leg: universal joint, drive held in its middle, strut, spherical joint; its foot and head."""
    low, high = (2 * np.pi * (i // 2) / 3 + s * (2 * (i % 2) - 1) for s in (0.2, 0.85))
    foot = 300.0 * np.array([np.cos(low), np.sin(low), 0.0])
    head = 150.0 * np.array([np.cos(high), np.sin(high), 0.0]) + [0.0, 0.0, 400.0]
    x = (head - foot) / np.linalg.norm(head - foot)
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= np.linalg.norm(y)
    root = frame(np.column_stack([x, y, np.cross(x, y)]), foot)
    length = float(np.linalg.norm(head - foot))
    bar = Beam("strut", length, section=SECTION)
    names = ("u1", "u2", "s1", "s2", "s3")
    joints = [Joint(name, AXES[axis], passive=True) for name, axis in zip(names, "yzxyz", strict=True)]
    parts = (*joints[:2], Joint("slide", AXES["x"], slides=True, fixed=True, compliance=DRIVE), bar, *joints[2:])
    chain = Machine(f"leg{i}", parts, postures={"h": np.zeros(5)})
    attachment = frame(root[:3, :3], head - [0.0, 0.0, 400.0])
    return Leg(f"l{i}", chain, root=root, attachment=attachment, posture=[0.0] * 5), foot, head


def test_legs_without_a_drive_hold_the_platform_at_home():
    """``K = Σ J⁻ᵀ k J⁻¹``: each strut is a spring along its own line."""
    legs, feet, heads = zip(*(strut(i) for i in range(6)), strict=True)
    robot = joined("hexapod", legs, {"home": np.zeros(6)}, translation([0.0, 0.0, 400.0]))
    K = np.zeros((6, 6))
    for foot, head in zip(feet, heads, strict=True):
        length = np.linalg.norm(head - foot)
        line = (head - foot) / length
        screw = np.concatenate([line, np.cross(head - [0.0, 0.0, 400.0], line)])
        K += np.outer(screw, screw) / (DRIVE + length / SECTION.EA)
    for engine, tolerance in (("vjm", 1e-10), ("vjm-paper", 1e-10), ("exudyn", 1e-7)):
        found = vjm.stiffness(robot, "home", engine=engine).loaded
        assert found == pytest.approx(K, rel=tolerance, abs=tolerance * np.abs(K).max()), engine
    with pytest.raises(PoseError, match=r"out of reach: nothing drives it, .* Give it drives"):
        vjm.stiffness(robot, "0,0,10")


def test_a_rigid_rotation_is_infinitely_stiff():
    """Three stiff bars with compliant drives: a platform that shifts by its drives and does not turn."""
    # turned, so that the rotation's zero is a sum and not a constant
    robot = cartesian(elastic=False, turned=frame(rotation_from_vector([0.3, -0.7, 0.4])))
    found = vjm.stiffness(robot, "h")
    assert np.all(np.isinf(found.loaded))
    C = np.zeros((6, 6))
    C[:3, :3] = DRIVE * np.eye(3)
    assert found.loaded_compliance == pytest.approx(C, abs=1e-14 * DRIVE)
    assert len(found.rigid) == 3
    assert np.all(found.rigid[:, :3] == 0.0)
    setting = MapSetting(robot, VjmEngine(4), MapQuantity.STIFFNESS)
    rows = run_map(Map(setting, points_of(setting.model, parsed_grid("x=-50:50:3", setting.model), "h")))
    assert rows.why == (OK,) * 3
    assert rows.values[:, :2] == pytest.approx(1.0 / DRIVE, rel=1e-12)
    assert np.all(np.isinf(rows.values[:, 2:]))


@pytest.mark.parametrize("engine", ["vjm", "vjm-paper", "exudyn"])
def test_a_force_on_rigid_legs_moves_what_is_elastic(engine: str):
    found = vjm.stiffness(cartesian(elastic=False), "h", wrench=(10.0, 0.0, 0.0, 0.0, 0.0, 0.0), engine=engine)
    assert found.displacement == pytest.approx([10.0 * DRIVE, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-11)
    assert np.all(np.isinf(found.loaded))
    # an imposed turn has no wrench that is determined
    with pytest.raises(ValueError, match="cannot move in every direction in which it is held"):
        vjm.stiffness(cartesian(elastic=False), "h", displacement=(0.0, 0.0, 0.0, 1e-3, 0.0, 0.0), engine=engine)


def test_a_leg_that_is_rigid_in_one_direction_alone():
    """A bar that does not twist: the platform turns as the two others bend, and not about x."""
    robot = cartesian()
    C = robot.beams[0].beam_compliance()
    C[3], C[:, 3] = 0.0, 0.0
    bar = replace(robot.beams[0], section=None, compliance=C)
    robot = replace(robot, parts=tuple(bar if part.name == bar.name else part for part in robot.parts))
    found = vjm.stiffness(robot, "h", engine="vjm-paper")
    assert len(found.rigid) == 1
    assert found.rigid[0] == pytest.approx([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], abs=1e-9)
    whole = vjm.stiffness(cartesian(), "h", engine="vjm-paper")
    # the limit of ever stiffer bars: K with its rx row and column gone
    rest = [0, 1, 2, 4, 5]
    limit = np.linalg.inv(whole.loaded[np.ix_(rest, rest)])
    assert found.loaded_compliance[np.ix_(rest, rest)] == pytest.approx(limit, rel=1e-9, abs=1e-12 * limit.max())


CASES = Path(__file__).parents[4] / "shared/cases/machines"


@pytest.mark.skipif(not CASES.exists(), reason="not redistributed: put it into ../shared beside the checkout")
def test_a_map_reaches_what_single_poses_reach():
    robot = vjm.load(CASES / "tripteron.toml")
    low, high = robot.workspace
    grid = np.linspace(0.0, 1.0, 10)
    shares = np.array(np.meshgrid(grid, grid, grid, indexing="ij")).reshape(3, -1).T
    poses = np.hstack([low + shares * (high - low), np.zeros((1000, 3))])
    found = PlatformBatch(robot, VjmEngine(4)).equilibria(poses, np.zeros(6))
    assert found.solved.all()
    for k in range(0, 1000, 83):
        K = vjm.stiffness(robot, ",".join(f"{v:.12g}" for v in poses[k, :3]), engine="vjm-4").loaded
        assert found.stiffness[k] == pytest.approx(K, rel=1e-7, abs=1e-9 * np.abs(K).max())
