"""Bad data and sheets: `validate diagnose` refuses each in one line that names row or key, and writes nothing."""

from pathlib import Path

import numpy as np
import pytest
from helpers.command import refused
from helpers.spoilt_tables import cell, column, keep, swapped, without

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase


@pytest.fixture(scope="module")
def sound(make, tmp_path_factory):
    """Sound data: what the spoiling starts from."""
    folder = tmp_path_factory.mktemp("sound")
    rows = make.load_case(("A", "B"), 1.0, 4)
    u, wrench = np.array([row[3] for row in rows]), np.zeros((len(rows), 6))
    engine, chain = VjmEngine(4), load_chain("orthoglide-chain")
    for posture in "AB":
        for sign in (1.0, -1.0):
            path = engine.trace(chain, LoadCase(posture, sign * 1.2))
            on = np.array([row[1] == posture for row in rows]) & (sign * u > 0.0)
            for k in range(6):
                wrench[on, k] = np.interp(np.abs(u[on]), path.s, path.wrench[:, k])
    return make.write(folder, rows, wrench, u)


DATA = {
    "missing displacement": (without("ux_mm"), ("ux_mm", "missing")),
    "missing force": (without("fx_N"), ("fx_N", "missing")),
    "missing posture": (without("posture"), ("posture", "missing")),
    "force in kN": (column("fx_N", lambda c: f"{float(c) / 1e3:.7f}"), ("fx_N", "factor 1000", "kN instead of N")),
    "displacement in m": (column("ux_mm", lambda c: f"{float(c) / 1e3:.9f}"), ("ux_mm", "factor 1000")),
    "nan": (cell(9, "fx_N", "nan"), ("row 9", "fx_N", "not finite")),
    "inf": (cell(9, "ux_mm", "inf"), ("row 9", "ux_mm", "not finite")),
    "text": (cell(9, "fx_N", "12 N"), ("row 9", "fx_N", "is no number")),
    "no displacement anywhere": (column("ux_mm", lambda _: ""), ("ux_mm",)),
    "constant": (column("ux_mm", lambda _: "1.0"), ("ux_mm", "constant")),
    "empty": (lambda table: table.clear(), ("empty",)),
    "header alone": (keep(0), ("no reading below",)),
    "one reading": (keep(1), ("posture A",)),
    "unknown posture": (cell(9, "posture", "E"), ("row 9", "unknown posture 'E'")),
    "swapped in time": (swapped, ("rows 6 and 7", "time")),
}


def refusal(files, folder: Path, *options: str) -> str:
    out = folder / "out"
    said = refused("diagnose", files[0], f"--sheet={files[1]}", f"--out={out}", *options)
    assert said.startswith("validate: ")
    assert not out.exists()
    return said


@pytest.mark.parametrize("case", DATA)
def test_bad_data_are_refused(sound, tmp_path, case):
    spoil, words = DATA[case]
    table = [line.split(",") for line in sound.data.read_text().splitlines()]
    spoil(table)
    data = tmp_path / "data.csv"
    data.write_text("".join(",".join(row) + "\n" for row in table))
    said = refusal((data, sound.sheet), tmp_path)
    assert said.startswith("validate: data.csv: ")
    assert [word for word in words if word not in said] == []


SHEETS = {
    "unknown key": ('title = "made up"', 'tilte = "made up"', "tilte"),
    "unknown model key": ("link_segments = 4", "link_segmnets = 4", "link_segmnets"),
    "half a spring": ("link_segments = 4", "link_segments = 4.5", "link_segments"),
    "unknown model": ('"orthoglide-chain"', '"orthoglide-chian"', "orthoglide-chian"),
    "zero noise": ("noise = 2.0", "noise = 0.0", "noise"),
    "negative zero": ("zero = 3.0", "zero = -3.0", "zero"),
    "unknown control": ('title = "made up"', 'control = "wishes"', "control"),
    "no such channel": ("[instrument.fx_N]", "[instrument.fx_kN]", "fx_kN"),
    "negative tolerance": ("modulus_rel = 0.02", "modulus_rel = -0.02", "modulus_rel"),
    "no TOML": ("[test]", "[test", "TOML"),
}


@pytest.mark.parametrize("case", SHEETS)
def test_bad_sheets_are_refused(sound, tmp_path, case):
    old, new, word = SHEETS[case]
    sheet = tmp_path / "sheet.toml"
    text = sound.sheet.read_text()
    assert old in text
    sheet.write_text(text.replace(old, new, 1))
    said = refusal((sound.data, sheet), tmp_path)
    assert "sheet.toml" in said or "fx_kN" in said or "orthoglide-chian" in said
    assert word in said


@pytest.mark.parametrize("missing", [0, 1])
def test_files_that_there_are_not(sound, tmp_path, missing):
    files = [sound.data, sound.sheet]
    files[missing] = tmp_path / "nowhere.csv"
    assert "nowhere.csv" in refusal(files, tmp_path)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--without", "joint_fiction"), "did you mean 'joint_friction'"),
        (("--only", "magic"), "magic"),
        (("--effects", "nowhere.py"), "nowhere.py"),
        (("--beside", "nowhere.csv", "nowhere.toml"), "nowhere.csv"),
    ],
)
def test_bad_options_are_refused(sound, tmp_path, options, word):
    assert word in refusal((sound.data, sound.sheet), tmp_path, *options)


def test_a_folder_that_cannot_be_made_is_refused_before_the_search(sound, tmp_path):
    (tmp_path / "out").write_text("a file")
    arguments = ["diagnose", str(sound.data), f"--sheet={sound.sheet}", f"--out={tmp_path / 'out' / 'in'}"]
    assert refused(*arguments)
