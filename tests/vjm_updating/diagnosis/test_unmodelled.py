"""A cause that no catalogue has is a hypothesis like any other, whose evidence is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.verdict import SIZES, kind_present, unmodelled
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference.fitting import prior
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.model_error import driven_place
from vjm_updating.inference.parameters import Coordinate


@pytest.mark.parametrize("residual", [(0.1, -0.4, 1.2), (6.0, -2.0, 0.5), (40.0, 90.0, -10.0)])
def test_the_evidence_of_a_kind_is_that_of_gaussians_of_all_sizes(residual):
    # densities of the residual itself, mixed as a statistics library has them
    noise = multivariate_normal(np.zeros(3), np.eye(3)).logpdf(residual)
    acts = [multivariate_normal(np.zeros(3), (1.0 + a**2) * np.eye(3)).logpdf(residual) for a in SIZES]
    mixed = np.logaddexp(np.log(0.8) + noise, np.log(0.2) + np.logaddexp.reduce(acts) - np.log(len(SIZES)))
    found = kind_present(3, float(np.sum(np.square(residual))), 0.2)
    assert found == pytest.approx(-2.0 * (mixed - noise), rel=1e-10)


def test_shapes_are_likelier_than_noise_only_where_they_are(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path, {}, 8, monkeypatch)
    prepared = prepare(observe_ramps(read_measurement(files.data, files.sheet)))
    fitter, null = prepared.fitter, prepared.null
    place = driven_place(fitter.forward.observed)

    def change(force):
        residual = null.at.residual.copy()
        residual[:, 0] += np.where(fitter.whitening.present[:, 0], force * np.sin(20.0 * place), 0.0)
        return unmodelled(fitter, replace(null, at=replace(null.at, residual=residual)))

    # noise speaks against them, a wave of four standard deviations for them, and ten times as large more so
    assert change(0.0) > 0.0 > change(8.0) > change(80.0)
    # nor need there be a shape: noise three times as large as the sheet says
    assert change(2.0 * 3.0 * np.random.default_rng(1).standard_normal(len(place)) / np.sin(20.0 * place)) < 0.0


@pytest.mark.parametrize("z", [-30.0, -2.0, -0.1, 0.0, 0.3, 5.0])
def test_a_shape_far_off_is_rare_and_a_tolerance_far_off_impossible(z):
    found = [Coordinate("a", "effect", "0", 1.0, 0.5, 2.0), Coordinate("b", "zero", "fx_N", 1.0)]
    cost, slope = prior(found, np.array([z, z]))
    off = (z - 0.5) / 2.0
    # minus twice the logarithm of Cauchy's density over that at its middle, and of Gauss'; rounding, for the floor
    # of a square beside the middle is 1e-12
    np.testing.assert_allclose(cost**2, [2.0 * np.log(1.0 + off**2), z**2], rtol=1e-9, atol=1e-9)
    ahead, back = (prior(found, np.array([z, z]) + h)[0] for h in (1e-6, -1e-6))
    # differences of a step h are wrong by some h² of a third derivative near one, and by rounding over h
    np.testing.assert_allclose(slope, (ahead - back) / 2e-6, rtol=1e-5)
