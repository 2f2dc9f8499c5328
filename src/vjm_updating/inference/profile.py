"""The profile of an objective along a coordinate, the others fitted, and the interval that it gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, prior
from vjm_updating.inference.parameters import Evaluation
from vjm_updating.inference.significance import NORMAL_95

FAR, GRID = numerical(40.0), numerical(65)
"""Squares beyond the least at which a profile ends, and points between two places of it."""
FOLLOWED, ENOUGH = numerical(5), numerical(0.1)
"""Steps of the other coordinates at most, and the fall of the squares, to be expected, that is worth no other."""


@dataclass(frozen=True)
class ProfileInterval:
    """What holds 95 % of a coordinate's posterior.

    Attributes:
        low: its lower end, and
        high: its upper one.
        by_readings: whether the readings, without the prior, speak against what lies farthest beyond each.
    """

    low: float
    high: float
    by_readings: tuple[bool, bool]


@dataclass
class Rise:
    """By how much the objective rises where some coordinates are held at other values, and the others follow.

    They go by Gauss-Newton with the fit's own slopes. To first order alone they would be led far off: a travel of
    which readings say only that it is short is fitted at their spacing, where it goes with all else, and below that
    with nothing.
    """

    fitter: LeastSquaresProblem
    fit: Fit
    held: Sequence[int]

    def __post_init__(self) -> None:
        fitter, fit = self.fitter, self.fit
        self.others = [i for i, c in enumerate(fit.parameters) if i not in self.held and c.sigma != 0.0]
        weight = prior(fit.parameters, fit.evaluation.z)[1]
        M = np.vstack([fitter.whitening.flat(fit.jacobian), np.diag(weight)])[:, self.others]
        self.onto, self.back = M, np.linalg.pinv(M)
        self.low, self.high = (np.array([getattr(c, end) for c in fit.parameters]) for end in ("low", "high"))
        self.least = self._squares(fit.evaluation)[1]

    def __call__(self, values: Array) -> float:
        """The rise at values ``(k,)``, the others begun at the fit's; infinite where no machine stands."""
        return self.begun(values, self.fit.evaluation.z)[0]

    def begun(self, values: Array, z: Array) -> tuple[float, Array]:
        """The same with the others begun at those of ``z`` (n_z,), and the coordinates to which they went."""
        point, best, least = z.copy(), np.inf, np.inf
        for _ in range(FOLLOWED):
            point[list(self.held)] = values
            evaluation = self.fitter.evaluate(self.fit.parameters, point, self.fit.hypothesis)
            if evaluation is None:
                break
            squares, left, step = self._squares(evaluation)
            if squares >= best:
                break
            z, best, least = evaluation.z, squares, min(left, least)
            if squares - left < ENOUGH:
                break
            point = z.copy()
            point[self.others] -= step
            point = np.clip(point, self.low, self.high)
        return least - self.least, z

    def _squares(self, evaluation: Evaluation) -> tuple[float, float, Array]:
        """Squares of an evaluation, those that the others leave to first order, and their step back ``(k,)``."""
        off = prior(self.fit.parameters, evaluation.z)[0]
        r = np.concatenate([self.fitter.whitening.flat(evaluation.residual), off])
        step = self.back @ r
        left = r - self.onto @ step
        return float(r @ r), float(left @ left), step


def profile_interval(
    fitter: LeastSquaresProblem, fit: Fit, index: int, covariance: Array, inflation: float = 1.0
) -> ProfileInterval:
    """The interval of a coordinate that holds 95 % of its posterior, by its profile.

    Where the model is curved it is not symmetric, as the one by the ``covariance`` (n_z, n_z) is (Venzon and
    Moolgavkar 1988). Readings may also say that a coordinate is below something and no more: there the objective is
    flat to one side, and its curvature says nothing. So it is found at distances that double, the first one by the
    curvature. The noise's variance is ``inflation`` times what the objective counts. The interval begins at a bound
    where the density is at least that at the 95 % quantile, see `vjm_updating.diagnosis.evidence.credible`.
    """
    coordinate, z = fit.parameters[index], float(fit.evaluation.z[index])
    std = float(covariance[index, index]) ** 0.5
    if std == 0.0:
        return ProfileInterval(z, z, (True, True))
    by, known, by_readings = Rise(fitter, fit, [index]), {z: 0.0}, list[bool]()
    for way in (-1.0, 1.0):
        others, distance, against = fit.evaluation.z, std, 0.0
        while known[min(known) if way < 0.0 else max(known)] < FAR:
            place = float(np.clip(z + way * distance, coordinate.low, coordinate.high))
            if place in known:
                break
            further, others = by.begun(np.array([place]), others)
            if np.isinf(further):
                against = further
                break
            point = fit.evaluation.z.copy()
            point[index] = place
            usual = [float(prior(fit.parameters, where)[0][index]) for where in (point, fit.evaluation.z)]
            unusual = usual[0] ** 2 - usual[1] ** 2
            against = (max(further, 0.0) - unusual) / inflation
            known[place] = max(against + unusual, 0.0)
            distance *= 2.0
        by_readings.append(against > NORMAL_95**2)
    places = np.array(sorted(known))
    if len(places) == 1:
        return ProfileInterval(z, z, (True, True))
    fine = np.unique(np.concatenate([np.linspace(a, b, GRID) for a, b in pairwise(places)]))
    # its root is straight where the model is
    density = np.exp(-0.5 * np.interp(fine, places, [known[place] ** 0.5 for place in places]) ** 2)
    mass = np.concatenate([[0.0], np.cumsum(np.diff(fine) * 0.5 * (density[1:] + density[:-1]))])

    def quantile(share: float) -> float:
        return float(np.interp(share, mass / mass[-1], fine))

    reached = [
        bool(end == bound and density[k] >= np.interp(quantile(far), fine, density))
        for k, end, bound, far in ((0, fine[0], coordinate.low, 0.95), (-1, fine[-1], coordinate.high, 0.05))
    ]
    low = quantile(0.05 if reached[1] else 0.025) if not reached[0] else float(fine[0])
    high = quantile(0.95 if reached[0] else 0.975) if not reached[1] else float(fine[-1])
    return ProfileInterval(min(low, z), max(high, z), (by_readings[0], by_readings[1]))
