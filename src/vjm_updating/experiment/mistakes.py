"""How data of any kind of test may be mistaken, the data without a mistake, and which rows most probably have one.

A mistake changes readings by a known operation: a factor between units, a sign, an exchange of two columns, rows
that were shifted, a clock that jumped. The other readings are as good as any. Each kind of test says which
mistakes its columns may have, and how probable its rows are under each.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
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
    """A way in which data may be mistaken: a known operation makes them right.

    Attributes:
        words: what is mistaken, or the mistake's name.
        cause: one of `TITLES`; empty where no diagnosis undoes it.
        remedy: what to do, for people.
        order: by column, the column that its readings stand in.
        factors: by column, what its readings have to be multiplied by.
        added: by column, what has to be added then.
        rows: by how many rows what was read stands too late; too early where it is negative.
        axes: a load's name whose wrench is in the other axes, the base's or the tool's.
        postures: by label, the posture in which the readings were taken.
        where: the readings concerned ``(n,)``; none where it was not found.
        parameters: by name, what was found: a factor, or a jump in s.
        others: words of mistakes that are about as probable.
    """

    words: str = ""
    cause: str = ""
    remedy: str = ""
    order: Mapping[str, str] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)
    added: Mapping[str, float] = field(default_factory=dict)
    rows: int = 0
    axes: str = ""
    postures: Mapping[str, str] = field(default_factory=dict)
    where: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool), compare=False)
    parameters: Mapping[str, float] = field(default_factory=dict)
    others: tuple[str, ...] = ()

    @property
    def columns(self) -> set[str]:
        """Those that are changed."""
        return {*self.order, *self.factors, *self.added}

    def put_right(self, values: Array, names: Sequence[str]) -> Array:
        """Columns ``(…, m)`` as they were meant: in their order, then multiplied, then added to.

        Example:
            >>> mistaken = Mistake(order=swapped(("a", "b")), factors={"a": 10.0}, added={"b": 0.5})
            >>> mistaken.put_right(np.array([1.0, 2.0]), ("a", "b")).tolist()
            [20.0, 1.5]
        """
        order = [names.index(self.order.get(name, name)) for name in names]
        factors = [self.factors.get(name, 1.0) for name in names]
        return values[..., order] * factors + [self.added.get(name, 0.0) for name in names]

    def corrected(self, readings: Readings) -> Readings:
        """The readings without the mistake."""
        names, rows = tuple(readings.values), self.where
        table = np.column_stack([readings.values[name] for name in names])
        table[rows] = self.put_right(table[rows], names)
        return replace(readings, values=dict(zip(names, table.T, strict=True)))


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


# --- How data may be mistaken: what was read is what the machine did, after a known operation ---------------------

TORQUE, FORCE, TURN, SHIFT = EFFORT[0], EFFORT[1], MOTION[0], MOTION[1]
FORCES, MOMENTS, TURNS = (*WRENCH[:3], FORCE), (*WRENCH[3:], TORQUE), (*POSE[3:], TURN)
SHIFTS = (*POSE[:3], SHIFT, *(f"{kind}{axis}_mm" for kind in ("", "d") for axis in "xyz"))
"""Of ramps and loads, of a joint, of a robot's markers."""
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
    ("rotations in mrad", 1e-3, TURNS),
)
"""What is mistaken, what makes it right by multiplication, and what columns that concerns."""
SIGNS = (("the sign of the forces", -1.0, LOADS), ("the sign of the displacements", -1.0, MOTIONS))
FARTHEST_ROWS = numerical(5)
"""By how many rows readings may stand from where they belong."""


def multiplied(
    present: Sequence[str], table: Iterable[tuple[str, float, Collection[str]]], cause: str
) -> Iterator[Mistake]:
    """Mistakes of a table such as `UNITS` that concern columns that are there, each once."""
    told: list[Mistake] = []
    for words, factor, names in table:
        one = Mistake(words, cause, factors={name: factor for name in present if split_point(name)[1] in names})
        if one.factors and one not in told:
            told.append(one)
            yield one


def swapped(*pairs: tuple[str, str]) -> dict[str, str]:
    """The order of columns of which each pair changed places."""
    return {one: other for a, b in pairs for one, other in ((a, b), (b, a))}


def axes(
    name: str, what: str, present: np.ndarray, vectors: Sequence[tuple[str, ...]],
    axial: Sequence[tuple[str, ...]] = (),
) -> Iterator[Mistake]:  # fmt: skip
    """Exchanged, cycled and reversed axes of those present ``(3,)``, of vectors of three columns each.

    An axial vector, such as a moment, turns with the axes, and keeps its sense where they are mirrored.
    """
    x, here = "xyz", np.flatnonzero(present).tolist()
    turned: list[tuple[list[int], Array, str, str]] = []
    for i, j in combinations(here, 2):
        order = [{i: j, j: i}.get(k, k) for k in range(3)]
        turned.append((order, np.ones(3), f"{x[i]}{x[j]}_exchanged", f"exchange {x[i]} and {x[j]} of the"))
    for order in ([1, 2, 0], [2, 0, 1]) if len(here) == len(x) else ():
        cycle = [x[i] for i in order]
        turned.append((order, np.ones(3), "".join(cycle), f"take {', '.join(cycle)} for x, y, z in the"))
    for i in here:
        sign = np.where(np.arange(3) == i, -1.0, 1.0)
        turned.append(([0, 1, 2], sign, f"{x[i]}_reversed", f"reverse {x[i]} of the"))
    if len(here) > 1:
        turned.append(([0, 1, 2], -np.ones(3), "reversed", "reverse the sign of the"))
    for order, sign, words, remedy in turned:
        mirrored = np.linalg.det(np.eye(3)[:, order] * sign)
        signs = dict.fromkeys(vectors, sign) | dict.fromkeys(axial, mirrored * sign)
        yield Mistake(
            f"{name}.{words}", remedy=f"{remedy} {what}",
            order={own[k]: own[i] for own in signs for k, i in enumerate(order)},
            factors={one: float(by) for own, each in signs.items() for one, by in zip(own, each, strict=True)},
        )  # fmt: skip


def shifted(count: int, what: str) -> Iterator[Mistake]:
    """What was read in so many rows stands some rows from where it belongs."""
    for by in [sign * size for size in range(1, min(FARTHEST_ROWS, count) + 1) for sign in (-1, 1)]:
        early = "early: move them down" if by < 0 else "late: move them up"
        remedy = f"the {what} stand {'one row' if abs(by) == 1 else f'{abs(by)} rows'} too {early},"
        yield Mistake(f"{what}_shifted.{by}", remedy=remedy, rows=by)


def reordered(values: Array, order: np.ndarray) -> Array:
    """Rows ``(n, …)`` in an order; nan where it names none."""
    result = values[np.clip(order, 0, len(values) - 1)]
    result[(order < 0) | (order >= len(values))] = np.nan
    return result


def ways(
    readings: Readings, postures: tuple[str, ...], columns: tuple[tuple[str, ...], tuple[str, ...]] = (POSE, WRENCH)
) -> list[Mistake]:
    """All mistakes of ramps that concern columns that are there, those that concern more of them first.

    The machine may have stood in ``postures``; ``columns`` are those of what was imposed, and of what was read.
    """
    present = [name for names in columns for name in names if np.isfinite(readings.values.get(name, np.nan)).any()]
    mistakes = [*multiplied(present, UNITS, UNIT), *multiplied(present, SIGNS, SIGN)]
    mistakes += [
        Mistake(f"the sign of {name}", SIGN, factors={name: -1.0})
        for name in sorted(present, key=lambda name: unit_of(name) not in ("N", "Nmm"))
    ]
    mistakes += [
        Mistake(f"the columns {a} and {b} exchanged", EXCHANGE, order=swapped((a, b)))
        for names in columns
        for a, b in combinations([name for name in names if name in present], 2)
    ]
    labels = dict.fromkeys(readings.posture.tolist())
    mistakes += [
        Mistake(f"{a} labelled instead of {b}", postures={a: b}) for a in labels for b in postures if a != b
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


def most_probable(level: Array, whole: np.ndarray | None = None, step: Step | None = None) -> np.ndarray:
    """The most probable mistake of each row ``(k,)``, by number; between two mistakes there are right rows.

    The most probable sequence is Viterbi's (IEEE Trans. Inf. Theory 13 (1967) 260). Where a stretch begins and ends
    is as probable in every row. ``level`` (w, k) are negative logarithms of each row's probability under each
    mistake, of which number 0 is none; before the readings each is as rare as `rarity` says. ``whole`` (w,) says
    which concern all rows or none, ``step`` what else a change costs.

    Example:
        >>> level = np.array([[0.0, 9.0, 9.0, 9.0, 0.0], [9.0, 0.0, 0.0, 0.0, 9.0]])
        >>> most_probable(level).tolist()
        [0, 1, 1, 1, 0]
    """
    n, each, every = level.shape[1], np.arange(len(level)), slice(None)
    none, rare = np.zeros(len(level)), rarity(len(level) - 1)
    change = np.where(none > 0.0 if whole is None else whole, np.inf, np.log(max(n, 2)))
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
    level: Array,
    judged: Callable[[int, int], tuple[np.ndarray, Array]],
    whole: np.ndarray | None = None,
    step: Step | None = None,
) -> Iterator[tuple[int, int, dict[int, float]]]:
    """Stretches of rows that are mistaken in one way in the most probable sequence; see `most_probable`.

    Of the rows from one on and before another ``judged`` says which mistakes (w,) are possible there, and the
    negative logarithm (w,) of each one's probability.

    Returns:
        The first row, the one behind the last, and by number the costs of the mistakes that are not `ODDS` times
        less probable than the best, which comes first.
    """
    path = most_probable(level, whole, step)
    for begin, end in runs(path):
        if path[begin] == 0:
            continue
        possible, cost = judged(begin, end)
        cost = np.where(possible & (np.arange(len(cost)) > 0), cost, np.inf)
        near = np.flatnonzero(cost < cost.min() + np.log(ODDS))
        if len(near):
            yield begin, end, {int(w): float(cost[w]) for w in near[np.argsort(cost[near], kind="stable")]}
