"""From answers of cases to rows: references, errors, orders, error estimates and verdicts."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from vjm.batch import map_all
from vjm_output.documents import Row
from vjm_validation.verification.convergence import Convergence, convergence
from vjm_validation.verification.library import Asked, Case, EngineTable, Reference, RunTable
from vjm_validation.verification.runner import Answers

# --- Answers of cases: numbers, or functions of `vjm_validation.exact` by name ------------------------------------

MODULES = ("arches", "columns", "elastica", "frames", "linear", "postbuckling", "reissner",
           "space", "torsion", "trusses")  # fmt: skip
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


def answer(reference: Reference) -> float:
    """The number that one reference stands for; see `solved`."""
    return solved([reference])[0]


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


class TriangulationRow(Row):
    """How far two engines are apart on one quantity of the paper's chain, and how far they may be."""

    posture: str
    direction: str
    quantity: str
    engines: tuple[str, str]
    at: float | None = None
    """Displacement in mm at which a whole curve differs most; null for a single point."""
    values: tuple[float, float] | None = None
    """Of each engine on its finest mesh; null where one did not run."""
    extrapolated: tuple[float | None, float | None] | None = None
    """Richardson's limits."""
    difference: float | None = None
    """Of the values, over the largest of them on the curve."""
    estimate: float | None = None
    """Sum of the two grid convergence indices, likewise."""
    within: bool | None = None
    """Whether the difference is covered by the estimate: then meshes explain it."""
    tolerance: float
    passed: bool | None
    """Whether the difference keeps to the tolerance; null where an engine is not installed."""
    not_run: str = ""
    """Which engine has no value, and why."""


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
    found = None
    if finest is not None:
        found = _convergence(table, values, size, theory, reference if kind == "exact" else None)
    error = abs(finest - reference) / size if finest is not None else None
    uncertainty = asked.reference.uncertainty
    tolerance = asked.tolerance if asked.tolerance is not None else table.tolerance
    passed = None if answers.refused else error is not None and error <= tolerance
    if passed and found is not None and kind == "exact" and family in JUDGED:
        passed = found.as_theory_says(theory)
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
        order=found.order if found else None,
        passed=passed,
        case=case.name,
        group=case.file.group,
        engine=family,
        meshes=list(table.meshes[: len(values)]),
        values=list(values),
        errors=[None if value is None else abs(value - reference) / size for value in values],
        digits=matching_digits(error) if error is not None else None,
        extrapolated=found.extrapolated if found else None,
        gci=found.gci / size if found and found.gci is not None else None,
        theoretical_order=theory if table.meshes else None,
        flag=found.flag if found else "",
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
    there = [value for value in values[first:] if value is not None]
    return convergence(meshes[first:], there, size, theory, exact)
