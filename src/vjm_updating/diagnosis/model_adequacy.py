"""Whether a fit leaves anything: tests of the residual against shapes that have no name.

Blocks of shapes, by kind and channel, are tested as effects are; beside them the size of the whole residual.
The least p-value is judged by its own distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.discrepancy import marginalised
from vjm_updating.diagnosis.screening import Projection
from vjm_updating.inference.fitting import Fit, Fitter, prior
from vjm_updating.inference.residual_basis import smooth_shapes, sudden_shapes
from vjm_updating.observation.significance import NOISE_KNOWN, chi2_isf, chi2_sf

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


def misfit(fitter: Fitter, fit: Fit, law_error: float = 0.0, explained: float = 0.0) -> Misfit:
    """Test a fit's residual.

    Args:
        fitter: of the test.
        fit: whose residual is asked.
        law_error: relative error of the causes' laws: what it may do is noise.
        explained: by how much the causes lower the objective, squares.
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


def blocks_of(fitter: Fitter, space: Projection, smooth: Sequence[Block] | None = None) -> list[Block]:
    """All shapes by kind and channel: smooth ones, made anew where none are given, and sudden ones."""
    observed = fitter.forward.observed
    first = _blocks(fitter, space, *smooth_shapes(observed)) if smooth is None else smooth
    return [*first, *_blocks(fitter, space, *sudden_shapes(observed))]


def _prior_p(fit: Fit, space: Projection) -> tuple[float, str]:
    """Chance of nuisances as far from the sheet's as a fit's, and the one that went farthest in words."""
    weight, off = prior(fit.found, fit.at.z)[1], space.off_sheet
    sheet = [i for i, c in enumerate(fit.found) if c.kind != "effect" and weight[i] > 0.0]
    if not sheet:
        return 1.0, ""
    squares = off[sheet] ** 2
    farthest = sheet[int(np.argmax(squares))]
    together = float(chi2_sf(squares.sum(), len(sheet)))
    # one alone is lost among twenty that are right
    alone = len(sheet) * float(chi2_sf(squares.max(), 1))
    words = f"{fit.found[farthest].name} {abs(off[farthest]):.1f} sigma from the sheet's"
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


def _blocks(fitter: Fitter, space: Projection, shapes: Array, names: Sequence[str]) -> list[Block]:
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

    One channel that oscillates, say, is lost among five that are right.

    Returns:
        The chance, and by how much the squares are too large where they are most.
    """
    channel = np.nonzero(present)[1]
    squares = space.residual[: space.rows] ** 2
    # of each reading what is not spent on coordinates
    own = 1.0 - np.sum(space.basis[: space.rows] ** 2, axis=1)
    parts = [np.ones(space.rows, dtype=bool), *(channel == c for c in np.unique(channel))]
    sizes = [(float(squares[on].sum()), float(own[on].sum())) for on in parts]
    chance = min(float(chi2_sf(size / NOISE_KNOWN, freedom)) for size, freedom in sizes)
    return min(1.0, len(parts) * chance), max(size - NOISE_KNOWN * freedom for size, freedom in sizes)
