"""What is said of a parameter: its interval where what is reported is no straight function of what is fitted."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import truncnorm

from vjm_updating.diagnosis.document import ValueRow
from vjm_updating.diagnosis.evidence import estimates, joined
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.parameters import SHARE, coordinates, nuisance_coordinates
from vjm_updating.mechanisms.contacts import ContactCompliance
from vjm_updating.mechanisms.drives import ActuatorCompliance
from vjm_updating.mechanisms.loads import LoadMisalignment

QUANTILES = {"rel": 0.02}
"""Of 512 draws spread evenly: one stratum more or less moves an end by 1 / 512 over the density there, 0.033 of the
standard deviation, which is 1.7 % of its distance from the middle."""


def known(effect, z, *errors, readings=lambda off: off):
    """Fitter and fit of an effect alone, its coordinates ``z`` known within such standard deviations.

    Args:
        effect: the cause.
        z: its coordinates.
        errors: standard deviation of each.
        readings: what the coordinates' distances from these, over their errors, leave ``(k,)``.
    """
    found = coordinates([], (effect,))
    best = np.array(z, dtype=float)

    def evaluate(_, there, hypothesis):
        return SimpleNamespace(z=there, residual=readings((there - best) / np.array(errors)))

    at = evaluate(found, best, (effect,))
    normal = np.diag(np.array(errors) ** -2.0)
    fitter = SimpleNamespace(
        normal=lambda fit: normal,
        evaluate=evaluate,
        whitening=SimpleNamespace(present=np.ones((100, 1), dtype=bool), flat=lambda rows: rows),
        squares=lambda found, at: 90.0,
        pressure=lambda fit: np.zeros(len(found)),
    )
    jacobian = np.diag(1.0 / np.array(errors))
    return fitter, SimpleNamespace(
        hypothesis=(effect,), parameters=found, evaluation=at, free=len(found), jacobian=jacobian
    )


def test_a_vector_may_be_larger_by_what_is_unknown_across_it():
    effect = LoadMisalignment()
    scale = 1.0 / coordinates([], (effect,))[0].value(1.0)
    angle = estimates(*known(effect, [0.03 * scale, 0.0], 0.001 * scale, 0.04 * scale))[
        "load_misalignment.angle_rad"
    ]
    assert angle.value == pytest.approx(0.03)
    # to first order errors across change nothing; forward differences by 1e-5 of a coordinate leave 1e-9
    assert angle.std == pytest.approx(0.001, rel=1e-7)
    # 97.5 % of |across| lie below 2.24 of its standard deviations
    assert angle.high == pytest.approx(np.hypot(0.03, 2.2414 * 0.04), **QUANTILES)
    assert 0.03 - 1.96 * 0.001 < angle.low < 0.03


def test_what_readings_tell_by_its_square_alone_is_not_unknown():
    """As of a bow out of the plane in which a bar buckles: the curvature says nothing, the objective does."""
    effect = LoadMisalignment()
    scale = 1.0 / coordinates([], (effect,))[0].value(1.0)
    across, unknown = 0.01 * scale, 1e3 * scale

    def readings(off):
        return np.array([off[0], (off[1] * unknown / across) ** 2])

    found = estimates(*known(effect, [0.03 * scale, 0.0], 0.001 * scale, unknown, readings=readings))
    angle, towards = found["load_misalignment.angle_rad"], found["load_misalignment.direction_rad"]
    # the objective rises by one where that square is one standard deviation
    assert angle.high == pytest.approx(np.hypot(0.03, 2.2414 * 0.01), **QUANTILES)
    # the first trial, far off, turns the vector: the fourth root of its rise leaves half a per cent
    assert towards.std == pytest.approx(0.01 / 0.03, rel=0.01)


def test_a_vector_of_known_size_may_have_any_direction():
    """Nothing is known of a component to first order, and the objective rises along it, but not all round."""
    effect = LoadMisalignment()
    scale = 1.0 / coordinates([], (effect,))[0].value(1.0)
    size, error, unknown = 0.03 * scale, 0.001 * scale, 1e3 * scale

    def readings(off):
        vector = np.array([size + off[0] * error, off[1] * unknown])
        return np.array([(np.hypot(*vector) - size) / error, 0.0])

    found = estimates(*known(effect, [size, 0.0], error, unknown, readings=readings))
    towards = found["load_misalignment.direction_rad"]
    assert towards.high - towards.low == pytest.approx(0.95 * 2.0 * np.pi)


def test_a_size_is_not_negative_and_an_unknown_direction_is_anywhere():
    effect = LoadMisalignment()
    scale = 1.0 / coordinates([], (effect,))[0].value(1.0)
    found = estimates(*known(effect, [0.001 * scale, 0.0], 0.03 * scale, 0.03 * scale))
    assert found["load_misalignment.angle_rad"].low == 0.0
    # that of an even distribution all round
    assert found["load_misalignment.direction_rad"].std == pytest.approx(np.pi / np.sqrt(3.0))


def test_a_direction_has_no_end():
    effect = LoadMisalignment()
    scale = 1.0 / coordinates([], (effect,))[0].value(1.0)
    towards = estimates(*known(effect, [-0.03 * scale, -1e-5 * scale], 0.001 * scale, 0.001 * scale))[
        "load_misalignment.direction_rad"
    ]
    assert towards.high - towards.low == pytest.approx(2 * 1.96 / 30.0, **QUANTILES)
    assert towards.low < towards.value < towards.high


def test_a_straight_parameter_has_the_interval_of_its_standard_deviation():
    effect = ActuatorCompliance()
    (own,) = coordinates([], (effect,))
    (found,) = estimates(*known(effect, [own.low + 10.0], 0.5)).values()
    assert found.high - found.low == pytest.approx(2 * 1.96 * found.std, **QUANTILES)


def test_an_interval_takes_in_what_other_places_say():
    names = [set(estimates(*known(ContactCompliance(part=p), [0.0, 0.6], 0.1, 0.1))) for p in "ab"]
    assert names[0] == names[1]
    here, there = (
        ValueRow(value=1.0, std=0.1, interval95=[0.8, 1.2]),
        ValueRow(value=1.3, std=0.1, interval95=[1.1, 1.5]),
    )
    both = joined({"x": here, "only here": here}, [{"x": there, "only there": there}])
    assert both == {"x": ValueRow(value=1.0, std=0.1, interval95=[0.8, 1.5]), "only here": here}


@pytest.mark.parametrize("one_sided", [False, True])
def test_an_interval_of_a_shape_ends_where_its_posterior_does(one_sided):
    """Readings that only say that an exponent is not above a value leave the prior below it."""

    def readings(off):
        return np.array([off[0], max(off[1], 0.0) if one_sided else off[1]])

    effect, scale = ContactCompliance(), 0.1
    usual = 2.0 / 3.0 / scale
    found = estimates(*known(effect, [5.0, usual], 0.1, 0.05, readings=readings))
    row = found["contact_compliance.exponent"]
    # the prior, Cauchy's with a spread twenty times the error, is flat beside it
    assert row.high == pytest.approx(2.0 / 3.0 + 0.05 * scale * (1.96 if not one_sided else 1.0), abs=0.004)
    if one_sided:
        # between the middle and the bound, at 0.3, half of Cauchy's distribution of spread 0.1 is cut off there
        low, cut = (np.arctan((2.0 / 3.0 - x) / 0.1) for x in (row.low, 0.3))
        assert low / cut == pytest.approx(0.975, abs=0.02)
    else:
        assert row.low == pytest.approx(2.0 / 3.0 - 1.96 * 0.05 * scale, abs=0.004)


def test_laws_that_are_not_quite_right_widen_intervals():
    effect = ContactCompliance()
    usual = 2.0 / 3.0 / 0.1
    fitter, fit = known(effect, [5.0, usual], 0.1, 0.05)
    by_laws = 3.0 * np.diag([0.1**2, 0.05**2])
    narrow, wide = estimates(fitter, fit), estimates(fitter, fit, by_laws)
    for name, row in wide.items():
        width, before = row.high - row.low, narrow[name].high - narrow[name].low
        # twice, to what slopes by differences are rounded by; the displacement has an end at nothing, and the
        # exponent its prior
        assert row.std == pytest.approx(2.0 * narrow[name].std, rel=1e-6)
        assert width == pytest.approx(2.0 * before, rel=QUANTILES["rel"])


def bounded(best):
    """Value and interval, in standard deviations, of a compliance that is best at ``best`` without a bound."""
    effect = ActuatorCompliance()
    fitter, fit = known(effect, [max(best, 0.0)], 1.0)
    fitter.pressure = lambda fit: np.array([max(-best, 0.0)])
    (found,) = estimates(fitter, fit).values()
    unit = effect.quantities()[0].scale
    return found.value / unit, found.low / unit, found.high / unit


@pytest.mark.parametrize("best", [0.0, -1.0, -9.0])
def test_a_size_at_its_bound_has_the_truncated_interval_to_one_side(best):
    value, low, high = bounded(best)
    assert (value, low) == (0.0, 0.0)
    # 534 of 8,000 draws: the 95 % quantile has a standard error of a twentieth of its distance, times four
    assert high == pytest.approx(truncnorm.ppf(0.95, -best, np.inf, loc=best), rel=0.2)


@pytest.mark.parametrize("best", [0.5, 1.0])
def test_the_interval_of_a_size_near_its_bound_begins_there(best):
    """The density at the bound is more than at the 95 % quantile."""
    value, low, high = bounded(best)
    assert (value, low) == (pytest.approx(best), 0.0)
    # the same errors of quantiles: a standard error of 0.06 standard deviations, times four
    assert high == pytest.approx(truncnorm.ppf(0.95, -best, np.inf, loc=best), abs=0.25)


def test_the_interval_of_a_size_far_from_its_bound_leaves_it_out():
    _, low, high = bounded(3.0)
    assert [low, high] == pytest.approx(truncnorm.ppf([0.025, 0.975], -3.0, np.inf, loc=3.0), abs=0.25)


# How far nuisances may be from the sheet's values before they are something else.


@pytest.mark.parametrize("tolerance", [0.01, 0.2, 2.0])
def test_a_tight_sheet_does_not_keep_a_wrong_length_from_being_found(make, tmp_path, monkeypatch, tolerance):
    files = make.made_up(tmp_path, {}, 1, monkeypatch, per=6, postures=("A",))
    files.sheet.write_text(files.sheet.read_text().replace("link_length_mm = 0.2", f"link_length_mm = {tolerance}"))
    observed = observe_ramps(read_measurement(files.data, files.sheet))
    (length,) = [c for c in nuisance_coordinates(observed) if c.kind == "length"]
    (whole,) = [b.length for b in observed.measurement.chain.beams if b.name == length.subject]
    # in mm; sixty of the sheet's sigmas where that is more
    assert length.high * length.scale == pytest.approx(max(SHARE * whole, 60.0 * tolerance))
    assert length.low == -length.high
