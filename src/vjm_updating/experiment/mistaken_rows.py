"""Which rows of a test were written mistakenly, and how: the most probable mistake of each row, or none.

A reading and the nominal machine's differ by the noise of the sheet and by what the model misses. The latter is a
factor, whose logarithm is small where the machine is as its sheet promises, else of standard deviation `MISSED`. It
changes slowly along a ramp, and rarely leaps. Under each way of being mistaken the readings have another
probability. A row is right or mistaken in one way, and rows beside each other are so alike: the most probable
sequence is Viterbi's (IEEE Trans. Inf. Theory 13 (1967) 260). Mistakes are rare, `MISTAKES`, and all are
as probable before the readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale, stated_level
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.experiment.comparison import CLEAR, MISSED, Comparison, correlation, machines
from vjm_updating.experiment.implausible_rows import roughness
from vjm_updating.experiment.mistaken_as import RIGHT, MistakenAs, ways
from vjm_updating.experiment.mistakes import SIGN, UNIT
from vjm_updating.experiment.readings import runs

MISTAKES = prior_scale(0.02)
"""Probability that a posture's readings are mistaken in some way."""
BESIDE = prior_scale(0.05)
"""Of a posture's largest load, that friction, backlash and cross-talk put into a reading beside the model."""
LEAPS = prior_scale(1e-3)
"""Probability that a machine's forces leap from one reading to the next, to anything."""
ALIKE = prior_scale(1.0)
"""Logarithm of the quotient of one column's noises or spans in two parts of a test."""
ODDS = stated_level(20.0)
"""Of the most probable mistake to one that is not named beside it."""
EVEN = stated_level(2.0)
"""Odds of two mistakes up to which they are about as probable: the one that is named first counts."""
LEAST_ROWS = numerical(2)
"""Of a stretch that say something: a single one is an outlier."""
MODEL = numerical(0.01)
"""What interpolation of the nominal machine's curves changes."""
WIDTH = numerical(20.0)
"""Logarithms of factors that a leap may have: of the largest number that is written over the smallest."""


Stretch = tuple[np.ndarray, dict[int, float]]
"""Rows ``(n,)`` of one posture that are mistaken in one way: which of all readings, and negative logarithms of the
probability of each way, by its number, that is not much less probable than the best."""


@dataclass(frozen=True)
class Mistaken:
    """Rows that are mistaken in one way.

    Attributes:
        way: in which they are.
        others: that are about as probable.
        rows: which of all readings ``(n,)``.
        factors: by column, what makes readings right.
    """

    way: MistakenAs
    others: tuple[MistakenAs, ...]
    rows: np.ndarray
    factors: dict[str, float]


def mistaken_rows(c: Comparison) -> list[Mistaken]:
    """All rows that are mistaken, by the way in which they are."""
    known = ways_of(c)
    # another posture's label concerns no other posture
    concerned = {
        label: [k for k, way in enumerate(known) if not way.postures or label in way.postures] for label in c.labels
    }
    doubted = [label for label in c.labels if Likelihood(c, label, []).doubted]
    return _by_way(c, [s for label in doubted for s in _stretches(c, label, known, concerned[label])], known)


def ways_of(c: Comparison) -> list[MistakenAs]:
    """How readings may be mistaken; a test of one joint has no postures to exchange."""

    def stands(label: str) -> bool:
        try:
            return bool(np.isfinite(c.slope(label)).all())
        except (NoConvergenceError, ValueError):
            return False

    others = () if c.of_joint else tuple(filter(stands, c.measurement.chain.postures))
    return ways(c.readings, others, (c.given, c.columns))


class Likelihood:
    """Negative logarithms of the probability of a posture's readings under each way; `RIGHT` is the first.

    Attributes:
        c: readings beside the nominal machine.
        label: of the posture.
        ways: w of them.
        at: its readings ``(k,)``.
        alone: of each row's factor ``(w, k)``.
        level: the same ``(w, k)`` beside the others: rows speak for a mistake together as one, against it each.
        largest: load of the posture, N, or mm of a test by force.
        apart: logarithms of factors ``(w, k, m)``; nan where the machine does not go.
        noise, beside: their variance ``(w, k, m)`` from noise, and from what is beside the model.
        loud: whether what a way makes of a row is above the noise, and so is what it changes ``(w, k)``.
        count: of rows that do.
        rare: of each mistake before the readings.
    """

    def __init__(self, c: Comparison, label: str, known: Sequence[MistakenAs]) -> None:
        self.c, self.label, self.ways, self.at = c, label, (RIGHT, *known), c.at(label)
        sheet = c.measurement.sheet
        noise = [np.hypot(c.noise(name), c.zero(name)) if name in sheet.instrument else 0.0 for name in c.columns]
        scale = max(sheet.errors(name).scale for name in (*c.given, *c.columns))
        self.promised = float(np.hypot(np.hypot(scale, sheet.tolerance.modulus_rel), MODEL))
        found = [self._apart(way, np.array(noise) * c.unit) for way in self.ways]
        self.apart, noises, beside, loud = (np.array(part) for part in zip(*found, strict=True))
        # what noise hides as it stands is not seen by another way of reading it
        self.noise, self.beside = np.maximum(noises, noises[0]), np.maximum(beside, beside[0])
        other = ~((self.apart - self.apart[0]) ** 2 <= self.noise)
        other[0] = True
        self.loud = (loud & other).any(axis=2)
        self.count = max(int(self.loud[0].sum()), 1)
        self.rare = float(np.log(max(len(known), 1) / MISTAKES))
        self.alone = self._cost(self.apart, self.noise, self.beside)
        self.level = self.alone / self.count + np.maximum(self.alone - self.alone[0], 0.0)

    @property
    def doubted(self) -> bool:
        """Whether there are rows that some way could make `ODDS` more probable: one in which they fit exactly."""
        best = self._cost(np.zeros_like(self.apart[0]), self.noise[0], self.beside[0])
        return bool(np.any(self.alone[0] - best > np.log(ODDS)))

    def _apart(self, way: MistakenAs, noise: Array) -> tuple[Array, Array, Array, np.ndarray]:
        """Logarithms of factors ``(k, m)``, their variances from noise and beside the model, and what is loud."""
        c = self.c
        f = way.put_right(c.read[self.at], c.columns) * c.unit
        g = c.predicted(way, self.label)[self.at] * c.unit
        read, lost = ~np.isnan(f), np.isnan(g)
        f, g = np.where(read, f, 0.0), np.where(read & ~lost, g, 0.0)
        if way is RIGHT:
            # one for all mistakes, which are compared by it
            self.largest = 0.5 * float(np.linalg.norm(np.abs(f) + np.abs(g), axis=1).max(initial=0.0))
        own = noise**2 + self._cancelled(way) + max(1e-9 * self.largest, 1e-100) ** 2
        friction = np.full(f.shape, (BESIDE * self.largest) ** 2)
        # a force's logarithm beyond its uncertainty, and the force itself within
        floor = np.sqrt(own + friction)
        apart, change = np.arcsinh(f / floor) - np.arcsinh(g / floor), (f - g) / floor
        near = np.abs(change) < 1e-6
        slope = np.where(near, 1.0 / (1.0 + (f / floor) ** 2), (apart / np.where(near, 1.0, change)) ** 2)
        largest = np.take_along_axis(g, np.argmax(np.abs(g), axis=1)[:, None], axis=1)
        apart = apart * np.where(np.where(np.abs(g) > floor, g, largest) < 0.0, -1.0, 1.0)
        return (
            np.where(read & lost, np.nan, np.where(read, apart, 0.0)),
            np.where(read, slope * own / floor**2, 1.0),
            np.where(read, slope * friction / floor**2, 0.0),
            read & (f**2 + g**2 > 2.0 * own),
        )

    def _cancelled(self, way: MistakenAs) -> Array:
        """Variance ``(k, m)`` of forces that are small differences of large ones, each as good as promised."""
        c = self.c
        given = way.put_right(c.imposed[self.at], c.given)
        slope = c.slope(way.postures.get(self.label, self.label)) * c.unit[:, None]
        excess = (np.abs(given) @ np.abs(slope.T)) ** 2 - (given @ slope.T) ** 2
        result: Array = self.promised**2 * np.maximum(excess, 0.0)
        return result

    def _cost(self, apart: Array, noise: Array, beside: Array, share: float = 1.0) -> Array:
        """Of logarithms of factors, summed over columns; the machine's part has a share of its variance."""
        density, seen = np.full(apart.shape, LEAPS / WIDTH), np.maximum(1.0 - noise - beside, 0.0)
        for machine in (seen * self.promised**2, seen * MISSED**2 + beside):
            variance = share * machine + noise
            normal = np.exp(-0.5 * np.nan_to_num(apart) ** 2 / variance) / np.sqrt(2.0 * np.pi * variance)
            density += np.where(np.isnan(apart), 0.0, 0.5 * (1.0 - LEAPS) * normal)
        result: Array = -np.log(density).sum(axis=-1)
        return result

    def step(self, k: int, before: int | slice, after: int | slice) -> Array:
        """Of the change from row ``k - 1`` to ``k`` of the posture, from one mistake to another."""
        change = self.apart[after, k] - self.apart[before, k - 1]
        noise = self.noise[after, k] + self.noise[before, k - 1]
        beside = np.maximum(self.beside[after, k], self.beside[before, k - 1])
        return self._cost(change, noise, beside, 2.0 / self.count)

    def of(self, way: int, begin: int, end: int, *, inside: bool = True) -> float:
        """Of a stretch of rows in a way between rows that are right; else of the changes at its ends alone."""
        steps = range(max(begin, 1), min(end + 1, len(self.at)))
        changes = [
            self.step(k, 0 if k == begin else way, 0 if k == end else way)
            for k in steps
            if inside or k in (begin, end)
        ]
        return float((self.level[way, begin:end].sum() if inside else 0.0) + sum(changes))


def _stretches(c: Comparison, label: str, known: Sequence[MistakenAs], which: list[int]) -> list[Stretch]:
    """The stretches of a posture that are mistaken in the most probable sequence of some, by their numbers."""
    likelihood = Likelihood(c, label, [known[k] for k in which])
    found, path = list[Stretch](), _sequence(likelihood)
    for begin, end in runs(path):
        if path[begin] == 0:
            continue
        rows = _between(likelihood, begin, end)
        unlike = np.array([_unlike(c, label, rows, way) for way in likelihood.ways])
        costs = unlike + [likelihood.of(w, begin, end) for w in range(len(unlike))]
        loud, alone = likelihood.loud[:, begin:end], likelihood.alone[:, begin:end]
        # that rows go on steadily is not enough: they say something, and their factors are more probable
        gained = ((alone[0] - alone) * loud).sum(axis=1) / np.maximum(loud.sum(axis=1), 1)
        says = (loud.sum(axis=1) >= LEAST_ROWS) & (2 * loud.sum(axis=1) >= loud[0].sum())
        whole = np.array([(begin, end) == (0, len(path)) or not way.postures for way in likelihood.ways])
        possible = says & whole & (gained > np.log(ODDS))
        # what is still as far from the model as no machine is was not mistaken in that way
        possible &= [
            bool(one) and machines(times(c, rows, way)) for one, way in zip(possible, likelihood.ways, strict=True)
        ]
        if not np.any(costs[possible] + likelihood.rare < costs[0]):
            continue
        # what changes from row to row within is of the machine, whatever the mistake
        ends = [likelihood.of(w, begin, end, inside=False) for w in range(len(unlike))]
        ranked = np.where(possible, unlike + ends - gained, np.inf)
        told = np.flatnonzero(ranked < ranked.min() + np.log(ODDS)).tolist()
        found.append((rows, {which[w - 1]: float(ranked[w]) for w in told}))
    return found


def times(c: Comparison, rows: np.ndarray, way: MistakenAs = RIGHT) -> float:
    """How many times what the model predicts was read, put right, in the large half of some rows; nan: not known.

    Args:
        c: readings beside the nominal machine.
        rows: which of all readings ``(n,)``.
        way: in which they may be mistaken; what it changes of what was read counts, the forces first.
    """
    concerned = [k for k, name in enumerate(c.columns) if name in (*way.factors, *way.exchanged)]
    own = [k for k in c.main if k in concerned] or concerned or c.main
    f, g = ((v * c.unit)[rows][:, own] for v in (way.put_right(c.read, c.columns), c.predicted(way)))
    known = ~np.isnan(f) & ~np.isnan(g)
    f, g = np.where(known, f, 0.0), np.where(known, g, 0.0)
    size = np.sum(g * g, axis=1)
    large = (size > 0.0) & (size >= np.median(size))
    return float(np.median(np.sum(f * g, axis=1)[large] / size[large])) if large.any() else np.nan


def _sequence(likelihood: Likelihood) -> np.ndarray:
    """The most probable way of each row ``(k,)``; from one to another it goes through right ones."""
    n, level, each = len(likelihood.at), likelihood.level, np.arange(len(likelihood.ways))
    # a label is written once for all rows
    change = np.where([bool(way.postures) for way in likelihood.ways], np.inf, np.log(max(n, 2)))
    every = slice(None)
    cost, came = level[:, 0] + np.where(each > 0, likelihood.rare, 0.0), np.zeros((n, len(each)), dtype=int)
    for k in range(1, n):
        stay = cost + likelihood.step(k, every, every)
        enter = cost[0] + likelihood.step(k, 0, every) + likelihood.rare + change
        leave = cost + likelihood.step(k, every, 0) + change
        leave[0], enter[0] = stay[0], np.inf
        came[k] = np.where(enter < stay, 0, each)
        came[k, 0] = np.argmin(leave)
        cost = level[:, k] + np.concatenate([[leave.min()], np.minimum(stay, enter)[1:]])
    path = np.zeros(n, dtype=int)
    path[-1] = int(np.argmin(cost))
    for k in range(n - 1, 0, -1):
        path[k - 1] = came[k, path[k]]
    return path


def _between(likelihood: Likelihood, begin: int, end: int) -> np.ndarray:
    """Which readings ``(n,)`` of a posture lie in a stretch, those without a displacement included."""
    c, at = likelihood.c, likelihood.at
    order = np.arange(len(c.readings))
    first = 0 if begin == 0 else at[begin]
    last = len(order) if end == len(at) else at[end]
    return (c.readings.posture == likelihood.label) & (order >= first) & (order < last)


def _unlike(c: Comparison, label: str, rows: np.ndarray, way: MistakenAs) -> float:
    """What a way makes less probable: noises and spans unlike those elsewhere, and leaps of what was imposed."""
    cost, inside = 0.0, c.readings.only(rows)
    for name in c.columns:
        if name in c.readings.values:
            rough = roughness(inside, name) * abs(way.factors.get(name, 1.0))
            cost += _quotient(rough, c.measurement.sheet.errors(name).noise)
    for name in (n for n in c.given if n in c.readings.values):
        factor, values = abs(way.factors.get(name, 1.0)), c.readings.values[name]
        span, elsewhere = (float(np.nanmax(np.abs(v), initial=0.0)) for v in (values[rows], values[~rows]))
        cost += _quotient(span * factor, elsewhere)
        cost += _leap(c, label, rows, values, way.factors.get(name, 1.0))
    return cost


def _quotient(a: float, b: float) -> float:
    return 0.5 * float(np.log(a / b) / ALIKE) ** 2 if a > 0.0 and b > 0.0 else 0.0


def _leap(c: Comparison, label: str, rows: np.ndarray, values: Array, factor: float) -> float:
    """Of the steps into and out of a stretch, by Cauchy's distribution of the width of usual steps."""
    mine = np.flatnonzero((c.readings.posture == label) & ~np.isnan(values))
    inside, same = rows[mine], np.diff(c.readings.sequence[mine]) == 0
    steps = np.abs(np.diff(np.where(inside, factor * values[mine], values[mine])))
    usual = float(np.median(steps[steps > 0.0])) if steps.any() else 0.0
    edges = steps[(inside[1:] != inside[:-1]) & same]
    return float(np.sum(np.log1p((edges / usual) ** 2))) if usual > 0.0 else 0.0


def _by_way(c: Comparison, stretches: Sequence[Stretch], known: Sequence[MistakenAs]) -> list[Mistaken]:
    """Stretches by the way in which most of them are mistaken, of such the most probable one."""
    found, left = list[Mistaken](), list(stretches)
    while left:
        counted = {k: [costs[k] for _, costs in left if k in costs] for _, costs in left for k in costs}
        most = max(len(costs) for costs in counted.values())
        cost = {k: sum(costs) for k, costs in counted.items() if len(costs) == most}
        # of mistakes that are about as probable, the one that is named first
        k = min(k for k in cost if cost[k] < min(cost.values()) + np.log(EVEN))
        mine = [(rows, costs) for rows, costs in left if k in costs]
        others = [j for j in counted if j != k and all(j in costs for _, costs in mine)]
        rows = np.any([rows for rows, _ in mine], axis=0)
        found.append(Mistaken(known[k], tuple(known[j] for j in sorted(others)), rows, _factors(c, known[k], rows)))
        left = [one for one in left if k not in one[1]]
    return found


def _factors(c: Comparison, way: MistakenAs, rows: np.ndarray) -> dict[str, float]:
    """What makes each mistaken column right: forces and moments are often, but not always, of one instrument."""
    if c.columns != WRENCH or way.cause not in (UNIT, SIGN) or not any(name in WRENCH[:3] for name in way.factors):
        return dict(way.factors)
    there, inside = [name for name in WRENCH if name in c.readings.values], c.readings.only(rows)
    main = max((name for name in there if name in WRENCH[:3]), key=inside.span, default=there[0])
    concerned = _turned if way.cause == SIGN else _converted
    factor = next(iter(way.factors.values()))
    return {name: factor for name in there if name == main or concerned(c, way, rows, name)}


def _turned(c: Comparison, way: MistakenAs, rows: np.ndarray, name: str) -> bool:
    """Whether a column goes against a clear prediction; where there is none it does as the way says."""
    predicted = c.predicted()[rows, WRENCH.index(name)]
    known = c.measurement.sheet.errors(name)
    size = float(np.sqrt(np.nanmean(predicted**2))) if not np.isnan(predicted).all() else 0.0
    if size > CLEAR * (known.noise + known.zero):
        return correlation(c.readings.values[name][rows], predicted) < 0.0
    return name in way.factors


def _converted(c: Comparison, way: MistakenAs, rows: np.ndarray, name: str) -> bool:
    """Whether a column is more nearly as rough as elsewhere once it is converted."""
    factor = next(iter(way.factors.values()))
    rough, usual = (roughness(c.readings.only(part), name) for part in (rows, ~rows))
    usual = usual or c.measurement.sheet.errors(name).noise
    if rough > 0.0 and usual > 0.0:
        return abs(float(np.log(rough * factor / usual))) < abs(float(np.log(rough / usual)))
    return name in way.factors
