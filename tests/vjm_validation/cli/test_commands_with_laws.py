"""Every command on machines whose springs have laws: values of a hand's, or one line that says why there are none.

An arm of 400 and 300 mm lies along x. 100 N at its tip turn the shoulder by 70 N m, which every law here bears at
2.75e-3 rad, and the elbow of 2e-8 rad/(N mm) by 30 N m.
"""

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from helpers.command import json_of, refused, validate

import vjm
from vjm_validation.explore.state import Explorer, Setting

LAWS = {
    "stop": 'kind = "one_sided", stiffness_Nmm_per_rad = 4e7, transition_rad = 1e-5, begins_rad = 1e-3',
    "dead zone": 'kind = "dead_zone", stiffness_Nmm_per_rad = 4e7, clearance_rad = 2e-3',
    "table": 'kind = "table", deflections_rad = [-0.02, -2.75e-3, 0, 2.75e-3, 0.02], forces_Nmm = [-8e5, -7e4, 0, 7e4, 8e5]',  # noqa: E501
}  # fmt: skip
LOOSE = [name for name in LAWS if name != "table"]
"""Laws without a slope at rest."""
ARM = """
format = 1
name = "arm"
title = "arm of two rigid links"
source = "made up"
units = {{ length = "mm", force = "N", angle = "rad" }}
parts = [
  {{ kind = "actuated", name = "shoulder", axis = "y", law = {{ {law} }} }},
  {{ kind = "link", name = "upper", translation_mm = [400, 0, 0], mass_kg = 4.0, centre_of_mass_mm = [400, 0, 0] }},
  {{ kind = "actuated", name = "elbow", axis = "y", compliance_rad_per_Nmm = 2e-8 }},
  {{ kind = "link", name = "fore", translation_mm = [300, 0, 0], mass_kg = 3.0, centre_of_mass_mm = [300, 0, 0] }},
]
postures = {{ level = {{ shoulder = 0.0, elbow = 0.0 }} }}
"""
WRENCH = ("--wrench", "0,0,-100,0,0,0")
SUNK = 700.0 * 2.75e-3 + 300.0 * 6e-4
"""mm."""
SECOND = 1e-4
"""Relative: turns of some milliradians shorten levers by their square, and turn the load's lever by themselves."""


@pytest.fixture(params=LAWS)
def law(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def arm(law: str, tmp_path: Path) -> str:
    file = tmp_path / "arm.toml"
    file.write_text(ARM.format(law=LAWS[law]))
    return str(file)


def slope(law: str) -> float:
    """Of the shoulder under the load, N mm/rad; of a table a mean of its chords (Fritsch and Butland 1984)."""
    if law != "table":
        return 4e7
    h, chord = np.array([2.75e-3, 0.01725]), np.array([7e4 / 2.75e-3, 7.3e5 / 0.01725])
    weights = np.array([h[0] + 2.0 * h[1], 2.0 * h[0] + h[1]])
    return float(weights.sum() / (weights / chord).sum())


def test_stiffness_and_map(arm: str, law: str, tmp_path: Path):
    found = json_of("stiffness", arm, *WRENCH)
    assert found["displacement"][2] == pytest.approx(-SUNK, rel=SECOND)
    compliance = 700.0**2 / slope(law) + 300.0**2 * 2e-8
    assert found["compliance_loaded"][2][2] == pytest.approx(compliance, rel=1e-3)
    grid = ("--grid", "shoulder=0:0.1:2,elbow=0:0.1:2", "--jobs", "1", "--out", str(tmp_path / "map"))
    mapped = json_of("map", arm, *grid, *WRENCH, "--quantity", "deflection")
    assert mapped["values"][0][mapped["columns"].index("u_mm")] == pytest.approx(
        np.linalg.norm(found["displacement"][:3]), rel=1e-9
    )


def test_shares(arm: str, law: str):
    if law in LOOSE:
        said = refused("stiffness", arm, *WRENCH, "--shares")
        assert "without load joint 'shoulder' is free" in said
        return
    (shares,) = json_of("stiffness", arm, *WRENCH, "--shares")["shares"]
    by_part = {row["part"]: row["deflection"][2] for row in shares["parts"]}
    assert by_part["elbow"] == pytest.approx(-300.0 * 6e-4, rel=1e-9)
    # the slope at rest is that of the chords, which are alike on both sides
    assert by_part["shoulder"] == pytest.approx(-700.0 * 2.75e-3, rel=1e-9)


def test_frequencies_are_those_of_the_slope_at_the_load(arm: str, law: str):
    found = json_of("modes", arm, *WRENCH)
    K = np.diag([slope(law), 5e7])
    # the load's own stiffness against both turns, to first order in the sag: N mm
    levers = np.array([[400.0, 0.0], [700.0, 300.0]])
    M = levers.T @ np.diag([4.0, 3.0]) @ levers
    squares = scipy.linalg.eigh(K, M, eigvals_only=True)
    own = sorted(mode["frequency_Hz"] for mode in found["modes"])
    # the masses are in kg and the stiffness in N mm: 1e3 of it are N mm per kg mm²/s²
    np.testing.assert_allclose(own, np.sqrt(1e3 * squares) / (2.0 * np.pi), rtol=1e-3)
    without = json_of("modes", arm)
    assert without["verdict"] == ("neutral" if law in LOOSE else "stable")


def test_sensitivity(arm: str, law: str):
    if law == "table":
        found = json_of("sensitivity", arm, *WRENCH, "--by", "elbow.compliance_rad_per_Nmm")
        assert found["parameters"][0]["derivative"] == pytest.approx(-300.0 * 3e4, rel=1e-3)
        return
    found = json_of("sensitivity", arm, *WRENCH, "--by", "shoulder.law.stiffness_Nmm_per_rad")
    (row,) = found["parameters"]
    assert abs(row["derivative"]) == pytest.approx(700.0 * 7e4 / 4e7**2, rel=1e-3)
    assert row["difference"] == pytest.approx(row["derivative"], rel=1e-4)


@pytest.mark.parametrize("command", ["curve", "buckling"])
def test_paths(arm: str, law: str, command: str):
    ramp = ("--load", "0,0,-100,0,0,0", "--axis", "load", "--to", "2", "--free", "x,y,z,rx,ry,rz")
    if law in LOOSE:
        said = refused(command, arm, *ramp, "--json", status=3)
        assert "nothing holds the machine where the path begins: joint 'shoulder' is free" in said
        return
    found = json_of(command, arm, *ramp)
    if command == "curve":
        point = min(found["points"], key=lambda row: abs(row["ramp"] - 1.0))
        assert found["law_changes"] == []
        assert point["displacement"][2] == pytest.approx(-SUNK * point["ramp"], rel=0.1)


def test_changes_of_region_are_in_the_document(tmp_path: Path):
    file = tmp_path / "arm.toml"
    file.write_text(ARM.format(law=LAWS["dead zone"] + ", inside_Nmm_per_rad = 1e6"))
    ramp = ("--load", "0,0,-100,0,0,0", "--axis", "load", "--to", "1", "--free", "x,y,z,rx,ry,rz")
    (change,) = json_of("curve", str(file), *ramp)["law_changes"]
    # 1 N m at the end of the clearance, and 3/32 of the jump of the slope over its width
    torque = 1e6 * 1e-3 + 3.0 / 32.0 * 3.9e7 * 2e-4
    assert change["at"] == change["force"] == pytest.approx(torque / 7e4, rel=1e-4)
    assert (change["what"], change["name"], change["region"]) == ("joint", "shoulder", "in contact")


def test_postures_and_compensation(arm: str, law: str, tmp_path: Path):
    assert "elbow = 1.57079633 }" in validate("postures", arm, "--tool", "400,0,-300").out
    path = tmp_path / "path.csv"
    path.write_text("x_mm,y_mm,z_mm,fx_N,fy_N,fz_N,mx_Nmm,my_Nmm,mz_Nmm\n600,0,0,0,0,-100,0,0,0\n")
    if law in LOOSE:
        assert "has no linear model at row 1 of the path" in refused("compensate", arm, str(path), status=3)
        return
    assert json_of("compensate", arm, str(path))["left"]["loaded"]["largest_mm"] < 1e-9


def test_optimise(arm: str, law: str):
    number = "elbow.compliance_rad_per_Nmm=1e-8:4e-8"
    found = json_of("optimise", arm, *WRENCH, "--minimise", "deflection.z", "--vary", number, "--starts", "1")
    assert found["value"] == pytest.approx(SUNK - 300.0 * 3e4 * 1e-8, rel=SECOND)


def test_explore(arm: str, law: str):
    if law in LOOSE:
        with pytest.raises(ValueError, match="without load joint 'shoulder' is free"):
            Explorer(arm)
    wrench = (0.0, 0.0, -100.0, 0.0, 0.0, 0.0)
    explorer = Explorer(arm, wrench=wrench)
    answer = explorer.answer(Setting((0.0, 0.0), wrench))
    assert answer.deflection[2] == pytest.approx(-SUNK, rel=SECOND)
    assert (answer.shares is None) is (law in LOOSE)
    if law in LOOSE:
        assert "without load joint 'shoulder' is free" in answer.said[0]
        with pytest.raises(vjm.NoConvergenceError, match="nothing determines where it stands"):
            explorer.answer(Setting((0.0, 0.0)))


def test_a_machine_on_cables(tmp_path: Path):
    """Four cables of 20 N/mm under 80 N carry 5 kg in x and z."""
    length = np.hypot(900.0, 740.0)
    K = 4.0 * np.array([20.0 * (900.0 / length) ** 2 + 80.0 / length * (740.0 / length) ** 2,
                        20.0 * (740.0 / length) ** 2 + 80.0 / length * (900.0 / length) ** 2])  # fmt: skip
    own = sorted(mode["frequency_Hz"] for mode in json_of("modes", "planar-cables")["modes"])
    np.testing.assert_allclose(own, sorted(np.sqrt(1e3 * K / 5.0) / (2.0 * np.pi)), rtol=1e-6)
    (shares,) = json_of("stiffness", "planar-cables", "--wrench", "0,0,-10,0,0,0", "--shares")["shares"]
    for row in shares["parts"]:
        if row["kind"] == "spring":
            # they lie alike to the load
            assert row["energy"] == pytest.approx(0.25, rel=1e-6)
    path = tmp_path / "path.csv"
    path.write_text("x_mm,y_mm,z_mm\n20,0,10\n")
    assert "no joint of it is driven" in refused("compensate", "planar-cables", str(path))
    assert "no joint of it is driven" in refused("postures", "planar-cables", "--tool", "20,0,10")
