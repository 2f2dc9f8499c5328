import numpy as np
import pytest

from vjm_updating.identify.matrix_file import (
    MatrixFileError,
    half_unit,
    matrix_names,
    parse_matrix,
    read_matrix,
    target,
)

from .textbook import as_text, cantilever

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
