"""Numbers that no instrument reads: repeated rows, copied columns, one value for what is absent.

Readings of one value agree to the last digit by chance only: under a noise of several digits rarely, and in many
rows never.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np
from scipy.special import gammaln

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.experiment.comparison import FEW
from vjm_updating.experiment.implausible_rows import CHANCE, agreeing, last_digit
from vjm_updating.experiment.readings import runs
from vjm_updating.experiment.row_sequence import LEAST_ROWS

Columns = Mapping[str, tuple[Array, float]]
"""By name what was read ``(n,)``, nan where it was not, and its noise."""


def column_findings(file: str, row: np.ndarray, columns: Columns) -> Iterator[Finding]:
    """What is implausible about the numbers in columns of readings.

    Args:
        file: for messages.
        row: ``(n,)`` lines of the file.
        columns: that were read.
    """
    yield from repeated_columns(file, row, columns)
    for name, (values, noise) in _known(columns).items():
        yield from _one_value(file, row, name, values, noise)
        read = values[np.isfinite(values)]
        # where most readings stand more than once, they are multiples of their least step
        digit = _step(values) if 2 * len(np.unique(read)) <= len(read) else last_digit(values)
        if np.nanmax(np.abs(values)) > 0.0 and digit > np.sqrt(12.0) * noise:
            yield Finding(
                Grade.DOUBTFUL, f"{file}: column {name}",
                f"every reading is a multiple of {digit:g}, far above its noise of {noise:g}: were digits lost, or "
                "is one in another unit?",
            )  # fmt: skip


def repeated_columns(file: str, row: np.ndarray, columns: Columns) -> Iterator[Finding]:
    """Blocks of rows that stand twice, and columns that are copies; see `column_findings`."""
    known = _known(columns)
    yield from _twice(file, row, known)
    yield from _copied(file, known)


def _known(columns: Columns) -> Columns:
    """Those that have readings enough, and a noise."""
    return {name: one for name, one in columns.items() if np.isfinite(one[0]).sum() >= FEW and one[1] > 0.0}


def _step(values: Array) -> float:
    """By how much readings differ at least: the last digit that is printed, or what an instrument counts in."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return max(last_digit(values), float(steps.min(initial=np.inf)) if len(steps) else 0.0)


def _twice(file: str, row: np.ndarray, columns: Columns) -> Iterator[Finding]:
    """Blocks of rows whose readings stand in the file before."""
    if not columns:
        return
    table = np.column_stack([np.nan_to_num(values, nan=1e300) for values, _ in columns.values()])
    first: dict[bytes, int] = {}
    before = np.array([first.setdefault(one.tobytes(), k) for k, one in enumerate(table)])
    again = before < np.arange(len(table))
    # by how far a row stands behind the first of its kind: the same within a block
    behind = np.where(again, np.arange(len(table)) - before, 0)
    chance = float(np.prod([agreeing(_step(values), noise) for values, noise in columns.values()]))
    for begin, end in runs(behind):
        if behind[begin] > 0 and end - begin >= LEAST_ROWS and len(table) ** 2 * chance ** (end - begin) < CHANCE:
            where = f"{file}: rows {row[begin]} to {row[end - 1]}"
            source = f"rows {row[before[begin]]} to {row[before[end - 1]]}"
            words = f"repeat the readings of {source}: were they pasted twice?"
            yield Finding(Grade.DOUBTFUL, where, words)


def _copied(file: str, columns: Columns) -> Iterator[Finding]:
    """Two columns that are the same in most rows."""
    for (a, (x, _)), (b, (y, _)) in combinations(columns.items(), 2):
        both = np.isfinite(x) & np.isfinite(y)
        same = (x == y) & both & (x != 0.0)
        if same.sum() >= FEW and 2 * same.sum() > both.sum() and np.ptp(x[same]) > 0.0:
            words = f"is the same as column {a} in {int(same.sum())} of {int(both.sum())} rows: was it copied?"
            yield Finding(Grade.DOUBTFUL, f"{file}: column {b}", words)


def _one_value(file: str, row: np.ndarray, name: str, values: Array, noise: float) -> Iterator[Finding]:
    """One value that stands so often that it was not read each time."""
    read = np.isfinite(values)
    kinds, count = np.unique(values[read], return_counts=True)
    most, n = int(count.max()), int(read.sum())
    likely = agreeing(_step(values), noise)
    log_likely = float(np.log(max(likely, 1e-300)))
    # expected number of sets of so many equal readings among all
    log_sets = gammaln(n + 1) - gammaln(most + 1) - gammaln(n - most + 1)
    if most < LEAST_ROWS or log_sets + (most - 1) * log_likely > np.log(CHANCE):
        return
    value = float(kinds[int(np.argmax(count))])
    at = np.flatnonzero(values == value)
    longest = max(((a, b) for a, b in runs(values == value) if values[a] == value), key=lambda one: one[1] - one[0])
    if longest[1] - longest[0] >= FEW:
        where = f"{file}: column {name}, rows {row[longest[0]]} to {row[longest[1] - 1]}"
        words = (
            f"{longest[1] - longest[0]} readings are {value:g}, under a noise of {noise:g}: did the channel hang, "
            "or does the number stand for an absent value? Leave such cells blank"
        )
    else:
        where = f"{file}: column {name}"
        words = (
            f"{most} readings are {value:g}, the first in row {row[at[0]]}, under a noise of {noise:g}: does it "
            "stand for an absent value? Leave such cells blank"
        )
    yield Finding(Grade.DOUBTFUL, where, words)
