"""Mistakes in readings and sheets that are well-formed: other units, signs, swapped columns, repeated rows.

Readings are compared with what the nominal machine's unloaded stiffness predicts at their displacements, before
anything is fitted. A machine that differs from its model changes forces by a factor that its causes explain; a
mistaken unit changes them by exactly a known factor, in whole postures or from one row on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from vjm_updating.experiment.comparison import Comparison, Finding, Grade
from vjm_updating.experiment.implausible_rows import clock, nothing_read, rows, sheet_values, temperature
from vjm_updating.experiment.implausible_units import signs, swapped_columns, swapped_postures, units
from vjm_updating.experiment.measurement import Measurement

__all__ = ["Finding", "Grade", "plausibility"]

RULES: tuple[Callable[[Comparison], Iterator[Finding]], ...] = (
    nothing_read, temperature, units, signs, swapped_columns, swapped_postures, rows, clock, sheet_values,
)  # fmt: skip
"""All rules."""


def plausibility(measurement: Measurement) -> list[Finding]:
    """What is implausible about a test, refusals first.

    Raises:
        NoConvergenceError: the nominal machine has no equilibrium in a posture.
    """
    compared = Comparison(measurement)
    found = [finding for rule in RULES for finding in rule(compared)]
    return sorted(found, key=lambda finding: list(Grade).index(finding.grade))
