"""Set weights, coarse cells and marks that control are no mistakes; lost digits and a hanging channel are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers.measured import needed

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.implausible_readings import last_digit
from vjm_updating.experiment.plausibility import plausibility

SHEET = """
[test]
title = "an arm under forces on its tool"
model = "planar-2r"
[model]
link_segments = 4
[postures]
bent = [0.5, 1.2]
[instrument.uy_mm]
noise = 0.002
zero = 0.002
scale = 0.001
[instrument.fy_N]
noise = NOISE
zero = 0.5
scale = 0.003
[tolerance]
link_length_mm = 0.2
modulus_rel = 0.02
"""


def stiffness() -> float:
    """Of the held tool along y in N/mm: all that a test of shifts alone says."""
    problem = VjmEngine(4).problem(load_chain("planar-2r"), LoadCase("bent", 1.0))
    K = problem.unloaded().stiffness
    assert K is not None
    return float(K[1, 1])


def said(folder: Path, force: np.ndarray, shown: np.ndarray, noise: float, seed: int = 0) -> list[str]:
    """What is said of a test in which the arm bore forces ``(n,)`` N and the file shows others."""
    rng = np.random.default_rng(seed)
    u = force / stiffness() + 0.002 * rng.standard_normal(len(force))
    rows = [f"{2.0 * k:.1f},bent,{a:.3f},{b:.3f}" for k, (a, b) in enumerate(zip(u, shown, strict=True))]
    (folder / "data.csv").write_text("\n".join(["time_s,posture,uy_mm,fy_N", *rows]) + "\n", encoding="utf-8")
    (folder / "sheet.toml").write_text(SHEET.replace("NOISE", f"{noise:g}"), encoding="utf-8")
    return [str(found) for found in plausibility(read_measurement(folder / "data.csv", folder / "sheet.toml"))]


WEIGHTS = np.array([0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 40.0, 30.0, 20.0, 10.0, 0.0])


@pytest.mark.parametrize("repeats", [1, 5])
def test_set_weights_are_no_lost_digits(repeats, tmp_path):
    """10, 20, 30 N with an exactness of 0.1 N, read once or five times each: the displacement stands with them."""
    force = np.repeat(WEIGHTS, repeats)
    assert said(tmp_path, force, force, 0.1) == []


@pytest.mark.parametrize("count", [13, 120])
def test_lost_digits_are_found(count, tmp_path):
    """A ramp shown in tens of N: the displacement goes on while the force stands, or the force leaps beside it."""
    force = np.concatenate([np.linspace(0.0, 131.0, count), np.linspace(127.0, 0.0, count)])
    lines = said(tmp_path, force, np.round(force, -1), 0.1)
    assert any("fy_N" in line and "were digits lost" in line for line in lines), lines


def stairs(rng: np.random.Generator) -> np.ndarray:
    """Forces that are held at marks for some dozens of readings each."""
    marks = [0.0, 11.0, 24.0, 38.0, 55.0, 71.0, 55.0, 30.0, 12.0]
    return np.concatenate([np.full(int(rng.integers(20, 60)), mark) for mark in marks])


def test_a_cell_of_coarse_steps_printed_finely_does_not_hang(tmp_path):
    """Steps of 1.877 N printed to 0.001 N under a stated noise of 0.5 N: most readings repeat the one before."""
    force = stairs(np.random.default_rng(1))
    shown = 1.877 * np.round(force / 1.877)
    assert last_digit(np.round(shown, 3)) == pytest.approx(1e-3)
    assert said(tmp_path, force, shown, 0.5) == []


@pytest.mark.parametrize("step", [0.0, 1.877])
def test_a_channel_that_hangs_is_found(step, tmp_path):
    """A ramp of 200 readings whose last 60 show one force, read finely or in steps of a coarse cell."""
    rng = np.random.default_rng(2)
    force = np.linspace(0.0, 120.0, 200)
    shown = force + 0.5 * rng.standard_normal(200)
    shown[140:199] = shown[140]
    shown = step * np.round(shown / step) if step else shown
    lines = said(tmp_path, force, shown, 0.5)
    assert any("fy_N, rows 142 to" in line and "did the channel hang" in line for line in lines), lines


@pytest.mark.parametrize("name", ["column_bar_1", "column_bar_2", "column_tube_1", "column_tube_2"])
@pytest.mark.parametrize("noise", ["0.1", "0.5", "1.0"])
@pytest.mark.parametrize("controlled", [True, False])
def test_measured_columns_are_not_doubted(name, noise, controlled, tmp_path):
    """A cell of 1.877 N steps and a ruler of 1.6 mm marks, whatever noise their sheets state."""
    data, own = needed(f"{name}.csv"), needed(f"{name}.toml")
    sheet = own.read_text(encoding="utf-8").replace("noise = 1.0", f"noise = {noise}", 1)
    (tmp_path / "sheet.toml").write_text(
        sheet if controlled else sheet.replace('held = "target"', ""), encoding="utf-8"
    )
    found = plausibility(read_measurement(data, tmp_path / "sheet.toml"))
    assert [str(one) for one in found] == []
