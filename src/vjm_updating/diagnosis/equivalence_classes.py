"""Which hypotheses a test cannot distinguish: each refitted to the other's noise-free readings.

All of them were fitted to the same readings and explain them about as well. So they lie near one another, and one
step of Gauss and Newton from a hypothesis' own optimum is its refit to another's readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from vjm.rotations import Array
from vjm_updating.inference.fitting import Fit, Fitter, prior
from vjm_updating.inference.parameters import release_key
from vjm_updating.observation.distributions import normal_sf

APART, UNSURE, SURE = 2.3, 0.7, 0.95
"""Distance at which two causes are as likely one class as not, its standard deviation, and the chance that nothing
else sets them apart. One class ends at a strength of 2; distances found in noise, by laws that are not quite the
machine's, come out a little larger (development sets of docs/hidden-effects.md)."""


def distance(fitter: Fitter, truth: Fit, other: Fit) -> float:
    """Strength that remains when a hypothesis is refitted to another's noise-free readings.

    What the other would need of its effects' shapes beyond the usual counts.

    Args:
        fitter: of the test.
        truth: whose readings are taken, its nuisances at zero.
        other: that is refitted to them, nuisances and all.
    """
    freed = {release_key(effect) for effect in truth.hypothesis}
    pull, weight = prior(other.found, other.at.z)
    for i, c in enumerate(fitter.nuisances):
        if (c.kind, c.subject) not in freed:
            # what the truth's own nuisances do is no part of the question
            pull[i] -= weight[i] * truth.at.z[i]
    apart = fitter.whitening.flat(other.at.residual - truth.at.residual)
    held = weight > 0.0
    r = np.concatenate([apart, pull[held]])
    columns = np.vstack([fitter.whitening.flat(other.jacobian), np.diag(weight)[held]])
    size = np.linalg.norm(columns, axis=0)
    free = np.array([c.sigma != 0.0 for c in other.found]) & (size > 0.0)
    low, high = (np.array([getattr(c, end) for c in other.found]) for end in ("low", "high"))
    while True:
        step = np.zeros(len(free))
        step[free] = np.linalg.lstsq(columns[:, free] / size[free], -r, rcond=1e-10)[0] / size[free]
        # what is at a bound goes no further
        out = free & (((other.at.z <= low) & (step < 0.0)) | ((other.at.z >= high) & (step > 0.0)))
        if not out.any():
            return float(np.linalg.norm(r + columns @ step))
        free &= ~out


def best_verdict(fitter: Fitter, fits: Sequence[Fit], weights: Array) -> tuple[list[int], float]:
    """Of hypotheses the set that is most probably right, the likeliest member first, and how probably it is.

    A set is right if it holds the truth and none that is not one class with it. So each member counts with its
    probability ``weights`` (k,) times the chance that all others are one class with it. With one member alone
    nothing but its own probability counts.
    """
    k = len(fits)
    alike = np.ones((k, k))
    for i, j in combinations(range(k), 2):
        apart = max(distance(fitter, fits[i], fits[j]), distance(fitter, fits[j], fits[i]))
        alike[i, j] = alike[j, i] = SURE * float(normal_sf((apart - APART) / UNSURE))
    best: list[int] = []
    most = -1.0
    for size in range(1, k + 1):
        for chosen in combinations(range(k), size):
            own = list(chosen)
            worth = float(weights[own] @ np.prod(alike[np.ix_(own, own)], axis=1))
            if worth > most:
                best, most = own, worth
    return sorted(best, key=lambda i: -weights[i]), most
