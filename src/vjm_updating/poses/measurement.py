"""A test of poses from its two files, checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.model_file import build_chain, read_document
from vjm.io.urdf import import_urdf
from vjm.model.chain import Chain
from vjm.model.joints import CoupledJoint
from vjm_updating.experiment.sheet import SheetError
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.readings import PoseData, read_poses
from vjm_updating.poses.sheet import PoseSheet, read_pose_sheet


@dataclass(frozen=True)
class PoseMeasurement:
    """What was measured and on what.

    Attributes:
        sheet: the sheet.
        data: the postures.
        document: of the model, as TOML gives it.
        chain: the machine of the model.
        machine: the same, extended.
        model_sha256: of the model file; of a URDF the empty text.
        doubts: what is likely a mistake in a URDF.
    """

    sheet: PoseSheet
    data: PoseData
    document: dict[str, Any]
    chain: Chain
    machine: PoseMachine
    model_sha256: str
    doubts: tuple[str, ...] = ()


def read_pose_measurement(data: Path, sheet: Path) -> PoseMeasurement:
    """A measurement from its two files.

    Raises:
        ValueError: one of them or the model cannot be used; one line that says what, where and the remedy.
    """
    page = read_pose_sheet(sheet)
    content, file, sha256, doubts = _document(page, sheet)
    chain = build_chain(content, file, sha256)
    driven = tuple(joint for joint in chain.held_joints if not isinstance(joint, CoupledJoint))
    names = [joint.name for joint in driven]
    for column, joint in page.joints.items():
        if joint not in names:
            raise SheetError(
                f"{page.file}: [joints] {column} = '{joint}': the model has no such driven joint; "
                f"it has {', '.join(names)}"
            )
    ends = {name: (table.on, np.array(table.position_mm, dtype=float)) for name, table in page.markers.items()}
    try:
        machine = PoseMachine(chain, ends, rigid=page.test.rigid, at_output=page.at_output)
    except ValueError as error:
        raise SheetError(f"{page.file}: {error}") from error
    followers = [part for part in chain.parts if isinstance(part, CoupledJoint)]
    readings = read_poses(data, page, machine.joints, machine.slides, followers)
    return PoseMeasurement(page, readings, content, chain, machine, sha256, doubts)


def _document(page: PoseSheet, path: Path) -> tuple[dict[str, Any], str, str, tuple[str, ...]]:
    near = path.parent / page.test.model
    if near.suffix == ".urdf":
        if not near.is_file():
            raise SheetError(f"{page.file}: [test] model: no file {near.name} beside the sheet")
        found = import_urdf(near, page.test.tip)
        return found.document, near.name, "", tuple(found.notes.doubtful)
    source = read_document(near if near.is_file() else page.test.model)
    return source.content, source.file, source.sha256, ()
