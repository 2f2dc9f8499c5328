"""The command from files to files: what is hidden is found, and nothing where nothing is."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from helpers.command import validate
from helpers.from_files import DIAGNOSIS as DOCUMENT
from helpers.from_files import DIAGNOSIS_PAGE as PAGE
from helpers.from_files import EXTENDED as MODEL
from helpers.from_files import diagnose

from vjm.io.model_file import load_chain

SCHEMA = Path(__file__).parents[3] / "docs/schemas/diagnosis.schema.json"


def run(make, folder, hidden, seed, monkeypatch):
    files = make.made_up(folder / "test", hidden, seed, monkeypatch)
    document = diagnose(files.data, files.sheet, folder / "out", page=True)
    found = json.loads((folder / "out" / DOCUMENT).read_text())
    jsonschema.validate(found, json.loads(SCHEMA.read_text()))
    return document, found


@pytest.mark.slow
def test_a_quiet_test_is_quiet(make, tmp_path, monkeypatch):
    _, found = run(make, tmp_path, {}, 8, monkeypatch)
    assert found["verdict"] == "none"
    assert found["causes"] == []
    assert found["parameters"] == {}
    assert found["gain"] is None
    assert found["noise"]["outliers"] == 2
    page = (tmp_path / "out" / PAGE).read_text()
    assert "The model explains the readings" in page
    assert not re.search("https?:", page.replace("http://www.w3.org", ""))


@pytest.mark.slow
def test_friction_is_found_and_its_files_hold_it(make, tmp_path, monkeypatch):
    _, found = run(make, tmp_path, {"joint_friction": (900.0,)}, 4, monkeypatch)
    assert found["verdict"] == "named"
    assert found["causes"] == ["joint_friction"]
    torque = found["parameters"]["joint_friction.torque_Nmm"]
    assert torque["value"] == pytest.approx(900.0, rel=0.15)
    # nine of ten intervals of 3 sigma are wider than any of these errors
    assert abs(torque["value"] - 900.0) < 3.5 * torque["std"]
    # that it acts, and that nothing unknown acts beside it
    (acts, *_), unknown = found["findings"]["causes"], found["findings"]["unknown"]
    assert 0.9 < found["confidence"] <= acts["probability"]
    assert found["confidence"] <= 1.0 - unknown + 1e-9
    gain = found["gain"]
    assert gain["split"] == "postures"
    assert gain["rmse_after"] < gain["rmse_before"]
    assert found["candidates"][0]["causes"] == found["causes"]
    assert found["candidates"][0]["probability"] == pytest.approx(1.0)
    text = (tmp_path / "out" / MODEL).read_text()
    assert "joint_friction: torque_Nmm" in text
    assert load_chain(tmp_path / "out" / MODEL).name == "orthoglide-chain"
    page = (tmp_path / "out" / PAGE).read_text()
    for part in ("What was measured", "The cause and its size", "held out", "joint_friction.torque_Nmm"):
        assert part in page


def test_a_foot_that_has_yielded_is_in_balance_at_every_reading(make, tmp_path, monkeypatch):
    # brackets that the past has spoilt take more than 40 steps here
    files = make.made_up(tmp_path, {"plasticity.foot": (1500.0, 0.1)}, 5, monkeypatch)
    header, *rows = (line.split(",") for line in files.data.read_text().splitlines())
    force = np.array([float(row[header.index("fx_N")] or "nan") for row in rows])
    assert np.nanmax(np.abs(force)) > 1500.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("label", "values", "name", "value"),
    [
        ("actuator_backlash", (0.05, 0.0, 8.0, 0.0), "actuator_backlash.gap_mm", 0.05),
        ("creep.foot", (0.05, 10.0), "creep.fraction", 0.05),
        ("plasticity.foot", (1500.0, 0.1), "plasticity.yield_N", 1500.0),
        ("base_compliance", (1e-5, 1.0, 1.0), "base_compliance.cxx_mm_per_N", 1e-5),
        ("thermal_drift.fx_N.per_s", (0.2,), "thermal_drift.fx_N.per_s", 0.2),
        ("tension_compression_asymmetry.link", (1.3, 1.0), "tension_compression_asymmetry.ratio", 1.3),
    ],
)
def test_what_is_hidden_is_found(make, tmp_path, monkeypatch, label, values, name, value):
    document, _ = run(make, tmp_path, {label: values}, 5, monkeypatch)
    cause = label.partition(".")[0]
    assert cause in document.causes
    own = next(c for c in document.candidates if cause in c.causes).parameters[name]
    assert own.value == pytest.approx(value, rel=0.2)


@pytest.mark.slow
def test_the_extended_model_has_the_drive(make, tmp_path, monkeypatch):
    document, _ = run(make, tmp_path, {"actuator_compliance": (4e-5,)}, 6, monkeypatch)
    assert "actuator_compliance" in document.causes
    chain = load_chain(tmp_path / "out" / MODEL)
    if document.candidates[0].causes == ["actuator_compliance"]:
        assert chain.parts[0].compliance == pytest.approx(4e-5, rel=0.2)


def test_data_without_a_displacement_is_refused(make, tmp_path):
    files = make.write(tmp_path, make.load_case(("A",), 1.0, 4), [[1.0] * 6] * 40, [0.0] * 40)
    lines = files.data.read_text().splitlines()
    files.data.write_text("\n".join(line.replace("ux_mm", "wx_mm") for line in lines))
    with pytest.raises(ValueError, match="wx_mm"):
        diagnose(files.data, files.sheet, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_plug_in_is_run_with_one_loud_line(make, tmp_path):
    plug_in = tmp_path / "mine.py"
    plug_in.write_text("raise RuntimeError('ran')\n")
    missing = str(tmp_path / "d.csv")
    arguments = ["diagnose", missing, "--sheet", missing, "--out", str(tmp_path / "o"), "--effects", str(plug_in)]
    loud, reason = validate(*arguments, status=2).err.splitlines()
    assert f"--effects runs the program {plug_in} with all your rights" in loud
    assert "RuntimeError: ran" in reason


@pytest.mark.slow
def test_texts_of_a_sheet_are_escaped_in_the_page(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path / "test", {}, 8, monkeypatch, per=4)
    hostile = "<img src=x onerror=alert(1)>"
    files.sheet.write_text(files.sheet.read_text().replace('title = "made up"', f'title = "{hostile} $x"'))
    diagnose(files.data, files.sheet, tmp_path / "out", page=True)
    page = (tmp_path / "out" / PAGE).read_text()
    assert hostile not in page
    assert "&lt;img src=x onerror=alert(1)&gt;" in page


def test_a_plug_in_is_tried(make, tmp_path, monkeypatch):
    plug_in = tmp_path / "magnet.py"
    plug_in.write_text("def effects(scene):\n    raise RuntimeError('tried')\n")
    files = make.made_up(tmp_path / "test", {}, 3, monkeypatch)
    with pytest.raises(RuntimeError, match="tried"):
        diagnose(files.data, files.sheet, tmp_path / "out", effects=[plug_in])


@pytest.mark.slow
def test_three_causes_at_once_are_named_where_each_of_them_shows(make, tmp_path, monkeypatch):
    # each must explain more than a slightly wrong law of the others may leave: 8 µm of backlash do, 4 do not
    hidden = {"thermal_drift.mz_Nmm.per_s": (10.0, 0.0), "link_bow": (1.5, 0.3), "actuator_backlash": (0.008,)}
    files = make.made_up(tmp_path / "made", hidden, 3, monkeypatch, per=8)
    found = diagnose(files.data, files.sheet, tmp_path / "out")
    # backlash in the drive and in the joints do the same in these postures
    assert {"actuator_backlash", "link_bow", "thermal_drift"} in [set(c.causes) for c in found.candidates]
    assert all({"link_bow", "thermal_drift"} < set(c.causes) and len(c.causes) == 3 for c in found.candidates)
