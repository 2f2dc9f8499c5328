"""Which rows of a test were written mistakenly, and how: stretches of rows that fit the nominal machine so only.

How far a reading is from the nominal machine's is stated as a distance from 0 to 2: a machine of half the stiffness
is 0.67 away, one of a tenth 1.6. A way of being mistaken is believed of a stretch of rows that it brings near while
they are far off as they stand: no cause in a machine puts whole stretches there. Mistakes that fit one stiffness
alike differ along the curve, for the load at which a chain buckles does not change with the unit of displacements.
Where they do not, the noise of the columns decides. Hidden causes change a machine's own forces by a factor, which
rows that fit as they stand show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, tuned
from vjm_updating.experiment.comparison import CLEAR, Comparison
from vjm_updating.experiment.implausible_rows import roughness
from vjm_updating.experiment.mistaken_as import RIGHT, MistakenAs, ways

FAR = tuned(0.9)
"""Mean distance from which on a stretch is far off: a factor 2.6 of the forces, or the other sign."""
ASKEW = tuned(0.25)
"""Mean distance from which on a stretch is believed to be mistaken where it then fits closely, to `CLOSELY`."""
CLOSELY = tuned(0.1)
"""Mean distance up to which a stretch fits closely, as it is or by one factor: no cause in a machine is so nearly a
unit or an exchange."""
SHARE = tuned(0.35)
"""Of its distance as it stands that a stretch keeps, at most, in the way in which it is mistaken."""
LEAST_ROWS = numerical(2)
"""Of a stretch that say something; two have to fit closely, as outliers stand side by side, too."""
STRETCHES = numerical(4)
"""At most, of one posture."""
CLOSE = tuned(0.03)
"""Difference of mean distances that means nothing: what a sheet's own tolerances change."""
TIE = CLOSELY
"""Difference of mean distances below which two mistakes fit alike: if one fits exactly, the other fits closely."""
UNLOADED = tuned(2)
"""Rows at the ends of a stretch that need not belong to it in another way."""
LEAP = tuned(3.0)
"""Of the larger steps of a column, from which on one is a leap."""
STRANGE = tuned(3.0)
"""Logarithm of the quotient of two noises from which on they cannot be one instrument's."""
IDLE = tuned(0.02)
"""Distance that a row must gain to belong to a stretch: unloaded rows go with either side."""
FLOOR = tuned(5.0)
"""Times noise and zero, of what readings and predictions are large against where they say something."""


@dataclass(frozen=True)
class MistakenStretch:
    """Rows of one posture that are mistaken in one way.

    Attributes:
        label: of the posture.
        rows: which of all readings ``(n,)``, by the number of the way: unloaded ones at its ends may differ.
        fits: mean distance in each way that fits about as well as the best, by its number.
    """

    label: str
    rows: dict[int, np.ndarray]
    fits: dict[int, float]


@dataclass(frozen=True)
class Mistaken:
    """Rows that are mistaken in one way.

    Attributes:
        way: in which they are.
        others: that fit these rows about as well.
        rows: which of all readings ``(n,)``.
        labels: of the postures concerned.
    """

    way: MistakenAs
    others: tuple[MistakenAs, ...]
    rows: np.ndarray
    labels: tuple[str, ...]


class Distances:
    """Distances of readings from the nominal machine's curves.

    Attributes:
        c: readings beside the nominal machine.
        floor: N, or mm of a test by force, below which readings say nothing.
    """

    def __init__(self, c: Comparison) -> None:
        self.c = c
        there = [k for k, name in enumerate(c.columns) if name in c.readings.values]
        known = [(k, c.measurement.sheet.sigma(c.columns[k])) for k in there]
        # of forces, where there are any: moments may be read by another instrument
        known = [(k, one) for k, one in known if k in c.main] or known
        self.floor = FLOOR * max(((one.noise + one.zero) * c.unit[k] for k, one in known), default=0.0)

    def pair(self, way: MistakenAs, label: str) -> tuple[Array, Array]:
        """What was read of a posture, made right, and what is predicted ``(k, m)``, N or mm; nan where unknown."""
        at = self.c.at(label)
        c = self.c
        f = c.read[at][:, list(way.order(c.columns))] * way.scaled(c.columns) * c.unit
        g = c.curves.predicted(way.scaled(c.given), way.order(c.given), way.postures, label)[at] * c.unit
        return f, g

    def own(self, label: str, left: np.ndarray) -> float:
        """Forces of the machine over the nominal one's in a posture, by its rows that fit as they stand.

        Args:
            label: of the posture.
            left: which readings ``(n,)`` may be taken.

        Returns:
            nan where too few rows fit, or no one factor makes them fit.
        """
        apart, size = self.of(RIGHT, label, 1.0)
        f, g = self.pair(RIGHT, label)
        taken = left[self.c.at(label)] & (apart < FAR) & (size > self.floor)
        known = ~np.isnan(f) & ~np.isnan(g)
        f, g = np.where(known, f, 0.0)[taken], np.where(known, g, 0.0)[taken]
        ratio = np.sum(f * g, axis=1) / np.maximum(np.sum(g * g, axis=1), 1e-300)
        middle = float(np.median(ratio)) if len(ratio) >= LEAST_ROWS else float("nan")
        if not middle > 0.0 or float(np.mean(self.of(RIGHT, label, middle)[0][taken])) > CLOSELY:
            return float("nan")
        return middle

    def of(self, way: MistakenAs, label: str, own: float) -> tuple[Array, Array]:
        """Distances ``(k,)`` in a way, and the larger of the forces read and predicted ``(k,)``, N.

        Args:
            way: of being mistaken.
            label: of the posture.
            own: forces of the machine there over the nominal one's.
        """
        f, g = self.pair(way, label)
        known = ~np.isnan(f)
        lost = (np.isnan(g) & known).any(axis=1)
        f, g = np.where(known, f, 0.0), np.where(known & ~np.isnan(g), own * g, 0.0)
        a, b = np.linalg.norm(f, axis=1), np.linalg.norm(g, axis=1)
        apart = 2.0 * np.linalg.norm(f - g, axis=1) / np.maximum(a + b + self.floor, 1e-300)
        return np.where(lost, 2.0, apart), np.maximum(a, b)


def mistaken_rows(c: Comparison) -> list[Mistaken]:
    """All rows that are mistaken, by the way in which they are."""
    distances = Distances(c)
    doubted = []
    for label in c.labels:
        apart, size = distances.of(RIGHT, label, 1.0)
        if int(np.sum((apart > ASKEW) & (size > distances.floor))) >= LEAST_ROWS:
            doubted.append(label)
    if not doubted:
        return []
    known = ways_of(c)
    found = {label: _stretches(distances, known, label, 1.0) for label in doubted}
    all_of_them = [rows for several in found.values() for s in several for rows in s.rows.values()]
    left = ~np.any([np.zeros(len(c.readings), dtype=bool), *all_of_them], axis=0)
    own = {label: distances.own(label, left) for label in c.labels}
    usual = [ratio for ratio in own.values() if not np.isnan(ratio)]
    if usual:
        other = float(np.median(usual))
        found = {
            label: _stretches(distances, known, label, other if np.isnan(own[label]) else own[label])
            for label in doubted
        }
    return _by_way(c, [s for several in found.values() for s in several], known)


def ways_of(c: Comparison) -> list[MistakenAs]:
    """How readings may be mistaken; a test of one joint has no postures to exchange."""
    return ways(c.readings, () if c.of_joint else tuple(c.measurement.chain.postures), (c.given, c.columns))


def far_postures(c: Comparison, rest: np.ndarray) -> list[str]:
    """Postures of whose readings, among some ``(n,)``, most are far from the nominal machine as they stand."""
    distances, found = Distances(c), []
    for label in c.labels:
        apart, size = distances.of(RIGHT, label, 1.0)
        says = (size > distances.floor) & rest[c.at(label)]
        if says.sum() > LEAST_ROWS and float(np.mean(apart[says])) > FAR:
            found.append(label)
    return found


def _stretches(distances: Distances, known: Sequence[MistakenAs], label: str, own: float) -> list[MistakenStretch]:
    """The stretches of a posture that are mistaken, the clearest first."""
    right, size = distances.of(RIGHT, label, own)
    by_way = [distances.of(way, label, own) for way in known]
    seen = [other > distances.floor for _, other in by_way]
    says = [(size > distances.floor) | large for large in seen]
    at, free, found = distances.c.at(label), np.ones(len(right), dtype=bool), list[MistakenStretch]()
    for _ in range(STRETCHES):
        best: tuple[float, int, int, int] | None = None
        for number, (apart, _) in enumerate(by_way):
            gain, begin, end = richest(np.where(free, right - apart - IDLE, -10.0))
            fit = _fit(right, apart, says[number], seen[number], slice(begin, end), known[number])
            if gain > 0.0 and fit is not None and (best is None or gain > best[0] + 1e-9):
                best = gain, number, begin, end
        if best is None:
            break
        _, number, begin, end = best
        inside = np.zeros(len(at), dtype=bool)
        inside[begin:end] = True
        fits, rows = dict[int, float](), dict[int, np.ndarray]()
        for k, (apart, _) in enumerate(by_way):
            _, first, last = richest(np.where(inside, right - apart - IDLE, -10.0))
            fit = _fit(right, apart, says[k], seen[k], slice(first, last), known[k])
            if fit is None or last - first < end - begin - UNLOADED:
                continue
            # unloaded rows that nothing else follows or goes before go with the stretch
            first = first if says[k][:first].any() else 0
            last = last if says[k][last:].any() else len(at)
            fits[k], rows[k] = fit, _between(distances.c, label, at, first, last)
        fits = {k: fit for k, fit in fits.items() if fit <= min(fits.values()) + TIE}
        free[begin:end] = False
        found.append(MistakenStretch(label, rows, fits))
    return found


def richest(gain: Array) -> tuple[float, int, int]:
    """The contiguous stretch of the largest sum: the sum, its begin, and its end."""
    sums = np.concatenate([[0.0], np.cumsum(gain)])
    lowest = np.minimum.accumulate(sums)
    end = int(np.argmax(sums - lowest))
    return float(sums[end] - lowest[end]), int(np.argmin(sums[: end + 1])), end


def _fit(
    right: Array, apart: Array, says: np.ndarray, seen: np.ndarray, stretch: slice, way: MistakenAs
) -> float | None:
    """Mean distance of a stretch in a way, None where that is not believed.

    A way in which hardly a row is loaded is none: of it any reading is near.
    """
    here = np.flatnonzero(says[stretch]) + stretch.start
    if len(here) < LEAST_ROWS or 2 * int(seen[here].sum()) < len(here):
        return None
    before, after = float(np.mean(right[here])), float(np.mean(apart[here]))
    if after >= SHARE * before:
        return None
    # a machine that is softer in one posture may be like the nominal one in another
    if after < CLOSELY and way.cause:
        return after if before > ASKEW else None
    return after if before > FAR and len(here) > LEAST_ROWS else None


def _between(c: Comparison, label: str, at: np.ndarray, begin: int, end: int) -> np.ndarray:
    """Which readings ``(n,)`` of a posture lie in a stretch, those without a displacement included."""
    order = np.arange(len(c.readings))
    first = 0 if begin == 0 else at[begin]
    last = len(order) if end == len(at) else at[end]
    return (c.readings.posture == label) & (order >= first) & (order < last)


def _strange(c: Comparison, label: str, rows: np.ndarray, way: MistakenAs) -> float:
    """What the columns that a way changes say against it, by their noise and where the stretch begins and ends.

    Returns:
        0 where their noise becomes the sheet's and they go on steadily, at most `TIE` for each of both.
    """
    noises, breaks, readings = [0.0], [0.0], c.readings.only(rows)
    for name, factor in way.factors.items():
        known, rough = c.measurement.sheet.instrument.get(name), roughness(readings, name)
        noise = known.noise if known else 0.0
        if name in c.given:
            # a ramp's steps are no noise; but it has to be seen, and is as long as others
            span = float(np.nanmax(np.abs(readings.values[name]), initial=0.0)) * abs(factor)
            elsewhere = float(np.nanmax(np.abs(c.readings.values[name][~rows]), initial=0.0))
            unlike = abs(float(np.log(span / elsewhere))) / STRANGE if span > 0.0 and elsewhere > 0.0 else 0.0
            noises.append(1.0 if span < CLEAR * noise else min(unlike, 1.0))
        elif noise > 0.0 and rough > 0.0:
            noises.append(min(abs(float(np.log(rough * abs(factor) / noise))) / STRANGE, 1.0))
        breaks.append(_breaks(c, label, rows, name, factor))
    return TIE * (max(noises) + max(breaks, key=abs))


def _breaks(c: Comparison, label: str, rows: np.ndarray, name: str, factor: float) -> float:
    """1 where a factor makes a column leap at a stretch's begin or end, -1 where it takes a leap away."""
    mine = np.flatnonzero((c.readings.posture == label) & ~np.isnan(c.readings.values[name]))
    values, inside = c.readings.values[name][mine], rows[mine]
    edges = np.flatnonzero(inside[1:] != inside[:-1]) + 1
    edges = edges[c.readings.sequence[mine][edges] == c.readings.sequence[mine][edges - 1]]
    if not len(edges):
        return 0.0
    right = np.where(inside, factor * values, values)
    return float(_leaps(right, edges)) - float(_leaps(values, edges))


def _leaps(values: Array, edges: np.ndarray) -> bool:
    """Whether a column leaps at one of its steps, which its other steps do not."""
    steps = np.abs(np.diff(values))
    return bool(steps[edges - 1].max() > LEAP * float(np.percentile(steps, 90.0)))


def _by_way(c: Comparison, stretches: Sequence[MistakenStretch], known: Sequence[MistakenAs]) -> list[Mistaken]:
    """Stretches by the way in which most of them are mistaken, of such the one that fits them best."""
    found, left = list[Mistaken](), list[MistakenStretch]()
    for s in stretches:
        fits = {k: fit + _strange(c, s.label, s.rows[k], known[k]) for k, fit in s.fits.items()}
        left.append(replace(s, fits=fits))
    while left:
        counted = {k: [s.fits[k] for s in left if k in s.fits] for s in left for k in s.fits}
        k = min(counted, key=lambda k: (-len(counted[k]), sum(counted[k])))
        # of mistakes that are not distinguishable, the one that is named first
        alike = [j for j in counted if known[j].cause == known[k].cause and len(counted[j]) == len(counted[k])]
        k = min(j for j in alike if sum(counted[j]) <= sum(counted[k]) + CLOSE * len(counted[k]))
        # of mistakes that differ by what else they concern, the wider one
        wider = [j for j in counted if known[k].within(known[j]) and len(counted[j]) == len(counted[k])]
        k = min([j for j in wider if sum(counted[j]) < sum(counted[k]) + TIE * len(counted[k])], default=k)
        mine = [s for s in left if k in s.fits]
        others = [j for j in counted if j != k and all(s.fits.get(j, 2.0) <= s.fits[k] + TIE for s in mine)]
        labels = tuple(dict.fromkeys(s.label for s in mine))
        rows = np.any([s.rows[k] for s in mine], axis=0)
        found.append(Mistaken(known[k], tuple(known[j] for j in others), rows, labels))
        left = [s for s in left if k not in s.fits]
    return found
