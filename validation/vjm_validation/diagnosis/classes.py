"""Which hypotheses a test cannot tell apart: each refitted to the other's noise-free readings.

All of them were fitted to the same readings and explain them about as well. So they lie near one another, and one
step of Gauss and Newton from a hypothesis' own optimum is its refit to another's readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from vjm.rotations import Array
from vjm_validation.diagnosis.fitting import Fit, Fitter, prior
from vjm_validation.diagnosis.unknowns import release_key

APART = 2.0
"""Strength within which two causes are one class."""


def distance(fitter: Fitter, truth: Fit, other: Fit) -> float:
    """Strength that remains when a hypothesis is refitted to another's noise-free readings.

    What the other would need of its effects' shapes beyond the usual counts.

    Args:
        fitter: of the test.
        truth: whose readings are taken, its nuisances at zero.
        other: that is refitted to them, nuisances and all.
    """
    freed = {release_key(effect) for effect in truth.hypothesis}
    _, weight = prior(other.found, other.at.z)
    off = other.at.z - np.array([c.mean for c in other.found])
    for i, c in enumerate(fitter.nuisances):
        if (c.kind, c.subject) not in freed:
            # what the truth's own nuisances do is no part of the question
            off[i] -= truth.at.z[i]
    apart = fitter.whitening.flat(other.at.residual - truth.at.residual)
    held = weight > 0.0
    free = np.array([c.sigma != 0.0 for c in other.found])
    r = np.concatenate([apart, (off * weight)[held]])
    columns = np.vstack([fitter.whitening.flat(other.jacobian), np.diag(weight)[held]])[:, free]
    size = np.linalg.norm(columns, axis=0)
    U, values, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    basis = U[:, values > 1e-10 * values[0]]
    return float(np.linalg.norm(r - basis @ (basis.T @ r)))


def likeliest_class(fitter: Fitter, fits: Sequence[Fit], weights: Array) -> list[int]:
    """Of hypotheses the likeliest set that are all one class with one another: indices, the likeliest first.

    Being one class is not transitive: of the sets of which any two are one class it is the one whose probabilities
    ``weights`` (k,) add up to most.
    """
    k = len(fits)
    alike = np.eye(k, dtype=bool)
    for i, j in combinations(range(k), 2):
        alike[i, j] = alike[j, i] = (
            distance(fitter, fits[i], fits[j]) <= APART and distance(fitter, fits[j], fits[i]) <= APART
        )
    best: list[int] = []
    most = -1.0

    def grow(chosen: list[int], rest: list[int]) -> None:
        nonlocal best, most
        total = float(weights[chosen].sum())
        if total > most:
            best, most = chosen, total
        for place, i in enumerate(rest):
            grow([*chosen, i], [j for j in rest[place + 1 :] if alike[i, j]])

    grow([], list(range(k)))
    return sorted(best, key=lambda i: -weights[i])
