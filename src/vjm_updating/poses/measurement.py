"""A test of a robot in many postures from its two files, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from vjm.io.model_file import build_chain
from vjm.io.provenance import digest
from vjm.io.urdf import import_urdf
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.experiment.measurement import model_document
from vjm_updating.experiment.source import SheetError
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.sheet import Rider, RobotSheet


@dataclass(frozen=True)
class SheetModel:
    """The model that a sheet names.

    Attributes:
        document: as TOML gives it.
        chain: its machine.
        machine: the same, extended.
        doubts: what is likely a mistake in a URDF.
    """

    document: dict[str, Any]
    chain: Machine
    machine: PoseMachine
    doubts: tuple[str, ...]


@dataclass(frozen=True)
class RobotMeasurement:
    """What was measured and on what, of any kind of test.

    Attributes:
        sheet: the sheet.
        data: the postures.
        model: of the robot.
        kind: of test.
    """

    sheet: RobotSheet
    data: PoseData
    model: SheetModel
    kind: Literal["poses", "deflections"]


def ends_of(tables: Mapping[str, Rider]) -> dict[str, tuple[str, Array]]:
    """Part behind which each point of a sheet rides, and where there, ``(3,)`` mm, by its name."""
    return {name: (table.on, np.array(table.position_mm, dtype=float)) for name, table in tables.items()}


def model_of(page: RobotSheet, ends: dict[str, tuple[str, Array]]) -> SheetModel:
    """The model that a sheet names.

    Args:
        page: the sheet; the model may lie beside it.
        ends: points that it names, see `ends_of`.

    Raises:
        ValueError: the model cannot be used; one line.
    """
    content, file, files, doubts = _document(page)
    chain = build_chain(content, file, files)
    names = [joint.name for joint in chain.held_joints]
    for column, joint in page.joints.items():
        if joint not in names:
            raise SheetError(
                f"{page.file}: [joints] {column} = '{joint}': the model has no such driven joint; "
                f"it has {', '.join(names)}"
            )
    try:
        machine = PoseMachine(chain, ends, rigid=page.test.rigid, at_output=page.at_output)
    except ValueError as error:
        raise SheetError(f"{page.file}: {error}") from error
    return SheetModel(content, chain, machine, doubts)


def _document(page: RobotSheet) -> tuple[dict[str, Any], str, Mapping[str, str], tuple[str, ...]]:
    near = page.folder / page.test.model
    if near.suffix == ".urdf":
        if not near.is_file():
            raise SheetError(f"{page.file}: [test] model: no file {near.name} beside the sheet")
        found = import_urdf(near, page.test.tip)
        return found.document, near.name, {near.name: digest(near.read_bytes())}, tuple(found.notes.doubtful)
    source = model_document(page, page.test.model)
    return source.content, source.file, source.files, ()
