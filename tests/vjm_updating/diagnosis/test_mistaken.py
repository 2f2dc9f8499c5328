"""Mistakes of the instruments are named as such, undone, and no physics is found in their place."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from helpers.from_files import DIAGNOSIS as DOCUMENT
from helpers.from_files import DIAGNOSIS_PAGE as PAGE
from helpers.from_files import diagnose

from vjm.io.findings import ImplausibleError
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.mistakes import CLOCK, EXCHANGE, SIGN, UNIT, corrected, mistakes_of
from vjm_updating.experiment.plausibility import plausibility


@pytest.fixture(scope="module")
def quiet(make, tmp_path_factory):
    """Readings of a machine as it was drawn."""
    with pytest.MonkeyPatch.context() as patch:
        return make.made_up(tmp_path_factory.mktemp("quiet"), {}, 8, patch)


def spoilt(quiet, folder, change):
    """The data with each row changed, as a file; rows are dictionaries of numbers but for the posture."""
    with open(quiet.data, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for k, row in enumerate(rows):
        change(k, row)
    data = folder / "data.csv"
    with open(data, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return data


def times(row, name, factor):
    row[name] = repr(float(row[name]) * factor)


FORCES = ("fx_N", "my_Nmm", "mz_Nmm")


def kgf_in_b(_, row):
    for name in FORCES:
        times(row, name, 1.0 / 9.80665 if row["posture"] == "B" else 1.0)


def inches_in_a(_, row):
    times(row, "ux_mm", 1.0 / 25.4 if row["posture"] == "A" else 1.0)


def inches_from_a_row_on(k, row):
    times(row, "ux_mm", 1.0 / 25.4 if row["posture"] == "B" and k >= 130 else 1.0)


def kn_to_a_row(k, row):
    for name in FORCES:
        times(row, name, 1e-3 if k < 50 else 1.0)


def kn_from_the_second_row_of_the_last_posture_on(k, row):
    for name in FORCES:
        times(row, name, 1e-3 if k >= 89 else 1.0)


def inches_in_all(_, row):
    times(row, "ux_mm", 1.0 / 25.4)


def lbf_from_the_middle_on(k, row):
    for name in FORCES:
        times(row, name, 1.0 / 4.4482216152605 if k >= 60 else 1.0)


def sign_in_b(_, row):
    for name in FORCES:
        times(row, name, -1.0 if row["posture"] == "B" else 1.0)


def sign_from_a_row_on(k, row):
    for name in FORCES:
        times(row, name, -1.0 if row["posture"] == "A" and k >= 40 else 1.0)


def force_and_moment(_, row):
    row["fx_N"], row["my_Nmm"] = row["my_Nmm"], row["fx_N"]


def clock_set(k, row):
    row["time_s"] = repr(float(row["time_s"]) + (7200.0 if k >= 60 else 0.0))


def clock_in_ms(_, row):
    times(row, "time_s", 1000.0 if row["posture"] == "B" else 1.0)


MISTAKES = {
    "forces in kgf in B": (kgf_in_b, UNIT),
    "displacements in inches in A": (inches_in_a, UNIT),
    "inches from a row on": (inches_from_a_row_on, UNIT),
    "kN up to a row": (kn_to_a_row, UNIT),
    "kN from the last posture's second row on": (kn_from_the_second_row_of_the_last_posture_on, UNIT),
    "inches everywhere": (inches_in_all, UNIT),
    "lbf from the middle on": (lbf_from_the_middle_on, UNIT),
    "sign in B": (sign_in_b, SIGN),
    "sign from a row on": (sign_from_a_row_on, SIGN),
    "fx and my exchanged": (force_and_moment, EXCHANGE),
    "the clock set": (clock_set, CLOCK),
    "the clock in ms in B": (clock_in_ms, CLOCK),
}


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_and_undone(name, quiet, tmp_path):
    change, cause = MISTAKES[name]
    right = read_measurement(quiet.data, quiet.sheet)
    assert mistakes_of(plausibility(right)) == []
    wrong = read_measurement(spoilt(quiet, tmp_path, change), quiet.sheet)
    found = mistakes_of(plausibility(wrong))
    assert {mistake.cause for mistake in found} == {cause}
    again = corrected(wrong, found)
    for column, values in right.readings.values.items():
        if column != "time_s":
            # a row at the change that is unloaded, or nearly so, goes with either side
            least = 1e-9 + 0.05 * np.ptp(values)
            np.testing.assert_allclose(again.readings.values[column], values, atol=least, rtol=1e-9)
        else:
            np.testing.assert_allclose(np.diff(again.readings.values[column]), np.diff(values), atol=1e-6)


@pytest.mark.slow
def test_a_diagnosis_names_the_mistake_and_nothing_else(quiet, tmp_path):
    data = spoilt(quiet, tmp_path, kgf_in_b)
    diagnose(data, quiet.sheet, tmp_path / "out")
    found = json.loads((tmp_path / "out" / DOCUMENT).read_text())
    assert (found["verdict"], found["causes"]) == ("named", [UNIT])
    assert found["parameters"][f"{UNIT}.fx_N"]["value"] == pytest.approx(9.80665, rel=1e-12)
    assert found["gain"] is None
    assert "kgf" in found["doubts"][0]["found"]
    assert "another unit" in (tmp_path / "out" / PAGE).read_text()
    with pytest.raises(ImplausibleError, match="kgf"):
        diagnose(data, quiet.sheet, tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()
