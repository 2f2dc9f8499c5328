"""Tool paths: a CSV of poses and process wrenches, read with every mistake named by its line."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vjm.rotations import Array

POSITION = ("x_mm", "y_mm", "z_mm")
ROTATION = ("rx_rad", "ry_rad", "rz_rad")
WRENCH = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
COLUMNS = (*POSITION, *ROTATION, *WRENCH)
MOST = 200_000
"""Rows beyond which a file is taken for something else."""


@dataclass(frozen=True)
class ToolPath:
    """Poses and wrenches, one a row.

    Attributes:
        positions: ``(g, 3)`` mm.
        turns: rotation vectors ``(g, 3)`` rad; None where the file has none, and the tool may turn as it likes.
        wrenches: ``(g, 6)`` N, N mm.
    """

    positions: Array
    turns: Array | None
    wrenches: Array


def read_tool_path(file: Path) -> ToolPath:
    """Read a path: columns ``x_mm, y_mm, z_mm``, perhaps ``rx_rad, ry_rad, rz_rad``, ``fx_N`` to ``mz_Nmm``.

    Raises:
        ValueError: naming the file, the line and the remedy.
    """
    with file.open(newline="", encoding="utf-8-sig") as stream:
        lines = [(number, row) for number, row in enumerate(csv.reader(stream), start=1) if _holds(row)]
    if len(lines) < 2:
        raise ValueError(f"{file}: no path; give a line of columns ({', '.join(COLUMNS)}) and a line a pose")
    header = [word.strip() for word in lines[0][1]]
    unknown = [name for name in header if name not in COLUMNS]
    if unknown or len(set(header)) < len(header):
        what = f"unknown column '{unknown[0]}'" if unknown else "a column stands twice"
        raise ValueError(f"{file}:{lines[0][0]}: {what}; there are {', '.join(COLUMNS)}")
    for group in (POSITION, ROTATION):
        missing = [name for name in group if name not in header]
        if missing and (group is POSITION or len(missing) < 3):
            raise ValueError(f"{file}:{lines[0][0]}: column '{missing[0]}' is missing")
    if len(lines) > MOST:
        raise ValueError(f"{file}: {len(lines)} rows are more than {MOST}")
    table = np.zeros((len(lines) - 1, len(COLUMNS)))
    for k, (number, row) in enumerate(lines[1:]):
        if len(row) != len(header):
            raise ValueError(f"{file}:{number}: {len(row)} values for {len(header)} columns")
        for name, word in zip(header, row, strict=True):
            try:
                value = float(word)
            except ValueError:
                value = np.nan
            if not np.isfinite(value):
                raise ValueError(f"{file}:{number}: {name}: '{word.strip()}' is no finite number")
            table[k, COLUMNS.index(name)] = value
    turns = table[:, 3:6] if ROTATION[0] in header else None
    return ToolPath(table[:, :3], turns, table[:, 6:])


def _holds(row: list[str]) -> bool:
    return any(word.strip() for word in row) and not row[0].lstrip().startswith("#")
