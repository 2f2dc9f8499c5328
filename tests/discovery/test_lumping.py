"""The suite's own discovery: a bar's readings, and a sheet that says one spring per link."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vjm_validation.blind.designs import Design, Known, Sequence
from vjm_validation.blind.drawing import by_finite_elements
from vjm_validation.blind.finder import diagnosed
from vjm_validation.blind.noise import read, with_nuisances
from vjm_validation.blind.rig import drawn
from vjm_validation.blind.sheets import data_text, sheet_text


def posture_a(**changes: object) -> Design:
    """Pull to 1.2 mm, past where the paper's model would buckle, and push to 2.4 mm; force and lateral force."""
    ux = np.concatenate([np.linspace(0.0, 1.2, 25), np.linspace(1.15, -2.4, 60)])
    sequence = Sequence("A", ux, 300.0 + 2.0 * np.arange(len(ux)), np.full(len(ux), 21.0))
    instruments = {"ux_mm": Known(0.0005, 0.002, 0.001)} | dict.fromkeys(("fx_N", "fz_N"), Known(2.0, 3.0, 0.003))
    kept = {"seed": 3 * 10**6, "kind": "posture A", "sequences": (sequence,), "instruments": instruments,
            "link_segments": 1, "foot_segments": 8, "memory": 0.0}  # fmt: skip
    return Design(**(kept | changes))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("posture_a")
    design = posture_a()
    rng = np.random.default_rng(31)
    rig, _ = with_nuisances(drawn(design), design, rng)
    elements = by_finite_elements(rig)
    assert elements is not None
    seen, _ = read(design, elements.response(design), rng)
    (folder / "sheet.toml").write_text(sheet_text(design, "finite elements"))
    (folder / "data.csv").write_text(data_text(design, seen.ux, seen.forces))
    result = diagnosed(folder / "data.csv", folder / "sheet.toml", folder / "found")
    assert "error" not in result, result["error"]
    pushed = seen.forces[seen.ux < 0.0, 0]
    return json.loads((folder / "found" / "diagnosis.json").read_text()), float(np.sqrt(np.mean(pushed**2)))


def test_finite_elements_against_one_spring_per_link_are_named_lumping(found):
    diagnosis, _ = found
    assert diagnosis["verdict"] == "named"
    assert diagnosis["causes"] == ["link_lumping"]


def test_the_extension_predicts_what_was_held_out(found):
    diagnosis, pushed = found
    gain = diagnosis["gain"]
    assert gain["split"] == "directions"
    # push from pull and pull from push: within 1 % of the push's force, where the sheet's own model is far off
    assert gain["rmse_after"] < 0.01 * pushed
    assert gain["rmse_before"] > 0.03 * pushed
