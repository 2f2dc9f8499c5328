"""What README and docs say to type works as it stands there."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.command import validate

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/load-cases.md")
OWN = ("all", "my-robot.toml")
"""Commands that other tests run whole, and those on a reader's own file."""


def commands():
    lines = [line for page in PAGES for line in (ROOT / page).read_text().splitlines()]
    found = [line.strip().partition("  #")[0] for line in lines if re.match(r"    validate \w", line)]
    return [command for command in found if not set(OWN) & set(command.split())]


def programs():
    return [
        pytest.param(program, id=f"{page}-{i}")
        for page in PAGES
        for i, program in enumerate(re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL))
    ]


@pytest.mark.parametrize("command", commands())
def test_a_command_works(command):
    finished = validate(*shlex.split(command)[1:])
    assert finished.status == 0, finished.err


@pytest.mark.parametrize("program", programs())
def test_a_program_works(program, tmp_path):
    # a file of its own: processes that it spawns import it
    file = tmp_path / "example.py"
    file.write_text(program)
    done = subprocess.run(
        [sys.executable, str(file)], capture_output=True, text=True, cwd=tmp_path, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    said = {float(v) for v in re.findall(r"\d+\.\d+", done.stdout)}
    promised = [float(v) for line in re.findall(r"# \[(.*?)\]", program) for v in line.split()]
    for value in promised:
        assert any(abs(value - other) < 0.06 for other in said), (value, done.stdout)
