"""Errors of the instruments that are mistakes, and the readings without them.

A mistake changes readings by a known operation: a factor between units, a sign, an exchange of two columns, a clock
that jumped. The other readings are as good as any.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from vjm.io.findings import Finding, ImplausibleError
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, prior_scale, stated_level
from vjm_updating.experiment.data_file import EFFORT, MOTION, POSE, WRENCH, split_point, unit_of
from vjm_updating.experiment.measured import Measurement
from vjm_updating.experiment.readings import Readings, runs

UNIT, SIGN, EXCHANGE, CLOCK = "instrument_unit", "instrument_sign", "instrument_exchange", "instrument_clock"
TITLES = {
    UNIT: "a channel that was written in another unit",
    SIGN: "a channel with the other sign",
    EXCHANGE: "two channels in each other's place",
    CLOCK: "a clock that jumped, or changed its unit",
}
"""Each mistake as a cause, and what it is."""


@dataclass(frozen=True)
class Mistake:
    """A way in which readings may be mistaken: a known operation makes them right.

    Attributes:
        cause: one of `TITLES`; empty for labels of postures.
        factors: by column, what its readings have to be multiplied by.
        exchanged: two columns that change places.
        postures: by label, the posture in which the readings were taken.
        shifts: by column, what has to be added ``(n,)``.
        where: the readings concerned ``(n,)``; none where it was not found.
        parameters: by name, what was found: a factor, or a jump in s.
        others: words of mistakes that are about as probable.
    """

    words: str = ""
    cause: str = ""
    factors: Mapping[str, float] = field(default_factory=dict)
    exchanged: tuple[str, ...] = ()
    postures: Mapping[str, str] = field(default_factory=dict)
    shifts: Mapping[str, Array] = field(default_factory=dict)
    where: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool), compare=False)
    parameters: Mapping[str, float] = field(default_factory=dict)
    others: tuple[str, ...] = ()

    @property
    def columns(self) -> set[str]:
        """Those that are changed."""
        return {*self.factors, *self.exchanged, *self.shifts}

    def put_right(self, values: Array, names: tuple[str, ...]) -> Array:
        """Columns ``(…, m)`` as they were meant: exchanged, then multiplied."""
        order = list(range(len(names)))
        if self.exchanged and self.exchanged[0] in names:
            i, j = (names.index(name) for name in self.exchanged)
            order[i], order[j] = j, i
        return values[..., order] * [self.factors.get(name, 1.0) for name in names]

    def corrected(self, readings: Readings) -> Readings:
        """The readings without the mistake."""
        names, rows = tuple(readings.values), self.where
        table = np.column_stack([readings.values[name] for name in names])
        table[rows] = self.put_right(table[rows], names)
        values = {
            name: column + rows * self.shifts.get(name, 0.0) for name, column in zip(names, table.T, strict=True)
        }
        return replace(readings, values=values)


RIGHT = Mistake("right")


class ColumnsMistaken(Finding):
    """Columns are not what they say: whatever is fitted to them means nothing before they are corrected."""


@dataclass(frozen=True)
class MistakeFound(ColumnsMistaken):
    """A finding that says what the mistake is."""

    mistake: Mistake


def columns_mistaken(findings: Iterable[Finding]) -> list[ColumnsMistaken]:
    """Findings that columns are not what they say, but for the clock: no stiffness is fitted to that."""
    return [
        one
        for one in findings
        if isinstance(one, ColumnsMistaken) and not (isinstance(one, MistakeFound) and one.mistake.cause == CLOCK)
    ]


DIAGNOSED = "`validate diagnose` says what the residual is"
"""A remedy, of tests that can be diagnosed."""
TAKEN_BY_FORCE = "--force takes the readings as they are, and the model says so"


def refuse_mistaken(findings: Iterable[Finding], *remedies: str) -> None:
    """Stop where columns are not what they say, before anything is calibrated by them.

    ``remedies`` say what else may be done.

    Raises:
        ImplausibleError: naming the first mistake, and how many more there are.
    """
    mistaken = columns_mistaken(findings)
    if mistaken:
        more = f" (and {len(mistaken) - 1} more)" if len(mistaken) > 1 else ""
        raise ImplausibleError("; ".join([f"{mistaken[0]}{more}: no machine is calibrated by that", *remedies]))


def mistakes_of(findings: Iterable[Finding]) -> list[Mistake]:
    """The mistakes among findings that can be undone together: of two that concern the same readings, the first."""
    taken: list[Mistake] = []
    for finding in findings:
        if not isinstance(finding, MistakeFound):
            continue
        one = finding.mistake
        if not any(one.columns & other.columns and np.any(one.where & other.where) for other in taken):
            taken.append(one)
    return taken


def corrected(measurement: Measurement, mistakes: Iterable[Mistake]) -> Measurement:
    """The measurement without mistakes."""
    readings = measurement.readings
    for mistake in mistakes:
        readings = mistake.corrected(readings)
    return replace(measurement, readings=readings)


# --- How readings may be mistaken: what was read is what the machine did, after a known operation -----------------

TORQUE, FORCE, TURN, SHIFT = EFFORT[0], EFFORT[1], MOTION[0], MOTION[1]
FORCES, MOMENTS, SHIFTS, TURNS = (*WRENCH[:3], FORCE), (*WRENCH[3:], TORQUE), (*POSE[:3], SHIFT), (*POSE[3:], TURN)
LOADS, MOTIONS = (*WRENCH, *EFFORT), (*POSE, *MOTION)
LENGTHS = {"cm": 10.0, "inches": 25.4, "m": 1e3, "µm": 1e-3, "mil (0.001 inches)": 0.0254, "feet": 304.8}
"""mm in each unit that lengths may be in by mistake."""
LBF, KGF = definition(4.4482216152605, "N"), definition(9.80665, "N")
"""N."""
UNITS = (
    *((f"forces in {unit}", n, FORCES) for unit, n in {"kN": 1e3, "kgf": KGF, "lbf": LBF, "mN": 1e-3}.items()),
    ("forces in gf", 1e-3 * KGF, FORCES),
    ("moments in N m", 1e3, MOMENTS),
    *((f"forces in {unit}", n, LOADS) for unit, n in {"kN": 1e3, "kgf": KGF, "lbf": LBF, "mN": 1e-3}.items()),
    ("torques in lbf in", LBF * 25.4, MOMENTS),
    ("torques in lbf ft", LBF * 304.8, MOMENTS),
    ("torques in ozf in", LBF / 16.0 * 25.4, MOMENTS),
    ("torques in kgf cm", 10.0 * KGF, MOMENTS),
    ("torques in kgf m", 1e3 * KGF, MOMENTS),
    ("torques in N cm", 10.0, MOMENTS),
    *((f"displacements in {unit}", mm, SHIFTS) for unit, mm in LENGTHS.items()),
    ("rotations in degrees", float(np.pi / 180.0), TURNS),
)
"""What is mistaken, what makes it right by multiplication, and what columns that concerns."""
SIGNS = (("the sign of the forces", LOADS), ("the sign of the displacements", MOTIONS))


def ways(
    readings: Readings, postures: tuple[str, ...], columns: tuple[tuple[str, ...], tuple[str, ...]] = (POSE, WRENCH)
) -> list[Mistake]:
    """All mistakes that concern columns that are there, those that concern more of them first.

    The machine may have stood in ``postures``; ``columns`` are those of what was imposed, and of what was read.
    """
    present = [name for names in columns for name in names if np.isfinite(readings.values.get(name, np.nan)).any()]

    def only(names: tuple[str, ...], factor: float) -> dict[str, float]:
        return {name: factor for name in present if split_point(name)[1] in names}

    mistakes = [Mistake(words, UNIT, only(names, factor)) for words, factor, names in UNITS]
    mistakes += [Mistake(words, SIGN, only(names, -1.0)) for words, names in SIGNS]
    mistakes += [
        Mistake(f"the sign of {name}", SIGN, {name: -1.0})
        for name in sorted(present, key=lambda name: unit_of(name) not in ("N", "Nmm"))
    ]
    mistakes = [way for k, way in enumerate(mistakes) if way.factors and way not in mistakes[:k]]
    mistakes += [
        Mistake(f"the columns {a} and {b} exchanged", EXCHANGE, exchanged=(a, b))
        for names in columns
        for a, b in combinations([name for name in names if name in present], 2)
    ]
    labels = dict.fromkeys(readings.posture.tolist())
    mistakes += [
        Mistake(f"{a} labelled instead of {b}", "", postures={a: b}) for a in labels for b in postures if a != b
    ]
    return mistakes


# --- The most probable mistake of each row of a test, of rows that follow one another -----------------------------

MISTAKES = prior_scale(0.02)
"""Probability that a posture's readings are mistaken in some way."""
ODDS = stated_level(20.0)
"""Of the most probable mistake to one that is not named beside it."""
LEAST_ROWS = numerical(2)
"""Of a stretch that say something: a single one is an outlier."""

Step = Callable[[int, int | slice, int | slice], Array]
"""What a change costs from a row's mistake to the next row's; given the next row and both mistakes."""


def rarity(ways: int) -> float:
    """Negative logarithm of the probability of each of so many mistakes, before the readings."""
    return float(np.log(max(ways, 1) / MISTAKES))


def most_probable(level: Array, rare: float, whole: np.ndarray, step: Step | None = None) -> np.ndarray:
    """The most probable mistake of each row ``(k,)``, by number; between two mistakes there are right rows.

    The most probable sequence is Viterbi's (IEEE Trans. Inf. Theory 13 (1967) 260). Where a stretch begins and ends
    is as probable in every row. ``level`` (w, k) are negative logarithms of each row's probability under each
    mistake, of which number 0 is none. ``whole`` (w,) says which concern all rows or none, ``step`` what else a
    change costs; for ``rare`` see `rarity`.

    Example:
        >>> level = np.array([[0.0, 9.0, 9.0, 9.0, 0.0], [9.0, 0.0, 0.0, 0.0, 9.0]])
        >>> most_probable(level, rarity(1), np.zeros(2, dtype=bool)).tolist()
        [0, 1, 1, 1, 0]
    """
    n, each, every = level.shape[1], np.arange(len(level)), slice(None)
    none = np.zeros(len(level))
    change = np.where(whole, np.inf, np.log(max(n, 2)))
    cost, came = level[:, 0] + np.where(each > 0, rare, 0.0), np.zeros((n, len(each)), dtype=int)
    for k in range(1, n):
        changes = ((every, every), (0, every), (every, 0))
        same, into, out = (none if step is None else step(k, before, after) for before, after in changes)
        stay = cost + same
        enter = cost[0] + into + rare + change
        leave = cost + out + change
        leave[0], enter[0] = stay[0], np.inf
        came[k] = np.where(enter < stay, 0, each)
        came[k, 0] = np.argmin(leave)
        cost = level[:, k] + np.concatenate([[leave.min()], np.minimum(stay, enter)[1:]])
    path = np.zeros(n, dtype=int)
    path[-1] = int(np.argmin(cost))
    for k in range(n - 1, 0, -1):
        path[k - 1] = came[k, path[k]]
    return path


def mistaken_stretches(
    path: np.ndarray, judged: Callable[[int, int], tuple[np.ndarray, Array]]
) -> Iterator[tuple[int, int, dict[int, float]]]:
    """Stretches of rows that are mistaken in one way.

    The ``path`` is of `most_probable`. Of the rows from one on and before another ``judged`` says which mistakes
    (w,) are possible there, and the negative logarithm (w,) of each one's probability.

    Returns:
        The first row, the one behind the last, and by number the costs of the mistakes that are not `ODDS` times
        less probable than the best, which comes first.
    """
    for begin, end in runs(path):
        if path[begin] == 0:
            continue
        possible, cost = judged(begin, end)
        cost = np.where(possible & (np.arange(len(cost)) > 0), cost, np.inf)
        near = np.flatnonzero(cost < cost.min() + np.log(ODDS))
        if len(near):
            yield begin, end, {int(w): float(cost[w]) for w in near[np.argsort(cost[near], kind="stable")]}
