"""What was found in measured data says what it was made of: readings, sheet, model, effects, options, version."""

import json
import shutil
from importlib.resources import files as resource_files

import pytest
from helpers.command import validate

from vjm.io import provenance
from vjm_updating import load_data

EXAMPLES = resource_files("vjm_validation") / "examples"


def deflections(folder):
    """A published test of deflections with its model beside it."""
    for name in ("readings.csv", "sheet.toml", "fanuc-r2000ic.toml"):
        shutil.copy(EXAMPLES / "fanuc-deflections" / name, folder)
    return folder / "readings.csv", folder / "sheet.toml"


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
        shutil.copy(EXAMPLES / "unknown-cause" / name, tmp_path)
    data, sheet, out = (str(tmp_path / name) for name in ("readings.csv", "sheet.toml", "out"))
    files = [data, "--sheet", sheet, "--out", out]
    more = ["--effects", str(tmp_path / "snap.py"), "--beside", data, sheet]
    found = json.loads(validate("diagnose", *files, "--json", *more).out)["made_of"]
    assert found["effects snap.py"] == provenance.digest((tmp_path / "snap.py").read_bytes())
    assert found["beside data readings.csv"] == found["data readings.csv"]
    assert found["beside sheet sheet.toml"] == found["sheet sheet.toml"]
    nominal = json.loads(validate("calibrate", *files, "--force", "--json", "--next", "A:1").out)["made_of"]
    assert (nominal["next"], nominal["force"]) == ('["A:1"]', "true")
