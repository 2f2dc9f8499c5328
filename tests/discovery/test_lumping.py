"""The suite's own discovery: finite elements' readings, and a sheet that says one spring per link."""

import json

import numpy as np
import pytest
from hidden_effects.finder import diagnosed

from vjm.io.model_file import load_chain
from vjm_updating.simulate import DATA, SHEET
from vjm_validation.acceptance import discovery_rows
from vjm_validation.report.chapters import discovery_tables
from vjm_validation.report.findings import discovery
from vjm_validation.studies.chain import Run
from vjm_validation.studies.link_lumping_discovery import study, write_data


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    out = tmp_path_factory.mktemp("run")
    result = study(out)
    written = json.loads((out / "discovery" / "diagnosis.json").read_text(encoding="utf-8"))
    return out, result, written


@pytest.mark.slow
def test_finite_elements_against_one_spring_per_link_are_named_lumping(found):
    _, result, written = found
    assert (written["verdict"], written["causes"]) == ("named", ["link_lumping"])
    assert (result.rows.verdict, result.rows.causes) == ("named", ["link_lumping"])
    assert [row.passed for row in discovery_rows(result)] == [True] * 3


@pytest.mark.slow
def test_the_extension_predicts_what_was_held_out(found):
    _, result, written = found
    assert written["gain"]["split"] == "cycles"
    by_name = {fold["name"]: fold for fold in written["gain"]["folds"]}
    pulled, pushed = by_name["cycle 1"], by_name["cycle 2"]
    # compression from tension alone, and tension from compression alone; the mean force is some 3 kN
    assert pushed["rmse_after"] < 0.01 * pushed["force"]
    assert pulled["rmse_after"] < 0.01 * pulled["force"]
    assert pulled["rmse_before"] > 0.1 * pulled["force"]
    assert result.rows.error == pytest.approx(pushed["rmse_after"] / pushed["force"])


@pytest.mark.slow
def test_the_spurious_buckling_in_tension_is_shown(found):
    _, result, _ = found
    row = result.rows.tension
    # posture A, the repaired data of the paper, in whole newtons; the readings go on to 1.2 mm, half as far again
    assert (row.nominal, row.nominal_N) == ("bifurcation", pytest.approx(2696.0, rel=2e-4))
    assert row.measured_N is None
    assert row.reached_N > 1.4 * row.nominal_N
    assert row.extended_N is None
    pulled, pushed = result.nominal
    assert pulled.critical is not None
    assert pushed.critical is None
    u = result.displacement
    far = u > 1.0
    at = np.interp(u[far], result.extended[0].s, result.extended[0].force)
    assert np.abs(result.force[far] / at - 1.0).max() < 0.03
    at = np.interp(u[far], pulled.s, pulled.force)
    assert np.abs(result.force[far] / at - 1.0).min() > 0.2


@pytest.mark.slow
def test_the_buckling_that_no_reading_reached_is_predicted(found):
    out, result, _ = found
    row = result.rows.compression
    assert row.extended == "bifurcation"
    assert row.reached_N < 0.9 * result.rows.truth_N
    # the readings tell the moduli of bar and foot and the force's scale to 0.2 % each: thrice their sum in squares
    assert row.extended_N == pytest.approx(result.rows.truth_N, rel=0.01)
    assert load_chain(out / "discovery" / "extended-model.toml").link_segments == 12


@pytest.mark.slow
def test_the_report_tells_it(found):
    _, result, _ = found
    finding = discovery(Run(load_chain("orthoglide-chain"), discovery=result))
    text = " ".join(finding.sentences)
    for part in ("named, link_lumping", "2696 N", "the readings go straight on", "predicts"):
        assert part in text
    critical, held = discovery_tables(result.rows)
    assert {row[0] for row in critical.rows} == {"tension", "compression"}
    assert {row[0] for row in held.rows} == {"tension", "compression"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_other_tolerances_and_noise_do_not_hide_it(tmp_path, seed):
    write_data(tmp_path, seed)
    diagnosis = diagnosed(tmp_path / DATA, tmp_path / SHEET, tmp_path / "found")
    assert (diagnosis["verdict"], diagnosis["causes"]) == ("named", ["link_lumping"])
