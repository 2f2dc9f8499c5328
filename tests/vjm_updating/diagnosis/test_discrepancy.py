"""Laws that are right to some per cent only, integrated out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, truncnorm

from vjm_updating.diagnosis.discrepancy import NODES, WEIGHTS, Softened, costs, integrated, response
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.parameters import coordinates
from vjm_updating.inference.ramp_readings import observe_ramps
from vjm_updating.observation.significance import LAW_ERROR

ROWS = 12
END = 1.6
"""Relative errors over their scale at which the prior ends."""


def drawn(seed: int, number: int = 3):
    """Orthonormal directions ``(n, k)``, sizes and a residual."""
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.standard_normal((ROWS, number)))[0]
    return U, np.array([60.0, 20.0, 0.0])[:number], 3.0 * rng.standard_normal(ROWS)


def test_the_rule_integrates_the_prior():
    # a half-normal one that ends where the last node's cell does
    prior = truncnorm(0.0, END)
    assert WEIGHTS.sum() == pytest.approx(1.0, rel=1e-12)
    # eight cells of a smooth density: a per cent of evidence is a hundredth of what counts
    assert float(WEIGHTS @ NODES**2) == pytest.approx(prior.moment(2), rel=0.01)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_discrepancy_is_a_covariance(seed):
    U, sizes, r = drawn(seed)
    for node, found in zip(NODES, costs(sizes, U.T @ r, LAW_ERROR), strict=True):
        own = np.eye(ROWS) + (LAW_ERROR * node) ** 2 * (U * sizes**2) @ U.T
        dense = -2.0 * (multivariate_normal(cov=own).logpdf(r) - multivariate_normal(cov=np.eye(ROWS)).logpdf(r))
        # round-off of determinants
        assert found == pytest.approx(dense, rel=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_its_size_is_integrated_out(seed):
    U, sizes, r = drawn(seed)
    along = U.T @ r

    def density(relative):
        variance = (relative * sizes) ** 2
        cost = np.sum(np.log1p(variance) - along**2 * variance / (1.0 + variance))
        return truncnorm(0.0, END, scale=LAW_ERROR).pdf(relative) * np.exp(-0.5 * cost)

    exact = -2.0 * np.log(quad(density, 0.0, END * LAW_ERROR)[0])
    # a twentieth of a unit of the criterion moves no verdict
    assert integrated(sizes, along, LAW_ERROR) == pytest.approx(exact, abs=0.1)


def test_without_a_response_nothing_is_gained_or_lost():
    assert integrated(np.zeros(2), np.array([3.0, -5.0]), LAW_ERROR) == pytest.approx(0.0, abs=0.05)


def test_what_a_discrepancy_may_do_is_noise_of_unit_size():
    U, sizes, _ = drawn(4)
    left = 1.0 / np.sqrt(1.0 + sizes**2)
    space = Softened(np.zeros((ROWS, 0)), np.zeros(ROWS), ROWS, {}, U, left)
    root = np.linalg.cholesky(np.eye(ROWS) + (U * sizes**2) @ U.T)
    white = space.rest(root)
    # round-off times the condition, 60
    np.testing.assert_allclose(white @ white.T, np.eye(ROWS), atol=1e-11)


def test_a_law_is_wrong_in_what_goes_beyond_the_tolerances_only(make, tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        files = make.made_up(tmp_path, {}, 5, patch)
    prepared = prepare(observe_ramps(read_measurement(files.data, files.sheet)), only=("link_compliance",))
    fitter, null, (effect,) = prepared.fitter, prepared.null, prepared.effects
    at = next(i for i, c in enumerate(fitter.nuisances) if c.kind == "modulus" and c.subject == effect.beam)
    z = null.at.z.copy()
    z[at] = 2.0
    found = tuple(coordinates(fitter.nuisances, (effect,)))
    fit = replace(null, hypothesis=(effect,), found=found, at=fitter.evaluate(found, z, (effect,)))
    z[at] = 0.0
    raw = fitter.evaluate(fitter.nuisances, z, ()).residual - fit.at.residual
    size, left = (float(np.linalg.norm(fitter.whitening.flat(r))) for r in (raw, response(fitter, fit)))
    # two sigmas of the sheet make up for two sigmas of it: strength is at most size over sigma
    assert left < 2.0
    # and it shows
    assert size > 5.0 * left
