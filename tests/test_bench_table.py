"""The page's table of speed and accuracy is what `make bench-table` writes, row by row."""

import re
from pathlib import Path

import pytest
from benchmarks.bench_table import BEGIN, END, MEANING, markdown, with_table

ROOT = Path(__file__).parents[1]
ABOUT = {
    **{f"version:{name}": "1.2" for name in ("python", "numpy", "numba", "exudyn")},
    "machine:cores": 2,
    "machine:processor": "P",
}


def found(**values):
    rows = dict.fromkeys(MEANING, 0.25) | values | ABOUT
    return [
        {
            "name": name,
            "value": value,
            "unit": "s",
            "requirement": "" if name in ABOUT else "<= 0.2",
            "passed": value == 0.1,
        }
        for name, value in rows.items()
        if value is not None
    ]


def test_a_row_has_value_requirement_and_verdict():
    values = {"curve_later_s": 0.1, "peak_memory_MB": 245.4, "critical_load_error_n8": 2.6e-8}
    lines = markdown(found(**values)).splitlines()
    row = {line.split("`")[1]: line for line in lines if line.startswith("| `")}
    assert list(row) == list(MEANING)
    assert row["curve_later_s"].endswith("| 0.1 s | ≤ 0.2 | holds |")
    assert row["curve_first_s"].endswith("| 0.25 s | ≤ 0.2 | **missed** |")
    assert "| 245 s |" in row["peak_memory_MB"]
    assert "| 2.6e-8 s |" in row["critical_load_error_n8"]
    assert (
        lines[-1]
        == "Medians, one thread, on a machine with 2 cores (P, Python 1.2, Numpy 1.2, Numba 1.2, Exudyn 1.2)."
    )


def test_only_what_is_between_the_marks_changes():
    new = with_table(f"before\n{BEGIN}\nold\n{END}\nafter\n", found())
    assert new.startswith(f"before\n{BEGIN}\n| row |")
    assert new.endswith(f"{END}\nafter\n")
    assert "old" not in new


def test_a_part_of_the_benchmarks_makes_no_table():
    with pytest.raises(ValueError, match="no row curve_later_s: run `make bench` whole"):
        markdown(found(curve_later_s=None))
    with pytest.raises(ValueError, match="say in MEANING what another is"):
        markdown(found(another=1.0))


def test_the_page_has_the_marks_and_every_benchmark_with_a_requirement_a_row():
    page = (ROOT / "docs/how-well-it-works.md").read_text(encoding="utf-8")
    assert page.count(BEGIN) == page.count(END) == 1
    assert "make bench-table" in page
    said = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests/benchmarks").glob("test_*.py"))
    recorded = re.findall(r'record\(f?"([\w{}]+)"', said)
    patterns = [re.sub(r"\{\w+\}", r"\\w+", name) for name in recorded]
    for name in MEANING:
        assert any(re.fullmatch(pattern, name) for pattern in patterns), name


def test_the_readme_repeats_what_the_page_and_the_reference_report_say():
    readme, page, report = (
        (ROOT / name).read_text(encoding="utf-8")
        for name in ("README.md", "docs/how-well-it-works.md", "reports/reference/README.md")
    )
    (speed,) = re.findall(r"is (\d+) times as fast", readme)
    assert re.findall(r"^\| `speedup_vs_exudyn` \|.*?\| (\d+) \|", page, re.MULTILINE) == [speed]
    (accuracy,) = re.findall(r"within ([\d.]+) % in force", readme)
    assert f"Force at equal displacement differs by at most {accuracy} %" in report
    for figure in ("force at equal displacement", "critical force", "critical displacement"):
        (differs,) = re.findall(rf"^\| {figure} \| differs by ([\d.]+) % at most", page, re.MULTILINE)
        assert f"{figure.capitalize()} differs by at most {differs} %" in report
