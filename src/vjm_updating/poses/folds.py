"""Which postures are held out together: at random, by region of joint space, which is extrapolation, and by level.

Where postures lie in a grid, each that is held out at random has neighbours with the same coordinates, and what the
model lacks is the same there. So whole levels of each such coordinate are held out, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical

RANDOM, REGIONS = numerical(5), numerical(5)
SEED = numerical(20260)
MOST = numerical(0.5)
"""Share of the postures above which an end, or a level, of a coordinate with a few values is none."""
SAME = numerical(1e-9, "rad")
"""rad or mm: postures nearer than that are one posture repeated, and are held out together."""


@dataclass(frozen=True)
class Folds:
    """Numbers of the parts ``(g,)`` that postures belong to.

    Attributes:
        random: parts drawn at random.
        region: parts of joint space.
        posture: number of the posture, the same for repeated ones.
        levels: by name of each coordinate that has a few values only, parts of whole levels; −1 where a group of
            several has no such levels.
        series: of several series, the number of each; else None.
    """

    random: np.ndarray
    region: np.ndarray
    posture: np.ndarray
    levels: Mapping[str, np.ndarray] = field(default_factory=dict)
    series: np.ndarray | None = None

    @property
    def several(self) -> bool:
        """Whether there is another part to predict one from: not of one posture alone."""
        return bool(self.random.any())

    @property
    def parts(self) -> tuple[np.ndarray, ...]:
        """At random, by region, by the levels of each coordinate that has some, and by series."""
        whole = () if self.series is None else (self.series,)
        return self.random, self.region, *self.levels.values(), *whole


def folds_of(q: Array, coordinates: Mapping[str, Array]) -> Folds:
    """Folds of postures.

    Args:
        q: ``(g, n)`` coordinates of the joints, rad and mm.
        coordinates: by name, ``(g,)`` each, what may be moved through a grid: joints, and places of the end.
    """
    _, posture = np.unique(np.round(q / SAME) * SAME, axis=0, return_inverse=True)
    posture = posture.reshape(-1)
    count = int(posture.max()) + 1
    parts = min(RANDOM, count)
    rng = np.random.default_rng(SEED)
    drawn = rng.permutation(count) % parts
    first = np.array([int(np.argmax(posture == k)) for k in range(count)])
    levels = {}
    for name, values in coordinates.items():
        level = levels_of(values[first])
        if level is not None:
            own = int(level.max()) + 1
            levels[name] = (rng.permutation(own) % min(RANDOM, own))[level][posture]
    return Folds(drawn[posture], _regions(q[first], min(REGIONS, count))[posture], posture, levels)


def levels_of(values: Array) -> np.ndarray | None:
    """Numbers of the levels ``(n,)`` of a coordinate; None where it lies in none.

    Levels lie further apart than any of them is wide, as readings of commanded values do. Each is met twice at
    least, so that a posture held out at random has a neighbour there, and none has more than half of the postures.

    Args:
        values: ``(n,)`` of different postures, in any unit.
    """
    order = np.argsort(values, kind="stable")
    gaps = np.diff(values[order])
    # the widest gap within levels, tried from the narrowest on
    for within in np.unique(gaps):
        level = np.concatenate([[0], np.cumsum(gaps > within)])
        sizes = np.bincount(level)
        if len(sizes) < 2 or sizes.max() > MOST * len(values):
            return None
        ends = np.cumsum(sizes) - 1
        widest = float((values[order][ends] - values[order][ends - sizes + 1]).max())
        if sizes.min() > 1 and widest < gaps[gaps > within].min():
            result = np.empty_like(level)
            result[order] = level
            return result
    return None


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
