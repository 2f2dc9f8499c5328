"""Machines with laws of springs: events along paths, parameters, engines and files, each against a closed form."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.file_texts import model_text, part_text

import vjm
from vjm.io.file_parameters import MachineFiles
from vjm.model.laws import DeadZone, OneSided, Polynomial, StrainWave, Tabulated
from vjm.model.machine import Machine

EVERYWHERE = ("x", "y", "z", "rx", "ry", "rz")
GEAR = StrainWave(3.1e7, 5e7, 5.7e7, 1.4e4, 4.8e4)


def arm(law, **more) -> Machine:
    """A rigid arm of 400 mm on one joint about z."""
    joint = vjm.Joint("elbow", vjm.axis("z"), law=law, **more)
    return vjm.build("arm", [joint, vjm.RigidOffset("fore", vjm.translation((400.0, 0.0, 0.0)))])


def across(force):
    """A force across the arm."""
    return (0.0, force, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "law",
    [
        GEAR,
        Polynomial(1e6, (-0.05, 0.05), K3=1e9),
        DeadZone(1e7, 2e-3),
        DeadZone(1e7, 2e-3, inside=1e5),
        OneSided(1e7, 1e-5, begins=0.01),
        Tabulated((-0.02, -0.01, 0.0, 0.01, 0.02), (-1e6, -1e4, 0.0, 1e4, 1e6)),
    ],
    ids=lambda law: law.kind,
)
@pytest.mark.parametrize("force", [5.0, 200.0])
def test_a_rigid_arm_stands_where_its_law_bears_the_force(law, force):
    found = vjm.stiffness(arm(law), wrench=across(force))
    turn = found.displacement[5]
    assert float(law.force(turn)) == pytest.approx(400.0 * force * np.cos(turn), rel=1e-11)
    stiffness = float(law.tangent(turn)) + 400.0 * force * np.sin(turn)
    assert found.loaded_compliance[5, 5] == pytest.approx(1.0 / stiffness, rel=1e-9)


def test_a_preload_shifts_the_law():
    """A passive joint with a preload of 2 N m in balance with 5 N at 400 mm stands where it was drawn."""
    machine = arm(GEAR, passive=True, preload=-2e4)
    found = vjm.stiffness(machine, wrench=across(50.0))
    assert abs(found.displacement[5]) < 1e-12
    # the spring is at 20 N m: on the second slope
    assert 1.0 / found.loaded_compliance[5, 5] == pytest.approx(5e7, rel=1e-9)


def test_slopes_of_a_gear_are_met_where_their_torques_are():
    load = vjm.Load(across(1.0))
    path = vjm.trace(arm(GEAR), vjm.LoadCase("home", 200.0, "load", free=EVERYWHERE, loads=(load,)))
    assert [change.region for change in path.law_changes] == ["between T1 and T2", "beyond T2"]
    for change, torque, jump in zip(path.law_changes, (1.4e4, 4.8e4), (1.9e7, 0.7e7), strict=True):
        turn = change.point.displacement[5]
        # the law rounds a kink by 3/32 of the jump times the width
        assert turn == pytest.approx({1.4e4: GEAR.kinks[2], 4.8e4: GEAR.kinks[3]}[torque], rel=1e-9)
        there = torque + 3.0 / 32.0 * jump * GEAR.width
        assert 400.0 * change.force * np.cos(turn) == pytest.approx(there, rel=1e-8)
        assert change.point in path.points


def test_a_stop_is_met_along_a_path_of_displacements():
    # a soft spring beside a stop: the arm of 400 mm meets it at 0.01 rad
    stop = DeadZone(1e8, 0.02, inside=1e6)
    path = vjm.trace(arm(stop), vjm.LoadCase("home", 8.0, "y", free=("x", "z", "rx", "ry", "rz")))
    (met,) = path.law_changes
    assert met.region == "in contact"
    assert met.s == pytest.approx(400.0 * np.sin(0.01), rel=1e-8)


def test_where_nothing_holds_a_machine_it_says_so():
    loose, load = arm(DeadZone(1e7, 2e-3)), vjm.Load(across(1.0))
    with pytest.raises(
        vjm.NoConvergenceError, match="nothing holds the machine where the path begins: joint 'elbow'"
    ):
        vjm.trace(loose, vjm.LoadCase("home", 100.0, "load", free=EVERYWHERE, loads=(load,)))
    with pytest.raises(
        vjm.NoConvergenceError,
        match="nothing determines where it stands: joint 'elbow' is free within its clearance",
    ):
        vjm.stiffness(loose)
    found = vjm.stiffness(loose, wrench=across(50.0))
    assert np.isnan(found.unloaded).all()
    assert "there is no unloaded stiffness" in found.laws[-1]


def test_numbers_of_laws_are_parameters(tmp_path: Path):
    file = tmp_path / "scara.toml"
    files = MachineFiles.read("scara")
    files.write(file, "", "scara")
    wrench = across(100.0)
    keys = [key for key in files.keys() if key.startswith("shoulder.law")]  # noqa: SIM118
    assert {"shoulder.law.K1_1e4Nm_per_rad", "shoulder.law.T1_Nm"} <= set(keys)
    found = vjm.sensitivities(file, keys, posture="stretched", wrench=wrench)
    for row in found.table():
        value, step = row["value"], 1e-4 * row["value"]
        other = (files.with_numbers({row["parameter"]: value + sign * step}) for sign in (1.0, -1.0))
        ahead, behind = (vjm.stiffness(each.machine("stretched"), wrench=wrench) for each in other)
        by_differences = (ahead.displacement[1] - behind.displacement[1]) / (2.0 * step)
        # the error of a difference is the square of its step
        assert row["derivative"] == pytest.approx(by_differences, rel=1e-6, abs=1e-9)
    # by hand: 29 N m on K1, then 31 N m on K2, over a lever of 600 mm
    by_hand = {"K1": -600.0 * 29.0 / 6.7**2 / 1e4, "T1": 600.0 * (1.0 / 6.7 - 1.0 / 11.0) / 1e4}
    own = {row["parameter"]: row["derivative"] for row in found.table()}
    assert own["shoulder.law.K1_1e4Nm_per_rad"] == pytest.approx(by_hand["K1"], rel=1e-3)
    assert own["shoulder.law.T1_Nm"] == pytest.approx(by_hand["T1"], rel=1e-3)


def test_linear_engines_say_where_they_are_linear():
    machine = arm(GEAR)
    for engine in ("vjm-linear", "msa"):
        found = vjm.stiffness(machine, wrench=across(100.0), engine=engine)
        assert found.displacement[5] == pytest.approx(4e4 / 3.1e7, rel=1e-9)
        assert found.laws == (
            f"{engine} is linear about the posture as drawn: laws of springs have their tangents there",
        )


def test_what_cannot_take_a_law_says_so():
    with pytest.raises(
        ValueError, match="joint 'elbow': msa does not take laws of springs without a slope at rest"
    ):
        vjm.stiffness(arm(DeadZone(1e7, 2e-3)), wrench=across(1.0), engine="msa")
    left_out = vjm.robot_text(arm(GEAR), "urdf").left_out
    assert "the laws of joint 'elbow': a URDF has none" in left_out


def test_strain_energy_of_a_law_is_shared_as_it_is():
    found = vjm.shares(arm(GEAR), wrench=across(200.0))
    (row,) = (row for row in found.table() if row["part"] == "elbow")
    assert row["energy"] == pytest.approx(1.0)


@pytest.mark.parametrize("steps", [1, 2, None])
def test_a_stop_that_is_met_and_left_within_one_step_is_seen(steps):
    """A slide of 200 mm passes a buffer 30 mm beside its middle: it is shorter than 40 mm in between."""
    aside, free, stiffness = 30.0, 40.0, 5.0
    slide = vjm.Joint("slide", vjm.axis("x"), slides=True, passive=True, compliance=1e-3)
    buffer = vjm.PointSpring(
        "buffer", ("", "tool"), np.array([[97.0, aside, 0.0], [0.0, 0.0, 0.0]]), free_length=free,
        law=OneSided(stiffness, 1e-6, acts="below"),
    )  # fmt: skip
    machine = vjm.build("rail", [slide, vjm.RigidOffset("tool", np.eye(4))], point_springs=[buffer])
    path = vjm.trace(machine, vjm.LoadCase("home", 200.0, "x", free=EVERYWHERE[1:], steps=steps))
    half = np.sqrt(free**2 - aside**2)
    assert [change.region for change in path.law_changes] == ["in contact", "without contact"]
    for change, place in zip(path.law_changes, (97.0 - half, 97.0 + half), strict=True):
        # located to 1e-9 of the path's parameter
        assert change.s == pytest.approx(place, rel=2e-9)


LAWS_EVERYWHERE = model_text(
    "everywhere",
    part_text(
        "mount",
        "frame",
        axis="z",
        motion="turns",
        law={"kind": "polynomial", "K1_Nmm_per_rad": 1e8, "K3_Nmm_per_rad3": 1e13, "range_rad": [-0.01, 0.01]},
    ),
    part_text(
        "actuator",
        "slide",
        axis="y",
        law={"kind": "dead_zone", "stiffness_N_per_mm": 500.0, "clearance_mm": 0.2, "inside_N_per_mm": 20.0},
    ),
    part_text(
        "actuated",
        "elbow",
        axis="z",
        compliance=[
            [1e-5, 0, 0, 0, 1e-8, 0],
            [0, 1e-5, 0, 0, 0, 0],
            [0, 0, 2e-5, 0, 0, 0],
            [0, 0, 0, 1e-8, 0, 0],
            [1e-8, 0, 0, 0, 2e-8, 0],
            [0, 0, 0, 0, 0, 0],
        ],
        law={
            "kind": "strain_wave",
            "K1_1e4Nm_per_rad": 3.1,
            "K2_1e4Nm_per_rad": 5.0,
            "K3_1e4Nm_per_rad": 6.0,
            "T1_Nm": 10.0,
            "T2_Nm": 50.0,
        },
    ),
    part_text("link", "fore", translation_mm=[400.0, 0.0, 0.0]),
    postures={"home": {"elbow": 0.0}},
)


@pytest.mark.parametrize("engine", ["vjm", pytest.param("exudyn", marks=pytest.mark.slow)])
def test_mounts_actuators_and_an_axis_beside_a_compliance_have_laws(tmp_path: Path, engine: str):
    if engine == "exudyn":
        pytest.importorskip("exudyn", reason="Exudyn, which is compared, is not installed")
    file = tmp_path / "everywhere.toml"
    file.write_text(LAWS_EVERYWHERE)
    machine = vjm.load(file)
    found = vjm.stiffness(machine, wrench=across(100.0), engine=engine)
    # 100 N at 400 mm, whose lever shortens by the square of a milliradian
    roots = np.roots([1e13, 0.0, 1e8, -4e4])
    frame = float(roots[np.abs(roots.imag) < 1e-9].real[0])
    elbow = 1e4 / 3.1e7 + 3e4 / 5e7
    assert found.displacement[5] == pytest.approx(frame + elbow, rel=1e-5)
    slide = 0.1 + (100.0 - 2.0) / 500.0
    assert found.displacement[1] == pytest.approx(slide + 400.0 * (frame + elbow) + 100.0 * 1e-5, rel=1e-5)
    if engine == "vjm":
        assert "mount 'frame' is within its range" in found.laws[0]
        assert "actuator 'slide' is in contact" in found.laws[1]
        assert "joint 'elbow' is between T1 and T2" in found.laws[2]
    assert vjm.robot_text(machine, "urdf").left_out[1] == (
        "the laws of mount 'frame', actuator 'slide', joint 'elbow': a URDF has none"
    )


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (
            ("[0, 0, 0, 0, 0, 0]", "[0, 0, 0, 0, 0, 1e-9]"),
            "A law is of one axis alone: give zeros in that axis's row",
        ),
        (('motion = "turns"\n', ""), 'has a law: add motion = "turns" or motion = "slides"'),
        (('axis = "y"\n', 'axis = "y"\ncompliance_mm_per_N = 1e-4\n'), "has a law and compliance_mm_per_N"),
        (("clearance_mm", "clearance_rad"), "law.clearance_rad has the unit of what turns: give clearance_mm"),
    ],
    ids=["coupled axis", "no motion", "two springs", "unit"],
)
def test_laws_that_a_part_cannot_have_are_refused(tmp_path: Path, wrong: tuple[str, str], said: str):
    file = tmp_path / "wrong.toml"
    assert wrong[0] in LAWS_EVERYWHERE
    file.write_text(LAWS_EVERYWHERE.replace(*wrong))
    with pytest.raises(vjm.ModelFileError, match=re.escape(said)):
        vjm.load(file)
