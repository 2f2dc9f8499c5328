"""What README, docs and the examples' pages say to type works as it stands there, from the page's top to its end.

A page is followed in a folder of its own: its commands, its programs, and the files that it has the reader write
(code blocks whose caption is a file's name). A command with a placeholder for the reader's own words, such as
DATA.csv, is held to its options only.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import types
from dataclasses import dataclass
from pathlib import Path

import pytest

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
SLOW = re.compile(
    r"^validate (all|map|diagnose|calibrate|identify (orthoglide|.*--solid)|(check|show) parts/|buckling .*exudyn)"
)
"""Steps that take more than two seconds or so."""
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
        """Whether it has a placeholder, or serves a page until it is stopped: its options are looked at only."""
        served = self.text.startswith("validate explore")
        return self.kind == "command" and (served or PLACEHOLDER.search(self.text) is not None)

    @property
    def slow(self) -> bool:
        if self.kind == "program":
            return "diagnose(" in self.text
        return self.kind == "command" and not self.placeholder and SLOW.search(self.text) is not None


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
    for step in todo:
        if step.kind == "file":
            Path(step.file).write_text(step.text, encoding="utf-8")
        elif step.kind == "output":
            # before any command it is a file's text
            if printed:
                promised(step.text, printed)
        elif step.kind == "program":
            program(step.text, capfd)
        else:
            words = shlex.split(step.text)[1:]
            if step.placeholder:
                words = [words[0], "--help"]
            status = run(words)
            said = capfd.readouterr()
            printed = said.out + said.err
            # a test of acceptance that fails is an answer, too
            assert status == 0, f"{name(page)}: {step.text}: status {status}: {said.err}"
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


def program(text: str, capfd: pytest.CaptureFixture[str]) -> None:
    if "__main__" in text:
        # processes that it spawns import its file
        file = Path("program_of_the_page.py")
        file.write_text(text, encoding="utf-8")
        done = subprocess.run([sys.executable, str(file)], capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        out = done.stdout
    else:
        # as a module of its own, for dataclasses look theirs up
        module = types.ModuleType("program_of_the_page")
        sys.modules[module.__name__] = module
        exec(compile(text, "program of the page", "exec"), module.__dict__)
        out = capfd.readouterr().out
    said = {float(v) for v in re.findall(r"\d+\.\d+", out)}
    promised = [float(v) for line in re.findall(r"# \[(.*?)\]", text) for v in line.split()]
    for value in promised:
        assert any(abs(value - other) < 0.06 for other in said), (value, out)


def quick(page: Path) -> list[Step]:
    """The steps before the first slow one."""
    found = steps(page)
    slow = [k for k, step in enumerate(found) if step.slow]
    return found[: slow[0]] if slow else found


WITH_SLOW = [page for page in PAGES if any(step.slow for step in steps(page))]


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if quick(page)], ids=name)
def test_a_page_does_what_it_says_up_to_what_takes_long(page, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    follow(page, quick(page), capfd)


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_SLOW, ids=name)
def test_a_page_does_what_it_says(page, tmp_path, monkeypatch, capfd):
    if any("--solid" in step.text or "parts/" in step.text for step in steps(page)):
        from helpers.solids import gmsh_or_skip

        gmsh_or_skip()
    monkeypatch.chdir(tmp_path)
    follow(page, steps(page), capfd)


def test_steps_are_found():
    page = ROOT / "docs/solid-parts.md"
    assert steps(page)[0].text == "validate example parts"
    assert [step.text for step in quick(page)] == ["validate example parts"] or len(quick(page)) > 1
    assert Step("command", "validate calibrate DATA.csv --sheet SHEET.toml").placeholder
    assert Step("command", "validate map orthoglide --scheduler tcp://host:8786").placeholder
    assert not Step("command", "validate stiffness ur10 --posture work --wrench 0,0,-100,0,0,0").placeholder
