"""The model file that a calibration writes is the machine that it found."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from vjm.io.model_file import build_chain, load_chain
from vjm.model.load_case import LoadCase
from vjm.model.parts import Beam, Joint
from vjm_updating.calibration.calibrated_model import calibrated_text
from vjm_updating.calibration.fit import problem_of

from . import synthetic
from .conftest import Make

CASES = {
    "sections": ({"link.EA": 0.1, "link.GJ": -0.2, "link.EIy": 0.05, "link.EIz": 0.3, "foot.factor": 0.2}, 1),
    "entries": ({"foot.C11": 0.2, "foot.C33": -0.1, "link.factor": 0.1}, 1),
    "matrix": ({f"foot.R{i}{j}": 0.03 * i - 0.05 * j for i in range(1, 7) for j in range(1, i + 1)}, 1),
    "drive": ({"actuator.compliance": 2.0}, 1),
    "split foot": ({"foot.EIy": 0.1, "foot.EIz": -0.1, "link.factor": -0.2}, 4),
}


@pytest.mark.parametrize("case", CASES)
def test_the_file_is_the_machine(make: Make, tmp_path: Path, case: str):
    z, foot = CASES[case]
    measurement = make(sheet=synthetic.sheet_text(foot=foot, link=4), steps=4)
    names = list(dict.fromkeys("foot.matrix" if ".R" in name else name for name in z))
    unknowns = problem_of(measurement, names).unknowns
    values = dict(z) | {"length link": 0.7}
    at = np.array([values.get(one.name, 0.0) for one in unknowns.all])
    chain = unknowns.build(at)
    file = tmp_path / "calibrated-model.toml"
    file.write_text(calibrated_text(measurement, chain), encoding="utf-8")
    again = load_chain(file)
    for to in (-3.0, 2.0):
        paths = [measurement.engine.trace(one, LoadCase("B", to, steps=4)) for one in (chain, again)]
        np.testing.assert_allclose(paths[1].wrench, paths[0].wrench, rtol=1e-9, atol=1e-6)
    nominal = measurement.engine.trace(measurement.chain, LoadCase("B", -3.0, steps=4))
    # the calibrated chain is another one: by far more than what any solver leaves
    assert abs(nominal.force[-1] / paths[0].force[-1]) != pytest.approx(1.0, rel=1e-3)


def test_both_descriptions_of_a_part_change_alike(make: Make):
    """Springs use one of the two; other engines the other. The library's bar has both from one table."""
    measurement = make(sheet=synthetic.sheet_text(foot=1, link=4), steps=4)
    unknowns = problem_of(measurement, ("link.EIz", "foot.factor")).unknowns
    z = np.zeros(len(unknowns))
    z[:2] = np.log(0.9), np.log(1.2)
    found = build_chain(tomllib.loads(calibrated_text(measurement, unknowns.build(z))), "found")
    for name in ("link", "foot"):
        old, new = (next(b for b in c.beams if b.name == name) for c in (measurement.chain, found))
        softer = new.tip_compliance() / np.where(old.tip_compliance() == 0.0, np.nan, old.tip_compliance())
        theory = new.beam_compliance() / np.where(
            np.abs(old.beam_compliance()) < 1e-12, np.nan, old.beam_compliance()
        )
        if name == "foot":
            np.testing.assert_allclose(softer[~np.isnan(softer)], 1.2, rtol=1e-9)
            np.testing.assert_allclose(theory[~np.isnan(theory)], 1.2, rtol=1e-9)
        else:
            # bending about z, its deflection and their coupling by 1/0.9; all else as it was
            for i, j in ((1, 1), (1, 5), (5, 5)):
                assert softer[i, j] == pytest.approx(1.0 / 0.9, rel=1e-3)
            for i in (0, 2, 3, 4):
                assert softer[i, i] == pytest.approx(1.0, rel=1e-9)


def test_a_shape_stays_a_shape_where_one_modulus_says_all(make: Make, tmp_path: Path):
    sheet = """
[test]
model = "pinned-column"
[model]
link_segments = 8
[postures]
straight = []
[instrument.fx_N]
noise = 1.0
[instrument.ux_mm]
noise = 0.0001
"""
    rows = [{"posture": "straight", "ux_mm": -0.002 * k, "fx_N": -37.0 * k} for k in range(12)]
    files = synthetic.write(tmp_path, rows, sheet)
    from vjm_updating.experiment import read_measurement

    measurement = read_measurement(files.data, files.sheet)
    unknowns = problem_of(measurement, ("link.factor",)).unknowns
    document = tomllib.loads(calibrated_text(measurement, unknowns.build(np.array([0.1]))))
    (beam,) = [part for part in document["parts"] if part["kind"] == "beam"]
    assert beam["section"]["shape"] == "rectangle"
    assert beam["section"]["youngs_modulus_MPa"] == pytest.approx(68948.0 * np.exp(-0.1))
    assert beam["section"]["yield_stress_MPa"] == 241.3


def test_what_was_not_looked_for_stays(make: Make):
    measurement = make(steps=4)
    unknowns = problem_of(measurement, ("foot.factor",)).unknowns
    chain = build_chain(
        tomllib.loads(calibrated_text(measurement, unknowns.build(np.zeros(len(unknowns))))), "same"
    )
    for old, new in zip(measurement.chain.parts, chain.parts, strict=True):
        if isinstance(old, Beam) and isinstance(new, Beam):
            assert new.section == old.section
            np.testing.assert_array_equal(new.compliance, old.compliance)
            assert new.length == old.length
        if isinstance(old, Joint) and isinstance(new, Joint):
            assert (new.kind, new.compliance) == (old.kind, old.compliance)
