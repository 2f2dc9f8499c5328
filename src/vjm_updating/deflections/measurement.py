"""A test of deflections from its two files, checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vjm_updating.deflections.readings import DeflectionData, read_deflections
from vjm_updating.deflections.sheet import DeflectionSheet, read_deflection_sheet
from vjm_updating.deflections.study import DeflectionStudy, ends_of_test, with_loads
from vjm_updating.experiment.source import SheetSource, TableSource
from vjm_updating.poses.measurement import RobotMeasurement, model_of
from vjm_updating.poses.readings import read_candidates
from vjm_updating.poses.study import Candidates


@dataclass(frozen=True)
class DeflectionMeasurement(RobotMeasurement):
    """A test of deflections."""

    sheet: DeflectionSheet
    data: DeflectionData


def read_deflection_measurement(data: TableSource, sheet: SheetSource) -> DeflectionMeasurement:
    """A measurement from its two files, or from columns and a sheet's content.

    Raises:
        ValueError: one of them or the model cannot be used; one line that says what, where and the remedy.
    """
    page = read_deflection_sheet(sheet)
    model = model_of(page, ends_of_test(page))
    return DeflectionMeasurement(page, read_deflections(data, page, model.machine), model, "deflections")


def read_deflection_candidates(path: Path, study: DeflectionStudy) -> Candidates:
    """Readings that could be taken, from a file: its loads, or the largest measured ones along each axis in turn.

    Raises:
        ValueError: it cannot be used; one line.
    """
    q, load = read_candidates(path, study.sheet, study.machine, study.points)
    return with_loads(q, study.data) if load is None else Candidates(q, load)
