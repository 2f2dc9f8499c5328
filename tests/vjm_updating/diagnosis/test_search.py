"""A search by evidence on a made-up test whose cause is known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from vjm_updating.diagnosis.evidence import effective_samples
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.search import Search
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.mechanisms.structure import LinkBow

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
