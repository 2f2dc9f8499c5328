"""The noise of postures against dense matrices, and its share and reach on drawn residuals."""

import numpy as np
import pytest

from vjm_updating.poses.fit import METRE, blocks_of, noise_of, places, solve

G = 150


def correlation(q, reach):
    return np.exp(-0.5 * ((q[:, None] - q) ** 2).sum(axis=2) / reach**2)


def blocks(y, columns, missing=None):
    """Readings ``y`` (G, 3) of one marker by ``columns`` (G, 3, P), the first a nuisance."""
    residual, J = np.full((G, 1, 6), np.nan), np.zeros((G, 1, 6, columns.shape[2]))
    residual[:, 0, :3], J[:, 0, :3] = y, columns
    if missing is not None:
        residual[missing] = np.nan
    fold, family = np.arange(G) % 5, np.array([-1, *[0] * (columns.shape[2] - 1)])
    free = np.full(len(family), -np.inf)
    return blocks_of(
        residual, J, np.ones_like(residual), (fold, fold), 1, np.array([100.0]), family, free, {}, -free
    )


def drawn(share, reach, seed):
    """Postures of two joints in a square of 3 rad, and readings of unit noise of which a share is correlated."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.5, 1.5, (G, 2))
    C = (1.0 - share) * np.eye(G) + share * correlation(q, reach)
    return q, np.linalg.cholesky(C + 1e-9 * np.eye(G)) @ rng.normal(size=(G, 3))


def test_the_fit_is_that_of_the_dense_covariance():
    rng = np.random.default_rng(1)
    q, noise = drawn(0.6, 0.4, 2)
    columns = rng.normal(size=(G, 3, 4))
    missing = (np.array([3, 70]), 0, np.array([0, 2]))  # of two channels one reading each
    made = blocks(columns @ [1.0, 0.5, -0.5, 0.2] + noise, columns, missing)
    found = noise_of(made, solve(made, [0]), q)
    whitened = found.whitened(made)
    N, b, c = np.zeros((4, 4)), np.zeros(4), 0.0
    for channel in np.unique(made.channel):
        own = made.channel == channel
        x = q[made.posture[own]]
        C = (1.0 - found.share) * np.eye(len(x)) + found.share * correlation(x, found.reach)
        A, y = made.J[own], made.y[own]
        N, b, c = N + A.T @ np.linalg.solve(C, A), b + A.T @ np.linalg.solve(C, y), c + y @ np.linalg.solve(C, y)
    # a part in 1e10 of the variance is added against rounding
    assert whitened.N == pytest.approx(N, rel=1e-6)
    assert whitened.b == pytest.approx(b, rel=1e-6, abs=1e-6)
    assert whitened.c == pytest.approx(c, rel=1e-6)


def test_share_and_reach_are_found_and_white_noise_has_none():
    columns = np.ones((G, 3, 1))
    shares, reaches, white = [], [], 0
    for seed in range(20):
        q, y = drawn(0.6, 0.4, seed)
        made = blocks(y, columns)
        found = noise_of(made, solve(made, []), q)
        shares.append(found.share)
        reaches.append(found.reach)
        plain = blocks(np.random.default_rng(100 + seed).normal(size=(G, 3)), columns)
        white += noise_of(plain, solve(plain, []), q).share == 0.0
    # 450 readings tell a share to 0.08 or so; the reaches that are tried are a factor of two apart
    assert np.mean(shares) == pytest.approx(0.6, abs=0.06)
    assert np.median(reaches) == 0.4
    assert white >= 18


def test_a_metre_of_a_sliding_joint_counts_as_a_radian():
    q = np.array([[0.5, 250.0]])
    assert places(q, np.array([True, False])) == pytest.approx(np.array([[0.5, 250.0 / METRE]]))
