"""Data files and sheets of one test, or of several series of one machine."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vjm_updating import load_data
from vjm_updating.data_set import DataSet


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
