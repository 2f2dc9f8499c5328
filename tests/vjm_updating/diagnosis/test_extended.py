"""The extended model file says what the diagnosis found, and commands get its predictions from it."""

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from helpers.command import json_of, validate

from vjm.io.files import toml_text
from vjm.io.model_file import build_chain, load_chain
from vjm_updating.calibration.calibrated_model import FILE, extended_document, extended_text
from vjm_updating.experiment import measurement as reading
from vjm_updating.inference.fitting import Fit
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates, start
from vjm_updating.mechanisms.contacts import ActuatorBacklash, ContactCompliance
from vjm_updating.mechanisms.drives import ActuatorCompliance, ActuatorHardening, DriveAsymmetry, DriveSite
from vjm_updating.mechanisms.effect import part_table
from vjm_updating.mechanisms.hysteresis import Creep
from vjm_updating.mechanisms.loads import Gravity, LoadMisalignment
from vjm_updating.mechanisms.structure import (
    BaseCompliance,
    FootCompliance,
    FootLumping,
    LinkBow,
    LinkLength,
    LinkLumping,
)
from vjm_validation.cli.main import run


class OnlyForward:
    """As much of a fitter as an extended file needs."""

    def __init__(self, forward):
        self.forward = forward


@pytest.fixture
def fitted(make, tmp_path, monkeypatch):
    """A hypothesis with the sheet's nuisances at one sigma of the machine's own, not fitted but given."""

    def given(hypothesis, values, segments=12):
        rows = make.load_case(("A", "B", "D"), 1.5, 4)
        sheet = make.SHEET.replace("link_segments = 4", f"link_segments = {segments}")
        monkeypatch.setattr(reading, "check_units", lambda *args: None)
        files = make.write(tmp_path / "test", rows, np.ones((len(rows), 6)), [row[3] for row in rows], sheet=sheet)
        measurement = reading.read_measurement(files.data, files.sheet)
        forward = Forward(observe_ramps(measurement))
        found = coordinates(nuisance_coordinates(forward.observed), hypothesis)
        nuisances = np.array([float(c.kind in ("modulus", "length")) for c in found if c.kind != "effect"])
        z = start(found, hypothesis, nuisances, values)
        at = forward.evaluate(found, z, hypothesis)
        return (
            measurement,
            OnlyForward(forward),
            Fit(hypothesis, tuple(found), at, np.zeros((0, 0, 0)), 0.0, converged=True),
        )

    return given


def curve(model: Path, posture: str, to: float, *options: str) -> tuple[np.ndarray, np.ndarray]:
    """Shift ``(k,)`` and force ``(k, 3)`` of `validate curve`."""
    out = model.with_name("curve.csv")
    status = run(["curve", str(model), f"--posture={posture}", f"--to={to}", f"--csv={out}", *options])
    assert status == 0
    lines = [line for line in out.read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    force = np.array([[float(row[f"f{a}_N"]) for a in "xyz"] for row in rows])
    shift = np.array([[float(row[f"u{a}_mm"]) for a in "xyz"] for row in rows])
    return np.linalg.norm(shift, axis=1), force


DRIVE = DriveSite(force=8000.0)
CASES = {
    "bow": ((LinkBow(),), [(0.3, -0.9)], 12, ()),
    "base": ((BaseCompliance(),), [(3e-5, 2.0, 0.5, 1e-3, 1.0, 1.0)], 12, ()),
    "base that turns": ((BaseCompliance(),), [(1e-5, 2.0, 0.5, 6.0, 1.5, 0.7)], 12, ()),
    "lumping": ((LinkLumping(), FootLumping()), [(), ()], 1, ()),
    "one spring": ((), [], 1, ()),
    "drive, length and foot": (
        (ActuatorCompliance(), LinkLength(), FootCompliance()),
        [(4e-5,), (1.0,), (1.1,)],
        12,
        (),
    ),
    "weight": ((Gravity(),), [(1.5,)], 12, ("--gravity=0,0,-9.80665",)),
    "weight of foot and bar": ((Gravity(foot=0.3),), [(1.5, 0.2)], 12, ("--gravity=0,0,-9.80665",)),
    "tilt": ((LoadMisalignment(),), [(0.05, -0.02)], 12, ("--axis",)),
    "a drive that stiffens": ((ActuatorHardening(force=8000.0, drive=DRIVE),), [(3.0, 2e-5, 1.5)], 12, ()),
    "backlash in a soft drive": (
        (ActuatorCompliance(), ActuatorBacklash(force=8000.0, drive=DRIVE)),
        [(2e-5,), (0.08, 0.0, 300.0, 0.2)],
        12,
        (),
    ),
    "a drive softer in push": ((DriveAsymmetry(drive=DRIVE),), [(2.0, 3e-5)], 12, ()),
    "a contact in the drive": ((ContactCompliance(force=8000.0),), [(0.02, 0.6)], 12, ()),
    "bow on a base": ((LinkBow(), BaseCompliance()), [(-1.5, 0.2), (2e-5, 1.0, 1.0, 1.0, 1.0, 1.0)], 12, ()),
}


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("case", CASES)
def test_a_command_predicts_what_the_diagnosis_did(fitted, tmp_path, case):
    hypothesis, values, segments, options = CASES[case]
    measurement, fitter, fit = fitted(hypothesis, values, segments)
    text = extended_text(measurement, fitter, fit, "named", {})
    model = tmp_path / FILE
    model.write_text(text)
    if "--axis" in options:
        axis = next(line for line in text.splitlines() if "--axis" in line).split("--axis ")[1].rstrip(".")
        options = (f"--axis={axis}",)
    observed = fitter.forward.observed
    for posture in "ABD":
        for sign in (1.0, -1.0):
            s, force = curve(model, posture, sign * 1.7, *options)
            # displacements as imposed, before a tilt
            u = np.abs(observed.imposed[:, 0])
            true = np.linalg.norm(fit.evaluation.place[:, :3], axis=1)
            on = (observed.readings.posture == posture) & (sign * observed.imposed[:, 0] > 0.0) & (u < 1.6)
            for k in range(3):
                there = np.interp(true[on], s, force[:, k])
                size = np.abs(fit.evaluation.prediction[on, :3]).max()
                # tables, series elements and a curve's own steps are each interpolated to 1e-4 or better; a bow
                # shortens the chord, from whose end the pose counts, by 0.003 mm
                assert np.abs(there - fit.evaluation.prediction[on, k]).max() < 5e-4 * size, (posture, sign, k)


def next_test(make, fitted, folder, case, *, noisy=False):
    """A test by the extended model of a case: its files, and what the diagnosis predicts there."""
    hypothesis, values, segments, _ = CASES[case]
    measurement, fitter, fit = fitted(hypothesis, values, segments)
    wrench = fit.evaluation.prediction
    if noisy:
        sigma = dict(make.NOISE.values())
        own = [sigma.get(k, 0.0) for k in range(6)]
        wrench = wrench + np.random.default_rng(3).standard_normal(wrench.shape) * own
    rows = make.load_case(("A", "B", "D"), 1.5, 4)
    sheet = make.SHEET.replace("link_segments = 4", f"link_segments = {segments}")
    sheet = sheet.replace('"orthoglide-chain"', f'"{FILE}"')
    files = make.write(folder, rows, wrench, [row[3] for row in rows], sheet=sheet)
    (folder / FILE).write_text(extended_text(measurement, fitter, fit, "named", {}))
    return files, fit.evaluation.prediction


WITH_LAWS = (
    "a drive that stiffens",
    "backlash in a soft drive",
    "a drive softer in push",
    "a contact in the drive",
)


@pytest.mark.parametrize("case", WITH_LAWS)
def test_a_next_test_by_the_extended_model_is_predicted_alike(make, fitted, tmp_path, case):
    files, expected = next_test(make, fitted, tmp_path / "next", case)
    measurement = reading.read_measurement(files.data, files.sheet)
    assert len(measurement.chain.laws) == 1
    forward = Forward(observe_ramps(measurement))
    found = coordinates(nuisance_coordinates(forward.observed), ())
    predicted = forward.evaluate(found, start(found, (), np.zeros(len(found)), []), ()).prediction
    # the law is a table that misses 1e-5 of its range, and both tables of paths err by 1e-4 at most
    assert np.abs(predicted - expected)[:, :3].max() < 5e-4 * np.abs(expected[:, :3]).max()


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("case", WITH_LAWS)
def test_nothing_is_left_of_a_next_test_by_the_extended_model(make, fitted, tmp_path, case):
    files, _ = next_test(make, fitted, tmp_path / "next", case, noisy=True)
    assert run(["diagnose", str(files.data), f"--sheet={files.sheet}", f"--out={tmp_path / 'out'}"]) == 0
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text())["verdict"] == "none"


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("case", WITH_LAWS)
def test_a_law_is_calibrated_as_a_whole(make, fitted, tmp_path, case):
    files, _ = next_test(make, fitted, tmp_path / "next", case, noisy=True)
    # the drive of the file is stiffer than that of the test by a tenth
    model = files.sheet.with_name(FILE)
    chain = load_chain(model)
    ((_, law),) = chain.laws
    document = tomllib.loads(model.read_text())
    part_table(document, "actuator")["law"] = law.softer(0.9).table(slides=True)
    model.write_text(toml_text(document))
    assert run(["calibrate", str(files.data), f"--sheet={files.sheet}", f"--out={tmp_path / 'out'}"]) == 0
    rows = {
        row["name"]: row for row in json.loads((tmp_path / "out" / "calibration.json").read_text())["parameters"]
    }
    row = rows["actuator.compliance"]
    # four standard deviations: one of four cases in 4,000 tests
    assert abs(row["value"] - 1.0 / law.largest_stiffness) < 4.0 * row["std"]
    ((_, written),) = load_chain(tmp_path / "out" / "calibrated-model.toml").laws
    assert 1.0 / written.largest_stiffness == pytest.approx(row["value"], rel=1e-6)
    assert written.deflection(500.0) == pytest.approx(
        row["over_nominal"] * law.softer(0.9).deflection(500.0), rel=1e-6
    )


@pytest.mark.parametrize("case", ["bow", "base", "lumping"])
def test_its_critical_force_is_predicted_anew(fitted, tmp_path, case):
    hypothesis, values, segments, _ = CASES[case]
    measurement, fitter, fit = fitted(hypothesis, values, segments)
    model = tmp_path / FILE
    model.write_text(extended_text(measurement, fitter, fit, "named", {}))
    found = {}
    for name in (str(model), "orthoglide-chain"):
        chain = json_of("buckling", name, "--posture", "A", "--direction", "-")["chain"]
        (found[name],) = chain["A"]["compression"].values()
    critical, nominal = found[str(model)], found["orthoglide-chain"]
    assert (nominal["critical"], nominal["F_cr"]) == ("bifurcation", pytest.approx(8849.0, rel=1e-4))
    # the nuisances at one sigma: EI 2 % up, a bar longer by 0.2 mm; a base does not change Euler's load
    euler = 1.02 * (310.0 / 310.2) ** 2 * nominal["F_cr"]
    if case == "bow":
        # a bowed bar bends from the start: what was a bifurcation is a stiffness knee below it
        assert critical["critical"] == "stiffness-knee"
        assert 0.85 * euler < critical["F_cr"] < euler
    else:
        assert critical["critical"] == "bifurcation"
        # the slanted foot turns under the load, and the bar is shortened by it: 2e-4
        assert critical["F_cr"] == pytest.approx(euler, rel=1e-3)


@pytest.mark.slow
def test_calibrate_takes_it(make, fitted, tmp_path):
    measurement, fitter, fit = fitted((LinkBow(),), [(0.3, -0.9)])
    (tmp_path / FILE).write_text(extended_text(measurement, fitter, fit, "named", {}))
    rng = np.random.default_rng(3)
    rows = make.load_case(("A", "B"), 1.5, 6)
    u = np.array([row[3] for row in rows])
    wrench = np.zeros((len(rows), 6))
    for posture in "AB":
        for sign in (1.0, -1.0):
            s, force = curve(tmp_path / FILE, posture, sign * 1.7)
            on = np.array([row[1] == posture for row in rows]) & (sign * u >= 0.0)
            for k in range(3):
                wrench[on, k] = np.interp(np.abs(u[on]), s, force[:, k])
    wrench[:, 0] += 2.0 * rng.standard_normal(len(rows))
    sheet = make.SHEET.replace("link_segments = 4\n", "").replace('"orthoglide-chain"', f'"{FILE}"')
    before, _, behind = sheet.partition("[instrument.mz_Nmm]")
    sheet = before + "[tolerance]" + behind.partition("[tolerance]")[2]
    files = make.write(tmp_path, rows, wrench, u, sheet)
    lines = files.data.read_text().splitlines()
    # the force alone was made up
    files.data.write_text("\n".join(line.rsplit(",", 2)[0] for line in lines) + "\n")
    validate("calibrate", files.data, f"--sheet={files.sheet}", f"--out={tmp_path / 'out'}")
    found = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert found["model"] == "orthoglide-chain"
    # the bowed machine of the file explains its own curves to the noise that was added, 2 N
    assert found["fit"]["fits"]
    assert found["fit"]["channels"][0]["rmse_nominal"] < 2.5
    again = load_chain(tmp_path / "out" / "calibrated-model.toml")
    assert again.link_segments == 12
    assert np.allclose(next(b for b in again.beams if b.name == "link").bow, (0.3, -0.9))


def test_a_law_of_the_history_is_named_and_kept_out(fitted):
    measurement, fitter, fit = fitted((Creep(part="foot"),), [(0.02, 60.0, 0.25, 10.0)])
    text = extended_text(measurement, fitter, fit, "named", {})
    assert "# creep.foot: not in the numbers below" in text
    document = extended_document(measurement, fitter, fit)
    assert build_chain(document, FILE).link_segments == 12


@pytest.mark.parametrize(
    ("hypothesis", "values", "said", "has_law"),
    [
        ((ActuatorCompliance(),), [(2e-5,)], "actuator_compliance: in the drive's compliance", False),
        ((ActuatorBacklash(drive=DRIVE),), [(0.08, 0.0, 300.0, 0.2)], "actuator_backlash: in the law of", True),
        # ends that do not yield: in a drive without a spring the travel stops
        ((ActuatorBacklash(drive=DRIVE),), [(0.08, 0.0, 100.0, 0.0)], "stops at an end that no law has", False),
    ],
    ids=["a compliance", "a travel", "a travel with rigid ends"],
)
def test_where_a_drive_has_what_was_found(fitted, hypothesis, values, said, has_law):
    measurement, fitter, fit = fitted(hypothesis, values)
    assert said in extended_text(measurement, fitter, fit, "named", {})
    drive = part_table(extended_document(measurement, fitter, fit), "actuator")
    assert ("law" in drive) == has_law
    # what takes the place of a number goes without it
    assert ("compliance_mm_per_N" in drive) != has_law


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "cause"),
    [({"link_bow": (1.2, 0.1)}, "link_bow"), ({"base_compliance": (4e-5, 3.0, 3.0)}, "base_compliance")],
)
def test_from_data_to_the_extended_curve(make, tmp_path, monkeypatch, hidden, cause):
    files = make.made_up(tmp_path / "test", hidden, 7, monkeypatch)
    out = tmp_path / "out"
    validate("diagnose", files.data, f"--sheet={files.sheet}", f"--out={out}", "--json")
    found = json.loads((out / "diagnosis.json").read_text())
    assert cause in found["candidates"][0]["causes"]
    error = {name: found["nuisances"].get(name, {"value": 0.0})["value"] for name in (
        "zero ux_mm", "scale ux_mm", "zero fx_N", "scale fx_N")}  # fmt: skip
    lines = csv.DictReader(files.data.read_text().splitlines())
    rows = [(row["posture"], float(row["ux_mm"]), float(row["fx_N"])) for row in lines]
    left = []
    for posture in "AB":
        for sign in (1.0, -1.0):
            s, force = curve(out / FILE, posture, sign * 1.7)
            for u, f in ((u, f) for p, u, f in rows if p == posture and sign * u > 0.0):
                true = (u - error["zero ux_mm"]) / (1.0 + error["scale ux_mm"])
                there = np.interp(abs(true), s, force[:, 0])
                left.append(f - (1.0 + error["scale fx_N"]) * there - error["zero fx_N"])
    # 2 N of the cell and 0.001 mm of the gauge at some 3000 N/mm; two outliers
    assert np.sqrt(np.median(np.square(left))) / 0.6745 < 1.3 * np.hypot(2.0, 3.3)


def test_a_displacement_turned_a_little_needs_no_tables_of_its_own(fitted):
    _, fitter, fit = fitted((LoadMisalignment(),), [(0.03, -0.02)])
    z = fit.evaluation.z.copy()
    tilt = next(i for i, c in enumerate(fit.parameters) if c.kind == "effect")

    def error(step):
        z[tilt] = fit.evaluation.z[tilt] + step
        own = fitter.forward.evaluate(fit.parameters, z, fit.hypothesis)
        beside = fitter.forward.evaluate(fit.parameters, z, fit.hypothesis, fit.evaluation.z)
        change = np.abs(own.residual - fit.evaluation.residual).max()
        return np.abs(beside.residual - own.residual).max() / change

    # the error is of second order: a quarter of the step, a quarter of the relative error
    assert error(1.6) < 0.02
    assert error(0.4) < 0.4 * error(1.6)
