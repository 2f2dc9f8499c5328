"""A path compensated by the rigid, the linear and the loaded model of a machine, beside each other."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
from pydantic import Field

from vjm import __version__
from vjm.compensation import compensate
from vjm.io.files import write_whole
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_output.documents import DoubtRow, Row
from vjm_validation.tool_path import ToolPath


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
    found = compensate(
        machine, path.positions, path.turns, path.wrenches, gravity=gravity, posture=posture, end=end, engine=engine
    )
    return CompensationDocument(
        model=machine.name,
        model_sha256=machine.sha256,
        version=__version__,
        engine=engine.label,
        poses=len(path.positions),
        joints=list(found.joints),
        commands={name: rows.tolist() for name, rows in found.commands.items()},
        errors={name: rows.tolist() for name, rows in found.errors.items()},
        left={name: _left(rows) for name, rows in found.errors.items()},
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
