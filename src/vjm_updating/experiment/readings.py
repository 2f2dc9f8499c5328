"""The readings of a test as arrays, checked row by row."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from vjm.io.errors import did_you_mean
from vjm.plain_numbers import plain_number
from vjm.rotations import Array
from vjm_updating.constants import numerical, stated_level
from vjm_updating.experiment.channels import (
    EFFORT,
    MOTION,
    OF_JOINT,
    PLAIN,
    POSE,
    POSTURE,
    RUN,
    TEMPERATURE,
    TIME,
    WRENCH,
    check_column,
    split_point,
)
from vjm_updating.experiment.sheet import Sheet
from vjm_updating.experiment.source import DataError, TableSource, source_of_readings, table_in

DEADBAND = stated_level(4.0)
"""Change over a reading's noise below which a displacement is held; of both its ends, so about 3 sigma."""

SETTLED = numerical(5)
"""Rows at a mark whose median is taken: two of them may be stale."""


class Branch(StrEnum):
    """What the displacement is doing at a reading."""

    UP = "up"
    """Away from the unloaded pose."""
    DOWN = "down"
    """Back towards it."""
    HOLD = "hold"


@dataclass(frozen=True)
class Readings:
    """n readings in the order in which they were taken.

    Attributes:
        file: name for messages.
        row: line of the file ``(n,)``, the header being line 1.
        posture: label of each ``(n,)``.
        run: repeat number ``(n,)``.
        values: by column ``(n,)``; nan where the channel missed the sample.
    """

    file: str
    row: np.ndarray
    posture: np.ndarray
    run: np.ndarray
    values: dict[str, Array]

    def __len__(self) -> int:
        return len(self.row)

    @property
    def channels(self) -> tuple[str, ...]:
        """Columns that an instrument read."""
        return tuple(name for name in self.values if name not in (TIME, TEMPERATURE))

    @property
    def pose(self) -> Array:
        """Displacement of the end-effector as read ``(n, 6)``, mm, rad; zero where there is no column."""
        return self._columns(POSE, 0.0)

    @property
    def wrench(self) -> Array:
        """Wrench as read ``(n, 6)``, N, N mm; nan where there is no reading."""
        return self._columns(WRENCH, np.nan)

    @property
    def sequence(self) -> np.ndarray:
        """Number ``(n,)`` of the unbroken sequence of one posture and run that a reading belongs to."""
        new = np.ones(len(self), dtype=bool)
        new[1:] = (self.posture[1:] != self.posture[:-1]) | (self.run[1:] != self.run[:-1])
        result: np.ndarray = np.cumsum(new) - 1
        return result

    def only(self, keep: np.ndarray) -> Readings:
        """The readings of a mask or of indices."""
        values = {name: column[keep] for name, column in self.values.items()}
        return Readings(self.file, self.row[keep], self.posture[keep], self.run[keep], values)

    def branches(self, channel: str, noise: float) -> list[Branch]:
        """Loading branch of every reading, off the history of one displacement.

        Turning points count once the displacement has gone back by `DEADBAND` times the noise.

        Args:
            channel: the displacement.
            noise: of one reading.
        """
        column, result = self.values[channel], [Branch.HOLD] * len(self)
        for number in np.unique(self.sequence):
            at = np.flatnonzero(self.sequence == number)
            size = np.abs(column[at])
            size[np.isnan(size)] = 0.0
            span = max(DEADBAND * noise, 1e-9 * float(size.max(initial=0.0)))
            begin = 0
            for k in range(1, len(at)):
                if abs(size[k] - size[begin]) > span:
                    way = Branch.UP if size[k] > size[begin] else Branch.DOWN
                    near = begin + 1
                    # what stayed where the motion began was held
                    while near < k and abs(size[near] - size[begin]) <= 0.5 * span:
                        near += 1
                    for i in range(near, k + 1):
                        result[at[i]] = way
                    begin = k
        return result

    def settled(self, held: str) -> Readings:
        """For a channel that was brought to marks: one row for each group that carries one mark.

        It is the last one, with the medians of the last rows in its channels: half of the group's, at most
        `SETTLED`. A single row may be a stale one, and the first ones were read on the way.
        """
        marks = self.values[held]
        last = np.ones(len(self), dtype=bool)
        last[:-1] = (marks[1:] != marks[:-1]) | (self.sequence[1:] != self.sequence[:-1])
        ends = np.flatnonzero(last) + 1
        begins = np.concatenate([[0], ends[:-1]])
        rows = [slice(b - min(SETTLED, max((b - a) // 2, 1)), b) for a, b in zip(begins, ends, strict=True)]
        found = self.only(last)
        values = {
            name: column if name == TIME else np.array([_median(self.values[name][own]) for own in rows])
            for name, column in found.values.items()
        }
        return replace(found, values=values)

    def _columns(self, names: tuple[str, ...], absent: float) -> Array:
        missing = np.full(len(self), absent)
        return np.column_stack([self.values.get(name, missing) for name in names])


def _median(values: Array) -> float:
    """Of those that were read; nan where none was."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else float("nan")


def read_readings(readings: TableSource, sheet: Sheet) -> Readings:
    """The readings of a data file or of columns, which fit their sheet.

    Raises:
        DataError: they do not; one line.
    """
    source = source_of_readings(readings)
    header, table = table_in(source)
    try:
        for column in header:
            check_column(column, tuple(sheet.points), OF_JOINT if sheet.kind == "joint" else PLAIN)
        _check_header(header, sheet)
        rows = np.array([number for number, _ in table])
        text = {name: [cells[i] for _, cells in table] for i, name in enumerate(header)}
        posture = _postures(text, rows, sheet)
        run = numbers_of(text[RUN], RUN, rows) if RUN in text else np.ones(len(rows))
        _check_runs(run, rows)
        values = {name: numbers_of(text[name], name, rows) for name in header if name not in (POSTURE, RUN)}
    except ValueError as error:
        raise DataError(f"{source.name}: {error}") from error
    return Readings(source.name, rows, posture, run.astype(int), values)


def _check_header(header: list[str], sheet: Sheet) -> None:
    """Refuse a file without what its control needs."""
    control = sheet.test.control
    if sheet.kind == "joint":
        for names, what in ((MOTION, "motion"), (EFFORT, "load")):
            if len([name for name in header if name in names]) != 1:
                raise ValueError(f"a test of one joint has one column of {what}, {' or '.join(names)}: give one")
        return
    if POSTURE not in header and len(sheet.postures) != 1:
        raise ValueError("column 'posture' is missing: add it, with the sheet's labels")
    if control not in ("displacement", "force") and control not in header:
        raise ValueError(
            f"column '{control}' is missing, by which the sheet says that the operator controlled the test: add it"
        )
    moved = [name for name in header if split_point(name)[1] in POSE]
    loaded = [name for name in header if name in WRENCH]
    if not moved:
        raise ValueError("a column of displacement is missing, such as ux_mm: add it")
    if not loaded:
        raise ValueError("a column of force is missing, such as fx_N: add it")
    for name, known in sheet.instrument.items():
        if known.noise > 0.0 and name not in header:
            hint = did_you_mean(name, [c for c in header if c not in sheet.instrument])
            raise ValueError(f"column '{name}' is missing, but the sheet has its instrument: add it{hint}")


def _postures(text: dict[str, list[str]], rows: np.ndarray, sheet: Sheet) -> np.ndarray:
    """Labels ``(n,)``, known ones."""
    only = next(iter(sheet.postures), sheet.test.joint)
    labels = text.get(POSTURE, [only] * len(rows))
    for label, row in zip(labels, rows, strict=True):
        if not label:
            raise ValueError(f"row {row}, column posture: is blank: write the posture's label")
        if sheet.postures and label not in sheet.postures:
            known = ", ".join(sheet.postures)
            raise ValueError(
                f"row {row}, column posture: unknown posture '{label}' (the sheet has {known}): "
                f"add it to [postures]{did_you_mean(label, sheet.postures)}"
            )
    return np.array(labels)


def numbers_of(cells: list[str], name: str, rows: np.ndarray) -> Array:
    """A column ``(n,)``, nan for a blank.

    Raises:
        ValueError: a cell is no finite number.
    """
    result = np.full(len(cells), np.nan)
    for i, (cell, row) in enumerate(zip(cells, rows, strict=True)):
        if not cell:
            continue
        try:
            result[i] = plain_number(cell)
        except ValueError:
            remedy = "write it with a point" if "," in cell else "leave the cell of a missed sample blank"
            raise ValueError(f"row {row}, column {name}: '{cell}' is no number: {remedy}") from None
        if not math.isfinite(result[i]):
            raise ValueError(f"row {row}, column {name}: '{cell}' is not finite: leave a missed sample blank")
    return result


def _check_runs(run: Array, rows: np.ndarray) -> None:
    wrong = np.flatnonzero(~((run >= 1) & (run == np.round(run))))
    if len(wrong):
        raise ValueError(f"row {rows[wrong[0]]}, column run: must be a whole number from 1")
