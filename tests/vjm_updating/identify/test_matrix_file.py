import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from helpers.command import json_of, validate

from vjm_updating.identify.beam_fit import Form, search
from vjm_updating.identify.command import identify_matrix
from vjm_updating.identify.matrix_file import (
    MatrixFileError,
    half_unit,
    matrix_names,
    parse_matrix,
    read_matrix,
    target,
)
from vjm_validation.schemas import schemas

from .paths import TAPER
from .textbook import as_text, cantilever, with_rigid_arm

BAR = cantilever(310.0, EA=6.74e6, GJ=1.07e7, EIy=2.07e8, EIz=4.31e7)
GOOD = as_text(BAR, 5)


@pytest.mark.parametrize(
    ("word", "half"),
    [("28e-5", 0.5e-5), ("1.20", 0.005), ("-40e-7", 0.5e-7), ("3.10D-02", 0.5e-4), ("7", 0.5), (".5E1", 0.5)],
)
def test_digits_say_how_well_a_number_is_known(word, half):
    assert half_unit(word) == pytest.approx(half, rel=1e-12)


def test_six_rows_are_read_whatever_parts_them():
    plain = parse_matrix(GOOD, "m.txt")
    # five digits are written
    assert plain.values == pytest.approx(BAR, rel=1e-4)
    commas = parse_matrix("# made by hand\n\n" + GOOD.replace(" ", ", ").replace("e", "D"), "m.txt")
    assert np.array_equal(commas.values, plain.values)
    assert np.array_equal(commas.half, plain.half)


def test_metres_become_millimetres():
    in_m = BAR * np.kron([[1e-3, 1.0], [1.0, 1e3]], np.ones((3, 3)))
    assert parse_matrix("units = N m rad\n" + as_text(in_m, 9), "m.txt").values == pytest.approx(BAR, rel=1e-8)
    K = np.linalg.inv(in_m)
    stiffness = parse_matrix("units = N m rad\nkind = stiffness\n" + as_text(K, 12), "m.txt")
    assert target(stiffness).matrix == pytest.approx(BAR, rel=1e-8, abs=1e-12)


def test_the_interval_of_an_inverted_stiffness_holds_the_truth():
    K = np.linalg.inv(BAR)
    aim = target(parse_matrix("kind = stiffness\n" + as_text(K, 4), "m.txt"))
    assert np.all(np.abs(aim.matrix - BAR) <= aim.half)


def test_load_cases_of_a_finite_element_program_are_read():
    names, loads = ["ux", "uy", "uz", "rx", "ry", "rz"], ["fx", "fy", "fz", "mx", "my", "mz"]
    sizes = [100.0, 1.0, -2.0, 1e3, 1.0, 500.0]
    lines = ["# nodal displacements"]
    for j, size in enumerate(sizes):
        lines.append(f"case {loads[j]} {size}")
        # another program's habit: freedoms by number, in any order
        rows = [f"7041 {i + 1 if j % 2 else names[i]} {BAR[i, j] * size:.7E}" for i in range(6)]
        lines += reversed(rows)
    found = parse_matrix("\n".join(lines), "nodes.txt")
    assert found.values == pytest.approx(BAR, rel=1e-6)
    assert found.half[1, 1] == pytest.approx(0.5 * 10.0 ** (np.floor(np.log10(BAR[1, 1])) - 7), rel=1e-6)


def test_the_papers_matrices_come_with_the_package():
    assert matrix_names() == ["bar-20-as-printed", "foot-19"]
    bar = read_matrix("bar-20-as-printed")
    assert bar.values[1, 5] == 11e-5
    assert bar.values[5, 1] == 11e-4
    assert bar.half[1, 1] == 0.5e-2
    foot = read_matrix("foot-19")
    assert np.array_equal(foot.values, foot.values.T)
    assert foot.values[0, 1] == -33e-5


def changed(row: int, column: int, word: str) -> str:
    rows = [line.split() for line in GOOD.splitlines()]
    rows[row - 1][column - 1] = word
    return "\n".join(" ".join(one) for one in rows)


def scaled(block) -> str:
    return as_text(BAR * np.kron(block, np.ones((3, 3))), 5)


REFUSED = {
    "empty": ("", "holds no matrix"),
    "nan": (changed(2, 2, "nan"), r"line 2: entry \(2,2\) is nan"),
    "inf": (changed(6, 6, "-Inf"), r"line 6: entry \(6,6\) is -Inf"),
    "word": (changed(1, 4, "o.1"), r"line 1: entry \(1,4\) is 'o.1', which is no number"),
    "five rows": ("\n".join(GOOD.splitlines()[:5]), "ends after 5 rows"),
    "seven rows": (GOOD + "\n1 2 3 4 5 6", "line 7: a seventh row"),
    "seven columns": (changed(3, 6, "0 0"), "line 3: row 3 has 7 entries"),
    "negative diagonal": (changed(3, 3, "-1e-2"), r"line 3: \(3,3\) = -1e-2: a compliance has positive diagonal"),
    "zero diagonal": (changed(3, 3, "0"), r"\(3,3\) = 0"),
    "indefinite": (changed(2, 6, "2e-3").replace("1.1148e-03", "2e-3"), "not positive definite"),
    "shifts in m": (scaled([[1e-3, 1], [1, 1]]), "some 1000 times smaller .* m/N"),
    "turns per N m": (scaled([[1, 1], [1, 1e3]]), r"some 1000 times larger .* rad/\(N m\)"),
    "all in m": (scaled([[1e-3, 1], [1, 1e3]]), "'units = N m rad'"),
    "mm said to be m": ("units = N m rad\n" + GOOD, "'units = N mm rad'"),
    "unknown key": ("unit = N mm rad\n" + GOOD, "unknown key 'unit'; did you mean 'units'"),
    "unknown units": ("units = lbf in\n" + GOOD, "line 1: units must be N mm rad or N m rad"),
    "unknown kind": ("kind = flexibility\n" + GOOD, "kind must be compliance or stiffness"),
    "twice": ("kind = compliance\nkind = compliance\n" + GOOD, "kind stands twice"),
    "rounding": ("rounding = 5 %\n" + GOOD, "rounding must be"),
    "a case short": ("case 1 1\n9 1 1e-3", "missing"),
    "a case of nothing": ("case 1 0\n9 1 1e-3", "size 0"),
    "two nodes": ("case 1 1\n9 1 1e-3\n10 2 1e-3", "node 10 after node 9"),
    "a freedom of its own": ("case 1 1\n9 temp 1e-3", "'temp' is no degree of freedom"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_matrix_of_an_elastic_body_is_refused(name):
    text, message = REFUSED[name]
    with pytest.raises(MatrixFileError, match=message) as caught:
        target(parse_matrix(text, "m.txt"))
    assert str(caught.value).startswith("m.txt: ")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(MatrixFileError, match=r"^foot19: no such file; .* did you mean 'foot-19'\?$"):
        read_matrix("foot19")


DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.slow
def test_a_part_is_identified_and_its_document_kept_to_its_schema():
    document = json_of("identify", "orthoglide-chain", "--part", "link")
    jsonschema.validate(document, schemas()["identification.schema.json"])
    assert document["source"] == "part"
    assert document["compliance"][1][1] == pytest.approx(310.0**3 / 3 / 4.3055556e7, rel=1e-6)


@pytest.mark.slow
def test_a_raw_matrix_is_examined_and_said_in_words():
    finished = validate("identify", "--matrix", "bar-20-as-printed")
    assert "not symmetric: (2,6) = 11e-5 but (6,2) = 11e-4: both are left out below" in finished.out
    assert "not identifiable from these entries: GAy, GAz" in finished.out


def test_the_documented_files_are_one_bar():
    text = (DOCS / "compliance-matrix-file.md").read_text()
    blocks = [block.split("```")[0] for block in text.split("```text\n")[1:]]
    rows, cases = (target(parse_matrix(block, "example.txt")) for block in blocks)
    # the entries are printed to three or four digits
    assert rows.matrix == pytest.approx(cases.matrix, rel=1e-3)
    found = search(cases, Form.STRAIGHT)
    assert found.met
    assert found.beam.beam.length == pytest.approx(310.0, rel=2e-4)


@pytest.mark.slow
def test_the_documented_path_is_identified(tmp_path):
    text = (DOCS / "identification.md").read_text()
    (block,) = [block.split("```")[0] for block in re.split(r"```(?:\{code-block\} )?toml\n(?::.*\n)*", text)[1:]]
    file = tmp_path / "bracket.toml"
    file.write_text(block)
    document = json_of("identify", file)
    jsonschema.validate(document, schemas()["identification.schema.json"])
    assert document["experiments"]["order"] == pytest.approx(2.0, abs=0.1)
    assert document["experiments"]["extrapolated"]
    assert not document["beams"][-1]["met"]


REFUSED_OPTIONS = {
    "nothing": ([], "either a model with --part, or --matrix FILE"),
    "both": (["orthoglide-chain", "--matrix", "foot-19"], "either a model with --part, or --matrix FILE"),
    "no part": (["orthoglide-chain"], "--part: which one? orthoglide-chain has foot, link"),
    "an unknown part": (["orthoglide-chain", "--part", "foots"], "no part 'foots'"),
    "a passive joint": (["orthoglide-chain", "--part", "q1"], "'q1' is a passive joint"),
    "an unknown model": (["orthoglide-chains", "--part", "foot"], "no model 'orthoglide-chains' in the library"),
    "a manipulator": (["orthoglide", "--part", "foot"], "is a whole manipulator, and this takes one chain"),
    "a missing file": (["--matrix", "nothing.txt"], "nothing.txt: no such file"),
    "a folder": (["--matrix", "."], "is a directory"),
    "a part of a path": (["{taper}", "--part", "x"], "is a beam path, which is taken whole"),
    "an indefinite one": (["--matrix", "{indefinite}"], "not positive definite"),
    "nan": (["--matrix", "{nan}"], "line 2: entry (2,2) is nan"),
}


@pytest.mark.parametrize("name", REFUSED_OPTIONS)
def test_bad_input_is_refused_in_one_line(name, tmp_path, monkeypatch):
    arguments, message = REFUSED_OPTIONS[name]
    C = cantilever(310.0, EA=6.74e6, GJ=1.07e7, EIy=2.07e8, EIz=4.31e7)
    C[2, 4] = C[4, 2] = 3e-3
    rows = as_text(C, 5).splitlines()
    files = {
        "taper": TAPER,
        "indefinite": "\n".join(rows),
        "nan": "\n".join([rows[0], "0 nan 0 0 0 1e-3", *rows[2:]]),
    }
    for key, content in files.items():
        (tmp_path / f"{key}.toml").write_text(content)
    paths = {key: str(tmp_path / f"{key}.toml") for key in files}
    monkeypatch.chdir(tmp_path)
    printed = validate("identify", *(one.format(**paths) for one in arguments), status=2)
    assert printed.out == ""
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert {file.name for file in tmp_path.iterdir()} == {f"{key}.toml" for key in files}


# The paper's printed matrices (19) and (20), from these alone.


@pytest.fixture(scope="module")
def bar():
    return identify_matrix("bar-20-as-printed")


@pytest.fixture(scope="module")
def foot():
    return identify_matrix("foot-19")


def test_entries_of_20_that_are_not_symmetric_are_named_and_left_out(bar):
    assert bar.findings[0] == "not symmetric: (2,6) = 11e-5 but (6,2) = 11e-4: both are left out below"
    assert bar.compliance[1][5] == bar.compliance[5][1] == pytest.approx(0.5 * (11e-5 + 11e-4), rel=1e-12)
    left_out = {(i, j) for i, row in enumerate(bar.uncertainty) for j, open_ in enumerate(row) if open_ is None}
    assert left_out == {(1, 5), (5, 1)}
    # the beam behind the other entries says which of both it is
    assert bar.beams[0].compliance[1][5] == pytest.approx(11e-4, abs=0.5e-4)


def test_20_is_a_straight_beam_of_its_length(bar):
    (beam,) = bar.beams
    assert beam.met
    span = beam.ranges["length_mm"]
    assert 310.0 < span.low < beam.length_mm < span.high < 316.0
    # by hand: √(3 (3,3)/(5,5)) from 50.5e-3/15.5e-7, and √(3 (2,2)/(6,6)) up to 23.5e-2/7.15e-6
    assert span.low == pytest.approx(np.sqrt(3 * 50.5e-3 / 15.5e-7), rel=1e-4)
    assert span.high == pytest.approx(np.sqrt(3 * 23.5e-2 / 7.15e-6), rel=1e-4)
    assert beam.direction == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)


@pytest.mark.slow
def test_no_straight_beam_meets_19(foot):
    straight, sheared, offset = foot.beams
    assert not straight.met
    assert not sheared.met
    assert straight.smallest_worst_misfit > 3.0
    assert 155.0 < straight.length_mm < 161.0
    azimuth = np.rad2deg(np.arctan2(straight.direction[1], straight.direction[0]))
    assert 35.0 < azimuth < 40.0
    assert offset.met
    assert straight.worst_misfit >= straight.smallest_worst_misfit


@pytest.mark.slow
def test_a_beam_with_a_rigid_offset_meets_19(foot):
    offset = foot.beams[-1]
    angle = np.arctan2(offset.direction[1], offset.direction[0])
    section = (offset.EA_N, offset.GJ_Nmm2, offset.EIy_Nmm2, offset.EIz_Nmm2)
    R = np.array(offset.section_axes)
    B = np.kron(np.eye(2), R)
    C = with_rigid_arm(B @ cantilever(offset.length_mm, *section) @ B.T, offset.offset_mm)
    printed = np.array(foot.compliance)
    half = np.array(foot.uncertainty, dtype=float)
    assert np.max(np.abs(C - printed) / half) < 0.5
    assert offset.length_mm == pytest.approx(146.5, abs=3.0)
    assert np.rad2deg(angle) == pytest.approx(50.3, abs=1.5)
    assert offset.offset_mm == pytest.approx([17.57, -8.74, 0.0], abs=1.5)
    # the library's own foot is one of those that the rounding admits
    known = {"length_mm": 146.5, "azimuth_deg": 50.3, "offset_x_mm": 17.57, "offset_y_mm": -8.74}
    known |= {"EIz_Nmm2": 1.744e9, "EIy_Nmm2": 6.32e8, "GJ_Nmm2": 6.40e8}
    for name, value in known.items():
        assert offset.ranges[name].low < value < offset.ranges[name].high, name
    assert "EA_N" in offset.not_identifiable
