"""Mistakes in readings, sheets and models that are well-formed: other units, signs, swapped columns, repeated rows.

Readings are compared with what the nominal machine's unloaded stiffness predicts at their displacements, before
anything is fitted. A machine that differs from its model changes forces by a factor that its causes explain; a
mistaken unit changes them by exactly a known factor, in whole postures or from one row on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm.rotations import Array
from vjm_updating.experiment.comparison import Comparison
from vjm_updating.experiment.implausible_columns import MISTAKES, OF_IMPOSED, OF_WHOLE, ReadColumns, column_findings
from vjm_updating.experiment.implausible_rows import blanks, clock, nothing_read, rounded, sheet_values, temperature
from vjm_updating.experiment.implausible_units import compared, gains, mistaken, of_joint, wrong_scale
from vjm_updating.experiment.measured import Measurement

__all__ = ["Finding", "Grade", "considered", "plausibility"]

Rule = Callable[[Comparison], Iterator[Finding]]


def columns(c: Comparison) -> Iterator[Finding]:
    """Mistakes in what was read and imposed, see `vjm_updating.experiment.implausible_columns`."""
    r, sheet, predicted = c.readings, c.measurement.sheet, np.full(c.read.shape, np.nan)
    if c.comparable:
        predicted = c.predicted()
    there = {
        name: np.array(r.values[name])
        for name in r.channels
        if name in sheet.instrument and sheet.errors(name).held is None and np.isfinite(r.values[name]).any()
    }
    read = [name for name in there if name in c.columns]
    imposed = [name for name in there if name not in c.columns]
    group = np.unique(r.posture, return_inverse=True)[1].reshape(-1)

    def these(names: list[str], beside: Array, others: list[str]) -> ReadColumns:
        noise = np.array([sheet.errors(name).noise for name in names])
        values = np.column_stack([there[name] for name in names])
        return ReadColumns(
            r.file, r.row, tuple(names), values, noise, beside, group, r.sequence, {n: there[n] for n in others},
            partial(rounded, c),
        )  # fmt: skip

    if read:
        yield from column_findings(
            these(read, predicted[:, [c.columns.index(name) for name in read]], imposed), MISTAKES, OF_WHOLE
        )
    main = max(read, key=r.span, default="")
    if main and imposed:
        # what was imposed goes with the main reading, as its own zero and gain say
        beside = np.outer(there[main] / max(r.span(main), 1e-300), [r.span(name) for name in imposed])
        yield from column_findings(these(imposed, beside, []), OF_IMPOSED)


RULES: tuple[Rule, ...] = (
    nothing_read,
    temperature,
    blanks,
    columns,
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
