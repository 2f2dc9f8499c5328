"""Laws that are right to some per cent only, integrated out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import nnls
from scipy.stats import chi2, multivariate_normal

from vjm_updating.diagnosis.discrepancy import (
    Marginalised,
    discrepancy,
    law_columns,
    law_covariance,
    marginalised,
    responses,
    spectrum,
)
from vjm_updating.diagnosis.evidence import Cone
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.screening import Projection, projection
from vjm_updating.diagnosis.verdict import SIZES, kind_present, unmodelled
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.fitting import prior
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.model_error import (
    NODES,
    WEIGHTS,
    costs,
    driven_place,
    integrated,
    likeliest,
    mean_square,
    principal,
)
from vjm_updating.inference.parameters import FitParameter, coordinates, release_key
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
        z = null.evaluation.z.copy()
        z[[(c.kind, c.subject) == release_key(effect) for c in found]] = sigmas
        fit = replace(null, hypothesis=(effect,), parameters=found, evaluation=fitter.evaluate(found, z, (effect,)))
        return fitter, replace(fit, jacobian=fitter.slopes(found, fit.evaluation, (effect,)))

    return at


def test_a_response_is_what_the_readings_lose_and_no_larger_than_what_is_explained(fitted):
    fitter, fit = fitted("link_compliance")
    z = np.where(
        [(c.kind, c.subject) == release_key(fit.hypothesis[0]) for c in fit.parameters], 0.0, fit.evaluation.z
    )
    raw = fitter.evaluate(fitter.nuisances, z, ()).residual - fit.evaluation.residual
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


def test_a_fit_follows_what_laws_do_wrong(fitted):
    """Its coordinates scatter as those of least squares on readings that laws have put off."""
    fitter, fit = fitted("link_compliance")
    columns = law_columns(fitter, fit, 1e6)
    free = np.array([c.sigma != 0.0 for c in fit.parameters])
    weights = np.diag(prior(fit.parameters, fit.evaluation.z)[1])
    A = np.vstack([fitter.whitening.flat(fit.jacobian), weights])[:, free]
    # as wrong as the fit's residual lets them be
    space = projection(fitter, fit)
    directions, sizes = spectrum(fitter, fit, space, 1e6)
    wrong = mean_square(sizes, directions.T @ space.residual, LAW_ERROR) ** 0.5
    draws = columns @ np.random.default_rng(2).standard_normal((columns.shape[1], 20_000)) * wrong
    moved = np.linalg.lstsq(A, np.vstack([draws, np.zeros((len(weights), draws.shape[1]))]), rcond=None)[0]
    found = law_covariance(fitter, fit, LAW_ERROR, 1e6)[np.ix_(free, free)]
    # a variance from 20,000 draws is known to 1 %; five times that; round-off where they do nothing
    np.testing.assert_allclose(np.diag(found), moved.var(axis=1), rtol=0.05, atol=1e-20)
    assert not law_covariance(fitter, fit, 0.0, 1e6).any()


def test_readings_of_a_law_that_is_off_leave_little(fitted):
    """What a law is wrong by that is half off at the ends of the ramp is noise beside the discrepancy."""
    fitter, fit = fitted("link_compliance", 20.0)
    made = responses(fitter, fit, 1e6)[..., 0]
    off = 0.5 * made * driven_place(fitter.forward.observed)[:, None] ** 4
    wrong = replace(fit, evaluation=replace(fit.evaluation, residual=fit.evaluation.residual + off))
    noise, plain = (
        float(projection(fitter, one).residual @ projection(fitter, one).residual) for one in (fit, wrong)
    )
    beside = marginalised(fitter, wrong, LAW_ERROR, 1e6).residual
    assert plain - noise > 400.0
    assert float(beside @ beside) - noise < 0.1 * (plain - noise)
    assert discrepancy(fitter, wrong, LAW_ERROR, 1e6) < -0.8 * (plain - noise)


# A cause that no catalogue has is a hypothesis like any other, whose evidence is known in closed form.


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
        residual = null.evaluation.residual.copy()
        residual[:, 0] += np.where(fitter.whitening.present[:, 0], force * np.sin(20.0 * place), 0.0)
        return unmodelled(fitter, replace(null, evaluation=replace(null.evaluation, residual=residual)))

    # noise speaks against them, a wave of four standard deviations for them, and ten times as large more so
    assert change(0.0) > 0.0 > change(8.0) > change(80.0)
    # nor need there be a shape: noise three times as large as the sheet says
    assert change(2.0 * 3.0 * np.random.default_rng(1).standard_normal(len(place)) / np.sin(20.0 * place)) < 0.0


@pytest.mark.parametrize("z", [-30.0, -2.0, -0.1, 0.0, 0.3, 5.0])
def test_a_shape_far_off_is_rare_and_a_tolerance_far_off_impossible(z):
    found = [FitParameter("a", "effect", "0", 1.0, 0.5, 2.0), FitParameter("b", "zero", "fx_N", 1.0)]
    cost, slope = prior(found, np.array([z, z]))
    off = (z - 0.5) / 2.0
    # minus twice the logarithm of Cauchy's density over that at its middle, and of Gauss'; rounding, for the floor
    # of a square beside the middle is 1e-12
    np.testing.assert_allclose(cost**2, [2.0 * np.log(1.0 + off**2), z**2], rtol=1e-9, atol=1e-9)
    ahead, back = (prior(found, np.array([z, z]) + h)[0] for h in (1e-6, -1e-6))
    # differences of a step h are wrong by some h² of a third derivative near one, and by rounding over h
    np.testing.assert_allclose(slope, (ahead - back) / 2e-6, rtol=1e-5)


# What mixtures of trials explain: the projection by another algorithm, and its chances in noise of one's own.


def trials(d, k, *, narrow=1.0, seed=0):
    rng = np.random.default_rng(seed)
    return np.eye(d)[:, :1] + narrow * rng.standard_normal((d, k))


@pytest.mark.parametrize(("d", "k"), [(1, 1), (2, 2), (2, 4), (3, 3), (3, 5), (4, 4)])
def test_projection_is_that_of_non_negative_least_squares(d, k):
    edges = trials(d, k)
    cone = Cone.of(edges, one_sided=True, vector=False)
    z = np.random.default_rng(1).standard_normal((d, 200))
    wanted = [float(residual @ residual) - nnls(edges, residual)[1] ** 2 for residual in z.T]
    # rounding: 1e-16 of squares up to 30, times the conditions of these faces, 3e3 at most
    np.testing.assert_allclose(cone.explained(z), wanted, rtol=0.0, atol=1e-10)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("one_sided", [True, False])
@pytest.mark.parametrize(("d", "k", "narrow"), [(1, 1, 1.0), (2, 2, 0.2), (3, 4, 0.4), (4, 4, 0.7)])
def test_chances_are_those_of_noise(d, k, narrow, one_sided):
    cone = Cone.of(trials(d, k, narrow=narrow), one_sided=one_sided, vector=False)
    draws = 200_000
    p = cone.p_value(cone.explained(np.random.default_rng(2).standard_normal((d, draws))))
    for rate in (0.05, 0.003):
        # three standard errors of these draws; and of the weights' 4000, which know what one trial alone explains
        # to 5 %, and the rarer others to 12 % and more of a smaller part
        error = 3.0 / np.sqrt(rate * draws) + 0.07
        assert np.mean(p < rate) == pytest.approx(rate, rel=error)


def test_one_way_is_half_as_likely_as_both():
    one, both = (Cone.of(np.array([[2.0]]), one_sided=own, vector=False) for own in (True, False))
    assert one.p_value(np.array([16.0]))[0] == pytest.approx(0.5 * chi2.sf(16.0, 1))
    assert both.p_value(np.array([16.0]))[0] == pytest.approx(chi2.sf(16.0, 1))
    assert one.explained(np.array([[-4.0]]))[0] == 0.0
    assert both.explained(np.array([[-4.0]]))[0] == pytest.approx(16.0)


def test_a_narrow_cone_is_hardly_more_than_one_direction():
    cone = Cone.of(trials(3, 4, narrow=0.01), one_sided=False, vector=False)
    # of a width of 0.03 it adds twice that share of a circle in two directions, 0.06 / 2π exp(-8) of 6.3e-5: 5 %;
    # three standard errors of the drawn weight are another 5 %
    assert cone.p_value(np.array([16.0]))[0] == pytest.approx(chi2.sf(16.0, 1), rel=0.1)
    assert chi2.sf(16.0, 3) > 10.0 * chi2.sf(16.0, 1)


def test_of_a_vector_all_directions_count():
    cone = Cone.of(trials(2, 3), one_sided=False, vector=True)
    z = np.random.default_rng(3).standard_normal((2, 50))
    np.testing.assert_allclose(cone.explained(z), np.sum(z**2, axis=0))
    np.testing.assert_allclose(cone.p_value(cone.explained(z)), chi2.sf(np.sum(z**2, axis=0), 2))


def test_a_trial_and_its_opposite_are_one_where_both_signs_make_sense():
    edges = np.array([[1.0, -1.0], [0.1, -0.1]])
    same, single = (Cone.of(own, one_sided=False, vector=False) for own in (edges, edges[:, :1]))
    z = np.random.default_rng(4).standard_normal((2, 50))
    np.testing.assert_allclose(same.explained(z), single.explained(z))
    # the weight of one direction is drawn: 4000 draws know one half to 1.6 %: three times that
    assert same.p_value(np.array([9.0]))[0] == pytest.approx(chi2.sf(9.0, 1), rel=0.05)
