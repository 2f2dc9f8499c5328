"""Rows of a test of a robot that are not what their columns say, while the other rows are.

Each possible mistake is put right and compared with the nominal machine, whose frames or springs are fitted
to the rows that are right. All mistakes are judged by the same readings: what is put right by a factor k has a
density that is k times as large. `vjm_updating.experiment.row_sequence` has the most probable sequence.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment.mistakes import ColumnsMistaken
from vjm_updating.experiment.readings import runs
from vjm_updating.experiment.row_sequence import LEAST_ROWS, ODDS, most_probable, rarity
from vjm_updating.observation.significance import CUT
from vjm_updating.poses.data_changes import Change, D
from vjm_updating.poses.study import MEDIAN_TO_SIGMA, TAIL

PARTS = numerical(8)
"""Of a file, with each of which the search for rows that are right begins."""
ROUNDS = numerical(10)
"""After which the rows that are right have been found, at most."""


class Beside(ABC, Generic[D]):
    """Readings of a test beside the nominal machine.

    Attributes:
        data: as read.
        least: number of rows to which frames or springs can be fitted.
    """

    def __init__(self, data: D, least: int) -> None:
        self.data, self.least = data, least

    @abstractmethod
    def changes(self) -> Iterator[Change[D]]:
        """Mistakes that rows may have, the simplest first."""

    @abstractmethod
    def left(self, data: D, rows: np.ndarray) -> Array:
        """Residuals ``(g, k, 3)`` mm of all rows of data, with what is fitted to some rows as they were read.

        Args:
            data: the test's, or as they may have been meant.
            rows: indices of those that are right.
        """

    @cached_property
    def right(self) -> np.ndarray:
        """Indices of the rows on which most agree, by least trimmed squares (Rousseeuw, JASA 79, 1984).

        It begins with each part of the file, since mistakes stand in blocks. From a fit to some rows the half that
        it misses least is fitted next, until that half stays.
        """
        g = len(self.data)
        half = max(g // 2 + 1, min(self.least, g))
        best, found = np.inf, np.arange(g)
        for begin in np.linspace(0, g, PARTS, endpoint=False).astype(int).tolist():
            rows = np.arange(begin, min(begin + max(g // PARTS, self.least), g))
            for _ in range(ROUNDS):
                off = self.off(self.left(self.data, rows))
                order = np.argsort(off, kind="stable")[:half]
                if set(order.tolist()) == set(rows.tolist()):
                    break
                rows = order
            size = float(np.sum(self.off(self.left(self.data, rows))[rows] ** 2))
            if size < best:
                best, found = size, rows
        return np.sort(self._near(found))

    def _near(self, rows: np.ndarray) -> np.ndarray:
        """All rows that lie no further off than normal errors of the size that some have."""
        off = self.off(self.left(self.data, rows))
        near = np.flatnonzero(off < CUT * scale_of(off))
        return near if len(near) >= self.least else rows

    def off(self, left: Array) -> Array:
        """How far off rows ``(g,)`` are, root mean square over the readings' sigmas; nan where none is read."""
        squares = (left / self.data.sigma[..., :3]) ** 2
        read = np.isfinite(squares).sum(axis=(1, 2))
        return np.sqrt(np.where(read > 0, np.nansum(squares, axis=(1, 2)) / np.maximum(read, 1), np.nan))


def scale_of(off: Array) -> float:
    """Of rows that are off so far ``(g,)``, over the readings' standard deviations; at least 1."""
    return max(MEDIAN_TO_SIGMA * float(np.median(off)), 1.0)


@dataclass(frozen=True)
class MistakenStretch:
    """Rows that have one mistake.

    Attributes:
        begin, end: the first row, and the one behind the last.
        ways: numbers of the changes that are about as probable, the best first.
        before, after: root mean square of the residual as read and put right, mm.
    """

    begin: int
    end: int
    ways: tuple[int, ...]
    before: float
    after: float


def mistaken_rows(beside: Beside[D]) -> Iterator[Finding]:
    """Rows in another unit, with another sign, exchanged or shifted, while the other rows fit."""
    g = len(beside.data)
    # what is as near as the other rows is a matter of the machine
    if g <= beside.least + LEAST_ROWS or g - len(beside.right) < LEAST_ROWS:
        return
    changes = list(beside.changes())
    for one in _stretches(beside, changes, beside.right):
        ways = [changes[w - 1] for w in one.ways]
        rows = beside.data.row[one.begin : one.end]
        others = "".join(f"; or {way.name}: {way.remedy.rstrip(',')}" for way in ways[1:])
        words = (
            f"{ways[0].name}: {one.before:.4g} mm are left there, while other rows fit; "
            f"{ways[0].remedy.rstrip(',')} there, and it is {one.after:.4g} mm{others}"
        )
        yield ColumnsMistaken(Grade.DOUBTFUL, f"{beside.data.file}: rows {rows[0]} to {rows[-1]}", words)


def _stretches(beside: Beside[D], changes: Sequence[Change[D]], rows: np.ndarray) -> Iterator[MistakenStretch]:
    left = [beside.left(beside.data, rows), *(beside.left(change.data, rows) for change in changes)]
    g = len(beside.data)
    scale = scale_of(beside.off(left[0])[rows])
    levels = np.array([_level(one / (scale * beside.data.sigma[..., :3])) for one in left])
    read = np.isfinite(left[0]).sum(axis=(1, 2))
    posture = np.unique(np.round(beside.data.q, 6), axis=0, return_inverse=True)[1].reshape(-1)
    for w, change in enumerate(changes, start=1):
        levels[w] -= read * np.log(change.factor)
        # what another row's readings say of a row at the end of the file is not known
        unknown = np.isfinite(left[w]).sum(axis=(1, 2)) != read
        levels[w, unknown] = np.inf
    levels[1:] = np.where(np.isfinite(levels[1:]), levels[1:], levels[0] + np.log(ODDS))
    path = most_probable(levels, rarity(len(changes)), np.zeros(len(levels), dtype=bool))
    for begin, end in runs(path):
        # more than half of the rows are no stretch beside the others
        far = end - begin - int(np.sum((rows >= begin) & (rows < end)))
        if path[begin] == 0 or min(far, _samples(posture, begin, end)) < LEAST_ROWS or 2 * (end - begin) > g:
            continue
        cost = levels[:, begin:end].sum(axis=1)
        gained = (cost[0] - cost) / (end - begin)
        squares = np.array([_squares(one[begin:end]) for one in left])
        factors = np.array([1.0, *(change.factor for change in changes)])
        # put right, more of the squares is explained than is left, in the readings' own unit
        possible = (gained > np.log(ODDS)) & (2.0 * squares / np.minimum(factors, 1.0) ** 2 <= squares[0])
        # and most rows are as near as right ones
        possible &= [float(np.median(beside.off(one)[begin:end])) < CUT * scale for one in left]
        possible[0] = False
        if not possible.any():
            continue
        ranked = np.where(possible, cost, np.inf)
        ways = np.flatnonzero(ranked <= ranked.min() + np.log(ODDS))
        yield MistakenStretch(
            begin, end, tuple(ways[np.argsort(ranked[ways], kind="stable")].tolist()),
            float(np.sqrt(squares[0])), float(np.sqrt(squares[ways].min())),
        )  # fmt: skip


def _samples(posture: np.ndarray, begin: int, end: int) -> int:
    """Of how many samples a stretch is: what a machine errs in one posture, it errs in all of its rows."""
    inside = posture[begin:end]
    whole = not np.isin(np.delete(posture, slice(begin, end)), inside).any()
    return len(np.unique(inside)) if whole else end - begin


def _level(scaled: Array) -> Array:
    """Negative logarithms ``(g,)`` of the probability of rows by Student's distribution, but for a constant."""
    result: Array = np.nansum(0.5 * (TAIL + 1.0) * np.log1p(scaled**2 / TAIL), axis=(1, 2))
    return result


def _squares(left: Array) -> float:
    return float(np.nanmean(left**2))
