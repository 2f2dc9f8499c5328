"""The best machine for one quantity, or the Pareto front of two.

Some numbers lie between bounds, and some parts are chosen from catalogues.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vjm.design.optimum import Evaluations, Optimum, OptimumProgress, QuantityLimit, limits_of, optimised
from vjm.design.sensitivity import DesignQuantity
from vjm.design.space import (
    NO_COST,
    NO_LOADS,
    Designed,
    DesignSpace,
    HeldTool,
    LoadCases,
    MachineMaker,
    design_space,
)
from vjm.design.sweep import SMALLER_IS_BETTER, AskedQuantity, asked, pareto, signs, swept
from vjm.errors import NoConvergenceError
from vjm.io.catalogues import COLUMN_OF_COST, COLUMN_OF_NAME, Row
from vjm.io.provenance import Provenance
from vjm.outcome import Outcome
from vjm.rotations import Array

if TYPE_CHECKING:
    from vjm.outcome import Axes


TRIED = 200
"""Combinations of rows that are all tried: a relaxation of four sizes takes as long as 100 to 200 machines."""
AGAIN = 1e-5
"""Relative difference of a quantity computed again: results are told to five digits. A relaxation has to be
better by as much, since its limits are tightened by less."""
Choices = Mapping[str, Sequence[Row]]


def optimise(
    model: Designed,
    vary: Mapping[str, tuple[float, float] | Sequence[Row]],
    *,
    minimise: str = "",
    maximise: str = "",
    such_that: str = "",
    starts: int = 3,
    cases: LoadCases = NO_LOADS,
    cost: str = "",
    progress: OptimumProgress | None = None,
    state: Path | None = None,
) -> Optimum:
    """The numbers and standard parts of a machine that make a quantity best and keep limits on others.

    Args:
        model: as for `vjm.load`, or a machine, or a function that makes one of its arguments.
        vary: bounds of each number by its key, see `vjm.sweep`; or rows of a catalogue by the key of a section,
            ``upper.section``, or of a function's argument, see `vjm.catalogue`.
        minimise: ``mass``, ``cost`` or ``deflection``, perhaps with a component: ``deflection.z``.
        maximise: ``critical``, ``frequency``, ``reach`` or ``stiffness.z`` instead.
        such_that: limits: ``deflection<=0.2; critical>=3*load; frequency>=20``.
        starts: of the optimiser.
        cases: postures and loads in which the machine is judged, by the worst one or by weights.
        cost: formula of what a machine costs, such as ``parts + 4.2*mass``: ``parts`` is the sum of the column
            ``cost`` of the chosen rows. A key of a number may stand in it, too.
        progress: called with how many machines were computed, and the best objective so far that keeps the limits.
        state: file of what was computed. A run with the same arguments goes on from it.

    Returns:
        The best machine. An interrupt gives the best so far.

    Raises:
        ModelFileError: there is no such file or number.
        ValueError: no such quantity or posture, bounds that are not positive and ordered, or ``state`` is a file of
            other arguments.
        NoConvergenceError: no start led to a machine that has the quantities.

    Example:
        >>> import vjm
        >>> bounds = {"upper.section.width_mm": (40.0, 90.0)}
        >>> push = vjm.LoadCases(wrenches=[(0, -10, 0, 0, 0, 0)], engine=vjm.VjmEngine(2))
        >>> best = vjm.optimise("planar-2r", bounds, minimise="mass", such_that="deflection<=5.9", cases=push,
        ...                     starts=1)
        >>> best.kept, [f"{row['number']} = {row['value']:.2f}" for row in best.table()]
        (True, ['upper.section.width_mm = 44.51'])
    """
    objective = objective_of(minimise, maximise)
    if starts < 1:
        raise ValueError(f"starts must be 1 or more, not {starts}")
    numbers, choices = divided(vary)
    space = design_space(model, tuple(numbers), cases, cost=cost)
    return best_machine(space, numbers, choices, objective, limits_of(such_that), starts, progress, state)


def objective_of(minimise: str, maximise: str) -> AskedQuantity:
    """What is made best.

    Raises:
        ValueError: none or two of them, or one that is better the other way.
    """
    objective = asked(minimise or maximise) if bool(minimise) != bool(maximise) else None
    if objective is None or (objective.quantity in SMALLER_IS_BETTER) != bool(minimise):
        raise ValueError(
            "say one: minimise mass, deflection or cost, or maximise critical, frequency, stiffness or reach"
        )
    return objective


def divided(
    vary: Mapping[str, tuple[float, float] | Sequence[Row]],
) -> tuple[dict[str, tuple[float, float]], dict[str, list[Row]]]:
    """Bounds of numbers, and rows of catalogues, by key.

    Raises:
        ValueError: what varies is neither, or nothing does.
    """
    numbers: dict[str, tuple[float, float]] = {}
    choices: dict[str, list[Row]] = {}
    for key, given in vary.items():
        rows = [each for each in given if isinstance(each, Mapping)]
        if rows and len(rows) == len(given):
            choices[key] = rows
            continue
        try:
            low, high = (float(each) for each in given if not isinstance(each, Mapping))
        except (TypeError, ValueError):
            raise ValueError(
                f"vary '{key}': give two bounds, such as (40.0, 90.0), or rows of a catalogue"
            ) from None
        numbers[key] = low, high
    if not vary:
        raise ValueError("say which number varies, with its bounds, or give it a catalogue")
    return numbers, choices


def best_machine(
    space: DesignSpace,
    numbers: Mapping[str, tuple[float, float]],
    choices: Choices,
    objective: AskedQuantity,
    limits: Sequence[QuantityLimit],
    starts: int = 3,
    progress: OptimumProgress | None = None,
    state: Path | None = None,
) -> Optimum:
    """As `optimise`, of machines that are known; computed again at the end, so that nothing of the search is in it.

    Raises:
        NoConvergenceError: as `optimise`, or the values computed again are others than those of the search.
    """
    evaluations = Evaluations(state, made_of(space, numbers, choices, [objective], limits, starts))
    search = CatalogueSearch(space, dict(numbers), objective, list(limits), starts, progress, evaluations)
    try:
        optimum = search.best(choices)
    finally:
        evaluations.write()
    return _computed_again(optimum)


def made_of(
    space: DesignSpace, numbers: Mapping[str, tuple[float, float]], choices: Choices, of: Sequence[AskedQuantity],
    limits: Sequence[QuantityLimit], starts: int,
) -> Provenance:  # fmt: skip
    """What a search is made of, so that a file of what was computed is told from that of another.

    Raises:
        ValueError: a catalogue is of no part, or of one of which a number varies, too; or a cost has no formula.
    """
    machine = space.files.machine()
    if space.price is None and any(each.quantity is DesignQuantity.COST for each in (*of, *(v.of for v in limits))):
        raise ValueError(NO_COST)
    if choices:
        twice = next((number for number in numbers for key in choices if number.startswith(f"{key}.")), "")
        if twice:
            raise ValueError(f"'{twice}' is in the catalogue's part: let one of both vary")
        # a table that is not there is said before anything is computed
        space.files.with_rows({key: _sizes(rows[0]) for key, rows in choices.items()}).machine()
    plain = space.freed.files
    made = plain.make if isinstance(plain, MachineMaker) else None
    code = getattr(made, "__code__", None)
    return Provenance.of(
        machine.files, machine=machine, engine=space.engine, vary=dict(numbers), rows=dict(choices),
        of=", ".join(map(str, of)), limits=[str(limit) for limit in limits], starts=starts, cases=list(space.cases),
        gravity=space.gravity, load=[str(each) for each in space.loads], end=space.end, weights=list(space.weights),
        hold_tool=isinstance(space.files, HeldTool), cost="" if space.price is None else space.price.formula,
        code="" if code is None else [code.co_code.hex(), repr(code.co_consts), repr(code.co_names)],
    )  # fmt: skip


def _computed_again(optimum: Optimum) -> Optimum:
    limits = optimum.limits
    again = swept(optimum.space, optimum.values[None], [optimum.of, *(limit.of for limit in limits)])
    _, *quantities = again.worst[0]
    value = optimum.space.in_all_cases(again.values[0, :, 0], signs([optimum.of])[0])
    for name, now, was in zip(
        (optimum.of, *limits), (value, *quantities), (optimum.objective, *optimum.quantities), strict=True
    ):
        if not abs(now - was) <= AGAIN * abs(was):
            raise NoConvergenceError(
                f"computed again, the best machine has {now:.6g} instead of {was:.6g} ({name}): none is given"
            )
    kept = all(limit.margin(each) >= 0.0 for limit, each in zip(limits, quantities, strict=True))
    return replace(optimum, objective=float(value), quantities=np.array(quantities), kept=kept)


@dataclass
class CatalogueSearch:
    """A search for the best machine."""

    space: DesignSpace
    numbers: dict[str, tuple[float, float]]
    objective: AskedQuantity
    limits: list[QuantityLimit]
    starts: int
    progress: OptimumProgress | None
    evaluations: Evaluations
    incumbent: Optimum | None = None

    def best(self, choices: Choices) -> Optimum:
        """The best machine; at an interrupt the best so far.

        Raises:
            NoConvergenceError: there is none that has the quantities.
            KeyboardInterrupt: none is known yet.
        """
        if not choices:
            return self._solved(self.space, self.numbers, {}, self.starts, self._tell)
        order, tie = list[tuple[float, int, Choices]](), itertools.count()
        heapq.heappush(order, (-np.inf, next(tie), choices))
        try:
            while order:
                bound, _, node = heapq.heappop(order)
                if self.incumbent is not None and self.incumbent.kept:
                    cost = self._cost(self.incumbent)
                    if bound >= cost - AGAIN * abs(cost):
                        break
                for least, part in self._followed(node):
                    heapq.heappush(order, (least, next(tie), part))
        except KeyboardInterrupt:
            if self.incumbent is None:
                raise
            return replace(self.incumbent, interrupted=True, evaluations=self.evaluations.count)
        if self.incumbent is None:
            raise NoConvergenceError("no row of the catalogues leads to a machine that has these quantities")
        return replace(self.incumbent, evaluations=self.evaluations.count)

    def _followed(self, node: Choices) -> list[tuple[float, Choices]]:
        """The nodes behind a node, with a bound on the cost of each; what has none is tried."""
        mixed = next((key for key, rows in node.items() if len({_kind(row) for row in rows}) > 1), "")
        if mixed:
            kinds = dict.fromkeys(_kind(row) for row in node[mixed])
            return [(-np.inf, {**node, mixed: [r for r in node[mixed] if _kind(r) == kind]}) for kind in kinds]
        if prod(map(len, node.values())) <= (TRIED if not self.numbers else 1):
            for rows in itertools.product(*node.values()):
                self._try(dict(zip(node, rows, strict=True)))
            return []
        relaxed = self._relaxed(node)
        if relaxed is None or not relaxed.kept:
            return []
        sizes = dict(zip(relaxed.space.keys, relaxed.values.tolist(), strict=True))
        self._try({key: _nearest(key, rows, sizes) for key, rows in node.items()})
        return [(self._cost(relaxed), part) for part in _split(node, sizes)]

    def _try(self, chosen: Mapping[str, Row]) -> None:
        """The best machine with a row for each part."""
        space = replace(
            self.space, files=self.space.files.with_rows({key: _sizes(row) for key, row in chosen.items()}),
            parts_cost=sum(map(_cost_of, chosen.values())),
        )  # fmt: skip
        try:
            optimum = self._solved(space, self.numbers, chosen, self.starts, self._tell)
        except (NoConvergenceError, ValueError):
            return
        if self.incumbent is None or _missed(optimum) < _missed(self.incumbent) or (
            _missed(optimum) == _missed(self.incumbent) and self._cost(optimum) < self._cost(self.incumbent)
        ):  # fmt: skip
            self.incumbent = replace(optimum, interrupted=False)
        if optimum.interrupted:
            raise KeyboardInterrupt

    def _relaxed(self, node: Choices) -> Optimum | None:
        """The best machine whose sizes lie between those of a node's rows; None where there is none."""
        bounds = {
            f"{key}.{column}": (min(values), max(values))
            for key, rows in node.items()
            for column in _columns(rows)
            if min(values := [float(row[column]) for row in rows]) < max(values)
        }
        middle = {key: rows[len(rows) // 2] for key, rows in node.items()}
        files = self.space.files.with_rows({key: _sizes(row) for key, row in middle.items()})
        # no part costs less than the cheapest of its rows
        parts = sum(min(map(_cost_of, rows)) for rows in node.values())
        space = replace(self.space, files=files, keys=(*self.numbers, *bounds), parts_cost=parts)
        try:
            # rows that are left stand in the bounds, and those that give the shape in the middle row
            optimum = self._solved(space, {**self.numbers, **bounds}, middle, self.starts, self._tell_relaxed)
        except (NoConvergenceError, ValueError):
            return None
        if optimum.interrupted:
            raise KeyboardInterrupt
        return optimum

    def _solved(
        self, space: DesignSpace, bounds: Mapping[str, tuple[float, float]], chosen: Mapping[str, Row], starts: int,
        progress: OptimumProgress,
    ) -> Optimum:  # fmt: skip
        within = np.array(list(bounds.values()), dtype=float).reshape(-1, 2)
        return optimised(space, within, self.objective, self.limits, starts, progress, self.evaluations, chosen)

    def _tell(self, machines: int, best: float | None) -> None:
        if self.progress is None:
            return
        known = [] if self.incumbent is None or not self.incumbent.kept else [self.incumbent.objective]
        (sign,) = signs([self.objective])
        self.progress(
            machines, min([*known, *([] if best is None else [best])], key=lambda v: sign * v, default=None)
        )

    def _tell_relaxed(self, machines: int, _: float | None) -> None:
        # what is between the rows of a catalogue is no machine that can be bought
        self._tell(machines, None)

    def _cost(self, optimum: Optimum) -> float:
        """The smaller, the better."""
        return float(signs([self.objective])[0] * optimum.objective)


def _missed(optimum: Optimum) -> float:
    """By how much the limit is missed that is missed most, over its size."""
    margins = [
        limit.margin(value) for limit, value in zip(optimum.limits, optimum.quantities.tolist(), strict=True)
    ]
    return 0.0 if optimum.kept else max(0.0, -min(margins, default=0.0))


def _sizes(row: Row) -> Row:
    return {key: cell for key, cell in row.items() if key not in (COLUMN_OF_NAME, COLUMN_OF_COST)}


def _cost_of(row: Row) -> float:
    """Of a row; zero where the catalogue says nothing.

    Raises:
        ValueError: it is no number.
    """
    cost = row.get(COLUMN_OF_COST, 0.0)
    if not isinstance(cost, float | int):
        raise ValueError(f"a catalogue's column {COLUMN_OF_COST} has '{cost}': write a number")
    return float(cost)


def _kind(row: Row) -> tuple[tuple[str, Any], ...]:
    """What of a row is no size: its shape, and which sizes it has."""
    return tuple((key, None if isinstance(cell, float) else cell) for key, cell in sorted(_sizes(row).items()))


def _columns(rows: Sequence[Row]) -> list[str]:
    return [key for key, cell in _sizes(rows[0]).items() if isinstance(cell, float)]


def _spans(key: str, rows: Sequence[Row], sizes: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Least value and width of the columns of rows that the relaxation varies."""
    spans = {}
    for column in _columns(rows):
        values = [float(row[column]) for row in rows]
        if f"{key}.{column}" in sizes and min(values) < max(values):
            spans[column] = min(values), max(values) - min(values)
    return spans


def _nearest(key: str, rows: Sequence[Row], sizes: Mapping[str, float]) -> Row:
    """The row whose sizes are nearest, in widths of the columns."""
    spans = _spans(key, rows, sizes)

    def apart(row: Row) -> float:
        return sum(((float(row[c]) - sizes[f"{key}.{c}"]) / width) ** 2 for c, (_, width) in spans.items())

    return min(rows, key=apart)


def _split(node: Choices, sizes: Mapping[str, float]) -> list[Choices]:
    """A node in two, at the size that lies farthest from those of the rows."""
    best: tuple[float, str, Callable[[Row], bool]] | None = None
    for key, rows in node.items():
        for column, (low, width) in _spans(key, rows, sizes).items():
            values = sorted({float(row[column]) for row in rows})
            size = min(max(sizes[f"{key}.{column}"], low), low + width)
            # the sizes on both sides, so that both parts have rows
            cut = max(value for value in values[:-1] if value <= size or value == values[0])
            above = values[values.index(cut) + 1]
            far = min(abs(size - cut), abs(above - size)) / width
            if best is None or far > best[0]:
                best = far, key, lambda row, c=column, v=cut: float(row[c]) <= v
    if best is None:
        # rows of equal sizes: one stands for all
        return [{key: rows[:1] for key, rows in node.items()}]
    _, key, below = best
    return [{**node, key: [r for r in node[key] if below(r) is side]} for side in (True, False)]


@dataclass(frozen=True)
class ParetoFront(Outcome):
    """Machines of which none is beaten by another in two quantities.

    Attributes:
        of: the two quantities.
        points: the machines, the best for the first quantity first; no two are alike.
        interrupted: whether it was ended before its time: the points so far.

    Example:
        >>> import vjm
        >>> front = vjm.pareto_front("planar-2r", {"upper.section.width_mm": (40.0, 90.0)}, ("mass", "stiffness.y"),
        ...                          points=2, starts=1, cases=vjm.LoadCases(engine=vjm.VjmEngine(1)))
        >>> front.values.shape
        (2, 2)
    """

    of: tuple[AskedQuantity, AskedQuantity]
    points: tuple[Optimum, ...]
    interrupted: bool = False

    @property
    def values(self) -> Array:
        """Of the two quantities ``(p, 2)``."""
        return np.array([front_values(point) for point in self.points])

    def table(self) -> list[dict[str, Any]]:
        """A row for each machine: both quantities, its numbers and standard parts by key."""
        return [
            dict(zip(map(str, self.of), pair, strict=True)) | {row["number"]: row["value"] for row in point.table()}
            for pair, point in zip(self.values.tolist(), self.points, strict=True)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Both quantities with their units, and `table`."""
        return {"quantities": {str(each): each.unit for each in self.of}, "machines": self.table(),
                "interrupted": self.interrupted}  # fmt: skip

    def plot(self, ax: Axes | None = None) -> Axes:
        """The second quantity over the first one.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import scatter

        first, second = ((f"{of}, {of.unit}".removesuffix(", "), self.values[:, k]) for k, of in enumerate(self.of))
        return scatter(first, second, np.ones(len(self.points), dtype=bool), "beaten by no other", ax)


def pareto_front(
    model: Designed,
    vary: Mapping[str, tuple[float, float] | Sequence[Row]],
    of: tuple[str, str] = ("mass", "deflection"),
    *,
    points: int = 7,
    such_that: str = "",
    starts: int = 3,
    cases: LoadCases = NO_LOADS,
    cost: str = "",
    progress: OptimumProgress | None = None,
    state: Path | None = None,
) -> ParetoFront:
    """The machines of which none is beaten by another in two quantities.

    Args:
        model: as `vjm.optimise`, and so are the arguments that are not told here.
        vary: bounds of numbers, or rows of catalogues, by key.
        of: the two quantities: less of mass, deflection and cost, more of the others is better. The second one
            counts in its worst case.
        points: machines that are looked for, 2 or more; fewer where some are alike.
        such_that: limits that all of them keep.
        starts: of the optimiser, for each point.
        cases: postures and loads; weights are of the cases in the first quantity.
        cost: formula of what a machine costs.
        progress: called with how many machines were computed.
        state: file of what was computed. A run with the same arguments goes on from it.

    Raises:
        ModelFileError: there is no such file or number.
        ValueError: as `vjm.optimise`, or both quantities are one.
        NoConvergenceError: no machine keeps the limits.

    Example:
        >>> import vjm
        >>> push = vjm.LoadCases(wrenches=[(0, -10, 0, 0, 0, 0)], engine=vjm.VjmEngine(2))
        >>> bounds = {"upper.section.width_mm": (40.0, 90.0)}
        >>> front = vjm.pareto_front("planar-2r", bounds, points=3, starts=1, cases=push)
        >>> [(round(row["mass"], 2), round(row["deflection"], 2)) for row in front.table()]
        [(3.08, 5.99), (3.22, 5.85), (3.89, 5.7)]
    """
    numbers, choices = divided(vary)
    space = design_space(model, tuple(numbers), cases, cost=cost)
    both = asked(of[0]), asked(of[1])
    return front_of(space, numbers, choices, both, limits_of(such_that), points, starts, progress, state)


def front_of(
    space: DesignSpace,
    numbers: Mapping[str, tuple[float, float]],
    choices: Choices,
    of: tuple[AskedQuantity, AskedQuantity],
    limits: Sequence[QuantityLimit],
    points: int,
    starts: int = 3,
    progress: OptimumProgress | None = None,
    state: Path | None = None,
) -> ParetoFront:
    """As `pareto_front`, of machines that are known.

    Raises:
        ValueError: both quantities are one, or fewer than two points.
        NoConvergenceError: no machine keeps the limits.
    """
    first, second = of
    if first == second or points < 2:
        raise ValueError(f"give two quantities and 2 points or more, not {first}, {second} and {points} points")
    evaluations = Evaluations(state, made_of(space, numbers, choices, of, limits, starts))

    def best(objective: AskedQuantity, also: Sequence[QuantityLimit]) -> Optimum:
        search = CatalogueSearch(space, dict(numbers), objective, [*limits, *also], starts, progress, evaluations)
        optimum = search.best(choices)
        if optimum.interrupted:
            raise KeyboardInterrupt
        return optimum

    optima: list[Optimum] = []
    less = second.quantity in SMALLER_IS_BETTER
    interrupted = False
    try:
        least = best(second, [])
        edge = QuantityLimit(second, less, least.objective * (1.0 + (SLACK if less else -SLACK)))
        optima.append(best(first, [edge]))
        # any value of the second quantity will do, so that its own is told beside
        loose = best(first, [QuantityLimit(second, less, ANY if less else 1.0 / ANY)])
        optima.append(loose)
        far = front_values(loose)[1]
        for bound in np.linspace(edge.value, far, points)[1:-1]:
            optima.append(best(first, [QuantityLimit(second, less, float(bound))]))
    except KeyboardInterrupt:
        if not optima:
            raise
        interrupted = True
    finally:
        evaluations.write()
    kept = [each for each in optima if each.kept]
    if not kept:
        raise NoConvergenceError("no machine within the bounds keeps all limits")
    on_front = pareto(np.array([front_values(each) for each in kept]), of)
    less_first = first.quantity in SMALLER_IS_BETTER
    ordered = sorted(itertools.compress(kept, on_front), key=lambda each: each.objective, reverse=not less_first)
    return ParetoFront(of, tuple(ordered), interrupted)


def front_values(point: Optimum) -> tuple[float, float]:
    """The two quantities of a machine of a front: what was made best, and what was bounded last."""
    return point.objective, float(point.quantities[-1])


SLACK = 1e-5
"""Of the best value of the second quantity, within which it has to stay at that end of the front: an optimum is
right to less."""
ANY = 1e12
"""A bound that every machine keeps."""
