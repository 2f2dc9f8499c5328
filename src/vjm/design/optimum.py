"""The numbers of a machine's files that make a quantity best and keep limits on others.

The design is computed again with twice as many springs, and with finite elements.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, assert_never

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from vjm.design.changes import STEP, difference
from vjm.design.critical import NoCriticalLoadError
from vjm.design.linear_state import Question
from vjm.design.sensitivity import UNLOADED, DesignQuantity, derivative_at, value_at
from vjm.design.space import DesignCase, DesignSpace, HeldTool
from vjm.design.sweep import AskedQuantity, asked, signs, value_in
from vjm.engines import EngineOptions, VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.catalogues import Row
from vjm.io.file_parameters import Numbered
from vjm.io.provenance import OtherInputsError, Provenance
from vjm.model.load_case import COMPONENTS, LOAD, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.outcome import Outcome
from vjm.rotations import Array
from vjm.threads import single_threaded

if TYPE_CHECKING:
    from vjm.continuation.path import Path as EquilibriumPath
    from vjm.outcome import Axes


ELEMENTS = 8
"""In each beam; half as many state the error."""
FURTHER = 1.2
"""Times a critical load, up to where finite elements look for it."""
TOLD = 5e-6
"""Half a unit of the sixth digit, over a value: results are told with six digits."""
NO_LOAD = Load((0.0, 0.0, 1e-9, 0.0, 0.0, 0.0))
"""N: no machine moves by a thing that counts under it; a path needs some load."""


@dataclass(frozen=True)
class Confirmation:
    """A quantity of a design by other models of its beams.

    Attributes:
        of: the quantity.
        value: as the design has it, in the worst case or the weighted mean.
        refined: with twice as many springs; nan where there is no answer.
        elements: with finite elements; nan where there is no answer.
        error: stated of the last two: what half as many springs, and half as many elements, change.
        why: there is no answer of one; empty where there are both.
    """

    of: AskedQuantity
    value: float
    refined: float
    elements: float
    error: float
    why: str

    @property
    def doubt(self) -> str:
        """In what they differ by more than they state; empty where they agree."""
        first, second = abs(self.value - self.refined), abs(self.refined - self.elements)
        size = TOLD * abs(self.value)
        if second > self.error + size:
            return f"springs and finite elements differ by {second:.3g} {self.of.unit}, more than their errors"
        if first > size:
            changed = f"twice as many springs change it by {first:.3g} {self.of.unit}"
            return f"{changed}: write more `segments` into its beams"
        return ""


def confirmed(
    space: DesignSpace, row: Array, quantities: dict[AskedQuantity, float], *, worst: bool = True
) -> list[Confirmation]:
    """Quantities of a machine by finer models; those that no spring changes are left out.

    Args:
        space: of the machine.
        row: its numbers ``(k,)``.
        quantities: that are asked for, with their values.
        worst: of the cases the worst one counts; else their weighted mean, where they have weights.
    """
    judged = replace(space, weights=()) if worst else space
    fine = replace(space, engine=_twice(space))
    return [_confirmed(judged, fine, row, *each) for each in quantities.items() if each[0].quantity not in UNLOADED]


def _confirmed(space: DesignSpace, fine: DesignSpace, row: Array, of: AskedQuantity, value: float) -> Confirmation:
    (sign,) = signs([of])

    def of_all(quantity: Callable[[DesignCase], float]) -> float:
        return space.in_all_cases(np.array([quantity(case) for case in space.cases]), sign)

    def refined_in(case: DesignCase) -> float:
        return value_in(fine, row, fine.question(row, case), of)

    def by_elements(number: int) -> float:
        return of_all(lambda case: _by_elements(space.question(row, case), of, number, value))

    why, refined, elements, error = "", np.nan, np.nan, 0.0
    try:
        refined = of_all(refined_in)
        coarse, elements = by_elements(ELEMENTS // 2), by_elements(ELEMENTS)
        error = abs(value - refined) + abs(coarse - elements)
    except (ValueError, NoConvergenceError, ImportError, np.linalg.LinAlgError) as problem:
        why = " ".join(str(problem).split())
    return Confirmation(of, value, refined, elements, error, why)


def _twice(space: DesignSpace) -> VjmEngine:
    """The engine with twice as many springs in each beam."""
    machine = space.files.machine()
    engine = space.engine or VjmEngine(*machine.usual_segments)
    # a whole beam is one spring, which a section splits and a compliance alone does not
    numbers = {beam.name: beam.segments or 1 for beam in engine.split(machine).beams if beam.section is not None}
    return replace(engine, parts=tuple((name, 2 * n) for name, n in numbers.items()))


def _by_elements(asked: Question, of: AskedQuantity, number: int, factor: float) -> float:
    """A quantity by a number of finite elements in each beam; a critical load is looked for near a factor.

    Raises:
        ValueError: they do not give it.
        NoConvergenceError: their path ends before the load is reached.
        ImportError: they are not installed.
    """
    if asked.end:
        raise ValueError(f"finite elements give the end-effector behind the last part, not end frame '{asked.end}'")
    loads = tuple(replace(load, ramped=True) for load in asked.acting)
    match of.quantity:
        case DesignQuantity.DEFLECTION | DesignQuantity.STIFFNESS:
            to = 1.0
        case DesignQuantity.CRITICAL:
            to = FURTHER * factor
        case DesignQuantity.FREQUENCY:
            raise ValueError("finite elements give no frequencies")
        case DesignQuantity.MASS | DesignQuantity.REACH | DesignQuantity.COST:
            raise ValueError(f"finite elements give no {of.quantity}")
        case _:
            assert_never(of.quantity)
    if not loads and asked.gravity is None:
        loads = (NO_LOAD,)
    case = LoadCase(asked.posture, to, LOAD, free=COMPONENTS, loads=loads, gravity=asked.gravity)
    solver = engine_by_name("exudyn", EngineOptions(number), asked.machine)
    return _of_path(solver.trace(asked.machine, case), of)


def _of_path(path: EquilibriumPath, of: AskedQuantity) -> float:
    if of.quantity is DesignQuantity.CRITICAL:
        if path.critical is None:
            raise ValueError("finite elements find no critical load near")
        return path.critical.s
    last = path.points[-1]
    if not path.complete or last.unstable:
        raise NoConvergenceError(f"finite elements reach {last.s:.1%} of the load: {path.stopped}")
    if of.quantity is DesignQuantity.DEFLECTION:
        moved = last.displacement
        return float(abs(moved[COMPONENTS.index(of.along)]) if of.along else np.linalg.norm(moved[:3]))
    if last.stiffness is None:
        raise ValueError("finite elements give no 6×6 stiffness")
    k = COMPONENTS.index(of.along)
    return float(1.0 / np.linalg.inv(last.stiffness)[k, k])


OptimumProgress: TypeAlias = Callable[[int, float | None], None]
"""Called with how many machines were computed, and the best objective that keeps the limits, if there is one."""
EVERY_S = 2.0
"""Seconds between two writings of what is known: as much can be lost."""
TIGHTER = 1e-6
"""Of its limit, by which a constraint is tightened: the optimiser's tolerance leaves as much. So the limit itself
is kept, and not all but kept."""
ITERATIONS = 100
"""Of the optimiser from one start."""
FAR = 1e3
"""Times the size of a limit by which a machine misses it that cannot be computed."""


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
        match = re.fullmatch(r"\s*([\w.]+)\s*(<=|>=)\s*([-+\d.eE]+)(\s*\*\s*load)?\s*", part)
        if not match:
            raise ValueError(f"'{part.strip()}' is no bound: write one such as deflection<=0.2")
        try:
            value = float(match[3])
        except ValueError:
            raise ValueError(f"'{part.strip()}': '{match[3]}' is no number") from None
        if not value:
            raise ValueError(f"'{part.strip()}': a bound of zero has no size: give another")
        of = asked(match[1])
        if match[4] and of.quantity is not DesignQuantity.CRITICAL:
            raise ValueError(f"'{part.strip()}': only a critical load is told in loads: critical>=3*load")
        result.append(QuantityLimit(of, match[2] == "<=", value))
    return result


@dataclass(frozen=True)
class Optimum(Outcome):
    """What an optimisation found.

    Attributes:
        space: of the machines; with the standard parts that were chosen.
        bounds: ``(k, 2)`` of the numbers.
        of: what was made best.
        limits: on other quantities. A critical load that is not found counts as what it is at least: the factor up
            to which none is.
        values: of the numbers ``(k,)``.
        objective: its value there, in the case that is worst for it, or the weighted mean over the cases.
        quantities: values of the bounded quantities, in the order of the limits, each in its worst case.
        kept: whether all limits are kept.
        agreeing: starts that ended there, to a thousandth of the objective.
        starts: number of starts.
        evaluations: machines that were computed.
        interrupted: whether it was ended before its time: the best so far.
        chosen: row of a catalogue by the key of what it is for.

    Example:
        >>> import vjm
        >>> best = vjm.optimise("planar-2r", {"upper.section.width_mm": (40.0, 90.0)}, minimise="mass", starts=1)
        >>> best.kept, f"{best.objective:.2f} kg", best.machine.name
        (True, '3.08 kg', 'planar-2r')
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
        """What makes the best machine: its files, where it has some, with the postures that hold its tool."""
        numbers = self.space.changed(self.values)
        return numbers.with_postures if isinstance(numbers, HeldTool) else numbers

    @property
    def machine(self) -> Machine:
        """The best machine."""
        return self.best.machine()

    def confirmed(self) -> list[Confirmation]:
        """What was made best and the limited quantities, with twice as many springs and with finite elements."""
        best = confirmed(self.space, self.values, {self.of: self.objective}, worst=False)
        limited = {limit.of: value for limit, value in zip(self.limits, self.quantities.tolist(), strict=True)}
        return [*best, *confirmed(self.space, self.values, limited)]

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
        from vjm.outcome import bars

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

    def value(self, machine: str, what: str, compute: Callable[[], list[float]]) -> Array:
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
        self._parameters: dict[tuple[bytes, int], tuple[list[Parameter], list[Parameter]]] = {}

    @property
    def count(self) -> int:
        """How many machines were computed."""
        return self._evaluations.count

    def cases(self, of: AskedQuantity) -> range:
        """Numbers of the cases in which a quantity differs."""
        return range(1 if of.quantity in UNLOADED else len(self._space.cases))

    def weighted(self, of: AskedQuantity) -> list[tuple[tuple[int, float], ...]]:
        """The cases of what is made best, with their weights: all in one sum, or each by itself."""
        weights, cases = self._space.weights, self.cases(of)
        if not weights or len(cases) == 1:
            return [((case, 1.0),) for case in cases]
        return [tuple((case, weights[case] / sum(weights)) for case in cases if weights[case])]

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
        """A quantity, of a critical load that is not found what it is at least; nan where there is none."""
        return float(
            self._evaluations.value(self._named(row), f"{case} {of}", lambda: [self._value(row, of, case)])[0]
        )

    def _value(self, row: Array, of: AskedQuantity, case: int) -> float:
        question = self._question(row, case)
        try:
            return float("nan") if question is None else value_in(self._space, row, question, of)
        except NoCriticalLoadError as none:
            return min(none.beyond, FAR)
        except (ValueError, NoConvergenceError):
            return float("nan")

    def worst(self, row: Array, of: AskedQuantity) -> float:
        """A quantity in the case that is worst for it; nan where one has none."""
        (sign,) = signs([of])
        return float(sign * np.max([sign * self.value(row, of, case) for case in self.cases(of)]))

    def objective(self, row: Array, of: AskedQuantity) -> float:
        """A quantity that is made best: its weighted mean over the cases, or the worst; nan where one has none."""
        (sign,) = signs([of])
        sums = [sum(w * self.value(row, of, case) for case, w in cases) for cases in self.weighted(of)]
        return float(sign * np.max([sign * each for each in sums]))

    def gradient(self, row: Array, of: AskedQuantity, case: int) -> Array:
        """By the logarithms of the numbers ``(k,)``; nan where there is none."""
        return self._evaluations.value(
            self._named(row), f"{case} {of} by", lambda: self._gradient(row, of, case).tolist()
        )

    def _gradient(self, row: Array, of: AskedQuantity, case: int) -> Array:
        question = self._question(row, case)
        if question is None or not np.isfinite(self.value(row, of, case)):
            return np.full(len(row), np.nan)
        if of.quantity is DesignQuantity.COST:
            return np.array([difference(partial(self._cost, row, k), STEP)[0] for k in range(len(row))])
        key = row.tobytes(), case
        if key not in self._parameters:
            # quantities of a case share its changed machines, which are found by their parameter
            space, design_case = self._space, self._space.cases[case]
            held = space.parameters(row, design_case)
            freed = space.freed.parameters(row, design_case) if isinstance(space.files, HeldTool) else held
            self._parameters = {key: (held, freed)}
        held, freed = self._parameters[key]
        # at the edge of its reach the tool cannot follow a change, by which the mass changes all the same
        parameters = freed if of.quantity in UNLOADED else held
        try:
            side = -1.0 if value_at(question, *of) < 0.0 else 1.0
            return side * np.array([derivative_at(question, p, *of) * p.value for p in parameters])
        except (ValueError, NoConvergenceError):
            return np.full(len(row), np.nan)

    def _cost(self, row: Array, k: int, share: float) -> Array:
        """Cost ``(1,)`` with a share more of number k."""
        space, more = self._space.freed, row * (1.0 + share * np.eye(len(row))[k])
        return np.array([space.cost(more, space.question(more, space.cases[0]))])


@dataclass(frozen=True)
class _Row:
    """A quantity in a case, or its weighted sum over some, times a factor, between bounds.

    Its variables ``(k + 1,)`` are the logarithms of the numbers and a bound on the objective, which is taken away
    where the quantity is the objective.
    """

    machines: _Machines
    of: AskedQuantity
    cases: tuple[tuple[int, float], ...]
    factor: float
    low: float
    high: float
    objective: bool = False

    def value(self, z: Array) -> list[float]:
        row = np.exp(z[:-1])
        own = self.factor * sum(w * self.machines.value(row, self.of, case) for case, w in self.cases)
        if np.isnan(own):
            # no machine stands there: its limit is missed by far, so that the optimiser takes a shorter step
            own = self.high + FAR if np.isfinite(self.high) else self.low - FAR
        return [own - float(z[-1]) if self.objective else own]

    def gradient(self, z: Array) -> Array:
        row = np.exp(z[:-1])
        own = self.factor * sum(w * self.machines.gradient(row, self.of, case) for case, w in self.cases)
        return np.append(np.nan_to_num(own), -1.0 if self.objective else 0.0)

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
        value = self._machines.objective(row, self._objective)
        margins = [limit.margin(self._machines.worst(row, limit.of)) for limit in self._limits]
        candidate = None
        if np.isfinite(value) and np.all(np.isfinite(margins)):
            candidate = _Candidate(max(0.0, -min(margins, default=0.0)), self._sign * value, value, row)
            if self.best is None or candidate.key < self.best.key:
                self.best = candidate
        if self._progress is not None:
            kept = self.best is not None and not self.best.missed
            self._progress(self._machines.count, self.best.value if self.best is not None and kept else None)
        return candidate


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
        _Row(machines, limit.of, ((case, 1.0),), 1.0 / abs(limit.value), *_sides(limit))
        for limit in limits
        for case in machines.cases(limit.of)
    ]
    if isinstance(space.files, HeldTool):
        # beyond its reach an arm has no quantities: the optimiser has to know where that begins
        far = max(float(np.linalg.norm(place.frame[:3, 3])) for place in space.files.places.values())
        within.append(_Row(machines, asked("reach"), ((0, 1.0),), 1.0 / far, 1.0 + TIGHTER, np.inf))
    watch, ends, interrupted = _Watch(machines, objective, limits, progress), [], False
    try:
        if np.all((bounds[:, 0] <= space.present) & (space.present <= bounds[:, 1])):
            watch.look(space.present)
        for begin in begins:
            size = abs(machines.objective(np.exp(begin), objective))
            if not np.isfinite(size) or not size:
                continue
            best = [
                _Row(machines, objective, cases, sign / size, -np.inf, 0.0, objective=True)
                for cases in machines.weighted(objective)
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

    solution: Any = minimize(
        bound, begin, jac=rate, bounds=box, constraints=[row.constraint for row in rows],
        method="SLSQP", options={"maxiter": ITERATIONS, "ftol": 1e-10},
    )  # fmt: skip
    return solution.x[:-1]
