"""``ROBOT.stiffness.toml`` or ``.csv``: how stiff the drives are of a robot whose description does not say it.

It stands beside the description and has a table for each joint, by the joint's name there::

    [joints.shoulder]
    stiffness_Nm_per_rad = 31000.0
    lateral_rad_per_Nmm = [2e-9, 2e-9]
    rotor_kg_mm2 = 2.1e6
    source = "the gear's data sheet"

A table has a row for each joint, and such columns: ``joint,stiffness_Nm_per_rad,lateral_1_rad_per_Nmm``.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import pydantic
from pydantic import Field, model_validator

from vjm.io.errors import ModelFileError, did_you_mean, one_line, validated
from vjm.io.fields import Table
from vjm.io.files import csv_rows, small_text, toml_content, toml_text
from vjm.io.joint_tables import AnyLaw, Compliance, Pair
from vjm.io.robot_document import COMPLIANCE, ROTOR, Imported
from vjm.model.machine import Machine

SUFFIX, TABLE = ".stiffness.toml", ".stiffness.csv"
ARCMINUTE = math.pi / 180.0 / 60.0
"""rad"""
LATERAL = ("lateral_1_rad_per_Nmm", "lateral_2_rad_per_Nmm")
COLUMNS: dict[str, tuple[str, float]] = {
    "stiffness_Nm_per_rad": ("stiffness_Nm_per_rad", 1.0),
    "stiffness_Nmm_per_rad": ("stiffness_Nm_per_rad", 1e-3),
    "stiffness_Nm_per_arcmin": ("stiffness_Nm_per_rad", 1.0 / ARCMINUTE),
    "stiffness_N_per_mm": ("stiffness_N_per_mm", 1.0),
    "stiffness_N_per_m": ("stiffness_N_per_mm", 1e-3),
    "compliance_rad_per_Nmm": ("compliance_rad_per_Nmm", 1.0),
    "compliance_rad_per_Nm": ("compliance_rad_per_Nmm", 1e-3),
    "compliance_mm_per_N": ("compliance_mm_per_N", 1.0),
    "lateral_1_rad_per_Nmm": (LATERAL[0], 1.0),
    "lateral_2_rad_per_Nmm": (LATERAL[1], 1.0),
    "lateral_1_rad_per_Nm": (LATERAL[0], 1e-3),
    "lateral_2_rad_per_Nm": (LATERAL[1], 1e-3),
    "rotor_kg_mm2": ("rotor_kg_mm2", 1.0),
    "rotor_kg_m2": ("rotor_kg_mm2", 1e6),
    "rotor_kg": ("rotor_kg", 1.0),
}
"""Columns with numbers of a table: key of a joint's table, and what the number is times."""
LARGEST, MANY_JOINTS = 2**20, "no robot has so many joints"
"""Bytes: a table of ten thousand joints has half of it."""
Stiff = Annotated[float, Field(gt=0.0, le=1e15)]


class JointStiffness(Table):
    """What is known of one joint's drive: a stiffness or a compliance about or along its axis, and more."""

    stiffness_Nm_per_rad: Stiff | None = Field(None, description="about its axis, where it turns")  # noqa: N815
    stiffness_N_per_mm: Stiff | None = Field(None, description="along its axis, where it slides")  # noqa: N815
    compliance_rad_per_Nmm: Compliance | None = None  # noqa: N815
    compliance_mm_per_N: Compliance | None = None  # noqa: N815
    lateral_rad_per_Nmm: Pair | None = Field(None, description="about the two other axes")  # noqa: N815
    rotor_kg_mm2: float | None = Field(None, ge=0.0, description="inertia times the squared gear ratio")
    rotor_kg: float | None = Field(None, ge=0.0, description="the same of a joint that slides")
    law: AnyLaw | None = Field(None, description="of its spring about or along its axis, as in a model file")
    source: str = Field("", description="where the numbers are from")

    @model_validator(mode="after")
    def _once(self) -> JointStiffness:
        given = [
            key
            for key in type(self).model_fields
            if key.startswith(("stiff", "compl", "law")) and getattr(self, key)
        ]
        if len(given) > 1:
            raise ValueError(f"has {' and '.join(given)}: give one of them")
        return self

    def keys(self, slides: bool) -> dict[str, Any]:
        """Of the joint's table in a model file.

        Raises:
            ValueError: one is of a joint that moves otherwise.
        """
        kind, other = ("slides", "turns") if slides else ("turns", "slides")
        stiff = {"turns": "stiffness_Nm_per_rad", "slides": "stiffness_N_per_mm"}
        for key in (stiff[other], COMPLIANCE[other], ROTOR[other]):
            if getattr(self, key) is not None:
                raise ValueError(f"has {key}, but it {kind}")
        named = COMPLIANCE[kind], "lateral_rad_per_Nmm", ROTOR[kind], "source"
        entries = {key: value for key in named if (value := getattr(self, key)) not in (None, "")}
        if self.law is not None:
            self.law.law(slides=slides)
            entries["law"] = self.law.model_dump(exclude_unset=True)
        if (stiffness := getattr(self, stiff[kind])) is not None:
            # N m are 1e3 N mm
            entries[COMPLIANCE[kind]] = 1.0 / (stiffness if slides else 1e3 * stiffness)
        return entries


class StiffnessFile(Table):
    """The whole file."""

    joints: dict[str, JointStiffness]


def beside(description: Path) -> Path | None:
    """The file beside a robot's description, ``arm.stiffness.toml`` beside ``arm.urdf``; None where none is.

    Raises:
        ModelFileError: there are two, of both kinds.
    """
    name = description.name.removesuffix(".xacro")
    files = [description.with_name(Path(name).stem + suffix) for suffix in (SUFFIX, TABLE)]
    existing = [file for file in files if file.is_file()]
    if len(existing) > 1:
        raise ModelFileError(f"{files[0].name} and {files[1].name} both stand beside {description.name}: keep one")
    return existing[0] if existing else None


def fill_in(imported: Imported, file: Path) -> None:
    """Put what a file says of joints into an imported document, and say it.

    Raises:
        ModelFileError: the file cannot be read, has other keys, or a joint of it has no drive or moves otherwise.
    """
    tables = _table(file) if file.suffix.lower() == ".csv" else _document(file)
    parts = {part["name"]: part for part in imported.document["parts"]}
    for joint, given in tables.items():
        part = parts.get(imported.joints.get(joint, ""))
        if part is None:
            known = did_you_mean(joint, imported.joints)
            imported.notes.doubtful.append(
                f"{file.name} names the joint '{joint}', which is not in the machine{known}"
            )
            continue
        if part["kind"] == "joint":
            raise ModelFileError(f"{file.name}: joint '{joint}' has no drive: its spring stands in {imported.file}")
        try:
            keys = given.keys(part.get("motion") == "slides")
        except ValueError as error:
            raise ModelFileError(f"{file.name}: joint '{joint}' {error}") from error
        part |= keys
        if "law" in keys:
            # in place of what the description says
            for key in COMPLIANCE.values():
                part.pop(key, None)
        if part["name"] in imported.to_fill_in and keys.keys() & {*COMPLIANCE.values(), "law"}:
            imported.to_fill_in.remove(part["name"])
    read = [joint for joint in tables if joint in imported.joints]
    imported.notes.changed.append(f"the stiffness of {', '.join(read) or 'no joint'} is that of {file.name}")
    imported.document["source"] = f"{imported.file} and {file.name}{imported.unfilled}"


def _document(file: Path) -> dict[str, JointStiffness]:
    """What a TOML file says of joints, by their names."""
    content = toml_content(small_text(file, LARGEST, MANY_JOINTS), file.name)
    return validated(StiffnessFile, content, file.name, lambda _: JointStiffness.model_fields).joints


def _table(file: Path) -> dict[str, JointStiffness]:
    """What a CSV file says of joints, by their names; empty cells say nothing."""
    text = small_text(file, LARGEST, MANY_JOINTS)
    empty = "is empty: begin with a line of columns, joint,stiffness_Nm_per_rad"
    joints: dict[str, JointStiffness] = {}
    for place, cells in csv_rows(text, file.name, _columns, empty, loose=True):
        given = {column: cell for column, cell in cells.items() if cell}
        if not (name := given.pop("joint", "")):
            raise ModelFileError(f"{place}, column joint: is empty: name the joint")
        if name in joints:
            raise ModelFileError(f"{place}, column joint: '{name}' is there already: give each joint one line")
        joints[name] = _row(place, given)
    return joints


def _columns(cells: list[str], place: str) -> list[str]:
    columns = [_column(place, cell) for cell in cells]
    if "joint" not in columns or len(set(columns)) < len(columns):
        raise ModelFileError(f"{place}: the columns {', '.join(columns)}: give joint, and each one once")
    return columns


def _column(place: str, written: str) -> str:
    """The name of a column, which may have its unit in brackets: ``stiffness [Nm/rad]``."""
    known = {_plain(name): name for name in (*COLUMNS, "joint", "source")}
    if (name := known.get(_plain(written))) is None:
        hint = did_you_mean(written, known.values()) or f": give joint, {', '.join(COLUMNS)} or source"
        raise ModelFileError(f"{place}: the column '{written}' is not known{hint}")
    return name


def _plain(name: str) -> str:
    """A column's name without signs and spaces."""
    return "".join(c for c in name.replace("/", "per").replace("²", "2") if c.isalnum()).casefold()


def _row(place: str, given: dict[str, str]) -> JointStiffness:
    """What a line of a table says."""
    values: dict[str, Any] = {"source": given.pop("source", "")}
    columns: dict[str, str] = {}
    for column, cell in given.items():
        key, factor = COLUMNS[column]
        try:
            value = float(cell)
        except ValueError:
            raise ModelFileError(f"{place}, column {column}: '{cell}' is no number: write it as 31000.5") from None
        if not 0.0 <= value < math.inf:
            raise ModelFileError(f"{place}, column {column}: '{cell}' must be finite and not below zero")
        if key in values:
            raise ModelFileError(f"{place}: has {columns[key]} and {column}: give one of them")
        values[key], columns[key] = factor * value, column
    lateral = [values.pop(key) for key in LATERAL if key in values]
    if len(lateral) == 1:
        one = next(columns[key] for key in LATERAL if key in columns)
        raise ModelFileError(f"{place}: has {one} alone: give both lateral columns")
    if lateral:
        values["lateral_rad_per_Nmm"] = lateral
        columns["lateral_rad_per_Nmm"] = f"{columns[LATERAL[0]]} or {columns[LATERAL[1]]}"
    try:
        return JointStiffness.model_validate(values)
    except pydantic.ValidationError as error:
        key = str(next(iter(error.errors()[0]["loc"]), ""))
        where = f"{place}, column {columns[key]}" if key in columns else place
        raise ModelFileError(
            f"{where}: {one_line(error, values, lambda _: JointStiffness.model_fields)}"
        ) from error


def stiffness_text(machine: Machine) -> str:
    """The file of a machine's drives: own and lateral compliance, and rotors; what import reads back."""
    tables = {}
    for joint in machine.moving:
        if joint.passive or joint.matrix is not None:
            continue
        kind = "slides" if joint.slides else "turns"
        known = {
            COMPLIANCE[kind]: joint.compliance,
            "lateral_rad_per_Nmm": list(joint.lateral) if any(joint.lateral) else None,
            ROTOR[kind]: joint.rotor,
            "law": None if joint.law is None else joint.law.table(slides=joint.slides),
        }
        if table := {key: value for key, value in known.items() if value}:
            tables[joint.name] = table
    return toml_text({"joints": tables})
