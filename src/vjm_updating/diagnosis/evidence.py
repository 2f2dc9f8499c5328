"""A hypothesis given the readings: its evidence, and its parameters with their uncertainty.

The evidence is how well it fits, less what its parameters and its choice from the catalogue cost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.special import ndtri

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.diagnosis.document import ValueRow
from vjm_updating.inference.bounded_normal import inverse, log_beyond, log_share, truncated_draws
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, prior
from vjm_updating.inference.forward import values_of
from vjm_updating.inference.noise import AutoregressiveNoise
from vjm_updating.inference.parameters import Hypothesis, of_effect, release_key, uncertain
from vjm_updating.inference.profile import Rise, profile_interval
from vjm_updating.inference.significance import (
    ALL_ROUND,
    LAW_ERROR,
    NORMAL_95,
    RARER,
    accident,
    chi2_sf,
    latin_hypercube,
)
from vjm_updating.mechanisms.effect import Effect

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
        off_sheet: whether an instrument that is off costs what its sheet says against that. Where no reading tells
            its error from another cause, nothing else does. A machine's tolerances that are freed cost no such
            thing: where both are asked for, it would speak against the instruments alone.
    """

    third: float = RAREST
    disguised: float = field(default_factory=accident)
    law_error: float = LAW_ERROR
    other_shapes: bool = True
    off_sheet: bool = False


def criterion(
    fitter: LeastSquaresProblem, fit: Fit, effects: Sequence[Effect], samples: float, costs: Costs = Costs()
) -> float:
    """Objective, what the parameters cost, and the catalogue's choice: of a cause, and of its place.

    A free parameter costs the logarithm of the effective readings; those with a usual value and a spread cost what
    the readings have narrowed them down by, see `narrowed`, and no more than a free one. Else a cause whose size
    has a wide prior would lose to one whose size has none. A cause whose own parameter may as well be nothing is
    another one in disguise.
    """
    own = [i for i, c in enumerate(fit.parameters) if c.kind == "effect" and np.isfinite(c.sigma)]
    # what frees a nuisance has one parameter; what either is or is not has none
    free = sum(1 if release_key(e) else len(e.quantities()) for e in fit.hypothesis) - len(own)
    cost = free * float(np.log(samples)) + choice(fit.hypothesis, effects, costs)
    A = fitter.normal(fit)
    covariance = inverse(A, uncertain(fit.parameters))
    # the other costs take in what lies beyond bounds
    cost -= 2.0 * float(np.sum(_within_bounds(fit, np.diag(covariance), fitter.pressure(fit))))
    if costs.off_sheet:
        # by a density of heavy tails, as of shapes: what is far off is rare and not impossible
        freed = [i for i, c in enumerate(fit.parameters) if c.of_instrument and not np.isfinite(c.sigma)]
        cost += 2.0 * float(np.sum(np.log1p(fit.evaluation.z[freed] ** 2)))
    sigma = np.array([fit.parameters[i].sigma for i in own])
    weight = prior(fit.parameters, fit.evaluation.z)[1][own]
    cost += narrowed(covariance[np.ix_(own, own)], weight, sigma, float(np.log(samples)))
    for number, effect in enumerate(fit.hypothesis):
        indices = of_effect(fit.parameters, number)[: effect.extent]
        if indices and _is_nothing(effect, fit.evaluation.z[indices], size_covariance(A, fit, number)):
            cost += costs.disguised
        if len(indices) > 1 and indices[0] not in own:
            # of a vector the directions that the readings say less of cost less
            sizes = np.maximum(np.linalg.eigvalsh(covariance[np.ix_(indices, indices)]), 1e-300)
            cost -= float(np.sum(np.minimum(np.log(sizes[1:] / sizes[0]), np.log(samples))))
    return fit.objective + cost


def _within_bounds(fit: Fit, variance: Array, pressure: Array) -> Array:
    """Logarithm ``(n_z,)`` of the share of each coordinate's posterior within its bounds, over that of its prior.

    The posterior is normal with the ``variance`` (n_z,) about the fit; of one that presses against a bound only the
    tail within it is left. Where readings say nothing, or the variance is zero, bounds cost nothing.
    """
    low, high, mean, sigma = (
        np.array([getattr(c, name) for c in fit.parameters]) for name in ("low", "high", "mean", "sigma")
    )
    known = variance > 0.0
    std = np.sqrt(np.where(known, variance, 1.0))
    below, above = (np.clip((end - fit.evaluation.z) / std, -NOTHING_LEFT, NOTHING_LEFT) for end in (low, high))
    posterior = np.where(pressure > 0.0, log_beyond(pressure * std), log_share(below, above))
    # of heavy tails, as of shapes
    shape = np.isfinite(sigma) & (sigma > 0.0)
    scale = np.where(shape, sigma, 1.0)
    prior_share = (np.arctan((high - mean) / scale) - np.arctan((low - mean) / scale)) / np.pi
    return np.where(known, posterior - np.where(shape, np.log(prior_share), 0.0), 0.0)


def narrowed(covariance: Array, weight: Array, spread: Array, most: float = np.inf) -> float:
    """What it costs that readings have narrowed the shapes of laws down (Laplace's approximation of the evidence).

    The prior of each is Cauchy's, whose density at its middle is 1/(π s). So a direction in which the readings' own
    precision is p, in units of ``1/s²``, costs ``log(p π/2)`` where p is large. A direction that they do not see
    costs nothing, for its posterior is its prior: ``log(1 + p π/2)`` is both. None costs more than ``most``. The
    ``covariance`` (k, k) is of the shapes' coordinates, with their priors of ``weight`` (k,), see
    `vjm_updating.inference.fitting.prior`; ``spread`` (k,) is s.
    """
    scaled = covariance / np.outer(spread, spread)
    precision = np.linalg.pinv(scaled, hermitian=True) - np.diag((weight * spread) ** 2)
    # rounding, where nothing is seen
    seen = np.maximum(np.linalg.eigvalsh(precision), 0.0)
    return float(np.sum(np.minimum(np.log1p(0.5 * np.pi * seen), most)))


def choice(hypothesis: Hypothesis, effects: Sequence[Effect], costs: Costs = Costs()) -> float:
    """What the choice of causes, and of their places, costs, whatever the readings say."""
    places = Counter(e.cause for e in effects)
    cost = 2.0 * sum(float(np.log(len(places) * places[e.cause])) for e in hypothesis)
    return cost + RARER * max(len(hypothesis) - 1, 0) + costs.third * max(len(hypothesis) - 2, 0)


def size_covariance(A: Array, fit: Fit, number: int) -> Array:
    """Covariance ``(k, k)`` of an effect's size, its shape as fitted: without a size a shape does nothing.

    ``A`` is the inverse covariance of all coordinates.
    """
    own = of_effect(fit.parameters, number)
    indices, shape = own[: fit.hypothesis[number].extent], own[fit.hypothesis[number].extent :]
    free = uncertain(fit.parameters)
    free[[i for i in shape if np.isfinite(fit.parameters[i].sigma)]] = False
    return inverse(A, free)[np.ix_(indices, indices)]


def _is_nothing(effect: Effect, z: Array, covariance: Array) -> bool:
    """Whether an effect's size, coordinates ``(k,)``, may as well be none, and would show if it were usual."""
    sizes = effect.quantities()[: effect.extent]
    # whether the usual size, where there is one, lies within what is not known of it
    hidden = sizes[0].log and NORMAL_95 * float(covariance[0, 0]) ** 0.5 > sizes[0].spread
    if hidden or any(q.neutral is None or (q.log and q.neutral <= 0.0) for q in sizes):
        return False
    off = z - np.array([q.coordinate(q.neutral or 0.0) for q in sizes])
    return float(off @ np.linalg.pinv(covariance, hermitian=True) @ off) < NORMAL_95**2


def effective_samples(noise: AutoregressiveNoise, present: np.ndarray) -> float:
    """Independent readings that autocorrelated ones are worth."""
    correlated = 2.0 * noise.neighbours / (1.0 - noise.rho)
    return float(np.sum(present.sum(axis=0) / (1.0 + correlated)))


# --- How much of mere noise the trials of one effect explain: projections onto cones, and their distribution ------
#
# An effect with one size and a shape that is not known, of which most can have one sign only, is a mixture of its
# trials with amounts that are not negative. What such a mixture explains at most of white noise is the squared
# length of the projection onto the trials' cone. It is distributed as a mixture of chi-squared distributions. They
# have as many degrees of freedom as trials share in the projection, weighted by how often they do (chi-bar-squared:
# Kudô, Biometrika 50, 1963, p. 403; Shapiro, International Statistical Review 56, 1988, p. 49). A narrow cone is
# hardly more than one direction, however many it spans.

DRAWS, SEED = numerical(4000), numerical(19630612)
"""Of noise, from which the weights of a cone follow."""
STEEP = numerical(1e6)
"""Condition of a face's products from which on it is one of fewer trials."""


@dataclass(frozen=True, eq=False)
class Cone:
    """The mixtures of trials.

    Attributes:
        edges: unit vectors ``(d, k)`` along the trials; none ``(d, 0)`` where all directions count.
        mirrored: whether the opposite of every mixture counts, too.
    """

    edges: Array
    mirrored: bool

    @staticmethod
    def of(trials: Array, *, one_sided: bool, vector: bool) -> Cone:
        """The cone of trials.

        The ``trials`` (d, k) are in coordinates of the space that they span. Of a ``vector`` all directions make
        sense, of what is ``one_sided`` no trial's opposite.
        """
        edges = trials / np.linalg.norm(trials, axis=0)
        if vector:
            return Cone(edges[:, :0], mirrored=False)
        if not one_sided:
            edges = edges * np.where(edges[:, 0] @ edges < 0.0, -1.0, 1.0)
        return Cone(edges, mirrored=not one_sided)

    @property
    def dimension(self) -> int:
        """Of the space that the trials span."""
        return len(self.edges)

    def explained(self, z: Array) -> Array:
        """Squares ``(n,)`` that the best mixtures take away from residuals ``(d, n)``."""
        if not self.edges.shape[1]:
            return np.sum(z**2, axis=0)
        result = self._projected(z)[0]
        return np.maximum(result, self._projected(-z)[0]) if self.mirrored else result

    def p_value(self, squares: Array) -> Array:
        """p-value of squares explained, where the residual is white noise of unit variance."""
        whole: Array = chi2_sf(squares, self.dimension)
        if not self.edges.shape[1]:
            return whole
        ways = 2.0 if self.mirrored else 1.0
        parts = [w * chi2_sf(squares, j) for j, w in enumerate(self._weights) if j]
        return np.where(np.asarray(squares) > 0.0, np.minimum(ways * sum(parts), whole), 1.0)

    @cached_property
    def _weights(self) -> Array:
        """How often so many trials ``(d + 1,)`` share in a projection of noise."""
        if self.edges.shape[1] == 1:
            return np.array([0.5, 0.5])
        noise = np.random.default_rng(SEED).standard_normal((self.dimension, DRAWS))
        return np.bincount(self._projected(noise)[1], minlength=self.dimension + 1) / DRAWS

    @cached_property
    def _faces(self) -> list[tuple[Array, Array]]:
        """Edges ``(d, m)`` of every face, and the inverse ``(m, m)`` of their products."""
        d, k = self.edges.shape
        result = []
        for m in range(1, min(d, k) + 1):
            for own in combinations(range(k), m):
                face = self.edges[:, list(own)]
                products = face.T @ face
                if np.linalg.cond(products) < STEEP:
                    result.append((face, np.asarray(np.linalg.inv(products), dtype=float)))
        return result

    def _projected(self, z: Array) -> tuple[Array, np.ndarray]:
        """Squared length ``(n,)`` of projections onto the cone, and how many trials share in each."""
        best, active = np.zeros(z.shape[1]), np.zeros(z.shape[1], dtype=int)
        for face, onto in self._faces:
            along = face.T @ z
            amounts = onto @ along
            squares = np.sum(amounts * along, axis=0)
            # onto the cone: the longest projection onto one of its faces that needs no negative amount
            longer = (squares > best) & (amounts >= 0.0).all(axis=0)
            best[longer], active[longer] = squares[longer], face.shape[1]
        return best, active


# --- Hypotheses of a search: one that is worth a fit, and one that was tried with what it is worth ----------------


@dataclass(frozen=True, eq=False)
class ScoredModel:
    """A hypothesis with its fit and its worth.

    Attributes:
        criterion: what the data say against it, and what its parameters cost; the smaller the better.
        cost: of its parameters and its choice, whatever the data say.
    """

    fit: Fit
    criterion: float
    cost: float = 0.0

    def coarsened(self, power: float) -> ScoredModel:
        """The same with its likelihood to a power, see `vjm_updating.diagnosis.verdict.coarsening`."""
        return replace(self, criterion=self.cost + power * (self.criterion - self.cost))

    @property
    def labels(self) -> frozenset[str]:
        """Its effects."""
        return frozenset(effect.label for effect in self.fit.hypothesis)

    @property
    def causes(self) -> frozenset[str]:
        """Its causes."""
        return frozenset(effect.cause for effect in self.fit.hypothesis)


@dataclass(frozen=True)
class SearchMove:
    """A hypothesis that is worth a fit.

    Attributes:
        base: fit of other causes, to begin at.
        starts: values of each effect, one list for each start.
        predicted_criterion: its criterion to first order, with the least that it can cost.
        criterion_error: by how much that may be off.
        always_fit: whether it is to be fitted whatever the first order says.
    """

    hypothesis: Hypothesis
    base: Fit
    starts: Sequence[Sequence[Sequence[float]]]
    predicted_criterion: float
    criterion_error: float
    always_fit: bool = False

    @property
    def labels(self) -> frozenset[str]:
        """Its effects."""
        return frozenset(effect.label for effect in self.hypothesis)


ESTIMATE_DRAWS = numerical(512)
"""Of the coordinates, from which an interval follows."""
THINNED = numerical(15)
"""Of the draws from a truncated distribution, each how many-th is taken: about as many."""
NOTHING_LEFT = numerical(30.0)
"""Standard deviations beyond which nothing of a normal distribution is left."""
PARTS = numerical(8)
"""Of an interval, over which draws are counted for a density."""
LIMITS: Mapping[tuple[bool, bool], str] = {
    (True, True): "both", (False, True): "upper", (True, False): "lower", (False, False): "none",
}  # fmt: skip
"""Of a `ValueRow`, by whether readings tell the lower and the upper end."""
STEEPER, NEARER = numerical(4.0), numerical(8)
"""Times what is expected of it, by which the objective rises where its curvature says nothing of an error; and how
often it is asked nearer then."""
DIRECTION = "direction_rad"
"""Last word of parameters that are angles all round."""


def estimates(fitter: LeastSquaresProblem, fit: Fit, by_laws: Array | None = None) -> dict[str, ValueRow]:
    """The parameters of a fit under docs/measured-data.md's names.

    Errors are taken as normal in the fit's own coordinates, where they nearly are; the intervals are of what is
    reported, which may be no straight function of them: a vector's size grows by errors in whatever direction.
    ``by_laws`` (n_z, n_z) is what laws that are not quite right add to the coordinates' covariance, see
    `vjm_updating.diagnosis.discrepancy.law_covariance`.
    """
    known = _inverse(fitter, fit)
    covariance = known * _inflation(fitter, fit) + (0.0 if by_laws is None else by_laws)
    push = _beyond_bounds(fitter, fit)
    result: dict[str, ValueRow] = {}
    for i, effect in enumerate(fit.hypothesis):
        key = release_key(effect)
        values = _reported(fit, fit.evaluation.z, i)
        own = (
            of_effect(fit.parameters, i)
            if key is None
            else [k for k, c in enumerate(fit.parameters) if (c.kind, c.subject) == key]
        )
        if not own:
            continue
        z = fit.evaluation.z[own]
        slopes = {name: np.zeros(len(own)) for name in values}
        for k in range(len(own)):
            h = 1e-5 * max(1.0, abs(float(z[k])))
            for name, value in _with(fit, own, z + h * np.eye(len(own))[k], i).items():
                slopes[name][k] = (value - values[name]) / h
        block = covariance[np.ix_(own, own)]
        if effect.extent > 1:
            shrunk = _supported(fitter, fit, own, np.sqrt(np.diag(block)))
            block = block * np.outer(shrunk, shrunk)
        low, high = (np.array([getattr(fit.parameters[k], end) for k in own]) for end in ("low", "high"))
        bounded, errors = _errors(block, low - z, high - z, push[own])
        drawn = [_with(fit, own, z + d, i) for d in errors]
        for name, value in values.items():
            std = max(float(slopes[name] @ block @ slopes[name]), 0.0) ** 0.5
            off = np.array([draw[name] for draw in drawn]) - value
            if name.endswith(DIRECTION):
                off = np.angle(np.exp(1j * off))
                if std > ALL_ROUND:
                    # more than of an angle of which nothing is known: all are as likely
                    std, off = ALL_ROUND, np.linspace(-np.pi, np.pi, len(off))
            if bounded and effect.extent == 1:
                ends = [_with(fit, own, end, i)[name] - value for end in (low, high) if np.isfinite(end).all()]
                least, most = credible(off, ends)
                least, most = min(least, 0.0), max(most, 0.0)
            else:
                least, most = (float(v) for v in np.quantile(off, [0.025, 0.975]))
                # a size that errors in whatever direction make larger is smaller by what lies along it
                least = least if least < 0.0 else -NORMAL_95 * std
                most = most if most > 0.0 else NORMAL_95 * std
                if effect.extent > 1 and not name.endswith(DIRECTION):
                    # a vector's size
                    least = max(least, -value)
            result[name] = ValueRow(value=value, std=std, interval95=[value + least, value + most])
        for k in own[effect.extent :] if key is None else ():
            alone = [name for name, slope in slopes.items() if slope[own.index(k)] and np.count_nonzero(slope) == 1]
            if alone:
                inflation = float(covariance[k, k] / max(known[k, k], 1e-300))
                profile = profile_interval(fitter, fit, k, covariance, inflation)
                reported = [
                    (_with(fit, [k], np.array([end]), i), by_readings)
                    for end, by_readings in zip((profile.low, profile.high), profile.by_readings, strict=True)
                ]
                for name in alone:
                    (least, by_low), (most, by_high) = sorted(
                        (one[name], by_readings) for one, by_readings in reported
                    )
                    interval = {"interval95": [least, most], "limits": LIMITS[by_low, by_high]}
                    result[name] = result[name].model_copy(update=interval)
    return result


def _supported(fitter: LeastSquaresProblem, fit: Fit, own: Sequence[int], std: Array) -> Array:
    """Share ``(k,)`` of a vector's standard deviations ``(k,)`` by the curvature that the objective supports.

    At such a distance it rises by one, times the inflation of the noise. Where it rises much more to both sides,
    and where the vector turns by as much, readings go with a higher power of the component. A bow out of
    the plane in which a bar buckles changes them by its square, and to first order by nothing. Where the objective
    rises however near, it is not smooth, and the curvature is all that is known.
    """
    z, inflation = fit.evaluation.z[list(own)], _inflation(fitter, fit)
    length, turned = float(np.hypot(*z)), Rise(fitter, fit, own)
    shares = np.ones(len(own))
    for k, index in enumerate(own):
        straight, share = Rise(fitter, fit, [index]), 1.0
        for _ in range(NEARER):
            off = share * std[k]
            least = min(straight(z[[k]] - off), straight(z[[k]] + off))
            for angle in (-min(off / length, 0.5 * np.pi), min(off / length, 0.5 * np.pi)) if length else ():
                c, s = np.cos(angle), np.sin(angle)
                least = min(least, turned(np.array([c * z[0] - s * z[1], s * z[0] + c * z[1]])))
            if least <= STEEPER * inflation:
                shares[k] = share
                break
            share *= 0.5 if np.isinf(least) else (inflation / least) ** 0.25
    return shares


def credible(draws: Array, bounds: Sequence[float]) -> tuple[float, float]:
    """An interval that holds 95 % of draws ``(n,)`` of a size that bounds cut off.

    It begins at a bound where the density is at least that at the 95 % quantile, as the shortest interval does.
    Quantiles at both ends would leave the bound out always, and so find a size where there may be none.

    Example:
        >>> credible(np.linspace(0.01, 10.0, 1000) ** 2, [0.0])[0]
        0.0
    """
    reached = []
    for bound in bounds:
        far = float(np.quantile(draws, 0.95 if bound <= draws.min() else 0.05))
        width = abs(far - bound) / PARTS
        if np.sum(np.abs(draws - bound) < width) >= np.sum(np.abs(draws - far) < 0.5 * width):
            reached.append((bound, far))
    if not reached:
        least, most = (float(v) for v in np.quantile(draws, [0.025, 0.975]))
        return least, most
    # at two bounds there is nothing between them that is less likely
    ends = list(reached[0]) if len(reached) == 1 else [bound for bound, _ in reached]
    return min(ends), max(ends)


def joined(values: Mapping[str, ValueRow], others: Sequence[Mapping[str, ValueRow]]) -> dict[str, ValueRow]:
    """Estimates whose intervals take in those of the same causes in other places, where these explain as much."""
    result = dict(values)
    for other in others:
        result |= {name: result[name].joined(other[name]) for name in result.keys() & other.keys()}
    return result


def _errors(covariance: Array, low: Array, high: Array, push: Array) -> tuple[bool, Array]:
    """Errors ``(n, k)`` of coordinates, and whether a bound is so near that it cuts them off.

    The ``covariance`` (k, k) is that without bounds. ``low`` and ``high`` (k,) count from where the coordinates
    are; without them these would go ``push`` (k,) further.
    """
    drawn = truncated_draws(push, covariance, low, high, np.zeros(len(push)))
    return (False, _normal(covariance)) if drawn is None else (True, drawn[::THINNED])


def _normal(covariance: Array) -> Array:
    """Errors ``(DRAWS, k)`` of a covariance ``(k, k)``, always the same ones, spread evenly."""
    sizes, axes = np.linalg.eigh(covariance)
    even = latin_hypercube(ESTIMATE_DRAWS, len(covariance), 0)
    return ndtri(even) * np.sqrt(np.maximum(sizes, 0.0)) @ axes.T


def _with(fit: Fit, own: Sequence[int], z: Array, index: int) -> dict[str, float]:
    """What is reported with some coordinates ``own`` at ``z`` instead."""
    point = fit.evaluation.z.copy()
    point[list(own)] = z
    return _reported(fit, point, index)


def _reported(fit: Fit, z: Array, index: int) -> dict[str, float]:
    effect = fit.hypothesis[index]
    values = values_of(fit.parameters, z, fit.hypothesis)[index]
    key = release_key(effect)
    if key is None:
        said = effect.reported(values)
        return {_named(fit, index, name.removeprefix(f"{effect.cause}.")): v for name, v in said.items()}
    name = {"modulus": "factor", "length": "delta_mm"}.get(key[0], effect.part)
    return {_named(fit, index, name): float(values[0])}


def _named(fit: Fit, index: int, name: str) -> str:
    """Name of an effect's parameter: with the part, where one cause sits in several parts."""
    effect = fit.hypothesis[index]
    again = sum(other.cause == effect.cause for other in fit.hypothesis) > 1
    inside = again and effect.part and not name.startswith(effect.part)
    return f"{effect.cause}.{effect.part}.{name}" if inside else f"{effect.cause}.{name}"


def _beyond_bounds(fitter: LeastSquaresProblem, fit: Fit) -> Array:
    """How far ``(n_z,)`` the coordinates would go if those that press against bounds had none."""
    pressure = fitter.pressure(fit)
    low = np.array([c.low for c in fit.parameters])
    return _inverse(fitter, fit) @ np.where(fit.evaluation.z <= low, -pressure, pressure)


def _inverse(fitter: LeastSquaresProblem, fit: Fit) -> Array:
    return inverse(fitter.normal(fit), uncertain(fit.parameters))


def covariance_of(fitter: LeastSquaresProblem, fit: Fit) -> Array:
    """Of a fit's z ``(n_z, n_z)``, widened where it leaves more than the noise."""
    return _inverse(fitter, fit) * _inflation(fitter, fit)


def _inflation(fitter: LeastSquaresProblem, fit: Fit) -> float:
    """Of the noise's variance, where a fit leaves more than that."""
    rows = int(fitter.whitening.present.sum())
    return max(1.0, fitter.squares(fit.parameters, fit.evaluation) / max(rows - fit.free, 1))


def nuisance_estimates(fitter: LeastSquaresProblem, fit: Fit) -> dict[str, ValueRow]:
    """The nuisances of a fit."""
    covariance = covariance_of(fitter, fit)
    result = {}
    for i, c in enumerate(fit.parameters):
        if c.kind == "effect" or c.sigma == 0.0:
            continue
        z = float(fit.evaluation.z[i])
        value, std = c.value(z), c.slope(z) * float(np.sqrt(covariance[i, i]))
        ends = [value - NORMAL_95 * std, value + NORMAL_95 * std]
        result[c.name] = ValueRow(value=value, std=std, interval95=ends)
    return result
