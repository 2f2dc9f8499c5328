"""The numbers of a machine's files that make a quantity best and keep limits on others."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from vjm.design.linear_state import Question
from vjm.design.sensitivity import DesignQuantity, derivative_at, value_at
from vjm.design.space import DesignCase, DesignSpace
from vjm.design.sweep import AskedQuantity, asked, signs, value_asked
from vjm.errors import NoConvergenceError
from vjm.io.catalogues import Row
from vjm.io.file_parameters import Numbered
from vjm.io.provenance import OtherInputsError, Provenance
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.outcome import Outcome
from vjm.rotations import Array
from vjm.threads import single_threaded

if TYPE_CHECKING:
    from vjm.notebook import Axes

OptimumProgress: TypeAlias = Callable[[int, float | None], None]
"""Called with how many machines were computed, and the best objective that keeps the limits, if there is one."""
EVERY_S = 2.0
"""Seconds between two writings of what is known: as much can be lost."""
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
class Optimum(Outcome):
    """What an optimisation found.

    Attributes:
        space: of the machines; with the standard parts that were chosen.
        bounds: ``(k, 2)`` of the numbers.
        of: what was made best.
        limits: on other quantities.
        values: of the numbers ``(k,)``.
        objective: its value there, in the case that is worst for it.
        quantities: values of the bounded quantities, in the order of the limits, each in its worst case.
        kept: whether all limits are kept.
        agreeing: starts that ended there, to a thousandth of the objective.
        starts: number of starts.
        evaluations: machines that were computed.
        interrupted: whether it was ended before its time: the best so far.
        chosen: row of a catalogue by the key of what it is for.
    """

    space: DesignSpace
    bounds: Array
    of: AskedQuantity
    limits: tuple[QuantityLimit, ...]
    values: Array
    objective: float
    quantities: Array
    kept: bool
    agreeing: int
    starts: int
    evaluations: int
    interrupted: bool = False
    chosen: Mapping[str, Row] = field(default_factory=dict)

    @property
    def best(self) -> Numbered:
        """What makes the best machine: its files, where it has some."""
        return self.space.changed(self.values)

    @property
    def machine(self) -> Machine:
        """The best machine."""
        return self.best.machine()

    def table(self) -> list[dict[str, Any]]:
        """A row for each number and each standard part: its key, unit and value, and whether it is at its bound."""
        rows: list[dict[str, Any]] = [
            {"number": key, "unit": unit, "value": value, "at_bound": bool(np.isclose(value, pair).any())}
            for key, unit, value, pair in zip(
                self.space.keys, self.space.units, self.values.tolist(), self.bounds, strict=True
            )
        ]
        parts = [(key, told_row(row)) for key, row in self.chosen.items()]
        return [*rows, *({"number": key, "unit": "", "value": text, "at_bound": False} for key, text in parts)]

    def to_dict(self) -> dict[str, Any]:
        """The objective, the limits with the values of what they bound, and `table`."""
        limits = [
            {"limit": str(limit), "value": value}
            for limit, value in zip(self.limits, self.quantities.tolist(), strict=True)
        ]
        return {"of": str(self.of), "unit": self.of.unit, "value": self.objective, "kept": self.kept,
                "limits": limits, "numbers": self.table(), "starts": self.starts, "agreeing": self.agreeing,
                "machines": self.evaluations, "interrupted": self.interrupted}  # fmt: skip

    def plot(self, ax: Axes | None = None) -> Axes:
        """Where each number lies between its bounds, 0 and 1.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.notebook import bars

        low, high = self.bounds.T
        ax = bars(list(self.space.keys), (self.values - low) / (high - low), "place between the bounds", ax)
        ax.set_xlim(0.0, 1.0)
        return ax


def told_row(row: Row) -> str:
    """A row of a catalogue in words: its name, or its columns."""
    name = row.get("name")
    return str(name) if name else ", ".join(f"{key} {cell}" for key, cell in row.items())


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


class Evaluations:
    """Values and gradients that were computed, in a file if there is one: a run that was interrupted goes on."""

    def __init__(self, file: Path | None = None, made_of: Provenance | None = None) -> None:
        """Open a file, or none.

        Raises:
            OtherInputsError: it is of another machine or question.
        """
        self._file, self._made_of = file, made_of
        self._known: dict[str, list[float]] = {}
        self._machines: set[str] = set()
        self._due = 0.0
        if file is None or made_of is None or not file.exists():
            return
        kept = made_of.kept(file)
        if kept is None:
            try:
                earlier = json.loads(file.read_bytes())["made_of"]
            except (ValueError, LookupError, TypeError):
                earlier = None
            remedy = "give another name, or remove it"
            made_of.check(earlier, f"{file}: is of another machine or question", remedy)
            raise OtherInputsError(f"{file}: is not as it was written: {remedy}")
        self._known = kept

    @property
    def count(self) -> int:
        """How many machines were asked for."""
        return len(self._machines)

    def found(self, machine: str, what: str, compute: Callable[[], list[float]]) -> Array:
        """What was computed of a machine, or is now."""
        self._machines.add(machine)
        key = f"{machine} {what}"
        if key not in self._known:
            self._known[key] = compute()
            if self._file is not None and time.monotonic() > self._due:
                began = time.monotonic()
                self.write()
                self._due = began + max(EVERY_S, 10.0 * (time.monotonic() - began))
        return np.array(self._known[key])

    def write(self) -> None:
        """Write the file anew, if there is one: whole or not at all."""
        if self._file is not None and self._made_of is not None:
            self._made_of.keep(self._file, self._known)


class _Machines:
    """Values and gradients of quantities at machines in their cases, each computed once."""

    def __init__(self, space: DesignSpace, evaluations: Evaluations, label: str) -> None:
        self._space, self._evaluations, self._label = space, evaluations, label
        self._questions: dict[bytes, list[Question | None]] = {}
        self._parameters: dict[tuple[bytes, int], list[Parameter]] = {}

    @property
    def count(self) -> int:
        """How many machines were computed."""
        return self._evaluations.count

    def cases(self, of: AskedQuantity) -> range:
        """Numbers of the cases in which a quantity differs."""
        return range(1 if of.quantity is DesignQuantity.MASS else len(self._space.cases))

    def _question(self, row: Array, case: int) -> Question | None:
        key = row.tobytes()
        if key not in self._questions:
            self._questions = {key: [self._made(row, each) for each in self._space.cases]}
        return self._questions[key][case]

    def _made(self, row: Array, case: DesignCase) -> Question | None:
        try:
            return self._space.question(row, case)
        except (ValueError, NoConvergenceError):
            return None

    def _named(self, row: Array) -> str:
        return f"{self._label}{' '.join(value.hex() for value in row.tolist())}"

    def value(self, row: Array, of: AskedQuantity, case: int) -> float:
        """A quantity; nan where there is none."""
        return float(
            self._evaluations.found(self._named(row), f"{case} {of}", lambda: [self._value(row, of, case)])[0]
        )

    def _value(self, row: Array, of: AskedQuantity, case: int) -> float:
        question = self._question(row, case)
        try:
            return float("nan") if question is None else value_asked(question, of)
        except (ValueError, NoConvergenceError):
            return float("nan")

    def worst(self, row: Array, of: AskedQuantity) -> float:
        """A quantity in the case that is worst for it; nan where one has none."""
        (sign,) = signs([of])
        return float(sign * np.max([sign * self.value(row, of, case) for case in self.cases(of)]))

    def gradient(self, row: Array, of: AskedQuantity, case: int) -> Array:
        """By the logarithms of the numbers ``(k,)``; nan where there is none."""
        return self._evaluations.found(
            self._named(row), f"{case} {of} by", lambda: self._gradient(row, of, case).tolist()
        )

    def _gradient(self, row: Array, of: AskedQuantity, case: int) -> Array:
        question = self._question(row, case)
        if question is None or not np.isfinite(self.value(row, of, case)):
            return np.full(len(row), np.nan)
        side = -1.0 if value_at(question, *of) < 0.0 else 1.0
        key = row.tobytes(), case
        if key not in self._parameters:
            # quantities of a case share its changed machines, which are found by their parameter
            self._parameters = {key: self._space.parameters(row, self._space.cases[case])}
        return side * np.array([derivative_at(question, p, *of) * p.value for p in self._parameters[key]])


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
        progress: OptimumProgress | None,
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
    progress: OptimumProgress | None = None,
    evaluations: Evaluations | None = None,
    chosen: Mapping[str, Row] | None = None,
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
        evaluations: what is known already.
        chosen: standard parts of the space's machines, by which they are known among the evaluations.

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
    label = f"{json.dumps(dict(chosen), sort_keys=True)} {' '.join(space.keys)} " if chosen else ""
    machines, (sign,) = _Machines(space, evaluations or Evaluations(), label), signs([objective])
    if not space.keys:
        # without numbers there is one machine
        begins, starts = list[Array](), 1
    else:
        begins = [np.clip(np.log(np.clip(space.present, *bounds.T)), low, high)]
    if begins and starts > 1:
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
    return Optimum(
        space, bounds, objective, tuple(limits), row, value, quantities, not missed, agreeing, len(begins),
        machines.count, interrupted, chosen or {},
    )  # fmt: skip


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
