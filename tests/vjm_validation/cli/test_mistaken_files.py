"""Mistakes that people make in files and options: the message says what is wrong, where, and what to write instead.

Each line of the table is one mistake, and what its message has to hold.
"""

import re
from pathlib import Path
from typing import NamedTuple

import pytest
from helpers.command import refused, validate

from vjm.plain_numbers import plain_number, whole_number
from vjm_validation.cli.main import run

READINGS = "\n".join(
    ["posture,ux_mm,fx_N", *(f"A,{u:.2f},{3262.7 * u:.1f}" for u in (0.0, -0.1, -0.2, -0.3, -0.2, -0.1, 0.0))]
)


class Mistake(NamedTuple):
    """What is typed."""

    edits: tuple[tuple[str, str, str], ...]
    command: str
    words: tuple[str, ...]

    @property
    def warned(self) -> bool:
        """Whether it is only improbable, so that the command goes on."""
        return self.words[0].startswith("warning: ")


def model(old: str, new: str, *words: str) -> Mistake:
    """A mistake in the file of an arm."""
    return Mistake((("arm.toml", old, new),), "check arm.toml", words)


def sheet(old: str, new: str, *words: str) -> Mistake:
    """A mistake in the sheet of a test."""
    return Mistake((("sheet.toml", old, new),), CALIBRATE, words)


def readings(old: str, new: str, *words: str) -> Mistake:
    """A mistake in the readings of a test."""
    return Mistake((("readings.csv", old, new),), CALIBRATE, words)


def option(command: str, *words: str) -> Mistake:
    """A mistake on the command line."""
    return Mistake((), command, words)


CALIBRATE = "calibrate readings.csv --sheet sheet.toml --out out"
MISTAKES = {
    # model files
    "key misspelt": model(
        "length_mm = 500.0",
        "lenght_mm = 500.0",
        "arm.toml:33: part 'upper': unknown key 'lenght_mm'; did you mean 'length_mm'?",
    ),
    "table misspelt": model(
        "[postures]", "[posture]", "arm.toml:80: unknown key 'posture'; did you mean 'postures'?"
    ),
    "kind misspelt": model(
        'kind = "beam"', 'kind = "beem"', "arm.toml:30: part 'upper': kind must be one of", "'beam'", "got 'beem'"
    ),
    "text for a number": model(
        "diameter_mm = 80.0",
        'diameter_mm = "80"',
        "arm.toml:38: part 'upper': section.diameter_mm must be a number, got '80'",
    ),
    "decimal comma": model(
        "diameter_mm = 80.0", "diameter_mm = 80,0", "line 38", "write a decimal point, diameter_mm = 80.0"
    ),
    "unit in the number": model(
        "diameter_mm = 80.0",
        "diameter_mm = 80.0 mm",
        "line 38",
        "write the number without its unit, diameter_mm = 80.0",
    ),
    "modulus in GPa": model(
        "youngs_modulus_MPa = 70000.0",
        "youngs_modulus_MPa = 70.0",
        "warning: arm.toml: part 'upper', section.youngs_modulus_MPa: 70 MPa is softer than plastics",
        "is it in GPa? Give MPa",
    ),
    "modulus in Pa": model(
        "youngs_modulus_MPa = 70000.0",
        "youngs_modulus_MPa = 7e10",
        "arm.toml:40: part 'upper': section.youngs_modulus_MPa = 7e10 is outside",
        "is it in Pa or GPa? Write it in MPa",
    ),
    "length in metres": model(
        "length_mm = 500.0",
        "length_mm = 0.5",
        "warning: arm.toml: part 'upper', length_mm: 0.5 is less than the depth",
        "is it in metres",
        "Give mm",
    ),
    "density in g/cm3": model(
        "density_kg_per_m3 = 2700.0",
        "density_kg_per_m3 = 2.7",
        "arm.toml:42: part 'upper': section.density_kg_per_m3 = 2.7",
        "is it in g/cm³? Write it in kg/m³",
    ),
    "angle in degrees": model(
        "home = { shoulder = -0.5,",
        "home = { shoulder = -30.0,",
        "arm.toml:81: posture 'home': shoulder = -30 rad is beyond ±2π: is it in degrees?",
    ),
    "limits swapped": model(
        "limits_rad = [-3.0, 3.0]",
        "limits_rad = [3.0, -3.0]",
        "arm.toml:27: part 'shoulder': limits_rad = [3.0, -3.0] must be [lower, upper]",
    ),
    "wall too thick": model(
        "wall_mm = 4.0",
        "wall_mm = 41.0",
        "part 'upper': section has wall_mm = 41, which leaves no hole",
        "give a thinner wall",
    ),
    "axis misspelt": model(
        'axis = "y"',
        'axis = "yy"',
        "arm.toml:23: part 'shoulder': axis must be 'x', 'y', 'z' or a unit vector",
        "got 'yy'",
    ),
    "joint left out of a posture": model(
        "stretched = { shoulder = 0.0, elbow = 0.0, wrist = 0.0 }",
        "stretched = { shoulder = 0.0, elbow = 0.0 }",
        "posture 'stretched': no coordinate for the joint 'wrist': give one",
    ),
    "two parts of a name": model(
        'name = "elbow"', 'name = "shoulder"', "part name 'shoulder' stands twice, as parts 1 and 3: rename one"
    ),
    "units of the file": model(
        'length = "mm"', 'length = "m"', "arm.toml:11: [units]: length must be 'mm', got 'm': convert the numbers"
    ),
    "quote left out": model(
        'kind = "beam"', 'kind = "beam', "line 31", "a text begins and ends with a quotation mark"
    ),
    "negative compliance": model(
        "compliance_rad_per_Nmm = 5e-8",
        "compliance_rad_per_Nmm = -5e-8",
        "arm.toml:25: part 'shoulder': compliance_rad_per_Nmm must be at least 0, got -5e-8",
    ),
    # files that are not there
    "no such file": option(
        "check amr.toml", "amr.toml: no such file; give a path to a TOML file", "did you mean 'arm.toml'?"
    ),
    "no such model": option("check ur01", "no model 'ur01' in the library", "did you mean 'ur10'?"),
    "no sheet": option(
        "calibrate readings.csv --sheet shet.toml --out out", "shet.toml: cannot be read: No such file"
    ),
    "no readings": option(
        "calibrate reading.csv --sheet sheet.toml --out out", "reading.csv: cannot be read: No such file"
    ),
    "readings for a sheet": option(
        "calibrate sheet.toml --sheet readings.csv --out out",
        "readings.csv: not valid TOML",
        "this is a table of readings",
    ),
    # sheets
    "sheet's model misspelt": sheet(
        'model = "orthoglide-chain"',
        'model = "ortoglide-chain"',
        "no model 'ortoglide-chain' in the library",
        "did you mean 'orthoglide-chain'?",
    ),
    "sheet's key misspelt": sheet(
        "control =", "controll =", "sheet.toml: unknown key 'controll' in test; did you mean 'control'?"
    ),
    "control misspelt": sheet(
        'control = "displacement"',
        'control = "displacment"',
        "sheet.toml: test.control must be displacement, force or the name of a column, got 'displacment'",
    ),
    "instrument misspelt": sheet(
        "[instrument.fx_N]",
        "[instrument.Fx_N]",
        "sheet.toml, line ",
        '[instrument."Fx_N"] is no channel: write one of',
        "fx_N",
    ),
    "noise left out": sheet(
        "[instrument.ux_mm]\nnoise = 0.001",
        "[instrument.ux_mm]",
        "sheet.toml: instrument.ux_mm.noise is missing: add it",
    ),
    "noise below zero": sheet(
        "noise = 2.0", "noise = -2.0", "sheet.toml: instrument.fx_N.noise must be at least 0, got -2"
    ),
    "posture too short": sheet(
        "A = [0.0, 0.0, 0.0, 0.0]",
        "A = [0.0, 0.0, 0.0]",
        "posture 'A': 3 coordinates for 4 passive joints (q1, q2, q3, q4): give one each",
    ),
    "percent for a share": sheet(
        "modulus_rel = 0.02", "modulus_rel = 2.0", "sheet.toml: tolerance.modulus_rel must be at most 1, got 2"
    ),
    # readings
    "column without unit": readings(
        "ux_mm", "ux", "readings.csv: column 'ux' has no unit: name it ux_mm if it is in mm"
    ),
    "column in metres": readings(
        "ux_mm", "ux_m", "readings.csv: column 'ux_m' must be in mm: multiply it by 1000 and name it ux_mm"
    ),
    "decimal commas": readings(
        "-0.10,-326.3",
        '"-0,10","-326,3"',
        "readings.csv: row 3, column ux_mm: '-0,10' is no number: write it with a point",
    ),
    "semicolons": Mistake(
        (("readings.csv", ",", ";"),),
        CALIBRATE,
        ("readings.csv: column 'posture;ux_mm;fx_N' is several: separate columns by commas",),
    ),
    "unknown posture": readings(
        "A,-0.20",
        "E,-0.20",
        "row 4, column posture: unknown posture 'E' (the sheet has A, B, C, D): add it to [postures]",
    ),
    "text in a cell": readings(
        "-652.5", "n/a", "row 4, column fx_N: 'n/a' is no number: leave the cell of a missed sample blank"
    ),
    "cell left out": readings(
        ",-652.5", "", "readings.csv: row 4: 2 cells for 3 columns: complete it or delete it"
    ),
    # options
    "no such posture": option(
        "stiffness arm.toml --posture hoem", "--posture: arm has no posture 'hoem' (it has home, stretched)"
    ),
    "no such engine": option(
        "stiffness arm.toml --posture home --engine vjm16", "unknown engine 'vjm16'; did you mean 'vjm'?"
    ),
    "command misspelt": option("stifness arm.toml", "stifness", "stiffness"),
    "option misspelt": option("stiffness arm.toml --postur home", "--postur", "Did you mean --posture?"),
    "five components": option(
        "stiffness arm.toml --posture home --wrench 0,0,-100,0,0",
        "--wrench: needs six numbers separated by commas, got 5",
    ),
    "spaces in a wrench": option(
        "stiffness arm.toml --posture home --wrench 0 0 -100 0 0 0", "--wrench", "such as --wrench 0,0,-100,0,0,0"
    ),
    "text for a wrench": option(
        "stiffness arm.toml --posture home --wrench down", "--wrench: 'down' is not six numbers separated by commas"
    ),
    "gravity along nothing": option(
        "stiffness arm.toml --posture home --gravity 9.81",
        "--gravity: '9.81' is not three numbers separated by commas",
    ),
    "axis of a curve": option(
        "curve arm.toml --posture home --axis w --to 1", "axis 'w' is none of x, y, z, rx, ry, rz, load"
    ),
    "picture without suffix": option(
        "show arm.toml --out picture.docx", "--out: picture.docx: write a name that ends in .html or .png"
    ),
}


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A folder with an arm, a sheet and readings that are right."""
    monkeypatch.chdir(tmp_path)
    validate("new", "arm", "arm.toml")
    validate("new", "sheet", "sheet.toml", "--for", "orthoglide-chain")
    text = Path("sheet.toml").read_text(encoding="utf-8")
    # the readings have one force only
    text = re.sub(r"\[instrument\.f[yz]_N\]\n(.+\n)+\n", "", text)
    Path("sheet.toml").write_text(text, encoding="utf-8")
    Path("readings.csv").write_text(READINGS + "\n", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=list(MISTAKES))
def test_the_message_says_what_to_write(mistake: Mistake, files: Path, capsys):
    for name, old, new in mistake.edits:
        text = Path(name).read_text(encoding="utf-8")
        assert old in text
        Path(name).write_text(text.replace(old, new), encoding="utf-8")
    before = {path.name for path in files.iterdir()}
    capsys.readouterr()
    status = run(mistake.command.split())
    said = capsys.readouterr()
    text = " ".join((said.err + said.out).split())
    assert {path.name for path in files.iterdir()} == before
    assert status == (0 if mistake.warned else 2), text
    assert "Traceback" not in text
    assert [words for words in mistake.words if words not in text] == [], text


# Options that are well-formed and mistaken: one line, status 2, nothing written.


MISTAKEN_OPTIONS = {
    "a ramp of nothing": ("curve orthoglide-chain --to 1e-320", "further than 1e-100"),
    "Arabic-Indic digits of an end": ("curve orthoglide-chain --to ١", "digits 0 to 9"),
    "of steps": ("curve orthoglide-chain --to 1 --steps ٣", "digits 0 to 9"),
    "of a wrench": ("stiffness orthoglide-chain --wrench ١٠,0,0,0,0,0", "six numbers"),
    "of an engine": ("curve orthoglide-chain --to 1 --engine vjm-١٦", "unknown engine"),
    "of segments by part": ("curve orthoglide-chain --to 1 --segments link=١٦", "no whole number"),
    "of a grid": ("map orthoglide --grid x=٠:٢:٣", "digits 0 to 9"),
    "an axis of a grid twice": ("map orthoglide --grid x=1,x=2", "x is given twice"),
    "a word too many": ("check orthoglide-chain other.toml more", "other.toml more: nothing more is taken here"),
    "a number with underscores": ("stiffness orthoglide-chain --wrench 1_0,0,0,0,0,0", "six numbers"),
}


@pytest.mark.parametrize("name", MISTAKEN_OPTIONS)
def test_a_mistaken_option_is_refused_in_one_line(name, tmp_path):
    command, words = MISTAKEN_OPTIONS[name]
    out = ["--out", str(tmp_path / "out")] if command.startswith("map") else []
    assert words in refused(*command.split(), *out)
    assert not (tmp_path / "out").exists()


def test_numbers_are_the_digits_0_to_9():
    assert plain_number(" -1.5e3 ") == -1500.0
    assert whole_number("16") == 16
    for word in ("١", "1_0", "ten", ""):
        with pytest.raises(ValueError):
            plain_number(word)
        with pytest.raises(ValueError):
            whole_number(word)
