"""Options that are well-formed and mistaken: one line, status 2, nothing written."""

from __future__ import annotations

import pytest

from vjm.plain_numbers import plain_number, whole_number
from vjm_validation.cli.main import run

MISTAKES = {
    "a ramp of nothing": ("curve orthoglide-chain --to 1e-320", "further than 1e-100"),
    "Arabic-Indic digits of an end": ("curve orthoglide-chain --to ١", "digits 0 to 9"),
    "of steps": ("curve orthoglide-chain --to 1 --steps ٣", "digits 0 to 9"),
    "of a wrench": ("stiffness orthoglide-chain --wrench ١٠,0,0,0,0,0", "six numbers"),
    "of an engine": ("curve orthoglide-chain --to 1 --engine vjm-١٦", "unknown engine"),
    "of segments by part": ("curve orthoglide-chain --to 1 --segments link=١٦", "no whole number"),
    "of a grid": ("map orthoglide --grid x=٠:٢:٣", "digits 0 to 9"),
    "an axis of a grid twice": ("map orthoglide --grid x=1,x=2", "x is given twice"),
    "a word too many": ("check orthoglide-chain other.toml more", "other.toml more: nothing more is taken here"),
    "a number with underscores": ("stiffness orthoglide-chain --wrench 1_0,0,0,0,0,0", "six numbers"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistaken_option_is_refused_in_one_line(name, capsys, tmp_path):
    command, words = MISTAKES[name]
    out = ["--out", str(tmp_path / "out")] if command.startswith("map") else []
    assert run([*command.split(), *out]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_numbers_are_the_digits_0_to_9():
    assert plain_number(" -1.5e3 ") == -1500.0
    assert whole_number("16") == 16
    for word in ("١", "1_0", "ten", ""):
        with pytest.raises(ValueError):
            plain_number(word)
        with pytest.raises(ValueError):
            whole_number(word)
