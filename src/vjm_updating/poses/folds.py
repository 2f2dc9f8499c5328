"""Which postures are held out together: at random, and by region of joint space, which is extrapolation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical

RANDOM, REGIONS = numerical(5), numerical(5)
SEED = numerical(20260)
SAME = numerical(1e-9, "rad")
"""rad or mm: postures nearer than that are one posture repeated, and are held out together."""


@dataclass(frozen=True)
class Folds:
    """Numbers of the parts ``(g,)`` that postures belong to.

    Attributes:
        random: parts drawn at random.
        region: parts of joint space.
        posture: number of the posture, the same for repeated ones.
    """

    random: np.ndarray
    region: np.ndarray
    posture: np.ndarray

    @property
    def several(self) -> bool:
        """Whether there is another part to predict one from: not of one posture alone."""
        return bool(self.random.any())

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Both."""
        return self.random, self.region


def folds_of(q: Array) -> Folds:
    """Folds of postures with the coordinates ``(g, n)``."""
    _, posture = np.unique(np.round(q / SAME) * SAME, axis=0, return_inverse=True)
    posture = posture.reshape(-1)
    count = int(posture.max()) + 1
    parts = min(RANDOM, count)
    drawn = np.random.default_rng(SEED).permutation(count) % parts
    first = np.array([int(np.argmax(posture == k)) for k in range(count)])
    return Folds(drawn[posture], _regions(q[first], min(REGIONS, count))[posture], posture)


def _regions(q: Array, count: int) -> np.ndarray:
    """Clusters of joint space: k-means from starts that lie as far apart as can be; by halves where it fails."""
    scale = np.ptp(q, axis=0)
    x = q / np.where(scale > 0.0, scale, 1.0)
    centres = [x[int(np.argmin(((x - x.mean(axis=0)) ** 2).sum(axis=1)))]]
    while len(centres) < count:
        nearest = np.min([((x - c) ** 2).sum(axis=1) for c in centres], axis=0)
        centres.append(x[int(np.argmax(nearest))])
    c = np.array(centres)
    label = np.zeros(len(x), dtype=np.int64)
    for _ in range(50):
        distance = ((x[:, None] - c[None]) ** 2).sum(axis=2)
        new = np.argmin(distance, axis=1)
        if np.array_equal(new, label):
            break
        label = new
        c = np.array([x[label == i].mean(axis=0) if np.any(label == i) else c[i] for i in range(count)])
    return label
