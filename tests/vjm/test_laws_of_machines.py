"""Machines with laws of springs: events along paths, parameters, engines and files, each against a closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vjm
from vjm.io.file_parameters import MachineFiles
from vjm.model.laws import DeadZone, OneSided, Polynomial, StrainWave, Tabulated
from vjm.model.machine import Machine
from vjm_updating.experiment.measurement import refuse_laws
from vjm_updating.experiment.sheet import SheetError

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
    with pytest.raises(vjm.NoConvergenceError, match="where a law of a spring has no slope, nothing may hold it"):
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
    with pytest.raises(ValueError, match="vjm-unloaded-jacobian does not take laws of springs"):
        vjm.stiffness(arm(GEAR), displacement=across(1.0), engine="vjm-unloaded-jacobian")
    with pytest.raises(SheetError, match="joint 'elbow' has a law, and tests take constant stiffnesses only"):
        refuse_laws(arm(GEAR), "sheet.toml")
    left_out = vjm.robot_text(arm(GEAR), "urdf").left_out
    assert "the laws of the springs of elbow: a URDF has none" in left_out


def test_strain_energy_of_a_law_is_shared_as_it_is():
    found = vjm.shares(arm(GEAR), wrench=across(200.0))
    (row,) = (row for row in found.table() if row["part"] == "elbow")
    assert row["energy"] == pytest.approx(1.0)
