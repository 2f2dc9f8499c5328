"""Kinds of tests of a robot in many postures, by the ``kind`` of their sheets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vjm.io.findings import Finding, refuse
from vjm_updating.experiment.data_file import DataError, SheetSource, TableSource, source_of_sheet, table_of
from vjm_updating.experiment.sheet import kind_of_sheet, read_sheet_of
from vjm_updating.poses import plausibility
from vjm_updating.poses.deflections import DeflectionSheet, DeflectionStudy, ends_of_test, read_deflections
from vjm_updating.poses.identifiability import NEXT_SEED as SEED
from vjm_updating.poses.measurement import (
    PoseSheet,
    RobotMeasurement,
    ends_of,
    model_of,
    read_candidates,
    read_poses,
)
from vjm_updating.poses.pooled import PooledStudy
from vjm_updating.poses.pose_study import PoseStudy
from vjm_updating.poses.state import Candidates
from vjm_updating.poses.study import SeriesStudy, Study

DEFLECTIONS = "deflections"
KINDS = {"poses": "a test of poses", DEFLECTIONS: "a test of deflections"}
"""What `vjm_updating.poses.run` takes, and what each is called."""


@dataclass(frozen=True)
class PreparedTest:
    """A test that was read, checked and aligned.

    Attributes:
        measurement: its files.
        study: what is fitted to it.
        considered: given whether what is doubtful is refused, what is implausible about it.
        candidates: of a file, the readings that could be taken next, within the joints' limits.
    """

    measurement: RobotMeasurement
    study: Study
    considered: Callable[[bool], list[Finding]]
    candidates: Callable[[Path], Candidates]


def read_test(data: TableSource, sheet: SheetSource) -> PreparedTest:
    """A test from its two files, or from columns and a sheet's content.

    Raises:
        ValueError: a file cannot be used; one line.
    """
    source = source_of_sheet(sheet)
    return _deflections(data, source) if kind_of_sheet(source) == DEFLECTIONS else _poses(data, source)


def together(tests: Sequence[PreparedTest]) -> PreparedTest:
    """Several series of one machine as one test; its model file is the first one's.

    Raises:
        ValueError: they are of different machines, or of different kinds.
    """
    first = tests[0]
    if len(tests) == 1:
        return first
    study = PooledStudy(_named([one for test in tests for one in test.study.groups]), range(len(tests)))
    read = replace(first.measurement, data=study.data)

    def considered(strict: bool) -> list[Finding]:
        return list(dict.fromkeys(finding for one in tests for finding in one.considered(strict)))

    return PreparedTest(read, study, considered, first.candidates)


def _named(studies: Sequence[SeriesStudy]) -> list[SeriesStudy]:
    """Tests whose files have different names: of one name each is numbered."""
    names = [one.data.file for one in studies]
    tests = []
    for number, one in enumerate(studies, start=1):
        own = copy(one)
        if names.count(one.data.file) > 1:
            own.data = replace(one.data, file=f"{one.data.file} ({number})")
        tests.append(own)
    return tests


def _poses(data: TableSource, sheet: SheetSource) -> PreparedTest:
    page = read_sheet_of(sheet, PoseSheet)
    model, table = model_of(page, ends_of(page.markers)), table_of(data)
    with table.named():
        read = RobotMeasurement(page, read_poses(table, page, model.machine), model, "poses")
    refuse(plausibility.units(read))
    study = PoseStudy(page, model.machine, read.data).without_outliers()
    plausibility.check_count(study)

    def considered(strict: bool) -> list[Finding]:
        return plausibility.considered(read, study, strict=strict)

    return PreparedTest(read, study, considered, lambda path: _candidates(path, study, read.data.markers))


def _deflections(data: TableSource, sheet: SheetSource) -> PreparedTest:
    page = read_sheet_of(sheet, DeflectionSheet)
    model, table = model_of(page, ends_of_test(page)), table_of(data)
    with table.named():
        readings = read_deflections(table, page, model.machine)
    read = RobotMeasurement(page, readings, model, "deflections")
    refuse(plausibility.deflection_units(readings, model.machine))
    whole = DeflectionStudy(page, model.machine, readings)
    plausibility.check_deflection_count(whole)
    study = whole.without_outliers()

    def considered(strict: bool) -> list[Finding]:
        return plausibility.deflections_considered(read, study, strict=strict)

    return PreparedTest(read, study, considered, lambda path: _candidates(path, study, study.points))


def _candidates(path: Path, study: SeriesStudy, points: tuple[str, ...]) -> Candidates:
    """The readings of a file that could be taken, with wrenches at points.

    Raises:
        DataError: it cannot be used, or a joint would be sent beyond its limits.
    """
    q, load = read_candidates(path, study.sheet, study.machine, points)
    if load is not None and not study.points:
        raise DataError(f"{path.name}: has wrenches, and {study.data.file} has none: leave their columns out")
    for number, row in enumerate(study.machine.rows(q), start=1):
        if said := study.machine.tree.limits.said(row):
            raise DataError(f"{path.name}: posture {number}: out of reach: {said}")
    return study.under_loads(q, np.random.default_rng(SEED)) if load is None else Candidates(q, load)
