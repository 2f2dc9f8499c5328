"""The numbers of a machine's files that make a quantity best and keep limits on others."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from vjm.design.linear_state import Question
from vjm.design.sensitivity import DesignQuantity, derivative_at, value_at
from vjm.design.space import DesignCase, DesignSpace
from vjm.design.sweep import AskedQuantity, asked, signs, value_asked
from vjm.errors import NoConvergenceError
from vjm.model.parameters import Parameter
from vjm.rotations import Array
from vjm.threads import single_threaded

TIGHTER = 1e-6
"""Of its limit, by which a constraint is tightened: the optimiser's tolerance leaves as much. So the limit itself
is kept, and not all but kept."""
ITERATIONS = 100
"""Of the optimiser from one start."""


class QuantityLimit(NamedTuple):
    """A bound on a quantity.

    Attributes:
        of: the quantity.
        most: whether it is an upper bound.
        value: of the bound.
    """

    of: AskedQuantity
    most: bool
    value: float

    def __str__(self) -> str:
        return f"{self.of} {'<=' if self.most else '>='} {self.value:g} {self.of.unit}"

    def margin(self, value: float) -> float:
        """How far a value is within the bound, over its size; negative beyond it."""
        sign = 1.0 if self.most else -1.0
        return sign * (self.value - value) / abs(self.value)


def limits_of(text: str) -> list[QuantityLimit]:
    """Bounds as they are written, with ``;`` between them; ``critical>=3*load`` is one of the factor 3.

    Raises:
        ValueError: it is no bound, or zero, which has no size.

    Example:
        >>> [str(limit) for limit in limits_of("deflection<=0.2; frequency>=20")]
        ['deflection <= 0.2 mm', 'frequency >= 20 Hz']
    """
    result = []
    for part in text.split(";"):
        if not part.strip():
            continue
        found = re.fullmatch(r"\s*([\w.]+)\s*(<=|>=)\s*([-+\d.eE]+)(\s*\*\s*load)?\s*", part)
        if not found:
            raise ValueError(f"'{part.strip()}' is no bound: write one such as deflection<=0.2")
        try:
            value = float(found[3])
        except ValueError:
            raise ValueError(f"'{part.strip()}': '{found[3]}' is no number") from None
        if not value:
            raise ValueError(f"'{part.strip()}': a bound of zero has no size: give another")
        of = asked(found[1])
        if found[4] and of.quantity is not DesignQuantity.CRITICAL:
            raise ValueError(f"'{part.strip()}': only a critical load is told in loads: critical>=3*load")
        result.append(QuantityLimit(of, found[2] == "<=", value))
    return result


@dataclass(frozen=True)
class Optimum:
    """What an optimisation found.

    Attributes:
        values: of the numbers ``(k,)``.
        objective: its value there, in the case that is worst for it.
        quantities: values of the bounded quantities, in the order of the limits, each in its worst case.
        kept: whether all limits are kept.
        agreeing: starts that ended there, to a thousandth of the objective.
        starts: number of starts.
        evaluations: machines that were computed.
        interrupted: whether it was ended before its time: the best so far.
    """

    values: Array
    objective: float
    quantities: Array
    kept: bool
    agreeing: int
    starts: int
    evaluations: int
    interrupted: bool = False


class _Candidate(NamedTuple):
    """A machine that has the quantities.

    Attributes:
        missed: by how much it misses the limit that it misses most, over its size; zero where it keeps all.
        rank: the objective, smaller is better.
        value: the objective.
        row: its numbers.
    """

    missed: float
    rank: float
    value: float
    row: Array

    @property
    def key(self) -> tuple[float, float]:
        """The smaller, the better."""
        return self.missed, self.rank


class _Machines:
    """Values and gradients of quantities at machines in their cases, each computed once."""

    def __init__(self, space: DesignSpace) -> None:
        self._space = space
        self._questions: dict[bytes, list[Question | None]] = {}
        self._values: dict[tuple[bytes, int, AskedQuantity], float] = {}
        self._gradients: dict[tuple[bytes, int, AskedQuantity], Array] = {}
        self._parameters: dict[tuple[bytes, int], list[Parameter]] = {}

    @property
    def count(self) -> int:
        """How many machines were computed."""
        return len(self._questions)

    def cases(self, of: AskedQuantity) -> range:
        """Numbers of the cases in which a quantity differs."""
        return range(1 if of.quantity is DesignQuantity.MASS else len(self._space.cases))

    def _question(self, row: Array, case: int) -> Question | None:
        key = row.tobytes()
        if key not in self._questions:
            self._questions[key] = [self._made(row, each) for each in self._space.cases]
        return self._questions[key][case]

    def _made(self, row: Array, case: DesignCase) -> Question | None:
        try:
            return self._space.question(row, case)
        except (ValueError, NoConvergenceError):
            return None

    def value(self, row: Array, of: AskedQuantity, case: int) -> float:
        """A quantity; nan where there is none."""
        key = row.tobytes(), case, of
        if key not in self._values:
            question = self._question(row, case)
            try:
                self._values[key] = float("nan") if question is None else value_asked(question, of)
            except (ValueError, NoConvergenceError):
                self._values[key] = float("nan")
        return self._values[key]

    def worst(self, row: Array, of: AskedQuantity) -> float:
        """A quantity in the case that is worst for it; nan where one has none."""
        (sign,) = signs([of])
        return float(sign * np.max([sign * self.value(row, of, case) for case in self.cases(of)]))

    def gradient(self, row: Array, of: AskedQuantity, case: int) -> Array:
        """By the logarithms of the numbers ``(k,)``; nan where there is none."""
        key = row.tobytes(), case, of
        if key not in self._gradients:
            self._gradients[key] = self._gradient(row, of, case)
        return self._gradients[key]

    def _gradient(self, row: Array, of: AskedQuantity, case: int) -> Array:
        question = self._question(row, case)
        if question is None or not np.isfinite(self.value(row, of, case)):
            return np.full(len(row), np.nan)
        side = -1.0 if value_at(question, *of) < 0.0 else 1.0
        key = row.tobytes(), case
        if key not in self._parameters:
            # quantities of a case share its changed machines, which are found by their parameter
            self._parameters = {key: self._space.parameters(row, self._space.cases[case])}
        parameters = self._parameters[key]
        return side * np.array([derivative_at(question, p, *of) * p.value for p in parameters])


@dataclass(frozen=True)
class _Row:
    """A quantity in a case, times a factor, between bounds.

    Its variables ``(k + 1,)`` are the logarithms of the numbers and a bound on the objective, which is taken away
    where the quantity is the objective.
    """

    machines: _Machines
    of: AskedQuantity
    case: int
    factor: float
    low: float
    high: float
    objective: bool = False

    def value(self, z: Array) -> list[float]:
        own = self.factor * self.machines.value(np.exp(z[:-1]), self.of, self.case)
        return [own - float(z[-1]) if self.objective else own]

    def gradient(self, z: Array) -> Array:
        own = self.factor * self.machines.gradient(np.exp(z[:-1]), self.of, self.case)
        return np.append(own, -1.0 if self.objective else 0.0)

    @property
    def constraint(self) -> NonlinearConstraint:
        """For the optimiser."""
        return NonlinearConstraint(self.value, self.low, self.high, jac=self.gradient)


class _Watch:
    """Looks at each machine that the optimiser comes to, and remembers the best."""

    def __init__(
        self, machines: _Machines, objective: AskedQuantity, limits: Sequence[QuantityLimit],
        progress: Callable[[int, float | None], None] | None,
    ) -> None:  # fmt: skip
        (self._sign,) = signs([objective])
        self._machines, self._objective, self._limits, self._progress = machines, objective, limits, progress
        self.best: _Candidate | None = None

    def look(self, row: Array) -> _Candidate | None:
        """A machine; None where it lacks one of the quantities."""
        value = self._machines.worst(row, self._objective)
        margins = [limit.margin(self._machines.worst(row, limit.of)) for limit in self._limits]
        found = None
        if np.isfinite(value) and np.all(np.isfinite(margins)):
            found = _Candidate(max(0.0, -min(margins, default=0.0)), self._sign * value, value, row)
            if self.best is None or found.key < self.best.key:
                self.best = found
        if self._progress is not None:
            kept = self.best is not None and not self.best.missed
            self._progress(self._machines.count, self.best.value if self.best is not None and kept else None)
        return found


@single_threaded
def optimised(
    space: DesignSpace,
    bounds: Array,
    objective: AskedQuantity,
    limits: Sequence[QuantityLimit],
    starts: int = 3,
    progress: Callable[[int, float | None], None] | None = None,
) -> Optimum:
    """The numbers within bounds that make a quantity best and keep limits on others, in every case.

    By sequential quadratic programming (SciPy's SLSQP) on the logarithms of the numbers, with exact gradients, from
    several starts: the present values, and a Latin hypercube. Of several cases the worst one counts: each has its
    own limits, and a bound on the objective that is then minimised.

    Args:
        space: of the machines.
        bounds: ``(k, 2)``, positive. Present values outside of them are moved to the nearest bound.
        objective: smaller is better of a deflection and a mass, larger of the others.
        limits: on quantities.
        starts: how many.
        progress: called with the number of machines so far, and the best objective that keeps the limits, if any.

    The present values themselves are among the machines, so that none that is worse is given. An interrupt gives
    the best so far, or goes on where there is none.

    Raises:
        ValueError: bounds that are not positive and ordered.
        NoConvergenceError: no start led to a machine that has the quantities.
    """
    # imported when it is asked for: it takes a third of a second, which a sweep does not need
    from scipy.stats import qmc

    if not (np.all(bounds > 0.0) and np.all(bounds[:, 0] < bounds[:, 1])):
        raise ValueError("bounds must be positive, the smaller first")
    low, high = np.log(bounds).T
    machines, (sign,) = _Machines(space), signs([objective])
    begins = [np.clip(np.log(np.clip(space.present, *bounds.T)), low, high)]
    if starts > 1:
        begins += list(low + (high - low) * qmc.LatinHypercube(len(low), seed=0).random(starts - 1))
    within = [
        _Row(machines, limit.of, case, 1.0 / abs(limit.value), *_sides(limit))
        for limit in limits
        for case in machines.cases(limit.of)
    ]
    watch, ends, interrupted = _Watch(machines, objective, limits, progress), [], False
    try:
        if np.all((bounds[:, 0] <= space.present) & (space.present <= bounds[:, 1])):
            watch.look(space.present)
        for begin in begins:
            size = abs(machines.worst(np.exp(begin), objective))
            if not np.isfinite(size) or not size:
                continue
            best = [
                _Row(machines, objective, case, sign / size, -np.inf, 0.0, objective=True)
                for case in machines.cases(objective)
            ]
            end = _least(np.append(begin, sign), (low, high), [*within, *best], watch)
            ends.append(watch.look(np.exp(np.clip(end, low, high))))
    except KeyboardInterrupt:
        if watch.best is None:
            raise
        interrupted = True
    if watch.best is None:
        raise NoConvergenceError("no start led to a machine in equilibrium that has these quantities")
    missed, _, value, row = watch.best
    agreeing = sum(
        end is not None and (not end.missed) == (not missed) and abs(end.value - value) <= 1e-3 * abs(value)
        for end in ends
    )
    quantities = np.array([machines.worst(row, limit.of) for limit in limits])
    return Optimum(row, value, quantities, not missed, agreeing, len(begins), machines.count, interrupted)


def _sides(limit: QuantityLimit) -> tuple[float, float]:
    """Bounds on a quantity over the size of its limit, a little within it."""
    side = float(np.sign(limit.value))
    return (-np.inf, side - TIGHTER) if limit.most else (side + TIGHTER, np.inf)


def _least(begin: Array, bounds: tuple[Array, Array], rows: Sequence[_Row], watch: _Watch) -> Array:
    """Logarithms of the numbers ``(k,)`` that make the bound on the objective least.

    The worst of several cases has a corner where another one becomes the worst; a bound on all of them has none.
    """
    box = Bounds(np.append(bounds[0], -np.inf), np.append(bounds[1], np.inf))
    last = np.append(np.zeros(len(begin) - 1), 1.0)

    def bound(z: Array) -> float:
        watch.look(np.exp(np.clip(z[:-1], *bounds)))
        return float(z[-1])

    def rate(_: Array) -> Array:
        return last

    found: Any = minimize(
        bound, begin, jac=rate, bounds=box, constraints=[row.constraint for row in rows],
        method="SLSQP", options={"maxiter": ITERATIONS, "ftol": 1e-10},
    )  # fmt: skip
    result: Array = found.x[:-1]
    return result
