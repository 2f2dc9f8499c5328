"""Kinds of tests of a robot in many postures, by the ``kind`` of their sheets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vjm.io.findings import Finding
from vjm_updating.experiment.data_file import DataError, SheetSource, TableSource, source_of_sheet
from vjm_updating.experiment.sheet import kind_of_sheet
from vjm_updating.poses import deflection_plausibility as of_deflections
from vjm_updating.poses import plausibility as of_poses
from vjm_updating.poses.deflections import (
    DeflectionStudy,
    ends_of_test,
    read_deflection_sheet,
    read_deflections,
    with_loads,
)
from vjm_updating.poses.identifiability import NEXT_SEED as SEED
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import (
    RobotMeasurement,
    ends_of,
    model_of,
    read_candidates,
    read_pose_sheet,
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
    page = read_pose_sheet(sheet)
    model = model_of(page, ends_of(page.markers))
    read = RobotMeasurement(page, read_poses(data, page, model.machine), model, "poses")
    of_poses.check_units(read)
    study = PoseStudy(page, model.machine, read.data).without_outliers()
    of_poses.check_count(study)

    def candidates(path: Path) -> Candidates:
        q, load = read_candidates(path, page, study.machine, read.data.markers)
        if load is not None and not study.points:
            raise DataError(f"{path.name}: has wrenches, and {read.data.file} has none: leave their columns out")
        postures = study.with_wrenches(q, np.random.default_rng(SEED)) if load is None else Candidates(q, load)
        return within_limits(path, study.machine, postures)

    return PreparedTest(read, study, lambda strict: of_poses.considered(read, study, strict=strict), candidates)


def _deflections(data: TableSource, sheet: SheetSource) -> PreparedTest:
    page = read_deflection_sheet(sheet)
    model = model_of(page, ends_of_test(page))
    readings = read_deflections(data, page, model.machine)
    read = RobotMeasurement(page, readings, model, "deflections")
    of_deflections.check_units(readings, model.machine)
    study = DeflectionStudy(page, model.machine, readings)
    of_deflections.check_count(study)
    study = study.without_outliers()

    def candidates(path: Path) -> Candidates:
        q, load = read_candidates(path, page, study.machine, study.points)
        postures = with_loads(q, study.data) if load is None else Candidates(q, load)
        return within_limits(path, study.machine, postures)

    return PreparedTest(
        read, study, lambda strict: of_deflections.considered(read, study, strict=strict), candidates
    )


def within_limits(path: Path, machine: PoseMachine, candidates: Candidates) -> Candidates:
    """Candidates of a file.

    Raises:
        DataError: a joint would be sent beyond its limits.
    """
    limits = machine.tree.limits
    for number, row in enumerate(machine.rows(candidates.q), start=1):
        if said := limits.said(row):
            raise DataError(f"{path.name}: posture {number}: out of reach: {said}")
    return candidates
