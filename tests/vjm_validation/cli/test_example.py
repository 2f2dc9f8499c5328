"""``validate example``: copies whole, names what to run next, never writes over anything."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from vjm_validation.cli.example import first_command, names
from vjm_validation.cli.main import app, run

ROOT = Path(__file__).parents[3]
SOURCE = ROOT / "validation/vjm_validation/examples"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_all_are_listed(capsys):
    assert run(["example"]) == 0
    said = capsys.readouterr().out
    assert names() == sorted(folder.name for folder in SOURCE.iterdir())
    assert [line.split()[0] for line in said.splitlines()[:-1]] == names()


@pytest.mark.parametrize("name", names())
def test_it_is_copied_whole_and_the_next_command_can_be_typed(name, capsys):
    assert run(["example", name]) == 0
    assert f"next: {first_command(name)}" in capsys.readouterr().out
    for file in SOURCE.joinpath(name).iterdir():
        assert Path(name, file.name).read_bytes() == file.read_bytes()
    words = shlex.split(first_command(name))
    app.parse_args(words[1:], exit_on_error=False, print_error=False)
    assert all(Path(word).is_file() for word in words if word.endswith((".csv", ".toml", ".step")))


def test_another_folder_stands_in_the_next_command(capsys):
    assert run(["example", "leg", "--out", "own/my-leg"]) == 0
    assert "next: validate buckling own/my-leg/leg.toml\n" in capsys.readouterr().out


def test_nothing_is_written_over(capsys):
    assert run(["example", "leg"]) == 0
    Path("leg/leg.toml").write_text("mine")
    assert run(["example", "leg"]) == 2
    assert (
        capsys.readouterr().err
        == "validate: leg: exists already; give another folder by --out, or remove it first\n"
    )
    assert Path("leg/leg.toml").read_text() == "mine"


def test_a_wrong_name_is_refused_with_the_near_one(capsys):
    assert run(["example", "lag"]) == 2
    assert "did you mean 'leg'" in capsys.readouterr().err
    assert list(Path().iterdir()) == []
