"""What a machine becomes with other numbers: quantities over grids of them, and the best that limits admit."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import NonlinearConstraint, minimize

from vjm.design.linear_state import LinearState, Question, state_of
from vjm.design.sensitivity import Quantity, derivative_of, unit_of, value_of
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS
from vjm.model.parameters import Parameter
from vjm.rotations import Array
from vjm.threads import single_threaded

SMALLER_IS_BETTER = (Quantity.DEFLECTION, Quantity.MASS)
KEPT = 1e-6
"""Of its limit, by which a constraint may be missed at the optimum: what the optimiser's tolerance leaves."""
ITERATIONS = 100
"""Of the optimiser from one start."""


class Asked(NamedTuple):
    """A quantity that is asked for.

    Attributes:
        quantity: which.
        along: component of a stiffness, or of a deflection, whose size counts; empty for the end's whole shift.
    """

    quantity: Quantity
    along: str = ""

    def __str__(self) -> str:
        return f"{self.quantity}.{self.along}" if self.along else str(self.quantity)

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return unit_of(self.quantity, self.along or "x")


def asked(text: str) -> Asked:
    """A quantity by its name, perhaps with a component.

    Raises:
        ValueError: there is none of the name.

    Example:
        >>> asked("deflection"), asked("stiffness.z").along
        (Asked(quantity=<Quantity.DEFLECTION: 'deflection'>, along=''), 'z')
    """
    name, _, along = text.strip().partition(".")
    known = [str(quantity) for quantity in Quantity]
    if name not in known:
        raise ValueError(
            f"'{text}' is no quantity: write one of {', '.join(known)}, perhaps with a component: stiffness.z"
        )
    quantity = Quantity(name)
    if along and (along not in COMPONENTS or quantity in (Quantity.FREQUENCY, Quantity.MASS)):
        raise ValueError(f"'{text}': a {name} has no component '{along}'")
    return Asked(quantity, along or ("x" if quantity is Quantity.STIFFNESS else ""))


class Limit(NamedTuple):
    """A bound on a quantity.

    Attributes:
        of: the quantity.
        most: whether it is an upper bound.
        value: of the bound.
    """

    of: Asked
    most: bool
    value: float

    def __str__(self) -> str:
        return f"{self.of} {'<=' if self.most else '>='} {self.value:g} {self.of.unit}"

    def margin(self, value: float) -> float:
        """How far a value is within the bound, over its size; negative beyond it."""
        sign = 1.0 if self.most else -1.0
        return sign * (self.value - value) / abs(self.value)


def limits_of(text: str) -> list[Limit]:
    """Bounds as they are written, with ``;`` between them.

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
        found = re.fullmatch(r"\s*([\w.]+)\s*(<=|>=)\s*([-+\d.eE]+)\s*", part)
        if not found:
            raise ValueError(f"'{part.strip()}' is no bound: write one such as deflection<=0.2")
        try:
            value = float(found[3])
        except ValueError:
            raise ValueError(f"'{part.strip()}': '{found[3]}' is no number") from None
        if not value:
            raise ValueError(f"'{part.strip()}': a bound of zero has no size: give another")
        result.append(Limit(asked(found[1]), found[2] == "<=", value))
    return result


def _value(state: LinearState, of: Asked) -> float:
    """A quantity; of a deflection its size, for that is what a design bounds."""
    return abs(value_of(state, *of))


QuestionAt = Callable[[Array], Question]
"""The machine with values ``(k,)`` of its parameters, and what is done to it."""


@single_threaded
def swept(question_at: QuestionAt, rows: Array, quantities: Sequence[Asked]) -> tuple[Array, list[str]]:
    """Quantities of machines with other numbers.

    Args:
        question_at: makes each machine.
        rows: values ``(g, k)`` of its parameters.
        quantities: what is asked for.

    Returns:
        ``(g, q)``, nan where there is no answer; and why there is none, empty where there is one.
    """
    values, why = np.full((len(rows), len(quantities)), np.nan), [""] * len(rows)
    for i, row in enumerate(rows):
        try:
            state = state_of(question_at(row))
            values[i] = [_value(state, each) for each in quantities]
        except (ValueError, NoConvergenceError) as error:
            values[i], why[i] = np.nan, " ".join(str(error).split())
    return values, why


def pareto(values: Array, quantities: Sequence[Asked]) -> np.ndarray:
    """Which rows ``(g,)`` of quantities ``(g, q)`` no other row beats: as good in all, and better in one.

    Example:
        >>> front = pareto(np.array([[1.0, 3.0], [2.0, 2.0], [2.0, 4.0]]), [asked("mass"), asked("deflection")])
        >>> front.tolist()
        [True, True, False]
    """
    cost = values * np.array([1.0 if each.quantity in SMALLER_IS_BETTER else -1.0 for each in quantities])
    good = np.isfinite(cost).all(axis=1)
    result = good.copy()
    for i in np.flatnonzero(good):
        beats = (cost[good] <= cost[i]).all(axis=1) & (cost[good] < cost[i]).any(axis=1)
        result[i] = not beats.any()
    return result


@dataclass(frozen=True)
class Optimum:
    """What an optimisation found.

    Attributes:
        values: of the parameters ``(k,)``.
        objective: its value there.
        quantities: values of the bounded quantities, in the order of the limits.
        kept: whether all limits are kept.
        agreeing: starts that ended there, to a thousandth of the objective.
        starts: number of starts.
        evaluations: machines that were computed.
    """

    values: Array
    objective: float
    quantities: Array
    kept: bool
    agreeing: int
    starts: int
    evaluations: int


class _Machines:
    """Values and gradients of quantities at machines, each machine solved once."""

    def __init__(self, question_at: QuestionAt, parameters_at: Callable[[Array], Sequence[Parameter]]) -> None:
        self._question_at, self._parameters_at = question_at, parameters_at
        self._states: dict[bytes, LinearState | None] = {}

    @property
    def count(self) -> int:
        return len(self._states)

    def state(self, row: Array) -> LinearState | None:
        key = row.tobytes()
        if key not in self._states:
            try:
                self._states[key] = state_of(self._question_at(row))
            except (ValueError, NoConvergenceError):
                self._states[key] = None
        return self._states[key]

    def value(self, row: Array, of: Asked) -> float:
        state = self.state(row)
        if state is None:
            return float("nan")
        try:
            return _value(state, of)
        except ValueError:
            return float("nan")

    def gradient(self, row: Array, of: Asked) -> Array:
        """By the logarithms of the parameters."""
        state = self.state(row)
        if state is None:
            return np.full(len(row), np.nan)
        side = -1.0 if value_of(state, *of) < 0.0 else 1.0
        return side * np.array([derivative_of(state, p, *of) * p.value for p in self._parameters_at(row)])


def _scaled(
    machines: _Machines, of: Asked, factor: float
) -> tuple[Callable[[Array], float], Callable[[Array], Array]]:
    """A quantity and its gradient, times a factor, by the logarithms of the parameters."""

    def value(y: Array) -> float:
        return factor * machines.value(np.exp(y), of)

    def gradient(y: Array) -> Array:
        return factor * machines.gradient(np.exp(y), of)

    return value, gradient


def _constraint(machines: _Machines, limit: Limit) -> NonlinearConstraint:
    """A limit over its size, for the optimiser."""
    value, gradient = _scaled(machines, limit.of, 1.0 / abs(limit.value))
    bound = float(np.sign(limit.value))

    def values(y: Array) -> list[float]:
        return [value(y)]

    return NonlinearConstraint(
        values, -np.inf if limit.most else bound, bound if limit.most else np.inf, jac=gradient
    )


@single_threaded
def optimised(
    question_at: QuestionAt,
    parameters_at: Callable[[Array], Sequence[Parameter]],
    bounds: Array,
    start: Array,
    objective: Asked,
    limits: Sequence[Limit],
    starts: int = 3,
) -> Optimum:
    """The parameters within bounds that make a quantity best and keep limits on others.

    By sequential quadratic programming (SciPy's SLSQP) on the logarithms of the parameters, with exact gradients,
    from several starts: the present values, and a Latin hypercube.

    Args:
        question_at: makes the machine of values ``(k,)``.
        parameters_at: its parameters there, in the order of the values.
        bounds: ``(k, 2)``, positive.
        start: present values ``(k,)``; outside their bounds the nearest bound is taken.
        objective: smaller is better of a deflection and a mass, larger of a stiffness and a frequency.
        limits: on quantities.
        starts: how many.

    Raises:
        ValueError: bounds that are not positive and ordered.
        NoConvergenceError: no start led to a machine that has the quantities.
    """
    # imported when it is asked for: it takes a third of a second, which a sweep does not need
    from scipy.stats import qmc

    if not (np.all(bounds > 0.0) and np.all(bounds[:, 0] < bounds[:, 1])):
        raise ValueError("bounds must be positive, the smaller first")
    low, high = np.log(bounds).T
    machines = _Machines(question_at, parameters_at)
    sign = 1.0 if objective.quantity in SMALLER_IS_BETTER else -1.0
    begins = [np.clip(np.log(np.clip(start, *bounds.T)), low, high)]
    if starts > 1:
        begins += list(low + (high - low) * qmc.LatinHypercube(len(low), seed=0).random(starts - 1))
    ends: list[tuple[bool, float, Array]] = []
    for begin in begins:
        size = abs(machines.value(np.exp(begin), objective))
        if not np.isfinite(size) or not size:
            continue
        fun, jac = _scaled(machines, objective, sign / size)
        found = minimize(
            fun,
            begin,
            jac=jac,
            bounds=list(zip(low.tolist(), high.tolist(), strict=True)),
            constraints=[_constraint(machines, limit) for limit in limits],
            method="SLSQP",
            options={"maxiter": ITERATIONS, "ftol": 1e-10},
        )
        row = np.exp(np.clip(found.x, low, high))
        value = machines.value(row, objective)
        margins = [limit.margin(machines.value(row, limit.of)) for limit in limits]
        if np.isfinite(value) and np.all(np.isfinite(margins)):
            ends.append((all(margin >= -KEPT for margin in margins), value, row))
    if not ends:
        raise NoConvergenceError("no start led to a machine in equilibrium that has these quantities")
    kept, value, row = min(ends, key=lambda end: (not end[0], sign * end[1]))
    agreeing = sum(end[0] == kept and abs(end[1] - value) <= 1e-3 * abs(value) for end in ends)
    quantities = np.array([machines.value(row, limit.of) for limit in limits])
    return Optimum(row, value, quantities, kept, agreeing, len(begins), machines.count)


def grid_of(ranges: Mapping[str, tuple[float, float, int]]) -> Array:
    """All combinations ``(g, k)`` of values of some ranges: first, last and how many.

    Example:
        >>> grid_of({"a": (1.0, 2.0, 2), "b": (5.0, 6.0, 2)}).tolist()
        [[1.0, 5.0], [1.0, 6.0], [2.0, 5.0], [2.0, 6.0]]
    """
    axes = [np.linspace(first, last, count) for first, last, count in ranges.values()]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
