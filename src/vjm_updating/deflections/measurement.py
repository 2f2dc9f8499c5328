"""A test of deflections from its two files, checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vjm.rotations import Array
from vjm_updating.deflections.readings import DeflectionData, read_deflections, read_loads
from vjm_updating.deflections.sheet import DeflectionSheet, read_deflection_sheet
from vjm_updating.deflections.study import DeflectionStudy, ends_of_test, with_loads
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import RobotMeasurement, model_of
from vjm_updating.poses.study import Candidates


@dataclass(frozen=True)
class DeflectionMeasurement(RobotMeasurement):
    """A test of deflections."""

    sheet: DeflectionSheet
    data: DeflectionData


def read_deflection_measurement(data: Path, sheet: Path) -> DeflectionMeasurement:
    """A measurement from its two files.

    Raises:
        ValueError: one of them or the model cannot be used; one line that says what, where and the remedy.
    """
    page = read_deflection_sheet(sheet)
    model = model_of(page, sheet, ends_of_test(page))
    machine = model.machine
    readings = read_deflections(data, page, machine.joints, machine.slides, postures_of(machine))
    return DeflectionMeasurement(page, readings, model, "deflections")


def read_deflection_candidates(path: Path, study: DeflectionStudy) -> Candidates:
    """Readings that could be taken, from a file: its loads, or the largest measured ones along each axis in turn.

    Raises:
        ValueError: it cannot be used; one line.
    """
    machine = study.machine
    q, load = read_loads(path, study.sheet, machine.joints, machine.slides, postures_of(machine))
    return with_loads(q, study.data) if load is None else Candidates(q, load)


def postures_of(machine: PoseMachine) -> dict[str, Array]:
    """Coordinates ``(n,)`` of the data's joints in the postures of the model file, by name."""
    postures = machine.chain.held
    return {label: np.array([values[name] for name in machine.joints]) for label, values in postures.items()}
