"""Fits of data whose truth is known: clean, noisy, autocorrelated, with outliers, with gaps, every parameter."""

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.calibration.fit import CalibrationProblem, fitter_of, problem_of, solve
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.inference.fitting import whitening_of
from vjm_updating.inference.observed import observe
from vjm_updating.inference.profile import profile_interval

from . import synthetic
from .conftest import RAMPS, TRUTH, Make, errors_in_sigma, solved


def as_read(measurement: Measurement) -> CalibrationProblem:
    """A calibration with every displacement as its gauge read it: a ramp under displacement control is a line."""
    return replace(problem_of(measurement, tuple(TRUTH)), observed=observe(measurement))


def test_clean_data_give_the_truth(make: Make):
    found = solved(make(errors=0.0))
    np.testing.assert_allclose(found.z[:3], list(TRUTH.values()), atol=1e-6)  # the file has six decimals
    assert found.whitening.spread.tolist() == [1.0] * 6
    assert not found.outliers.any()


def test_slopes_are_the_models_own(make: Make):
    """The Jacobian against differences of the residuals, all unknowns, where slopes are not interpolated."""
    problem = problem_of(make(), tuple(TRUTH))
    fitter, _ = fitter_of(problem)
    forward, found = fitter.forward, problem.unknowns.all
    z = np.concatenate([list(TRUTH.values()), 0.3 * np.ones(len(problem.unknowns) - 3)])
    at = forward.evaluate(found, z, ())
    J = fitter.slopes(found, at, ())
    scale = 1.0 / np.hypot(problem.observed.noise.wrench, 1.0)
    smooth = ~forward.behind_bifurcation(found, z, ())
    for i in range(len(z)):
        h = 1e-3 * np.eye(len(z))[i]
        more, less = (forward.evaluate(found, z + s * h, ()).residual for s in (1.0, -1.0))
        slope = (more - less) / 2e-3 * scale
        exact = J[:, :, i] * scale
        # of differences over 1e-3 in z, where neither curvature nor rounding counts: 1e-11 of the forces
        np.testing.assert_allclose(exact[smooth], slope[smooth], atol=1e-4 * max(np.abs(slope).max(), 1.0))


def test_the_displacements_noise_is_what_it_makes_of_the_residuals(make: Make):
    """Of a gauge whose scale is far off an error of its reading is another one of the displacement.

    So it is of readings by themselves; errors of straight lines in their place are tested with those.
    """
    problem = as_read(make())
    names = [unknown.name for unknown in problem.unknowns.all]
    z = np.where([name == "scale ux_mm" for name in names], 200.0, 0.0)
    forward, found = problem.forward(problem.observed), problem.unknowns.all
    at = forward.evaluate(found, z, ())
    h, observed = 1e-5, problem.observed
    moved = (replace(observed, imposed=observed.imposed + s * h * np.eye(6)[0]) for s in (1.0, -1.0))
    more, less = (problem.forward(other).evaluate(found, z, ()).residual for other in moved)
    slope = (more - less) / (2.0 * h)
    noise = observed.noise
    covariance = noise.pose[0] ** 2 * slope[:, :, None] * slope[:, None, :] + np.diag(noise.wrench**2)
    L = whitening_of(observed, at).factors
    smooth = ~forward.behind_bifurcation(found, z, ())
    white = np.einsum("nij,njk,nlk->nil", L, covariance, L)[smooth]
    # of differences over 1e-5 mm
    np.testing.assert_allclose(white, np.tile(np.eye(6), (len(white), 1, 1)), atol=1e-3)


def test_noise_is_survived(make: Make):
    found = solved(make())
    assert max(abs(e) for e in errors_in_sigma(found, TRUTH).values()) < 3.5
    r = found.residual[found.problem.observed.present]
    # whitened residuals are standard normal: 216 of them, 4 standard errors
    assert np.std(r) == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * len(r)))


@pytest.mark.slow
def test_autocorrelation_of_the_noise_widens_the_intervals(make: Make):
    white, red = solved(make(steps=40)), solved(make(steps=40, rho=0.8))
    assert white.whitening.autoregression.rho.max() < 0.35
    # the displacement's own noise, which is not autocorrelated, outweighs fx's
    np.testing.assert_allclose(red.whitening.autoregression.rho[1:], 0.8, atol=0.15)
    ratio = np.sqrt(np.diag(red.covariance) / np.diag(white.covariance))
    # a mean of autocorrelated readings is worse by √((1 + ρ)/(1 − ρ)) = 3 in the long run
    names = [unknown.name for unknown in red.problem.unknowns.all]
    assert 2.0 < ratio[names.index("zero my_Nmm")] < 3.8
    assert max(abs(e) for e in errors_in_sigma(red, TRUTH).values()) < 3.5


@pytest.mark.slow
def test_outliers_have_no_weight(make: Make):
    clean, spoilt = solved(make(steps=25)), solved(make(steps=25, outliers=0.03))
    assert 5 < spoilt.outliers.sum() < 30
    # the same dice but for the outliers: everything stays where it was, within its own uncertainty
    assert max(abs(e) for e in errors_in_sigma(spoilt, TRUTH).values()) < 3.5
    assert np.all(np.sqrt(np.diag(spoilt.covariance)[:3] / np.diag(clean.covariance)[:3]) < 1.3)


def test_gaps_are_no_harm(make: Make):
    def holes(rows):
        for k, row in enumerate(rows):
            if k % 3 == 0:
                row["fz_N"] = ""
            if k % 7 == 0:
                row["ux_mm"] = ""

    found = solved(make(spoil=holes))
    assert found.problem.observed.present[:, 0].sum() == 39 - 6
    assert found.problem.observed.present[:, 2].sum() < 25
    assert max(abs(e) for e in errors_in_sigma(found, TRUTH).values()) < 3.5


def test_a_few_channels_will_do(make: Make):
    found = solved(make(columns=("fx_N", "fz_N")))
    assert found.problem.observed.present.any(axis=0).tolist() == [True, False, True, False, False, False]
    assert max(abs(e) for e in errors_in_sigma(found, TRUTH).values()) < 3.5


def test_the_other_branch_of_a_bifurcation_is_found(make: Make):
    """What the buckled chain pushes sideways has either sign; each run takes its own."""

    def mirror(rows):
        for k, row in enumerate(rows):
            row["run"] = "1"
            if k < 13:
                # A in compression, mirrored in its plane of symmetry
                for name in ("fy_N", "mx_Nmm", "mz_Nmm"):
                    row[name] = -float(row[name])

    measurement = make(ramps={"A": (-4.0,), "C": (1.0,)}, spoil=mirror, errors=0.3)
    found = solved(measurement, ("link.EA", "link.EIz", "foot.factor"))
    assert found.residual[found.problem.observed.present].std() < 1.2


def test_force_control_is_the_same_to_a_fit(make: Make):
    """Errors of both are in the covariance, whichever was imposed; the sheet says what is held."""
    found = make()
    held = 'control = "force"\nheld = ["y", "z", "rx", "ry", "rz"]'
    controlled = make(sheet=synthetic.sheet_text(foot=1, link=4).replace('title = "made up"', held))
    assert controlled.sheet.test.control == "force"
    np.testing.assert_allclose(solve(as_read(controlled)).z, solve(as_read(found)).z, atol=1e-9)


def test_a_compliant_drive_is_found(make: Make):
    truth = {"actuator.compliance": 2.0, "foot.factor": 0.05}  # 2e-5 mm/N
    measurement = make(z=truth, ramps={"A": (-2.0, 2.0), "B": (4.0,), "C": (1.0, -0.5)})
    found = solved(measurement, tuple(truth))
    assert max(abs(e) for e in errors_in_sigma(found, truth).values()) < 3.5
    assert np.sqrt(found.covariance[0, 0]) < 0.5


def interval(found, index):
    return profile_interval(found.fitter, found.fit, index, found.covariance)


def test_a_rigid_drive_stays_at_its_bound(make: Make):
    measurement = make(z={"foot.factor": 0.05}, ramps={"A": (-2.0, 2.0), "B": (4.0,), "C": (1.0, -0.5)}, seed=3)
    found = solved(measurement, ("actuator.compliance", "foot.factor"))
    ends = interval(found, 0)
    assert ends.low == pytest.approx(found.problem.unknowns.lowest[0])
    assert ends.low <= found.z[0] < ends.high < 1.0


def test_every_part_has_a_name_that_means_something(make: Make):
    measurement = make()
    for names, words in (
        (("bar.factor",), "no such elastic part"),
        (("link.C11",), "is split into springs with its section"),
        (("foot.EA",), "is one spring with a 6×6"),
        (("link.EIz", "link.section"), "looked for twice"),
        (("link.GAy",), "shear is neglected"),
        (("actuator.factor",), "actuator.compliance"),
    ):
        with pytest.raises(ValueError, match=words):
            problem_of(measurement, names)


def test_parameters_need_readings(make: Make):
    measurement = make(ramps={"A": (-1.0,)}, steps=2, columns=("fx_N",))
    with pytest.raises(ValueError, match="look for fewer of them, or read more"):
        problem_of(measurement, ("link.section", "foot.matrix"))


@pytest.mark.slow
def test_a_full_compliance_is_found_and_stays_positive_definite(make: Make):
    """Where little breaks the symmetry of a posture its path turns sharply: no step may leave it there."""
    rng = np.random.default_rng(5)
    truth = {f"foot.R{i + 1}{j + 1}": 0.1 * rng.standard_normal() for i in range(6) for j in range(i + 1)}
    ramps = {"A": (4.0, -4.0), "B": (4.0, -8.0), "C": (2.0, -2.0)}
    measurement = make(z=truth, ramps=ramps, steps=20)
    found = solve(problem_of(measurement, ("foot.matrix",)))
    foot = next(beam for beam in found.problem.unknowns.build(found.z).beams if beam.name == "foot")
    true = next(
        beam for beam in found.problem.unknowns.build(with_truth(found, truth)).beams if beam.name == "foot"
    )
    assert foot.compliance is not None
    assert true.compliance is not None
    assert np.all(np.linalg.eigvalsh(foot.compliance) > 0.0)
    # the translations are seen to a few thousandths
    size = np.sqrt(np.diag(true.compliance))
    error = (foot.compliance - true.compliance) / np.outer(size, size)
    assert np.abs(error[:3, :3]).max() < 0.01
    assert found.residual[found.problem.observed.present].std() == pytest.approx(1.0, abs=0.1)


def with_truth(found, truth) -> np.ndarray:
    names = [unknown.name for unknown in found.problem.unknowns.all]
    z = np.zeros(len(names))
    for name, value in truth.items():
        z[names.index(name)] = value
    return z


def test_intervals_follow_the_likelihood(make: Make):
    """Nearly linear here: the profile's ends are the covariance's."""
    found = solved(make())
    std = np.sqrt(np.diag(found.covariance))
    for i in range(3):
        ends = interval(found, i)
        # at two standard deviations the model is curved by a thousandth of what it rises
        assert (ends.high - found.z[i]) / std[i] == pytest.approx(1.96, rel=2e-3)
        assert (found.z[i] - ends.low) / std[i] == pytest.approx(1.96, rel=2e-3)
        assert ends.by_readings == (True, True)


def test_rounded_readings_are_seen_as_such(make: Make):
    def rounded(rows):
        for row in rows:
            row["fx_N"] = 25.0 * round(float(row["fx_N"]) / 25.0)
            row["fz_N"] = 25.0 * round(float(row["fz_N"]) / 25.0)

    # many readings near each other, so that the steps show
    found = solved(make(ramps={"A": (-0.2,), "B": (1.0,), "C": (0.1,)}, steps=60, spoil=rounded), ("foot.factor",))
    noise = found.problem.observed.noise
    assert noise.quantum["fx_N"] == pytest.approx(25.0)
    assert noise.wrench[WRENCH.index("fx_N")] == pytest.approx(np.hypot(2.0, 25.0 / np.sqrt(12.0)))


def test_ramps_are_what_is_calibrated_with(make: Make):
    assert len({ray.posture for ray in problem_of(make()).observed.rays}) == len(RAMPS)
