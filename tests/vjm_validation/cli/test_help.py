"""The help: nothing in brackets is lost, examples can be parsed, pages are there."""

import re
import shlex
from pathlib import Path

import pytest

from vjm_validation.cli.main import COMMANDS, EXAMPLES, app
from vjm_validation.cli.main import run as command

ROOT = Path(__file__).parents[3]


def said(capsys, *arguments):
    command([*arguments, "--help"])
    return " ".join(re.sub(r"[│╭╮╰╯─]", " ", capsys.readouterr().out).split())


def test_what_stands_in_brackets_is_shown(capsys):
    assert "vjm-<n>" in said(capsys, "map")
    # lines may be broken within it
    shown = said(capsys, "curve").replace(" ", "")
    assert "[part@fraction:]fx,fy,fz[,mx,my,mz][:follower][:constant]" in shown


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_a_call_of_its_command_and_its_page_is_there(name, capsys):
    example, _, pages = EXAMPLES[name]
    words = shlex.split(example)
    assert words[:2] == ["validate", name]
    app.parse_args(words[1:], exit_on_error=False, print_error=False)
    assert all((ROOT / page).is_file() for page in pages.split(", "))
    assert "Example: validate" in said(capsys, name)


def test_every_example_is_of_a_command():
    assert set(EXAMPLES) <= set(COMMANDS)
