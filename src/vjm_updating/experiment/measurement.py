"""A measurement: the sheet, its readings, and the nominal machine as the sheet describes it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.machine_file import machine_document
from vjm.io.model_file import build_chain
from vjm.model.joints import Joint
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.vjm_engine import VjmEngine
from vjm_updating.experiment.channels import EFFORT, MOTION, POSE, WRENCH
from vjm_updating.experiment.checks import check_postures, check_reach, check_time, check_units
from vjm_updating.experiment.nuisances import Nuisance, nuisances
from vjm_updating.experiment.overrides import SEGMENTS, overridden
from vjm_updating.experiment.readings import Readings, read_readings
from vjm_updating.experiment.sheet import Sheet, read_sheet
from vjm_updating.experiment.source import (
    DataError,
    SheetError,
    SheetSource,
    TableSource,
    source_of_readings,
    source_of_sheet,
)


@dataclass(frozen=True)
class Measurement:
    """What was measured and on what.

    Attributes:
        sheet: the test sheet.
        readings: in the order in which they were taken.
        document: the model file's content with the sheet's overrides and postures.
        chain: the nominal machine.
        engine: that solves it with as many springs as the sheet says.
        nuisances: that the sheet's tolerances allow, independent of one another.
        model_sha256: of the model file.
        data_sha256: of the data file.
    """

    sheet: Sheet
    readings: Readings
    document: dict[str, Any]
    chain: Machine
    engine: VjmEngine
    nuisances: tuple[Nuisance, ...]
    model_sha256: str
    data_sha256: str

    @property
    def drive(self) -> Joint:
        """The joint that a test of one joint is about.

        Raises:
            SheetError: the model has no such joint, or it does not deflect there.
        """
        sheet, joints = self.sheet, {joint.name: joint for joint in self.chain.moving if joint.held}
        found = joints.get(sheet.test.joint)
        if found is None:
            raise SheetError(
                f"{sheet.file}: [test] joint: no actuated, coupled or sprung joint '{sheet.test.joint}' in "
                f"{self.chain.name}; there are {', '.join(joints) or 'none'}"
            )
        if not found.compliance > 0.0:
            raise SheetError(
                f"{sheet.file}: [test] joint: {found.name} is rigid in the model: give it a compliance in the "
                "model file, a first guess"
            )
        return found

    @property
    def joint_compliance(self) -> float:
        """Of that joint in the model, rad/(N mm) or mm/N."""
        return self.drive.compliance

    @property
    def free(self) -> tuple[str, ...]:
        """Components of the end-effector's pose that no support holds: of a test by force; else none."""
        test = self.sheet.test
        return tuple(name for name in COMPONENTS if name not in test.held) if test.by_force else ()

    @property
    def loaded(self) -> bool:
        """Whether loads say what the machine does: they were imposed, and its pose is not wholly known.

        Where each component of the pose was read or held, displacements say it, whichever of the two was imposed.
        """
        read = {name for name, column in zip(COMPONENTS, POSE, strict=True) if column in self.readings.values}
        return any(name not in read for name in self.free)

    @property
    def imposed(self) -> bool:
        """Whether the pose of the end-effector is known at every reading, whichever end controlled the test."""
        return any(name in self.readings.values for name in POSE)


def read_measurement(data: TableSource, sheet: SheetSource) -> Measurement:
    """A measurement from its two files, or from columns and a sheet's content.

    Raises:
        ValueError: one of them or the model cannot be used; one line that says what, where and the remedy.
    """
    table, text = source_of_readings(data), source_of_sheet(sheet)
    page = read_sheet(text)
    document, chain, sha256 = machine_of_sheet(page, text.folder)
    engine = engine_of_sheet(page, chain)
    readings = read_readings(table, page)
    of_joint = page.kind == "joint"
    unknown = next((p for p in readings.posture.tolist() if p not in chain.postures), None)
    if unknown is not None and not of_joint:
        known = ", ".join(chain.postures)
        row = readings.row[readings.posture == unknown][0]
        raise DataError(
            f"{readings.file}: row {row}, column posture: unknown posture '{unknown}' (there are {known}): "
            "add it to the sheet's [postures]"
        )
    check_time(readings)
    if not of_joint:
        check_held(readings, page)
        check_postures(readings, page.test.control)
    needed = (*WRENCH, *MOTION, *EFFORT)
    noise = {
        name: page.sigma(name).noise for name in readings.channels if name in needed or name in page.instrument
    }
    check_reach(readings, chain)
    measurement = Measurement(
        sheet=page,
        readings=readings,
        document=document,
        chain=chain,
        engine=engine,
        nuisances=nuisances(page, readings.channels, chain),
        model_sha256=sha256,
        data_sha256=table.sha256,
    )
    if of_joint:
        check_joint(measurement)
    elif measurement.loaded:
        check_supports(measurement)
    else:
        check_units(readings, chain, engine, noise)
    return measurement


def check_held(readings: Readings, sheet: Sheet) -> None:
    """Refuse a gauge on what the sheet holds.

    Raises:
        DataError: there is one.
    """
    for name, column in zip(COMPONENTS, POSE, strict=True):
        if name in sheet.test.held and column in readings.values:
            raise DataError(
                f"{readings.file}: column {column} reads what the sheet holds ([test] held has '{name}'): "
                "leave one of them out"
            )


def check_supports(measurement: Measurement) -> None:
    """Refuse a load on what the sheet holds: it is the support's, and says nothing of what is imposed.

    Raises:
        DataError: there is one.
    """
    for name, column in zip(COMPONENTS, WRENCH, strict=True):
        if name in measurement.sheet.test.held and column in measurement.readings.values:
            raise DataError(
                f"{measurement.readings.file}: column {column} is the reaction of what the sheet holds ([test] "
                f"held has '{name}'), and no load that was imposed: leave it out"
            )


def check_joint(measurement: Measurement) -> None:
    """Refuse a test of a joint that cannot be one.

    Raises:
        ValueError: there is no such joint, it is rigid in the model, its lever is not known, or nothing moved.
    """
    sheet, readings, drive = measurement.sheet, measurement.readings, measurement.drive
    for name in readings.channels:
        arm = {"force_N": "force_mm", "deflection_mm": "gauge_mm"}.get(name, "")
        if not drive.slides and arm and getattr(sheet.lever, arm) is None:
            raise SheetError(f"{sheet.file}: {name} was read on a lever: add [lever] {arm}, from the joint's axis")
        if drive.slides and name in (MOTION[0], EFFORT[0]):
            raise DataError(f"{readings.file}: column {name}: {drive.name} slides: give deflection_mm and force_N")
        values = readings.values[name][~np.isnan(readings.values[name])]
        if not len(values) or not np.ptp(values):
            raise DataError(f"{readings.file}: column {name}: it does not change: was the right column exported?")


def planned_measurement(sheet: Sheet, path: Path, readings: Readings) -> Measurement:
    """A measurement that has not been made: the sheet's machine and instruments, and where readings will be.

    Args:
        sheet: the test sheet.
        path: its file, beside which the model may lie.
        readings: planned displacements; wrench channels are zero.

    Raises:
        ValueError: the model cannot be used, or a posture is not known; one line.
    """
    document, chain, sha256 = machine_of_sheet(sheet, path.parent)
    unknown = next((p for p in readings.posture.tolist() if p not in chain.postures), None)
    if unknown is not None:
        raise SheetError(
            f"{sheet.file}: no posture '{unknown}' (there are {', '.join(chain.postures)}): add it to [postures]"
        )
    found = nuisances(sheet, readings.channels, chain)
    return Measurement(sheet, readings, document, chain, engine_of_sheet(sheet, chain), found, sha256, "")


def machine_of_sheet(sheet: Sheet, folder: Path) -> tuple[dict[str, Any], Machine, str]:
    """The model document as a sheet changes it, its chain, and the file's hash.

    Raises:
        ValueError: the model cannot be used; one line.
    """
    name: str | Path = sheet.test.model
    if (folder / sheet.test.model).is_file():
        name = folder / sheet.test.model
    source = machine_document(name)
    build_chain(source.content, source.file)  # what is wrong with the model itself is said of the model
    try:
        document = overridden(source.content, sheet.model)
    except ValueError as error:
        raise SheetError(f"{sheet.file}: {error}") from error
    given = source.content.get("postures", {})
    for label, q in sheet.postures.items():
        # an empty list is the model's own posture of that label, else all joints at zero
        joints = sum(1 for part in document.get("parts", []) if part.get("kind") == "joint")
        document.setdefault("postures", {})[label] = q or given.get(label, [0.0] * joints)
    if sheet.poses:
        document["poses"] = {**document.get("poses", {}), **sheet.poses}
    for label, point in sheet.points.items():
        parts = [part.get("name") for part in document.get("parts", [])]
        if point.body not in parts:
            raise SheetError(
                f"{sheet.file}: [points.{label}]: no part '{point.body}'; there are {', '.join(parts)}"
            )
    return document, build_chain(document, f"{sheet.file}, model {source.file}", source.sha256), source.sha256


def engine_of_sheet(sheet: Sheet, chain: Machine) -> VjmEngine:
    """The lumped model with the sheet's number of springs, else the model file's; one a link is the paper's own.

    Raises:
        SheetError: that is no number of springs.
    """
    counts = []
    for key, default in zip(SEGMENTS, (chain.link_segments or 12, chain.foot_segments or 1), strict=True):
        count = sheet.model.get(key, default)
        if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= 1000:
            raise SheetError(f"{sheet.file}: [model] {key} must be a whole number from 1 to 1000, got {count!r}")
        counts.append(count)
    link, foot = counts
    return VjmEngine.of(link, foot)
