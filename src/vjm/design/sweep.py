"""Quantities of a machine over grids of its files' numbers, in several postures and under several loads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from vjm.batch import Progress, map_all
from vjm.design.linear_state import Question
from vjm.design.sensitivity import WITHOUT_COMPONENT, DesignQuantity, unit_of, value_at
from vjm.design.space import NO_COST, NO_LOADS, Designed, DesignSpace, LoadCases, design_space
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS
from vjm.outcome import Outcome
from vjm.rotations import Array
from vjm.threads import single_threaded

if TYPE_CHECKING:
    from vjm.outcome import Axes

SMALLER_IS_BETTER = (DesignQuantity.DEFLECTION, DesignQuantity.MASS, DesignQuantity.COST)
AT_ONCE = 5
"""Machines of a task: some seconds' work, which can be lost."""


class AskedQuantity(NamedTuple):
    """A quantity that is asked for.

    Attributes:
        quantity: which.
        along: component of a stiffness, or of a deflection, whose size counts; empty for the end's whole shift.
    """

    quantity: DesignQuantity
    along: str = ""

    def __str__(self) -> str:
        return f"{self.quantity}.{self.along}" if self.along else str(self.quantity)

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return unit_of(self.quantity, self.along or "x")


def asked(text: str) -> AskedQuantity:
    """A quantity by its name, perhaps with a component.

    Raises:
        ValueError: there is none of the name.

    Example:
        >>> asked("deflection"), asked("stiffness.z").along
        (AskedQuantity(quantity=<DesignQuantity.DEFLECTION: 'deflection'>, along=''), 'z')
    """
    name, _, along = text.strip().partition(".")
    known = [str(quantity) for quantity in DesignQuantity]
    if name not in known:
        raise ValueError(
            f"'{text}' is no quantity: write one of {', '.join(known)}, perhaps with a component: stiffness.z"
        )
    quantity = DesignQuantity(name)
    if along and (along not in COMPONENTS or quantity in WITHOUT_COMPONENT):
        raise ValueError(f"'{text}': a {name} has no component '{along}'")
    return AskedQuantity(quantity, along or ("x" if quantity is DesignQuantity.STIFFNESS else ""))


def value_in(space: DesignSpace, row: Array, question: Question, of: AskedQuantity) -> float:
    """A quantity of the machine of values ``(k,)``; of a deflection its size, for that is what a design bounds.

    Raises:
        ValueError: there is none.
        NoConvergenceError: there is no equilibrium under the loads.
    """
    if of.quantity is DesignQuantity.COST:
        return space.cost(row, question)
    return abs(value_at(question, *of))


@dataclass(frozen=True)
class SweepTask:
    """Some machines of a sweep, all their cases.

    Attributes:
        space: of the machines.
        rows: values ``(g, k)`` of the numbers.
        quantities: what is asked for.
    """

    space: DesignSpace
    rows: Array
    quantities: tuple[AskedQuantity, ...]


@single_threaded
def evaluated(task: SweepTask) -> tuple[Array, list[list[str]]]:
    """Quantities ``(g, c, q)`` of machines in their cases, nan where there is no answer; and why there is none."""
    cases = task.space.cases
    values = np.full((len(task.rows), len(cases), len(task.quantities)), np.nan)
    why = [[""] * len(cases) for _ in task.rows]
    for i, row in enumerate(task.rows):
        for j, case in enumerate(cases):
            try:
                question = task.space.question(row, case)
                values[i, j] = [value_in(task.space, row, question, each) for each in task.quantities]
            except (ValueError, NoConvergenceError) as error:
                values[i, j], why[i][j] = np.nan, " ".join(str(error).split())
    return values, why


@dataclass(frozen=True)
class Sweep(Outcome):
    """Quantities of the machines of a grid, in each of their cases.

    Attributes:
        space: of the machines, c cases.
        quantities: q that were asked for.
        rows: values ``(g, k)`` of the numbers.
        values: ``(g, c, q)``, nan where there is no answer.
        why: there is no answer, for each machine and case; empty where there is one.

    Example:
        >>> import vjm
        >>> sweep = vjm.sweep("planar-2r", {"tool.mass_kg": [1.0, 2.0]}, ["mass"])
        >>> sweep.front.tolist()
        [True, False]
    """

    space: DesignSpace
    quantities: tuple[AskedQuantity, ...]
    rows: Array
    values: Array
    why: list[list[str]]

    @property
    def worst(self) -> Array:
        """Quantities ``(g, q)`` in the case that is worst for each; nan where one has no answer."""
        sign = signs(self.quantities)
        return np.max(self.values * sign, axis=1) * sign

    @property
    def front(self) -> np.ndarray:
        """Which machines ``(g,)`` no other one beats, each in its worst cases."""
        return pareto(self.worst, self.quantities)

    def to_dict(self) -> dict[str, Any]:
        """Names of numbers and quantities with their units, and `table`."""
        quantities = {str(each): each.unit for each in self.quantities}
        return {"numbers": dict(zip(self.space.keys, self.space.units, strict=True)), "quantities": quantities,
                "machines": self.table()}  # fmt: skip

    def plot(self, ax: Axes | None = None) -> Axes:
        """The second quantity over the first one, or the only one over the first number; worst cases.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import scatter

        columns = [(f"{each}, {each.unit}", self.worst[:, k]) for k, each in enumerate(self.quantities[:2])]
        if len(columns) == 1:
            columns.insert(0, (", ".join(filter(None, (self.space.keys[0], self.space.units[0]))), self.rows[:, 0]))
        return scatter(columns[0], columns[1], self.front, "beaten by no other", ax)

    def table(self) -> list[dict[str, Any]]:
        """A row for each machine and case: its numbers by key, posture, wrench, quantities, front and why."""
        front, names = self.front, [str(each) for each in self.quantities]
        return [
            dict(zip(self.space.keys, row.tolist(), strict=True))
            | {"posture": case.posture, "wrench": case.wrench_text}
            | dict(zip(names, self.values[i, j].tolist(), strict=True))
            | {"front": bool(front[i]), "why": self.why[i][j]}
            for i, row in enumerate(self.rows)
            for j, case in enumerate(self.space.cases)
        ]


class KeptMachines(Protocol):
    """What a sweep knows of its machines from before, and keeps of those that it computes."""

    def find(self, row: Array) -> tuple[Array, list[str]] | None:
        """Quantities ``(c, q)`` of the machine of values ``(k,)``, and why there are none; None where unknown."""

    def keep(self, row: Array, values: Array, why: list[str]) -> None:
        """Keep those of a machine that was computed."""


def swept(
    space: DesignSpace,
    rows: Array,
    quantities: Sequence[AskedQuantity],
    jobs: int = 1,
    progress: Progress | None = None,
    kept: KeptMachines | None = None,
    compute: Callable[..., object] = map_all,
) -> Sweep:
    """Quantities of machines with other numbers.

    Args:
        space: of the machines.
        rows: values ``(g, k)`` of the numbers.
        quantities: what is asked for.
        jobs: processes.
        progress: called with how many machines are done, and of how many.
        kept: machines that are known; they are not computed again.
        compute: does all tasks, as `vjm.batch.map_all` does, perhaps elsewhere.

    Raises:
        ValueError: a cost is asked for, and no formula says it.
    """
    if space.price is None and any(each.quantity is DesignQuantity.COST for each in quantities):
        raise ValueError(NO_COST)
    values = np.full((len(rows), len(space.cases), len(quantities)), np.nan)
    why, todo, done = [[""] * len(space.cases) for _ in rows], list[int](), 0
    for i, row in enumerate(rows):
        known = None if kept is None else kept.find(row)
        if known is None:
            todo.append(i)
        else:
            values[i], why[i] = known
    parcels = [todo[i : i + AT_ONCE] for i in range(0, len(todo), AT_ONCE)]

    def finish(index: int, result: tuple[Array, list[list[str]]]) -> None:
        nonlocal done
        for i, machine_values, said in zip(parcels[index], *result, strict=True):
            values[i], why[i] = machine_values, said
            if kept is not None:
                kept.keep(rows[i], machine_values, said)
        done += len(parcels[index])
        if progress is not None:
            progress(done, len(todo))

    compute(evaluated, [SweepTask(space, rows[own], tuple(quantities)) for own in parcels], jobs, done=finish)
    return Sweep(space, tuple(quantities), rows, values, why)


def sweep(
    model: Designed,
    vary: Mapping[str, Sequence[float]],
    quantities: Iterable[str] = ("mass", "deflection"),
    *,
    cases: LoadCases = NO_LOADS,
    cost: str = "",
    jobs: int = 1,
    progress: Progress | None = None,
) -> Sweep:
    """Quantities of a machine over all combinations of values of its numbers.

    Args:
        model: as for `vjm.load`, or a machine, or a function that makes one of its arguments.
        vary: values of each number by its key: of files see `vjm.io.file_parameters.MachineFiles`, of a machine
            ``part.attribute``, of a function its arguments.
        quantities: ``mass``, ``deflection``, ``deflection.z``, ``stiffness.z``, ``critical``, ``frequency``,
            ``reach``, ``cost``.
        cases: postures and loads in which each machine is computed; its weights count in an optimum, not here.
        cost: formula of what a machine costs, such as ``4.2*mass + 0.1*upper.section.wall_mm``.
        jobs: processes. More than one takes no function that is made inside another one.
        progress: called with how many machines are done, and of how many.

    Raises:
        ModelFileError: there is no such file or number.
        ValueError: no such quantity or posture.

    Example:
        >>> import vjm
        >>> sweep = vjm.sweep("planar-2r", {"tool.mass_kg": [1.0, 2.0]}, ["mass"])
        >>> [round(row["mass"], 3) for row in sweep.table()]
        [2.403, 3.403]
    """
    space = design_space(model, tuple(vary), cases, cost=cost)
    rows = combined([np.asarray(values, dtype=float) for values in vary.values()])
    return swept(space, rows, [asked(each) for each in quantities], jobs, progress)


def signs(quantities: Sequence[AskedQuantity]) -> Array:
    """1 for each quantity ``(q,)`` of which less is better, else −1."""
    return np.array([1.0 if each.quantity in SMALLER_IS_BETTER else -1.0 for each in quantities])


def pareto(values: Array, quantities: Sequence[AskedQuantity]) -> np.ndarray:
    """Which rows ``(g,)`` of quantities ``(g, q)`` no other row beats: as good in all, and better in one.

    Example:
        >>> front = pareto(np.array([[1.0, 3.0], [2.0, 2.0], [2.0, 4.0]]), [asked("mass"), asked("deflection")])
        >>> front.tolist()
        [True, True, False]
    """
    cost = values * signs(quantities)
    good = np.array([np.isfinite(row).all() for row in cost], dtype=bool)
    result = good.copy()
    for i in np.flatnonzero(good):
        beats = (cost[good] <= cost[i]).all(axis=1) & (cost[good] < cost[i]).any(axis=1)
        result[i] = not beats.any()
    return result


def grid_of(ranges: Mapping[str, tuple[float, float, int]]) -> Array:
    """All combinations ``(g, k)`` of values of some ranges: first, last and how many.

    Example:
        >>> grid_of({"a": (1.0, 2.0, 2), "b": (5.0, 6.0, 2)}).tolist()
        [[1.0, 5.0], [1.0, 6.0], [2.0, 5.0], [2.0, 6.0]]
    """
    return combined([np.linspace(first, last, count) for first, last, count in ranges.values()])


def combined(axes: Sequence[Array]) -> Array:
    """All combinations ``(g, k)`` of values ``(n,)`` of each of k numbers, the last one changing fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
