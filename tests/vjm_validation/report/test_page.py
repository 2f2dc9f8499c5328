"""The page: complete, self-contained, honest about what is missing."""

import base64
import io
import os
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from vjm_output.off_screen import why_not_rendered
from vjm_validation.report import page
from vjm_validation.report.findings import findings
from vjm_validation.report.page import write_report

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


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
def folder(computed, tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    assert write_report(computed, out) == out / "index.html"
    return out


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "index.html").read_text()


@pytest.fixture
def bare(monkeypatch):
    """No pictures: for tests of the words around them."""
    monkeypatch.setattr(page, "why_not_rendered", lambda: "a test says so")
    monkeypatch.setattr(page, "posture_pictures", lambda run, posture: [])
    monkeypatch.setattr(page, "lumping_pictures", lambda run: [])
    monkeypatch.setattr(page, "foot_picture", lambda run: None)
    monkeypatch.setattr(page, "published_picture", lambda run: None)
    monkeypatch.setattr(page, "iteration_picture", lambda run: None)


def test_a_campaign_beside_the_report_is_linked(computed, bare, tmp_path):
    assert "blind.html" not in write_report(computed, tmp_path / "run").read_text()
    (tmp_path / "blind").mkdir()
    (tmp_path / "blind" / "blind.html").write_text("a campaign")
    (link,) = [a for a in Elements(write_report(computed, tmp_path / "run").read_text()).all("a")
               if a.get("href", "").endswith("blind.html")]  # fmt: skip
    assert (tmp_path / "run" / link["href"]).read_text() == "a campaign"


def test_no_external_reference(text):
    elements = Elements(text)
    ids = {attributes["id"] for _, attributes in elements.found if "id" in attributes}
    for tag, attributes in elements.found:
        assert tag not in {"script", "iframe", "object", "embed", "base"}
        for name in ("src", "href", "srcset", "data", "action", "poster"):
            value = attributes.get(name)
            if value is not None and not value.startswith("data:"):
                assert value.startswith("#"), (tag, name, value)
                assert value[1:] in ids
    assert "@import" not in text
    assert not re.search(r"url\(\s*['\"]?(?!data:)", text)


def test_every_image_decodes_and_shows_something(text, folder):
    images = Elements(text).all("img")
    files = [*(folder / "figures").iterdir(), *(folder / "renders").iterdir()]
    embedded = []
    for image in images:
        assert image["alt"]
        content = base64.b64decode(image["src"].removeprefix("data:image/png;base64,"), validate=True)
        embedded.append(content)
        pixels = np.asarray(Image.open(io.BytesIO(content)).convert("L"))
        assert min(pixels.shape) > 300
        assert 0.005 < np.mean(pixels < 200) < 0.5
    assert sorted(embedded) == sorted(file.read_bytes() for file in files)
    assert {"force_A.png", "stiffness_A.png", "difference_A.png", "link_lumping.png", "foot_law.png",
            "lumping_convergence.png", "iterations.png"} <= {file.name for file in files}  # fmt: skip


def test_renders_show_compression_and_the_artefact(folder):
    if reason := why_not_rendered():
        pytest.skip(f"no off-screen rendering: {reason}")
    assert {file.name for file in (folder / "renders").iterdir()} == {"A_compression.png", "A_tension.png"}


def test_no_temporary_file_is_left(folder):
    """Pictures, the page, the findings, and nothing else."""
    assert {file.name for file in folder.iterdir()} <= {"index.html", "findings.md", "figures", "renders"}
    pictures = [*(folder / "figures").iterdir(), *(folder / "renders").iterdir()]
    assert not [file for file in pictures if file.suffix != ".png" or file.name.startswith(".")]


def test_findings_md_needs_nothing_but_its_figures(folder, computed):
    text = (folder / "findings.md").read_text()
    links = re.findall(r"!?\[[^\]]*\]\(([^)]*)\)", text)
    assert {"figures/link_lumping.png", "figures/foot_law.png", "figures/iterations.png"} <= set(links)
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
    assert text.count("<details") == text.count("</details>") == len(tables)
    assert text.count("ab" * 32) == 64


def test_absent_values_are_dashes(text):
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", text)
    assert "–" in cells
    assert not {"None", "nan", "null"} & set(cells)


def test_nothing_failed_here(text):
    assert "FAILED" not in text
    assert 'class="finding failed"' not in text


def test_a_failed_row_is_prominent(run, bare, tmp_path):
    run.summary["acceptance"].append(
        {"name": "<script>residuals</script>", "requirement": "a < b", "value": None, "passed": False}
    )
    text = write_report(run, tmp_path).read_text()
    assert text.index('class="finding failed"') < text.index('class="finding agrees"')
    assert '<tr class="bad">' in text
    assert "<script>" not in text
    assert "&lt;script&gt;residuals&lt;/script&gt;: required a &lt; b, found –." in text


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
    run.paths, run.lumping, run.iterations, run.summary = {}, (), (), {}
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
            raise OSError("disk full")
        replace(source, target)

    monkeypatch.setattr("os.replace", full_disk)
    with pytest.raises(OSError, match="disk full"):
        write_report(run, tmp_path)
    assert (index.read_bytes(), failing.read_bytes()) == old
    assert sorted(file.name for file in tmp_path.iterdir()) == ["findings.md", "index.html"]


def browse(tmp_path, *arguments):
    return subprocess.run(
        [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
         "--no-first-run", "--hide-scrollbars", f"--user-data-dir={tmp_path / 'profile'}", *arguments],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path")
def test_a_browser_shows_it(folder, tmp_path):
    shot = tmp_path / "page.png"
    browse(tmp_path, f"--screenshot={shot}", "--window-size=1200,2400", (folder / "index.html").as_uri())
    pixels = np.asarray(Image.open(shot).convert("L"))
    assert pixels.shape == (2400, 1200)
    halves = (pixels[:1200], pixels[1200:])
    assert all(0.01 < np.mean(half < 128) < 0.5 for half in halves)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path")
@pytest.mark.parametrize("width", [500, 1200])
def test_wide_content_does_not_overflow(text, tmp_path, width):
    probe = "<script>document.title = document.documentElement.scrollWidth + '/' + innerWidth</script></body>"
    copy = tmp_path / "probed.html"
    copy.write_text(text.replace("</body>", probe))
    done = browse(tmp_path, "--dump-dom", f"--window-size={width},900", copy.as_uri())
    content, window = map(int, re.search(r"<title>(\d+)/(\d+)</title>", done.stdout).groups())
    assert window == width
    assert content <= window
