"""Intervals by the likelihood ratio: how far a parameter goes until the best fit with it there is 3.84 worse.

Where the model is curved these intervals are not symmetric, as the covariance's are (Venzon and Moolgavkar 1988).
At each trial all other unknowns follow by Gauss-Newton steps with the slopes of the solution.
"""

from __future__ import annotations

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.constants import definition, numerical
from vjm_updating.observation.significance import NORMAL_95

CHI2_95 = definition(3.841458820694124)
"""Of one degree of freedom."""
REACHED = numerical(0.02)
"""Of the root of the ratio over that of `CHI2_95`: an interval's end is good to this share of its half-width."""
MOST_TRIALS = numerical(5)


def profile_interval(fit: CalibrationSolution, index: int) -> tuple[float, float]:
    """Ends of a parameter's 95 % interval in z.

    An end beyond the bound of a parameter is the bound. Where the model reaches no reading on the way, the end is
    the covariance's.
    """
    low, high = (_end(fit, index, sign) for sign in (-1.0, 1.0))
    return low, high


def _end(fit: CalibrationSolution, index: int, sign: float) -> float:
    best, deviation = fit.fitter.squares(fit.fit.found, fit.fit.at), float(np.sqrt(fit.covariance[index, index]))
    bound = float(fit.problem.unknowns.lowest[index])
    plain = fit.z[index] + sign * NORMAL_95 * deviation
    if sign < 0.0 and plain <= bound:
        plain = bound
    trial, wanted = sign * NORMAL_95 * deviation, np.sqrt(CHI2_95)
    shift = np.zeros(len(fit.z))
    for _ in range(MOST_TRIALS):
        if sign < 0.0 and fit.z[index] + trial < bound:
            return bound
        try:
            worse, shift = _worse(fit, index, trial, best, shift)
        except (NoConvergenceError, np.linalg.LinAlgError, ValueError):
            return float(plain)
        # the root of the ratio is nearly straight in the parameter
        ratio = np.sqrt(max(worse, 1e-12)) / wanted
        if abs(ratio - 1.0) < REACHED:
            break
        trial *= float(np.clip(1.0 / ratio, 0.5, 2.0))
    return float(fit.z[index] + trial)


def _worse(fit: CalibrationSolution, index: int, trial: float, best: float, shift: Array) -> tuple[float, Array]:
    """How much worse the best fit with a parameter moved by ``trial`` is, and how the others moved beside the plan.

    Args:
        fit: the solution.
        index: of the parameter.
        trial: by how much it is moved.
        best: objective at the solution.
        shift: ``(n_z,)`` of the others at the last trial, per unit of its square.
    """
    along = fit.covariance[:, index] / fit.covariance[index, index]
    z = np.maximum(fit.z + trial * along + trial**2 * shift, fit.problem.unknowns.lowest)
    z[index] = fit.z[index] + trial
    at = fit.fitter.forward.evaluate(fit.fit.found, z, ())
    value = fit.fitter.squares(fit.fit.found, at)
    free = np.arange(len(z)) != index
    _, downhill = fit.fitter.system(fit.fit.found, at, fit.fit.jacobian)
    change = np.zeros(len(z))
    change[free] = np.linalg.solve(fit.normal[np.ix_(free, free)], downhill[free])
    # what the step will gain is known well enough without taking it
    gain = float(downhill[free] @ change[free])
    return value - best - gain, shift + change / trial**2
