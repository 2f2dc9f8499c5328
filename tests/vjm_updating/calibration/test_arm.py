"""Calibration of an arm with several links on geared joints: each link has its tolerances."""

from pathlib import Path

import numpy as np
import pytest
from helpers.file_texts import instruments_text, table_text
from helpers.from_files import CALIBRATED as MODEL
from helpers.from_files import calibrate
from helpers.parameters import joint_compliance

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import Direction, LoadCase
from vjm.model.parameters import compliance_factor
from vjm_updating.calibration import design
from vjm_updating.calibration import design as carried
from vjm_updating.calibration.fit import CalibrationProblem, fitter_of, problem_of, solve
from vjm_updating.experiment import read_measurement

SOFTER = {"upper": 1.1, "fore": 0.95}
"""Compliances over nominal."""
SHEET = (
    table_text("test", model="planar-2r")
    + table_text("model", link_segments=4)
    + table_text("tolerance", link_length_mm=0.5, modulus_rel=0.02)
    + instruments_text(uz_mm=(0.001,), fz_N=(0.05,), mx_Nmm=(20.0,), my_Nmm=(20.0,))
)


def measured(folder: Path) -> CalibrationProblem:
    """Out of its plane in two postures, without errors, with links softer and stiffer than drawn."""
    chain, engine = load_chain("planar-2r"), VjmEngine.of(4, 1)
    for name, factor in SOFTER.items():
        chain = compliance_factor(chain, name).apply(chain, factor)
    rows = ["posture,uz_mm,fz_N,mx_Nmm,my_Nmm"]
    for posture in ("bent", "folded"):
        path = engine.trace(chain, LoadCase(posture, 3.0, "z", steps=10))
        rows += [
            f"{posture},{s:.9f},{w[2]:.9f},{w[3]:.9f},{w[4]:.9f}" for s, w in zip(path.s, path.wrench, strict=True)
        ]
    data, sheet = folder / "data.csv", folder / "sheet.toml"
    data.write_text("\n".join(rows) + "\n")
    sheet.write_text(SHEET)
    return problem_of(read_measurement(data, sheet), ["upper.factor", "fore.factor"])


def test_every_link_has_a_length_of_its_own(tmp_path: Path):
    problem = measured(tmp_path)
    names = [unknown.name for unknown in problem.unknowns.all]
    lengths = [i for i, name in enumerate(names) if name.startswith("length")]
    assert [names[i] for i in lengths] == ["length upper", "length fore"]
    fitter, at = fitter_of(problem)
    J = fitter.slopes(problem.unknowns.all, at, ())
    for i in lengths:
        h = 1e-2 * np.eye(len(names))[i]
        more, less = (fitter.forward.evaluate(problem.unknowns.all, s * h, ()).residual for s in (1.0, -1.0))
        slope = (more - less) / 2e-2
        # one-sided differences over 0.03 of the tolerance: a length is 0.015 mm of some hundred
        np.testing.assert_allclose(J[:, :, i], slope, atol=1e-3 * np.abs(slope).max())
        assert np.abs(slope).max() > 0.0


def test_the_arm_and_what_it_will_do_are_found(tmp_path: Path):
    problem = measured(tmp_path)
    found = solve(problem)
    values = [u.value(z) for u, z in zip(problem.unknowns.all, found.z, strict=True)]
    # the file has nine decimals; lengths are held by their prior where no reading says more
    np.testing.assert_allclose(values[:2], list(SOFTER.values()), rtol=1e-5)
    np.testing.assert_allclose(values[2:], 0.0, atol=1e-3)
    figures, _, names = carried.after_calibration(found)
    assert names == ["upper.factor", "fore.factor", "length upper", "length fore"]
    force = next(f for f in figures if design.label(f) == "stretched:compression:F_cr")
    h = 1e-3 * np.eye(len(names))[1]
    machines = (problem.unknowns.build(found.z + s * h) for s in (1.0, -1.0))
    more, less = (carried.paths_of(m, problem.engine)["stretched", Direction.COMPRESSION] for m in machines)
    slope = (more.critical.force - less.critical.force) / 2e-3
    assert force.gradient[1] == pytest.approx(slope, rel=1e-4)


@pytest.mark.slow
def test_the_whole_calibration_of_an_arm_is_written(tmp_path: Path):
    measured(tmp_path)
    document = calibrate(tmp_path / "data.csv", tmp_path / "sheet.toml", tmp_path / "out")
    assert document.fit.fits
    beams = {beam.name: beam for beam in load_chain(tmp_path / "out" / MODEL).beams}
    drawn = {beam.name: beam for beam in load_chain("planar-2r").beams}
    for name, factor in SOFTER.items():
        assert drawn[name].section.EIz / beams[name].section.EIz == pytest.approx(factor, rel=1e-5)


GEARS = {"shoulder": 1.3, "elbow": 0.8}
"""Compliances of the gears over nominal."""


@pytest.mark.slow
def test_the_gears_of_an_arm_are_found_and_written(tmp_path: Path):
    """In the plane of the arm, which its joints turn in: what bends is as drawn."""
    chain, engine = load_chain("planar-2r"), VjmEngine.of(4, 1)
    for name, factor in GEARS.items():
        gear = joint_compliance(chain, name)
        chain = gear.apply(chain, factor * gear.value)
    rows = ["posture,ux_mm,fx_N,fy_N"]
    for posture in ("bent", "folded"):
        path = engine.trace(chain, LoadCase(posture, 2.0, "x", steps=10))
        rows += [f"{posture},{s:.9f},{w[0]:.9f},{w[1]:.9f}" for s, w in zip(path.s, path.wrench, strict=True)]
    data, sheet = tmp_path / "data.csv", tmp_path / "sheet.toml"
    data.write_text("\n".join(rows) + "\n")
    sheet.write_text(
        '[test]\nmodel = "planar-2r"\n[model]\nlink_segments = 4\n'
        # so precise that the weak priors hold nothing back
        "[instrument.ux_mm]\nnoise = 1e-5\n[instrument.fx_N]\nnoise = 5e-4\n[instrument.fy_N]\nnoise = 5e-4\n"
    )
    names = [f"{name}.compliance" for name in GEARS]
    document = calibrate(data, sheet, tmp_path / "out", names)
    assert [row.unit for row in document.parameters] == ["rad/(N mm)"] * 2
    # the file has nine decimals
    for row, factor in zip(document.parameters, GEARS.values(), strict=True):
        assert row.over_nominal == pytest.approx(factor, rel=1e-5)
    written = load_chain(tmp_path / "out" / MODEL)
    for name in GEARS:
        own, true = (joint_compliance(c, name).value for c in (written, chain))
        assert own == pytest.approx(true, rel=1e-5)


def test_what_a_joint_has_is_what_can_be_looked_for(tmp_path: Path):
    measured(tmp_path)
    measurement = read_measurement(tmp_path / "data.csv", tmp_path / "sheet.toml")
    for names, words in (
        (("elbow.factor",), "has the parameters elbow.compliance, elbow.lateral-1, elbow.lateral-2"),
        (("elbow.compliance", "elbow.compliance"), "looked for twice"),
        (("wrist.compliance",), "no such elastic part"),
    ):
        with pytest.raises(ValueError, match=words):
            problem_of(measurement, names)
    rigid = problem_of(measurement, ("elbow.lateral-1",)).unknowns.sought[0]
    assert (rigid.nominal, rigid.linear) == (0.0, True)
