"""The Pareto front of two quantities of a design: the best machines between the best for the one and for the other.

One quantity is made best while the other one is bounded, at values between those at the two ends. The bounds are
evenly spread: a front of machines that vary continuously is followed wherever it lies, convex or not.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vjm.design.best_machine import CatalogueSearch, Choices, divided, made_of
from vjm.design.maker import Designed
from vjm.design.optimum import Evaluations, Optimum, OptimumProgress, QuantityLimit, limits_of
from vjm.design.space import NO_LOADS, DesignSpace, LoadCases, design_space
from vjm.design.sweep import SMALLER_IS_BETTER, AskedQuantity, asked, pareto
from vjm.errors import NoConvergenceError
from vjm.io.catalogues import Row
from vjm.outcome import Outcome
from vjm.rotations import Array

if TYPE_CHECKING:
    from vjm.notebook import Axes


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
        from vjm.notebook import scatter

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
        found = search.best(choices)
        if found.interrupted:
            raise KeyboardInterrupt
        return found

    found: list[Optimum] = []
    less = second.quantity in SMALLER_IS_BETTER
    interrupted = False
    try:
        least = best(second, [])
        edge = QuantityLimit(second, less, least.objective * (1.0 + (SLACK if less else -SLACK)))
        found.append(best(first, [edge]))
        # any value of the second quantity will do, so that its own is told beside
        loose = best(first, [QuantityLimit(second, less, ANY if less else 1.0 / ANY)])
        found.append(loose)
        far = front_values(loose)[1]
        for bound in np.linspace(edge.value, far, points)[1:-1]:
            found.append(best(first, [QuantityLimit(second, less, float(bound))]))
    except KeyboardInterrupt:
        if not found:
            raise
        interrupted = True
    finally:
        evaluations.write()
    kept = [each for each in found if each.kept]
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
