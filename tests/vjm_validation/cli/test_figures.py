"""``--plot`` and ``--report``: what they write, and what they refuse."""

import io
import re

import numpy as np
import pytest
from PIL import Image

from vjm_validation.cli.main import run as command

CALLS = {
    "curve": ["curve", "pinned-column", "--to", "-1"],
    "buckling": ["buckling", "pinned-column", "--direction", "-", "--to", "1"],
    "stiffness": ["stiffness", "orthoglide-chain", "--posture", "A", "--displacement", "0.2,0,0,0,0,0"],
    "identify": ["identify", "--matrix", "foot-19"],
}


# what fits beams to a matrix takes half a minute
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n == "identify" else ()) for n in CALLS]
)
def test_a_command_draws_and_writes_its_page(name, tmp_path, capsys):
    plot, page = tmp_path / "plot.png", tmp_path / "page.html"
    assert command([*CALLS[name], "--plot", str(plot), "--report", str(page)]) == 0
    pixels = np.asarray(Image.open(io.BytesIO(plot.read_bytes())).convert("L"))
    assert 0.005 < np.mean(pixels < 200)
    text = page.read_text()
    assert "<h1>" in text
    assert "Content-Security-Policy" in text
    assert text.count("<figure") == 1
    assert not re.search(r"(?:src|href)=\"(?!data:|#)", text)
    out = capsys.readouterr().out
    assert f"figure: {plot}" in out
    assert f"page: {page}" in out


def test_a_path_is_drawn_as_svg(tmp_path):
    plot = tmp_path / "plot.svg"
    assert command([*CALLS["curve"], "--plot", str(plot)]) == 0
    assert plot.read_text().startswith("<?xml")
    assert "tangent stiffness, N/mm" in plot.read_text()


def test_another_ending_is_refused_before_anything_is_computed(tmp_path, capsys):
    plot = tmp_path / "plot.docx"
    assert command([*CALLS["curve"], "--plot", str(plot)]) == 2
    assert "write a file that ends in .png or .svg" in capsys.readouterr().err
    assert not plot.exists()


def test_a_curve_against_its_axis_says_that_it_prints_magnitudes(capsys):
    assert command(CALLS["curve"]) == 0
    assert "magnitudes: the ramp goes against its axis" in capsys.readouterr().out


def test_a_matrix_has_labels_and_its_asymmetry_a_reason(capsys):
    call = ["stiffness", "orthoglide-chain", "--posture", "B", "--displacement", "-3,0,0,0,0,0"]
    assert command(call) == 0
    out = capsys.readouterr().out
    assert re.search(r"ux +┃ +uy +┃ +uz", out)
    assert "It is not symmetric" in out


def test_a_pdf_without_a_chromium_is_refused_before_anything_is_computed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("vjm_validation.cli.all.chromium", lambda: "")
    assert command(["all", "--pdf", "--out", str(tmp_path / "run")]) == 2
    assert "--pdf: no Chromium is installed" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
