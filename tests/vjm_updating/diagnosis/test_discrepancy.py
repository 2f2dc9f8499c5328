"""Laws that are right to some per cent only, integrated out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from vjm_updating.diagnosis.discrepancy import Marginalised, discrepancy, marginalised, responses
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.screening import Projection, projection
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.model_error import NODES, WEIGHTS, costs, driven_place, integrated, likeliest, principal
from vjm_updating.inference.parameters import coordinates, release_key
from vjm_updating.inference.significance import LAW_ERROR

ROWS = 12


def drawn(seed: int, number: int = 3):
    """Orthonormal directions ``(n, k)``, sizes and a residual."""
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.standard_normal((ROWS, number)))[0]
    return U, np.array([60.0, 20.0, 0.0])[:number], 3.0 * rng.standard_normal(ROWS)


def test_the_rule_integrates_the_prior():
    """Of a half-Cauchy distribution one half lies within its scale, and nine tenths within 6.3."""
    ends = np.arctan(NODES[-1])
    for middle in (1.0, 6.31):
        # half a cell is the error of a sum
        assert WEIGHTS[middle >= NODES].sum() == pytest.approx(np.arctan(middle) / ends, abs=0.5 * WEIGHTS.max())
    assert WEIGHTS.sum() == pytest.approx(1.0, rel=1e-12)


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
        return np.exp(-0.5 * cost) / (1.0 + (relative / LAW_ERROR) ** 2)

    end = LAW_ERROR * NODES[-1]
    mass = LAW_ERROR * np.arctan(NODES[-1])
    exact = -2.0 * np.log(quad(density, 0.0, end, points=[LAW_ERROR, 0.1 * end], limit=200)[0] / mass)
    # a tenth of a unit of the criterion moves no verdict
    assert integrated(sizes, along, LAW_ERROR) == pytest.approx(exact, abs=0.1)


def test_a_law_that_is_far_off_is_told_from_one_that_is_nearly_right():
    """Residuals along 40 directions by a third of what the law does, and by a hundredth."""
    sizes = np.full(40, 200.0)
    for error in (0.3, 0.01):
        along = error * sizes * np.random.default_rng(3).standard_normal(40)
        # a size from 40 draws is known to 11 %, and the nodes lie 31 % apart
        assert likeliest(sizes, along, LAW_ERROR) == pytest.approx(error, rel=0.35)


def test_without_a_response_nothing_is_gained_or_lost():
    assert integrated(np.zeros(2), np.array([3.0, -5.0]), LAW_ERROR) == pytest.approx(0.0, abs=1e-12)


def test_what_a_discrepancy_may_do_is_noise_of_unit_size():
    U, sizes, _ = drawn(4)
    space = Marginalised.of(Projection(np.zeros((ROWS, 0)), np.zeros(ROWS), ROWS, {}), U, 4.0 * sizes, 0.25)
    root = np.linalg.cholesky(np.eye(ROWS) + (U * sizes**2) @ U.T)
    white = space.rest(root)
    # round-off times the condition, 60
    np.testing.assert_allclose(white @ white.T, np.eye(ROWS), atol=1e-11)


def test_nuisances_beside_a_discrepancy_are_those_of_a_fit_with_its_covariance():
    """Generalised least squares of three nuisances, each known to one, where a law may do two things besides."""
    rng = np.random.default_rng(5)
    A, D, r = rng.standard_normal((ROWS, 3)), 4.0 * rng.standard_normal((ROWS, 2)), 3.0 * rng.standard_normal(ROWS)
    basis = np.linalg.qr(np.vstack([A, np.eye(3)]))[0]
    readings = np.concatenate([r, np.zeros(3)])
    space = Projection(basis, readings - basis @ (basis.T @ readings), ROWS, {})
    columns = space.rest(np.vstack([D, np.zeros((3, 2))]))
    turn, sizes = principal(columns.T @ columns)
    beside = Marginalised.of(space, columns @ turn / sizes, sizes, 1.0)
    weight = np.linalg.inv(np.eye(ROWS) + D @ D.T)
    z = np.linalg.solve(A.T @ weight @ A + np.eye(3), A.T @ weight @ r)
    # round-off times the condition
    np.testing.assert_allclose(beside.off_sheet, -z, atol=1e-12)
    assert np.abs(space.off_sheet + z).max() > 0.1


@pytest.fixture(scope="module")
def fitted(tmp_path_factory, make):
    """The fit of a cause that frees a nuisance, at so many sigmas of it, in a quiet test."""
    with pytest.MonkeyPatch.context() as patch:
        files = make.made_up(tmp_path_factory.mktemp("quiet"), {}, 5, patch)
    observed = observe_ramps(read_measurement(files.data, files.sheet))

    def at(cause, sigmas=2.0):
        prepared = prepare(observed, only=(cause,))
        fitter, null, effect = prepared.fitter, prepared.null, prepared.effects[0]
        found = tuple(coordinates(fitter.nuisances, (effect,)))
        z = null.at.z.copy()
        z[[(c.kind, c.subject) == release_key(effect) for c in found]] = sigmas
        fit = replace(null, hypothesis=(effect,), found=found, at=fitter.evaluate(found, z, (effect,)))
        return fitter, replace(fit, jacobian=fitter.slopes(found, fit.at, (effect,)))

    return at


def test_a_response_is_what_the_readings_lose_and_no_larger_than_what_is_explained(fitted):
    fitter, fit = fitted("link_compliance")
    z = np.where([(c.kind, c.subject) == release_key(fit.hypothesis[0]) for c in fit.found], 0.0, fit.at.z)
    raw = fitter.evaluate(fitter.nuisances, z, ()).residual - fit.at.residual
    size = float(np.linalg.norm(fitter.whitening.flat(raw)))
    assert size > 10.0
    np.testing.assert_array_equal(responses(fitter, fit, 2.0 * size**2)[..., 0], raw)
    # rounding of a root
    np.testing.assert_allclose(responses(fitter, fit, 25.0)[..., 0], raw * (5.0 / size), rtol=1e-12)


@pytest.mark.parametrize("cause", ["link_length", "instrument_zero", "instrument_scale"])
def test_geometry_and_scales_have_no_error_of_their_own(fitted, cause):
    fitter, fit = fitted(cause)
    assert fit.hypothesis[0].exact
    assert responses(fitter, fit, 1e6).shape[2] == 0
    assert discrepancy(fitter, fit, LAW_ERROR, 1e6) == 0.0


def test_readings_of_a_law_that_is_off_leave_little(fitted):
    """What a law is wrong by that is half off at the ends of the ramp is noise beside the discrepancy."""
    fitter, fit = fitted("link_compliance", 20.0)
    made = responses(fitter, fit, 1e6)[..., 0]
    off = 0.5 * made * driven_place(fitter.forward.observed)[:, None] ** 4
    wrong = replace(fit, at=replace(fit.at, residual=fit.at.residual + off))
    noise, plain = (
        float(projection(fitter, one).residual @ projection(fitter, one).residual) for one in (fit, wrong)
    )
    beside = marginalised(fitter, wrong, LAW_ERROR, 1e6).residual
    assert plain - noise > 400.0
    assert float(beside @ beside) - noise < 0.1 * (plain - noise)
    assert discrepancy(fitter, wrong, LAW_ERROR, 1e6) < -0.8 * (plain - noise)
