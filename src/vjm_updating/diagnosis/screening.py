"""Which causes could explain what a fit leaves: score tests of every effect's signature, nuisances projected out.

A signature is the change of all readings that an effect makes at a small trial size. Together with the fit's own
slopes it is whitened, and what the fit could absorb is projected out. What remains of the trials of one effect
spans a few directions, and what their mixtures explain of mere noise has a known distribution (`cones`). The least
p-value over the catalogue has a distribution that follows from the signatures alone; it is drawn (a parametric
bootstrap of the maximum), which gives the threshold for a wanted rate of false alarms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, tuned
from vjm_updating.diagnosis.evidence import Cone
from vjm_updating.inference.fitting import Fit, HeldTables, LeastSquaresProblem, prior
from vjm_updating.inference.parameters import coordinates, exclusive, release_key, sizeless, start, uncertain
from vjm_updating.inference.significance import FALSE_ALARMS
from vjm_updating.mechanisms.effect import Effect

DRAWS, RARE = numerical(10000), numerical(3.0)
"""Of noise, for the threshold; and times that rate, by which a single effect's p-value is worth computing."""
SAME = numerical(0.08)
"""Singular value of an effect's trials over the largest, below which they differ in nothing that shows."""
SEED = numerical(20240229)
STRONG = numerical(4000.0)
"""Squares explained from which on what was found about the old fit is found anew about the new one."""
ORDINARY = numerical(3.0)
"""Sigmas of a machine's nuisance that change little of what effects do."""
NEAR_BY = numerical(1.0)
"""Sigmas of a nuisance by which a null may move and signatures about it are still those."""
ABSORBED = numerical(1e-6)
"""Share of a signature that is left by rounding where the fit absorbs all of it."""
FAR_OFF = tuned(2.0)
"""Median size of whitened residuals, 0.67 for a right model, beyond which a model is far off."""
APART = numerical(0.05)
"""Singular value of two effects' directions over the largest, below which they are the same direction."""
STARTS = numerical(2)
"""Trials from which an effect is fitted."""


@dataclass(frozen=True)
class Signature:
    """What an effect does to the readings at a trial size.

    Attributes:
        change: of the raw prediction ``(n, 6)``; None for a cause that frees a nuisance.
        one_sided: only its own sign makes sense.
    """

    effect: Effect
    values: tuple[float, ...]
    change: Array | None
    one_sided: bool


@dataclass(frozen=True, eq=False)
class SignatureSet:
    """Signatures about a null, of the samples ``(n, 6)`` that were present."""

    null: Fit
    present: np.ndarray
    branches: dict[tuple[int, int], int]
    signatures: list[Signature]

    def serves(self, fitter: LeastSquaresProblem, null: Fit) -> bool:
        """Whether another null of the same test lies so near that effects do the same about it."""
        own, moved = fitter.of_machine, np.abs(null.evaluation.z - self.null.evaluation.z).max(initial=0.0)
        ordinary = (
            max(np.abs(z[own]).max(initial=0.0) for z in (null.evaluation.z, self.null.evaluation.z)) < ORDINARY
        )
        seen = not (fitter.forward.observed.present & ~self.present).any()
        return bool(moved < NEAR_BY and ordinary and seen and self.branches == fitter.forward.branches)


@dataclass(frozen=True)
class Score:
    """How well an effect explains a residual.

    Attributes:
        explained: squares of the residual in the space of its trials, the most that it takes away to first order.
        mixture: those that the best mixture of its trials takes away.
        starts: parameters to begin fits from, the most promising first.
        directions: orthonormal ``(N, d)``, whitened and projected.
    """

    effect: Effect
    explained: float
    mixture: float
    starts: tuple[tuple[float, ...], ...]
    directions: Array
    cone: Cone

    @cached_property
    def p(self) -> float:
        """p-value of what mixtures of its trials take away."""
        return float(self.cone.p_value(np.array([self.mixture]))[0])


def signatures(fitter: LeastSquaresProblem, base: Fit, effects: Sequence[Effect]) -> list[Signature]:
    """The signatures of effects about a fit."""
    result = []
    own, held = fitter.of_machine, None
    if float(np.abs(base.evaluation.z[own]).max(initial=0.0)) < ORDINARY:
        # what the machine's own nuisances do beside the effect cancels: the nominal machine's tables serve all fits
        held = HeldTables(own, np.zeros(len(own)), fitter.machine_slopes(base))
    reference = fitter.evaluate(base.parameters, base.evaluation.z, base.hypothesis, held=held) or base.evaluation
    for effect in effects:
        if (key := release_key(effect)) is not None:
            # what the sheet gives no tolerance is freed of no prior: its own slope says what it does
            fixed = [i for i, c in enumerate(base.parameters) if (c.kind, c.subject) == key and c.sigma == 0.0]
            change = -base.jacobian[:, :, fixed[0]] if fixed else None
            result.append(Signature(effect, (1.0,), change, one_sided=False))
            continue
        hypothesis = (*base.hypothesis, effect)
        unknowns = coordinates(fitter.nuisances, hypothesis)
        quantities = effect.quantities()
        sided = not quantities or any(q.neutral is not None and q.low == q.neutral for q in quantities)
        m = len(fitter.nuisances)
        for trial in effect.trials():
            z = start(unknowns, hypothesis, base.evaluation.z[:m], [*base.values, trial])
            evaluation = fitter.evaluate(unknowns, z, hypothesis, held=held)
            if evaluation is not None:
                change = reference.residual - evaluation.residual
                result.append(Signature(effect, tuple(trial), change, one_sided=sided))
    return result


def signed(fitter: LeastSquaresProblem, null: Fit, effects: Sequence[Effect]) -> SignatureSet:
    """The signatures of effects about a null, kept for others near by."""
    candidates = signatures(fitter, null, effects)
    return SignatureSet(null, fitter.forward.observed.present, dict(fitter.forward.branches), candidates)


def far_off(fitter: LeastSquaresProblem, fit: Fit) -> bool:
    """Whether a fit is so far from the readings, a few outliers aside, that it says nothing of their noise."""
    return float(np.median(np.abs(fitter.whitening.flat(fit.evaluation.residual)))) > FAR_OFF


@dataclass(frozen=True)
class Projection:
    """The space that a fit cannot absorb.

    Attributes:
        basis: orthonormal ``(N, m)`` of what it can, whitened, priors below.
        residual: whitened ``(N,)``, priors below.
        rows: number of whitened samples; the rest are priors.
        released: row of each nuisance's prior by (kind, subject).
        law_error: relative error of the causes' laws that counts as noise.
    """

    basis: Array
    residual: Array
    rows: int
    released: dict[tuple[str, str], int]
    law_error: float = field(default=0.0, kw_only=True)

    @property
    def off_sheet(self) -> Array:
        """How far the nuisances lie from the sheet's ``(n_z,)``, over its tolerances."""
        return self.residual[self.rows :]

    def rest(self, columns: Array) -> Array:
        """Columns ``(N, k)`` without what the fit can absorb."""
        result = columns - self.basis @ (self.basis.T @ columns)
        return result - self.basis @ (self.basis.T @ result)


def projection(fitter: LeastSquaresProblem, base: Fit) -> Projection:
    """The space that a fit cannot absorb, and its residual there."""
    W = fitter.whitening.flat(base.jacobian)
    p, weight = prior(base.parameters, base.evaluation.z)
    A = np.vstack([W, np.diag(weight)])[:, uncertain(base.parameters)]
    r = np.concatenate([fitter.whitening.flat(base.evaluation.residual), p])
    size = np.linalg.norm(A, axis=0)
    U, values, _ = np.linalg.svd(A[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    basis = U[:, values > 1e-10 * values.max(initial=0.0)]
    rows = len(W)
    released = {(c.kind, c.subject): rows + i for i, c in enumerate(base.parameters) if c.kind != "effect"}
    rest = r - basis @ (basis.T @ r)
    return Projection(basis, rest, rows, released)


def whitened(fitter: LeastSquaresProblem, space: Projection, candidates: Sequence[Signature]) -> Array:
    """Signatures, whitened, priors below ``(N, k)``."""
    raw = np.zeros((len(space.residual), len(candidates)))
    changes = {i: signature.change for i, signature in enumerate(candidates) if signature.change is not None}
    if changes:
        raw[: space.rows, list(changes)] = fitter.whitening.flat(np.stack(list(changes.values()), axis=-1))
    for i, signature in enumerate(candidates):
        key = release_key(signature.effect)
        if key is not None and signature.change is None and key in space.released:
            raw[space.released[key], i] = 1.0
    return raw


def scores(fitter: LeastSquaresProblem, space: Projection, candidates: Sequence[Signature]) -> list[Score]:
    """Every effect's score, best first."""
    groups: dict[str, list[int]] = {}
    for i, signature in enumerate(candidates):
        groups.setdefault(signature.effect.label, []).append(i)
    raw = whitened(fitter, space, candidates)
    rest = space.rest(raw)
    before, after = np.linalg.norm(raw, axis=0), np.linalg.norm(rest, axis=0)
    # a release's row has length one before it is projected
    released = np.array([s.change is None for s in candidates], dtype=bool)
    visible = after > np.where(released, 1e-6, np.maximum(1e-3, ABSORBED * before))
    result = []
    for group in groups.values():
        own = [i for i in group if visible[i]]
        if not own:
            continue
        size = after[own]
        columns, kept = rest[:, own] / size, [candidates[i] for i in own]
        z = columns.T @ space.residual
        worth = np.where([s.one_sided for s in kept], np.maximum(z, 0.0), np.abs(z))
        order = np.argsort(-worth)[:STARTS]
        starts = tuple(_scaled(kept[i], float(z[i] / size[i])) for i in order)
        U, values, _ = np.linalg.svd(columns, full_matrices=False)
        U = U[:, values > SAME * values.max(initial=0.0)]
        effect = kept[0].effect
        cone = Cone.of(U.T @ columns, one_sided=all(s.one_sided for s in kept), vector=effect.extent > 1)
        left = U.T @ space.residual
        explained, mixture = float(left @ left), float(cone.explained(left[:, None])[0])
        if sizeless(effect):
            # all of it or nothing
            explained = mixture = float((2.0 * z * size - size**2).max())
        result.append(Score(effect, explained, mixture, starts, U, cone))
    return sorted(result, key=lambda score: -score.explained + 2.0 * score.cone.dimension)


def _scaled(signature: Signature, amplitude: float) -> tuple[float, ...]:
    """The trial as large as the residual asks for, to first order."""
    quantities = signature.effect.quantities()
    if not quantities or signature.change is None:
        return signature.values
    if signature.one_sided:
        amplitude = max(amplitude, 0.0)
    amplitude = float(np.sign(amplitude) * np.clip(abs(amplitude), 0.1, 20.0)) if amplitude else 0.1
    values = []
    for q, v in zip(quantities, signature.values, strict=True):
        grown = v if q.neutral is None or q.log else q.neutral + amplitude * (v - q.neutral)
        values.append(float(np.clip(grown, q.low, q.high)))
    return tuple(values)


def threshold(ranking: Sequence[Score]) -> float:
    """p-value that the least of all effects falls below with `FALSE_ALARMS` where nothing is wrong."""
    if not ranking:
        return FALSE_ALARMS
    directions = np.column_stack([score.directions for score in ranking])
    rng = np.random.default_rng(SEED)
    # the directions overlap: noise is drawn in the space that they span
    _, values, Vt = np.linalg.svd(directions, full_matrices=False)
    keep = values > 1e-8 * values[0]
    mix = values[keep, None] * Vt[keep]
    draws = rng.standard_normal((DRAWS, int(keep.sum()))) @ mix
    least = np.ones(DRAWS)
    column = 0
    for score in ranking:
        own = draws[:, column : column + score.cone.dimension].T
        squares = score.cone.explained(own)
        # what is not rare for one effect is no least of all
        rare = squares >= np.quantile(squares, 1.0 - RARE * FALSE_ALARMS)
        least[rare] = np.minimum(least[rare], score.cone.p_value(squares[rare]))
        column += score.cone.dimension
    return float(np.quantile(least, FALSE_ALARMS))


def best_pairs(space: Projection, ranking: Sequence[Score], count: int) -> list[tuple[Score, Score, float]]:
    """Pairs of effects that together explain most, to first order."""
    if not ranking:
        return []
    directions = np.column_stack([score.directions for score in ranking])
    products, z = directions.T @ directions, directions.T @ space.residual
    ends = np.cumsum([score.cone.dimension for score in ranking])
    own = [np.arange(end - score.cone.dimension, end) for score, end in zip(ranking, ends, strict=True)]
    result = []
    for (i, a), (j, b) in combinations(enumerate(ranking), 2):
        if a.effect.cause == b.effect.cause or exclusive(a.effect, b.effect):
            continue
        if sizeless(a.effect) or sizeless(b.effect):
            continue
        both = np.concatenate([own[i], own[j]])
        # singular values of both together, and what their span explains
        squares, mix = np.linalg.eigh(products[np.ix_(both, both)])
        keep = squares > APART**2 * squares[-1]
        total = float(np.sum((mix[:, keep].T @ z[both]) ** 2 / squares[keep]))
        result.append((a, b, total - 2.0 * int(keep.sum())))
    return sorted(result, key=lambda pair: -pair[2])[:count]
