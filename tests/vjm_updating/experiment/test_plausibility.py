"""Mistakes that are well-formed: each is found and named, and sound readings are not doubted."""

import csv
import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from helpers.file_texts import instruments_text, table_text
from helpers.measured import needed
from helpers.small_machines import clamped_bar

from vjm.engines import VjmEngine
from vjm.io.findings import Grade
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_updating import load_data
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.implausible_readings import last_digit
from vjm_updating.experiment.plausibility import plausibility

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
    assert words in finding.description


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


# Set weights, coarse cells and marks that control are no mistakes; lost digits and a hanging channel are.


def stiffness() -> float:
    """Of the held tool along y in N/mm: all that a test of shifts alone says."""
    problem = VjmEngine(4).problem(load_chain("planar-2r"), LoadCase("bent", 1.0))
    K = problem.unloaded().stiffness
    assert K is not None
    return float(K[1, 1])


def said(folder: Path, force: np.ndarray, shown: np.ndarray, noise: float, seed: int = 0) -> list[str]:
    """What is said of a test in which the arm bore forces ``(n,)`` N and the file shows others."""
    rng = np.random.default_rng(seed)
    u = force / stiffness() + 0.002 * rng.standard_normal(len(force))
    rows = [f"{2.0 * k:.1f},bent,{a:.3f},{b:.3f}" for k, (a, b) in enumerate(zip(u, shown, strict=True))]
    (folder / "data.csv").write_text("\n".join(["time_s,posture,uy_mm,fy_N", *rows]) + "\n", encoding="utf-8")
    (folder / "sheet.toml").write_text(
        table_text("test", title="an arm under forces on its tool", model="planar-2r")
        + table_text("model", link_segments=4)
        + table_text("postures", bent=[0.5, 1.2])
        + instruments_text(uy_mm=(0.002, 0.002, 0.001), fy_N=(noise, 0.5, 0.003))
        + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
    )
    return [str(found) for found in plausibility(read_measurement(folder / "data.csv", folder / "sheet.toml"))]


WEIGHTS = np.array([0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 40.0, 30.0, 20.0, 10.0, 0.0])


@pytest.mark.parametrize("repeats", [1, 5])
def test_set_weights_are_no_lost_digits(repeats, tmp_path):
    """10, 20, 30 N with an exactness of 0.1 N, read once or five times each: the displacement stands with them."""
    force = np.repeat(WEIGHTS, repeats)
    assert said(tmp_path, force, force, 0.1) == []


@pytest.mark.parametrize("count", [13, 120])
def test_lost_digits_are_found(count, tmp_path):
    """A ramp shown in tens of N: the displacement goes on while the force stands, or the force leaps beside it."""
    force = np.concatenate([np.linspace(0.0, 131.0, count), np.linspace(127.0, 0.0, count)])
    lines = said(tmp_path, force, np.round(force, -1), 0.1)
    assert any("fy_N" in line and "were digits lost" in line for line in lines), lines


def stairs(rng: np.random.Generator) -> np.ndarray:
    """Forces that are held at marks for some dozens of readings each."""
    marks = [0.0, 11.0, 24.0, 38.0, 55.0, 71.0, 55.0, 30.0, 12.0]
    return np.concatenate([np.full(int(rng.integers(20, 60)), mark) for mark in marks])


def test_a_cell_of_coarse_steps_printed_finely_does_not_hang(tmp_path):
    """Steps of 1.877 N printed to 0.001 N under a stated noise of 0.5 N: most readings repeat the one before."""
    force = stairs(np.random.default_rng(1))
    shown = 1.877 * np.round(force / 1.877)
    assert last_digit(np.round(shown, 3)) == pytest.approx(1e-3)
    assert said(tmp_path, force, shown, 0.5) == []


@pytest.mark.parametrize("step", [0.0, 1.877])
def test_a_channel_that_hangs_is_found(step, tmp_path):
    """A ramp of 200 readings whose last 60 show one force, read finely or in steps of a coarse cell."""
    rng = np.random.default_rng(2)
    force = np.linspace(0.0, 120.0, 200)
    shown = force + 0.5 * rng.standard_normal(200)
    shown[140:199] = shown[140]
    shown = step * np.round(shown / step) if step else shown
    lines = said(tmp_path, force, shown, 0.5)
    assert any("fy_N, rows 142 to" in line and "did the channel hang" in line for line in lines), lines


@pytest.mark.parametrize("name", ["column_bar_1", "column_bar_2", "column_tube_1", "column_tube_2"])
@pytest.mark.parametrize("noise", ["0.1", "0.5", "1.0"])
@pytest.mark.parametrize("controlled", [True, False])
def test_measured_columns_are_not_doubted(name, noise, controlled, tmp_path):
    """A cell of 1.877 N steps and a ruler of 1.6 mm marks, whatever noise their sheets state."""
    data, own = needed(f"{name}.csv"), needed(f"{name}.toml")
    sheet = own.read_text(encoding="utf-8").replace("noise = 1.0", f"noise = {noise}", 1)
    (tmp_path / "sheet.toml").write_text(
        sheet if controlled else sheet.replace('held = "target"', ""), encoding="utf-8"
    )
    found = plausibility(read_measurement(data, tmp_path / "sheet.toml"))
    assert [str(one) for one in found] == []


# Torques in another unit than N mm are named, in tests of one joint and by loads.


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
SHEET = (
    table_text("test", model="bar.toml", control="force")
    + table_text("instrument.mz_Nmm", noise=10.0, scale=0.005)
    + table_text("instrument.uy_mm", noise=0.002, scale=0.001)
    + table_text("tolerance", modulus_rel=0.02)
)


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
    (tmp_path / "bar.toml").write_text(clamped_bar(LENGTH, EI))
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
