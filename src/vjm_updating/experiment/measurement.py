"""Measurements from their files, refused with one line where they cannot be any."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vjm.engines import VjmEngine
from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.fields import StiffnessSection, Table
from vjm.io.findings import refuse
from vjm.io.machine_file import machine_document
from vjm.io.model_file import ModelDocument, build_chain
from vjm.io.schema import BeamTable
from vjm.io.shapes import SHAPES, Shape
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm_updating.constants import physical_bound
from vjm_updating.experiment.data_file import (
    EFFORT,
    MOTION,
    POSE,
    TIME,
    WRENCH,
    DataError,
    SheetError,
    SheetSource,
    TableSource,
    beyond_turn,
    split_point,
    table_of,
)
from vjm_updating.experiment.measured import Measurement, nuisances
from vjm_updating.experiment.plausibility import compared, wrong_scale
from vjm_updating.experiment.readings import Readings, check_labels, read_readings
from vjm_updating.experiment.sheet import AnySheet, Sheet, read_sheet

# --- A sheet's ``[model]`` table: changes of the model file's own values, before the chain is built ---------------

SEGMENTS = ("link_segments", "foot_segments")
"""Keys that say how the model is solved and are no values of the machine."""
ACTUATOR = "actuator_compliance_mm_per_N"
_MATERIAL = tuple(Shape.model_fields)
_SECTIONS: tuple[type[Table], ...] = (StiffnessSection, *SHAPES.values())
_SECTION_KEYS = {key for table in _SECTIONS for key in table.model_fields} - {"source"}


def overridden(content: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A model document with a sheet's overrides.

    A key is one of docs/measured-data.md's, a key of the link or its section, or a dotted path into the file. A
    list's table is found by its ``name`` or its number from 1, and a path may begin at a part's name. ``content``
    is not changed.

    Raises:
        ValueError: a key leads nowhere.
    """
    document = copy.deepcopy(dict(content))
    flat = {key: value for key, value in _flat(overrides) if key not in SEGMENTS}
    shape = flat.pop("section", None)
    if shape is not None:
        _reshape(_link(document), shape)
    for key, value in flat.items():
        if key == ACTUATOR:
            drives = [part for part in _parts(document) if part.get("kind") == "actuator"]
            if value and not drives:
                raise ValueError(f"[model]: {ACTUATOR} = {value}, but the model has no actuator: leave it out")
            for part in drives:
                part["compliance_mm_per_N"] = value
        elif "." in key:
            _set(document, key, value)
        elif key in BeamTable.model_fields:
            _link(document)[key] = value
        elif key in _SECTION_KEYS:
            _link(document).setdefault("section", {})[key] = value
        elif key in document:
            document[key] = value
        else:
            known = [*SEGMENTS, ACTUATOR, *BeamTable.model_fields, *sorted(_SECTION_KEYS)]
            raise ValueError(f"[model]: unknown key '{key}'{did_you_mean(key, known)}")
    return document


def _flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _parts(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    return document.get("parts", [])


def _link(document: Mapping[str, Any]) -> dict[str, Any]:
    """The beam that a key without a path means: the one called link, else the only one."""
    beams = [part for part in _parts(document) if part.get("kind") == "beam"]
    named = [part for part in beams if part.get("name") == "link"] or beams
    if len(named) != 1:
        names = ", ".join(str(part.get("name")) for part in beams)
        raise ValueError(f"[model]: the model has no one link: write a path such as 'parts.<name>.key' ({names})")
    return named[0]


def _reshape(link: dict[str, Any], shape: object) -> None:
    """Another cross-section of the same material."""
    if not isinstance(shape, str) or shape not in SHAPES:
        raise ValueError(f"[model]: section must be one of {', '.join(SHAPES)}, got {shape!r}")
    old = link.get("section", {})
    kept = SHAPES[shape].model_fields if old.get("shape") == shape else _MATERIAL
    link["section"] = {key: value for key, value in old.items() if key in kept} | {"shape": shape}


def _set(document: dict[str, Any], path: str, value: object) -> None:
    *way, last = path.split(".")
    node: Any = document
    for i, step in enumerate(way):
        if i == 0 and step in BeamTable.model_fields:
            node = _link(document).setdefault(step, {})
        elif i == 0 and step not in document:
            node = _part(document, step, path)
        elif isinstance(node, list):
            node = _entry(node, step, path)
        elif isinstance(node, dict):
            node = node.setdefault(step, {})
        else:
            raise ValueError(f"[model]: '{path}' leads nowhere: '{step}' is inside a value")
    if not isinstance(node, dict):
        raise ValueError(f"[model]: '{path}' leads nowhere: name a key of a table")
    node[last] = value


def _part(document: Mapping[str, Any], name: str, path: str) -> dict[str, Any]:
    for part in _parts(document):
        if part.get("name") == name:
            return part
    names = [str(part.get("name")) for part in _parts(document)]
    raise ValueError(f"[model]: '{path}' leads nowhere: no table or part '{name}'{did_you_mean(name, names)}")


def _entry(table: list[Any], step: str, path: str) -> object:
    for entry in table:
        if isinstance(entry, dict) and entry.get("name") == step:
            return entry
    if step.isdigit() and 1 <= int(step) <= len(table):
        return table[int(step) - 1]
    raise ValueError(f"[model]: '{path}' leads nowhere: no entry '{step}'")


LARGEST, FULL_TURN = physical_bound(1e12), physical_bound(2.0 * np.pi)
"""Above these no reading is one of a machine: N, N mm, mm; rad."""


def read_measurement(data: TableSource, sheet: SheetSource) -> Measurement:
    """A measurement from its two files, or from columns and a sheet's content.

    Raises:
        ValueError: one of them or the model cannot be used; one line that says what, where and the remedy.
    """
    page = read_sheet(sheet)
    document, chain = machine_of_sheet(page)
    engine, table = engine_of_sheet(page, chain), table_of(data)
    readings = read_readings(table, page)
    nuisance_parameters = nuisances(page, readings.channels, chain)
    measurement = Measurement(page, readings, document, chain, engine, nuisance_parameters, table.sha256)
    with table.named():
        if page.kind == "joint":
            check_joint(measurement)
        else:
            check_labels(readings.posture.tolist(), readings.row, chain.postures)
            _check_time(readings)
            _check_held(measurement)
            _check_postures(readings, page.test.control)
            _check_channels(measurement)
    check_units(measurement)
    return measurement


def check_joint(measurement: Measurement) -> None:
    """Refuse a test of one joint that cannot be one: none, rigid in the model, unknown lever, or nothing moved.

    Raises:
        ValueError: naming the column and the remedy; one line.
    """
    _check_time(measurement.readings)
    _check_channels(measurement)
    sheet, readings, drive = measurement.sheet, measurement.readings, measurement.drive
    for name in readings.channels:
        arm = {"force_N": "force_mm", "deflection_mm": "gauge_mm"}.get(name, "")
        if not drive.slides and arm and getattr(sheet.lever, arm) is None:
            raise SheetError(f"{sheet.file}: {name} was read on a lever: add [lever] {arm}, from the joint's axis")
        if drive.slides and name in (MOTION[0], EFFORT[0]):
            raise DataError(f"column {name}: {drive.name} slides: give deflection_mm and force_N")
        values = readings.known(name)
        if not len(values) or not np.ptp(values):
            raise DataError(f"column {name}: it does not change: was the right column exported?")


def _check_channels(measurement: Measurement) -> None:
    """Refuse a channel whose errors the sheet does not give, and displacements out of reach."""
    for name in measurement.readings.channels:
        if name in (*WRENCH, *MOTION, *EFFORT):
            measurement.sheet.sigma(name)
    _check_reach(measurement)


def check_units(measurement: Measurement) -> None:
    """Refuse readings that are off by a thousand, or of the other sign; see `wrong_scale`.

    Of a test by force it is asked later: what is free may make the machine a mechanism.

    Raises:
        ImplausibleError: naming column and remedy.
    """
    if not measurement.loaded:
        refuse(wrong_scale(compared(measurement)))


def _check_time(readings: Readings) -> None:
    """Refuse a clock that goes backwards; it may begin anew with a posture or run that was not there before."""
    if TIME not in readings.values:
        return
    known = np.flatnonzero(~np.isnan(readings.values[TIME]))
    time, row = readings.values[TIME][known], readings.row[known]
    label = [(p, r) for p, r in zip(readings.posture[known], readings.run[known], strict=True)]
    back = [k for k in range(1, len(known)) if time[k] < time[k - 1] and label[k] in label[:k]]
    if not back:
        return
    k = back[0]
    swapped = time.copy()
    swapped[[k - 1, k]] = swapped[[k, k - 1]]
    if np.all(np.diff(swapped[max(k - 2, 0) : k + 2]) >= 0.0):
        raise DataError(
            f"rows {row[k - 1]} and {row[k]} are swapped in time ({TIME} {time[k - 1]:g}, then {time[k]:g}): put "
            "them in the order in which they were taken"
        )
    raise DataError(
        f"row {row[k]}, column {TIME}: {time[k]:g} comes after {time[k - 1]:g}, and {len(back)} rows in all go "
        f"back: sort by {TIME} or number the runs. Was the clock set back, or is it in ms before? "
        "Were rows written twice?"
    )


def _check_held(measurement: Measurement) -> None:
    """Refuse a gauge and a load on what the sheet holds: the load is the support's, and was not imposed."""
    for name, moved, load in zip(COMPONENTS, POSE, WRENCH, strict=True):
        if name not in measurement.sheet.test.held:
            continue
        if moved in measurement.readings.values:
            raise DataError(
                f"column {moved} reads what the sheet holds ([test] held has '{name}'): leave one of them out"
            )
        if load in measurement.readings.values and measurement.loaded:
            raise DataError(
                f"column {load} is the reaction of what the sheet holds ([test] held has '{name}'), and no load "
                "that was imposed: leave it out"
            )


def _check_postures(readings: Readings, control: str) -> None:
    """Refuse a posture that says nothing: no reading at all, or nothing that moved."""
    moved = [name for name in readings.channels if split_point(name)[1] in POSE]
    loaded = [name for name in readings.channels if name in WRENCH]
    for label in dict.fromkeys(readings.posture.tolist()):
        group = readings.only(readings.posture == label)
        for names, kind in ((loaded, "force"), (moved, "displacement")):
            if all(np.isnan(group.values[name]).all() for name in names):
                raise DataError(
                    f"posture {label}: every reading of {', '.join(names)} is blank: give the {kind}s or leave out "
                    f"the posture's {len(group)} rows"
                )
        controlled = [control] if control in readings.values else loaded if control == "force" else moved
        if not any(np.ptp(v) for name in controlled if len(v := group.known(name))):
            raise DataError(
                f"posture {label}, column {', '.join(controlled)}: it is constant over all {len(group)} rows: "
                "nothing was loaded; was the right column exported?"
            )


def _check_reach(measurement: Measurement) -> None:
    """Refuse displacements that leave the machine's own size, and what no instrument reads."""
    readings, length = measurement.readings, measurement.chain.characteristic_length
    for name, values in readings.values.items():
        point, channel = split_point(name)
        turns = channel in POSE[3:]
        # the end-effector is held, a point between may move out
        reach = length if point else length / 5.0
        bounds = [FULL_TURN if turns else LARGEST, *([reach] if channel in POSE[:3] else [])]
        for bound in bounds:
            far = np.flatnonzero(np.abs(values) > bound)
            if not len(far):
                continue
            value = float(values[far[0]])
            if turns:
                why = f"rad is more than a full turn: {beyond_turn(value, bound)}"
            elif bound == LARGEST:
                why = "is no reading"
            else:
                why = (
                    f"mm is out of reach (the longest part has {length:g} mm): is it in another unit, such as µm, "
                    "a factor 1000? Write it in mm"
                )
            raise DataError(f"row {readings.row[far[0]]}, column {name}: {value:g} {why}")


def planned_measurement(sheet: Sheet, readings: Readings) -> Measurement:
    """A measurement that has not been made: the sheet's machine and instruments, and where readings will be.

    Of the planned readings the wrench channels are zero.

    Raises:
        ValueError: the model cannot be used, or a posture is not known; one line.
    """
    document, chain = machine_of_sheet(sheet)
    unknown = next((p for p in readings.posture.tolist() if p not in chain.postures), None)
    if unknown is not None:
        raise SheetError(
            f"{sheet.file}: no posture '{unknown}' (there are {', '.join(chain.postures)}): add it to [postures]"
        )
    nuisance_parameters = nuisances(sheet, readings.channels, chain)
    return Measurement(sheet, readings, document, chain, engine_of_sheet(sheet, chain), nuisance_parameters, "")


def model_document(sheet: AnySheet, model: str) -> ModelDocument:
    """The document of the model that a sheet names: a file beside it, else one of the library.

    Raises:
        ModelFileError: it cannot be read; one line.
        SheetError: there is none; one line.
    """
    near = sheet.folder / model
    if near.is_file():
        return machine_document(near)
    try:
        return machine_document(model)
    except ModelFileError as error:
        raise SheetError(f"{sheet.file}: [test] model: {error}") from error


def machine_of_sheet(sheet: Sheet) -> tuple[dict[str, Any], Machine]:
    """The model document as a sheet changes it, and its chain.

    Raises:
        ValueError: the model cannot be used; one line.
    """
    source = model_document(sheet, sheet.test.model)
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
    return document, build_chain(document, f"{sheet.file}, model {source.file}", source.files)


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
