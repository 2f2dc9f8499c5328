"""``validate compensate``: a path of an arm and of a platform, and files that are wrong."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from vjm_validation.cli.main import run
from vjm_validation.compensation import CompensationDocument

HEAD = "x_mm,y_mm,z_mm,fx_N,fy_N,fz_N\n"


@pytest.fixture
def square(tmp_path):
    file = tmp_path / "square.csv"
    corners = [(500, 300), (600, 300), (600, 400)]
    file.write_text("# a comment\n" + HEAD + "".join(f"{x},{y},0,0,-100,0\n" for x, y in corners))
    return file


def test_an_arm_s_path(square, tmp_path, capsys):
    out, plot = tmp_path / "out.csv", tmp_path / "out.png"
    words = [
        "compensate",
        "planar-2r",
        str(square),
        "--gravity",
        "0,-9.81,0",
        "--out",
        str(out),
        "--plot",
        str(plot),
        "--report",
        str(tmp_path / "page.html"),
    ]
    assert run([*words, "--json"]) == 0
    document = CompensationDocument.model_validate(json.loads(capsys.readouterr().out))
    assert document.joints == ["shoulder", "elbow"]
    left = document.left
    assert left["loaded"].largest_mm < 1e-6 < left["linear"].largest_mm < 0.1 * left["rigid"].largest_mm
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert len(rows) == document.poses == 3
    assert float(rows[1]["loaded.elbow"]) == pytest.approx(document.commands["loaded"][1][1], abs=1e-11)
    # twelve digits are written
    left_over = np.linalg.norm(document.errors["rigid"][2][:3])
    assert float(rows[2]["rigid.error_mm"]) == pytest.approx(left_over, rel=1e-11)
    assert plot.stat().st_size > 5000
    page = (tmp_path / "page.html").read_text()
    assert "compensation along 3 poses" in page
    assert f"the rigid {left['rigid'].largest_mm:.3g} mm" in page


def test_a_platform_s_path(tmp_path, capsys):
    file = tmp_path / "path.csv"
    file.write_text(HEAD + "0,0,0,0,0,-500\n20,10,5,300,0,0\n")
    assert run(["compensate", "orthoglide", str(file), "--engine", "vjm-paper", "--json"]) == 0
    left = json.loads(capsys.readouterr().out)["left"]
    assert left["loaded"]["largest_mm"] < 1e-6 < left["linear"]["largest_mm"] < 0.2 * left["rigid"]["largest_mm"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no path; give a line of columns"),
        (HEAD, "no path; give a line of columns"),
        ("x_mm,y_mm\n1,2\n", ":1: column 'z_mm' is missing"),
        ("x_mm,y_mm,z_mm,rx_rad\n1,2,3,4\n", ":1: column 'ry_rad' is missing"),
        ("x,y_mm,z_mm\n1,2,3\n", ":1: unknown column 'x'"),
        ("x_mm,y_mm,z_mm\n1,2\n", ":2: 2 values for 3 columns"),
        ("x_mm,y_mm,z_mm\n1,2,3\n1,nan,3\n", ":3: y_mm: 'nan' is no finite number"),
        ("x_mm,y_mm,z_mm\n5000,0,0\n", "row 1 of the path: planar-2r: out of reach"),
    ],
)
def test_a_wrong_path_is_refused_in_one_line(text, said, tmp_path, capsys):
    file = tmp_path / "path.csv"
    file.write_text(text)
    assert run(["compensate", "planar-2r", str(file), "--out", str(tmp_path / "out.csv")]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out.csv").exists()


def test_a_mechanism_is_refused(square, capsys):
    assert run(["compensate", "orthoglide-chain", str(square)]) == 2
    assert "its passive joints leave the end a mechanism" in capsys.readouterr().err
