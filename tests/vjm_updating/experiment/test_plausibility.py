"""Mistakes that are well-formed: each is found and named, and sound readings are not doubted."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.plausibility import Grade, plausibility

from .conftest import Draft, times

SHARED = Path(__file__).parents[4] / "shared" / "blind_development"


def doubts(draft: Draft) -> list[str]:
    """What is implausible about a draft, as lines, whether refused or doubted."""
    try:
        return [str(finding) for finding in plausibility(draft.read())]
    except ValueError as refused:
        return [str(refused)]


def test_a_sound_test_is_not_doubted(draft):
    assert doubts(draft) == []


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("fx_N", 1.0 / 9.80665, "kgf"),
        ("fx_N", 1.0 / 4.4482216, "lbf"),
        ("fx_N", 1e-3, "kN"),
        ("ux_mm", 0.1, "cm"),
        ("ux_mm", 1.0 / 25.4, "inches"),
    ],
)
@pytest.mark.parametrize("posture", ["", "B"])
def test_another_unit_in_one_posture_or_in_all(draft, column, factor, words, posture):
    draft.column(column, times(factor), posture)
    assert any(words in line for line in doubts(draft))


@pytest.mark.parametrize(
    ("columns", "factor", "kind"), [(("fx_N", "mx_Nmm"), 20.0, "forces"), (("fx_N", "mx_Nmm"), 3500.0, "forces")]
)
def test_a_wrong_scale_that_is_no_units_is_told_as_a_number(draft, columns, factor, kind):
    for column in columns:
        draft.column(column, times(factor))
    said = [line for line in doubts(draft) if "no unit" in line]
    (told,) = [re.search(rf"{kind} are (\S+) times what the model predicts, and no unit", line) for line in said]
    # the readings are the model's own; the comparison interpolates its curves
    assert float(told[1]) == pytest.approx(factor, rel=0.02)
    assert not any(re.search(r"\b(gf|kgf|lbf|kN|mN|cm|inches)\b", line) for line in doubts(draft))


def test_a_wrong_scale_of_moments_alone_is_told_as_a_number(draft):
    draft.column("mx_Nmm", times(20.0))
    (told,) = [re.search(r"column mx_Nmm: is (\S+) times what the model predicts", line) for line in doubts(draft)]
    assert float(told[1]) == pytest.approx(20.0, rel=0.05)


def test_a_unit_is_named_beside_a_machine_that_differs_from_its_model(draft):
    """Readings in grams of a machine that is 0.7 times as stiff: 71 times what the model predicts."""
    for column in ("fx_N", "mx_Nmm"):
        draft.column(column, times(0.7 / 9.80665e-3))
    assert any("forces in gf" in line for line in doubts(draft))


def test_another_unit_from_the_middle_on_is_found_with_its_row(draft):
    draft.header[draft.header.index("mx_Nmm")] = "mx_Nmm"
    at, late = draft.header.index("fx_N"), [row for row in draft.rows if row[1] == "B"]
    # two cycles of one posture: the second one in kN
    again = [[f"{100.0 + k}", *row[1:]] for k, row in enumerate(late)]
    for row in again:
        row[at] = repr(1e-3 * float(row[at]))
    draft.rows += again
    found = [line for line in doubts(draft) if "kN" in line]
    assert found
    assert "row" in found[0]


@pytest.mark.parametrize("posture", ["B", "A"])
def test_the_other_sign_in_one_posture(draft, posture):
    draft.column("fx_N", times(-1.0), posture)
    assert any("sign" in line for line in doubts(draft))


def test_swapped_columns_of_the_wrench(draft):
    f, m = draft.header.index("fx_N"), draft.header.index("mx_Nmm")
    for row in draft.rows:
        row[f], row[m] = row[m], row[f]
    assert any("fx_N" in line for line in doubts(draft))


def test_swapped_labels(draft):
    at = draft.header.index("posture")
    for row in draft.rows:
        row[at] = {"A": "B", "B": "A"}[row[at]]
    assert any("swapped" in line for line in doubts(draft))


def test_every_row_twice(draft):
    draft.rows = [row for row in draft.rows for _ in range(2)]
    assert any("written twice" in line for line in doubts(draft))


@pytest.mark.parametrize("clock", [True, False])
def test_one_row_twice(draft, clock):
    if not clock:
        draft.header = draft.header[1:]
        draft.rows = [row[1:] for row in draft.rows]
    draft.rows.insert(5, list(draft.rows[5]))
    words = "the same was read as in row 7: was it written twice, or are readings shifted by 1 row?"
    assert doubts(draft) == [f"data.csv: row 8: {words}"]


def test_rows_that_repeat_because_they_are_rounded_are_not_doubted(draft):
    """Held readings of a display with one digit for its noise."""
    draft.header = draft.header[1:]
    rounded = [
        [row[1], f"{float(row[2]):.2f}", f"{float(row[3]):.0f}", f"{float(row[4]):.0f}"] for row in draft.rows
    ]
    draft.rows = [row for row in rounded for _ in range(1 + (row is rounded[6]))]
    draft.sheet = draft.sheet.replace("noise = 0.001", "noise = 0.01")
    draft.sheet = draft.sheet.replace("noise = 2.0", "noise = 0.5").replace("noise = 50.0", "noise = 0.5")
    assert not any("twice" in line for line in doubts(draft))


def test_the_file_twice(draft):
    draft.header = draft.header[1:]
    draft.rows = [row[1:] for row in draft.rows] * 2
    assert any("written twice" in line for line in doubts(draft))


def test_a_clock_in_milliseconds_in_one_posture(draft):
    draft.column("time_s", times(1000.0), "B")
    assert any("ms" in line for line in doubts(draft))


def test_a_negative_clock(draft):
    draft.column("time_s", lambda cell: repr(float(cell) - 5.0))
    assert any("negative" in line for line in doubts(draft))


@pytest.mark.parametrize(
    ("value", "grade", "words"),
    [
        (294.0, Grade.DOUBTFUL, "kelvin"),
        (70.0, Grade.DOUBTFUL, "°F"),
        (420.0, Grade.DOUBTFUL, "neither kelvin nor °F explains it"),
        (-300.0, Grade.REFUSED, "absolute zero"),
        (1e9, Grade.REFUSED, "hot"),
    ],
)
def test_temperatures_that_no_room_has(draft, value, grade, words):
    draft.header.append("temperature_C")
    for k, row in enumerate(draft.rows):
        row.append(repr(value + 0.01 * k))
    (finding,) = plausibility(draft.read())
    assert finding.grade is grade
    assert words in finding.found


def test_an_absurd_reading_is_refused(draft):
    draft.rows[5][draft.header.index("fx_N")] = "1e308"
    assert any("no reading" in line for line in doubts(draft))


def test_blanks(draft):
    at = draft.header.index("fx_N")
    for row in draft.rows[::2]:
        row[at] = ""
    assert any("blank" in line for line in doubts(draft))


def test_all_but_two_displacements_blank(draft):
    at = draft.header.index("ux_mm")
    kept = {3, 20}
    for k, row in enumerate(draft.rows):
        row[at] = row[at] if k in kept else ""
    # one displacement in each posture: nothing moved
    assert any("nothing was loaded" in line for line in doubts(draft))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("noise = 2.0", "noise = 0.0", "noise = 0"),
        ("noise = 2.0", "noise = 1e-300", "last digit"),
        ("noise = 2.0", "noise = 1e9", "little can be seen"),
        ("noise = 0.001", "noise = 1.0", "little can be seen"),
        ("zero = 3.0", "zero = 3000.0", "another unit"),
        ("scale = 0.003", "scale = 1.0", "per cent"),
        ("link_length_mm = 0.2", "link_length_mm = 1000.0", "µm"),
        ("modulus_rel = 0.02", "modulus_rel = 0.9", "per cent"),
    ],
)
def test_sheets_that_no_maker_writes(draft, old, new, words):
    assert old in draft.sheet
    draft.sheet = draft.sheet.replace(old, new, 1)
    assert any(words in line for line in doubts(draft))


def test_a_column_that_does_not_change_where_the_model_says_it_does(draft):
    draft.column("fx_N", lambda cell: "0.0")
    assert any("column fx_N: every reading is 0" in line for line in doubts(draft))


def test_a_posture_without_one_whole_reading(draft):
    u, f, m = (draft.header.index(name) for name in ("ux_mm", "fx_N", "mx_Nmm"))
    for k, row in enumerate(row for row in draft.rows if row[1] == "B"):
        for at in (u,) if k % 2 else (f, m):
            row[at] = ""
    assert any("posture B: no reading of it has both" in line for line in doubts(draft))


def test_one_channel_with_the_other_sign(draft):
    draft.column("mx_Nmm", times(-1.0))
    assert any("column mx_Nmm" in line and "axis turned" in line for line in doubts(draft))


def test_two_displacements_exchanged(draft):
    draft.header.insert(3, "uy_mm")
    for row in draft.rows:
        # what ux_mm was stands under uy_mm
        row.insert(2, "0.0")
    assert any("ux_mm and uy_mm exchanged" in line for line in doubts(draft))


def test_a_mistaken_model_is_named_with_the_sheet(draft):
    draft.sheet = draft.sheet.replace("link_segments = 8", "link_segments = 8\nactuator_compliance_mm_per_N = 1e3")
    (line,) = doubts(draft)
    assert "sheet.toml, model orthoglide-chain: part 'actuator'" in line


def test_noise_in_another_unit(draft):
    """Readings that scatter by 2 N under a sheet that says 0.002."""
    rng = np.random.default_rng(2)
    at = draft.header.index("fx_N")
    for row in draft.rows:
        row[at] = repr(float(row[at]) + 200.0 * rng.standard_normal())
    draft.sheet = draft.sheet.replace("noise = 2.0", "noise = 0.002", 1)
    assert any("another unit" in line for line in doubts(draft))


def test_gravity_with_its_size_is_noted(draft):
    draft.sheet = draft.sheet.replace("[test]", "[test]\ngravity = [0.0, 0.0, -9.81]", 1)
    (finding,) = plausibility(draft.read())
    assert finding.grade is Grade.NOTED


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.is_dir(), reason="the sets of another author are not beside this checkout")
def test_sets_of_another_author_are_not_doubted():
    """In one of them the clamp slips, which no force tells from a zero that was set anew."""
    folders = sorted(SHARED.glob("set_*"))[::5]
    doubted = [f.name for f in folders if plausibility(read_measurement(f / "DATA.csv", f / "SHEET.toml"))]
    assert doubted == ["set_141"]
