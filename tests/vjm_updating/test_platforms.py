"""Tests of a whole platform: finite elements make the readings, and the springs of its legs come back."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers.command import validate

from vjm.engines import EngineOptions, engine_by_name
from vjm.io.machine_file import load_model
from vjm.model.load_case import LoadCase
from vjm.model.parameters import compliance_factor
from vjm_updating import load_data
from vjm_updating.calibration.fit import problem_of, solve
from vjm_updating.experiment.comparison import ratio_of
from vjm_updating.experiment.plausibility import compared as compare
from vjm_updating.experiment.plausibility import plausibility

FORCES = ("fx_N", "fy_N", "fz_N")
NOISE = {**dict.fromkeys(("ux_mm", "uy_mm", "uz_mm"), 2e-4), **dict.fromkeys(FORCES, 0.5)}
FAR, STEPS = 0.2, 4
"""mm from the unloaded pose, and readings on the way."""
SHEET = """[test]
model = "orthoglide"
control = "displacement"
[model]
link_segments = 2
foot_segments = 2
""" + "".join(f"[instrument.{name}]\nnoise = {noise}\n" for name, noise in NOISE.items())


def files(folder: Path, soft: dict[str, float], postures: tuple[str, ...]) -> list[str]:
    """Readings of finite elements of the Orthoglide with factors on its parts' compliances, and a sheet."""
    chain, rng = load_model("orthoglide"), np.random.default_rng(5)
    for part, factor in soft.items():
        chain = compliance_factor(chain, part).apply(chain, factor)
    engine = engine_by_name("exudyn", EngineOptions(segments=2), chain)
    lines = ["posture,run," + ",".join(NOISE)]
    for run, (posture, axis) in enumerate([(p, axis) for p in postures for axis in range(3)], 1):
        path = engine.trace(chain, LoadCase(posture, FAR, tuple(np.eye(6)[axis].tolist()), steps=STEPS))
        assert path.complete, path.stopped
        for point in path.points[1:]:
            true = np.concatenate([point.s * np.eye(3)[axis], point.wrench[:3]])
            read = true + np.array(list(NOISE.values())) * rng.standard_normal(6)
            lines.append(f"{posture},{run}," + ",".join(f"{value:.6f}" for value in read))
    (folder / "readings.csv").write_text("\n".join(lines) + "\n")
    (folder / "sheet.toml").write_text(SHEET)
    return [str(folder / "readings.csv"), "--sheet", str(folder / "sheet.toml")]


@pytest.mark.slow
def test_the_springs_of_all_legs_come_back(tmp_path: Path):
    """Along x, y and z in three poses every part of every leg has a number of its own."""
    soft = {"x/link": 1.2, "y/foot": 1.3, "z/link": 0.8}
    given = files(tmp_path, soft, ("isotropic", "Q1", "Q2"))
    validate("calibrate", *given, "--out", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert found["fit"]["fits"]
    rows = {row["name"]: row for row in found["parameters"]}
    assert set(rows) == {f"{leg}/{part}.factor" for leg in "xyz" for part in ("foot", "link")}
    for name, row in rows.items():
        truth = soft.get(name.removesuffix(".factor"), 1.0)
        # of six, one misses an interval of 95 % by luck in four tests
        assert abs(row["value"] - truth) < 3.0 * row["std"], name
        assert row["std"] < 0.1, name
    # the calibrated machine is one file, which every command takes
    validate("stiffness", tmp_path / "out" / "calibrated-model.toml", "--posture", "Q1")


@pytest.mark.slow
def test_a_soft_leg_is_named(tmp_path: Path):
    """In one pose the foot of a leg is hardly another cause than its drive: both are said, and the leg.

    The sheet gives no tolerances: what they would leave open is a cause like any other.
    """
    given = files(tmp_path, {"y/foot": 1.3}, ("Q2",))
    validate("diagnose", *given, "--out", tmp_path / "out")
    names_the_soft_foot(json.loads((tmp_path / "out" / "diagnosis.json").read_text()))


def names_the_soft_foot(found: dict) -> None:
    assert found["verdict"] in ("named", "class")
    assert "link_compliance" in found["causes"]
    left = [row for row in found["candidates"] if set(row["causes"]) <= set(found["causes"])]
    places = {place for row in left if row["probability"] > 0.05 for place in row["places"]}
    # nothing of the two other legs
    assert places <= {
        "link_compliance(y/foot)", "tension_compression_asymmetry(y/foot)", "actuator_compliance(y)",
        "actuator_hardening(y)",
    }  # fmt: skip
    (foot,) = (row["parameters"] for row in left if row["places"] == ["link_compliance(y/foot)"])
    factor = foot["link_compliance.factor"]
    assert abs(factor["value"] - 1.3) < 4.0 * factor["std"]
    assert factor["std"] < 0.02
    assert found["findings"]["explained"] > 0.95
    assert found["findings"]["nothing"] < 1e-6


@pytest.mark.slow
def test_noise_of_an_idle_gauge_is_no_mistake_of_a_stiff_platform(tmp_path: Path):
    """Nobody drives z. Its gauge's 1 µm times 102 kN/mm are fifty times the force's noise, and of either sign."""
    sheet, out = tmp_path / "sheet.toml", tmp_path / "out"
    validate("new", "sheet", str(sheet), "--for", "3-puu")
    gauges = (f"\n[instrument.{name}]\nnoise = 0.001\nzero = 0.002\n" for name in ("uy_mm", "uz_mm"))
    sheet.write_text(sheet.read_text(encoding="utf-8") + "".join(gauges), encoding="utf-8")
    ramps = ("--ramp", "home:x:0.2", "--ramp", "home:y:0.2")
    validate("simulate", "3-puu", "--test", sheet, *ramps, "--out", out)
    data = load_data(out / "readings.csv", out / "sheet.toml")
    assert (data.kind, len(data)) == ("ramps", 60)
    compared = compare(data.test)
    assert compared.noise("fz_N") > 50.0 * 2.0
    assert not compared.expected("fz_N")
    assert [str(one) for one in plausibility(data.test)] == []
    (driven,) = (k for k, name in enumerate(compared.columns) if name == "fx_N")
    assert ratio_of(compared.read[:, driven], compared.predicted()[:, driven])[1] == pytest.approx(1.0, abs=0.05)
    # nor is it explained by slopes of forces that have the same noise in them: nothing is hidden
    found = solve(problem_of(data.test))
    assert (found.whitening.spread == 1.0).all()
    assert not found.outliers.any()
    assert (found.whitening.autoregression.rho < 0.5).all()
    own = found.problem.unknowns.parameters
    # of six, one lies further off by luck in sixty tests
    assert (np.abs(found.z[:own]) < 3.0 * np.sqrt(np.diag(found.covariance)[:own])).all()
