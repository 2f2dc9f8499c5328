"""What README, docs and the examples' pages say to type works as it stands there, from the page's top to its end.

A page is followed in a folder of its own: its commands, its programs, and the files that it has the reader write
(code blocks whose caption is a file's name). A command with a placeholder for the reader's own words, such as
DATA.csv, is held to its options only.
"""

import doctest
import os
import re
import shlex
import subprocess
import sys
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import vjm
from vjm_validation.cli.main import run

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "validation/vjm_validation/examples"
GENERATED = re.compile(r"reference/(cli|.*-keys)\.md")
"""Pages that the site's build makes of the programs."""
PAGES = [
    ROOT / "README.md",
    *sorted(page for page in (ROOT / "docs").rglob("*.md") if not GENERATED.search(page.as_posix())),
    *sorted(EXAMPLES.glob("*/README.md")),
]
STEP = re.compile(
    r"^```\{code-block\} *\w*\n:caption: (?P<file>\S+)\n\n?(?P<content>.*?)^```$"
    r"|^```(?:python|\{code-block\} python)\n(?P<program>.*?)^```$"
    r"|^```text\n(?P<output>.*?)^```$"
    r"|^```.*?^```$"
    r"|^    (?P<command>validate \w.*?)(?:  #.*)?$",
    re.DOTALL | re.MULTILINE,
)
PLACEHOLDER = re.compile(r"\b[A-Z]{3,}\b|…|\[--|\w\|\w|tcp://")
LAST_DIGITS = 1e-3
"""Of a number that a page shows."""


@dataclass(frozen=True)
class Step:
    """Something that a page has its reader do."""

    kind: str
    text: str
    file: str = ""

    @property
    def placeholder(self) -> bool:
        """Whether its options are looked at only.

        It has a placeholder, serves a page until it is stopped, or is what a whole run of `test_run_all` does.
        """
        served = self.text.startswith(("validate explore", "validate all --only verification"))
        return self.kind == "command" and (served or PLACEHOLDER.search(self.text) is not None)


def steps(page: Path) -> list[Step]:
    found = [
        Step("file", match["content"], match["file"]) if match["file"]
        else Step("program", match["program"]) if match["program"]
        else Step("output", match["output"]) if match["output"]
        else Step("command", match["command"])
        for match in STEP.finditer(page.read_text(encoding="utf-8"))
        if any(match.groupdict().values())
    ]  # fmt: skip
    if page.parent.parent == EXAMPLES:
        return [Step("command", f"validate example {page.parent.name}"), *found]
    return found


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def follow(page: Path, todo: list[Step], capfd: pytest.CaptureFixture[str]) -> None:
    printed = ""
    # a page's programs go on from one another, as a module of its own, for dataclasses look theirs up
    module = sys.modules["program_of_the_page"] = types.ModuleType("program_of_the_page")
    for step in todo:
        if step.kind == "file":
            Path(step.file).write_text(step.text, encoding="utf-8")
        elif step.kind == "output":
            # before any command it is a file's text
            if printed:
                promised(step.text, printed)
        elif step.kind == "program":
            program(step.text, module.__dict__, capfd)
        else:
            words = shlex.split(step.text)[1:]
            if step.placeholder:
                words = [words[0], "--help"]
            status = run(words)
            said = capfd.readouterr()
            printed = said.out + said.err
            # where the page says so, an answer that is not good enough is what it shows
            expected = (0, 1) if "exit status is 1" in page.read_text(encoding="utf-8") else (0,)
            assert status in expected, f"{name(page)}: {step.text}: status {status}: {said.err}"
            if step.placeholder:
                options = re.findall(r"(?<![\w-])--[a-z][a-z-]*", step.text)
                assert [option for option in options if option not in said.out] == [], step.text


def promised(block: str, printed: str) -> None:
    """Hold what a page shows of a command's output to what it prints: each line, some columns of it."""
    lines = [words(line) for line in printed.splitlines()]
    for line in filter(None, map(words, block.splitlines())):
        starts = [(k, at) for k, own in enumerate(lines) for at in range(len(own) - len(line) + 1)]
        assert any(all(map(alike, line, lines[k][at : at + len(line)])) for k, at in starts), (
            f"{' '.join(line)}\nis not in\n{printed}"
        )


def words(line: str) -> list[str]:
    return [word.rstrip(";") for word in re.sub(r"[│┃━─]", " ", line).split()]


def alike(shown: str, printed: str) -> bool:
    """Whether two words are one, or the same number but for its last digits, which hang on the processor."""
    if shown == printed:
        return True
    try:
        apart, size = abs(float(shown) - float(printed)), abs(float(printed))
    except ValueError:
        return False
    # rounding may turn the last digit that is shown over
    last = 10.0 ** -len(shown.partition(".")[2]) if "e" not in shown else 0.0
    return apart <= max(1.01 * last, LAST_DIGITS * size)


def program(text: str, names: dict[str, Any], capfd: pytest.CaptureFixture[str]) -> None:
    if "__main__" in text:
        # processes that it spawns import its file
        file = Path("program_of_the_page.py")
        file.write_text(text, encoding="utf-8")
        done = subprocess.run([sys.executable, str(file)], capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        out = done.stdout
    elif text.startswith(">>>"):
        session = doctest.DocTestParser().get_doctest(text, names, "session of the page", None, 0)
        result = doctest.DocTestRunner().run(session, clear_globs=False)
        names.update(session.globs)
        out = capfd.readouterr().out
        assert result.failed == 0, out
    else:
        exec(compile(text, "program of the page", "exec"), names)
        out = capfd.readouterr().out
    said = {float(v) for v in re.findall(r"\d+\.\d+", out)}
    promised = [float(v) for line in re.findall(r"# \[(.*?)\]", text) for v in line.split()]
    for value in promised:
        assert any(abs(value - other) < 0.06 for other in said), (value, out)


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if steps(page)], ids=name)
def test_a_page_does_what_it_says(page, tmp_path, monkeypatch, capfd):
    if any("--solid" in step.text or "parts/" in step.text for step in steps(page)):
        from helpers.solids import gmsh_or_skip

        gmsh_or_skip()
    monkeypatch.chdir(tmp_path)
    follow(page, steps(page), capfd)


def test_steps_are_found():
    page = ROOT / "docs/solid-parts.md"
    assert steps(page)[0].text == "validate example parts"
    assert Step("command", "validate calibrate DATA.csv --sheet SHEET.toml").placeholder
    assert Step("command", "validate map orthoglide --scheduler tcp://host:8786").placeholder
    assert not Step("command", "validate stiffness ur10 --posture work --wrench 0,0,-100,0,0,0").placeholder


# The page From Python does what it says: its lines run in their order and print what stands below them.


PAGE = Path(__file__).parents[2] / "docs/from-python.md"


def test_the_page_prints_what_it_shows():
    text = "\n".join(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL))
    page = doctest.DocTestParser().get_doctest(text, {}, PAGE.name, str(PAGE), 0)
    assert len(page.examples) > 20
    told: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(page, out=told.append)
    assert result.failed == 0, "".join(told)


# The first tutorial as a notebook, which the gallery offers to load: it runs and gets the tutorial's figures.


DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def notebook():
    """The notebook that sphinx-gallery makes of the program."""
    pytest.importorskip("sphinx_gallery")
    from sphinx_gallery.gen_gallery import DEFAULT_GALLERY_CONF
    from sphinx_gallery.notebook import jupyter_notebook
    from sphinx_gallery.py_source_parser import split_code_and_text_blocks

    program = DOCS / "gallery/plot_arm_map.py"
    return jupyter_notebook(
        split_code_and_text_blocks(str(program))[1], {**DEFAULT_GALLERY_CONF}, str(program.parent)
    )


def test_the_notebook_of_the_first_tutorial_runs(notebook, capsys):
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) == 3
    kernel = {}
    with mpl.rc_context({"backend": "agg"}):
        for cell in cells:
            exec(compile(cell, "cell", "exec"), kernel)
        sys.modules["matplotlib.pyplot"].close("all")
    out = capsys.readouterr().out
    tutorial = (DOCS / "tutorials/urdf-arm.md").read_text(encoding="utf-8")
    sinks = float(re.search(r"sinks by (\S+) mm", tutorial)[1])
    least, largest = (float(v) for v in re.search(r"kt_min_N_per_mm: (\S+) to (\S+)", tutorial).groups())
    # the tutorial rounds to its last digit; the notebook's grid is denser and ends at the same corners
    assert -kernel["found"].deflection[0, 0, 2] == pytest.approx(sinks, abs=0.006)
    assert (np.min(kernel["weakest"]), np.max(kernel["weakest"])) == pytest.approx((least, largest), rel=1e-4)
    assert f"from {least:.1f} to {largest:.1f} N/mm" in out


# The documentation's site builds without a warning, and lists what is public. Its build takes half a minute.

SITE_DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site without its gallery's figures."""
    for module in ("sphinx", "myst_parser", "furo", "sphinx_design", "sphinx_gallery"):
        pytest.importorskip(module)
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", str(folder / ".doctrees"),
         str(SITE_DOCS), str(folder)],
        capture_output=True, text=True, env={**os.environ, "VJM_DOCS_QUICK": "1"}, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_every_page_is_in_the_site(site):
    pages = {
        page.relative_to(SITE_DOCS).with_suffix(".html")
        for page in SITE_DOCS.rglob("*.md")
        if "_build" not in page.parts
    }
    assert {page for page in pages if not (site / page).is_file()} == set()


def test_every_public_name_is_documented():
    """What the page asks the build for; the build fails where it does not find it."""
    page = (SITE_DOCS / "reference/python.md").read_text(encoding="utf-8")
    documented = re.findall(r"^\.\. auto\w+:: vjm\.(\w+)$", page, re.M)
    assert sorted(documented) == sorted(name for name in vjm.__all__ if name != "__version__")


@pytest.mark.slow
def test_the_site_has_every_public_name(site):
    page = (site / "reference/python.html").read_text()
    documented = set(re.findall(r'id="vjm\.([A-Za-z_]+)"', page))
    assert documented == {name for name in vjm.__all__ if name != "__version__"}
    assert "vjm.__version__" in page


@pytest.mark.slow
def test_the_command_line_is_the_parser_s(site):
    page = (site / "reference/cli.html").read_text()
    for name in ("validate example", "--imperfection", "--effects"):
        assert name in page


@pytest.mark.slow
def test_formulas_ask_nobody_for_a_script(site):
    page = (site / "theory/stiffness.html").read_text()
    assert page.count("<math") > 20
    assert re.findall(r"<script[^>]*https?:", page) == []


def test_pages_for_learning_have_a_figure():
    pages = [page for folder in ("tutorials", "theory", "how-well") for page in (SITE_DOCS / folder).glob("*.md")]
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


@pytest.mark.slow
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
