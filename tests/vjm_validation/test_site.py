"""The documentation's site builds without a warning, and lists what is public."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import vjm

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site without its gallery's figures."""
    for module in ("sphinx", "myst_parser", "furo", "sphinx_design", "sphinx_gallery"):
        pytest.importorskip(module)
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", str(folder / ".doctrees"), str(DOCS),
         str(folder)],
        capture_output=True, text=True, env={**os.environ, "VJM_DOCS_QUICK": "1"}, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


def test_every_page_is_in_the_site(site):
    pages = {
        page.relative_to(DOCS).with_suffix(".html") for page in DOCS.rglob("*.md") if "_build" not in page.parts
    }
    assert {page for page in pages if not (site / page).is_file()} == set()


def test_every_public_name_is_documented(site):
    page = (site / "reference/python.html").read_text()
    documented = set(re.findall(r'id="vjm\.([A-Za-z_]+)"', page))
    assert documented == {name for name in vjm.__all__ if name != "__version__"}
    assert "vjm.__version__" in page


def test_the_command_line_is_the_parser_s(site):
    page = (site / "reference/cli.html").read_text()
    for name in ("validate example", "--imperfection", "--effects"):
        assert name in page


def test_formulas_ask_nobody_for_a_script(site):
    page = (site / "theory/stiffness.html").read_text()
    assert page.count("<math") > 20
    assert re.findall(r"<script[^>]*https?:", page) == []


def test_pages_for_learning_have_a_figure():
    pages = [page for folder in ("tutorials", "theory", "how-well") for page in (DOCS / folder).glob("*.md")]
    assert len(pages) > 20
    assert [page.name for page in pages if "![" not in page.read_text(encoding="utf-8")] == []


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


CLICKS = 3
"""Links that may lie between the landing page and an answer."""


def article(page: Path) -> str:
    """What a page says beside its menus."""
    return page.read_text(encoding="utf-8").partition("<article")[2].partition("</article>")[0]


def followed(page: Path, link: str) -> Path:
    """The page behind a link, by the words of the link."""
    shown = {
        " ".join(re.sub(r"<[^>]*>", "", words).split()): target
        for target, words in re.findall(r'<a [^>]*?href="([^"]+)"[^>]*>(.*?)</a>', article(page), re.DOTALL)
    }
    assert link in shown, f"{page.name}: no link says {link!r}; they say {', '.join(shown)}"
    return (page.parent / shown[link].partition("#")[0]).resolve()


@pytest.mark.parametrize(
    ("links", "answer"),
    [
        (("Describe an arm",), "validate new arm"),
        (("Stiffness map",), "validate map"),
        (("From a tracker",), "validate calibrate"),
        (("How well it works",), "against Exudyn"),
        (("How well it works", "a real robot"), "tracker"),
    ],
    ids=["describe an arm", "its stiffness map", "calibrate from a tracker", "how right it is", "on a real robot"],
)
def test_a_newcomer_finds_it_from_the_landing_page(site, links, answer):
    assert len(links) <= CLICKS
    page = site / "index.html"
    for link in links:
        page = followed(page, link)
    # code blocks have their words in spans
    assert answer in " ".join(re.sub(r"<[^>]*>", "", article(page)).split())
