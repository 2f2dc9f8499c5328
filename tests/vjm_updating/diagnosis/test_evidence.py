"""What the parameters of a hypothesis and its choice cost."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from vjm_updating.diagnosis.evidence import Costs, criterion, effective_samples, narrowed
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.search import RIVAL, Search
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.fitting import ENOUGH, ROUNDING, best_fit
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.instruments import InstrumentZero
from vjm_updating.inference.parameters import FitParameter, coordinates, of_effect, start
from vjm_updating.inference.significance import FALSE_ALARMS, NORMAL_95
from vjm_updating.mechanisms.drives import ActuatorCompliance
from vjm_updating.mechanisms.structure import LinkBow, LinkLumping


@pytest.mark.parametrize("precision", [0.0, 1e3, 1e6])
def test_readings_cost_what_they_narrow_a_shape_down_by(precision):
    """Evidence of a Gaussian likelihood under Cauchy's prior by quadrature, at and far beyond what is usual."""
    best = 0.0
    prior = np.sqrt(2.0)  # curvature of −log(1 + x²) at its middle
    cost = narrowed(np.array([[1.0 / (precision + prior**2)]]), np.array([prior]), np.ones(1))

    def density(x):
        return np.exp(-0.5 * precision * (x - best) ** 2) / (np.pi * (1.0 + x * x))

    wide = 10.0 / np.sqrt(precision) if precision else np.inf
    evidence = quad(density, -wide, wide, points=[0.0] if precision else None)[0]
    # reason: Laplace's approximation is right to 1/precision, of each side of the logarithm
    assert cost == pytest.approx(-2.0 * np.log(evidence), abs=4.0 / max(precision, 1e3))


def test_no_direction_costs_more_than_a_free_parameter():
    """One that readings narrow down by e^20 of its prior, beside one that they do not see."""
    prior, most = np.full(2, np.sqrt(2.0)), np.log(1000.0)
    covariance = np.diag([1.0 / (np.exp(20.0) + 2.0), 0.5])
    bounded, free = (narrowed(covariance, prior, np.ones(2), limit) for limit in (most, np.inf))
    # log(1 + p pi/2) of p = e^20, less 1e-9; rounding of a pseudo-inverse of condition 1e9 is 1e-7
    assert free == pytest.approx(20.0 + np.log(0.5 * np.pi), abs=1e-6)
    assert bounded == pytest.approx(most, abs=1e-6)


def test_what_is_not_seen_costs_nothing_beside_what_is():
    """Two shapes of which readings see the sum alone: it is one number that they narrow down."""
    seen, prior = 1e4, np.full(2, np.sqrt(2.0))
    one = narrowed(np.array([[1.0 / (2.0 * seen + 2.0)]]), prior[:1], np.ones(1))
    both = np.linalg.inv(seen * np.ones((2, 2)) + np.diag(prior**2))
    # rounding of an inverse of condition 1e4
    assert narrowed(both, prior, np.ones(2)) == pytest.approx(one, abs=1e-6)


def test_what_either_is_or_is_not_has_no_parameter_to_pay_for():
    zero = FitParameter("zero fx_N", "zero", "fx_N", 1.0, sigma=np.inf)
    observed = SimpleNamespace()
    fitter = SimpleNamespace(
        forward=SimpleNamespace(observed=observed), normal=lambda fit: np.eye(1), pressure=lambda fit: np.zeros(1)
    )
    causes = LinkLumping(), InstrumentZero(part="fx_N")
    fits = (
        SimpleNamespace(
            hypothesis=(e,), parameters=[zero], evaluation=SimpleNamespace(z=np.zeros(1)), objective=50.0
        )
        for e in causes
    )
    lumped, shifted = (criterion(fitter, fit, causes, 200.0) for fit in fits)
    # rounding of sums of a few tens
    assert shifted - lumped == pytest.approx(np.log(200.0), rel=1e-12)


def test_an_instrument_off_its_sheet_costs_what_that_says_against_it():
    zero = FitParameter("zero fx_N", "zero", "fx_N", 1.0, sigma=np.inf)
    fitter = SimpleNamespace(
        forward=SimpleNamespace(), normal=lambda fit: np.eye(1), pressure=lambda fit: np.zeros(1)
    )
    cause = InstrumentZero(part="fx_N")

    def cost(z):
        at = SimpleNamespace(z=np.array([z]))
        fit = SimpleNamespace(hypothesis=(cause,), parameters=[zero], evaluation=at, objective=50.0)
        return criterion(fitter, fit, (cause,), 200.0, Costs(off_sheet=True))

    # twice the logarithm of the density of Cauchy's distribution; rounding of sums of a few tens
    assert cost(40.0) - cost(0.0) == pytest.approx(2.0 * np.log(1.0 + 40.0**2), rel=1e-12)


def test_what_a_sheet_gives_exactly_is_not_free():
    """A stiffness beside a scale that is exact: its size is known as if there were no scale."""
    drive = ActuatorCompliance()
    exact = FitParameter("scale fx_N", "scale", "fx_N", 1.0, sigma=0.0)
    alike = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-6]])
    fitter = SimpleNamespace(forward=SimpleNamespace(), normal=lambda fit: alike, pressure=lambda fit: np.zeros(2))
    found = [exact, *coordinates([], (drive,))]
    fit = SimpleNamespace(
        hypothesis=(drive,), parameters=found, evaluation=SimpleNamespace(z=np.array([0.0, 3.0])), objective=50.0
    )
    # three standard deviations of one: something acts, and costs its one parameter, and what lies below none;
    # rounding of sums of a few tens
    expected = 50.0 + np.log(200.0) - 2.0 * norm.logcdf(3.0 * alike[1, 1] ** 0.5)
    assert criterion(fitter, fit, (drive,), 200.0) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("sigmas", "disguised"), [(0.99 * NORMAL_95, True), (1.01 * NORMAL_95, False)])
def test_a_cause_that_may_as_well_be_nothing_costs_what_a_false_alarm_is_worth(sigmas, disguised):
    drive = ActuatorCompliance()
    fitter = SimpleNamespace(
        forward=SimpleNamespace(), normal=lambda fit: np.eye(1), pressure=lambda fit: np.zeros(1)
    )

    def cost(z):
        at = SimpleNamespace(z=np.array([z]))
        fit = SimpleNamespace(
            hypothesis=(drive,), parameters=coordinates([], (drive,)), evaluation=at, objective=50.0
        )
        return criterion(fitter, fit, (drive,), 200.0)

    # less than none there is not: of its normal distribution so much is left; rounding of sums of a few tens
    expected = 2.0 * np.log(1.0 / FALSE_ALARMS) * disguised - 2.0 * norm.logcdf(sigmas)
    assert cost(sigmas) - cost(50.0) == pytest.approx(expected, abs=1e-12)


def test_a_cause_costs_as_much_just_inside_of_a_bound_as_at_it():
    drive = ActuatorCompliance()

    def cost(z, pressure, precision=1.0):
        fitter = SimpleNamespace(
            forward=SimpleNamespace(),
            normal=lambda fit: np.array([[precision]]),
            pressure=lambda fit: np.array([pressure]),
        )
        at = SimpleNamespace(z=np.array([z]))
        fit = SimpleNamespace(
            hypothesis=(drive,), parameters=coordinates([], (drive,)), evaluation=at, objective=50.0
        )
        return criterion(fitter, fit, (drive,), 200.0)

    # a millionth of a standard deviation off it, or pressed by as little: by as little more or less
    assert cost(1e-6, 0.0) == pytest.approx(cost(0.0, 0.0), abs=5e-6)
    assert cost(0.0, 1e-6) == pytest.approx(cost(0.0, 0.0), abs=5e-6)
    assert cost(0.0, 2.0) > cost(0.0, 0.0) > cost(2.0, 0.0)
    # nothing known, or all
    assert np.isfinite([cost(3.0, 0.0, 0.0), cost(3.0, 0.0, 1e-290), cost(3.0, 0.0, 1e290), cost(0.0, 1e9)]).all()


# A search by evidence on a made-up test whose cause is known.


ONLY = ("actuator_compliance", "joint_friction", "link_bow", "instrument_zero")


@pytest.fixture(scope="module")
def searched(make, tmp_path_factory):
    """A search among few causes for a drive that gives way, strength some 100."""
    with pytest.MonkeyPatch.context() as patch:
        files = make.made_up(tmp_path_factory.mktemp("search"), {"actuator_compliance": (2e-5,)}, 5, patch)
    prepared = prepare(observe_ramps(read_measurement(files.data, files.sheet)), only=ONLY)
    fitter = prepared.fitter
    samples = effective_samples(fitter.whitening.autoregression, fitter.whitening.present)
    search = Search(fitter, prepared.null, prepared.effects, samples, signed=prepared.signed)
    return search, search.run()


@pytest.mark.slow
def test_the_hidden_cause_has_the_best_evidence(searched):
    search, best = searched
    assert best.causes == {"actuator_compliance"}
    assert best.criterion == min(r.criterion for r in search.tried.values())


@pytest.mark.slow
def test_a_search_that_goes_on_from_what_is_likely_ends_where_a_whole_one_does(searched):
    search, best = searched
    likely = [r for r in search.tried.values() if r.criterion < best.criterion + RIVAL]
    again = replace(search, known=search.tried)
    found = again.run(likely)
    assert found.labels == best.labels
    # two searches differ by what a fit leaves when it ends
    assert found.criterion == pytest.approx(best.criterion, abs=2.0 * np.sqrt(ENOUGH * ROUNDING))
    # what is not likely is not fitted again
    assert {r.labels for r in likely} <= set(again.tried)
    assert len(again.tried) < len(search.tried)


@pytest.mark.slow
def test_a_worse_fit_of_the_best_takes_nothing_from_it(searched):
    """Else the verdict would weigh an unknown cause beside the best against another fit of the same causes."""
    search, best = searched
    worse = replace(best.fit, objective=best.fit.objective + 10.0)
    assert search.kept(worse) is best
    assert search.tried[best.labels] is best


@pytest.mark.slow
def test_a_second_search_begins_where_the_first_has_ended(searched):
    search, best = searched
    told: list[str] = []
    again = replace(search, known=search.tried, progress=told.append)
    found = again.run()
    assert found.labels == best.labels
    # the same test with the same noise; a fit that begins at its end moves by less than what ends it
    assert found.criterion == pytest.approx(best.criterion, abs=0.5)
    least, null = min(r.criterion for r in search.tried.values()), search.tried[frozenset()].criterion
    beaten = {labels for labels, r in search.tried.items() if r.criterion > 0.5 * (least + null)}
    assert beaten - {frozenset()}, "nothing fell behind, so that this test shows nothing"
    assert not beaten.intersection(again.tried) - {frozenset()}


@pytest.mark.slow
def test_of_nothing_nothing_is_said(searched):
    search, _ = searched
    # without an effect that could explain it, what is wrong stays without a name
    bow = [e for e in search.effects if isinstance(e, LinkBow)]
    found = replace(search, effects=bow, signed=None, known={}).run()
    assert "actuator_compliance" not in found.causes


# Fits near a critical point, where a cause changes how the machine's own nuisances act.


REACH = 2.6
"""mm; posture A as drawn buckles at 2.72."""


@pytest.fixture(scope="module")
def heavy(make, tmp_path_factory):
    """A machine with a weight that is pushed nearly to its critical point."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("heavy")
        files = make.made_up(folder, {"gravity": (3.0,)}, 5, patch, postures=("A",), reach=REACH)
    return prepare(observe_ramps(read_measurement(files.data, files.sheet)))


@pytest.mark.slow
def test_a_fit_ends_at_the_same_place_wherever_it_begins(heavy):
    fitter = heavy.fitter
    gravity = next(e for e in heavy.effects if e.cause == "gravity")
    ends = []
    for sigmas in (-1.5, 3.0):
        for values in ([3.0, 0.5], [1.0, 0.5]):
            begin = np.zeros(len(fitter.nuisances))
            begin[fitter.of_machine] = sigmas
            ends.append(best_fit(fitter, (gravity,), begin, [values]))
    assert None not in ends
    assert all(fit.converged for fit in ends)
    found = [fit.objective for fit in ends]
    # a fit ends where a step brings less than that; without tables of its own they end up to 0.5 apart
    assert np.ptp(found) < ENOUGH * ROUNDING


# the machine's slopes over what they are where the fit begins
@pytest.mark.parametrize("wrong", [-1.0, 0.3, 2.0, (0.0, 1.0, 1.0)])
def test_slopes_from_elsewhere_do_not_lead_uphill(heavy, wrong):
    fitter = heavy.fitter
    gravity = next(e for e in heavy.effects if e.cause == "gravity")
    begin = np.zeros(len(fitter.nuisances))
    best = best_fit(fitter, (gravity,), begin, [[3.0, 0.5]])
    begin[fitter.of_machine] = 1.5
    rough = best_fit(
        fitter, (gravity,), begin, [[1.0, 0.5]], borrowed=fitter.machine_slopes(best) * np.array(wrong)
    )
    assert rough.converged
    assert rough.objective < best.objective + ROUNDING


@pytest.mark.parametrize(("off", "ended"), [(2.0, True), (5.0, False)])
def test_a_fit_ends_at_a_kink_that_costs_little(heavy, monkeypatch, off, ended):
    """One reading, some standard deviations off, gets worse to both sides of the best mass."""
    fitter, observed = heavy.fitter, heavy.fitter.forward.observed
    gravity = next(e for e in heavy.effects if e.cause == "gravity")
    best = best_fit(fitter, (gravity,), np.zeros(len(fitter.nuisances)), [[3.0, 0.5]])
    (mass, *_), right = of_effect(best.parameters, 0), fitter.forward.evaluate
    i, j = np.argwhere(observed.present)[0]

    def kinked(found, z, *more):
        evaluation = right(found, z, *more)
        residual = evaluation.residual.copy()
        # by ten standard deviations for a thousandth of the mass
        way = 1e4 * abs(z[mass] / best.evaluation.z[mass] - 1.0)
        residual[i, j] = observed.noise.wrench[j - observed.columns.index("fx_N")] * (off + way)
        return replace(evaluation, residual=residual)

    monkeypatch.setattr(fitter.forward, "evaluate", kinked)
    fit = best_fit(fitter, (gravity,), best.evaluation.z[: len(fitter.nuisances)], best.values)
    # further off the kink alone costs a hundred squares
    assert fit.evaluation.z[mass] == pytest.approx(best.evaluation.z[mass], rel=1e-3)
    assert fit.converged is ended


@pytest.mark.parametrize("cause", ["base_compliance", "actuator_hardening", "contact_compliance"])
def test_slopes_of_elements_are_those_of_the_readings(heavy, cause):
    fitter = heavy.fitter
    effect = next(e for e in heavy.effects if e.cause == cause)
    found = coordinates(fitter.nuisances, (effect,))
    z = start(found, (effect,), np.zeros(len(fitter.nuisances)), [effect.trials()[0]])
    at, own = fitter.evaluate(found, z, (effect,)), of_effect(found, 0)
    slopes = []
    for i in own:
        step = 1e-3 * max(1.0, abs(z[i])) * np.eye(len(z))[i]
        ends = [fitter.evaluate(found, z + sign * step, (effect,)).residual for sign in (1.0, -1.0)]
        slopes.append((ends[0] - ends[1]) / (2.0 * step[i]))
    size = np.abs(slopes).max()
    assert size > 0.0
    for i, slope in zip(own, slopes, strict=True):
        # the law's central difference over h = 0.05 misses h²/6 of it; readings, in balance to 1e-7 mm only, give
        # their own to some thousandths
        np.testing.assert_allclose(at.exact(i), slope, rtol=0.0, atol=0.004 * np.abs(slope).max() + 1e-5 * size)
