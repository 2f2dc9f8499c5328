"""Data, diagnoses and calibrations in memory: the same as by files, for every kind of test."""

import csv
import json
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from importlib.resources import files
from importlib.resources import files as resource_files
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from helpers.command import json_of, validate
from threadpoolctl import threadpool_info, threadpool_limits

import vjm
import vjm_updating
from vjm.io import provenance
from vjm_updating import CalibrationResult, DataSet, calibrate, diagnose, load_data
from vjm_updating.calibration.document import Calibration
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.data_file import DataError, SheetError
from vjm_updating.simulate import DATA, SHEET, simulate

EXAMPLES = Path(str(files("vjm_validation"))) / "examples"
KINDS = {
    "soft-springs": "ramps",
    "clamped-tube": "loads",
    "joint-test": "joint",
    "fanuc-deflections": "deflections",
    "ur10-poses": "poses",
}


def paths(name: str) -> tuple[Path, Path]:
    return EXAMPLES / name / "readings.csv", EXAMPLES / name / "sheet.toml"


def held(name: str) -> tuple[dict[str, list[float | str | None]], dict[str, object]]:
    """The readings of an example as columns of numbers, and the content of its sheet."""
    data, sheet = paths(name)
    lines = [line for line in data.read_text().splitlines() if not line.startswith("#")]
    header, *rows = csv.reader(lines)
    columns: dict[str, list[float | str | None]] = {}
    for i, key in enumerate(header):
        cells = [row[i] for row in rows]
        try:
            columns[key] = [float(cell) if cell else None for cell in cells]
        except ValueError:
            columns[key] = list(cells)
    content = tomllib.loads(sheet.read_text())
    model = sheet.parent / content["test"]["model"]
    if model.is_file():
        content["test"]["model"] = str(model)
    return columns, content


@pytest.mark.parametrize(("name", "kind"), KINDS.items())
def test_every_kind_of_test_is_loaded_by_its_sheet(name: str, kind: str):
    data = load_data(*paths(name))
    assert data.kind == kind
    lines = [line for line in paths(name)[0].read_text().splitlines() if line and not line.startswith("#")]
    assert len(data) == len(lines) - 1
    assert repr(data).startswith(f"<DataSet {kind} of ")
    assert set(data.rows()[0]) == set(lines[0].split(","))


@pytest.mark.parametrize("name", ["joint-test", "clamped-tube", "ur10-poses"])
def test_what_a_program_holds_is_read_as_its_files_are(name: str):
    by_files, in_memory = load_data(*paths(name)), load_data(*held(name))
    assert in_memory.rows() == by_files.rows()
    assert repr(in_memory) == repr(by_files)
    one, other = by_files.test, in_memory.test
    if isinstance(one, Measurement):
        assert isinstance(other, Measurement)
        assert other.document == one.document
        assert other.nuisances == one.nuisances
        for column, values in one.readings.values.items():
            np.testing.assert_array_equal(other.readings.values[column], values)
    else:
        assert not isinstance(other, Measurement)
        np.testing.assert_array_equal(other.study.data.position, one.study.data.position)
        np.testing.assert_array_equal(other.study.frames.t, one.study.frames.t)


@pytest.fixture(scope="module")
def calibrated() -> CalibrationResult[Calibration]:
    result = calibrate(load_data(*paths("soft-springs")))
    assert isinstance(result.figures, Calibration)
    return CalibrationResult(result.figures, result.models, result.draw)


@pytest.mark.slow
def test_a_calibration_shows_draws_and_writes_itself(calibrated: CalibrationResult[Calibration], tmp_path: Path):
    """The springs are 1.10 and 1.20 times as soft, see the example."""
    values = {row["name"]: (row["low"], row["high"]) for row in calibrated.rows()}
    for name, truth in {"foot.factor": 1.1, "link.factor": 1.2}.items():
        assert values[name][0] < truth < values[name][1]
    assert all(name in repr(calibrated) and name in calibrated._repr_html_() for name in values)
    assert list(calibrated.to_frame()["name"]) == list(values)
    matplotlib.use("agg")
    assert [label.get_text() for label in calibrated.plot().get_yticklabels()] == list(values)
    calibrated.write(tmp_path)
    assert json.loads((tmp_path / "calibration.json").read_text()) == calibrated.document()
    names = {"calibration.json", "calibrated-model.toml", "calibration.html"}
    assert {file.name for file in tmp_path.iterdir()} == names


@pytest.mark.slow
def test_what_is_not_for_use_is_not_written_and_an_older_one_goes(
    calibrated: CalibrationResult[Calibration], tmp_path: Path
):
    calibrated.write(tmp_path)
    replace(calibrated, models={"calibrated-model.toml": ""}, draw=None).write(tmp_path)
    assert not (tmp_path / "calibrated-model.toml").exists()
    with pytest.raises(ValueError, match="has no page"):
        replace(calibrated, draw=None).page()


def test_a_diagnosis_shows_and_writes_itself(tmp_path: Path):
    found = diagnose(load_data(*held("joint-test")), only=("joint_friction",))
    assert found.figures.verdict in repr(found).splitlines()[0]
    found.write(tmp_path)
    assert json.loads((tmp_path / "diagnosis.json").read_text()) == found.document()
    assert (tmp_path / "diagnosis.html").read_text() == found.page()
    matplotlib.use("agg")
    (chart,) = found.plot().containers
    lengths = [bar.get_width() for bar in chart]
    findings = found.figures.findings
    assert lengths == [*(row["probability"] for row in found.rows()), findings.nothing, findings.unknown]
    # the joint also has backlash and hardening, which nobody may name here: more than noise is left
    assert findings.more_than_noise
    assert not findings.trusted
    assert {row["said"] for row in found.rows()} <= {"may act"}
    assert "What acts, what may act, and the residual" in found.page()


@pytest.mark.slow
def test_linear_algebra_runs_in_one_thread_while_data_are_looked_at():
    """With a thread for each core a diagnosis takes three times as long: its matrices are small."""
    seen = list[int]()

    def progress(_: str) -> None:
        seen.extend(one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas")

    data = load_data(*held("joint-test"))
    with threadpool_limits(limits=2, user_api="blas"):
        diagnose(data, only=("joint_friction",), progress=progress)
        once = len(seen)
        calibrate(data, force=True, progress=progress)
    assert 0 < once < len(seen)
    assert set(seen) == {1}


def test_columns_of_different_lengths_are_refused():
    columns, sheet = held("joint-test")
    columns["angle_rad"] = columns["angle_rad"][:-1]
    with pytest.raises(DataError, match="readings: columns differ in length"):
        load_data(columns, sheet)


def test_a_sheet_in_memory_is_checked_as_a_file_is():
    columns, sheet = held("joint-test")
    with pytest.raises(SheetError, match=r"sheet: .*tset"):
        load_data(columns, sheet | {"tset": {}})
    with pytest.raises(SheetError, match="sheet: TOML has no set"):
        load_data(columns, sheet | {"test": {"model": {"a"}}})


def test_a_frame_of_pandas_is_read_as_its_file_is():
    import pandas as pd

    data, sheet = paths("joint-test")
    frame: DataSet = load_data(pd.read_csv(data, comment="#"), sheet)
    assert frame.rows() == load_data(data, sheet).rows()


def test_the_verbs_are_functions_whatever_was_imported_before():
    modules = "vjm_updating.diagnosis.run, vjm_updating.calibration.run, vjm_updating as u"
    program = f"import {modules}; print(callable(u.diagnose) and callable(u.calibrate))"
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert told == "True\n"


# What was found in measured data says what it was made of: readings, sheet, model, effects, options, version.


EXAMPLE_FILES = resource_files("vjm_validation") / "examples"


def deflections(folder):
    """A published test of deflections with its model beside it."""
    for name in ("readings.csv", "sheet.toml", "fanuc-r2000ic.toml"):
        shutil.copy(EXAMPLE_FILES / "fanuc-deflections" / name, folder)
    return folder / "readings.csv", folder / "sheet.toml"


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("readings.csv", "data readings.csv"),
        ("sheet.toml", "sheet sheet.toml"),
        ("fanuc-r2000ic.toml", "fanuc-r2000ic.toml"),
        ("", "only"),
        ("", "version"),
    ],
)
def test_measured_data_say_what_an_answer_is_made_of(tmp_path, monkeypatch, file, name):
    files = deflections(tmp_path)
    first = load_data(*files).made_of(only=["actuator_compliance"])
    assert load_data(*files).made_of(only=["actuator_compliance"]) == first
    if file:
        (tmp_path / file).write_text((tmp_path / file).read_text() + "# another\n")
    if name == "version":
        monkeypatch.setattr(provenance.vjm, "__version__", "9.9")
    second = load_data(*files).made_of(only=["actuator_compliance", "actuator_backlash"][: 1 + (name == "only")])
    assert {key for key in second.inputs if first.inputs[key] != second.inputs[key]} == {name}
    assert first.key != second.key


@pytest.mark.slow
def test_a_diagnosis_is_written_with_what_it_was_made_of(tmp_path):
    data, sheet = deflections(tmp_path)
    files = [str(data), "--sheet", str(sheet), "--out", str(tmp_path / "out")]
    words = ["diagnose", *files, "--only", "actuator_compliance"]
    for text in ("", "\n# another\n"):
        sheet.write_text(sheet.read_text() + text)
        assert validate(*words).status == 0
        document = json.loads((tmp_path / "out/diagnosis.json").read_text())
        assert (
            document["made_of"]
            == load_data(data, sheet).made_of(only=("actuator_compliance",), without=(), strict=False).inputs
        )
        page = (tmp_path / "out/diagnosis.html").read_text()
        assert f"sheet sheet.toml {document['made_of']['sheet sheet.toml'][:16]}" in page


@pytest.mark.slow
def test_a_diagnosis_and_a_calibration_name_effects_other_specimens_and_what_is_next(tmp_path):
    for name in ("readings.csv", "sheet.toml", "snap.py"):
        shutil.copy(EXAMPLE_FILES / "unknown-cause" / name, tmp_path)
    data, sheet, out = (str(tmp_path / name) for name in ("readings.csv", "sheet.toml", "out"))
    files = [data, "--sheet", sheet, "--out", out]
    more = ["--effects", str(tmp_path / "snap.py"), "--beside", data, sheet]
    found = json_of("diagnose", *files, *more)["made_of"]
    assert found["effects snap.py"] == provenance.digest((tmp_path / "snap.py").read_bytes())
    assert found["beside data readings.csv"] == found["data readings.csv"]
    assert found["beside sheet sheet.toml"] == found["sheet sheet.toml"]
    nominal = json_of("calibrate", *files, "--force", "--next", "A:1")["made_of"]
    assert (nominal["next"], nominal["force"]) == ('["A:1"]', "true")


# What `vjm_updating` offers in Python is what the commands do: maps, simulated tests, identified parts.

PUSH = (0.0, -10.0, 0.0, 0.0, 0.0, 0.0)


def test_a_map_says_what_single_calls_say(tmp_path):
    arm, told = vjm.load("planar-2r"), []
    angles = [0.5, 1.0, 2.0]
    found = vjm_updating.workspace_map(
        arm, {"elbow": angles}, "deflection", wrench=PUSH, posture="bent", folder=tmp_path / "map",
        progress=lambda done, total: told.append((done, total)),
    )  # fmt: skip
    assert told[-1] == (3, 3)
    for angle, row in zip(angles, found.table(), strict=True):
        one = vjm.stiffness(arm, {"shoulder": 0.5, "elbow": angle}, wrench=PUSH, engine="vjm-4")
        # both solvers stop at 1e-8 mm
        assert row["u_mm"] == pytest.approx(float(np.linalg.norm(one.displacement[:3])), abs=1e-7)
        assert row["elbow"] == angle
    again = vjm_updating.workspace_map(arm, "elbow=0.5:1:2", "deflection", wrench=PUSH, posture="bent")
    np.testing.assert_array_equal(again.values, found.values[:2])
    assert json.loads(json.dumps(found.to_dict()))["points"][0]["status"] == "ok"
    assert found.plot().get_xlabel() == "elbow"
    with pytest.raises(ValueError, match="holds another map"):
        vjm_updating.workspace_map(arm, {"elbow": angles}, "frequency", folder=tmp_path / "map")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"grid": {"elbow": [0.5]}, "quantity": "shares"}, "needs a load"),
        ({"grid": {"elbow": [0.5]}, "quantity": "critical", "wrench": PUSH}, "leave wrench out"),
        ({"grid": {"elbow": [0.5]}, "wrench": (1.0,)}, "six finite numbers"),
        ({"grid": {"elbow": [1.0, 0.5]}}, "run upwards"),
        ({"grid": {"elbwo": [1.0]}}, "x, y, z or a joint"),
        ({"grid": {"elbow": [0.5]}, "quantity": "mass"}, "'mass' is not a valid"),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(words, said):
    with pytest.raises(ValueError, match=said):
        vjm_updating.workspace_map(vjm.load("planar-2r"), **words)


def test_a_simulated_test_in_memory_is_that_of_the_files(tmp_path):
    sheet = EXAMPLES / "soft-springs/sheet.toml"
    options = {"hide": ["link_bow=1.0"], "seed": 7, "ramps": ["A:-1"]}
    made = vjm_updating.simulated("orthoglide-chain", sheet, **options)
    truth = simulate("orthoglide-chain", sheet, tmp_path, **options)
    assert truth == made.truth
    for name in (DATA, SHEET):
        assert (tmp_path / name).read_bytes() == made.files[name]
    read = vjm_updating.load_data(tmp_path / DATA, tmp_path / SHEET)
    assert dict(read.columns) == dict(made.data.columns)
    assert made.to_dict()["seed"] == 7


@pytest.mark.slow
def test_an_identified_matrix_is_plain_python():
    found = vjm_updating.identified(matrix="foot-19")
    assert json.loads(json.dumps(found.to_dict()))["compliance"] == found.compliance.tolist()
    assert found.table()[0]["x"] == found.compliance[0, 0]
    for words, said in (({}, "either a machine"), ({"machine": vjm.load("planar-2r")}, "which one")):
        with pytest.raises(ValueError, match=said):
            vjm_updating.identified(**words)
