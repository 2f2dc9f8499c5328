"""Torques in another unit than N mm are named, in tests of one joint and by loads."""

from __future__ import annotations

import csv
from importlib.resources import files

import numpy as np
import pytest

from vjm_updating import load_data

LBF, INCH = 4.4482216152605, 25.4
UNITS = {
    "lbf in": LBF * INCH,
    "lbf ft": LBF * 12.0 * INCH,
    "ozf in": LBF / 16.0 * INCH,
    "kgf cm": 98.0665,
    "kgf m": 9806.65,
    "N cm": 10.0,
    "N m": 1000.0,
}
"""N mm of each."""

EI, LENGTH = 1e9, 400.0
MODEL = f"""format = 1
name = "bar"
title = "a clamped bar"
source = "test"
units = {{ length = "mm", force = "N", angle = "rad" }}
[[parts]]
kind = "beam"
name = "bar"
length_mm = {LENGTH}
section = {{ EA_N = 1e7, GJ_Nmm2 = 1e9, EIy_Nmm2 = {EI}, EIz_Nmm2 = {EI} }}
[postures]
bench = []
"""
SHEET = """[test]
model = "bar.toml"
control = "force"
[instrument.mz_Nmm]
noise = 10.0
scale = 0.005
[instrument.uy_mm]
noise = 0.002
scale = 0.001
[tolerance]
modulus_rel = 0.02
"""


def said_of(readings, sheet) -> str:
    """What is implausible, or why nothing is taken."""
    try:
        return " ".join(map(str, load_data(readings, sheet).considered()))
    except ValueError as error:
        return str(error)


@pytest.mark.parametrize("unit", UNITS)
def test_of_one_joint(unit):
    """The example, with friction and backlash, whose sheet keeps the noise of N mm."""
    folder = files("vjm_validation") / "examples/joint-test"
    rows = list(csv.DictReader((folder / "readings.csv").read_text("utf-8").splitlines()))
    readings = {name: [float(row[name]) for row in rows] for name in rows[0]}
    assert "Convert" not in said_of(readings, folder / "sheet.toml")
    readings["torque_Nmm"] = [value / UNITS[unit] for value in readings["torque_Nmm"]]
    said = said_of(readings, folder / "sheet.toml")
    assert unit in said
    assert "Convert" in said


@pytest.mark.parametrize("unit", UNITS)
def test_by_moments(unit, tmp_path):
    """A bar under a moment at its tip: its deflection is M L² / (2 EI)."""
    (tmp_path / "bar.toml").write_text(MODEL)
    (tmp_path / "sheet.toml").write_text(SHEET)
    moment = 5e4 * np.concatenate([np.linspace(-1.0, 1.0, 21), np.linspace(1.0, -1.0, 21)])
    rng = np.random.default_rng(5)
    deflection = moment * LENGTH**2 / (2.0 * EI) + 0.002 * rng.standard_normal(len(moment))
    readings = {"posture": ["bench"] * len(moment), "mz_Nmm": moment.tolist(), "uy_mm": deflection.tolist()}
    assert said_of(readings | {}, tmp_path / "sheet.toml") == ""
    readings["mz_Nmm"] = (moment / UNITS[unit]).tolist()
    said = said_of(readings, tmp_path / "sheet.toml")
    assert unit in said
    assert "Convert" in said
