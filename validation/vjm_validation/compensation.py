"""Tool paths read from CSV, and a path compensated by three models of a machine.

The models are the rigid, the linear and the loaded one; they stand beside each other.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field

from vjm import __version__
from vjm.compensation import compensate
from vjm.engines import VjmEngine
from vjm.io.files import write_whole
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.rotations import Array
from vjm_output.documents import DoubtRow, Row

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


class ModelError(Row):
    """What one model leaves along the path."""

    largest_mm: float
    mean_mm: float
    largest_rad: float
    """Largest turn; of an arm whose path asks for none, from the end of the rigid arm."""


class CompensationDocument(Row):
    """What ``validate compensate --json`` prints."""

    model: str
    model_sha256: str
    version: str
    engine: str
    poses: int
    joints: list[str]
    """Names of the joints, or of the legs whose drives they are."""
    commands: dict[str, list[list[float]]]
    """By ``rigid``, ``linear`` and ``loaded``: a row of coordinates a pose, mm or rad."""
    errors: dict[str, list[list[float]]]
    """Likewise of the loaded end: shift in mm and rotation vector in rad, world axes, from where it should be."""
    left: dict[str, ModelError]
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


def compensation(
    machine: Machine,
    engine: VjmEngine,
    path: ToolPath,
    *,
    gravity: Gravity | None = None,
    posture: str = "",
    end: str = "",
) -> CompensationDocument:
    """Compensate a path.

    Args:
        machine: of any kind; of one with poses the path counts from home.
        engine: that splits its beams.
        path: poses and wrenches.
        gravity: m/s².
        posture: near which the path begins; empty for any.
        end: name of the end frame.

    Raises:
        ValueError: a pose is out of reach, or the machine cannot be compensated.
        NoConvergenceError: there is no stable equilibrium somewhere.
    """
    compensated = compensate(
        machine, path.positions, path.turns, path.wrenches, gravity=gravity, posture=posture, end=end, engine=engine
    )
    return CompensationDocument(
        model=machine.name,
        model_sha256=machine.sha256,
        version=__version__,
        engine=engine.label,
        poses=len(path.positions),
        joints=list(compensated.joints),
        commands={name: rows.tolist() for name, rows in compensated.commands.items()},
        errors={name: rows.tolist() for name, rows in compensated.errors.items()},
        left={name: _left(rows) for name, rows in compensated.errors.items()},
    )


def _left(errors: Array) -> ModelError:
    shifts = np.linalg.norm(errors[:, :3], axis=1)
    turned = np.linalg.norm(errors[:, 3:], axis=1)
    return ModelError(largest_mm=float(shifts.max()), mean_mm=float(shifts.mean()), largest_rad=float(turned.max()))


def write_commands(document: CompensationDocument, file: Path) -> None:
    """Write a CSV: a row a pose, its coordinates and the error left, for each of the models."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    names = [f"{model}.{joint}" for model in document.commands for joint in document.joints]
    table.writerow(
        ["pose", *names, *(f"{model}.error_{unit}" for model in document.commands for unit in ("mm", "rad"))]
    )
    for k in range(document.poses):
        row: list[float] = [value for model in document.commands for value in document.commands[model][k]]
        for model in document.commands:
            error = np.array(document.errors[model][k])
            row += [float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))]
        table.writerow([k + 1, *(f"{value:.12g}" for value in row)])
    write_whole(file, stream.getvalue())
