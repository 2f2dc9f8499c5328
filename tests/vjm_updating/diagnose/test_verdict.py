"""Which hypotheses may stand beside the best one."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from vjm_updating.diagnose.instrument import InstrumentZero, ThermalDrift
from vjm_updating.diagnose.model_adequacy import Misfit
from vjm_updating.diagnose.parameters import coordinates
from vjm_updating.diagnose.scored_hypothesis import Ranked
from vjm_updating.diagnose.verdict import (
    PAYS,
    Verdict,
    in_other_places,
    left_by_laws,
    needless,
    proved,
    surely_nothing,
)
from vjm_updating.mechanisms.actuator_compliance import ActuatorCompliance
from vjm_updating.mechanisms.actuator_hardening import RATIO, ActuatorHardening

DRIFT, ZERO = ThermalDrift(part="ux_mm", by="K", span=1.0), InstrumentZero(part="fx_N")
LINEAR, HARDENING = ActuatorCompliance(), ActuatorHardening()


def ranked(*effects, objective=100.0):
    fit = SimpleNamespace(hypothesis=effects, objective=objective, found=coordinates([], effects))
    return Ranked(fit, objective)


def known_within(*errors):
    """A fitter that knows a hypothesis' coordinates within such standard deviations."""
    return SimpleNamespace(normal=lambda fit: np.diag([(1.0 / e) ** 2 for e in errors or [1.0] * len(fit.found)]))


@pytest.mark.parametrize(("error", "out"), [(0.3, True), (0.6, False)])
def test_a_shape_that_would_not_show_does_not_exclude_its_cause(error, out):
    # the usual hardening is a factor of 2.5 either way: seen where its logarithm is known within half of that
    assert RATIO.spread == pytest.approx(np.log(2.5))
    best, rival = ranked(LINEAR), ranked(HARDENING)
    assert needless(known_within(error, 1e-6, 0.3), best, rival) is out
    assert not needless(known_within(error, 1e-6, 0.3), best, ranked(HARDENING, objective=100.0 - PAYS - 0.1))


def test_a_law_with_a_parameter_more_must_pay_for_it():
    best = ranked(ZERO)
    # a drift is a zero error and a slope
    assert needless(known_within(), best, ranked(DRIFT, objective=best.fit.objective - PAYS + 0.1))
    assert not needless(known_within(), best, ranked(DRIFT, objective=best.fit.objective - PAYS - 0.1))


def test_a_zero_error_beside_a_drift_of_another_channel_is_not_needless():
    both = ranked(DRIFT, ZERO)
    assert not needless(known_within(), both, both)
    assert needless(known_within(), both, ranked(DRIFT, ZERO, InstrumentZero(part="ux_mm")))


@pytest.mark.parametrize(
    ("after", "expected", "counts"),
    # better than none; worse than none, as a right model's might be; worse than that
    [(1.9, 0.1, False), (2.9, 1.5, False), (2.9, 1.4, True)],
)
@pytest.mark.parametrize("causes", [(LINEAR,), (LINEAR, ZERO)])
def test_what_was_held_out_counts_where_a_right_model_would_do_better(after, expected, counts, causes):
    verdict = Verdict("named", (ranked(*causes),), (1.0,), 0.8, (), Misfit(1.0, 0.0, ""))
    found = proved(verdict, 2.0, after, expected)
    if not counts:
        assert found is verdict
    else:
        assert (found.kind, found.members) == ("unknown", ())
        assert found.others == ((verdict.members[0], 1.0),)
        assert found.doubt.endswith("predicts what was held out worse than no cause does")


@pytest.mark.parametrize(("confidence", "kind"), [(0.51, "named"), (0.49, "unknown")])
def test_causes_that_are_more_likely_wrong_than_right_are_not_named(confidence, kind):
    verdict = Verdict("named", (ranked(LINEAR),), (1.0,), confidence, (), Misfit(1.0, 0.0, ""))
    found = proved(verdict, 2.0, 1.0, 1.0)
    assert found.kind == kind
    # either way it is more likely right than wrong
    assert found.confidence == 0.51


def test_nothing_is_less_sure_the_nearer_an_alarm_came():
    def sure(least, rest):
        return surely_nothing(SimpleNamespace(first=[SimpleNamespace(p=least)], alarm=1e-3), Misfit(rest, 0.0, ""))

    # more likely than not that something faint is there; hardly any chance of it; no effect to test
    assert sure(1e-3, 1.0) < 0.5 < sure(0.05, 1.0) < sure(0.9, 1.0) < 0.9
    assert sure(0.9, 0.01) < sure(0.9, 1.0)
    assert surely_nothing(SimpleNamespace(first=[], alarm=1e-3), Misfit(1.0, 0.0, "")) == sure(1.0, 1.0)


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


@pytest.mark.parametrize("size", [0.5, 1.0, 3.0])
def test_what_a_law_leaves_is_judged_by_what_it_explains(size):
    # a leftover of so many standard deviations of the discrepancy has a Gaussian's two-sided chance
    explained = 160.0**2
    rest = Misfit(1e-12, (size * 0.07) ** 2 * explained, "fx_N: shape")
    assert left_by_laws(rest, explained, 0.07) == pytest.approx(2.0 * norm.sf(size), rel=1e-9)


def test_noise_excuses_what_no_law_does():
    assert left_by_laws(Misfit(0.4, 30.0, "fx_N: shape"), 1.0, 0.07) == 0.4
    assert left_by_laws(Misfit(1e-9, 30.0, "fx_N: shape"), 0.0, 0.07) == 1e-9
    # exact laws leave noise alone
    assert left_by_laws(Misfit(1e-9, 30.0, "fx_N: shape"), 900.0, 0.0) == 1e-9
