"""What a calibration says beside its numbers: what is not seen, what to measure next, what follows."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import Direction, LoadCase
from vjm.model.parameters import section_value
from vjm_updating.calibration import design
from vjm_updating.calibration import design as carried
from vjm_updating.calibration.fit import identifiability
from vjm_updating.calibration.run import fit_row, results
from vjm_updating.inference.significance import more_than_noise

from . import synthetic
from .conftest import TRUTH, Make, solved

PAIR = ("link.EA", "foot.factor")
"""Along the straight chain of posture A, below the critical load, only the sum of the two gives way."""
ONLY_A = {"A": (-1.5, 1.5)}
FORCE = ("fx_N",)


@pytest.fixture
def pair(make: Make):
    truth = {"link.EA": 0.06, "foot.factor": 0.08}
    return make(z=truth, ramps=ONLY_A, steps=20, columns=FORCE)


def test_an_inseparable_pair_is_no_two_numbers(pair):
    found = solved(pair, PAIR)
    said = identifiability(found)
    assert said.separable.tolist() == [False, False]
    seen, unseen = said.combinations
    assert seen.seen
    assert not unseen.seen
    # 28e-5 mm/N in series with half of 46e-6, with the values that were found: softness counts by its share
    share = 23e-6 * np.exp(-found.z[0]) / (28e-5 * np.exp(found.z[1]))
    assert seen.name == f"- {share:.2g} link.EA + foot.factor"
    assert seen.coefficients == pytest.approx({"link.EA": -share, "foot.factor": 1.0}, rel=0.02)
    made = 0.06 * seen.coefficients["link.EA"] + 0.08 * seen.coefficients["foot.factor"]
    assert made == pytest.approx(seen.value, abs=4.0 * seen.std)
    assert seen.std < 0.01


@pytest.mark.slow
def test_an_inseparable_pair_is_reported_as_such(pair):
    document, _ = results(pair, solved(pair, PAIR))
    assert document.parameters == []
    assert document.identifiability.not_separable == list(PAIR)
    seen, unseen = document.combinations
    assert seen.interval95 is not None
    assert (unseen.value, unseen.std, unseen.interval95) == (None, None, None)
    assert "No number of its own has link.EA, foot.factor." in document.identifiability.statement
    assert not {"link.EA", "foot.factor"} & set(document.joint.names)


def test_more_than_noise_is_the_same_in_a_calibration_and_in_a_diagnosis(pair):
    """A sheet's noise is known to `NOISE_KNOWN`: what scatters no further is widened, and is no misfit."""
    found = solved(pair, PAIR)
    n = int(found.everything.present.sum())
    for times in (1.1, 2.0):
        spread = np.full(found.whitening.present.shape[1], times)
        found.fitter.whitening = replace(found.fitter.whitening, spread=spread)
        row = fit_row(found)
        assert row.fits is (times < 1.2)
        assert more_than_noise(times, n) is not row.fits
        assert "widened by" in row.statement


def test_another_posture_separates_them(make: Make):
    found = solved(make(z=dict.fromkeys(PAIR, 0.05), ramps={"A": (-1.5, 1.5), "C": (-0.3, 0.3)}), PAIR)
    assert identifiability(found).separable.all()


def test_the_posture_that_separates_them_is_proposed(pair):
    found = solved(pair, PAIR)
    ramps = design.parsed_ramps(["A:1.5", "A:-1.0", "B:1.5", "C:0.3"], pair.chain)
    ranked, left_out = design.candidates(found, None, ramps)
    assert left_out == []
    assert ranked[0].posture == "C"
    assert ranked[0].parameters_shrink_to < 0.5 * min(c.parameters_shrink_to for c in ranked if c.posture == "A")


@pytest.mark.slow
def test_a_proposal_keeps_its_promise(make: Make):
    """The covariance that is promised is the one of the fit with those readings, the same dice aside."""
    before = make(ramps={"A": (-2.0,), "B": (3.0,)}, steps=20, errors=1e-9)
    found = solved(before)
    figures = carried.after_calibration(found)
    target = design.in_view(figures[0], figures[1], "C:compression:F_cr")
    (promised,), _ = design.candidates(found, target, design.parsed_ramps(["C:0.5"], before.chain))
    after = solved(make(ramps={"A": (-2.0,), "B": (3.0,), "C": (0.5,)}, steps=20, errors=1e-9))
    volumes = [np.linalg.slogdet(one.covariance[:3, :3])[1] for one in (found, after)]
    # the fit has a reading at zero besides
    assert promised.parameters_shrink_to == pytest.approx(np.exp((volumes[1] - volumes[0]) / 6.0), rel=0.03)
    (again,) = [f for f in carried.after_calibration(after)[0] if design.label(f) == "C:compression:F_cr"]
    at = after.problem.unknowns.on_chain
    assert promised.figure_std == pytest.approx(again.std(after.covariance[np.ix_(at, at)]), rel=0.03)


def test_ramps_that_make_no_sense(pair):
    for text, words in (
        ("A", "is no ramp"),
        ("Q:1", "no posture 'Q'"),
        ("A:w:1", "is no ramp"),
        ("A:0", "other than zero"),
    ):
        with pytest.raises(ValueError, match=words):
            design.parsed_ramps([text], pair.chain)


def test_a_figure_that_is_none(make: Make):
    found = solved(make())
    figures, covariance, _ = carried.after_calibration(found)
    with pytest.raises(ValueError, match="is no predicted figure"):
        design.in_view(figures, covariance, "A:tension:F_cr")


def test_slopes_of_figures_are_those_of_whole_paths():
    """Also where a sign, a factor or the wrong path would show: against differences of paths traced anew."""
    engine, chain = VjmEngine(4), load_chain("orthoglide-chain")
    chain = replace(chain, postures={"A": chain.posture("A")})
    parameter = section_value(chain, "link", "EIz")
    parameters = [parameter, section_value(chain, "link", "EA")]
    found = {(f.direction, f.quantity): f for f in carried.predicted(chain, engine, parameters)}
    h = 1e-3 * parameter.value

    def figures(value: float) -> dict[str, float]:
        path = engine.trace(parameter.apply(chain, value), LoadCase("A", -4.0))
        assert path.critical is not None
        return {"F_cr": path.critical.force, "d_cr": path.critical.s, "K0": path.points[0].tangent}

    more, less = figures(parameter.value + h), figures(parameter.value - h)
    for name in more:
        slope = (more[name] - less[name]) / (2.0 * h)
        # the difference's step leaves the square of 1e-3, 3.5e-6 here; K0 has no slope
        assert found[Direction.COMPRESSION, name].gradient[0] == pytest.approx(slope, rel=1e-4, abs=1e-12)
    assert (Direction.TENSION, "F_cr") not in found


def test_tolerances_reach_the_figures(make: Make):
    """A's critical force is π²EI/L²: 2 % of the modulus, and twice 0.2 mm of 310."""
    figures, covariance, names = carried.within_tolerances(make())
    assert names == ["modulus foot", "modulus link", "length link"]
    force = next(f for f in figures if design.label(f) == "A:compression:F_cr")
    # but for the bar's shortening before it buckles: 9e-5
    assert force.std(covariance) / force.value == pytest.approx(np.hypot(0.02, 2.0 * 0.2 / 310.0), rel=3e-3)


@pytest.mark.slow
def test_the_rounding_of_printed_matrices_reaches_the_figures(make: Make):
    """One spring a part: K0 in A is the inverse of C_xx of the foot and half of that of the bar."""
    measurement = make(sheet=synthetic.sheet_text(foot=1, link=1), ramps={"A": (1.0,)})
    figures, covariance, names = carried.within_rounding(measurement)
    assert "foot compliance (1,1)" in names
    assert "link compliance (2,6)" in names
    stiffness = next(f for f in figures if design.label(f) == "A:tension:K0")
    expected = stiffness.value**2 * np.hypot(0.5e-5, 0.5 * 0.5e-6) / np.sqrt(3.0)
    assert stiffness.value == pytest.approx(1.0 / (28e-5 + 23e-6), rel=1e-6)
    # the slopes are differences of the figure: 9e-9
    assert stiffness.std(covariance) == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_the_rounding_reaches_a_split_link_by_its_quotients(make: Make):
    """Its EI is L over an entry of two digits, 72e-7: half a unit of 1e-7 is 0.7 %."""
    figures, covariance, names = carried.within_rounding(make())
    assert "link EIz" in names
    force = next(f for f in figures if design.label(f) == "A:compression:F_cr")
    # entries beside it add a little: 6e-4
    assert force.std(covariance) / force.value == pytest.approx(0.5 / 72.0 / np.sqrt(3.0), rel=0.01)


@pytest.mark.slow
def test_a_calibration_shrinks_what_tolerances_leave_open(make: Make):
    measurement = make(steps=40)
    before, of_sheet, _ = carried.within_tolerances(measurement)
    found = solved(measurement)
    after, of_fit, _ = carried.after_calibration(found)
    label = "A:compression:F_cr"
    wide, narrow = (
        next(f for f in figures if design.label(f) == label).std(C)
        for figures, C in ((before, of_sheet), (after, of_fit))
    )
    assert narrow < 0.3 * wide
    true = VjmEngine(4).trace(synthetic.changed(TRUTH, VjmEngine(4)), LoadCase("A", -4.0)).critical
    assert true is not None
    value = next(f for f in after if design.label(f) == label).value
    assert abs(value - true.force) < 4.0 * narrow
