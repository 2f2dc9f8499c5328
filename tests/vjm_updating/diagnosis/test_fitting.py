"""Fits near a critical point, where a cause changes how the machine's own nuisances act."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.fitting import ENOUGH, ROUNDING, best_fit
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.parameters import coordinates, of_effect, start

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
