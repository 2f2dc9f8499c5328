"""From answers of cases to rows.

Here are references, observed orders, Richardson's extrapolation and the grid convergence index, and verdicts.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from vjm.batch import map_all
from vjm_output.documents import Row
from vjm_validation.verification.library import Asked, Case, EngineTable, Reference, RunTable
from vjm_validation.verification.runner import Answers

SAFETY = 1.25
"""Roache's factor for three meshes or more."""
ABOVE = 1e-8
"""Relative error from which digits tell of the mesh, and not of events' places (found to 1e-9 of the path) or of
rounding."""
FLOOR = 2e-9
"""Relative change between meshes below which it says nothing."""
LOWEST_ORDER = 0.5
"""An observed order below is replaced by this in the error estimate: it would grow without bounds."""
HIGHEST_ORDER = 16.0
"""Orders are sought up to here; the springs' tenth is the highest in the house."""
ORDER_TOLERANCE = 0.2
"""How far the observed order may be from that of theory."""
MESHLESS = 0.05
"""An order of errors nearer to zero than this has nothing to do with meshes."""
EXACT = "exact at every mesh"
SAME = "the same error at every mesh"
TOO_FEW = "too few meshes above 1e-8 for an order"


@dataclass(frozen=True)
class Convergence:
    """What a sequence of meshes says.

    Attributes:
        order: observed; None where there are too few meshes above the floor, or where the values oscillate.
        extrapolated: Richardson's limit; None without three meshes.
        gci: in the values' unit, not relative; None without three meshes.
        flag: empty where the meshes converge as theory says; else in words.
    """

    order: float | None
    extrapolated: float | None
    gci: float | None
    flag: str = ""

    def as_theory_says(self, theory: float | None) -> bool:
        """Whether the order is within `ORDER_TOLERANCE` of ``theory``, or no mesh has an error to speak of."""
        if self.flag == EXACT:
            return True
        return theory is None or (self.order is not None and abs(self.order - theory) <= ORDER_TOLERANCE)


def convergence(
    meshes: Sequence[int], values: Sequence[float], size: float, theory: float | None, exact: float | None = None
) -> Convergence:
    """Observed order, limit and error estimate of a quantity.

    Args:
        meshes: from coarse to fine.
        values: one a mesh.
        size: to which relative figures refer, in the values' unit.
        theory: order by theory, where it is known.
        exact: the answer, where it is known exactly.
    """
    if len(values) < 3:
        return Convergence(None, None, None, "fewer than three meshes")
    f1, f2, f3 = values[-3:]
    coarse, fine = f2 - f1, f3 - f2
    floor = FLOOR * size
    if exact is not None:
        errors = [abs(value - exact) / size for value in values]
        order = fitted_order(meshes, errors)
        flag = _flag_of_errors(errors, order, theory)
        if order is not None and abs(order) < MESHLESS:
            order, flag = None, SAME
    else:
        order = three_mesh_order(meshes[-3:], coarse, fine) if abs(fine) > floor else None
        flag = _flag_of_changes(order, theory, coarse, fine, floor)
    used = theory if theory is not None else 2.0
    if order is not None:
        # a lucky order would make the estimate too small, one near zero would blow it up
        used = float(np.clip(order, LOWEST_ORDER, max(theory, LOWEST_ORDER) if theory is not None else order))
    gain = (meshes[-1] / meshes[-2]) ** max(used, LOWEST_ORDER) - 1.0
    return Convergence(order, f3 + fine / gain, SAFETY * abs(fine) / gain, flag)


def fitted_order(meshes: Sequence[int], errors: Sequence[float]) -> float | None:
    """Slope of log error by −log mesh, by least squares over the errors above `ABOVE`; None with under three."""
    used = [(n, error) for n, error in zip(meshes, errors, strict=True) if error > ABOVE]
    if len(used) < 3:
        return None
    n, error = np.log(np.array(used, dtype=float)).T
    return float(-np.polyfit(n, error, 1)[0])


def three_mesh_order(meshes: Sequence[int], coarse: float, fine: float) -> float | None:
    """Order from the differences of three meshes; None where they oscillate or shrink too slowly or too fast.

    Args:
        meshes: three, from coarse to fine.
        coarse: f₂ − f₁.
        fine: f₃ − f₂.
    """
    if fine == 0.0 or coarse / fine <= 0.0:
        return None
    ratio = coarse / fine
    h1, h2, h3 = (1.0 / n for n in meshes)

    def excess(order: float) -> float:
        return float((h1**order - h2**order) / (h2**order - h3**order)) - ratio

    low = 1e-3
    if excess(low) > 0.0 or excess(HIGHEST_ORDER) < 0.0:
        return None
    return brentq(excess, low, HIGHEST_ORDER)


def _flag_of_errors(errors: Sequence[float], order: float | None, theory: float | None) -> str:
    if max(errors) <= ABOVE:
        return EXACT
    if order is None:
        return TOO_FEW
    return _compared(order, theory)


def _flag_of_changes(order: float | None, theory: float | None, coarse: float, fine: float, floor: float) -> str:
    if abs(fine) <= floor:
        return "at the rounding floor"
    if coarse * fine < 0.0:
        return "oscillates"
    if order is None:
        return "no order within the three meshes"
    return _compared(order, theory)


def _compared(order: float, theory: float | None) -> str:
    if theory is None or abs(order - theory) <= ORDER_TOLERANCE:
        return ""
    return "slower than theory" if order < theory else "faster than theory"


# --- Answers of cases: numbers, or functions of `vjm_validation.exact` by name ------------------------------------

MODULES = ("arches", "columns", "elastica", "frames", "linear", "postbuckling", "reissner",
           "space", "trusses")  # fmt: skip
"""Of `vjm_validation.exact`."""


def solved(references: Sequence[Reference], jobs: int = 1) -> list[float]:
    """The numbers that references stand for, each in its quantity's unit.

    Args:
        references: any of them twice costs nothing.
        jobs: processes.

    Raises:
        ValueError: one names what there is not, or its arguments are out of range.
    """
    calls = list(dict.fromkeys(_call(reference) for reference in references if reference.value is None))
    results = dict(zip(calls, map_all(_result, calls, jobs), strict=True))
    return [
        reference.value if reference.value is not None else _taken(reference, results[_call(reference)])
        for reference in references
    ]


def _call(reference: Reference) -> str:
    """The function and its arguments as text, which two components of one result share."""
    return json.dumps([reference.exact, reference.arguments], sort_keys=True)


def _result(call: str) -> Any:  # noqa: ANN401
    name, arguments = json.loads(call)
    try:
        return named(name)(**made(arguments))
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from error


def _taken(reference: Reference, result: Any) -> float:  # noqa: ANN401
    steps = [reference.take] if isinstance(reference.take, str) else reference.take or []
    for step in steps:
        result = getattr(result, step) if isinstance(step, str) else result[step]
    return float(result) * reference.times


def named(name: str) -> Any:  # noqa: ANN401
    """What ``module.name`` is in `vjm_validation.exact`.

    Raises:
        ValueError: there is no such thing.
    """
    module, *path = name.split(".")
    if module not in MODULES or not path or any(step.startswith("_") for step in path):
        raise ValueError(f"'{name}' is not module.name of vjm_validation.exact ({', '.join(MODULES)})")
    thing: Any = importlib.import_module(f"vjm_validation.exact.{module}")
    for step in path:
        try:
            thing = getattr(thing, step)
        except AttributeError:
            raise ValueError(f"vjm_validation.exact.{module} has no '{step}'") from None
    return thing


def made(value: Any) -> Any:  # noqa: ANN401
    """An argument with the named things in it made: ``{make = "columns.Support", rotational = 3.0}``."""
    if isinstance(value, Mapping):
        inner = {key: made(item) for key, item in value.items()}
        if "constant" in inner:
            return named(inner["constant"])
        if "make" in inner:
            return named(inner.pop("make"))(**inner)
        return inner
    if isinstance(value, list):
        return tuple(made(item) for item in value)
    return value


# --- What is known of one quantity of one case on one engine ------------------------------------------------------


class VerificationRow(Row):
    """One quantity of one case on one engine."""

    name: str
    """Case, run where it has several, and engine."""
    kind: str
    """``exact``: mathematics; ``code``: another program; ``published``: a printed figure."""
    quantity: str
    reference: float
    source: str
    value: float | None
    """On the finest mesh; null where the engine did not get there."""
    error: float | None
    """Of the value, relative to the reference or to the size that the case names."""
    tolerance: float
    order: float | None
    """Observed: least squares on the errors above 1e-8, three at least, where the reference is exact; else by
    Richardson's formula for three meshes."""
    passed: bool | None
    """Whether the error keeps to the tolerance, and for an exact reference also the order to theory within 0.2;
    null where the engine did not run: nothing is known then."""
    case: str = ""
    group: str = ""
    engine: str = ""
    """Family: vjm, exudyn, opensees, vjm-linear, msa."""
    meshes: list[int] = Field(default_factory=list)
    """Springs or elements of every beam."""
    values: list[float | None] = Field(default_factory=list)
    """One a mesh."""
    errors: list[float | None] = Field(default_factory=list)
    """One a mesh."""
    digits: float | None = None
    """Decimal digits of the value that agree with the reference."""
    extrapolated: float | None = None
    """Richardson's limit of the three finest meshes."""
    gci: float | None = None
    """Grid convergence index of the finest mesh, relative as the error; a safety factor of 1.25."""
    theoretical_order: float | None = None
    flag: str = ""
    """Exact at every mesh, or why the order is to be taken with care."""
    reason: str = ""
    """Of the tolerance."""
    uncertainty: float | None = None
    """Of a published reference, relative as the error."""
    not_run: str = ""
    """Why there is no value: the engine refuses, being not installed or unable to express the case, or gave up."""


# --- From answers to rows: errors, orders, error estimates and verdicts -------------------------------------------

JUDGED = ("vjm", "exudyn")
"""Families whose observed order decides; that of others is shown."""
DIGITS = 15.0
"""Most that agree: those of a double."""


def case_rows(cases: Sequence[Case], answers: Sequence[Answers], jobs: int = 1) -> list[VerificationRow]:
    """One row for every quantity of every case on every engine that was asked.

    Args:
        cases: what was asked.
        answers: of the engines.
        jobs: processes, for the references.

    Raises:
        ValueError: a reference cannot be computed.
    """
    by_name = {case.name: case for case in cases}
    references = iter(solved([asked.reference for case in cases for _, asked in case.questions], jobs))
    numbers = {case.name: [next(references) for _ in case.questions] for case in cases}
    return [row for one in answers for row in _rows(by_name[one.case], one, numbers[one.case])]


def _rows(case: Case, answers: Answers, references: Sequence[float]) -> list[VerificationRow]:
    return [
        _row(case, run, asked, reference, answers, values, failure)
        for (run, asked), reference, values, failure in zip(
            case.questions, references, answers.values, answers.failures, strict=True
        )
    ]


def _row(
    case: Case,
    run: RunTable,
    asked: Asked,
    reference: float,
    answers: Answers,
    values: Sequence[float | None],
    failure: str,
) -> VerificationRow:
    size = asked.relative_to if asked.relative_to is not None else abs(reference)
    family = answers.family
    table = case.file.engines[family]
    theory = asked.orders.get(family, table.order)
    kind = asked.kind or case.file.kind
    finest = None if answers.refused or not values else values[-1]
    mesh_convergence = None
    if finest is not None:
        mesh_convergence = _convergence(table, values, size, theory, reference if kind == "exact" else None)
    error = abs(finest - reference) / size if finest is not None else None
    uncertainty = asked.reference.uncertainty
    tolerance = asked.tolerance if asked.tolerance is not None else table.tolerance
    passed = None if answers.refused else error is not None and error <= tolerance
    if passed and mesh_convergence is not None and kind == "exact" and family in JUDGED:
        passed = mesh_convergence.as_theory_says(theory)
    not_run = f"refused: {answers.refused}" if answers.refused else ""
    if not not_run and finest is None:
        not_run = f"gave up: {failure}"
    return VerificationRow(
        name=", ".join(filter(None, [case.name, run.name, family])),
        kind=kind,
        quantity=asked.quantity,
        reference=reference,
        source=asked.reference.source,
        value=finest,
        error=error,
        tolerance=tolerance,
        order=mesh_convergence.order if mesh_convergence else None,
        passed=passed,
        case=case.name,
        group=case.file.group,
        engine=family,
        meshes=list(table.meshes[: len(values)]),
        values=list(values),
        errors=[None if value is None else abs(value - reference) / size for value in values],
        digits=matching_digits(error) if error is not None else None,
        extrapolated=mesh_convergence.extrapolated if mesh_convergence else None,
        gci=mesh_convergence.gci / size if mesh_convergence and mesh_convergence.gci is not None else None,
        theoretical_order=theory if table.meshes else None,
        flag=mesh_convergence.flag if mesh_convergence else "",
        reason=asked.reason or table.reason,
        uncertainty=uncertainty / size if uncertainty is not None else None,
        not_run=not_run,
    )


def matching_digits(error: float) -> float:
    """How many decimal digits agree: −log₁₀ of a relative error, at most `DIGITS`."""
    return float(np.clip(-np.log10(max(error, 10.0**-DIGITS)), 0.0, DIGITS))


def _convergence(
    table: EngineTable, values: Sequence[float | None], size: float, theory: float | None, exact: float | None
) -> Convergence | None:
    """What the meshes from the first that got there on say."""
    if not table.meshes:
        return None
    meshes = table.meshes[: len(values)]
    first = max((i + 1 for i, value in enumerate(values) if value is None), default=0)
    known_values = [value for value in values[first:] if value is not None]
    return convergence(meshes[first:], known_values, size, theory, exact)
