"""The second variation on the constraints' null space, against another way to compute it."""

import numpy as np
import pytest
from scipy.linalg import null_space

from vjm.engines import VjmEngine
from vjm.rotations import displaced
from vjm.statics import Configuration, critical_modes, solve_newton, stability


def reduced_second_variation(at):
    """K − H on an orthonormal basis of the null space of J from the SVD, in the model's units; and the basis."""
    model = at.model
    unit = model.coordinate_scale
    J = at.kinematics.jacobian * unit / np.repeat([model.chain.characteristic_length, 1.0], 3)[:, None]
    N = null_space(J, rcond=1e-10)
    A = (at.stiffness - at.hessian) * unit[:, None] * unit / model.wrench_scale[3]
    return N.T @ (0.5 * (A + A.T)) @ N, N


def configuration(model, point):
    """The configuration of a point of a path."""
    m = model.size
    return Configuration(model, point.state[:m], point.state[m : m + 6], point.residual, point.iterations)


STATES = [("A", 0.6, None), ("A", 2.0, None), ("B", 4.0, None), ("C", 0.3, None), ("D", 3.0, None),
          ("A", -4.0, 4), ("B", -10.0, 4), ("D", -12.0, 4)]  # fmt: skip


@pytest.mark.parametrize(("posture", "to", "segments"), STATES)
def test_eigenvalue_agrees_with_the_null_space_from_the_svd(state, posture, to, segments):
    at = state(posture, to, segments)
    values = np.linalg.eigvalsh(reduced_second_variation(at)[0])
    verdict = stability(at)
    # eigenvalues are wrong by the rounding of the largest
    assert verdict.eigenvalue == pytest.approx(values[0], abs=1e-13 * values[-1])
    assert verdict.unstable == np.count_nonzero(values < 0.0) == 0


def test_one_mode_is_unstable_on_the_straight_branch_beyond_the_critical_point(straight):
    # the critical displacement is 0.813 mm
    before, beyond = straight(0.80), straight(0.83)
    assert (stability(before).unstable, stability(beyond).unstable) == (0, 1)
    for at in (before, beyond):
        values = np.linalg.eigvalsh(reduced_second_variation(at)[0])
        assert stability(at).eigenvalue == pytest.approx(values[0], abs=1e-13 * values[-1])
    assert stability(beyond).eigenvalue < 0.0 < stability(before).eigenvalue


def test_critical_mode_solves_the_eigenproblem(trace, state):
    at = state("A", trace("A", 2.0).critical.s * 0.999)
    model = at.model
    mode = critical_modes(at)[0] / model.coordinate_scale
    assert np.linalg.norm(mode) == pytest.approx(1.0, rel=1e-14)
    J = at.kinematics.jacobian * model.coordinate_scale / np.repeat([310.0, 1.0], 3)[:, None]
    assert np.abs(J @ mode).max() < 1e-14  # the end-effector stays: rounding of entries of order one
    reduced, N = reduced_second_variation(at)
    values = np.linalg.eigvalsh(reduced)
    assert np.abs(N @ (N.T @ mode) - mode).max() < 1e-13
    # at the critical point the smallest eigenvalue is 1e-5 and the residual rounding of the largest
    residual = reduced @ (N.T @ mode) - values[0] * (N.T @ mode)
    assert np.abs(residual).max() < 1e-13 * values[-1]


@pytest.mark.parametrize(("segments", "to"), [(4, -4.0), (None, 2.0)], ids=["4 springs", "paper"])
def test_critical_mode_shows_its_largest_deflection_positive(chain, trace, segments, to):
    """On branch +1 the buckled shape moves the way that the mode's sign says, and visibly so."""
    critical = trace("A", to, segments).critical.point
    at = configuration(VjmEngine(segments).model(chain), critical)
    mode = critical_modes(at)[0]
    # one spring a link: its stations are the joints, which stand still while the bar kinks between them
    deflection = mode / at.model.coordinate_scale if segments is None else at.model.shape_rate(at.kinematics, mode)
    largest = deflection.ravel()[np.argmax(np.abs(deflection))]
    # the mode has length one in units of 310 mm and a radian, over 16 or 28 coordinates
    assert largest > (0.2 if segments is None else 1.0)


@pytest.mark.parametrize(("segments", "to"), [(4, -4.0), (None, 2.0)], ids=["4 springs", "paper"])
def test_sign_of_the_critical_mode_does_not_hang_on_rounding(chain, trace, segments, to):
    critical = trace("A", to, segments).critical.point
    model = VjmEngine(segments).model(chain)
    at = configuration(model, critical)
    modes = [critical_modes(at)[0]]
    for change in (-1e-6, 1e-6):
        pose = displaced(at.kinematics.end, change * critical.displacement)
        modes.append(critical_modes(solve_newton(model, pose, at.x, at.wrench))[0])
    unit = model.coordinate_scale
    # a millionth of the displacement turns the mode by about as little
    assert [float((modes[0] / unit) @ (mode / unit)) for mode in modes] == pytest.approx([1.0] * 3, abs=1e-9)


def test_a_push_along_the_mode_grows_into_the_branch_that_the_follower_takes(chain, trace):
    """Newton from a state beyond the critical point, pushed along the mode, finds the followed branch."""
    path = trace("A", -4.0, 4)
    critical, followed = path.critical.point, path.points[-1]
    at = configuration(VjmEngine(4).model(chain), critical)
    target = displaced(at.kinematics.end, followed.displacement - critical.displacement)
    unit, mode = at.model.coordinate_scale, critical_modes(at)[0]
    state = configuration(at.model, followed)
    amplitude = float(mode @ ((state.x - at.x) / unit**2))
    assert amplitude > 0.0
    found = solve_newton(at.model, target, at.x + 0.9 * amplitude * mode, at.wrench)
    # the same state, to the solver's tolerance over the soft mode's eigenvalue
    assert np.abs((found.x - state.x) / unit).max() < 1e-8
