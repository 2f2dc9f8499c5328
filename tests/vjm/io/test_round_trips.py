"""Random machines, written in each format and read again: what does not come back is what export says.

Tables of joints have round trips of their own, `test_dh_tables`.
"""

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.same_machine import masses, same
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vjm.io import robot_text
from vjm.io.inertia import inertia_values
from vjm.io.model_file import build_chain, load_chain
from vjm.io.robot_file import Description, import_robot
from vjm.io.stiffness_file import stiffness_text
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, JointKind, RigidOffset, Section
from vjm.rotations import AXES, rotate_matrix6, shift_compliance, turn

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
    lost = robot_text.urdf_leaves_out(machine)
    back = written_and_read(tmp_path, machine, ".urdf", stiffness=False)
    same(machine, back, ordered=False)
    assert masses(back) == masses(machine)
    for kept, found in zip(inertias(machine), inertias(back), strict=True):
        assert (kept is None and found is None) or np.array_equal(kept, found)
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
    lost = robot_text.mjcf_leaves_out(machine)
    back = written_and_read(tmp_path, machine, ".xml", stiffness=False)
    same(machine, back, digits=LAST, ordered=False)
    massless = named(lost, "that ", " have no mass")
    assert len(masses(back)) == len(masses(machine)) + len(massless)
    again = {joint.name: joint for joint in back.moving}
    across_lost = named(lost, "what is elastic across the axes of ")
    for joint in machine.moving:
        other = again[joint.name]
        assert other.rotor == pytest.approx(joint.rotor, rel=LAST)
        assert other.passive == joint.passive
        if joint.held and joint.coupling is None:
            assert other.compliance == pytest.approx(joint.compliance, rel=2 * LAST)
            assert not any(other.lateral)
    rests = {joint.name: joint.rest for joint in machine.joints}
    assert {joint.name: joint.rest for joint in back.joints} == pytest.approx(rests, rel=LAST)
    assert across_lost == {joint.name for joint in machine.held_joints if any(joint.lateral)}
    if not massless:
        for kept, found in zip(inertias(machine), inertias(back), strict=True):
            assert (kept is None) == (found is None)
            if kept is not None and found is not None:
                assert found == pytest.approx(kept, abs=TURNED * np.abs(kept).max())


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


# A random valid model, written as TOML by hand, loads as the same machine.


VECTORS = st.lists(st.floats(-200.0, 200.0), min_size=3, max_size=3)
TURNS = st.lists(
    st.fixed_dictionaries({"turn_about": st.sampled_from("xyz"), "angle_deg": st.floats(-180.0, 180.0)}), max_size=3
)
SECTIONS = st.builds(
    lambda E, iy, iz, torsion: {
        "EA_N": E, "EIy_Nmm2": E * iy**2, "EIz_Nmm2": E * iz**2, "GJ_Nmm2": torsion * E * (iy**2 + iz**2),
    },
    st.floats(1e5, 1e9), st.floats(0.5, 10.0), st.floats(0.5, 10.0), st.floats(1e-3, 0.5),
)  # fmt: skip


@st.composite
def beams(draw: st.DrawFn) -> dict[str, Any]:
    beam: dict[str, Any] = {
        "kind": "beam", "length_mm": draw(st.floats(50.0, 2000.0)), "count": draw(st.integers(1, 4)),
        "own_axes": draw(TURNS), "section_axes": draw(TURNS), "end_offset_mm": draw(VECTORS),
    }  # fmt: skip
    section = draw(SECTIONS)
    given = draw(st.sampled_from(["section", "compliance", "both"]))
    if given != "compliance":
        beam["section"] = section
    if given != "section":
        stiff = Section(section["EA_N"], section["GJ_Nmm2"], section["EIy_Nmm2"], section["EIz_Nmm2"])
        at_end = rotate_matrix6(stiff.compliance(beam["length_mm"]), rotation(beam["section_axes"]))
        # a part that is a little softer than its beam, as identified ones are
        k = draw(st.floats(0.5, 2.0)) * shift_compliance(at_end, beam["end_offset_mm"])
        beam["compliance"] = (0.5 * (k + k.T)).tolist()
    return beam


OTHERS = st.one_of(
    st.fixed_dictionaries({"kind": st.just("offset"), "translation_mm": VECTORS, "turns": TURNS}),
    st.fixed_dictionaries(
        {"kind": st.just("actuator"), "axis": st.sampled_from("xyz"), "compliance_mm_per_N": st.floats(0, 1e-3)}
    ),
)


@st.composite
def models(draw: st.DrawFn) -> dict[str, Any]:
    """Anything in series, with one hinge at the most: it can always turn alone."""
    parts = [*draw(st.lists(beams() | OTHERS, max_size=4)), draw(beams())]
    angles = []
    if draw(st.booleans()):
        axis = np.array(draw(VECTORS.filter(lambda v: math.hypot(*v) > 1.0)))
        joint = {"kind": "joint", "axis": (axis / np.linalg.norm(axis)).tolist()}
        parts.insert(draw(st.integers(0, len(parts))), joint)
        angles = [draw(st.floats(-3.0, 3.0))]
    for i, part in enumerate(parts):
        part["name"] = f"p{i}"
    return {
        "format": 1, "name": "random", "title": 'a "title" with \\ in it', "source": "hypothesis",
        "units": {"length": "mm", "force": "N", "angle": "rad"},
        "base": {"position_mm": draw(VECTORS), "turns": draw(TURNS)},
        "parts": parts,
        "postures": {"P": angles},
    }  # fmt: skip


def rotation(turns: list[dict[str, Any]]) -> np.ndarray:
    """The product of elementary turns, as (1) and (21) string them."""
    T = np.eye(4)
    for one in turns:
        T = T @ turn(AXES[one["turn_about"]], math.radians(one["angle_deg"]))
    return T[:3, :3]


def toml(value: Any) -> str:
    """A value as inline TOML."""
    match value:
        case dict():
            return "{" + ", ".join(f"{key} = {toml(one)}" for key, one in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(toml, value)) + "]"
        case str():
            return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        case _:
            return repr(value)


@settings(max_examples=40, deadline=None)
@given(models())
def test_roundtrip(document):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "random.toml"
        file.write_text("".join(f"{key} = {toml(value)}\n" for key, value in document.items()), "utf-8")
        chain = load_chain(file)
    assert (chain.name, chain.title, chain.source) == ("random", document["title"], "hypothesis")
    np.testing.assert_array_equal(chain.base[:3, 3], document["base"]["position_mm"])
    np.testing.assert_allclose(chain.base[:3, :3], rotation(document["base"]["turns"]), atol=1e-14)
    np.testing.assert_array_equal(chain.posture("P"), document["postures"]["P"])
    assert len(chain.parts) == len(document["parts"])
    for part, raw in zip(chain.parts, document["parts"], strict=True):
        assert part.name == raw["name"]
        match part:
            case RigidOffset():
                np.testing.assert_array_equal(part.transform[:3, 3], raw["translation_mm"])
                np.testing.assert_allclose(part.transform[:3, :3], rotation(raw["turns"]), atol=1e-14)
            case Joint(fixed=True):
                assert (part.kind, part.slides) == (JointKind.ACTUATOR, True)
                np.testing.assert_array_equal(part.axis, AXES[raw["axis"]])
                assert part.compliance == raw["compliance_mm_per_N"]
            case Joint():
                assert part.kind is JointKind.FREE
                np.testing.assert_allclose(part.axis, raw["axis"], atol=1e-15)
            case Beam():
                check_beam(part, raw)


def check_beam(part: Beam, raw: dict[str, Any]) -> None:
    assert (part.length, part.count, part.segments) == (raw["length_mm"], raw["count"], None)
    np.testing.assert_array_equal(part.end_offset, raw["end_offset_mm"])
    np.testing.assert_allclose(part.own_frame, rotation(raw["own_axes"]), atol=1e-14)
    np.testing.assert_allclose(part.section_frame, rotation(raw["section_axes"]), atol=1e-14)
    if "section" in raw:
        s = raw["section"]
        assert part.section == Section(s["EA_N"], s["GJ_Nmm2"], s["EIy_Nmm2"], s["EIz_Nmm2"])
    else:
        assert part.section is None
    if "compliance" in raw:
        np.testing.assert_array_equal(part.compliance, raw["compliance"])
    else:
        assert part.compliance is None


def test_what_a_description_does_not_tell_of_a_coupling_is_said():
    document = random_document(0)
    for part in document["parts"]:
        if part["kind"] == "coupled":
            part["coupling"] = "as commanded"
    machine = build_chain(document, "random.toml")
    names = [one.name for one in machine.moving if one.coupling is not None and len(one.coupling.ratios) == 1]
    assert names
    for lost in (robot_text.urdf_leaves_out(machine), robot_text.mjcf_leaves_out(machine)):
        assert named(lost, "that ", " follow what others are commanded") == set(names)
