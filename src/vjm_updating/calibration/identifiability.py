"""What the readings see of the parameters, what only together, and what not at all.

The information of the readings on the parameters, once the nuisances have taken what they may within the sheet's
tolerances, is a Schur complement; the roots of its eigenvalues are the singular values of the whitened sensitivity
matrix. A direction whose standard deviation from the readings alone is above `UNSEEN` is not seen: there the fit
stays where its weak prior holds it. A parameter is *separable* when that prior has next to no part in its variance.
The others are reported by the combinations of them that are seen, never as numbers of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.constants import numerical, stated_level

UNSEEN = stated_level(0.25)
"""Standard deviation in z from which on a direction counts as not seen: a factor of 1.6 is not excluded."""
SHARE = stated_level(0.5)
"""Part of a parameter's variance that may come from directions that are not seen: the readings say more of it."""
NEGLIGIBLE = numerical(0.05)
"""Coefficient of a combination, its largest being 1, that is left out of its name."""
TINY = numerical(1e-3)
"""Coefficient below which a combination is one parameter."""


@dataclass(frozen=True)
class ParameterCombination:
    """A combination of parameters.

    Attributes:
        name: ``foot.C11 + 0.21 actuator.compliance``.
        coefficients: ``(p,)`` of the parameters' z, the largest 1.
        singular_value: of the whitened sensitivity matrix; the inverse of the standard deviation of the unit
            vector's z.
        seen: whether the readings determine it.
        value: of the combination.
        std: its standard deviation with the priors.
    """

    name: str
    coefficients: Array
    singular_value: float
    seen: bool
    value: float
    std: float


@dataclass(frozen=True)
class Identifiability:
    """What a test can tell.

    Attributes:
        directions: of all parameters, the best seen first.
        separable: ``(p,)`` whether a parameter has a number of its own.
        combinations: of the parameters that are not separable, the best seen first.
        unseen: part ``(p, p)`` of the parameters' covariance along directions that are not seen.
    """

    directions: tuple[ParameterCombination, ...]
    separable: np.ndarray
    combinations: tuple[ParameterCombination, ...]
    unseen: Array

    def determined(self, gradient: Array, variance: float) -> bool:
        """Whether a function of the parameters is known from the readings, not from the weak prior.

        Args:
            gradient: by the parameters' z ``(p,)``.
            variance: of the function.
        """
        return bool(gradient @ self.unseen @ gradient <= SHARE * variance)


def identifiability(fit: CalibrationSolution) -> Identifiability:
    """What the readings of a fit can tell."""
    p = fit.problem.unknowns.parameters
    prior = fit.problem.unknowns.sigma**-2.0
    seen_of_all = _information(fit, np.arange(p))
    values, vectors = np.linalg.eigh(seen_of_all)
    dark = values < UNSEEN**-2.0
    hidden = vectors[:, dark]
    unseen = hidden / (prior[:1] + np.maximum(values[dark], 0.0)) @ hidden.T
    separable = np.diag(unseen) <= SHARE * np.diag(fit.covariance)[:p]
    group = np.flatnonzero(~separable)
    return Identifiability(
        _directions(fit, seen_of_all, np.arange(p)),
        separable,
        _directions(fit, _information(fit, group), group),
        unseen,
    )


def _information(fit: CalibrationSolution, which: np.ndarray) -> Array:
    """The readings' information on some unknowns ``(k, k)``, all others being free within their priors."""
    A = fit.normal
    rest = np.setdiff1d(np.arange(len(A)), which)
    kept = fit.information[np.ix_(which, which)]
    if not len(rest):
        return kept
    cross = A[np.ix_(which, rest)]
    result: Array = kept - cross @ np.linalg.solve(A[np.ix_(rest, rest)], cross.T)
    return 0.5 * (result + result.T)


def _directions(
    fit: CalibrationSolution, information: Array, which: np.ndarray
) -> tuple[ParameterCombination, ...]:
    """Eigenvectors of an information on some parameters."""
    names = [unknown.name for unknown in fit.problem.unknowns.sought]
    p = len(names)
    values, vectors = np.linalg.eigh(information)
    found = []
    for k in np.argsort(values)[::-1]:
        coefficients = np.zeros(p)
        coefficients[which] = vectors[:, k]
        coefficients /= coefficients[np.argmax(np.abs(coefficients))]
        value = float(coefficients @ fit.z[:p])
        variance = float(coefficients @ fit.covariance[:p, :p] @ coefficients)
        size = float(np.sqrt(max(values[k], 0.0)))
        name, std = in_words(coefficients, names), float(np.sqrt(variance))
        found.append(ParameterCombination(name, coefficients, size, size > 1.0 / UNSEEN, value, std))
    return tuple(found)


def in_words(coefficients: Array, names: list[str]) -> str:
    """Which parameters, by coefficients ``(p,)`` of their z."""
    text = ""
    # a combination of one parameter is none: its largest partner is named then, however small its part
    least = min(NEGLIGIBLE, max(float(np.sort(np.abs(coefficients))[-2:][0]), TINY))
    for name, value in zip(names, coefficients, strict=True):
        if abs(value) < least:
            continue
        sign = "- " if value < 0.0 else "+ " if text else ""
        size = "" if abs(abs(value) - 1.0) < 5e-3 else f"{abs(value):.2g} "
        text += f"{' ' if text else ''}{sign}{size}{name}"
    return text
