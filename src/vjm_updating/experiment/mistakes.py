"""Errors of the instruments that are mistakes, and the readings without them.

A mistake changes readings by a known operation: a factor between units, a sign, an exchange of two columns, a clock
that jumped. The other readings are as good as any.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.io.findings import Finding, ImplausibleError
from vjm.rotations import Array
from vjm_updating.experiment.measured import Measurement
from vjm_updating.experiment.readings import Readings

UNIT, SIGN, EXCHANGE, CLOCK = "instrument_unit", "instrument_sign", "instrument_exchange", "instrument_clock"
TITLES = {
    UNIT: "a channel that was written in another unit",
    SIGN: "a channel with the other sign",
    EXCHANGE: "two channels in each other's place",
    CLOCK: "a clock that jumped, or changed its unit",
}
"""Each mistake as a cause, and what it is."""


@dataclass(frozen=True)
class Mistake:
    """What has to be done to readings to undo a mistake.

    Attributes:
        cause: one of `TITLES`.
        where: the readings concerned ``(n,)``.
        factors: by column, what its readings have to be multiplied by.
        exchanged: two columns that change places.
        shifts: by column, what has to be added ``(n,)``.
        parameters: by name, what was found: a factor, or a jump in s.
    """

    cause: str
    where: np.ndarray
    factors: Mapping[str, float] = field(default_factory=dict)
    exchanged: tuple[str, ...] = ()
    shifts: Mapping[str, Array] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)

    def corrected(self, readings: Readings) -> Readings:
        """The readings without the mistake."""
        values = {name: column.copy() for name, column in readings.values.items()}
        for name, factor in self.factors.items():
            values[name][self.where] *= factor
        for name, shift in self.shifts.items():
            values[name][self.where] += shift[self.where]
        if self.exchanged:
            a, b = self.exchanged
            values[a][self.where], values[b][self.where] = (
                readings.values[b][self.where],
                readings.values[a][self.where],
            )
        return replace(readings, values=values)


class ColumnsMistaken(Finding):
    """Columns are not what they say: whatever is fitted to them means nothing before they are corrected."""


@dataclass(frozen=True)
class MistakeFound(ColumnsMistaken):
    """A finding that says what the mistake is.

    Attributes:
        mistake: how to undo it.
    """

    mistake: Mistake


def columns_mistaken(findings: Iterable[Finding]) -> list[ColumnsMistaken]:
    """Findings that columns are not what they say, but for the clock: no stiffness is fitted to that."""
    return [
        one
        for one in findings
        if isinstance(one, ColumnsMistaken) and not (isinstance(one, MistakeFound) and one.mistake.cause == CLOCK)
    ]


DIAGNOSED = "`validate diagnose` says what the residual is"
"""A remedy, of tests that can be diagnosed."""
TAKEN_BY_FORCE = "--force takes the readings as they are, and the model says so"


def refuse_mistaken(findings: Iterable[Finding], *remedies: str) -> None:
    """Stop where columns are not what they say, before anything is calibrated by them.

    Args:
        findings: what is implausible about a test.
        remedies: what else may be done, for people.

    Raises:
        ImplausibleError: naming the first mistake, and how many more there are.
    """
    found = columns_mistaken(findings)
    if found:
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise ImplausibleError("; ".join([f"{found[0]}{more}: no machine is calibrated by that", *remedies]))


def mistakes_of(findings: Iterable[Finding]) -> list[Mistake]:
    """The mistakes among findings that can be undone together: of two that concern the same readings, the first."""
    taken: list[Mistake] = []
    for finding in findings:
        if not isinstance(finding, MistakeFound):
            continue
        one = finding.mistake
        columns = {*one.factors, *one.exchanged, *one.shifts}
        if not any(
            columns & {*other.factors, *other.exchanged, *other.shifts} and np.any(one.where & other.where)
            for other in taken
        ):
            taken.append(one)
    return taken


def corrected(measurement: Measurement, mistakes: Iterable[Mistake]) -> Measurement:
    """The measurement without mistakes."""
    readings = measurement.readings
    for mistake in mistakes:
        readings = mistake.corrected(readings)
    return replace(measurement, readings=readings)
