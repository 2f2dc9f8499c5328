"""Which hypotheses may stand beside the best one."""

from types import SimpleNamespace

from vjm_validation.diagnosis.instrument import InstrumentZero, ThermalDrift
from vjm_validation.diagnosis.search import Ranked
from vjm_validation.diagnosis.verdict import PAYS, needless

DRIFT, ZERO = ThermalDrift(part="ux_mm", by="K", span=1.0), InstrumentZero(part="fx_N")


def ranked(*effects, objective=100.0):
    return Ranked(SimpleNamespace(hypothesis=effects, objective=objective), objective)


def test_a_law_with_a_parameter_more_must_pay_for_it():
    best = ranked(ZERO)
    # a drift is a zero error and a slope
    assert needless(best, ranked(DRIFT, objective=best.fit.objective - PAYS + 0.1))
    assert not needless(best, ranked(DRIFT, objective=best.fit.objective - PAYS - 0.1))


def test_a_zero_error_beside_a_drift_of_another_channel_is_not_needless():
    both = ranked(DRIFT, ZERO)
    assert not needless(both, both)
    assert needless(both, ranked(DRIFT, ZERO, InstrumentZero(part="ux_mm")))
