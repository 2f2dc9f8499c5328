"""Postures by coordinates in every command and in Python, axes of buckling, negative values, labels."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from helpers.command import validate

import vjm
from vjm_validation.cli.main import joined

BENT = {"shoulder": 0.5, "elbow": 1.2}
"""The posture `bent` of `planar-2r`."""
PATH = "x_mm,y_mm,z_mm,fx_N\n500,400,0,10\n"


@pytest.mark.parametrize("posture", ["0.5,1.2", "elbow=1.2,shoulder=0.5"])
def test_coordinates_are_the_posture_of_that_label(posture):
    words = ("--wrench", "-10,-20,0,0,0,0", "--json")
    by_label, by_numbers = (
        json.loads(validate("stiffness", "planar-2r", "--posture", each, *words).out) for each in ("bent", posture)
    )
    assert by_numbers.pop("posture") == "0.5,1.2"
    assert by_label.pop("posture") == "bent"
    assert by_numbers == by_label


@pytest.mark.parametrize("posture", [BENT, (0.5, 1.2), "0.5,1.2"])
def test_python_takes_them_too(posture):
    arm = vjm.load("planar-2r")
    asked = {"displacement": (0.0, -1.0, 0.0, 0.0, 0.0, 0.0)}
    found, known = (vjm.stiffness(arm, each, **asked) for each in (posture, "bent"))
    assert np.array_equal(found.loaded, known.loaded)
    standing, label = vjm.in_posture(arm, posture)
    paths = [vjm.trace(m, vjm.LoadCase(p, 1.0, "y"), engine="vjm-2") for m, p in ((standing, label), (arm, "bent"))]
    assert paths[0].points[-1].tangent == paths[1].points[-1].tangent
    along = {"directions": ["tension"], "engine": "vjm-2", "axis": "y", "to": 1.0}
    rows = [vjm.buckling(arm, [p], **along).rows()[0] for p in (posture, "bent")]
    assert rows[0]["K0"] == rows[1]["K0"]


@pytest.mark.parametrize("command", ["stiffness", "curve", "buckling", "map", "compensate", "show", "all"])
@pytest.mark.parametrize(
    ("posture", "said"),
    [
        ("0.5,2.7", "elbow = 2.7 exceeds its limit 2.6 by 0.1 rad"),
        ("-3.2,0", "shoulder = -3.2 is below its limit -3 by 0.2 rad"),
        ("30,40", "is it in degrees?"),
        ("0.5", "1 coordinates for 2 joints"),
        ("wrist=1,elbow=1", "no joint 'wrist'"),
        ("elbow=1", "no coordinate for 'shoulder'"),
        ("bend", "no posture 'bend' (it has stretched, bent, folded)"),
    ],
)
def test_every_command_refuses_what_the_joints_cannot(command, posture, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "path.csv").write_text(PATH)
    more = {
        "curve": ["--to", "1"],
        "compensate": [],
        "map": ["--grid", "elbow=0:1:2", "--out", "map"],
        "all": ["--out", "run"],
    }
    first = ["path.csv"] if command == "compensate" else []
    done = validate(command, "planar-2r", *first, "--posture", posture, *more.get(command, []))
    assert done.status == 2
    assert said in done.err
    assert done.err.strip().count("\n") == 0
    assert not (tmp_path / "run").exists()
    assert not (tmp_path / "map").exists()


def test_a_path_beyond_a_limit_and_one_near_the_stretched_arm(tmp_path):
    """Of the second the two exact answers are those of the loaded arm, residual 1e-14."""
    (tmp_path / "limit.csv").write_text("x_mm,y_mm,z_mm\n200,100,0\n")
    done = validate("compensate", "planar-2r", str(tmp_path / "limit.csv"), "--posture", "bent")
    assert done.status == 2
    assert re.search(r"row 1 .*elbow = -?2\.69057 .* by 0\.09057 rad", done.err)
    (tmp_path / "near.csv").write_text("x_mm,y_mm,z_mm,fx_N,fy_N\n899.99,0,0,50,-100\n")
    words = ("--posture", "bent", "--gravity", "0,-9.81,0", "--json", "--out", str(tmp_path / "out.csv"))
    done = validate("compensate", "planar-2r", str(tmp_path / "near.csv"), *words)
    document = json.loads(done.out)
    (q,) = document["commands"]["loaded"]
    # to the digits in which they are known
    assert min(np.abs(np.subtract(q, known)).max() for known in ((0.05305, 0.06047), (0.06192, 0.04026))) < 6e-6
    assert document["left"]["loaded"]["largest_mm"] < 1e-7
    header, row = (line.split(",") for line in (tmp_path / "out.csv").read_text().splitlines())
    shown = float(row[header.index("loaded.error_rad")])
    assert document["left"]["loaded"]["largest_rad"] == pytest.approx(shown, rel=1e-9)
    assert shown > 0.01


def test_buckling_along_an_axis_is_the_curve_along_it():
    asked = ("--posture", "0.5,1.2", "--axis", "y", "--engine", "vjm-2", "--json")
    found = json.loads(validate("buckling", "planar-2r", "--to", "1", "--direction", "+", *asked).out)
    curve = json.loads(validate("curve", "planar-2r", "--to", "1", *asked).out)
    assert found["chain"]["0.5,1.2"]["tension"]["vjm-2"]["K0"] == pytest.approx(curve["points"][0]["stiffness"])
    refused = validate("buckling", "planar-2r", "--axis", "rz")
    assert (refused.status, "--to: with --axis rz say up to how many" in refused.err) == (2, True)


COLUMN = ("curve", "pinned-column", "--axis", "load", "--free", "x", "--control", "limit", "--engine", "vjm-8")


def test_a_driven_force_is_labelled_in_newtons():
    """As a force of 1 N times its factor, as ten of them, and as `--force` drives it: one critical force."""
    one = validate(*COLUMN, "--load", "-1,0,0", "--to", "3000").out
    force = re.search(r"bifurcation at \S+ mm, force (\S+) N", one)
    assert force
    ten = validate(*COLUMN, "--load", "-10,0,0", "--to", "300").out
    factor = re.search(r"bifurcation at \S+ mm, load factor (\S+) \((\S+) N\)", ten)
    assert factor
    # both are printed to six digits
    assert float(factor[2]) == pytest.approx(float(force[1]), rel=1e-5)
    assert float(factor[1]) == pytest.approx(0.1 * float(force[1]), rel=1e-5)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (
            "identify --base -1,-60,0 --tip 2,0,0",
            "identify --base=-1,-60,0 --tip 2,0,0",
        ),
        ("curve m --to -4 --json", "curve m --to=-4 --json"),
        ("map m --gravity -.1,0,0", "map m --gravity=-.1,0,0"),
        ("buckling m --posture 0.1,1 -0.1,1", "buckling m --posture 0.1,1 --posture=-0.1,1"),
        ("all m --direction -x --to -1", "all m --direction -x --to=-1"),
        ("simulate m --ramp A:1 A:-2", "simulate m --ramp A:1 A:-2"),
        ("curve m --load=-1,0,0", "curve m --load=-1,0,0"),
    ],
)
def test_values_that_begin_with_a_minus_are_values(words, expected):
    assert joined(words.split()) == expected.split()


@pytest.mark.parametrize("spring", ["", "stiffness_Nmm_per_rad = 1e5"])
def test_limits_of_passive_joints_hold_by_label_and_by_numbers(spring, tmp_path):
    template = tmp_path / "chain.toml"
    validate("new", "chain", str(template))
    free = 'name = "q1"\naxis = "z"\n'
    text = template.read_text().replace(free, f"{free}limits_rad = [-0.5, 0.5]\n{spring}\n")
    said = "out of reach: q1 = 0.6 exceeds its limit 0.5 by 0.1 rad"
    template.write_text(text)
    found = validate("stiffness", str(template), "--posture", "0.6,-0.6")
    assert found.status == 2
    assert said in found.err
    template.write_text(text.replace("bent = { q1 = 0.4", "bent = { q1 = 0.6"))
    found = validate("stiffness", str(template), "--posture", "bent")
    assert found.status == 2
    assert said in found.err
