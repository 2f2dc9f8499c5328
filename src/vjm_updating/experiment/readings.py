"""The readings of a test as arrays, checked row by row."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.io.errors import did_you_mean
from vjm.rotations import Array
from vjm_updating.constants import numerical, stated_level
from vjm_updating.experiment.data_file import (
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
    DataError,
    DataTable,
    check_column,
    split_point,
)
from vjm_updating.experiment.sheet import Sheet

DEADBAND = stated_level(4.0)
"""Change over a reading's noise below which a displacement is held; of both its ends, so about 3 sigma."""

SETTLED = numerical(5)
"""Rows at a mark whose median is taken: two of them may be stale."""


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

    def known(self, channel: str) -> Array:
        """What was read of a column, without its gaps."""
        return self.values[channel][~np.isnan(self.values[channel])]

    def span(self, channel: str) -> float:
        """From the least to the largest reading of a column; 0 where there is none."""
        return float(np.ptp(known)) if len(known := self.known(channel)) else 0.0

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
        return np.cumsum(new) - 1

    @property
    def sequences(self) -> list[np.ndarray]:
        """Indices of the readings of each such sequence."""
        return [np.arange(begin, end) for begin, end in runs(self.sequence)]

    def only(self, keep: np.ndarray) -> Readings:
        """The readings of a mask or of indices."""
        values = {name: column[keep] for name, column in self.values.items()}
        return Readings(self.file, self.row[keep], self.posture[keep], self.run[keep], values)

    def ways(self, channel: str, noise: float) -> Array:
        """What one displacement does at each reading: 1 away from the unloaded pose, −1 back, 0 held ``(n,)``.

        Turning points count once the displacement has gone back by `DEADBAND` times the noise.
        """
        column, result = self.values[channel], np.zeros(len(self))
        for rows in self.sequences:
            size = np.abs(column[rows])
            size[np.isnan(size)] = 0.0
            span = max(DEADBAND * noise, 1e-9 * float(size.max(initial=0.0)))
            begin = 0
            for k in range(1, len(rows)):
                if abs(size[k] - size[begin]) > span:
                    way = 1.0 if size[k] > size[begin] else -1.0
                    near = begin + 1
                    # what stayed where the motion began was held
                    while near < k and abs(size[near] - size[begin]) <= 0.5 * span:
                        near += 1
                    result[rows[near : k + 1]] = way
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
        last_rows = self.only(last)
        values = {
            name: column if name == TIME else np.array([_median(self.values[name][own]) for own in rows])
            for name, column in last_rows.values.items()
        }
        return replace(last_rows, values=values)

    def _columns(self, names: tuple[str, ...], absent: float) -> Array:
        missing = np.full(len(self), absent)
        return np.column_stack([self.values.get(name, missing) for name in names])


def runs(values: np.ndarray) -> list[tuple[int, int]]:
    """Begins and ends of runs of equal values ``(n,)``."""
    edges = np.flatnonzero(np.concatenate([[len(values) > 0], values[1:] != values[:-1], [True]]))
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _median(values: Array) -> float:
    """Of those that were read; nan where none was."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else float("nan")


def read_readings(table: DataTable, sheet: Sheet) -> Readings:
    """The readings of a table, which fit their sheet.

    Raises:
        DataError: they do not; one line.
    """
    with table.named():
        for column in table.cells:
            check_column(column, tuple(sheet.points), OF_JOINT if sheet.kind == "joint" else PLAIN)
        _check_header(list(table.cells), sheet)
        labels = table.cells.get(POSTURE, [next(iter(sheet.postures), sheet.test.joint)] * len(table.row))
        if sheet.postures:
            check_labels(labels, table.row, sheet.postures, "the sheet has", "add it to [postures]")
        run = table.numbers(RUN) if RUN in table.cells else np.ones(len(table.row))
        wrong = np.flatnonzero(~((run >= 1) & (run == np.round(run))))
        if len(wrong):
            raise ValueError(f"row {table.row[wrong[0]]}, column run: must be a whole number from 1")
        values = {name: table.numbers(name) for name in table.cells if name not in (POSTURE, RUN)}
        return Readings(table.name, table.row, np.array(labels), run.astype(int), values)


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


def check_labels(
    labels: Sequence[str], rows: np.ndarray, known: Collection[str], whose: str = "there are",
    remedy: str = "add it to the sheet's [postures]",
) -> None:  # fmt: skip
    """Refuse labels of postures that are not known.

    Raises:
        DataError: naming the row and what is known.
    """
    for label, row in zip(labels, rows, strict=True):
        if not label:
            raise DataError(f"row {row}, column posture: is blank: write the posture's label")
        if label not in known:
            raise DataError(
                f"row {row}, column posture: unknown posture '{label}' ({whose} {', '.join(known) or 'none'}): "
                f"{remedy}{did_you_mean(label, known)}"
            )
