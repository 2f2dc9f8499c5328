"""Which hypotheses may stand beside the best one."""

from types import SimpleNamespace

import numpy as np
import pytest

from vjm_updating.diagnosis.discrepancy import Misfit
from vjm_updating.diagnosis.document import GainRow, by_hypotheses
from vjm_updating.diagnosis.evidence import ScoredModel
from vjm_updating.diagnosis.verdict import (
    Verdict,
    coarsening,
    credible_causes,
    credible_places,
    in_other_places,
    needless,
    posterior_of,
    proved,
    weights_of,
)
from vjm_updating.inference.instruments import InstrumentZero, ThermalDrift
from vjm_updating.inference.parameters import coordinates
from vjm_updating.inference.significance import LAW_ERROR
from vjm_updating.mechanisms.drives import ActuatorCompliance, ActuatorHardening, Asymmetry
from vjm_updating.mechanisms.structure import LinkCompliance

DRIFT, ZERO = ThermalDrift(part="ux_mm", by="K", span=1.0), InstrumentZero(part="fx_N")
LINEAR, HARDENING = ActuatorCompliance(), ActuatorHardening()


def ranked(*effects, objective=100.0):
    fit = SimpleNamespace(hypothesis=effects, objective=objective, parameters=coordinates([], effects))
    return ScoredModel(fit, objective)


def test_a_law_that_contains_another_and_is_no_better_is_needless():
    # a spring of its own may as well be linear, a drift is a zero error and a slope
    assert needless(ranked(LINEAR), ranked(HARDENING))
    assert needless(ranked(ZERO), ranked(DRIFT))
    # the converse
    assert not needless(ranked(HARDENING), ranked(LINEAR))


def test_a_law_that_contains_one_of_two_causes_does_not_say_the_same_as_both():
    both = ranked(LINEAR, InstrumentZero(part="fx_N"))
    assert not needless(both, ranked(HARDENING))
    assert needless(both, ranked(HARDENING, InstrumentZero(part="fx_N")))


def test_a_links_two_stiffnesses_contain_that_links_softness_and_no_others():
    softer, pull_and_push = (
        LinkCompliance("fore", "fore"),
        {name: Asymmetry(name, name) for name in ("fore", "upper")},
    )
    assert needless(ranked(softer), ranked(pull_and_push["fore"]))
    assert not needless(ranked(softer), ranked(pull_and_push["upper"]))
    # an only link has no name
    assert needless(ranked(LinkCompliance("rod")), ranked(Asymmetry("link", "rod")))


def test_a_zero_error_beside_a_drift_of_another_channel_is_not_needless():
    both = ranked(DRIFT, ZERO)
    assert not needless(both, both)
    assert needless(both, ranked(DRIFT, ZERO, InstrumentZero(part="ux_mm")))


@pytest.mark.parametrize(
    ("after", "expected", "fall", "doubt"),
    [
        # better than none, by as much as a law that is off by 38 % leaves at most, and by less
        (1.4, 0.1, 0.2, ""),
        (1.6, 0.1, 0.2, "explains hardly anything of what was held out"),
        # worse than none, as a right model's might be; worse than that, within and beyond the scatter
        (2.9, 1.5, -0.1, ""),
        (2.9, 1.4, 0.1, ""),
        (2.9, 1.4, -0.1, "predicts what was held out worse than no cause does"),
    ],
)
@pytest.mark.parametrize("causes", [(LINEAR,), (LINEAR, ZERO)])
def test_what_was_held_out_counts_where_a_right_model_would_do_better(after, expected, fall, doubt, causes):
    verdict = Verdict("named", (ranked(*causes),), (1.0,), 0.8, (), Misfit(1.0, 0.0, ""))
    gain = GainRow(
        rmse_before=2.0, rmse_after=after, interval95=[-1.0, fall], before_in_sigma=2.0, after_in_sigma=after,
        expected_in_sigma=expected, split="postures",
    )  # fmt: skip
    found = proved(verdict, gain)
    if not doubt:
        assert found is verdict
    else:
        assert (found.kind, found.members) == ("unknown", ())
        assert found.others == ((verdict.members[0], 1.0),)
        assert found.doubt.endswith(doubt)


def test_a_cause_may_sit_in_another_place():
    def at(*parts, converged=True):
        found = ranked(*(ThermalDrift(part=part, by="K", span=1.0) for part in parts))
        found.fit.converged = converged
        return found

    assert in_other_places(at("fx_N"), at("ux_mm"))
    assert not in_other_places(at("fx_N"), at("fx_N"))
    assert not in_other_places(at("fx_N", converged=False), at("ux_mm"))
    # two places at once are another hypothesis
    assert not in_other_places(at("fx_N", "fz_N"), at("ux_mm"))


def test_only_fits_that_have_ended_have_a_weight():
    def fitted(*effects, objective, converged=True):
        found = ranked(*effects, objective=objective)
        found.fit.converged = converged
        return found

    best = fitted(LINEAR, objective=100.0)
    # as likely as e^-1; below the best for its fit has not ended; more causes than needed
    rival = fitted(HARDENING, objective=102.0)
    rest = fitted(ZERO, objective=60.0, converged=False), fitted(LINEAR, ZERO, objective=99.0)
    weights = weights_of((best, rival, *rest), best)
    assert weights == {
        best: pytest.approx(1.0 / (1.0 + np.exp(-1.0))),
        rival: pytest.approx(np.exp(-1.0) / (1.0 + np.exp(-1.0))),
    }
    # that nothing acts is as likely as its own criterion makes it
    nothing = fitted(objective=104.0)
    assert weights_of((best, nothing), best)[nothing] == pytest.approx(np.exp(-2.0) / (1.0 + np.exp(-2.0)))
    # there is no other to go by where the best's own has not ended
    alone = fitted(LINEAR, objective=100.0, converged=False)
    assert weights_of((alone, *rest), alone) == {alone: 1.0}


def test_places_are_credible_up_to_what_an_interval_holds():
    parts = "fx_N", "ux_mm", "fz_N", "fy_N"
    first, *others = (ranked(ThermalDrift(part=part, by="K", span=1.0)) for part in parts)
    for one in (first, *others):
        one.fit.converged = True
    other = ranked(ZERO)
    # 0.90 and 0.94 are not enough, 0.96 is; another cause is no place
    weights = {others[2]: 0.04, others[0]: 0.04, first: 0.9, others[1]: 0.02, other: 5.0}
    weights = {one: weights[one] for one in (*others[::-1], other, first)}
    assert set(credible_places(weights, first)) == {others[0], others[2]}
    assert credible_places({first: 0.96, others[0]: 0.04}, first) == ()
    # of many that are as likely, as many as make 95 in a hundred
    assert len(credible_places({first: 0.25, others[0]: 0.25, others[1]: 0.25, others[2]: 0.25}, first)) == 3


def test_the_fewest_sets_of_causes_that_hold_95_in_a_hundred_are_a_class_with_the_likeliest_first():
    best, near, far = ranked(DRIFT), ranked(LINEAR), ranked(ZERO)
    for one in (best, near, far):
        one.fit.converged = True
    assert credible_causes(best, {best: 0.96, near: 0.03, far: 0.01}) == [best]
    assert credible_causes(best, {best: 0.5, near: 0.46, far: 0.04}) == [best, near]
    assert credible_causes(best, {far: 0.06, best: 0.5, near: 0.44}) == [best, near, far]
    # two runners-up that are alike do not put the leader out
    assert credible_causes(best, {best: 0.4, near: 0.3, far: 0.3})[0] is best


def test_a_set_that_says_the_same_with_more_is_no_member_of_a_class():
    best, contained = ranked(LINEAR), ranked(HARDENING)
    for one in (best, contained):
        one.fit.converged = True
    assert credible_causes(best, {best: 0.6, contained: 0.4}) == [best]
    # it counts as what it contains: nothing unlikely fills its place
    unlikely = ranked(ZERO)
    unlikely.fit.converged = True
    assert credible_causes(best, {best: 0.6, contained: 0.4, unlikely: 1e-9}) == [best]


def searched(squares):
    """A search that has tried hypotheses, with the squares that each leaves of 24 readings."""
    for one in squares:
        one.fit.converged, one.fit.evaluation = True, SimpleNamespace(residual=np.ones((4, 6)))
    left = {len(one.fit.parameters): own for one, own in squares.items()}
    fitter = SimpleNamespace(
        whitening=SimpleNamespace(present=np.ones((4, 6), dtype=bool), flat=np.ravel),
        squares=lambda found, _: left[len(found)],
    )
    null = next(one.fit for one in squares if not one.labels)
    return SimpleNamespace(tried={one.labels: one for one in squares}, fitter=fitter, singles=dict, null=null)


@pytest.mark.parametrize(("strength", "sure"), [(10.0, True), (100.0, False)])
def test_what_a_law_may_leave_that_is_a_few_per_cent_wrong_makes_no_cause_beside_it_sure(strength, sure):
    """A cause beside another lowers the criterion by 20 more than it costs, at 10 and at 100 sigma of the other."""
    best, main, null = ranked(DRIFT, LINEAR), ranked(LINEAR, objective=30.0), ranked(objective=strength**2)
    best = ScoredModel(best.fit, 10.0, 12.0)
    search = searched({best: 20.0, main: 50.0, null: strength**2})
    never = ScoredModel(null.fit, 1e4)
    power = coarsening(strength**2, LAW_ERROR)
    found = posterior_of(search, best, never, never, power)
    p = found.causes[0]
    assert p["actuator_compliance"] > 0.999
    assert (p["thermal_drift"] > 0.95) is sure
    # the evidence as it stands is sure of both: odds of exp(10)
    assert by_hypotheses(found.hypotheses)[0]["thermal_drift"] > 0.9999


def test_a_cause_whose_fit_failed_is_no_hypothesis_whatever_it_promised():
    """To first order it was better than the best: it was said to act with 0.99 without a fit."""
    best, null = ranked(LINEAR, objective=100.0), ranked(objective=400.0)
    search = searched({best: 100.0, null: 400.0})
    search.singles = lambda: {ZERO: 90.0, DRIFT: 104.0}
    p = posterior_of(search, best, ScoredModel(null.fit, 1e4), ScoredModel(best.fit, 1e4)).causes[0]
    assert set(p) == {"actuator_compliance", "thermal_drift"}
    assert p["actuator_compliance"] == pytest.approx(1.0 / (1.0 + np.exp(-2.0)))


def test_a_best_hypothesis_whose_fit_has_not_ended_has_a_posterior():
    """It is said to be unsure; before, the diagnosis ended in an error."""
    best, null = ranked(LINEAR, objective=10.0), ranked(objective=400.0)
    search = searched({best: 30.0, null: 400.0})
    best.fit.converged = False
    found = posterior_of(search, best, ScoredModel(null.fit, 300.0), ScoredModel(best.fit, 30.0))
    assert found.hypotheses[0].places == {"actuator_compliance": ["actuator_compliance"]}
    assert found.hypotheses[0].probability == pytest.approx(1.0, abs=1e-4)
    # of 400 squares, of which 24 are noise, 370 are gone
    assert found.explained == pytest.approx(370.0 / 376.0)
