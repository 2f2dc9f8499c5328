"""Tests of one joint: what was put in by other laws is found, within its interval."""

import csv
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from helpers.command import validate
from helpers.from_files import CALIBRATED as MODEL
from helpers.from_files import CALIBRATION as DOCUMENT
from helpers.from_files import calibrate as calibrate_joint
from helpers.from_files import diagnose
from helpers.joint_rig import SHEET, Joint, write
from scipy.optimize import brentq

from vjm.io.findings import Grade, ImplausibleError
from vjm.io.model_file import load_chain
from vjm_updating.calibration.joint import JointSolution
from vjm_updating.calibration.run import fit_row
from vjm_updating.diagnosis.kinds import JointTest, joint_effects
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.summary_text import lines
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.plausibility import considered
from vjm_updating.inference.joint_forward import JointHardening
from vjm_updating.inference.observed import observe_joint
from vjm_updating.inference.parameters import coordinates, of_effect, start
from vjm_updating.mechanisms.contacts import ActuatorBacklash
from vjm_updating.mechanisms.history_kernels import hardening_deflections

CUBIC = 7e6 / 0.005**2
ALL = Joint(stiffness=7e6, cubic=CUBIC, gap=3e-4, friction=2500.0)
STANDARD_ERRORS = 3.5
"""One in two thousand lies further off: of the dozen numbers that are asked, with a fixed seed, none does."""


def by_name(document):
    return {row.name.removeprefix("elbow."): row for row in document.parameters}


def tangent_ratio(joint, torque):
    """Of the spring at the end of the test to that at no load."""
    wound = abs(joint.angle(torque)) - 0.5 * joint.gap
    return 1.0 + 3.0 * joint.cubic * wound**2 / joint.stiffness


@pytest.mark.parametrize(
    "joint",
    [
        pytest.param(Joint(), marks=pytest.mark.slow),
        Joint(stiffness=2e7),
        pytest.param(Joint(friction=3000.0), marks=pytest.mark.slow),
        pytest.param(Joint(gap=4e-4), marks=pytest.mark.slow),
        pytest.param(Joint(cubic=2e11), marks=pytest.mark.slow),
        pytest.param(ALL, marks=pytest.mark.slow),
    ],
    ids=["as drawn", "stiffer", "friction", "backlash", "cubic spring", "all"],
)
def test_a_calibration_finds_what_the_joint_has(tmp_path, joint):
    document = calibrate_joint(*write(tmp_path, joint, 3), tmp_path / "out")
    assert document.fit.fits
    rows = by_name(document)
    truth = {
        "stiffness": joint.stiffness,
        # the largest load that was read has friction in it
        "stiffness_ratio": tangent_ratio(joint, 5e4 + joint.friction),
        "backlash": joint.gap,
        "friction": joint.friction,
    }
    for name, value in truth.items():
        row = rows[name]
        assert abs(row.value - value) < STANDARD_ERRORS * row.std, name
        # a size that is not there is not found
        assert value or row.interval95[0] == 0.0


def test_hard_ends_of_a_backlash_do_not_hide_how_readings_change(tmp_path):
    """Slopes against differences of the prediction itself, where the ends of a backlash are met within 15 N mm."""
    observed = observe_joint(read_measurement(*write(tmp_path, Joint(gap=4e-4), 3)))
    fitter = prepare(observed).fitter
    effects = tuple(e for e in joint_effects(observed) if isinstance(e, JointHardening | ActuatorBacklash))
    found = coordinates(fitter.nuisances, effects)
    values = [[1.001, 1.0e-7, 2.0, 0.5], [4e-4, -0.1, 15.0, 0.0]]
    z = start(found, effects, np.zeros(len(fitter.nuisances)), values)
    at = fitter.evaluate(found, z, effects)
    slopes = fitter.slopes(found, at, effects)
    for i in of_effect(found, 0)[:2] + of_effect(found, 1)[:1]:
        step = 1e-4 * np.eye(len(z))[i]
        ends = [fitter.evaluate(found, z + sign * step, effects).residual for sign in (1.0, -1.0)]
        wanted = (ends[0] - ends[1]) / 2e-4
        # reason: the slope is that over 3 % of a coordinate, the difference over 0.01 %
        np.testing.assert_allclose(slopes[:, :, i], wanted, atol=0.05 * np.abs(wanted).max())


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_loads_to_one_side_do_not_know_backlash(tmp_path, turn):
    """Friction turns the load's sign on the way back; that is no load to the other side."""
    data, sheet = write(tmp_path, Joint(friction=3000.0), 3)
    head, *rows = data.read_text().splitlines()
    kept = [row for row in rows if turn * float(row.split(",")[2]) > 0.0]
    assert min(turn * float(row.split(",")[3]) for row in kept) < -5.0 * np.hypot(60.0, 100.0)
    data.write_text("\n".join([head, *kept]) + "\n")
    document = calibrate_joint(data, sheet, tmp_path / "out")
    rows = by_name(document)
    assert "backlash" not in rows
    for name, value in (("stiffness", 1e7), ("friction", 3000.0)):
        assert abs(rows[name].value - value) < STANDARD_ERRORS * rows[name].std, name
    assert "its backlash they cannot know" in document.identifiability.statement[0]
    # what both commands say and keep
    (note,) = considered(read_measurement(data, sheet))
    assert "loaded to one side only" in str(note)
    assert document.doubts[0].found == note.description
    assert not any(
        isinstance(e, ActuatorBacklash) for e in JointTest().effects(observe_joint(read_measurement(data, sheet)))
    )


def test_an_outlier_is_told_over_the_noise_of_load_and_motion(tmp_path):
    data, sheet = write(tmp_path, Joint(), 3)
    head, *rows = data.read_text().splitlines()
    spoilt = rows[30].split(",")
    rows[30] = ",".join([*spoilt[:3], str(float(spoilt[3]) + 6000.0)])
    data.write_text("\n".join([head, *rows]) + "\n")
    prepared = prepare(observe_joint(read_measurement(data, sheet)))
    fitter, null = prepared.fitter, prepared.null
    # the joint as drawn, no error of an instrument
    as_drawn = replace(null, evaluation=fitter.evaluate(null.parameters, np.zeros(len(null.parameters)), ()))
    found = JointSolution(prepared.all, fitter.forward.reading(prepared.all), fitter, as_drawn)
    angle, torque = np.array([[float(v) for v in row.split(",")[2:]] for row in rows]).T
    # 1e7 N mm/rad; the sheet's noise of both, and the file's rounding to 1e-7 rad
    noise = np.sqrt(60.0**2 + (1e7 * 2e-6) ** 2 + (1e7 * 1e-7) ** 2 / 12.0)
    expected = (torque - 1e7 * angle) / noise
    # its rounding to 0.1 N mm is a ten-millionth of that
    assert found.noises[:, 0] == pytest.approx(expected, rel=1e-6)
    said = {row.row: row.in_sigma for row in fit_row(found).outliers}
    assert said[int(prepared.all.readings.row[30])] == pytest.approx(expected[30])
    assert expected[30] > 60.0


@pytest.mark.slow
def test_a_stiffness_is_known_no_better_than_the_cell(tmp_path):
    """The sheet's scale errors of cell and gauge, 0.5 and 0.05 %, and hardly anything else: 200 readings."""
    row = by_name(calibrate_joint(*write(tmp_path, Joint(), 5), tmp_path / "out"))["stiffness"]
    # reason: readings add a tenth of that in quadrature
    assert row.std / row.value == pytest.approx(np.hypot(0.005, 0.0005), rel=0.1)


@pytest.mark.slow
def test_a_cell_that_is_off_is_in_the_interval(tmp_path):
    """A cell two of its own sigma off: stiffness and cell cannot be told apart, and the interval says so."""
    row = by_name(calibrate_joint(*write(tmp_path, Joint(scale=0.01), 6), tmp_path / "out"))["stiffness"]
    assert abs(row.value - 1e7) < STANDARD_ERRORS * row.std


@pytest.mark.parametrize(
    "joint",
    [
        Joint(stiffness=8e6, gap=4e-4),
        pytest.param(Joint(cubic=2e11), marks=pytest.mark.slow),
        pytest.param(ALL, marks=pytest.mark.slow),
    ],
    ids=["backlash", "cubic spring", "all"],
)
@pytest.mark.parametrize("command", [pytest.param(diagnose, marks=pytest.mark.slow), calibrate_joint])
def test_the_model_file_turns_as_the_joint_does(tmp_path, joint, command):
    """By the law of the file under loads, within twice the cell's scale, 0.5 %, and the gauge's noise."""
    command(*write(tmp_path, joint, 3), tmp_path / "out")
    (model,) = (tmp_path / "out").glob("*.toml")
    (elbow,) = load_chain(model).moving
    loads = np.array([-5e4, -2e4, -5e3, 5e3, 2e4, 5e4])
    turned = np.array([elbow.law.deflection(load) for load in loads])
    true = np.array([joint.angle(load) for load in loads])
    off = 2.0 * np.hypot(0.005 * np.abs(true), 2e-6)
    assert (np.abs(turned - true) < off).all()
    # the model that was measured is not that near
    assert (np.abs(1e-7 * loads - true) > 2.0 * off).any()


@pytest.mark.slow
def test_a_straight_spring_stays_a_number(tmp_path):
    document = calibrate_joint(*write(tmp_path, Joint(friction=2500.0), 3), tmp_path / "out")
    text = (tmp_path / "out" / MODEL).read_text()
    (elbow,) = (part for part in tomllib.loads(text)["parts"] if part["name"] == "elbow")
    assert "law" not in elbow
    assert 1.0 / elbow["compliance_rad_per_Nmm"] == pytest.approx(by_name(document)["stiffness"].value, rel=1e-9)
    assert re.search("elbow.friction.*: not in the numbers below", text)
    assert (tmp_path / "out" / DOCUMENT).is_file()


@pytest.mark.slow
def test_a_lever_reads_the_same(tmp_path):
    """A force on an arm of 250 mm and a gauge at 400 mm, in the place of torque and angle."""
    data, sheet = write(tmp_path, ALL, 3)
    here = by_name(calibrate_joint(data, sheet, tmp_path / "out"))
    with data.open(newline="") as file:
        rows = list(csv.DictReader(file))
    lines = ["time_s,run,deflection_mm,force_N"]
    lines += [
        f"{r['time_s']},{r['run']},{400.0 * float(r['angle_rad']):.9g},{float(r['torque_Nmm']) / 250.0:.9g}"
        for r in rows
    ]
    data.write_text("\n".join(lines) + "\n")
    text = SHEET.replace(
        "[instrument.angle_rad]\nnoise = 2e-6\nzero = 2e-5", "[instrument.deflection_mm]\nnoise = 8e-4\nzero = 8e-3"
    )
    text = text.replace(
        "[instrument.torque_Nmm]\nnoise = 60.0\nzero = 100.0", "[instrument.force_N]\nnoise = 0.24\nzero = 0.4"
    )
    sheet.write_text(text + "\n[lever]\nforce_mm = 250.0\ngauge_mm = 400.0\n")
    there = by_name(calibrate_joint(data, sheet, tmp_path / "there"))
    for name, row in here.items():
        # reason: the same readings in other units but for the rounding of the file, under the same search
        assert there[name].value == pytest.approx(row.value, rel=1e-3, abs=0.05 * row.std), name


@pytest.mark.parametrize(
    ("joint", "causes"),
    [
        (Joint(), []),
        (Joint(friction=3000.0), ["joint_friction"]),
        pytest.param(Joint(gap=4e-4), ["actuator_backlash"], marks=pytest.mark.slow),
        pytest.param(Joint(cubic=2e11), ["actuator_hardening"], marks=pytest.mark.slow),
        pytest.param(ALL, ["actuator_backlash", "actuator_hardening", "joint_friction"], marks=pytest.mark.slow),
    ],
    ids=["nothing", "friction", "backlash", "hardening", "three"],
)
def test_a_diagnosis_names_what_was_hidden(tmp_path, joint, causes):
    document = diagnose(*write(tmp_path, joint, 3), tmp_path / "out")
    assert document.verdict == ("named" if causes else "none")
    assert document.causes == causes


@pytest.mark.parametrize(
    "elastic", [5e-6, *(pytest.param(one, marks=pytest.mark.slow) for one in (5e-7, 5e-5, 4e-4))]
)
def test_an_interval_of_presliding_is_told_only_where_readings_have_it(tmp_path, elastic):
    """They lie 2e-4 rad apart: after a reversal a joint that slips within that has slipped at the next reading."""
    files = write(tmp_path, Joint(friction=3000.0, presliding=elastic), 5)
    document = diagnose(*files, tmp_path / "out", page=True)
    assert (document.verdict, document.causes) == ("named", ["joint_friction"])
    row = document.parameters["joint_friction.presliding_rad"]
    low, high = row.interval95
    words = f"joint_friction.presliding_rad = below {high:.3g}"
    if elastic > 1e-4:
        assert row.limits == "both"
        assert abs(row.value - elastic) < STANDARD_ERRORS * row.std
        assert high < 1.1 * low
    else:
        assert row.limits == "upper"
        assert elastic < high < 2e-4
        assert (
            f'<td class="name" colspan="3">below {high:.3g}</td>' in (tmp_path / "out/diagnosis.html").read_text()
        )
    assert (words in [line.strip() for line in lines(document)]) == (elastic < 1e-4)


@pytest.mark.parametrize("seed", [2, 3, 7])
def test_an_interval_of_presliding_goes_to_where_readings_are_silent(tmp_path, seed):
    """Readings lie 8e-5 rad apart: a presliding of half that goes with all else, and a shorter one with nothing."""
    elastic = 5e-7
    files = write(tmp_path, Joint(friction=400.0, presliding=elastic), seed, torque=2e4)
    row = diagnose(*files, tmp_path / "out").parameters["joint_friction.presliding_rad"]
    assert row.limits == "upper"
    assert row.interval95[0] < elastic < row.interval95[1] < 8e-5


def in_unit(data, factor):
    """The torques of a file over a factor."""
    head, *rows = data.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    data.write_text("\n".join([head, *(f"{t},{r},{a},{float(m) / factor:.9g}" for t, r, a, m in cells)]) + "\n")


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (4.4482216152605, "forces in lbf"),
        (4.4482216152605 * 25.4, "torques in lbf in"),
        (98.0665, "torques in kgf cm"),
        (9806.65, "torques in kgf m"),
    ],
)
def test_torques_in_another_unit_are_refused(tmp_path, factor, words):
    """With friction and backlash: half a percent and six of the largest torque and turn."""
    data, sheet = write(tmp_path, Joint(gap=3e-4, friction=300.0), 3)
    assert considered(read_measurement(data, sheet)) == []
    in_unit(data, factor)
    with pytest.raises(ImplausibleError, match=f"readings.csv: .*{words}.* Convert"):
        calibrate_joint(data, sheet, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_diagnosis_names_the_unit_and_nothing_else(tmp_path):
    data, sheet = write(tmp_path, Joint(), 3)
    in_unit(data, 98.0665)
    document = diagnose(data, sheet, tmp_path / "out")
    assert (document.verdict, document.causes) == ("named", ["instrument_unit"])
    assert document.parameters["instrument_unit.torque_Nmm"].value == pytest.approx(98.0665, rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_torques_in_pounds_of_a_few_sigma_are_said_undecided(tmp_path, seed):
    data, sheet = write(tmp_path, Joint(), seed, torque=400.0)
    assert not [one for one in considered(read_measurement(data, sheet)) if "lbf" in str(one)]
    in_unit(data, 4.4482216152605)
    # the cell's noise is that of the sheet, in whatever unit it is written
    rng = np.random.default_rng(seed)
    head, *rows = data.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    noisy = (f"{t},{r},{a},{float(m) + 60.0 * rng.standard_normal():.9g}" for t, r, a, m in cells)
    data.write_text("\n".join([head, *noisy]) + "\n")
    said = [str(one) for one in considered(read_measurement(data, sheet)) if one.grade is Grade.DOUBTFUL]
    # that the noise is large beside all that was read is said, too
    assert sum("forces in lbf" in one and "too few or too small to tell" in one for one in said) == 1


@pytest.mark.slow
@pytest.mark.parametrize("sigmas", [20.0, 40.0])
def test_a_cell_far_off_its_sheet_is_less_likely_than_another_stiffness(tmp_path, sigmas):
    """A tenth on the cell is 20 of the sheet's sigma, and no reading tells it from a tenth on the stiffness."""
    document = diagnose(*write(tmp_path, Joint(scale=0.005 * sigmas), 3), tmp_path / "out")
    assert document.causes == ["actuator_compliance"]
    scales = [row.probability for row in document.findings.causes if row.cause == "instrument_scale"]
    # reason: the density of its error falls as 1 / (1 + k²); a factor of two for what else both cost
    assert sum(scales) < 2.0 / (1.0 + sigmas**2)


@pytest.mark.parametrize("ratio", [0.3, 1.0, 3.0, 15.0])
def test_the_wound_up_spring_bears_its_load(ratio):
    """Against the law solved by bracketing; both are exact to rounding."""
    loads = np.array([-1.0, -0.3, 0.0, 0.05, 0.5, 1.0])
    found, slope = hardening_deflections(loads, ratio, 2.0)
    a = (ratio - 1.0) / 3.0
    end = 1.0 / (1.0 + a)
    wanted = [
        np.sign(N) * brentq(lambda x, N=N: x * (1.0 + a * (x / end) ** 2) - abs(N), 0.0, 1.01 * end, xtol=1e-15)
        for N in loads
    ]
    np.testing.assert_allclose(found, wanted, atol=1e-12)
    assert slope[2] == pytest.approx(1.0)
    assert slope[-1] == pytest.approx(1.0 / ratio, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ('joint = "elbow"', 'joint = "wrist"'),
            "no actuated, coupled or sprung joint 'wrist' in wrist; there are elbow",
        ),
        (('kind = "joint"\n', ""), "go together: give both or none"),
        (("[instrument.torque_Nmm]", "[instrument.fx_N]"), "is no channel of a test of one joint"),
    ],
)
def test_a_wrong_sheet_is_refused_in_one_line(tmp_path, change, words):
    data, sheet = write(tmp_path, Joint(), 3)
    sheet.write_text(sheet.read_text().replace(*change))
    with pytest.raises(ValueError, match=words) as caught:
        read_measurement(data, sheet)
    assert "\n" not in str(caught.value)


def test_effects_of_a_chain_are_refused(tmp_path):
    data, sheet = write(tmp_path, Joint(), 3)
    (tmp_path / "mine.py").write_text("def effects(scene):\n    return []\n")
    own, out = tmp_path / "mine.py", tmp_path / "out"
    said = validate("diagnose", data, "--sheet", sheet, "--effects", own, "--out", out, status=2).err.splitlines()
    assert said[-1].endswith("--effects is for ramps and loads, and this is a test of a joint")
    assert not out.exists()


def test_torques_of_a_wrong_scale_are_told_as_a_number(tmp_path):
    """Twenty times too large: grams would make a fifth of it, and no other unit is nearer."""
    data, sheet = write(tmp_path, Joint(), 3)
    in_unit(data, 1.0 / 20.0)
    (said,) = [str(one) for one in considered(read_measurement(data, sheet))]
    told = re.search(r"loads are (\S+) times what the model predicts, and no unit", said)
    # readings follow the model but for the cell's noise and scale, a percent
    assert float(told[1]) == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize(("factor", "words"), [(-1.0, "the other sign"), (1e-3, "a factor 1000")])
def test_torques_in_other_units_are_refused(tmp_path, factor, words):
    data, sheet = write(tmp_path, Joint(), 3)
    head, *rows = data.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    data.write_text("\n".join([head, *(",".join([*c[:3], f"{factor * float(c[3]):.6g}"]) for c in cells)]) + "\n")
    with pytest.raises(ImplausibleError, match=words):
        considered(read_measurement(data, sheet))


def test_an_angle_in_degrees_is_no_finding_about_the_joint(tmp_path):
    """57 times softer, which a calibration would fit: nothing is named and no model written."""
    data, sheet = write(tmp_path, Joint(), 3)
    head, *rows = data.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    turned = (",".join([*c[:2], f"{np.degrees(float(c[2])):.9g}", c[3]]) for c in cells)
    data.write_text("\n".join([head, *turned]) + "\n")
    for command in (calibrate_joint, diagnose):
        with pytest.raises(ImplausibleError, match=r"is the angle in degrees\? Convert it to rad"):
            command(data, sheet, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    # a joint that is that soft by its model is as good as any
    model = tmp_path / "wrist.toml"
    softer = f"compliance_rad_per_Nmm = {np.degrees(1e-7):.6g}"
    model.write_text(model.read_text().replace("compliance_rad_per_Nmm = 1e-7", softer))
    assert not considered(read_measurement(data, sheet))


def test_a_lever_must_be_known(tmp_path):
    data, sheet = write(tmp_path, Joint(), 3)
    data.write_text(data.read_text().replace("torque_Nmm", "force_N"))
    sheet.write_text(sheet.read_text().replace("torque_Nmm", "force_N"))
    with pytest.raises(ValueError, match=r"add \[lever\] force_mm"):
        read_measurement(data, sheet)
