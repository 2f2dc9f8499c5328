"""Steps to which readings are rounded are told from steps that a test takes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from vjm_updating.experiment import Instrument, Sheet
from vjm_updating.inference.noise import noise_of, rounding_step


def measured(noise, **channels):
    known = {name: Instrument(noise=noise) for name in channels}
    sheet = Sheet(test={"model": "orthoglide-chain"}, instrument=known, file="sheet.toml")
    return SimpleNamespace(readings=SimpleNamespace(values=channels), sheet=sheet)


def test_rounding_is_seen_where_values_are_read_twice():
    rng = np.random.default_rng(1)
    force = np.linspace(0.0, 100.0, 300) + rng.standard_normal(300)
    assert rounding_step(force) == 0.0
    # most values are different ones; round-off of numbers of some hundred over the step
    fine = 0.25 * np.round(force / 0.25)
    assert len(np.unique(fine)) > 150
    assert rounding_step(fine) == pytest.approx(0.25, rel=1e-12)
    # steps of a test, each read once
    assert rounding_step(np.arange(0.0, 100.0, 5.0)) == 0.0


@pytest.mark.parametrize(("step", "rounded"), [(3.4, True), (3.5, False)])
def test_a_gauge_rounds_to_no_more_than_its_own_noise(step, rounded):
    # even errors of half a step have a standard deviation of a step over √12
    place = step * np.tile(np.arange(10.0), 4)
    noise = noise_of(measured(1.0, ux_mm=place))
    assert noise.quantum == ({"ux_mm": pytest.approx(step)} if rounded else {})
    assert noise.pose[0] == pytest.approx(np.hypot(1.0, step / np.sqrt(12.0)) if rounded else 1.0)


def test_a_force_without_noise_has_that_of_its_rounding():
    force = 25.0 * np.tile(np.arange(10.0), 4)
    # round-off
    assert noise_of(measured(0.0, fx_N=force)).wrench[0] == pytest.approx(25.0 / np.sqrt(12.0), rel=1e-12)
    with pytest.raises(ValueError, match="fx_N"):
        noise_of(measured(0.0, fx_N=np.linspace(0.0, 1.0, 40) ** 2))
