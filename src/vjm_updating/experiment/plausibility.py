"""Mistakes in readings, sheets and models that are well-formed.

Other units, signs, exchanged columns and labels, repeated rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.errors import printed
from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale, stated_level
from vjm_updating.experiment.comparison import (
    CLEAR,
    DIFFERS,
    MISSED,
    ByDisplacements,
    ByLoads,
    Comparison,
    OfJoint,
    correlation,
    instead,
    machines,
    one_sided,
    ratio_of,
    thousandfold,
    units_between,
)
from vjm_updating.experiment.data_file import MOTION, POSE, WRENCH, split_point
from vjm_updating.experiment.implausible_readings import (
    MISTAKES,
    OF_IMPOSED,
    OF_WHOLE,
    ReadColumns,
    blanks,
    clock,
    column_findings,
    nothing_read,
    roughness,
    rounded,
    sheet_values,
    temperature,
)
from vjm_updating.experiment.measured import Measurement
from vjm_updating.experiment.mistakes import (
    LEAST_ROWS,
    ODDS,
    RIGHT,
    SIGN,
    UNIT,
    ColumnsMistaken,
    Mistake,
    MistakeFound,
    mistaken_stretches,
    rarity,
    ways,
)
from vjm_updating.experiment.readings import runs
from vjm_updating.inference.significance import NORMAL_95, level

# --- Which rows of a test were written mistakenly, and how: the most probable mistake of each row, or none --------
#
# A reading and the nominal machine's differ by the noise of the sheet and by what the model misses. The latter is a
# factor, whose logarithm is small where the machine is as its sheet promises, else of standard deviation `MISSED`.
# It changes slowly along a ramp, and rarely leaps. Under each way of being mistaken the readings have another
# probability. A row is right or mistaken in one way, and rows beside each other are so alike.

BESIDE = prior_scale(0.05)
"""Of a posture's largest load, that friction, backlash and cross-talk put into a reading beside the model."""
LEAPS = prior_scale(1e-3)
"""Probability that a machine's forces leap from one reading to the next, to anything."""
ALIKE = prior_scale(1.0)
"""Logarithm of the quotient of one column's noises or spans in two parts of a test."""
EVEN = stated_level(2.0)
"""Odds of two mistakes up to which they are about as probable: the one that is named first counts."""
MODEL = numerical(0.01)
"""What interpolation of the nominal machine's curves changes."""
WIDTH = numerical(20.0)
"""Logarithms of factors that a leap may have: of the largest number that is written over the smallest."""


Stretch = tuple[np.ndarray, dict[int, float]]
"""Rows ``(n,)`` of one posture that are mistaken in one way: which of all readings, and negative logarithms of the
probability of each way, by its number, that is not much less probable than the best."""


def mistaken_rows(c: Comparison) -> list[Mistake]:
    """All rows that are mistaken, by the way in which they are."""
    known = ways_of(c)
    # another posture's label concerns no other posture
    concerned = {
        label: [k for k, way in enumerate(known) if not way.postures or label in way.postures] for label in c.labels
    }
    doubted = [label for label in c.labels if Likelihood(c, label, []).doubted]
    return _by_way(c, [s for label in doubted for s in _stretches(c, label, known, concerned[label])], known)


def ways_of(c: Comparison) -> list[Mistake]:
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

    def __init__(self, c: Comparison, label: str, known: Sequence[Mistake]) -> None:
        self.c, self.label, self.ways, self.at = c, label, (RIGHT, *known), c.at(label)
        sheet = c.measurement.sheet
        noise = [np.hypot(c.noise(name), c.zero(name)) if name in sheet.instrument else 0.0 for name in c.columns]
        scale = max(sheet.errors(name).scale for name in (*c.given, *c.columns))
        self.promised = float(np.hypot(np.hypot(scale, sheet.tolerance.modulus_rel), MODEL))
        by_way = [self._apart(way, np.array(noise) * c.unit) for way in self.ways]
        self.apart, noises, beside, loud = (np.array(part) for part in zip(*by_way, strict=True))
        # what noise hides as it stands is not seen by another way of reading it
        self.noise, self.beside = np.maximum(noises, noises[0]), np.maximum(beside, beside[0])
        other = ~((self.apart - self.apart[0]) ** 2 <= self.noise)
        other[0] = True
        self.loud = (loud & other).any(axis=2)
        self.count = max(int(self.loud[0].sum()), 1)
        self.rare = rarity(len(known))
        self.alone = self._cost(self.apart, self.noise, self.beside)
        self.level = self.alone / self.count + np.maximum(self.alone - self.alone[0], 0.0)

    @property
    def doubted(self) -> bool:
        """Whether there are rows that some way could make `ODDS` more probable: one in which they fit exactly."""
        best = self._cost(np.zeros_like(self.apart[0]), self.noise[0], self.beside[0])
        return bool(np.any(self.alone[0] - best > np.log(ODDS)))

    def _apart(self, way: Mistake, noise: Array) -> tuple[Array, Array, Array, np.ndarray]:
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

    def _cancelled(self, way: Mistake) -> Array:
        """Variance ``(k, m)`` of forces that are small differences of large ones, each as good as promised."""
        c = self.c
        given = way.put_right(c.imposed[self.at], c.given)
        slope = c.slope(way.postures.get(self.label, self.label)) * c.unit[:, None]
        excess = (np.abs(given) @ np.abs(slope.T)) ** 2 - (given @ slope.T) ** 2
        return self.promised**2 * np.maximum(excess, 0.0)

    def _cost(self, apart: Array, noise: Array, beside: Array, share: float = 1.0) -> Array:
        """Of logarithms of factors, summed over columns; the machine's part has a share of its variance."""
        density, seen = np.full(apart.shape, LEAPS / WIDTH), np.maximum(1.0 - noise - beside, 0.0)
        for machine in (seen * self.promised**2, seen * MISSED**2 + beside):
            variance = share * machine + noise
            normal = np.exp(-0.5 * np.nan_to_num(apart) ** 2 / variance) / np.sqrt(2.0 * np.pi * variance)
            density += np.where(np.isnan(apart), 0.0, 0.5 * (1.0 - LEAPS) * normal)
        return -np.log(density).sum(axis=-1)

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


def _stretches(c: Comparison, label: str, known: Sequence[Mistake], which: list[int]) -> list[Stretch]:
    """The stretches of a posture that are mistaken in the most probable sequence of some, by their numbers."""
    likelihood = Likelihood(c, label, [known[k] for k in which])
    # a label is written once for all rows
    whole = np.array([bool(way.postures) for way in likelihood.ways])
    number = range(len(likelihood.ways))

    def judged(begin: int, end: int) -> tuple[np.ndarray, Array]:
        rows = _between(likelihood, begin, end)
        unlike = np.array([_unlike(c, label, rows, way) for way in likelihood.ways])
        costs = unlike + [likelihood.of(w, begin, end) for w in number]
        loud, alone = likelihood.loud[:, begin:end], likelihood.alone[:, begin:end]
        # that rows go on steadily is not enough: they say something, and their factors are more probable
        gained = ((alone[0] - alone) * loud).sum(axis=1) / np.maximum(loud.sum(axis=1), 1)
        says = (loud.sum(axis=1) >= LEAST_ROWS) & (costs + likelihood.rare < costs[0])
        possible = says & (~whole | ((begin, end) == (0, len(likelihood.at)))) & (gained > np.log(ODDS))
        # what is still as far from the model as no machine is was not mistaken in that way
        possible &= [
            bool(one) and machines(times(c, rows, way)) for one, way in zip(possible, likelihood.ways, strict=True)
        ]
        # what changes from row to row within is of the machine, whatever the mistake
        ends = [likelihood.of(w, begin, end, inside=False) for w in number] if possible.any() else 0.0
        return possible, unlike + ends - gained

    return [
        (_between(likelihood, begin, end), {which[w - 1]: cost for w, cost in costs.items()})
        for begin, end, costs in mistaken_stretches(likelihood.level, judged, whole, likelihood.step)
    ]


def times(c: Comparison, rows: np.ndarray, way: Mistake = RIGHT) -> float:
    """How many times what the model predicts was read, put right, in the large half of some rows; nan: not known.

    ``rows`` (n,) say which. Of a ``way`` of being mistaken counts what it changes of what was read, the forces
    first.
    """
    concerned = [k for k, name in enumerate(c.columns) if name in way.columns]
    own = [k for k in c.main if k in concerned] or concerned or c.main
    f, g = ((v * c.unit)[rows][:, own] for v in (way.put_right(c.read, c.columns), c.predicted(way)))
    known = ~np.isnan(f) & ~np.isnan(g)
    f, g = np.where(known, f, 0.0), np.where(known, g, 0.0)
    size = np.sum(g * g, axis=1)
    return ratio_of(np.sum(f * g, axis=1), size)[1] if size.any() else np.nan


def _between(likelihood: Likelihood, begin: int, end: int) -> np.ndarray:
    """Which readings ``(n,)`` of a posture lie in a stretch, those without a displacement included."""
    c, indices = likelihood.c, likelihood.at
    order = np.arange(len(c.readings))
    first = 0 if begin == 0 else indices[begin]
    last = len(order) if end == len(indices) else indices[end]
    return (c.readings.posture == likelihood.label) & (order >= first) & (order < last)


def _unlike(c: Comparison, label: str, rows: np.ndarray, way: Mistake) -> float:
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


def _by_way(c: Comparison, stretches: Sequence[Stretch], known: Sequence[Mistake]) -> list[Mistake]:
    """Stretches by the way in which most of them are mistaken, of such the most probable one."""
    mistakes, left = list[Mistake](), list(stretches)
    while left:
        counted = {k: [costs[k] for _, costs in left if k in costs] for _, costs in left for k in costs}
        most = max(len(costs) for costs in counted.values())
        cost = {k: sum(costs) for k, costs in counted.items() if len(costs) == most}
        # of mistakes that are about as probable, the one that is named first
        k = min(k for k in cost if cost[k] < min(cost.values()) + np.log(EVEN))
        mine = [(rows, costs) for rows, costs in left if k in costs]
        others = [j for j in counted if j != k and all(j in costs for _, costs in mine)]
        rows = np.any([rows for rows, _ in mine], axis=0)
        also = tuple(known[j].words for j in sorted(others))
        mistakes.append(replace(known[k], where=rows, factors=_factors(c, known[k], rows), others=also))
        left = [one for one in left if k not in one[1]]
    return mistakes


def _factors(c: Comparison, way: Mistake, rows: np.ndarray) -> dict[str, float]:
    """What makes each mistaken column right: forces and moments are often, but not always, of one instrument."""
    if c.columns != WRENCH or way.cause not in (UNIT, SIGN) or not any(name in WRENCH[:3] for name in way.factors):
        return dict(way.factors)
    present, inside = [name for name in WRENCH if name in c.readings.values], c.readings.only(rows)
    main = max((name for name in present if name in WRENCH[:3]), key=inside.span, default=present[0])
    concerned = _turned if way.cause == SIGN else _converted
    factor = next(iter(way.factors.values()))
    return {name: factor for name in present if name == main or concerned(c, way, rows, name)}


def _turned(c: Comparison, way: Mistake, rows: np.ndarray, name: str) -> bool:
    """Whether a column goes against a clear prediction; where there is none it does as the way says."""
    predicted = c.predicted()[rows, WRENCH.index(name)]
    known = c.measurement.sheet.errors(name)
    size = float(np.sqrt(np.nanmean(predicted**2))) if not np.isnan(predicted).all() else 0.0
    if size > CLEAR * (known.noise + known.zero):
        return correlation(c.readings.values[name][rows], predicted) < 0.0
    return name in way.factors


def _converted(c: Comparison, way: Mistake, rows: np.ndarray, name: str) -> bool:
    """Whether a column is more nearly as rough as elsewhere once it is converted."""
    factor = next(iter(way.factors.values()))
    rough, usual = (roughness(c.readings.only(part), name) for part in (rows, ~rows))
    usual = usual or c.measurement.sheet.errors(name).noise
    if rough > 0.0 and usual > 0.0:
        return abs(float(np.log(rough * factor / usual))) < abs(float(np.log(rough / usual)))
    return name in way.factors


REMEDIES = {UNIT: "Convert them", SIGN: "Turn it"}


def mistaken(c: Comparison) -> Iterator[Finding]:
    """Rows in another unit, with the other sign, or with columns or labels in each other's place."""
    if not c.comparable:
        return
    explained = mistaken_rows(c)
    strange = list(_strange(c, explained))
    yield from strange or (undecided(c) if not explained else ())
    for mistake in explained:
        words = ", or ".join(dict.fromkeys([mistake.words, *mistake.others]))
        where, what = f"{c.readings.file}: {_place(c, mistake.where)}", f"{_seen(c, mistake)}: {words}"
        if not mistake.cause:
            yield ColumnsMistaken(Grade.DOUBTFUL, where, f"{what}: are the labels swapped?")
            continue
        (name, *more), cause = mistake.factors or ("",), mistake.cause
        parameters = {f"{cause}.{name}": value for name, value in mistake.factors.items()}
        if mistake.where.sum() < len(c.readings):
            parameters[f"{cause}.row"] = float(c.readings.row[mistake.where][0])
        if cause == SIGN and name in c.columns and not more and np.isfinite(c.read).any(axis=0).sum() > 1:
            where = f"{c.readings.file}: column {name}, {_place(c, mistake.where)}"
            what = (
                "follows the model's prediction with the other sign, while other columns fit: is its axis turned, "
                "or that of the displacement"
            )
        yield MistakeFound(
            Grade.DOUBTFUL, where, f"{what}? {REMEDIES.get(cause, 'Put them right')}",
            replace(mistake, parameters=parameters),
        )  # fmt: skip


def undecided(c: Comparison) -> Iterator[Finding]:
    """A unit that all readings together fit, where none of them alone is large enough to say so.

    What was read is a multiple of what is predicted, beside zeros that the sheet allows. The multiple is beyond
    what a machine differs by, its distance from one is no accident, and in another unit it is one. These readings
    do not tell such a unit from such a machine.
    """
    as_is, spread = _multiple(c, RIGHT)
    if abs(np.log(max(as_is, 1e-300))) < DIFFERS or abs(as_is - 1.0) < level(1) * spread:
        return
    units = []
    for way in ways_of(c):
        multiple, own = _multiple(c, way) if way.cause == UNIT else (np.nan, np.nan)
        if abs(multiple - 1.0) < NORMAL_95 * own and machines(multiple):
            units.append(way.words)
    if units:
        words = ", or ".join(dict.fromkeys(units))
        yield Finding(
            Grade.DOUBTFUL,
            f"{c.readings.file}: every row",
            f"{c.words} are {as_is:.2g} ± {spread:.1g} of what the model predicts: {words}, or a machine that "
            "differs so much from its model? The readings are too few or too small to tell: load it more, or hang "
            "a known weight on it",
        )


def _multiple(c: Comparison, way: Mistake) -> tuple[float, float]:
    """What was read, put right, over what is predicted, by all readings together; its standard deviation.

    Zeros and scales of the channels and the modulus are as uncertain as the sheet says. Where a multiple does not
    describe the readings, its standard deviation grows by the residual.
    """
    f, g = way.put_right(c.read, c.columns), c.predicted(way)
    squares = products = left = 0.0
    count, scale = 0, 0.0
    for k, name in enumerate(c.columns):
        known = c.measurement.sheet.instrument.get(name)
        seen = ~np.isnan(f[:, k]) & ~np.isnan(g[:, k])
        if known is None or not known.noise > 0.0 or not seen.any():
            continue
        a, b = f[seen, k], g[seen, k]
        by = way.factors.get(name, 1.0)
        noise, zero = abs(by) * known.noise, abs(by) * known.zero
        if not noise**2 > 0.0:
            # below the last digit of any number: the sheet is doubted for it
            continue
        # a constant of standard deviation zero beside the noise, by the inverse of I + z z' (Sherman and Morrison)
        share = zero**2 / (noise**2 + len(a) * zero**2)
        squares += float(b @ b - share * b.sum() ** 2) / noise**2
        products += float(a @ b - share * a.sum() * b.sum()) / noise**2
        left += float(a @ a - share * a.sum() ** 2) / noise**2
        count, scale = count + len(a), max(scale, known.scale)
    if not squares > 0.0 or count < 2:
        return 1.0, np.inf
    multiple = products / squares
    misfit = max((left - multiple * products) / (count - 1), 1.0)
    same = np.hypot(scale, c.measurement.sheet.tolerance.modulus_rel)
    return multiple, float(np.hypot(np.sqrt(misfit / squares), multiple * same))


REACH = numerical(0.01)
"""End of the ramp over the longest part's length on which the force is sought that a chain cannot exceed."""


def compared(measurement: Measurement) -> Comparison:
    """Readings beside the nominal machine, as its kind of test has it."""
    if measurement.sheet.kind == "joint":
        return OfJoint(measurement)
    return ByLoads(measurement) if measurement.loaded else ByDisplacements(measurement)


def wrong_scale(c: Comparison) -> Iterator[Finding]:
    """What was read is off by a thousand, has the other sign, or is beside an angle in degrees."""
    if not c.comparable:
        yield from _beside_buckling(c)
        return
    for name, f, g in c.pairs(c.linear()):
        if max(np.abs(f).max(), np.abs(g).max()) <= (least := CLEAR * c.noise(name)):
            continue
        index = 0 if c.of_joint else (*POSE, *WRENCH).index(split_point(name)[1]) % 6
        driven = next((i for i in (index, *range(len(c.given))) if np.any(c.imposed[:, i])), 0)
        if c.measurement.imposed and driven != index and np.abs(g).max() <= least:
            continue  # what little the unloaded stiffness says of this channel is no measure
        ratio, given = ratio_of(f, g), c.given[driven]
        beside = f"what the model predicts for {given}"
        if thousandfold(ratio) and ratio[0] * ratio[2] > 0.0:
            units = units_between(ratio, name, given)
            asked = ", or ".join(instead(unit, of, of) for unit, of in units.items())
            words = f"is about {said(ratio[1])} {beside}, a factor 1000: is {asked}? Convert it"
        elif ratio[2] < 0.0 and ratio[1] < -np.exp(-DIFFERS) and driven == index and not c.measurement.loaded:
            words = (
                f"has the other sign than the model predicts for {given}. {name} is what the machine needs there, "
                f"positive with {given}; turn the sign of one of them"
            )
        elif given == MOTION[0] and all(r > 0.0 and abs(np.log(np.degrees(r))) < MISSED for r in ratio):
            words = (
                f"is about 1/57 of {beside}: is the angle in degrees? Convert it to rad, or give the model that "
                "compliance"
            )
        else:
            continue
        yield Finding(Grade.REFUSED, f"{c.readings.file}: column {name}", words)


def _beside_buckling(c: Comparison) -> Iterator[Finding]:
    """Of a test that another point controls: no force is many times the one at which the chain buckles."""
    name, chain = WRENCH[0], c.measurement.chain
    for label in c.labels if name in c.readings.values else ():
        force = np.abs(c.readings.only(c.readings.posture == label).known(name))
        try:
            path = c.measurement.engine.trace(chain, LoadCase(label, -REACH * chain.characteristic_length))
        except NoConvergenceError:
            continue
        if path.critical is None or not len(force):
            continue
        # the largest tenth, not one outlier
        many = float(np.percentile(force, 95.0)) / path.critical.force
        clear = path.critical.force > CLEAR * c.measurement.sheet.sigma(name).noise
        impossible = thousandfold([many]) and bool(many > 1.0 or clear)
        if impossible or many > np.exp(DIFFERS):
            units = ", or ".join(instead(unit, name, "it") for unit in units_between([many], name))
            yield Finding(
                Grade.REFUSED if impossible else Grade.DOUBTFUL, f"{c.readings.file}: column {name}",
                f"reaches {said(many)} the force at which posture {label} buckles{', a factor 1000' * impossible}: "
                f"{f'is {units}? Convert it' if units else 'no unit explains it'}",
            )  # fmt: skip


def said(times: float) -> str:
    """``20 times``, ``1/20 of``."""
    return f"1/{printed(1.0 / times, 3)} of" if 0.0 < abs(times) < 1.0 else f"{printed(times, 3)} times"


def of_joint(c: Comparison) -> Iterator[Finding]:
    """A joint that was loaded to one side only."""
    if c.of_joint and one_sided(c.measurement):
        words = "the joint was loaded to one side only: backlash is not asked, load both sides to know it"
        yield Finding(Grade.NOTED, f"{c.readings.file}: column {c.columns[0]}", words)


def gains(c: Comparison) -> Iterator[Finding]:
    """One channel that is another multiple of its prediction than a machine's, while the others fit."""
    if not c.comparable:
        return
    ratios = {
        name: ratio_of(f, g)
        for name, f, g in c.pairs(c.predicted())
        if np.sqrt(np.mean(g**2)) > CLEAR * c.noise(name)
    }
    fits = {name: abs(np.log(max(ratio[1], 1e-300))) < DIFFERS for name, ratio in ratios.items()}
    for name, (low, middle, high) in ratios.items():
        others = [fit for other, fit in fits.items() if other != name]
        beyond = low > 0.0 and (np.log(low) > DIFFERS or np.log(high) < -DIFFERS)
        if beyond and others and all(others):
            yield Finding(
                Grade.DOUBTFUL, f"{c.readings.file}: column {name}",
                f"is {said(middle)} what the model predicts, while other columns fit: is it in another unit, "
                "or its amplifier set to another range?",
            )  # fmt: skip


def _strange(c: Comparison, explained: list[Mistake]) -> Iterator[Finding]:
    """Readings that are as far from the model in every posture as no machine is, and are not explained."""
    rest = ~np.any([np.zeros(len(c.readings), dtype=bool), *(mistake.where for mistake in explained)], axis=0)
    noise = max((c.noise(n) * c.unit[k] for k, n in enumerate(c.columns) if n in c.readings.values), default=0.0)
    read = ~np.isnan(c.read)
    f, g = (np.where(read, np.nan_to_num(v * c.unit), 0.0)[:, c.main] for v in (c.read, c.predicted()))
    size = np.linalg.norm(f, axis=1) + np.linalg.norm(g, axis=1)
    loud = rest & ~np.isnan(c.imposed).any(axis=1) & (size > CLEAR * noise)
    # two numbers whose quotient is exp(x) differ by tanh(x/2) of their sum
    far = np.linalg.norm(f - g, axis=1) >= np.tanh(0.5 * DIFFERS) * size
    for label in c.labels:
        in_posture = loud & (c.readings.posture == label)
        if in_posture.sum() <= LEAST_ROWS or 2 * (in_posture & far).sum() < in_posture.sum():
            return
    many = times(c, loud & far)
    differ = f"differ from what the model predicts by more than a factor {np.exp(DIFFERS):.2g}"
    seen = f"are {said(many)} what the model predicts" if np.isfinite(many) else differ
    where = f"{c.readings.file}: {'every row' if len(c.labels) > 1 else f'posture {c.labels[0]}'}"
    if units := _in_units(c, loud & far):
        yield ColumnsMistaken(Grade.DOUBTFUL, where, f"{c.words} {seen}: {', or '.join(units)}? Convert them")
        return
    yield Finding(
        Grade.DOUBTFUL, where,
        f"{c.words} {seen}, and no unit, sign or exchange explains it. Look at the model's stiffness, the columns' "
        "axes and the postures",
    )  # fmt: skip


def _in_units(c: Comparison, rows: np.ndarray) -> list[str]:
    """The units in which some rows would be a machine's like the model, the likeliest first.

    The logarithm of what a machine shows over its model's is normal, of standard deviation `MISSED`; a unit that is
    `ODDS` less probable than the best is not told.
    """
    costs: dict[str, float] = {}
    for way in ways_of(c):
        many = times(c, rows, way) if way.cause == UNIT else np.nan
        if machines(many):
            costs.setdefault(way.words, 0.5 * float(np.log(many) / MISSED) ** 2)
    ranked = sorted(costs, key=lambda words: costs[words])
    return [words for words in ranked if costs[words] < costs[ranked[0]] + np.log(ODDS)]


def _seen(c: Comparison, mistake: Mistake) -> str:
    rest = "" if mistake.where.all() else " while other rows fit"
    if mistake.cause == SIGN:
        return f"{c.words} point against what the model predicts there{rest}"
    if mistake.cause == UNIT:
        own = [k for k, name in enumerate(c.columns) if name in mistake.columns]
        what = c.words if set(own) & set(c.main) or not own else ", ".join(c.columns[k] for k in own)
        many = times(c, mistake.where, Mistake(factors=dict.fromkeys(mistake.columns, 1.0)))
        if many > 0.0:
            return f"{what} are {said(many)} what the model predicts there{rest}"
        return f"{what} are far from what the model predicts there{rest}"
    return "the readings fit the model with them changed, not as they stand"


def _place(c: Comparison, rows: np.ndarray) -> str:
    """Which rows, in words."""
    if rows.all():
        return "every row"
    parts = []
    for label in c.labels:
        indices = np.flatnonzero(c.readings.posture == label)
        row, inside = c.readings.row[indices], rows[indices]
        spans = [f"rows {row[a]} to {row[b - 1]}" for a, b in runs(inside) if inside[a]]
        if spans:
            parts.append(f"posture {label}" + ("" if inside.all() else f", {', '.join(spans)}"))
    return "; ".join(parts)


Rule = Callable[[Comparison], Iterator[Finding]]


def columns(c: Comparison) -> Iterator[Finding]:
    """Mistakes in what was read and imposed, see `vjm_updating.experiment.implausible_readings`."""
    r, sheet, predicted = c.readings, c.measurement.sheet, np.full(c.read.shape, np.nan)
    if c.comparable:
        predicted = c.predicted()
    channels = {
        name: np.array(r.values[name])
        for name in r.channels
        if name in sheet.instrument and sheet.errors(name).held is None and np.isfinite(r.values[name]).any()
    }
    read = [name for name in channels if name in c.columns]
    imposed = [name for name in channels if name not in c.columns]
    group = np.unique(r.posture, return_inverse=True)[1].reshape(-1)

    def these(names: list[str], beside: Array, others: list[str]) -> ReadColumns:
        noise = np.array([sheet.errors(name).noise for name in names])
        values = np.column_stack([channels[name] for name in names])
        return ReadColumns(
            r.file, r.row, tuple(names), values, noise, beside, group, r.sequence, {n: channels[n] for n in others},
            partial(rounded, c),
        )  # fmt: skip

    if read:
        yield from column_findings(
            these(read, predicted[:, [c.columns.index(name) for name in read]], imposed), MISTAKES, OF_WHOLE
        )
    main = max(read, key=r.span, default="")
    if main and imposed:
        # what was imposed goes with the main reading, as its own zero and gain say
        beside = np.outer(channels[main] / max(r.span(main), 1e-300), [r.span(name) for name in imposed])
        yield from column_findings(these(imposed, beside, []), OF_IMPOSED)


RULES: tuple[Rule, ...] = (nothing_read, temperature, blanks, columns, clock, sheet_values)
"""Rules of readings and sheets; those of models are `vjm.io.model_plausibility`'s."""
BESIDE_THE_MODEL: tuple[Rule, ...] = (wrong_scale, of_joint, mistaken, gains)
"""Rules that compare readings with what the nominal machine does."""


def considered(measurement: Measurement, *, strict: bool = False) -> list[Finding]:
    """What is implausible about a test, unless it is refused for that.

    With ``strict`` what is doubtful is refused, too.

    Raises:
        ImplausibleError: naming the first reason.
        NoConvergenceError: the nominal machine has no equilibrium in a posture.
    """
    findings = plausibility(measurement)
    refuse(findings, strict=strict)
    return findings


def plausibility(measurement: Measurement) -> list[Finding]:
    """What is implausible about a test and its model, refusals first.

    Raises:
        NoConvergenceError: the nominal machine has no equilibrium in a posture.
    """
    name = f"{measurement.sheet.file}, model {measurement.sheet.test.model}"
    of_model = list(model_findings(measurement.document, name))
    # what a mistaken model predicts says nothing of the readings
    believed = all(finding.grade is Grade.NOTED for finding in of_model)
    rules = [*RULES, *(BESIDE_THE_MODEL if believed else ())]
    beside = compared(measurement)
    findings = [finding for rule in rules for finding in rule(beside)]
    return worst_first([*findings, *of_model, *measurement.notes])
