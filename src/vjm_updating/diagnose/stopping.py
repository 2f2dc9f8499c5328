"""When a search for causes ends: what a further one must show to be worth a fit, and to count."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from vjm_updating.diagnose.fitting import Fit, Fitter
from vjm_updating.diagnose.model_adequacy import Misfit
from vjm_updating.diagnose.screening import Score, projection

HOPEFUL = 30.0
"""How far from significance, by its score's p-value over the threshold, an effect is still fitted in full."""
WRONG_LAW = 0.02
"""Share of the squares explained that a slightly wrong law of the right cause may leave: a seventh of its size. Of
readings by other laws, without noise, these leave more in one set of three (docs/hidden-effects.md)."""
WORTH_A_LOOK = 60.0
"""Squares explained up to which a hypothesis may owe them to better nuisances alone."""
HOPE = 0.3
"""Share of what is left that the best causes must explain, to first order, to be worth a fit."""
FALLEN = 0.3
"""Share of what was explained by which a hypothesis must have fallen behind not to be fitted again where the noise
is known better, or where its fit had not ended."""
CLOSE = 40.0
"""Criterion within which of the best a rough fit is made exact."""


def no_cause_left(ranked: Sequence[Score], gained: float, alarm: float) -> bool:
    """Whether no effect is near significance.

    Args:
        ranked: what every other effect explains beside the causes found.
        gained: squares that they explain.
        alarm: p-value at which the least of all effects is significant.
    """
    return not any(s.explained > WRONG_LAW * gained and s.p < HOPEFUL * alarm for s in ranked)


def no_shape_left(rest: Misfit, gained: float, alarm: float) -> bool:
    """Whether no shape without a name is left.

    Args:
        rest: what the causes found leave.
        gained: squares that they explain.
        alarm: p-value at which the least of all effects is significant.
    """
    return (rest.p > alarm or rest.left < WRONG_LAW * gained) and rest.strained > alarm


def hopeless(fitter: Fitter, fit: Fit, more: Sequence[Score]) -> bool:
    """Whether these causes more, however they were mixed, would leave most of what a fit leaves."""
    space = projection(fitter, fit)
    left = float(space.residual @ space.residual) - len(space.residual) + space.basis.shape[1]
    return left >= WORTH_A_LOOK and sum(score.explained for score in more) < HOPE * left


def chance(first: Sequence[Score], null: Fit, fit: Fit) -> float:
    """p-value of what one effect explains; where it shows in no signature, each parameter is one direction.

    Args:
        first: scores of all effects about the null.
        null: fit without causes.
        fit: of the effect.
    """
    (effect,) = fit.hypothesis
    gain = max(null.objective - fit.objective, 0.0)
    for score in first:
        if score.effect.label == effect.label:
            return float(score.cone.chance(np.array([gain]))[0])
    return float(chi2.sf(gain, max(len(effect.quantities()), 1)))


def in_one_reading(fitter: Fitter, before: Fit, after: Fit) -> float:
    """The most that one fit explains more than another in a single reading, in squares."""
    reading = np.nonzero(fitter.whitening.present)[0]
    less, more = (fitter.whitening.flat(fit.at.residual) ** 2 for fit in (after, before))
    return float(np.bincount(reading, weights=more - less).max(initial=0.0))


def far_behind(criterion: float, least: float, null: float) -> bool:
    """Whether a hypothesis lies too far behind the least criterion to count, by what that gains on the null's."""
    return criterion > least + max(CLOSE, FALLEN * (null - least))
