"""Model discrepancy: laws that are right to some per cent only, and residuals with shapes that have no name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.screening import Projection, projection
from vjm_updating.inference.bounded_normal import inverse
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, prior, weighed
from vjm_updating.inference.model_error import (
    driven_place,
    integrated,
    likeliest,
    loading,
    mean_square,
    principal,
    smooth_shapes,
    sudden_shapes,
)
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.parameters import coordinates, of_effect, release_key, uncertain
from vjm_updating.inference.significance import NOISE_KNOWN, chi2_isf, chi2_sf

SEEN = numerical(1e-6)
"""Share of the largest deviation below which one is rounding."""


def responses(fitter: LeastSquaresProblem, fit: Fit, explained: float) -> Array:
    """What each cause of a fit whose law may be wrong does to the readings ``(n, 6, m)``, raw, beside the others.

    It is no larger than what the causes explain. Else a cause could grow, made up for by nuisances, and its law be
    wrong by more than that. A cause without which no machine stands is left out. The causes lower the objective by
    ``explained`` squares.
    """
    made = []
    for number, effect in enumerate(fit.hypothesis):
        if effect.exact:
            continue
        key = release_key(effect)
        own = set(of_effect(fit.parameters, number))
        others = tuple(other for k, other in enumerate(fit.hypothesis) if k != number)
        z = np.array([
            c.mean if (c.kind, c.subject) == key else value
            for i, (c, value) in enumerate(zip(fit.parameters, fit.evaluation.z, strict=True))
            if i not in own
        ])  # fmt: skip
        without = fitter.evaluate(coordinates(fitter.nuisances, others), z, others)
        if without is not None:
            change = without.residual - fit.evaluation.residual
            size = float(np.linalg.norm(fitter.whitening.flat(change)))
            made.append(change * min(1.0, explained**0.5 / max(size, 1e-300)))
    return np.stack(made, axis=-1) if made else np.zeros((*fit.evaluation.residual.shape, 0))


def _slopes(observed: Observed, made: Array) -> Array:
    """Derivatives ``(n, 6, m)`` of readings by the place on the ramp, in their order; 0 while held."""
    place, sequence = driven_place(observed), observed.readings.sequence
    result = np.zeros_like(made)
    for number in np.unique(sequence):
        own = np.flatnonzero(sequence == number)
        step = place[own[2:]] - place[own[:-2]]
        change = made[own[2:]] - made[own[:-2]]
        moves = np.abs(step) > 0.0
        result[own[1:-1][moves]] = change[moves] / step[moves, None, None]
    return result


def _columns(fitter: LeastSquaresProblem, made: Array, shapes: Array) -> Array:
    """What laws that are wrong by their own size do ``(N, k)``, whitened; in each posture as much as the causes.

    What each cause does is ``made`` (n, 6, m), raw; ``shapes`` (n, k) are smooth, orthonormal within a posture.
    """
    observed = fitter.forward.observed
    postures = observed.readings.posture
    number = shapes.shape[1] / len(set(postures.tolist()))
    samples = np.array([(postures == label).sum() for label in postures], dtype=float)
    # of unit mean square within a posture, all shapes of it together
    relative = shapes * np.sqrt(samples / number)[:, None]
    products = (made[:, :, :, None] * relative[:, None, None, :]).reshape(*made.shape[:2], -1)
    blocks = [fitter.whitening.flat(products)]
    # the argument of the law is off: the slope; it acts in another direction: each channel by itself
    apart = made[:, :, :, None] * np.eye(made.shape[1])[None, :, None, :]
    off = np.concatenate([_slopes(observed, made)[:, :, :, None], apart], axis=3)
    ways = np.column_stack([np.ones(len(postures)), np.sign(driven_place(observed)), loading(observed)])
    off = (off[:, :, :, :, None] * ways[:, None, None, None, :]).reshape(*made.shape[:2], -1)
    # no autocorrelation leads from one posture to another
    whitening = fitter.whitening
    off, plain = whitening.independent(off)[whitening.present], whitening.independent(made)[whitening.present]
    for label in dict.fromkeys(postures.tolist()):
        on = np.broadcast_to((postures == label)[:, None], whitening.present.shape)[whitening.present][:, None]
        columns = whitening.apart(np.where(on, off, 0.0))
        size = np.linalg.norm(columns, axis=0)
        seen = size > SEEN * size.max(initial=0.0)
        # each kind as large as what the cause does there
        own = np.linalg.norm(whitening.apart(np.where(on, plain, 0.0)), axis=0)
        kinds = np.repeat([1.0, *[made.shape[1]] * made.shape[1]], ways.shape[1])
        wanted = (own[:, None] / np.sqrt(ways.shape[1] * kinds)).ravel()
        blocks.append(columns[:, seen] * (wanted[seen] / size[seen]))
    return np.concatenate(blocks, axis=1)


def spectrum(fitter: LeastSquaresProblem, fit: Fit, space: Projection, explained: float) -> tuple[Array, Array]:
    """The discrepancy's principal directions in the space that the fit cannot absorb.

    Returns:
        Directions ``(N, k)``, and the standard deviation ``(k,)`` along each, in units of the noise, of laws that
        are wrong by their own size.
    """
    return _principal(space, law_columns(fitter, fit, explained))


def law_columns(fitter: LeastSquaresProblem, fit: Fit, explained: float) -> Array:
    """What laws of a fit that are wrong by their own size do to the readings ``(N, k)``, whitened."""
    made = responses(fitter, fit, explained)
    shapes, _ = smooth_shapes(fitter.forward.observed)
    if not made.shape[2] or not shapes.shape[1]:
        return np.zeros((int(fitter.whitening.present.sum()), 0))
    return _columns(fitter, made, shapes)


def _principal(space: Projection, columns: Array) -> tuple[Array, Array]:
    """Directions and sizes of a discrepancy, see `spectrum`."""
    if not columns.shape[1]:
        return np.zeros((len(space.residual), 0)), np.zeros(0)
    columns = space.rest(np.vstack([columns, np.zeros((len(space.residual) - space.rows, columns.shape[1]))]))
    turn, sizes = principal(columns.T @ columns)
    return columns @ turn / sizes, sizes


def law_covariance(fitter: LeastSquaresProblem, fit: Fit, law_error: float, explained: float) -> Array:
    """What laws that are not quite right add to the covariance of a fit's z ``(n_z, n_z)``.

    The fit follows what they do wrong as it follows noise. How wrong they are is known by what the fit leaves: the
    mean square of the relative error, given that and its prior of the scale ``law_error``.
    """
    nothing = np.zeros((len(fit.parameters), len(fit.parameters)))
    if law_error == 0.0:
        return nothing
    columns = law_columns(fitter, fit, explained)
    if not columns.shape[1]:
        return nothing
    space = projection(fitter, fit)
    directions, sizes = _principal(space, columns)
    follows = inverse(fitter.normal(fit), uncertain(fit.parameters)) @ fitter.whitening.flat(fit.jacobian).T
    wrong = mean_square(sizes, directions.T @ space.residual, law_error) ** 0.5 * follows @ columns
    return wrong @ wrong.T


@dataclass(frozen=True)
class Marginalised(Projection):
    """A space in which what a discrepancy may do counts for less.

    Attributes:
        directions: orthonormal ``(N, k)`` ones of the discrepancy.
        left: share ``(k,)`` of what lies along each that is left.
        noise: the residual ``(N,)`` without the likeliest discrepancy.
    """

    directions: Array
    left: Array
    noise: Array

    @classmethod
    def of(cls, space: Projection, directions: Array, sizes: Array, law_error: float) -> Marginalised:
        """A space with a Gaussian discrepancy.

        Laws wrong by their own size have ``sizes`` (k,) along ``directions`` (N, k), orthonormal ones: standard
        deviations over the noise's.
        """
        left, along = 1.0 / np.sqrt(1.0 + (law_error * sizes) ** 2), directions.T @ space.residual
        residual = space.residual - directions @ ((1.0 - left) * along)
        noise = space.residual - directions @ ((1.0 - left**2) * along)
        return cls(
            space.basis, residual, space.rows, space.released, directions, left, noise, law_error=law_error
        )  # fmt: skip

    def rest(self, columns: Array) -> Array:
        """Columns ``(N, k)`` without what the fit can absorb, in units of noise and discrepancy together."""
        free = super().rest(columns)
        return free - self.directions @ ((1.0 - self.left)[:, None] * (self.directions.T @ free))

    @property
    def off_sheet(self) -> Array:
        """How far nuisances lie from the sheet's ``(n_z,)``, over its tolerances, beside the discrepancy."""
        return self.noise[self.rows :]


def discrepancy(fitter: LeastSquaresProblem, fit: Fit, law_error: float, explained: float) -> float:
    """What the discrepancy adds to a fit's objective, its size and its shape integrated out; 0 without causes."""
    if not fit.hypothesis or law_error == 0.0:
        return 0.0
    own = replace(fitter, whitening=weighed(fitter.whitening, fitter.forward.observed, fit.evaluation))
    space = projection(own, fit)
    U, sizes = spectrum(own, fit, space, explained)
    return integrated(sizes, U.T @ space.residual, law_error)


def marginalised(fitter: LeastSquaresProblem, fit: Fit, law_error: float, explained: float) -> Projection:
    """The space that a fit cannot absorb, with the likeliest discrepancy of its laws among the noise."""
    space = projection(fitter, fit)
    if not fit.hypothesis or law_error == 0.0:
        return space
    U, sizes = spectrum(fitter, fit, space, explained)
    return Marginalised.of(space, U, sizes, likeliest(sizes, U.T @ space.residual, law_error))


DRAWS = numerical(4000)
SEED = numerical(17)
TAIL = numerical(0.02)
"""Share of the least p-values among draws that is their tail."""


@dataclass(frozen=True)
class Misfit:
    """The residual of a fit.

    Attributes:
        p: chance of such a residual where nothing is wrong.
        left: squares of the residual in the shapes, or of a channel, beyond what noise has there.
        worst: the shape that stands out most, in words; empty where none does, or the residual is rough.
        prior_p: chance of nuisances as far from the sheet's as they had to go, all together or one of them.
        farthest: the one that went farthest, in words; empty where the sheet allows none.
        law_error: relative error of the causes' laws that counts as noise.
    """

    p: float
    left: float
    worst: str
    prior_p: float = 1.0
    farthest: str = ""
    law_error: float = 0.0


@dataclass(frozen=True)
class Block:
    """One question of the residual: its name, and the whitened directions ``(n, k)`` that would show it."""

    name: str
    directions: Array


def misfit(fitter: LeastSquaresProblem, fit: Fit, law_error: float = 0.0, explained: float = 0.0) -> Misfit:
    """Test a fit's residual.

    A relative error ``law_error`` of laws whose causes lower the objective by ``explained`` squares is noise.
    """
    space = marginalised(fitter, fit, law_error, explained)
    smooth = _blocks(fitter, space, *smooth_shapes(fitter.forward.observed))
    blocks = blocks_of(fitter, space, smooth)
    if not blocks:
        return Misfit(1.0, 0.0, "", *_prior_p(fit, space), space.law_error)
    squares = np.array([float(np.sum((b.directions.T @ space.residual) ** 2)) for b in blocks])
    freedom = np.array([b.directions.shape[1] for b in blocks])
    p = np.asarray(chi2_sf(squares, freedom))
    worst = int(np.argmin(p))
    # the rank of the least p among its draws; far out in its tail it goes with the p itself
    least = least_p_values(blocks, max(float(p[worst]), 2.0 * TAIL))
    rank = float((np.count_nonzero(least <= p[worst]) + 1) / (DRAWS + 1))
    if rank <= 20.0 / DRAWS:
        rank = min(rank, float(p[worst] * TAIL / np.quantile(least, TAIL)))
    together, size = _together(smooth, space)
    large, beyond = _too_large(space, fitter.whitening.present)
    overall = min(large, float(chi2_sf(together, size)))
    total = min(1.0, 3.0 * min(rank, overall))
    left = max(together - size, float(squares[worst]) - int(freedom[worst]), beyond, 0.0)
    named = blocks[worst].name if total < 0.05 and rank <= large else ""
    return Misfit(total, left, named, *_prior_p(fit, space), space.law_error)


def blocks_of(fitter: LeastSquaresProblem, space: Projection, smooth: Sequence[Block] | None = None) -> list[Block]:
    """All shapes by kind and channel: smooth ones, made anew where none are given, and sudden ones."""
    observed = fitter.forward.observed
    first = _blocks(fitter, space, *smooth_shapes(observed)) if smooth is None else smooth
    return [*first, *_blocks(fitter, space, *sudden_shapes(observed))]


def _prior_p(fit: Fit, space: Projection) -> tuple[float, str]:
    """Chance of nuisances as far from the sheet's as a fit's, and the one that went farthest in words."""
    weight, off = prior(fit.parameters, fit.evaluation.z)[1], space.off_sheet
    sheet = [i for i, c in enumerate(fit.parameters) if c.kind != "effect" and weight[i] > 0.0]
    if not sheet:
        return 1.0, ""
    squares = off[sheet] ** 2
    farthest = sheet[int(np.argmax(squares))]
    together = float(chi2_sf(squares.sum(), len(sheet)))
    # one alone is lost among twenty that are right
    alone = len(sheet) * float(chi2_sf(squares.max(), 1))
    words = f"{fit.parameters[farthest].name} {abs(off[farthest]):.1f} sigma from the sheet's"
    return min(1.0, 2.0 * min(together, alone)), words


def least_p_values(blocks: Sequence[Block], level: float) -> Array:
    """The least p-value of blocks ``(DRAWS,)`` where nothing is wrong; one where it is larger than a level."""
    directions = np.column_stack([b.directions for b in blocks])
    # a rank among draws needs no more digits than these
    noise = np.random.default_rng(SEED).standard_normal((DRAWS, len(directions)), dtype=np.float32)
    draws = noise @ directions.astype(np.float32)
    edges = np.concatenate([[0], np.cumsum([b.directions.shape[1] for b in blocks])])
    result = np.ones(DRAWS)
    for a, b in pairwise(edges.tolist()):
        squares = np.sum(draws[:, a:b] ** 2, axis=1, dtype=float)
        # the chance is slow to compute, and of most draws not needed
        rare = squares >= chi2_isf(level, b - a)
        result[rare] = np.minimum(result[rare], chi2_sf(squares[rare], b - a))
    return result


def _together(blocks: Sequence[Block], space: Projection) -> tuple[float, int]:
    """Squares of the residual in the span of blocks, and its dimension."""
    if not blocks:
        return 0.0, 0
    U, values, _ = np.linalg.svd(np.column_stack([b.directions for b in blocks]), full_matrices=False)
    U = U[:, values > 1e-6 * values.max(initial=0.0)]
    return float(np.sum((U.T @ space.residual) ** 2)), U.shape[1]


def _blocks(fitter: LeastSquaresProblem, space: Projection, shapes: Array, names: Sequence[str]) -> list[Block]:
    """Shapes ``(n, k)`` of a kind as they show in each channel, by the kinds in their names."""
    observed = fitter.forward.observed
    kinds = list(dict.fromkeys(name.partition(": ")[2] for name in names))
    result = []
    for c, channel in enumerate(observed.columns):
        if not observed.present[:, c].any():
            continue
        for kind in kinds:
            own = [k for k, name in enumerate(names) if name.partition(": ")[2] == kind]
            raw = np.zeros((*observed.present.shape, len(own)))
            raw[:, c] = shapes[:, own]
            free = fitter.whitening.apart(fitter.whitening.autoregression.remove(raw)[fitter.whitening.present])
            columns = space.rest(np.vstack([free, np.zeros((len(space.residual) - space.rows, len(own)))]))
            size = np.linalg.norm(columns, axis=0)
            before = np.linalg.norm(free, axis=0)
            columns = columns[:, size > 0.05 * before]
            if columns.shape[1]:
                U, values, _ = np.linalg.svd(columns, full_matrices=False)
                result.append(Block(f"{channel}: {kind}", U[:, values > 0.05 * values.max(initial=0.0)]))
    return result


def _too_large(space: Projection, present: np.ndarray) -> tuple[float, float]:
    """Chance of a residual as large as it is, in all channels or one, beyond what an unsure sheet explains.

    One channel that oscillates, say, is lost among five that are right. By how much the squares are too large,
    where they are most, is the second number.
    """
    channel = np.nonzero(present)[1]
    squares = space.residual[: space.rows] ** 2
    # of each reading what is not spent on coordinates
    own = 1.0 - np.sum(space.basis[: space.rows] ** 2, axis=1)
    parts = [np.ones(space.rows, dtype=bool), *(channel == c for c in np.unique(channel))]
    sizes = [(float(squares[on].sum()), float(own[on].sum())) for on in parts]
    chance = min(float(chi2_sf(size / NOISE_KNOWN, freedom)) for size, freedom in sizes)
    return min(1.0, len(parts) * chance), max(size - NOISE_KNOWN * freedom for size, freedom in sizes)
