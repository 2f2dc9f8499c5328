"""Mistakes in readings, sheets and models that are well-formed: other units, signs, swapped columns, repeated rows.

Readings are compared with what the nominal machine's unloaded stiffness predicts at their displacements, before
anything is fitted. A machine that differs from its model changes forces by a factor that its causes explain; a
mistaken unit changes them by exactly a known factor, in whole postures or from one row on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm_updating.experiment.comparison import Comparison
from vjm_updating.experiment.implausible_columns import repeated_columns
from vjm_updating.experiment.implausible_rows import clock, nothing_read, rows, sheet_values, temperature
from vjm_updating.experiment.implausible_units import compared, gains, mistaken, of_joint, wrong_scale
from vjm_updating.experiment.measured import Measurement

__all__ = ["Finding", "Grade", "considered", "plausibility"]

Rule = Callable[[Comparison], Iterator[Finding]]


def _repeated(c: Comparison) -> Iterator[Finding]:
    """Blocks of rows that stand twice, and columns that are copies."""
    instruments = c.measurement.sheet.instrument
    there = [name for name in c.readings.channels if name in instruments and instruments[name].held is None]
    columns = {name: (c.readings.values[name], instruments[name].noise) for name in there}
    yield from repeated_columns(c.readings.file, c.readings.row, columns)


RULES: tuple[Rule, ...] = (
    nothing_read,
    temperature,
    rows,
    _repeated,
    clock,
    sheet_values,
)
"""Rules of readings and sheets; those of models are `vjm.io.model_plausibility`'s."""
BESIDE_THE_MODEL: tuple[Rule, ...] = (wrong_scale, of_joint, mistaken, gains)
"""Rules that compare readings with what the nominal machine does."""


def considered(measurement: Measurement, *, strict: bool = False) -> list[Finding]:
    """What is implausible about a test, unless it is refused for that.

    Args:
        measurement: sheet, readings, machine.
        strict: whether what is doubtful is refused, too.

    Raises:
        ImplausibleError: naming the first reason.
        NoConvergenceError: the nominal machine has no equilibrium in a posture.
    """
    findings = plausibility(measurement)
    refuse(findings, strict=strict)
    return findings


def plausibility(measurement: Measurement) -> list[Finding]:
    """What is implausible about a test and its model, refusals first.

    Raises:
        NoConvergenceError: the nominal machine has no equilibrium in a posture.
    """
    name = f"{measurement.sheet.file}, model {measurement.sheet.test.model}"
    of_model = list(model_findings(measurement.document, name))
    # what a mistaken model predicts says nothing of the readings
    believed = all(finding.grade is Grade.NOTED for finding in of_model)
    rules = [*RULES, *(BESIDE_THE_MODEL if believed else ())]
    beside = compared(measurement)
    found = [finding for rule in rules for finding in rule(beside)]
    return worst_first([*found, *of_model, *measurement.notes])
