"""Deflections of one posture, of which nothing can be held out, and of axes that were not read."""

from __future__ import annotations

import json

import numpy as np
import pytest
from helpers.lever import lever_text

from vjm_updating import load_data
from vjm_validation.cli.main import run

COMPLIANCE, LEVER, NOISE, PLAY = 1.3e-7, 400.0, 0.003, 3e-4
MODEL = lever_text(LEVER, 1e-7)
WRIST = """[[parts]]
kind = "actuated"
name = "wrist"
axis = "z"
compliance_rad_per_Nmm = 1e-8
[postures]
home = { elbow = 0.0, wrist = 0.0"""
SHEET = """kind = "deflections"
[test]
model = "arm.toml"
order = "as taken"
[loads.tool]
on = "lever"
[markers.tip]
on = "lever"
sigma_mm = 0.01
[tracker]
noise_mm = 0.003
sigma_rad = 1e-4
"""
FORCE = np.array([*range(10, 101, 10), *range(90, 0, -10), *range(-10, -101, -10), *range(-90, 0, 10)], dtype=float)


def write(folder, columns, sheet=SHEET):
    (folder / "arm.toml").write_text(MODEL)
    (folder / "sheet.toml").write_text(sheet)
    data = folder / "readings.csv"
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    data.write_text("\n".join(lines) + "\n")
    return data, folder / "sheet.toml"


def deflection(play=0.0, seed=3):
    """Of the tip, mm: a compliance and half a play to either side."""
    turn = COMPLIANCE * LEVER * FORCE + 0.5 * play * np.sign(FORCE)
    return LEVER * np.sin(turn) + NOISE * np.random.default_rng(seed).standard_normal(len(FORCE))


@pytest.mark.slow
def test_one_posture_is_said_not_to_be_held_out(tmp_path, capsys):
    shift = deflection()
    data, sheet = write(tmp_path, {"posture": ["home"] * len(FORCE), "tool.fy_N": FORCE, "tip.dy_mm": shift})
    # a second joint, or this is a test of the only one
    (tmp_path / "arm.toml").write_text(MODEL.replace("[postures]\nhome = { elbow = 0.0", WRIST))
    out = tmp_path / "out"
    assert run(["diagnose", str(data), "--sheet", str(sheet), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "not held out, for all readings are of one posture" in said
    assert "of the error held out" not in said
    assert "explained: 0%" not in said
    document = json.loads((out / "diagnosis.json").read_text())
    assert document["explained"] is None
    assert {row["random_mm"] for row in document["selection"]} == {None}
    assert {row["region_mm"] for row in document["selection"]} == {None}
    # the compliance alone was wrong: what the fit leaves is the mean size of normal noise, √(2/π) σ
    assert document["after"]["fitted_mm"] == pytest.approx(np.sqrt(2.0 / np.pi) * NOISE, rel=0.3)
    saved = 1.0 - document["after"]["fitted_mm"] / document["before"]["fitted_mm"]
    assert document["findings"]["explained"] == pytest.approx(saved)
    page = (out / "diagnosis.html").read_text()
    assert "not held out, for all readings are of one posture" in page
    assert "% of the mean distance held out" not in page
    # whether a model is written is the model's own worth
    run(["calibrate", str(data), "--sheet", str(sheet), "--out", str(out)])
    assert "not held out, for all readings are of one posture" in capsys.readouterr().out


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_an_axis_that_was_not_read_is_not_exchanged(tmp_path, axis):
    """A play that springs do not explain: no exchange with a column that is not there may seem to explain all."""
    text, k = MODEL, "xyz".index(axis)
    about, along = "xyz"[(k + 2) % 3], "xyz"[(k + 1) % 3]
    lever = [0.0, 0.0, 0.0]
    lever["xyz".index(along)] = LEVER
    # the joint turns the lever so that its tip goes along the axis
    text = text.replace('axis = "z"', f'axis = "{about}"').replace(f"[{LEVER}, 0.0, 0.0]", str(lever))
    way = np.cross(np.eye(3)["xyz".index(about)], np.eye(3)["xyz".index(along)])[k]
    shift = way * deflection(play=20.0 * PLAY)
    columns = {
        "posture": ["home"] * len(FORCE),
        f"tool.f{axis}_N": way * FORCE * way,
        f"tip.d{axis}_mm": way * shift,
    }
    data, sheet = write(tmp_path, columns)
    (tmp_path / "arm.toml").write_text(text)
    said = " ".join(map(str, load_data(data, sheet).considered()))
    assert "exchange" not in said
    assert "_axes" not in said
    # columns that are there are exchanged in a test in which they were mistaken
    other = "xyz"[(k + 1) % 3]
    mistaken = {
        "posture": ["home"] * len(FORCE),
        f"tool.f{axis}_N": FORCE,
        f"tip.d{other}_mm": deflection(),
        f"tip.d{axis}_mm": np.zeros(len(FORCE)),
    }
    data, sheet = write(tmp_path, mistaken)
    (tmp_path / "arm.toml").write_text(text)
    assert "exchange" in " ".join(map(str, load_data(data, sheet).considered()))


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "in m instead of mm"), (1e3, "in µm instead of mm")])
def test_a_dial_on_one_axis_in_metres_is_refused(tmp_path, capsys, factor, unit):
    """As in a test by loads or of the joint: the model deflects by a thousand times as much, or a thousandth."""
    columns = {"posture": ["home"] * len(FORCE), "tool.fy_N": FORCE, "tip.dy_mm": factor * deflection()}
    data, sheet = write(tmp_path, columns)
    for command in ("calibrate", "diagnose"):
        assert run([command, str(data), "--sheet", str(sheet), "--out", str(tmp_path / "out")]) == 2
        said = capsys.readouterr().err
        assert unit in said
        assert "times what the model predicts" in said
    assert not (tmp_path / "out").exists()


def test_a_reading_of_which_a_part_is_blank_keeps_the_rest(tmp_path):
    """An exchange of x and z leaves what was read of y, where x and z were not read."""
    shift = deflection(play=20.0 * PLAY)
    there = [f"{value}" if k % 2 else "" for k, value in enumerate(np.zeros(len(FORCE)))]
    columns = {
        "posture": ["home"] * len(FORCE), "tool.fy_N": FORCE,
        "tip.dx_mm": there, "tip.dy_mm": shift, "tip.dz_mm": there,
    }  # fmt: skip
    data, sheet = write(tmp_path, columns)
    assert "exchange" not in " ".join(map(str, load_data(data, sheet).considered()))
