"""Normal distributions that bounds truncate, against another solver, quadrature and scipy's truncated normal."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from helpers import linear_arm
from helpers.file_texts import instruments_text, table_text
from scipy.integrate import quad
from scipy.optimize import lsq_linear
from scipy.stats import norm, truncnorm

from vjm_updating.calibration.fit import problem_of, solve
from vjm_updating.diagnosis.evidence import estimates
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference.bounded_normal import bounded_step, log_beyond, log_share, mode, truncated_draws
from vjm_updating.inference.fitting import LeastSquaresProblem, best_fit, whitening_of
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates


@pytest.mark.parametrize("seed", range(20))
def test_a_step_to_a_bound_ends_at_its_very_value(seed):
    """What a coordinate at its bound costs is another thing than that of one a rounding off."""
    rng = np.random.default_rng(seed)
    z, low, high = rng.normal(size=6), np.full(6, -1.7), np.full(6, 1.9)
    z = np.clip(z, low, high)
    A = np.diag(rng.uniform(0.1, 1e3, size=6))
    far = np.where(np.arange(6) % 2, high + 1.0, low - 1.0)
    none = np.zeros(6, dtype=bool)
    after = bounded_step(A, A @ (far - z), 0.0, none, ~none, z, low, high)
    assert after.tolist() == np.where(np.arange(6) % 2, high, low).tolist()
    # one that no bound holds back goes where the equations lead, one that is fixed stays
    inside = rng.uniform(-1.6, 1.8, size=6)
    after = bounded_step(A, A @ (inside - z), 0.0, np.arange(6) == 0, ~none, z, low, high)
    # hundreds of roundings of values below two: an equation each, without any condition
    np.testing.assert_allclose(after[1:], inside[1:], rtol=0.0, atol=1e-13)
    assert after[0] == z[0]


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("condition", [10.0, 1e6])
def test_the_mode_is_that_of_another_solver(seed, condition):
    """Against scipy's bounded least squares (Stark and Parker), and the conditions of Karush, Kuhn and Tucker."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 40))
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    root = np.geomspace(1.0, condition**-0.5, n)[:, None] * Q.T
    root /= np.linalg.norm(root, axis=0)
    y = 3.0 * rng.normal(size=n)
    low = np.where(rng.random(n) < 0.3, -np.inf, -rng.random(n))
    high = np.where(rng.random(n) < 0.3, np.inf, rng.random(n))
    A, b = root.T @ root, root.T @ y
    z, free = mode(A, b, low, high)
    slope = b - A @ z
    # rounding of a solution of this condition
    tiny = 1e-15 * condition * n * np.abs(z).max() + 1e-9
    assert ((z >= low) & (z <= high)).all()
    assert np.abs(slope[free]).max(initial=0.0) < tiny
    assert (slope[~free & (z == low)] < tiny).all()
    assert (slope[~free & (z == high)] > -tiny).all()
    other = lsq_linear(root, y, (low, high), method="bvls", tol=1e-14, max_iter=1000).x
    # the other solver ends where squares fall by 1e-14: an error of 1e-7 along what is seen best
    assert 0.5 * z @ A @ z - b @ z <= 0.5 * other @ A @ other - b @ other + 1e-9


def test_the_mode_of_a_matrix_that_is_singular_to_rounding_is_within_the_bounds():
    z, free = mode(np.ones((2, 2)), np.array([1.0, 1.0]), np.full(2, -0.1), np.full(2, 0.8))
    # any split of the sum is a best one; a slope off a bound of 1e-9 of the largest is none, and rounding
    assert z.sum() == pytest.approx(1.0, abs=1e-6)
    assert ((z >= -0.1) & (z <= 0.8)).all()
    assert free.any()


@pytest.mark.parametrize("slope", [0.1, 1.0, 5.0, 30.0])
def test_what_lies_beyond_a_bound(slope):
    left = quad(lambda t: np.exp(-slope * t - 0.5 * t * t), 0.0, np.inf)[0] / np.sqrt(2.0 * np.pi)
    # quadrature's own tolerance, 1.5e-8 of the integral, which is 0.01 at least
    assert log_beyond(np.array([slope]))[0] == pytest.approx(np.log(left), abs=1e-5)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 2.0), (20.0, 21.0), (-21.0, -20.0), (-np.inf, 0.3)])
def test_the_share_between_two_ends_keeps_its_digits(low, high):
    there = quad(lambda t: norm.pdf(t) / norm.pdf(max(min(0.0, high), low)), max(low, -30.0), high, epsabs=1e-14)[0]
    expected = np.log(there) + norm.logpdf(max(min(0.0, high), low))
    # quadrature's tolerance
    assert log_share(np.array([low]), np.array([high]))[0] == pytest.approx(expected, abs=1e-7)


def test_marginals_of_a_truncated_pair():
    # x1 with mean -1 above 0 is a truncated normal; x2 follows by its regression, slope 0.9
    C = np.array([[1.0, 0.9], [0.9, 1.0]])
    x = truncated_draws(
        np.array([-1.0, 0.0]), C, np.array([0.0, -np.inf]), np.full(2, np.inf), np.array([0.1, 0.0])
    )
    one = truncnorm(1.0, np.inf, loc=-1.0)
    mean, var = one.mean(), one.var()
    # 8,000 draws: 1.1 % of a standard deviation, times three
    assert x.mean(axis=0) == pytest.approx([mean, 0.9 * (mean + 1.0)], abs=0.04)
    assert x.std(axis=0) == pytest.approx([np.sqrt(var), np.sqrt(0.19 + 0.81 * var)], rel=0.04)
    # a quantile of so rare an event: 0.0017 of probability over a density of 0.074, 1.4 % of it, times three
    assert np.quantile(x[:, 0], 0.975) == pytest.approx(one.ppf(0.975), rel=0.05)


def test_draws_of_coordinates_without_variance_stay_and_none_are_made_without_a_bound_near():
    C = np.diag([1.0, 0.0])
    x = truncated_draws(np.array([0.5, 7.0]), C, np.array([0.0, -np.inf]), np.full(2, np.inf), np.array([0.5, 7.0]))
    assert x is not None
    assert np.ptp(x[:, 1]) == 0.0
    assert x[:, 0].min() >= 0.0
    far = np.full(2, 50.0)
    assert truncated_draws(np.zeros(2), np.eye(2), -far, far, np.zeros(2)) is None


# Under force control displacements are scored given the forces: against Gaussian densities by virtual work.


ANGLES = (0.5, 0.9)
GAUGE, CELL, REACH = 5e-4, 0.5, 1e-3
"""mm, N, and mm: two of the gauge's noise, so that hardly any curvature of the arm's path shows."""


def stiffness(width: float) -> np.ndarray:
    """By x and z ``(2, 2)`` of an arm whose beams are so many times as stiff, all else held."""
    arm = linear_arm.Arm(linear_arm.arm("upper", "fore", width=width), ANGLES)
    return np.linalg.inv(arm.compliance())[np.ix_((0, 2), (0, 2))]


def objective(folder: Path, rows: np.ndarray, width: float) -> float:
    """Of readings ``(n, 4)``, the sheet's tolerances at nought."""
    model, data, sheet = folder / "arm.toml", folder / "data.csv", folder / "sheet.toml"
    model.write_text(linear_arm.model(linear_arm.arm("upper", "fore", width=width), {"bent": ANGLES}))
    lines = ["posture,ux_mm,uz_mm,fx_N,fz_N", *(",".join(["bent", *(f"{v:.9g}" for v in row)]) for row in rows)]
    data.write_text("\n".join(lines) + "\n")
    sheet.write_text(
        table_text("test", model=str(model), control="force", held=["y", "rx", "ry", "rz"])
        + table_text("postures", bent=[])
        + instruments_text(ux_mm=(GAUGE,), uz_mm=(GAUGE,), fx_N=(CELL,), fz_N=(CELL,))
    )
    observed = observe_ramps(read_measurement(data, sheet))
    nuisances = tuple(nuisance_coordinates(observed))
    found, forward = coordinates(nuisances, ()), Forward(observed)
    at = forward.evaluate(found, np.zeros(len(found)), ())
    return LeastSquaresProblem(forward, nuisances, whitening_of(observed, at)).objective(found, at)


def given_the_forces(rows: np.ndarray, width: float) -> float:
    """Twice the negative logarithm of the density of displacements, but for a constant."""
    C = np.linalg.inv(stiffness(width))
    covariance = GAUGE**2 * np.eye(2) + CELL**2 * C @ C.T
    off = rows[:, :2] - rows[:, 2:] @ C.T
    squares = np.einsum("ni,ij,nj->", off, np.linalg.inv(covariance), off)
    return float(squares + len(rows) * np.linalg.slogdet(covariance)[1])


def test_a_softer_arm_gains_what_its_displacements_are_likelier_by(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    s = np.linspace(-REACH, REACH, 21)
    moved = np.concatenate([np.column_stack([s, 0.0 * s]), np.column_stack([0.0 * s, s])])
    loads = moved @ stiffness(1.0)
    rows = np.column_stack([moved, loads]) + rng.standard_normal((len(s) * 2, 4)) * [GAUGE, GAUGE, CELL, CELL]
    found, wanted = (
        of(1.0) - of(0.7)
        for of in (lambda width: objective(tmp_path, rows, width), lambda width: given_the_forces(rows, width))
    )
    # the density of forces would differ by 2 log(1/0.7) for each axis of a reading more: 60 in all
    assert found == pytest.approx(wanted, abs=0.5)


# A calibration of what a diagnosis frees says the same of it: one inference for both.


PARTS = ("foot", "link")


@pytest.mark.slow
def test_calibration_and_diagnosis_find_the_same_springs():
    folder = Path(str(resources.files("vjm_validation") / "examples/soft-springs"))
    measurement = read_measurement(folder / "readings.csv", folder / "sheet.toml")

    calibrated = solve(problem_of(measurement, [f"{part}.factor" for part in PARTS]))
    unknowns = calibrated.problem.unknowns
    values = [unknown.value(z) for unknown, z in zip(unknowns.sought, calibrated.z, strict=False)]
    deviations = [value * calibrated.covariance[i, i] ** 0.5 for i, value in enumerate(values)]

    prepared = prepare(observe_ramps(measurement))
    causes = {effect.label: effect for effect in prepared.effects}
    hypothesis = tuple(causes[f"{part}_compliance"] for part in PARTS)
    fit = best_fit(prepared.fitter, hypothesis, prepared.null.evaluation.z, [[1.0], [1.0]])
    assert fit is not None
    found = estimates(prepared.fitter, fit)
    for part, value, deviation in zip(PARTS, values, deviations, strict=True):
        diagnosed = found[f"{part}_compliance.factor"]
        # a diagnosis takes lines in time for the displacement and interpolates: some hundredths of a deviation
        assert diagnosed.value == pytest.approx(value, abs=0.2 * deviation)
        assert diagnosed.std == pytest.approx(deviation, rel=0.05)
