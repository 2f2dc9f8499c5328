"""When a search takes a cause, and what it does not try again."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vjm_updating.calibrate.noise import memory_of
from vjm_updating.diagnose.instrument import InstrumentZero, ThermalDrift
from vjm_updating.diagnose.parameters import AFAR, Coordinate
from vjm_updating.diagnose.scored_hypothesis import Ranked
from vjm_updating.diagnose.search import SHORT, Search
from vjm_updating.diagnose.stopping import CLOSE, FALLEN, WRONG_LAW
from vjm_updating.diagnose.whitening import Whitening
from vjm_updating.mechanisms.link_bow import LinkBow
from vjm_updating.mechanisms.link_lumping import LinkLumping
from vjm_updating.mechanisms.part_compliance import FootCompliance, LinkCompliance

ONE, OTHER = InstrumentZero(part="fx_N"), InstrumentZero(part="ux_mm")
EXPLAINED = 500.0


READINGS = 20
PRESENT = np.zeros((READINGS, 6), dtype=bool)
PRESENT[:, 0] = True
WHITE = Whitening(np.tile(np.eye(6), (READINGS, 1, 1)), memory_of(np.zeros(READINGS, dtype=int), PRESENT), PRESENT)


def evenly(squares):
    """Residuals ``(n, 6)`` of one channel, all of a size."""
    return np.sqrt(max(squares, 0.0) / READINGS) * np.eye(6)[np.zeros(READINGS, dtype=int)]


def ranked(*effects, objective, criterion, converged=True):
    fit = SimpleNamespace(hypothesis=effects, objective=objective, values=[], at=None, converged=converged)
    return Ranked(fit, criterion)


def search(*tried, hints=(), dragged=False):
    """With an alarm that a gain of 15 by one parameter does not give."""
    # fits cannot be made any better
    fitter = SimpleNamespace(
        nuisances=(),
        machine_slopes=None,
        fit=lambda *args, **kwargs: None,
        dragged=lambda null: dragged,
        whitening=WHITE,
    )
    null = ranked(objective=1000.0, criterion=1000.0)
    for r in (null, *tried):
        r.fit.at = r.fit.at or SimpleNamespace(z=[], residual=evenly(r.fit.objective))
    return Search(
        fitter,
        null.fit,
        (ONE, OTHER),
        100.0,
        hints={r.labels: r for r in hints},
        tried={r.labels: r for r in (null, *tried)},
        alarm=1e-5,
    )


@pytest.mark.parametrize(("gain", "taken"), [(15.0, False), (25.0, True)])
def test_a_first_cause_must_stand_out_of_noise(gain, taken):
    new = ranked(ONE, objective=1000.0 - gain, criterion=1000.0 - gain + 5.0)
    own = search(new)
    assert own._better(own.tried[frozenset()], 1) is (new if taken else None)


def test_one_stands_out_and_another_is_likelier():
    # what a law with many free shapes explains says that there is something; a simpler one says as much
    loud = ranked(ONE, objective=975.0, criterion=1010.0)
    likely = ranked(OTHER, objective=985.0, criterion=990.0)
    assert search(likely)._better(search(likely).tried[frozenset()], 1) is None
    own = search(loud, likely)
    assert own._better(own.tried[frozenset()], 1) is likely


@pytest.mark.parametrize(
    ("gain", "cost", "taken"),
    # worth its price; not worth it; what a slightly wrong law of the first leaves
    [(15.0, 12.0, True), (15.0, 16.0, False), (0.9 * WRONG_LAW * EXPLAINED, 0.0, False)],
)
def test_a_further_cause_must_be_worth_its_price(gain, cost, taken):
    first = ranked(ONE, objective=1000.0 - EXPLAINED, criterion=510.0)
    both = ranked(ONE, OTHER, objective=first.fit.objective - gain, criterion=first.criterion - gain + cost)
    assert search(first, both)._better(first, 2) is (both if taken else None)


@pytest.mark.parametrize(("share", "rho", "taken"), [(0.4, 0.0, True), (0.6, 0.0, False), (0.6, 0.6, False)])
def test_a_further_cause_is_no_explanation_of_a_single_reading(share, rho, taken):
    first = ranked(ONE, objective=1000.0 - EXPLAINED, criterion=510.0)
    both = ranked(ONE, OTHER, objective=450.0, criterion=470.0)
    own = search(first, both)
    memory = replace(WHITE.memory, rho=np.full(6, rho))
    own.fitter.whitening = replace(WHITE, memory=memory)
    # beyond what is left of each reading, in the one that the second cause explains, and in all
    gain = first.fit.objective - both.fit.objective
    free = np.sqrt(np.full(READINGS, 20.0) + (1.0 - share) * gain / READINGS)
    free[7] = np.sqrt(free[7] ** 2 + share * gain)
    for r, white in ((first, free), (both, np.full(READINGS, np.sqrt(20.0)))):
        r.fit.at = SimpleNamespace(z=[], residual=remembering(white, rho)[:, None] * np.eye(6)[0])
        # round-off
        assert own.fitter.whitening.flat(r.fit.at.residual) == pytest.approx(white, rel=1e-12)
    assert own._better(first, 2) is (both if taken else None)


def remembering(white, rho):
    """Residuals ``(n,)`` of a memory of first order, from ones without."""
    result = [white[0]]
    for one in white[1:]:
        result.append(rho * result[-1] + np.sqrt(1.0 - rho**2) * one)
    return np.array(result)


@pytest.mark.parametrize(
    ("behind", "converged", "dragged", "again"),
    # led astray; ended by itself; by slopes that can be relied on; too far behind to be the right one
    [(1.0, False, True, True), (1.0, True, True, False), (1.0, False, False, False), (4.0, False, True, False)],
)
def test_a_fit_that_dragged_nuisances_led_astray_is_made_exact(monkeypatch, behind, converged, dragged, again):
    best = ranked(ONE, objective=490.0, criterion=500.0)
    lost = ranked(OTHER, objective=490.0, criterion=500.0 + behind * (CLOSE + 10.0), converged=converged)
    own, polished = search(best, lost, dragged=dragged), []
    monkeypatch.setattr(Search, "_polish", lambda self, known: polished.append(known))
    own._better(own.tried[frozenset()], 1)
    assert (lost in polished) is again
    assert best in polished


@pytest.mark.parametrize(
    ("behind", "explained", "beaten"), [(1.1, 50.0, True), (0.9, 50.0, False), (1.1, 900.0, True)]
)
def test_what_fell_far_behind_is_not_tried_again(behind, explained, beaten):
    least = 1000.0 - explained
    far = least + behind * max(CLOSE, FALLEN * explained)
    hints = (
        ranked(objective=1000.0, criterion=1000.0),
        ranked(ONE, objective=0.0, criterion=least),
        ranked(OTHER, objective=0.0, criterion=far),
    )
    own = search(hints=hints)
    assert own._beaten(frozenset([OTHER.label])) is beaten
    assert not own._beaten(frozenset([ONE.label]))
    # what was never tried may be anything
    assert not own._beaten(frozenset([ONE.label, OTHER.label]))


@pytest.mark.parametrize(
    ("promised", "fitted"),
    # beside the best cause, beside a rival; enough to be better than the best alone, and not
    [
        ({ONE.label: 8.0}, [(ONE, FootCompliance())]),
        ({ONE.label: 5.0}, []),
        ({OTHER.label: 20.0}, [(OTHER, FootCompliance())]),
        ({OTHER.label: 14.0}, []),
        # the better one of the same two causes
        ({ONE.label: 8.0, OTHER.label: 20.0}, [(OTHER, FootCompliance())]),
    ],
)
def test_pairs_are_fitted_that_promise_to_be_better_than_the_best_cause(monkeypatch, promised, fitted):
    best, rival = (ranked(e, objective=v, criterion=v) for e, v in ((ONE, 890.0), (OTHER, 900.0)))
    own, tried = search(best, rival), []

    def beside(self, base, found):
        mixture = promised.get(*base.labels, 0.0)
        return [SimpleNamespace(effect=FootCompliance(), mixture=mixture, starts=[(1.0,)], explained=99.0)]

    monkeypatch.setattr(Search, "_scores", beside)
    monkeypatch.setattr(Search, "_try", lambda self, hypothesis, *args: tried.append(hypothesis))
    monkeypatch.setattr("vjm_updating.diagnose.search.projection", lambda fitter, fit: None)
    own._pairs(best, [])
    assert tried == fitted


@pytest.mark.parametrize(
    ("second", "fitted"),
    [
        (ThermalDrift(part="fx_N", by="s"), False),
        (ThermalDrift(part="ux_mm", by="s"), True),
        (InstrumentZero(part="fx_N"), True),
    ],
)
def test_a_gauge_drifts_by_one_law(monkeypatch, second, fitted):
    own = search()
    own.fitter.fit = lambda hypothesis, *_, **__: SimpleNamespace(hypothesis=hypothesis, objective=900.0)
    monkeypatch.setattr(Search, "_criterion", lambda self, fit: fit.objective)
    null = own.tried[frozenset()].fit
    null.found, null.at.z = [], np.zeros(0)
    own._try((ThermalDrift(part="fx_N", by="K"), second), null, [[(1.0, 0.0), (1.0, 0.0)]])
    assert (len(own.tried) == 2) is fitted


def first_tried(monkeypatch, own, shown):
    """The causes that a search fits alone, by their scores."""
    tried = []
    own.fitter.differentiate_near = lambda *_: None
    own.null.values = []
    for name, what in (("_signatures", []), ("_scores", shown), ("_null_from", False), ("_better", None)):
        monkeypatch.setattr(Search, name, lambda *_, what=what: what)
    monkeypatch.setattr(Search, "_criterion", lambda self, fit: fit.objective)
    monkeypatch.setattr(Search, "_try", lambda self, hypothesis, *_: tried.append(hypothesis[-1]))
    monkeypatch.setattr("vjm_updating.diagnose.search.threshold", lambda ranked: 1e-4)
    own.run()
    return tried


@pytest.mark.parametrize(("p", "fitted"), [(1e-4, True), (0.1, False)])
def test_what_has_no_size_is_fitted_whatever_its_slope_says(monkeypatch, p, fitted):
    channels = ("ux_mm", "fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
    louder = [InstrumentZero(part=channel) for channel in channels]
    scores = [SimpleNamespace(effect=effect, p=1e-9, starts=[()], explained=50.0) for effect in louder]
    scores.append(SimpleNamespace(effect=LinkLumping(), p=p, starts=[()], explained=30.0))
    tried = first_tried(monkeypatch, search(), scores)
    assert (LinkLumping() in tried) is fitted
    assert [effect for effect in tried if effect != LinkLumping()] == louder[:SHORT]


@pytest.mark.parametrize("dragged", [False, True])
def test_what_dragged_nuisances_can_imitate_is_fitted_all_the_same(monkeypatch, dragged):
    # to first order one of the two shows nothing that the nuisances do not
    shown = [SimpleNamespace(effect=ONE, p=1e-9, starts=[(1.0,)], explained=50.0)]
    tried = first_tried(monkeypatch, search(dragged=dragged), shown)
    assert tried == ([ONE, OTHER] if dragged else [ONE])


@pytest.mark.parametrize(
    ("rough", "exact", "taken"), [(975.0, 951.0, 951.0), (975.0, None, 975.0), (955.0, 951.0, 955.0)]
)
def test_a_fit_that_others_slopes_have_led_astray_gets_its_own(monkeypatch, rough, exact, taken):
    def fit(hypothesis, begin, values, *, fresh=False, **_):
        objective = exact if fresh else rough
        own.fitter.machine_slopes = "its own" if fresh else own.fitter.machine_slopes
        return objective and SimpleNamespace(hypothesis=hypothesis, objective=objective)

    own = search()
    own.fitter.fit, own.fitter.machine_slopes = fit, "of the null"
    monkeypatch.setattr(Search, "_criterion", lambda self, fit: fit.objective)
    null = own.tried[frozenset()].fit
    null.found, null.at.z = [], np.zeros(0)
    # first order promises 950
    own._try((LinkLumping(),), null, [[()]], 50.0)
    assert own.tried[frozenset([LinkLumping().label])].fit.objective == taken
    assert own.fitter.machine_slopes == "of the null"


@pytest.mark.parametrize(
    ("promised", "rival", "amplitudes"),
    # a promise not kept; one that first order cannot make; one that would come too late; one kept
    [(50.0, 1000.0, [8.0, 2.4]), (450.0, 1000.0, [8.0]), (50.0, 930.0, [8.0]), (30.0, 1000.0, [8.0])],
)
def test_a_fit_that_falls_short_of_what_first_order_promises_begins_again_nearer(
    monkeypatch, promised, rival, amplitudes
):
    begun = []

    def fit(hypothesis, begin, values, **_):
        begun.append(values[-1][1])
        # from far away it ends in another optimum
        return SimpleNamespace(hypothesis=hypothesis, objective=975.0 if values[-1][1] > 5.0 else 950.0)

    own = search(ranked(ONE, objective=rival, criterion=rival))
    own.fitter.fit, own.fitter.squares = fit, lambda found, at: rival
    monkeypatch.setattr(Search, "_criterion", lambda self, fit: fit.objective)
    null = own.tried[frozenset()].fit
    for known in own.tried.values():
        known.fit.found = []
    null.at.z = np.zeros(0)
    own._try((LinkBow(),), null, [[(0.0, 8.0)]], promised)
    assert begun == pytest.approx(amplitudes)
    assert own.tried[frozenset([LinkBow().label])].fit.objective == (950.0 if len(begun) > 1 else 975.0)


@pytest.mark.parametrize(
    ("effect", "begun"), [(LinkCompliance(beam="link"), [0.0, 1.0, -1.0]), (FootCompliance(), [0.0]), (ONE, [0.0])]
)
def test_a_bars_stiffness_is_looked_for_from_afar_too(monkeypatch, effect, begun):
    link = Coordinate("modulus link", "modulus", "link", np.log(AFAR))
    tried = []

    def fit(hypothesis, begin, values, **_):
        tried.append(begin[0])
        return SimpleNamespace(hypothesis=hypothesis, objective=900.0 - 50.0 * begin[0])

    own = search()
    own.fitter.fit, own.fitter.nuisances = fit, (link,)
    monkeypatch.setattr(Search, "_criterion", lambda self, fit: fit.objective)
    null = own.tried[frozenset()].fit
    null.found, null.at.z = [link], np.zeros(1)
    own._try((effect,), null, [[(1.0,)]])
    assert tried == pytest.approx(begun)
    assert own.tried[frozenset([effect.label])].fit.objective == 900.0 - 50.0 * max(begun)
