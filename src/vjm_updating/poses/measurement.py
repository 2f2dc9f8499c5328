"""A test of a robot in many postures from its two files, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from vjm.io.model_file import build_chain
from vjm.io.provenance import digest
from vjm.io.robot_file import Description, import_robot
from vjm.io.stiffness_file import beside
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.experiment.measurement import model_document, refuse_laws
from vjm_updating.experiment.source import SheetError
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.sheet import Rider, RobotSheet

DESCRIPTIONS = (".urdf", ".sdf")
"""Of files that a sheet may name in place of a model file."""


@dataclass(frozen=True)
class SheetModel:
    """The model that a sheet names.

    Attributes:
        document: as TOML gives it.
        chain: its machine.
        machine: the same, extended.
        doubts: what is likely a mistake in a URDF or an SDF file.
        notes: where the stiffness of its drives is from.
    """

    document: dict[str, Any]
    chain: Machine
    machine: PoseMachine
    doubts: tuple[str, ...]
    notes: tuple[str, ...] = ()


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
    named = _document(page)
    chain = build_chain(named.content, named.file, named.files)
    refuse_laws(chain, page.file)
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
    return SheetModel(named.content, chain, machine, named.doubts, named.notes)


@dataclass(frozen=True)
class _Named:
    """The document that a sheet names; its file, what it was made of, and what is to be said of it."""

    content: dict[str, Any]
    file: str
    files: Mapping[str, str]
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def _document(page: RobotSheet) -> _Named:
    near = page.folder / page.test.model
    if near.suffix not in DESCRIPTIONS:
        source = model_document(page, page.test.model)
        return _Named(source.content, source.file, source.files)
    if not near.is_file():
        raise SheetError(f"{page.file}: [test] model: no file {near.name} beside the sheet")
    drives = beside(near)
    found = import_robot(Description(near), page.test.tip, stiffness=drives)
    files = {file.name: digest(file.read_bytes()) for file in (near, drives) if file is not None}
    # what is said last is from where the stiffness of the drives is
    notes = tuple(found.notes.changed[-1:]) if drives is not None else ()
    return _Named(found.document, near.name, files, tuple(found.notes.doubtful), notes)
