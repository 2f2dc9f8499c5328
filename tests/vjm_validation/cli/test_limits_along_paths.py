"""Where a path leads a joint beyond its limit, the command says at which load and displacement."""

from __future__ import annotations

import json
import re
from importlib.resources import files

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from vjm_validation.cli.main import run

LENGTH, LIMIT = 299.085, 0.5
EI = 68948.0 * 25.4 * 3.175**3 / 12.0
EA = 68948.0 * 25.4 * 3.175


@pytest.fixture
def column(tmp_path):
    """The library's pinned bar, its hinges with limits."""
    text = (files("vjm") / "models/pinned-column.toml").read_text("utf-8")
    file = tmp_path / "column.toml"
    file.write_text(text.replace('axis = "z"', f'axis = "z"\nlimits_rad = [{-LIMIT}, {LIMIT}]'))
    return str(file)


def elastica():
    """Force, N, and shortening, mm, of a pinned column whose ends have turned by the limit; with axial strain."""
    m = np.sin(0.5 * LIMIT) ** 2
    force = EI * (2.0 * ellipk(m) / LENGTH) ** 2
    return force, LENGTH * (2.0 - 2.0 * ellipe(m) / ellipk(m)) + force * LENGTH / EA


@pytest.mark.parametrize(
    "words", [["curve", "--to", "-30", "--steps", "60"], ["buckling", "--to", "30", "--direction=-"]]
)
def test_passive_joints_of_a_buckled_column(column, capsys, words):
    command, *options = words
    assert run([command, column, *options, "--json"]) == 0
    out, err = capsys.readouterr()
    force, shortening = elastica()
    found = re.findall(
        r"joint '(q\d)' reaches its limit 0.5 rad at a displacement of (\S+) mm and force (\S+) N", err
    )
    assert [name for name, *_ in found] == ["q1", "q2"]
    for _, at, driven in found:
        # 16 springs miss the elastica by π²/(12·16²), and a straight line between points by less
        assert float(at) == pytest.approx(shortening, rel=4e-3)
        assert float(driven) == pytest.approx(force, rel=4e-3)
    assert sum("reaches its limit" in row["found"] for row in json.loads(out)["doubts"]) == 2
    # in strict use it is refused, and a path that ends before says nothing
    assert run([command, column, *options, "--strict"]) == 2
    capsys.readouterr()
    short = [option.replace("30", "15") for option in options]
    assert run([command, column, *short, "--json"]) == 0
    assert "limit" not in capsys.readouterr().err


def test_a_drive_that_yields(tmp_path, capsys):
    """A lever of length L on a drive of compliance c turns by θ under F = θ / (c L cos θ)."""
    c, lever, limit = 1e-5, 100.0, 0.1
    file = tmp_path / "lever.toml"
    file.write_text(
        'format = 1\nname = "lever"\ntitle = "a lever"\nsource = "test"\n'
        'units = { length = "mm", force = "N", angle = "rad" }\n'
        '[[parts]]\nkind = "actuated"\nname = "drive"\naxis = "z"\n'
        f"compliance_rad_per_Nmm = {c}\nlimits_rad = [-1.0, {limit}]\n"
        f'[[parts]]\nkind = "link"\nname = "bar"\ntranslation_mm = [{lever}, 0.0, 0.0]\n'
        "[postures]\nhome = { drive = 0.0 }\n"
    )
    words = ["--axis", "load", "--load=0,1,0", "--free", "x,y,z,rx,ry,rz", "--to", "200", "--steps", "50"]
    assert run(["curve", str(file), *words]) == 0
    (force,) = re.findall(r"joint 'drive' reaches its limit 0.1 rad at force (\S+) N", capsys.readouterr().err)
    assert float(force) == pytest.approx(limit / (c * lever * np.cos(limit)), rel=1e-4)
