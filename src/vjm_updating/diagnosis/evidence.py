"""What a hypothesis is worth: how well it fits, and what its parameters and its choice from the catalogue cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import prior_scale
from vjm_updating.inference.fitting import Fit, Fitter, prior
from vjm_updating.inference.normal_equations import inverse
from vjm_updating.inference.parameters import Hypothesis, of_effect, release_key
from vjm_updating.inference.truncated_normal import log_beyond
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.observation.coordinate import uncertain
from vjm_updating.observation.noise import AutoregressiveNoise
from vjm_updating.observation.significance import LAW_ERROR, NORMAL_95, RARER, accident

RAREST = prior_scale(8.0)
"""What each cause beyond the second costs besides `RARER`: what no catalogue has is likelier than three at once."""


@dataclass(frozen=True)
class Costs:
    """What a choice of causes costs that depends on the kind of test, in units of the objective.

    Attributes:
        third: of each cause beyond the second.
        disguised: of a cause whose own parameter may as well be nothing: that it acts would be a false alarm.
        law_error: relative error of the causes' laws, standard deviation; see `vjm_updating.diagnosis.discrepancy`.
        other_shapes: whether laws may also be off in shapes that the discrepancy has not, as those of a machine's
            many parts; see `vjm_updating.diagnosis.verdict.coarsening`.
    """

    third: float = RAREST
    disguised: float = field(default_factory=accident)
    law_error: float = LAW_ERROR
    other_shapes: bool = True


def criterion(fitter: Fitter, fit: Fit, effects: Sequence[Effect], samples: float, costs: Costs = Costs()) -> float:
    """Objective, what the parameters cost, and the catalogue's choice: of a cause, and of its place.

    A free parameter costs the logarithm of the effective readings; those with a usual value and a spread cost what
    the readings have narrowed them down by, see `narrowed`. A cause whose own parameter may as well be nothing is
    another one in disguise.

    Args:
        fitter: of the test.
        fit: of the hypothesis.
        effects: the catalogue.
        samples: effective number of readings.
        costs: of the kind of test.
    """
    own = [i for i, c in enumerate(fit.found) if c.kind == "effect" and np.isfinite(c.sigma)]
    # what frees a nuisance has one parameter; what either is or is not has none
    free = sum(1 if release_key(e) else len(e.quantities()) for e in fit.hypothesis) - len(own)
    cost = free * float(np.log(samples)) + choice(fit.hypothesis, effects, costs)
    A = fitter.normal(fit)
    covariance = inverse(A, uncertain(fit.found))
    spread = np.maximum(np.diag(covariance), 1e-300)
    # of coordinates that end at bounds the other costs take in what lies beyond
    pressed = fitter.pressure(fit) * spread**0.5
    cost -= 2.0 * float(np.sum(log_beyond(pressed[pressed > 0.0])))
    # an instrument that is off costs what its sheet says against that, by a density of heavy tails, as of shapes:
    # what is far off is rare and not impossible. Where no reading tells it from another cause, nothing else does
    freed = [i for i, c in enumerate(fit.found) if c.of_instrument and not np.isfinite(c.sigma)]
    cost += 2.0 * float(np.sum(np.log1p(fit.at.z[freed] ** 2)))
    sigma = np.array([fit.found[i].sigma for i in own])
    cost += narrowed(covariance[np.ix_(own, own)], prior(fit.found, fit.at.z)[1][own], sigma)
    for number, effect in enumerate(fit.hypothesis):
        at = of_effect(fit.found, number)[: effect.extent]
        if at and _is_nothing(effect, fit.at.z[at], size_covariance(A, fit, number)):
            cost += costs.disguised
        if len(at) > 1 and at[0] not in own:
            # of a vector the directions that the readings say less of cost less
            sizes = np.maximum(np.linalg.eigvalsh(covariance[np.ix_(at, at)]), 1e-300)
            cost -= float(np.sum(np.minimum(np.log(sizes[1:] / sizes[0]), np.log(samples))))
    return fit.objective + cost


def narrowed(covariance: Array, weight: Array, spread: Array) -> float:
    """What it costs that readings have narrowed the shapes of laws down (Laplace's approximation of the evidence).

    The prior of each is Cauchy's, whose density at its middle is 1/(π s). So a direction in which the readings'
    own precision is p, in units of ``1/s²``, costs ``log(p π/2)`` where p is large. A direction that they do not
    see costs nothing, for its posterior is its prior: ``log(1 + p π/2)`` is both.

    Args:
        covariance: of the shapes' coordinates ``(k, k)``, their priors included.
        weight: ``(k,)`` of their priors in that, see `vjm_updating.inference.fitting.prior`.
        spread: s ``(k,)``.
    """
    scaled = covariance / np.outer(spread, spread)
    precision = np.linalg.pinv(scaled, hermitian=True) - np.diag((weight * spread) ** 2)
    # rounding, where nothing is seen
    seen = np.maximum(np.linalg.eigvalsh(precision), 0.0)
    return float(np.sum(np.log1p(0.5 * np.pi * seen)))


def choice(hypothesis: Hypothesis, effects: Sequence[Effect], costs: Costs = Costs()) -> float:
    """What the choice of causes, and of their places, costs, whatever the readings say.

    Args:
        hypothesis: the causes.
        effects: the catalogue.
        costs: of the kind of test.
    """
    places = Counter(e.cause for e in effects)
    cost = 2.0 * sum(float(np.log(len(places) * places[e.cause])) for e in hypothesis)
    return cost + RARER * max(len(hypothesis) - 1, 0) + costs.third * max(len(hypothesis) - 2, 0)


def size_covariance(A: Array, fit: Fit, number: int) -> Array:
    """Covariance ``(k, k)`` of an effect's size, its shape as fitted: without a size a shape does nothing.

    Args:
        A: inverse covariance of all coordinates.
        fit: of the hypothesis.
        number: of the effect in it.
    """
    own = of_effect(fit.found, number)
    at, shape = own[: fit.hypothesis[number].extent], own[fit.hypothesis[number].extent :]
    free = uncertain(fit.found)
    free[[i for i in shape if np.isfinite(fit.found[i].sigma)]] = False
    result: Array = inverse(A, free)[np.ix_(at, at)]
    return result


def would_not_show(effect: Effect, covariance: Array) -> bool:
    """Whether the usual size of an effect, where there is one, lies within what is not known of it ``(k, k)``."""
    usual = effect.quantities()[0]
    return usual.log and NORMAL_95 * float(covariance[0, 0]) ** 0.5 > usual.spread


def _is_nothing(effect: Effect, z: Array, covariance: Array) -> bool:
    """Whether an effect's size, coordinates ``(k,)``, may as well be none, and would show if it were usual."""
    sizes = effect.quantities()[: effect.extent]
    if any(q.neutral is None or (q.log and q.neutral <= 0.0) for q in sizes) or would_not_show(effect, covariance):
        return False
    off = z - np.array([q.coordinate(q.neutral or 0.0) for q in sizes])
    return float(off @ np.linalg.pinv(covariance, hermitian=True) @ off) < NORMAL_95**2


def effective_samples(noise: AutoregressiveNoise, present: np.ndarray) -> float:
    """Independent readings that autocorrelated ones are worth."""
    correlated = 2.0 * noise.neighbours / (1.0 - noise.rho)
    return float(np.sum(present.sum(axis=0) / (1.0 + correlated)))
