"""What is thought wrong of a robot, the fit of it, and its errors held out.

Postures are held out together at random, by region of joint space, which is extrapolation, and by level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.poses.fit import NormalEquations, PoseSolution, PostureNoise
from vjm_updating.poses.forward import Frames, Linearised

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
    """Folds of postures ``(g, n)``, rad and mm.

    ``coordinates`` (g,) by their names may be moved through a grid: joints, and places of the end.
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
    """Numbers of the levels ``(n,)`` of a coordinate ``(n,)`` of different postures; None where it lies in none.

    Levels lie further apart than any of them is wide, as readings of commanded values do. Each is met twice at
    least, so that a posture held out at random has a neighbour there, and none has more than half of the postures.
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


COUPLING = "coupling"
AT_RANDOM, BY_LEVEL, BY_SERIES = "held out at random", "held out by level", "held out by series"


@dataclass(frozen=True)
class Hypothesis:
    """What is thought wrong.

    Attributes:
        families: names, in the order in which they were added.
        as_deflected: coupled joints thought to pass on deflections where the model says not, or the reverse.
        kept: members of these families that keep the model's value all the same.
    """

    families: tuple[str, ...] = ()
    as_deflected: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Families, and the couplings among them."""
        return self.families + tuple(f"{COUPLING}.{joint}" for joint in self.as_deflected)

    def plus(self, name: str) -> Hypothesis:
        """With one more."""
        if name.startswith(f"{COUPLING}."):
            return replace(self, as_deflected=(*self.as_deflected, name.partition(".")[2]))
        return replace(self, families=(*self.families, name))

    def minus(self, name: str) -> Hypothesis:
        """Without one."""
        return Hypothesis(
            tuple(f for f in self.families if f != name),
            tuple(joint for joint in self.as_deflected if f"{COUPLING}.{joint}" != name),
            tuple(member for member in self.kept if not member.startswith(f"{name}.")),
        )


def mean_distance(distance: Array) -> float:
    """Mean of distances, nan where there is none."""
    known = distance[np.isfinite(distance)]
    return float(known.mean()) if len(known) else float("nan")


@dataclass(frozen=True)
class Errors:
    """Distances of markers from their predictions, mm; of tracked orientations the positions only.

    Of one posture alone nothing can be held out: there ``random`` and ``region`` are nan.

    Attributes:
        fitted: ``(g, k)`` of all readings fitted.
        random: ``(g, k)`` of postures held out at random.
        region: ``(g, k)`` of regions held out.
        levels: ``(g, k)`` of levels held out, the mean over the coordinates that have some; None: there are none.
        series: ``(g, k)`` of whole series held out, frames and zeros fitted there; None: there is one series.
    """

    fitted: Array
    random: Array
    region: Array
    levels: Array | None = None
    series: Array | None = None

    @property
    def between(self) -> Array:
        """Distances ``(g, k)`` within what was measured: of levels where there are some, else at random."""
        return self.random if self.levels is None else self.levels

    @property
    def way(self) -> str:
        """How the postures of `between` were held out, in words."""
        return AT_RANDOM if self.levels is None else BY_LEVEL

    def ways(self, ends: Array | None = None) -> dict[str, Array]:
        """Distances of postures held out, and of ends (g, k) where they are given, by the way, in words."""
        at_ends = {} if ends is None else {"at the ends of what was measured": ends}
        whole = {} if self.series is None else {BY_SERIES: self.series}
        return {self.way: self.between, "of regions held out": self.region, **at_ends, **whole}

    @property
    def means(self) -> tuple[float, float, float]:
        """Mean distances fitted, between, and of regions; nan of what was not held out."""
        return mean_distance(self.fitted), mean_distance(self.between), mean_distance(self.region)

    @property
    def held_out(self) -> bool:
        """Whether anything was."""
        return bool(np.isfinite(self.random).any())

    @property
    def judged(self) -> tuple[float, ...]:
        """Mean distances by which fits are judged: of what was held out, else of the fit."""
        whole = () if self.series is None else (mean_distance(self.series),)
        return (*self.means[1:], *whole) if self.held_out else self.means[:1]


@dataclass(frozen=True)
class FittedState:
    """A hypothesis with its fit.

    Attributes:
        hypothesis: what is thought wrong.
        z: ``(P,)`` members, in units.
        frames: nuisances.
        linearised: the model there.
        blocks: normal equations of all members there.
        solution: the linear fit there.
        noise: how readings of like postures are correlated.
        whitened: normal equations of the readings made independent, by which hypotheses are compared.
        errors: of the readings.
        sigma: ``(g, k, 6)`` standard deviations with the robust weights.
        weight: ``(g, k)`` robust weights.
    """

    hypothesis: Hypothesis
    z: Array
    frames: Frames
    linearised: Linearised
    blocks: NormalEquations
    solution: PoseSolution
    noise: PostureNoise
    whitened: NormalEquations
    errors: Errors
    sigma: Array
    weight: Array


@dataclass(frozen=True)
class Candidates:
    """Readings that could be taken.

    Attributes:
        q: ``(c, n)`` coordinates of the joints, mm and rad.
        load: ``(c, l, 6)`` wrenches at the points of load, N and N mm; of tests without such points l is 0.
    """

    q: Array
    load: Array

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True)
class Outlier:
    """A position that is not used: its row, marker, and how far it is off, mm."""

    row: int
    marker: str
    distance: float
