"""Fits that begin elsewhere: a law has several optima, and which is found first says nothing of the cause."""

import numpy as np

from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference.fitting import best_fit
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.refit import begun_anew


def test_a_soft_stop_is_found_from_a_hard_one(make, tmp_path, monkeypatch):
    # travel, place, force that crosses it, and yielding of its ends
    true, hard = (0.092, -0.055, 1050.0, 0.19), (0.04, 0.0, 10.0, 0.0)
    files = make.made_up(tmp_path, {"actuator_backlash": true}, 25, monkeypatch, per=4, postures=("A",))
    prepared = prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    fitter = prepared.fitter
    backlash = next(effect for effect in prepared.effects if effect.label == "actuator_backlash")
    begin = np.zeros(len(fitter.nuisances))
    first, known = (best_fit(fitter, (backlash,), begin, [values]) for values in (hard, true))
    assert first is not None
    assert known is not None
    # the optimum that is found first is a local one: odds of exp(25) to 1 against a cause that acts
    assert first.objective > known.objective + 50.0
    # within one standard deviation of one parameter
    assert begun_anew(fitter, first).objective < known.objective + 1.0
