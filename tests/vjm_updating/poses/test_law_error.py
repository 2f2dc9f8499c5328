"""Laws that are right to some per cent only, in the evidence of a robot's families."""

import numpy as np
import pytest
from helpers.from_files import diagnose_poses
from helpers.weighed_arm import drawn, files
from hidden_effects.poses.injector import Hidden, measure
from hidden_effects.poses.plan import NOISE
from hidden_effects.poses.robots import UR10
from scipy.stats import multivariate_normal

from vjm_updating.inference.model_error import NODES, WEIGHTS
from vjm_updating.inference.significance import LAW_ERROR
from vjm_updating.poses.families import VALUE, FamilyParameter
from vjm_updating.poses.fit import PostureNoise, blocks_of, solve
from vjm_updating.poses.study import law_evidence

G = 40


def test_the_evidence_is_that_of_the_marginal_likelihood():
    """Of two members with one law, whose error is a factor that follows two shapes; a third has an exact one."""
    rng = np.random.default_rng(4)
    columns, shapes = rng.normal(size=(G, 3, 4)), rng.normal(size=(G, 2))
    y = columns @ [3.0, 5.0, -4.0, 0.5] * (1.0 + 0.1 * shapes[:, :1]) + rng.normal(size=(G, 3))
    residual, J = np.full((G, 1, 6), np.nan), np.zeros((G, 1, 6, 4))
    residual[:, 0, :3], J[:, 0, :3] = y, columns
    family, free, fold = np.array([-1, 0, 0, 1]), np.full(4, -np.inf), np.arange(G) % 5
    made = blocks_of(
        residual, J, np.ones_like(residual), (fold, fold), 1, np.array([100.0]), family, free, {}, -free
    )
    found = solve(made, [0, 1])
    members = [
        FamilyParameter(name=name, kind=VALUE, scale=1.0, family=of, index=0, unit="rad")
        for name, of in (("a", "one"), ("b", "one"), ("c", "two"))
    ]
    got = law_evidence(made, [shapes, shapes, None], members, found, PostureNoise(), made)
    A, rows = columns.reshape(-1, 4), np.repeat(shapes, 3, axis=0)
    D = (A[:, 1:3] @ found.z[1:3])[:, None] * rows
    plain = A @ np.diag([1e4, *[found.sizes[f] ** 2 for f in (0, 0, 1)]]) @ A.T + found.noise**2 * np.eye(3 * G)

    def log_density(error):
        C = plain + error**2 * D @ D.T
        return multivariate_normal(np.zeros(3 * G), C).logpdf(y.reshape(-1))

    change = np.array([log_density(LAW_ERROR * node) - log_density(0.0) for node in NODES])
    # rounding of determinants of 120 numbers
    assert got == pytest.approx(np.log(np.sum(WEIGHTS * np.exp(change))), abs=1e-6)
    assert got > 2.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_third_wave_of_gears_is_no_error_of_encoders(seed, tmp_path):
    """The family has a turn's first two waves; a third of a fifth of their size is what laws are wrong by."""
    q = drawn(seed, 120, 2.9)
    hidden = Hidden.nothing(6)
    hidden.wave[[0, 2, 4], :2] = 4e-4 * np.random.default_rng(seed).choice([-1.0, 1.0], (3, 2))
    off = np.zeros_like(q)
    off[:, [0, 2, 4]] = 1.2e-4 * np.sin(3.0 * q[:, [0, 2, 4]] + 0.7)
    y = measure(UR10, hidden, q + off, NOISE, np.random.default_rng(seed))
    found = diagnose_poses(*files(tmp_path, q, y), tmp_path / "out")
    assert [row.cause for row in found.findings.causes if row.probability >= 0.95] == ["gear_error"]
