"""Under force control displacements are scored given the forces: against Gaussian densities by virtual work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import linear_arm

from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference.fitting import Fitter, whitening_of
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates

ANGLES = (0.5, 0.9)
GAUGE, CELL, REACH = 5e-4, 0.5, 1e-3
"""mm, N, and mm: two of the gauge's noise, so that hardly any curvature of the arm's path shows."""
SHEET = """[test]
title = "loads along x and z"
model = "{model}"
control = "force"
held = ["y", "rx", "ry", "rz"]
[postures]
bent = []
[instrument.ux_mm]
noise = {gauge}
[instrument.uz_mm]
noise = {gauge}
[instrument.fx_N]
noise = {cell}
[instrument.fz_N]
noise = {cell}
"""


def stiffness(width: float) -> np.ndarray:
    """By x and z ``(2, 2)`` of an arm whose beams are so many times as stiff, all else held."""
    arm = linear_arm.Arm(linear_arm.arm("upper", "fore", width=width), ANGLES)
    return np.linalg.inv(arm.compliance())[np.ix_((0, 2), (0, 2))]


def objective(folder: Path, rows: np.ndarray, width: float) -> float:
    """Of readings ``(n, 4)``, the sheet's tolerances at nought."""
    model, data, sheet = folder / "arm.toml", folder / "data.csv", folder / "sheet.toml"
    model.write_text(linear_arm.model(linear_arm.arm("upper", "fore", width=width), {"bent": ANGLES}))
    lines = ["posture,ux_mm,uz_mm,fx_N,fz_N", *(",".join(["bent", *(f"{v:.9g}" for v in row)]) for row in rows)]
    data.write_text("\n".join(lines) + "\n")
    sheet.write_text(SHEET.format(model=model, gauge=GAUGE, cell=CELL))
    observed = observe_ramps(read_measurement(data, sheet))
    nuisances = tuple(nuisance_coordinates(observed))
    found, forward = coordinates(nuisances, ()), Forward(observed)
    at = forward.evaluate(found, np.zeros(len(found)), ())
    return Fitter(forward, nuisances, whitening_of(observed, at)).objective(found, at)


def given_the_forces(rows: np.ndarray, width: float) -> float:
    """Twice the negative logarithm of the density of displacements, but for a constant."""
    C = np.linalg.inv(stiffness(width))
    covariance = GAUGE**2 * np.eye(2) + CELL**2 * C @ C.T
    off = rows[:, :2] - rows[:, 2:] @ C.T
    squares = np.einsum("ni,ij,nj->", off, np.linalg.inv(covariance), off)
    return float(squares + len(rows) * np.linalg.slogdet(covariance)[1])


def test_a_softer_arm_gains_what_its_displacements_are_likelier_by(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    s = np.linspace(-REACH, REACH, 21)
    moved = np.concatenate([np.column_stack([s, 0.0 * s]), np.column_stack([0.0 * s, s])])
    loads = moved @ stiffness(1.0)
    rows = np.column_stack([moved, loads]) + rng.standard_normal((len(s) * 2, 4)) * [GAUGE, GAUGE, CELL, CELL]
    found, wanted = (
        of(1.0) - of(0.7)
        for of in (lambda width: objective(tmp_path, rows, width), lambda width: given_the_forces(rows, width))
    )
    # the density of forces would differ by 2 log(1/0.7) for each axis of a reading more: 60 in all
    assert found == pytest.approx(wanted, abs=0.5)
