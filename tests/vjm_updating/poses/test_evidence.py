"""The linear fit of poses against closed forms: evidence, bounds, marginal intervals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from vjm_updating.poses.fit import PostureNoise, blocks_of, solve
from vjm_updating.poses.held_out import as_good, saved, surely_saved
from vjm_updating.poses.identifiability import marginals
from vjm_updating.poses.state import Errors
from vjm_updating.poses.study import outlying

G = 60


def blocks(J, y, family, lower=-np.inf, upper=np.inf):
    """Readings ``y`` (G, 3) of one marker by columns J ``(G, 3, P)``; the first is a nuisance."""
    residual = np.full((G, 1, 6), np.nan)
    residual[:, 0, :3] = y
    columns = np.zeros((G, 1, 6, J.shape[2]))
    columns[:, 0, :3] = J
    family = np.array(family)
    bounds = [np.where(family < 0, sign * np.inf, value) for sign, value in ((-1.0, lower), (1.0, upper))]
    fold = np.arange(G) % 5
    return blocks_of(
        residual,
        columns,
        np.ones_like(residual),
        (fold, fold),
        1,
        np.array([100.0]),
        family,
        bounds[0],
        {},
        bounds[1],
    )


@pytest.fixture(scope="module")
def columns():
    return np.random.default_rng(1).normal(size=(G, 3, 7))


def test_the_evidence_is_that_of_the_marginal_likelihood(columns):
    rng = np.random.default_rng(2)
    y = columns @ [3.0, 0.5, -0.4, 0.6, 0.0, 0.0, 0.0] + rng.normal(size=(G, 3))
    made = blocks(columns, y, [-1, 0, 0, 0, 1, 1, 1])
    found = [solve(made, families) for families in ([0], [0, 1])]
    for one, families in zip(found, ([0], [0, 1]), strict=True):
        variance = [1e4, *[one.sizes[f] ** 2 if f in families else 0.0 for f in (0, 0, 0, 1, 1, 1)]]
        J = columns.reshape(-1, 7)
        C = J @ np.diag(variance) @ J.T + one.noise**2 * np.eye(len(J))
        exact = multivariate_normal(np.zeros(len(J)), C).logpdf(y.reshape(-1))
        # rounding of determinants of 180 numbers; the constant is that of the normal distribution
        assert one.log_evidence - 0.5 * len(J) * np.log(2.0 * np.pi) == pytest.approx(exact, abs=1e-6)


def test_nuisances_that_are_not_distinguishable_are_fitted_to_readings_without_noise(columns):
    """As the height of the base and of the marker where all axes are upright."""
    J = 100.0 * columns[..., [0, 0, 1]]
    made = replace(blocks(J, J @ [3.0, 0.0, 0.5], [-1, -1, 0]), nuisances=2, prior=np.array([100.0, 100.0]))
    found = solve(made, [0])
    # to the prior's pull on readings of a noise of some 1e-7
    assert [found.z[0] + found.z[1], found.z[2]] == pytest.approx([3.0, 0.5], abs=1e-6)


@pytest.mark.parametrize("least", [0.0, 1.0])
def test_readings_scatter_no_less_than_the_sheet_says(columns, least):
    y = 0.1 * np.random.default_rng(3).normal(size=(G, 3))
    found = solve(replace(blocks(columns, y, [-1, 0, 0, 0, 1, 1, 1]), least=least), [])
    # a tenth to its chance of 180 readings, or what the sheet says
    assert found.noise == pytest.approx(1.0 if least else 0.1, rel=0.15 if not least else 1e-12)


@pytest.mark.parametrize("size", [0.3, 3.0])
def test_over_all_sizes_the_evidence_is_its_integral(size):
    rng = np.random.default_rng(7)
    J = rng.normal(size=(G, 3, 13))
    y = J @ [3.0, *size * rng.normal(size=12)] + rng.normal(size=(G, 3))
    made = blocks(J, y, [-1, *[0] * 12])
    found = solve(made, [0])
    rows = J.reshape(-1, 13)

    def logpdf(s):
        C = rows @ np.diag([1e4, *[s**2] * 12]) @ rows.T + found.noise**2 * np.eye(len(rows))
        return multivariate_normal(np.zeros(len(rows)), C).logpdf(y.reshape(-1))

    peak = logpdf(found.sizes[0])
    s = np.geomspace(found.sizes[0] / 20.0, found.sizes[0] * 20.0, 400)
    density = np.exp([logpdf(one) - peak for one in s]) * 2.0 / (np.pi * (1.0 + s**2))
    exact = float(np.log(np.trapezoid(density, s)))
    # to second order in the logarithm of the size, of a dozen members
    assert found.evidence - found.log_evidence == pytest.approx(exact, abs=0.15)


@pytest.mark.parametrize("start", [1e-4, 1.0, 1e3])
def test_a_family_without_effect_earns_no_evidence(columns, start):
    y = 3.0 * columns[..., 0] + np.random.default_rng(3).normal(size=(G, 3))
    made = blocks(columns, y, [-1, 0, 0, 0, 0, 0, 0])
    # whatever the size that the search begins with: noise alone earns half of a unit now and then
    assert solve(made, [0], {0: start}).log_evidence - solve(made, []).log_evidence < 1.0


@pytest.mark.parametrize("truth", [-0.3, 0.0, 0.2])
def test_the_evidence_of_one_bounded_member_is_its_integral(columns, truth):
    J = columns[..., :2]
    y = J @ [3.0, truth] + np.random.default_rng(4).normal(size=(G, 3))
    made = blocks(J, y, [-1, 0], lower=0.0)
    found, without = solve(made, [0]), solve(made, [])
    # the same noise in both, so that only the member's integral differs
    N, b, noise2 = made.N / found.noise**2, made.b / found.noise**2, found.noise**2
    A0 = N[0, 0] + 1e-4
    h, g = N[1, 1] - N[0, 1] ** 2 / A0, b[1] - N[0, 1] * b[0] / A0
    s = found.sizes[0]
    integral = quad(
        lambda z: 2.0 * norm.pdf(z, scale=s) * np.exp(g * z - 0.5 * h * z * z), 0.0, 12.0 * s, limit=400,
        points=[min(s, 0.5)],
    )[0]  # fmt: skip
    base = -0.5 * (made.count * np.log(noise2) + made.c / noise2 - b[0] ** 2 / A0 + np.log(A0 / 1e-4))
    # a member at its bound is integrated with the nuisance held: what they share of their columns, some per cent
    assert found.log_evidence == pytest.approx(base + np.log(integral), abs=0.05)
    assert found.log_evidence > without.log_evidence - 1.0


def test_an_interval_at_a_bound_is_not_that_of_the_other_members_best_values(columns):
    # two columns that are nearly one, whose sum the readings give
    J = columns[..., :3].copy()
    J[..., 2] = J[..., 1] + 0.05 * columns[..., 3]
    y = J @ [0.0, 3.0, -2.0] + 0.5 * np.random.default_rng(5).normal(size=(G, 3))
    made = blocks(J, y, [-1, 0, 0], lower=0.0)
    found = solve(made, [0])
    held = [int(u) for u in found.at_bound]
    assert len(held) == 1
    place = int(np.flatnonzero(found.active == held[0])[0])
    got = marginals(made, found, PostureNoise())
    # by integration on a grid, the nuisance profiled out
    s2, noise2 = found.sizes[0] ** 2, found.noise**2
    A = made.N / noise2 + np.diag([1e-4, 1.0 / s2, 1.0 / s2])
    b = made.b / noise2
    S = A[1:, 1:] - np.outer(A[1:, 0], A[0, 1:]) / A[0, 0]
    r = b[1:] - A[1:, 0] * b[0] / A[0, 0]
    t = np.linspace(0.0, 4.0, 1601)
    u, v = np.meshgrid(t, t, indexing="ij")
    log_p = u * r[0] + v * r[1] - 0.5 * (S[0, 0] * u * u + 2.0 * S[0, 1] * u * v + S[1, 1] * v * v)
    p = np.exp(log_p - log_p.max()).sum(axis=1 - (held[0] - 1))
    upper = float(np.interp(0.95, np.cumsum(p) / p.sum(), t))
    assert got.high[place] == pytest.approx(upper, rel=0.05)
    conditional = 1.0 / np.sqrt(A[held[0], held[0]])
    # given the other's best value it would be held to its column's own noise
    assert got.high[place] > 3.0 * conditional


def test_no_best_value_is_outside_of_its_interval_or_at_its_end_without_words(columns):
    beyond = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        J = columns.copy()
        J[..., 2:] = J[..., 1:2] + 0.05 * J[..., 2:]  # members that are nearly one
        y = J @ [1.0, *rng.normal(0.3, 1.0, 6)] + rng.normal(size=(G, 3))
        made = blocks(J, y, [-1, 0, 0, 0, 0, 0, 0], lower=0.0, upper=1.5)
        found = solve(made, [0])
        got, z = marginals(made, found, PostureNoise()), found.z[found.active]
        assert ((got.low <= z) & (z <= got.high)).all()
        assert (((got.low < z) & (z < got.high)) | (got.side != 0)).all()
        # at most: the value is its own end, or the lower bound is not excluded and is the interval's other end
        at_most, at_least = np.flatnonzero(got.side > 0), np.flatnonzero(got.side < 0)
        assert all(z[i] == got.high[i] or got.low[i] == 0.0 for i in at_most)
        assert all(z[i] == got.low[i] or got.high[i] == 1.5 for i in at_least)
        beyond += int(np.sum((got.side != 0) & (z > 0.0) & (z < 1.5)))
    # where others stand at their bounds, the best of all is beyond nearly all that the posterior has of one
    assert beyond > 0


def test_bounds_hold_from_both_sides(columns):
    y = columns @ [0.0, 5.0, -5.0, 0.0, 0.0, 0.0, 0.0] + np.random.default_rng(6).normal(size=(G, 3))
    made = blocks(columns, y, [-1, 0, 0, 0, 0, 0, 0], lower=-1.0, upper=2.0)
    found = solve(made, [0])
    assert found.z[1:3] == pytest.approx([2.0, -1.0], abs=1e-12)
    assert set(found.at_bound) >= {1, 2}
    pull = marginals(made, found, PostureNoise()).pull
    assert min(pull[1:3]) > 5.0


# How sure a saving is, and which readings are outliers.


SIGMA = np.ones((200, 1, 6))


def errors(mean, seed=0):
    """Distances of 200 postures with a scatter of 0.1: their mean has a standard error of 0.007."""
    drawn = mean + 0.1 * np.random.default_rng(seed).standard_normal((3, 200, 1))
    return Errors(*drawn)


def test_a_saving_is_as_sure_as_its_standard_error_says():
    rng = np.random.default_rng(3)
    before = np.abs(rng.standard_normal((400, 1))) + 2.0
    # differences of mean 0.1 and standard deviation 0.5: a standard error of 0.025
    after, sigma = before - 0.1 - 0.5 * rng.standard_normal(before.shape), np.ones((400, 1, 6))
    assert surely_saved(before, after, sigma) == pytest.approx(4.0, abs=1.5)  # the mean's own error is one and more
    assert saved(before, after) == pytest.approx(0.1 / before.mean(), abs=3.0 * 0.025 / before.mean())
    assert (saved(before, before), surely_saved(before, before, sigma)) == (0.0, 0.0)
    assert surely_saved(before, before - 0.5, sigma) > 1e6  # the same in each posture
    assert as_good(errors(1.0), errors(1.0, 1), SIGMA)
    assert not as_good(errors(1.1), errors(1.0, 1), SIGMA)
    assert as_good(errors(1.0), errors(1.1, 1), SIGMA)


def test_of_a_heavy_tail_none_is_outlying_and_what_is_far_beyond_is():
    rng = np.random.default_rng(11)
    alarms = 0
    for _ in range(500):
        # three errors of Student's distribution with four degrees of freedom
        scale = np.sqrt(rng.chisquare(4.0, (150, 1, 1)) / 4.0)
        misfit = np.linalg.norm(rng.standard_normal((150, 1, 3)) / scale, axis=2)
        alarms += bool(outlying(misfit).any())
    assert alarms <= 8  # two of 500 by the rate of false alarms; eight and more once in a thousand times
    misfit[7] = 50.0 * np.median(misfit)
    misfit[9] = np.nan
    assert outlying(misfit)[7]
    assert not outlying(misfit)[9]
