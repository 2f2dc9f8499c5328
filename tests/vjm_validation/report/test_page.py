"""The page: complete, self-contained, honest about what is missing."""

import base64
import csv
import errno
import hashlib
import html
import io
import os
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from vjm.model.load_case import Direction
from vjm_fea.factories import EXUDYN_MISSING
from vjm_fea.opensees.beams import MISSING
from vjm_validation.report import page
from vjm_validation.report.findings import findings
from vjm_validation.report.page import matrix, write_report, wrong_in_the_paper
from vjm_validation.studies.chain import Key


class Elements(HTMLParser):
    """All start tags with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def all(self, tag):
        return [attributes for name, attributes in self.found if name == tag]


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "index.html").read_text()


@pytest.mark.slow
def test_no_external_reference(text):
    elements = Elements(text)
    ids = {attributes["id"] for _, attributes in elements.found if "id" in attributes}
    for tag, attributes in elements.found:
        assert tag not in {"iframe", "object", "embed", "base"}
        for name in ("src", "href", "srcset", "data", "action", "poster"):
            value = attributes.get(name)
            if value is not None and not value.startswith("data:"):
                assert value.startswith("#"), (tag, name, value)
                assert value[1:] in ids
    assert [attributes for tag, attributes in elements.found if tag == "script"] == [{}]
    assert "@import" not in text
    assert not re.search(r"url\(\s*['\"]?(?!data:|#)", text)


def test_every_image_decodes_and_shows_something(text, folder):
    """Renders are embedded; every other figure stands in the page as SVG and in its folder as PNG."""
    files = [*(folder / "figures").iterdir(), *(folder / "renders").iterdir()]
    for file in files:
        pixels = np.asarray(Image.open(file).convert("L"))
        assert min(pixels.shape) > 300
        assert 0.005 < np.mean(pixels < 200) < 0.5
    images = Elements(text).all("img")
    embedded = [
        base64.b64decode(image["src"].removeprefix("data:image/png;base64,"), validate=True) for image in images
    ]
    assert all(image["alt"] for image in images)
    plots = [attributes for attributes in Elements(text).all("svg") if attributes.get("class") == "plot"]
    assert all(plot["role"] == "img" and plot["aria-label"] for plot in plots)
    assert len(plots) + len(embedded) == len(files)
    assert {file.read_bytes() for file in (folder / "renders").iterdir()} <= set(embedded)
    assert {"force_A.png", "stiffness_A.png", "difference_A.png", "link_lumping.png", "foot_law.png",
            "lumping_convergence.png"} <= {file.name for file in files}  # fmt: skip


def test_every_plot_has_its_values(text, computed):
    """The CSV of the force figure holds the points of the paths that it draws, kN and mm."""
    links = {a["download"]: a["href"] for a in Elements(text).all("a") if "download" in a}
    assert {"force_A.csv", "stiffness_A.csv", "lumping_convergence.csv", "foot_law.csv"} <= set(links)
    head, content = links["force_A.csv"].split(",", 1)
    assert head == "data:text/csv;charset=utf-8;base64"
    rows = list(csv.DictReader(io.StringIO(base64.b64decode(content).decode())))
    drawn = [row for row in rows if row["title"] == "Tension" and row["series"] == "vjm-paper"]
    path = computed.paths[Key("A", Direction.TENSION, "vjm-paper")]
    x, y = (np.array([float(row[name]) for row in drawn]) for name in list(rows[0])[3:])
    # six digits are written
    np.testing.assert_allclose(x, path.s, rtol=1e-5)
    np.testing.assert_allclose(y, path.force / 1e3, rtol=1e-5)


def test_only_the_page_s_own_script_may_run(text):
    policy = next(m["content"] for m in Elements(text).all("meta") if "http-equiv" in m)
    script = text.rpartition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}';" in policy
    assert "default-src 'none';" in policy


def test_what_was_not_run_is_not_passed(run, bare, tmp_path):
    known = run.summary["verification"][0]
    run.summary["verification"] += [{**known, "passed": None, "not_run": EXUDYN_MISSING}] * 3
    run.summary["acceptance"].append(
        {
            "name": "agreement of a and b",
            "requirement": "close",
            "value": f"not run: {EXUDYN_MISSING}",
            "passed": None,
        }
    )
    text = write_report(run, tmp_path).read_text()
    assert "All 2 checks that were run passed; 4 were not run." in text
    cells = re.findall(r'<td class="yes">(\d+)</td><td>(\d+)</td><td class="missing">(\d+)</td>', text)
    assert cells == [("1", "0", "1"), ("1", "0", "3")]
    assert '<div class="verdict differs">' in text
    assert f"{html.escape(EXUDYN_MISSING, quote=False)}" in html.unescape(text)


def test_an_optional_engine_that_is_not_installed_is_one_grey_line(run, bare, tmp_path):
    known = {**run.summary["verification"][0], "engine": "opensees", "passed": None}
    run.summary["verification"] += [{**known, "not_run": MISSING}] * 3
    run.summary["verification"].append({**known, "not_run": "its corotational beams are rigid in shear"})
    text = html.unescape(write_report(run, tmp_path).read_text())
    assert "All 2 checks that were run passed." in text
    assert '<div class="verdict agrees">' in text
    assert 'class="missing"' not in text
    said = f"Not asked: {MISSING} (3 checks); opensees: its corotational beams are rigid in shear (1 check)</p>"
    assert f'<p class="reason soft">{said}' in text


def test_the_matrix_colours_by_tolerance(computed):
    found = matrix(computed)
    assert found.columns == ("A, tension", "A, compression")
    cells = dict(found.rows)
    # in the fixture the stand-in of the finite elements has five springs, the refined model four
    assert [cell.tone for cell in cells["vjm-16f16"]] == ["yes", "yes"]
    assert [cell.tone for cell in cells["vjm-paper"]] == ["no", "no"]
    assert cells["vjm-paper"][1].critical == "none"
    first, second = wrong_in_the_paper(computed)
    assert "buckles when it is pulled" in first
    assert "Pushed, the beams buckle" in second


@pytest.mark.usefixtures("rendering")
def test_renders_show_compression_and_the_artefact(folder):
    assert {file.name for file in (folder / "renders").iterdir()} == {"A_compression.png", "A_tension.png"}


def test_no_temporary_file_is_left(folder):
    """Pictures, the page, the findings, and nothing else."""
    assert {file.name for file in folder.iterdir()} <= {"index.html", "findings.md", "figures", "renders"}
    pictures = [*(folder / "figures").iterdir(), *(folder / "renders").iterdir()]
    assert not [file for file in pictures if file.suffix != ".png" or file.name.startswith(".")]


def test_findings_md_needs_nothing_but_its_figures(folder, computed):
    text = (folder / "findings.md").read_text()
    links = re.findall(r"!?\[[^\]]*\]\(([^)]*)\)", text)
    assert {"figures/link_lumping.png", "figures/foot_law.png"} <= set(links)
    for link in links:
        assert (folder / link).resolve().is_relative_to(folder / "figures")
        Image.open(folder / link).verify()
    assert not re.search(r"\w+://|<\w|^\s*\[[^\]]+\]:", text, re.MULTILINE)
    titles = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert titles == [finding.title for finding in findings(computed)]


def test_long_tables_of_the_record_are_folded_away(run, bare, tmp_path):
    run.summary["hashes"] = {f"A_{n}.csv": "ab" * 32 for n in range(64)}
    text = write_report(run, tmp_path).read_text()
    tables = re.findall(r"<details( open)?>\s*<summary>(\w+)", text)
    assert ("", "Hashes") in tables
    assert (" open", "Versions") in tables
    assert text.count("<details") == text.count("</details>")
    assert text.count("ab" * 32) == 64


def test_absent_values_are_dashes(text):
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", text)
    assert "–" in cells
    assert not {"None", "nan", "null"} & set(cells)


def test_nothing_failed_here(text):
    assert "FAILED" not in text
    assert 'class="finding print failed"' not in text


def test_a_failed_row_is_prominent(run, bare, tmp_path):
    run.summary["acceptance"].append(
        {"name": "<script>residuals</script>", "requirement": "a < b", "value": None, "passed": False}
    )
    text = write_report(run, tmp_path).read_text()
    assert text.index('class="finding print failed"') < text.index('class="finding print agrees"')
    assert "FAILED: 1 of 3 checks that were run does not hold." in text
    assert '<tr class="bad">' in text
    assert text.count("<script>") == 1
    assert "&lt;script&gt;residuals&lt;/script&gt;: required a &lt; b, found –." in text


@pytest.mark.slow
def test_a_machine_without_graphics_gets_a_complete_report(run, monkeypatch, tmp_path):
    monkeypatch.setattr(page, "why_not_rendered", lambda: "exit status -11, no message")
    text = write_report(run, tmp_path).read_text()
    assert "Off-screen rendering is impossible on this machine: exit status -11" in text
    assert (tmp_path / "figures" / "force_A.png").exists()
    assert not (tmp_path / "renders").exists()


def test_a_renderer_that_fails_after_the_probe_does_not_fail_the_report(run, bare, monkeypatch, tmp_path):
    def fail(_):
        raise RuntimeError("lost the context")

    monkeypatch.setattr(page, "why_not_rendered", lambda: "")
    monkeypatch.setattr(page, "render_pictures", fail)
    assert "RuntimeError: lost the context" in write_report(run, tmp_path).read_text()


def test_an_empty_run_has_a_page(run, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "why_not_rendered", lambda: "a test says so")
    run.paths, run.lumping, run.summary = {}, (), {}
    text = write_report(run, tmp_path).read_text()
    assert "no rows in this run" in text


@pytest.mark.parametrize("fails", ["findings.md", "index.html"])
def test_a_report_that_fails_leaves_the_old_page(run, bare, monkeypatch, tmp_path, fails):
    index = write_report(run, tmp_path)
    failing = tmp_path / fails
    old = index.read_bytes(), failing.read_bytes()
    run.summary["command"] = "another"
    replace = os.replace

    def full_disk(source, target):
        if os.fspath(target) == os.fspath(failing):
            raise OSError(errno.ENOSPC, "disk full")
        replace(source, target)

    monkeypatch.setattr("os.replace", full_disk)
    with pytest.raises(OSError, match="disk full"):
        write_report(run, tmp_path)
    assert (index.read_bytes(), failing.read_bytes()) == old
    assert sorted(file.name for file in tmp_path.iterdir()) == ["findings.md", "index.html"]
