"""Bad data: each kind is refused with one line that names the file, the row or key, and the remedy."""

import numpy as np
import pytest
from helpers.command import GAUGE_SHEET

from vjm_updating.experiment import read_measurement, read_sheet
from vjm_updating.experiment.data_file import SheetError

from .conftest import Draft, times


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("fx_N", 1e-3, ("fx_N", "factor 1000", "kN instead of N")),
        ("fx_N", 1e3, ("fx_N", "factor 1000", "mN instead of N")),
        ("ux_mm", 1e-3, ("fx_N", "factor 1000", "ux_mm in m instead of mm")),
        ("ux_mm", 1e3, ("row", "ux_mm", "factor 1000", "µm")),
        ("mx_Nmm", 1e-3, ("mx_Nmm", "factor 1000", "N m instead of N mm")),
        ("mx_Nmm", 1e3, ("mx_Nmm", "factor 1000")),
    ],
)
def test_wrong_units(draft: Draft, column: str, factor: float, words: tuple[str, ...]):
    draft.column(column, times(factor))
    message = draft.refused()
    assert message.startswith("data.csv: ")
    assert [word for word in words if word not in message] == []


@pytest.mark.parametrize(("angle", "words"), [(90.0, "is it in degrees?"), (4000.0, "degrees do not explain it")])
def test_angles_of_many_turns(draft: Draft, angle: float, words: str):
    draft.header.append("rz_rad")
    for row in draft.rows:
        row.append("0.0")
    draft.rows[3][-1] = f"{angle}"
    assert words in draft.refused()


def test_short_ramps_in_micrometres(draft: Draft):
    """Too short to be out of reach: the ratio tells."""
    draft.rows = [["", "A", f"{-0.003 * k}", f"{-9.0 * k}", ""] for k in range(12)]
    draft.column("ux_mm", times(1e3))
    assert "ux_mm in µm instead of mm" in draft.refused()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("fx_N", "fx_kN", "column 'fx_kN' must be in N: multiply it by 1000 and name it fx_N"),
        ("ux_mm", "ux_m", "column 'ux_m' must be in mm: multiply it by 1000 and name it ux_mm"),
        ("ux_mm", "ux", "column 'ux' has no unit: name it ux_mm if it is in mm"),
        ("mx_Nmm", "mx_furlong", "'furlong' is not the unit of mx"),
        ("mx_Nmm", "ux_mm", "column 'ux_mm' stands twice"),
        ("mx_Nmm", "mid.uy_mm", "no point 'mid'; the sheet names none: add [points.mid]"),
        ("ux_mm", "note", "column 'note' is no channel"),
    ],
)
def test_wrong_columns(draft: Draft, old: str, new: str, words: str):
    draft.header[draft.header.index(old)] = new
    assert words in draft.refused()


@pytest.mark.parametrize("name", ["posture", "ux_mm", "fx_N", "mx_Nmm"])
def test_a_missing_column(draft: Draft, name: str):
    at = draft.header.index(name)
    del draft.header[at]
    for row in draft.rows:
        del row[at]
    message = draft.refused()
    assert "is missing" in message
    assert name in message
    assert "add it" in message


def test_a_missing_column_that_was_the_control(draft: Draft):
    draft.sheet = draft.sheet.replace('title = "two postures pushed"', 'control = "uz_mm"')
    assert (
        "column 'uz_mm' is missing, by which the sheet says that the operator controlled the test"
        in draft.refused()
    )


@pytest.mark.parametrize("posture", ["", "B"])
def test_constant_displacement(draft: Draft, posture: str):
    draft.column("ux_mm", lambda _: "1.5", posture)
    message = draft.refused()
    assert f"posture {posture or 'A'}, column ux_mm" in message
    assert "constant over all 13 rows" in message


def test_rows_swapped_in_time(draft: Draft):
    draft.rows[4], draft.rows[5] = draft.rows[5], draft.rows[4]
    message = draft.refused()
    assert "rows 6 and 7 are swapped in time (time_s 5, then 4)" in message


def test_rows_swapped_across_postures(draft: Draft):
    draft.rows[12], draft.rows[13] = draft.rows[13], draft.rows[12]
    assert "rows 14 and 15 are swapped in time" in draft.refused()


def test_a_block_out_of_order(draft: Draft):
    draft.rows = draft.rows[6:10] + draft.rows[:6] + draft.rows[10:]
    message = draft.refused()
    assert "row 6, column time_s: 0 comes after 9" in message
    assert "sort by time_s" in message


def test_a_clock_that_begins_anew_with_a_posture(draft: Draft):
    for row in draft.rows[13:]:
        row[0] = str(float(row[0]) - 13.0)
    assert len(draft.read().readings) == 26


@pytest.mark.parametrize("cell", ["nan", "NaN", "inf"])
def test_nan(draft: Draft, cell: str):
    draft.rows[7][3] = cell
    message = draft.refused()
    assert "row 9, column fx_N" in message
    assert "leave a missed sample blank" in message


def test_a_decimal_comma(draft: Draft):
    draft.rows[7][3] = "'12"
    assert "row 9, column fx_N: ''12' is no number" in draft.refused()


def test_a_row_cut_short(draft: Draft):
    draft.rows[7].pop()
    assert "row 9: 4 cells for 5 columns" in draft.refused()


def test_one_posture_all_blank(draft: Draft):
    for name in ("fx_N", "mx_Nmm"):
        draft.column(name, lambda _: "", "B")
    message = draft.refused()
    assert "posture B: every reading of fx_N, mx_Nmm is blank" in message
    assert "leave out the posture's 13 rows" in message


def test_a_posture_without_displacements(draft: Draft):
    draft.column("ux_mm", lambda _: "", "B")
    assert "posture B: every reading of ux_mm is blank" in draft.refused()


def test_empty_files(draft: Draft):
    draft.header, rows, draft.rows = [], draft.rows, []
    assert draft.refused() == "data.csv: the file is empty; its first line must name the columns"
    draft.header, draft.rows = ["posture", "ux_mm", "fx_N"], []
    assert "no reading below it" in draft.refused()
    draft.rows, draft.sheet = rows, ""
    assert "sheet.toml: the file is empty" in draft.refused()


def test_no_such_files(draft: Draft):
    data, sheet = draft.write()
    data.unlink()
    with pytest.raises(ValueError, match="cannot be read"):
        read_measurement(data, sheet)
    sheet.unlink()
    with pytest.raises(ValueError, match="cannot be read"):
        read_measurement(data, sheet)


def test_an_unknown_posture(draft: Draft):
    draft.rows[20][1] = "b"
    message = draft.refused()
    assert "row 22, column posture: unknown posture 'b' (the sheet has A, B)" in message


def test_a_blank_posture(draft: Draft):
    draft.column("posture", lambda _: "", "B")
    assert "row 15, column posture: is blank" in draft.refused()


def test_the_other_sign(draft: Draft):
    draft.column("fx_N", times(-1.0))
    assert "has the other sign" in draft.refused()


def test_a_channel_without_an_instrument(draft: Draft):
    draft.sheet = draft.sheet.replace("[instrument.mx_Nmm]\nnoise = 50.0", "")
    assert "channel mx_Nmm was measured: add [instrument.mx_Nmm]" in draft.refused()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[test]", "[tset]", "tset"),
        ('model = "orthoglide-chain"', "", "model is missing"),
        ('model = "orthoglide-chain"', 'model = "orthoglide-chains"', "no model 'orthoglide-chains'"),
        ("noise = 2.0", "noise = -2.0", "noise must be at least 0"),
        ("noise = 2.0", 'noise = "2"', "noise must be a number"),
        ("[instrument.fx_N]", "[instrument.fx_kN]", "fx_kN"),
        ("link_length_mm = 0.2", "link_lenght_mm = 0.2", "unknown key 'link_lenght_mm'"),
        ("link_segments = 8", "link_segments = 0", "link_segments must be a whole number"),
        ("link_segments = 8", "link_segmens = 8", "did you mean 'link_segments'"),
        ("link_segments = 8", "link.section.EA = 8.0", "unknown key 'EA'"),
        ("link_segments = 8", "bar.length_mm = 8.0", "no table or part 'bar'"),
        ("link_segments = 8", "length_mm = 0.31", "1000 times beam theory"),
        ("A = [0.0, 0.0, 0.0, 0.0]", "A = [0.0, 0.0]", "posture 'A'"),
        ("[tolerance]", '[points.mid]\nbody = "lnk"\n[tolerance]', "no part 'lnk'"),
        ("[test]", "[test", "not valid TOML"),
    ],
)
def test_wrong_sheets(draft: Draft, old: str, new: str, words: str):
    assert old in draft.sheet
    draft.sheet = draft.sheet.replace(old, new, 1)
    message = draft.refused()
    assert words in message
    assert "sheet.toml" in message or "no model" in message


def test_forces_of_a_column_in_kilonewtons(draft: Draft):
    """Steered by a point between the ends: the buckling load is the measure."""
    draft.sheet = GAUGE_SHEET
    draft.header = ["posture", "fx_N", "mid.uy_mm"]
    marks = np.linspace(0.0, 20.0, 15)
    draft.rows = [["straight", f"{-500.0 * np.tanh(m):.3f}", f"{m:.3f}"] for m in marks]
    assert len(draft.read().readings) == 15
    draft.column("fx_N", times(1e-3))
    assert "is it in kN instead of N" in draft.refused()
    draft.column("fx_N", times(1e6))
    assert "is it in mN instead of N" in draft.refused()


def test_an_unknown_instrument_is_refused_with_its_line(tmp_path):
    sheet = tmp_path / "sheet.toml"
    sheet.write_text('[test]\nmodel = "orthoglide-chain"\n\n[instrument.fx_kN]\nnoise = 1.0\n')
    with pytest.raises(SheetError, match=r"sheet\.toml, line 4: .*fx_kN.* is no channel"):
        read_sheet(sheet)


def test_a_thermometer_is_an_instrument(tmp_path):
    sheet = tmp_path / "sheet.toml"
    sheet.write_text('[test]\nmodel = "orthoglide-chain"\n[instrument.temperature_C]\nnoise = 0.05\nzero = 0.5\n')
    assert read_sheet(sheet).instrument["temperature_C"].noise == 0.05
