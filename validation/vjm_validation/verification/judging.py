"""From answers to rows: errors, orders, error estimates and verdicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm_validation.verification.convergence import Convergence, convergence
from vjm_validation.verification.library import Case
from vjm_validation.verification.references import answers as solved
from vjm_validation.verification.rows import VerificationRow
from vjm_validation.verification.runner import Answers
from vjm_validation.verification.schema import Asked, EngineTable, RunTable

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
