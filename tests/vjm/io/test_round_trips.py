"""Random machines, written in each format and read again: what does not come back is what export says.

Tables of joints have round trips of their own, `test_dh_tables`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.same_machine import masses, same
from scipy.spatial.transform import Rotation

from vjm.io import robot_text
from vjm.io.inertia import inertia_values
from vjm.io.model_file import build_chain
from vjm.io.robot_file import Description, import_robot
from vjm.io.stiffness_file import stiffness_text
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset

LAST = 4e-16
"""Relative: the last digit of a double, which a stiffness loses where a format has it in place of a compliance."""
TURNED = 1e-9
"""Of the largest moment: MuJoCo has principal moments in axes of their own, of which it keeps quaternions."""


def random_document(seed: int) -> dict[str, Any]:
    """A tree of two to nine joints: driven, sprung, and coupled to driven ones, with masses, limits and rotors."""
    rng = np.random.default_rng(seed)
    parts: list[dict[str, Any]] = []
    held: list[str] = []
    ends: list[str] = [""]
    home: dict[str, float] = {}
    for k in range(int(rng.integers(2, 10))):
        before = str(rng.choice(ends)) if rng.random() < 0.3 else ends[-1]
        slides = bool(rng.random() < 0.3)
        motion = {"motion": "slides"} if slides else {}
        unit = "mm" if slides else "rad"
        table: dict[str, Any] = {"name": f"j{k}", "after": before, "axis": _axis(rng), **motion}
        kind = str(rng.choice(["actuated", "actuated", "joint", "coupled"])) if held else "actuated"
        size = 100.0 if slides else 1.0
        rotor = {"rotor_kg" if slides else "rotor_kg_mm2": float(10.0 ** rng.uniform(-1, 5))}
        if kind == "coupled":
            table |= {"to": {str(rng.choice(held)): float(rng.uniform(-2, 2))}, "coupling": "as deflected"}
            table |= {f"offset_{unit}": float(rng.uniform(-1, 1)) * size} if rng.random() < 0.5 else {}
        elif kind == "joint":
            table["stiffness_N_per_mm" if slides else "stiffness_Nmm_per_rad"] = float(10.0 ** rng.uniform(1, 7))
            table[f"rest_{unit}"] = float(rng.uniform(-0.5, 0.5)) * size
            home[f"j{k}"] = table[f"rest_{unit}"]
        else:
            table["compliance_mm_per_N" if slides else "compliance_rad_per_Nmm"] = float(
                10.0 ** rng.uniform(-9, -5)
            )
            home[f"j{k}"] = 0.0
            if rng.random() < 0.3:
                table["lateral_rad_per_Nmm"] = [float(v) for v in 10.0 ** rng.uniform(-10, -8, 2)]
        if rng.random() < 0.5:
            table[f"limits_{unit}"] = [-10.0 * size, float(rng.uniform(9, 10)) * size]
        parts.append({"kind": kind, **table, **(rotor if rng.random() < 0.5 else {})})
        if kind == "actuated":
            held.append(f"j{k}")
        parts.append(_link(rng, f"l{k}", f"j{k}"))
        ends.append(f"l{k}")
    return {
        "format": 1, "name": f"random-{seed}", "title": "random", "source": "made up",
        "units": {"length": "mm", "force": "N", "angle": "rad"}, "parts": parts, "postures": {"home": home},
    }  # fmt: skip


def _axis(rng: np.random.Generator) -> list[float]:
    axis = rng.normal(size=3)
    return [float(v) for v in axis / np.linalg.norm(axis)]


def _link(rng: np.random.Generator, name: str, after: str) -> dict[str, Any]:
    """A link with the inertia of masses at random points; some are a point, and some have no mass."""
    turn = Rotation.random(random_state=rng).as_rotvec()
    table: dict[str, Any] = {
        "kind": "link", "name": name, "after": after,
        "translation_mm": [float(v) for v in rng.uniform(-400, 400, 3)],
        "turns": [{"turn_about": _unit(turn), "angle_deg": float(np.rad2deg(np.linalg.norm(turn)))}],
    }  # fmt: skip
    if rng.random() < 0.85:
        table |= {
            "mass_kg": float(rng.uniform(0.1, 40)),
            "centre_of_mass_mm": [float(v) for v in rng.uniform(-200, 200, 3)],
        }
        if rng.random() < 0.8:
            points = rng.normal(size=(3, 6)) * 80.0
            spread = points @ points.T
            table["inertia_kg_mm2"] = inertia_values(np.trace(spread) * np.eye(3) - spread)
    return table


def _unit(turn: np.ndarray) -> list[float]:
    return [float(v) for v in turn / np.linalg.norm(turn)]


def written_and_read(folder: Path, machine: Machine, suffix: str, *, stiffness: bool) -> Machine:
    text = robot_text.urdf_text if suffix == ".urdf" else robot_text.mjcf_text
    (folder / f"robot{suffix}").write_text(text(machine), encoding="utf-8")
    if stiffness:
        (folder / "robot.stiffness.toml").write_text(stiffness_text(machine), encoding="utf-8")
    found = import_robot(Description(folder / f"robot{suffix}"))
    return build_chain(found.document, found.file)


def inertias(machine: Machine) -> list[np.ndarray | None]:
    """Of the bodies with a mass, in the order of `masses`."""
    heavy = [part for part in machine.parts if isinstance(part, RigidOffset) and part.mass > 0.0]
    heavy.sort(key=lambda part: (part.mass, tuple(part.centre_of_mass)))
    return [None if part.inertia is None or not part.inertia.any() else part.inertia for part in heavy]


def named(lines: list[str], begins: str, ends: str = "") -> set[str]:
    """The parts that a line names which begins and ends so; none where no line does."""
    line = next((one for one in lines if one.startswith(begins) and ends in one), "")
    return set(line.removeprefix(begins).split(ends or ":")[0].strip().split(", ")) - {""}


@pytest.mark.quick_cases(10)
@pytest.mark.parametrize("seed", range(100))
def test_a_urdf_loses_what_is_said_and_its_stiffness_file_brings_it_back(tmp_path, seed):
    machine = build_chain(random_document(seed), "random.toml")
    lost = robot_text.left_out(machine)
    back = written_and_read(tmp_path, machine, ".urdf", stiffness=False)
    same(machine, back, ordered=False)
    assert masses(back) == masses(machine)
    for given, found in zip(inertias(machine), inertias(back), strict=True):
        assert (given is None and found is None) or np.array_equal(given, found)
    # what is elastic, rotors, and what moves without a drive are lost, and named
    elastic = {joint.name for joint in machine.moving if joint.held and joint.coupling is None}
    assert named(lost, "what is elastic in ") >= elastic
    assert named(lost, "the inertia of the rotors of ") == {joint.name for joint in machine.moving if joint.rotor}
    assert not any(joint.rotor for joint in back.moving)
    sprung = {joint.name for joint in machine.joints}
    assert named(lost, "that ", " move freely") == sprung
    # of drives the file beside it has all of it, to the last digit
    driven = [joint for joint in machine.held_joints if not joint.passive and joint.coupling is None]
    (tmp_path / "beside").mkdir()
    back = written_and_read(tmp_path / "beside", machine, ".urdf", stiffness=True)
    again = {joint.name: joint for joint in back.moving}
    for joint in driven:
        other = again[joint.name]
        assert (joint.compliance, joint.lateral, joint.rotor) == (other.compliance, other.lateral, other.rotor)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("seed", range(100))
def test_an_mjcf_file_loses_what_is_said(tmp_path, seed):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")
    machine = build_chain(random_document(seed), "random.toml")
    lost = robot_text.left_out(machine)
    back = written_and_read(tmp_path, machine, ".xml", stiffness=False)
    same(machine, back, digits=LAST, ordered=False)
    massless = named(lost, "that ", " have no mass")
    assert len(masses(back)) == len(masses(machine)) + len(massless)
    again = {joint.name: joint for joint in back.moving}
    elastic_lost = named(lost, "what is elastic in ")
    for joint in machine.moving:
        other = again[joint.name]
        assert other.rotor == pytest.approx(joint.rotor, rel=LAST)
        assert other.passive == joint.passive
        if joint.held and joint.coupling is None and joint.name not in elastic_lost:
            assert other.compliance == pytest.approx(joint.compliance, rel=2 * LAST)
            assert not any(joint.lateral)
    rests = {joint.name: joint.rest for joint in machine.joints}
    assert {joint.name: joint.rest for joint in back.joints} == pytest.approx(rests, rel=LAST)
    assert elastic_lost == {joint.name for joint in machine.held_joints if any(joint.lateral)}
    if not massless:
        for given, found in zip(inertias(machine), inertias(back), strict=True):
            assert (given is None) == (found is None)
            if given is not None and found is not None:
                assert found == pytest.approx(given, abs=TURNED * np.abs(given).max())


def test_the_random_machines_have_all_that_is_asked():
    machines = [build_chain(random_document(seed), "random.toml") for seed in range(100)]
    joints = [joint for machine in machines for joint in machine.moving]
    for what in (
        [joint.coupling is not None for joint in joints], [joint.passive for joint in joints],
        [any(joint.lateral) for joint in joints], [joint.slides for joint in joints],
        [joint.limits is not None for joint in joints], [bool(joint.rotor) for joint in joints],
        [len(set(machine.predecessors.values())) < len(machine.parts) for machine in machines],
    ):  # fmt: skip
        assert sum(what) > 20
