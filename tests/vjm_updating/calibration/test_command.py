"""``validate calibrate`` as a user meets it: what it writes, and what it refuses, with one line and status 2."""

import json
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from helpers.command import GAUGE_SHEET, json_of, refused, validate
from helpers.from_files import CALIBRATED as MODEL
from helpers.from_files import CALIBRATION as DOCUMENT
from helpers.from_files import CALIBRATION_PAGE as PAGE
from helpers.spoilt_tables import Spoil, Table, cell, column, keep, swapped, without

from vjm.io.model_file import build_chain, load_chain
from vjm.model.load_case import LoadCase
from vjm.model.parts import Beam, Joint
from vjm_updating.calibration.calibrated_model import calibrated_text
from vjm_updating.calibration.document import Calibration, fit_report
from vjm_updating.calibration.fit import problem_of
from vjm_validation.schemas import schemas

from . import synthetic
from .conftest import ENGINE, RAMPS, TRUTH, Make

HEADER = ("time_s", "posture", "run", "ux_mm", *synthetic.COLUMNS)
NAMES = tuple(TRUTH)


@pytest.fixture
def files(tmp_path: Path) -> synthetic.Files:
    trace = synthetic.of_model(synthetic.changed(TRUTH, ENGINE), ENGINE)
    rows = synthetic.readings(trace, RAMPS, 12, np.random.default_rng(11))
    whole = [{"time_s": float(k), "run": "1"} | row for k, row in enumerate(rows)]
    whole = [{name: row[name] for name in HEADER} for row in whole]
    return synthetic.write(tmp_path, whole, synthetic.sheet_text(foot=1, link=4))


def command(files: synthetic.Files, *more: str) -> list[str]:
    out = files.data.parent / "out"
    return ["calibrate", str(files.data), "--sheet", str(files.sheet), "--out", str(out), *more]


def test_the_command_writes_three_files(files):
    options = ("--fit", *NAMES, "--next", "D:-6", "A:y:1", "--figure", "C:compression:F_cr")
    printed = validate(*command(files, *options)).out
    out = files.data.parent / "out"
    assert {path.name for path in out.iterdir()} == {DOCUMENT, MODEL, PAGE}
    document = json.loads((out / DOCUMENT).read_text())
    jsonschema.validate(document, schemas()["calibration.schema.json"])
    assert [row["name"] for row in document["parameters"]] == list(NAMES)
    for row in document["parameters"]:
        low, high = row["interval95"]
        # of the value itself, not of its logarithm
        assert low <= row["nominal"] * np.exp(TRUTH[row["name"]]) <= high
    ramps = {(row["posture"], row["ramp"]) for row in document["next_experiment"]["candidates"]}
    assert ramps == {("D", "x:-6"), ("A", "y:1")}
    assert document["next_experiment"]["figure"] == "C:compression:F_cr"
    for word in ("link.EIz", "95 % interval", "Which posture next", "D x -6"):
        assert word in printed
    found = Calibration.model_validate(document)
    assert fit_report(found).split() == printed[: printed.index("page:")].split()
    assert len(repr(found).splitlines()) == 1 + len(NAMES)
    validate("buckling", out / MODEL, "--posture", "A", "--direction", "-", "--engine", "vjm-4")


@pytest.mark.slow
def test_json_is_the_document_and_nothing_else(files):
    # by default one factor for every elastic part, which is too few for these readings
    document = json.loads(validate(*command(files, "--json"), status=1).out)
    assert document == json.loads((files.data.parent / "out" / DOCUMENT).read_text())
    assert [row["name"] for row in document["parameters"]] == ["foot.factor", "link.factor"]


@pytest.mark.slow
def test_a_model_that_misses_its_own_readings_is_written_by_force_alone(files):
    out = files.data.parent / "out"
    out.mkdir()
    (out / MODEL).write_text("# of another calibration")
    # an earlier calibration's model does not stay beside a document of another
    printed = validate(*command(files), status=1).out
    assert {path.name for path in out.iterdir()} == {DOCUMENT, PAGE}
    document = json.loads((out / DOCUMENT).read_text())
    assert (document["fit"]["fits"], document["calibrated_model"]) == (False, "")
    assert "validate diagnose" in printed
    assert "--force" in printed
    validate(*command(files, "--force"))
    assert (out / MODEL).read_text().startswith("# Not for use: it does not explain its own readings")
    assert json.loads((out / DOCUMENT).read_text())["calibrated_model"] == MODEL


@pytest.mark.slow
def test_forces_in_pounds_are_refused(files):
    """A machine 4.45 times as soft may fit them; it is none that was measured."""
    table = [line.split(",") for line in files.data.read_text().splitlines()]
    for name in synthetic.COLUMNS:
        column(name, lambda cell: f"{float(cell) / 4.4482216152605:.9g}" if cell else cell)(table)
    files.data.write_text("\n".join(",".join(row) for row in table) + "\n")
    out = files.data.parent / "out"
    said = refused(*command(files, "--fit", *NAMES))
    assert said.startswith("validate: data.csv: ")
    assert [word for word in ("lbf", "Convert them", "validate diagnose", "--force") if word not in said] == []
    assert not out.exists()
    validate(*command(files, "--fit", *NAMES, "--force"))
    assert any("lbf" in reason for reason in json.loads((out / DOCUMENT).read_text())["unfit"])
    head = [line for line in (out / MODEL).read_text().splitlines() if line.startswith("# Not for use")]
    assert any("lbf" in line for line in head)


@pytest.mark.slow
def test_intervals_cover_the_truth_through_the_command(files):
    """A handful of tests of the same machine; all dice are fixed."""
    trace = synthetic.of_model(synthetic.changed(TRUTH, ENGINE), ENGINE)
    covered = total = 0
    for seed in range(5):
        rows = synthetic.readings(trace, RAMPS, 12, np.random.default_rng([3, seed]))
        synthetic.write(files.data.parent, rows, synthetic.sheet_text(foot=1, link=4))
        for row in json_of(*command(files, "--fit", *NAMES))["parameters"]:
            low, high = row["interval95"]
            covered += low <= row["nominal"] * np.exp(TRUTH[row["name"]]) <= high
            total += 1
    assert total == 15
    assert covered >= 12  # 95 % of 15, and the chance of fewer is 0.5 %


def blank_posture(table: Table) -> None:
    for name in synthetic.COLUMNS:
        column(name, lambda _: "", "B")(table)


BAD: dict[str, tuple[Spoil, tuple[str, ...]]] = {
    "force in kN": (column("fx_N", lambda c: str(float(c) / 1e3)), ("fx_N", "factor 1000", "kN instead of N")),
    "force in mN": (column("fx_N", lambda c: str(float(c) * 1e3)), ("fx_N", "factor 1000", "mN instead of N")),
    "displacement in m": (column("ux_mm", lambda c: str(float(c) / 1e3)), ("ux_mm", "factor 1000", "in m instead")),
    "displacement in um": (column("ux_mm", lambda c: str(float(c) * 1e3)), ("ux_mm", "factor 1000", "µm")),
    "missing displacement": (without("ux_mm"), ("ux_mm", "missing")),
    "missing force": (without("fx_N"), ("fx_N", "missing")),
    "missing posture": (without("posture"), ("posture", "missing")),
    "constant": (column("ux_mm", lambda _: "1.0"), ("posture A", "ux_mm", "constant")),
    "swapped": (swapped, ("rows 6 and 7", "swapped in time")),
    "nan": (cell(9, "fx_N", "nan"), ("row 9", "fx_N", "not finite")),
    "text": (cell(9, "fx_N", "12 N"), ("row 9", "fx_N", "is no number")),
    "blank posture": (blank_posture, ("posture B", "blank")),
    "unknown posture": (cell(9, "posture", "E"), ("row 9", "unknown posture 'E'")),
    "empty": (lambda table: table.clear(), ("data.csv", "empty")),
    "header alone": (keep(0), ("no reading below",)),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_data_are_refused(files, case: str):
    spoil, words = BAD[case]
    table = [line.split(",") for line in files.data.read_text().splitlines()]
    spoil(table)
    files.data.write_text("".join(",".join(row) + "\n" for row in table))
    said = refused(*command(files, "--fit", *NAMES))
    assert said.startswith("validate: data.csv: ")
    assert [word for word in words if word not in said] == []
    assert not (files.data.parent / "out").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--fit", "bar.factor"), "no such elastic part"),
        (("--fit", "link.EIx"), "look for factor, section"),
        (("--next", "D"), "is no ramp"),
        # the whole fit comes first; `test_a_figure_that_is_none` has the reason
        pytest.param(("--figure", "A:compression:K9"), "is no predicted figure", marks=pytest.mark.slow),
    ],
)
def test_bad_options_are_refused(files, options: tuple[str, ...], words: str):
    assert words in validate(*command(files, *options), status=2).err
    assert not list(files.data.parent.glob("out/*"))


def test_a_test_without_the_end_effectors_displacement(files):
    files.sheet.write_text(GAUGE_SHEET)
    rows = [f"straight,{-500.0 * np.tanh(m):.3f},{m:.3f}" for m in np.linspace(0.0, 20.0, 15)]
    files.data.write_text("posture,fx_N,mid.uy_mm\n" + "\n".join(rows) + "\n")
    assert "no displacement of the end-effector was read" in refused(*command(files))


# The model file that a calibration writes is the machine that it found.


CASES = {
    "sections": ({"link.EA": 0.1, "link.GJ": -0.2, "link.EIy": 0.05, "link.EIz": 0.3, "foot.factor": 0.2}, 1),
    "entries": ({"foot.C11": 0.2, "foot.C33": -0.1, "link.factor": 0.1}, 1),
    "matrix": ({f"foot.R{i}{j}": 0.03 * i - 0.05 * j for i in range(1, 7) for j in range(1, i + 1)}, 1),
    "drive": ({"actuator.compliance": 2.0}, 1),
    "split foot": ({"foot.EIy": 0.1, "foot.EIz": -0.1, "link.factor": -0.2}, 4),
}


@pytest.mark.parametrize("case", CASES)
def test_the_file_is_the_machine(make: Make, tmp_path: Path, case: str):
    z, foot = CASES[case]
    measurement = make(sheet=synthetic.sheet_text(foot=foot, link=4), steps=4)
    names = list(dict.fromkeys("foot.matrix" if ".R" in name else name for name in z))
    unknowns = problem_of(measurement, names).unknowns
    values = dict(z) | {"length link": 0.7}
    at = np.array([values.get(one.name, 0.0) for one in unknowns.all])
    chain = unknowns.build(at)
    file = tmp_path / "calibrated-model.toml"
    file.write_text(calibrated_text(measurement, chain), encoding="utf-8")
    again = load_chain(file)
    for to in (-3.0, 2.0):
        paths = [measurement.engine.trace(one, LoadCase("B", to, steps=4)) for one in (chain, again)]
        np.testing.assert_allclose(paths[1].wrench, paths[0].wrench, rtol=1e-9, atol=1e-6)
    nominal = measurement.engine.trace(measurement.chain, LoadCase("B", -3.0, steps=4))
    # the calibrated chain is another one: by far more than what any solver leaves
    assert abs(nominal.force[-1] / paths[0].force[-1]) != pytest.approx(1.0, rel=1e-3)


def test_both_descriptions_of_a_part_change_alike(make: Make):
    """Springs use one of the two; other engines the other. The library's bar has both from one table."""
    measurement = make(sheet=synthetic.sheet_text(foot=1, link=4), steps=4)
    unknowns = problem_of(measurement, ("link.EIz", "foot.factor")).unknowns
    z = np.zeros(len(unknowns))
    z[:2] = np.log(0.9), np.log(1.2)
    found = build_chain(tomllib.loads(calibrated_text(measurement, unknowns.build(z))), "found")
    for name in ("link", "foot"):
        old, new = (next(b for b in c.beams if b.name == name) for c in (measurement.chain, found))
        softer = new.tip_compliance() / np.where(old.tip_compliance() == 0.0, np.nan, old.tip_compliance())
        theory = new.beam_compliance() / np.where(
            np.abs(old.beam_compliance()) < 1e-12, np.nan, old.beam_compliance()
        )
        if name == "foot":
            np.testing.assert_allclose(softer[~np.isnan(softer)], 1.2, rtol=1e-9)
            np.testing.assert_allclose(theory[~np.isnan(theory)], 1.2, rtol=1e-9)
        else:
            # bending about z, its deflection and their coupling by 1/0.9; all else as it was
            for i, j in ((1, 1), (1, 5), (5, 5)):
                assert softer[i, j] == pytest.approx(1.0 / 0.9, rel=1e-3)
            for i in (0, 2, 3, 4):
                assert softer[i, i] == pytest.approx(1.0, rel=1e-9)


def test_a_shape_stays_a_shape_where_one_modulus_says_all(make: Make, tmp_path: Path):
    sheet = """
[test]
model = "pinned-column"
[model]
link_segments = 8
[postures]
straight = []
[instrument.fx_N]
noise = 1.0
[instrument.ux_mm]
noise = 0.0001
"""
    rows = [{"posture": "straight", "ux_mm": -0.002 * k, "fx_N": -37.0 * k} for k in range(12)]
    files = synthetic.write(tmp_path, rows, sheet)
    from vjm_updating.experiment import read_measurement

    measurement = read_measurement(files.data, files.sheet)
    unknowns = problem_of(measurement, ("link.factor",)).unknowns
    document = tomllib.loads(calibrated_text(measurement, unknowns.build(np.array([0.1]))))
    (beam,) = [part for part in document["parts"] if part["kind"] == "beam"]
    assert beam["section"]["shape"] == "rectangle"
    assert beam["section"]["youngs_modulus_MPa"] == pytest.approx(68948.0 * np.exp(-0.1))
    assert beam["section"]["yield_stress_MPa"] == 241.3


def test_what_was_not_looked_for_stays(make: Make):
    measurement = make(steps=4)
    unknowns = problem_of(measurement, ("foot.factor",)).unknowns
    chain = build_chain(
        tomllib.loads(calibrated_text(measurement, unknowns.build(np.zeros(len(unknowns))))), "same"
    )
    for old, new in zip(measurement.chain.parts, chain.parts, strict=True):
        if isinstance(old, Beam) and isinstance(new, Beam):
            assert new.section == old.section
            np.testing.assert_array_equal(new.compliance, old.compliance)
            assert new.length == old.length
        if isinstance(old, Joint) and isinstance(new, Joint):
            assert (new.kind, new.compliance) == (old.kind, old.compliance)
