"""Data files and sheets of one test, or of several series of one machine: the options and what they load."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm_updating import load_data
from vjm_updating.data_set import DataSet

Readings = Annotated[
    tuple[Path, ...],
    Parameter(
        help="Readings, CSV; see docs/measured-data.md and docs/poses.md. Of poses and deflections also several "
        "series of one machine."
    ),
]
Sheets = Annotated[
    tuple[Path, ...],
    Parameter(consume_multiple=True, help="Test sheet, TOML: one for all series, or one each in their order."),
]
Beside = Annotated[
    tuple[tuple[Path, Path], ...],
    Parameter(
        help="DATA SHEET of another test that judges what is found. Of poses and deflections: another series of "
        "the machine, only frames and zeros refitted; more than once. A ramp, in `diagnose` only: another "
        "specimen, nothing fitted anew."
    ),
]


def load_series(data: Sequence[Path], sheets: Sequence[Path]) -> list[DataSet]:
    """The series of a command.

    Args:
        data: files of readings.
        sheets: one for all, or one each in their order.

    Raises:
        ValueError: as many sheets as fit neither, or a file cannot be used; one line.
    """
    if not data:
        raise ValueError("no data file: give at least one CSV file of readings")
    if len(sheets) not in (1, len(data)):
        raise ValueError(
            f"--sheet: {len(sheets)} sheets for {len(data)} data files: give one for all, or one each in order"
        )
    each = list(sheets) * len(data) if len(sheets) == 1 else list(sheets)
    return [load_data(*files) for files in zip(data, each, strict=True)]
