"""The format of a model file, version 1: its tables and keys, and the parts that they make.

A chain frame runs from base to tool; each part begins where the one before it ends. Every key carries its
unit; lengths are mm, forces N, joint coordinates rad. ``source`` is free text and stands wherever numbers do.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterable
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PlainValidator,
    StringConstraints,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from vjm.io import checks
from vjm.io.errors import printed
from vjm.io.sections import (
    LONGEST_MM,
    AnySection,
    LengthMM,
    Rectangle,
    SquareTube,
    StiffnessSection,
    Table,
)
from vjm.model import parts
from vjm.model.chain import FOOT, Chain
from vjm.rotations import AXES, Array, frame, rotation_from_vector

Label = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
"""A name that can stand in a dotted path and in a file name."""


def _unit_vector(raw: object) -> Array:
    if isinstance(raw, str) and raw in AXES:
        return AXES[raw]
    if not isinstance(raw, list) or len(raw) != 3 or not all(type(v) in (int, float) and abs(v) < 1e6 for v in raw):
        raise ValueError(f"must be 'x', 'y', 'z' or a unit vector [x, y, z], got {reprlib.repr(raw)}")
    vector = np.array(raw, dtype=float)
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise ValueError(f"= {raw} gives no direction: write 'x', 'y', 'z' or a unit vector")
    if abs(length - 1.0) > 1e-6:
        unit = ", ".join(f"{v:.7g}" for v in vector / length)
        raise ValueError(f"= {raw} has length {printed(length)}: write the unit vector [{unit}]")
    result: Array = vector / length
    return result


def _six_by_six(raw: object) -> object:
    """Refuse another shape before the entries are looked at; what is no list at all is left to the type."""
    if isinstance(raw, list):
        if len(raw) != 6:
            raise ValueError(f"must be 6×6, got {len(raw)} rows")
        for i, row in enumerate(raw):
            if isinstance(row, list) and len(row) != 6:
                raise ValueError(f"must be 6×6, but row {i + 1} has {len(row)} entries")
    return raw


def _near(vector: list[float]) -> list[float]:
    for value in vector:
        if abs(value) > LONGEST_MM:
            raise ValueError(f"= {vector} goes beyond {printed(LONGEST_MM)} mm: write it in mm")
    return vector


Axis = Annotated[
    Any,
    PlainValidator(_unit_vector),
    WithJsonSchema(
        {
            "anyOf": [
                {"enum": ["x", "y", "z"]},
                {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
            ]
        }
    ),
]
VectorMM = Annotated[list[float], Field(min_length=3, max_length=3), AfterValidator(_near)]
Row = Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=6, max_length=6)]
Matrix6 = Annotated[list[Row], Field(min_length=6, max_length=6), BeforeValidator(_six_by_six)]


class Turn(Table):
    """A turn about an axis of the frame as the turns before it left it."""

    turn_about: Axis
    angle_deg: float = Field(ge=-360.0, le=360.0)


Turns = list[Turn]


def rotation(turns: Turns) -> Array:
    """Rotation ``(3, 3)`` of turns one after another, each about the axes that the one before it left."""
    R = np.eye(3)
    for turn in turns:
        R = R @ rotation_from_vector(turn.turn_about * np.deg2rad(turn.angle_deg))
    return R


class Offset(Table):
    """A rigid piece: shifted first, then turned."""

    kind: Literal["offset"]
    name: Label
    source: str = ""
    translation_mm: VectorMM = Field([0.0, 0.0, 0.0])
    turns: Turns = Field([])

    def part(self) -> parts.RigidOffset:
        """The part that the table describes."""
        return parts.RigidOffset(self.name, frame(rotation(self.turns), self.translation_mm))


class ActuatorTable(Table):
    """A drive, held at its coordinate."""

    kind: Literal["actuator"]
    name: Label
    source: str = ""
    axis: Axis
    compliance_mm_per_N: float = Field(0.0, ge=0.0, le=1e3)  # noqa: N815

    def part(self) -> parts.Actuator:
        """The part that the table describes."""
        return parts.Actuator(self.name, self.axis, self.compliance_mm_per_N)


class MountTable(Table):
    """What carries the chain and gives way along one axis: a frame, a guide."""

    kind: Literal["mount"]
    name: Label
    source: str = ""
    axis: Axis
    compliance_mm_per_N: float = Field(ge=0.0, le=1e3)  # noqa: N815

    def part(self) -> parts.Mount:
        """The part that the table describes."""
        return parts.Mount(self.name, self.axis, self.compliance_mm_per_N)


class JointTable(Table):
    """A perfect passive revolute joint."""

    kind: Literal["joint"]
    name: Label
    source: str = ""
    axis: Axis
    limits_rad: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None

    @field_validator("limits_rad")
    @classmethod
    def _ordered(cls, limits: list[float] | None) -> list[float] | None:
        if limits is not None and limits[0] >= limits[1]:
            raise ValueError(f"= {limits} must be [lower, upper]")
        return limits

    def part(self) -> parts.PassiveJoint:
        """The part that the table describes."""
        return parts.PassiveJoint(self.name, self.axis)


class BeamTable(Table):
    """An elastic part: a section, a compliance matrix, or both.

    The matrix is that of one member at the tip, in the own axes, rows and columns x, y, z, φx, φy, φz.
    """

    kind: Literal["beam"]
    name: Label
    source: str = ""
    length_mm: LengthMM
    own_axes: Turns = Field([], description="from the chain frame to the part's own axes")
    section_axes: Turns = Field([], description="from the own axes to the section's, x along the beam")
    end_offset_mm: VectorMM = Field([0.0, 0.0, 0.0], description="from the beam's end to the tip, own axes")
    count: int = Field(1, ge=1, le=1000, description="equal members that share every load")
    section: AnySection | None = None
    compliance: Matrix6 | None = Field(None, description="mm/N, 1/N, rad/(N mm)")
    compliance_source: str = ""
    bow_mm: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        [0.0, 0.0], description="mid-span, along the section's y and z, of the half sine wave that it is unloaded"
    )
    mass_kg: float | None = Field(None, ge=0.0, le=1e4, description="of all members, in place of a density")

    @field_validator("compliance")
    @classmethod
    def _compliance(cls, rows: list[list[float]] | None) -> list[list[float]] | None:
        return None if rows is None else checks.checked_compliance(np.array(rows, dtype=float)).tolist()

    @model_validator(mode="after")
    def _sane(self) -> BeamTable:
        if self.section is None and self.compliance is None:
            raise ValueError("needs a [parts.section], a compliance, or both")
        beam = self.part()
        if beam.section is not None:
            checks.check_section_units(beam.section, self.length_mm)
        if beam.compliance is not None:
            checks.check_compliance_units(beam)
        if beam.section is not None and beam.compliance is not None:
            checks.check_against_section(beam)
        self._check_extras()
        return self

    def _check_extras(self) -> None:
        for key, given in (("bow_mm", any(self.bow_mm)), ("mass_kg", self.mass_kg is not None)):
            if given and self.section is None:
                raise ValueError(f"has {key} but no [parts.section]: it is spread along a section")
        if math.hypot(*self.bow_mm) > 0.2 * self.length_mm:
            raise ValueError(
                f"has bow_mm = {self.bow_mm}, above a fifth of length_mm = {printed(self.length_mm)}: give mm"
            )
        if self.mass_kg is not None and getattr(self.section, "density_kg_per_m3", None) is not None:
            raise ValueError("has mass_kg and density_kg_per_m3, two masses: give one")

    def part(self) -> parts.Beam:
        """The part that the table describes."""
        section = None if self.section is None else self.section.stiffness()
        if section is not None and self.mass_kg is not None:
            section = replace(section, mass=self.mass_kg / self.length_mm / self.count)
        return parts.Beam(
            self.name,
            self.length_mm,
            own_frame=rotation(self.own_axes),
            section_frame=rotation(self.section_axes),
            end_offset=np.array(self.end_offset_mm, dtype=float),
            section=section,
            compliance=None if self.compliance is None else np.array(self.compliance, dtype=float),
            count=self.count,
            bow=(self.bow_mm[0], self.bow_mm[1]),
        )


class Units(Table):
    """The units of the file, said out loud; there is no choice."""

    length: Literal["mm"]
    force: Literal["N"]
    angle: Literal["rad"]


class Springs(Table):
    """How many springs the machine is to be computed with, unless a command says so itself."""

    link_segments: int | None = Field(
        None, ge=1, le=1000, description="every beam but the foot; 1: one spring at the far end, the paper's"
    )
    foot_segments: int | None = Field(None, ge=1, le=1000)


class Base(Table):
    """Where the first part begins in the world: shifted first, then turned."""

    position_mm: VectorMM = Field([0.0, 0.0, 0.0])
    turns: Turns = Field([])


AnyPart = Annotated[Offset | ActuatorTable | MountTable | BeamTable | JointTable, Field(discriminator="kind")]


class ModelFile(Table):
    """A model file: a chain from base to tool, and its postures."""

    format: Literal[1]
    name: Label
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    units: Units
    base: Base = Base()
    springs: Springs = Springs()
    parts: list[AnyPart] = Field(min_length=1)
    postures: dict[Label, list[float]] = Field(
        min_length=1, description="passive joint coordinates in rad, base to tool"
    )

    @model_validator(mode="after")
    def _chain(self) -> ModelFile:
        names = [part.name for part in self.parts]
        for name in names:
            if names.count(name) > 1:
                places = " and ".join(str(i + 1) for i, other in enumerate(names) if other == name)
                raise ValueError(f"part name '{name}' stands twice, as parts {places}: rename one")
        if not any(isinstance(part, BeamTable) for part in self.parts):
            raise ValueError("no part has kind = 'beam': a chain needs at least one, or nothing gives way")
        for part in self.parts:
            one = self.springs.foot_segments if part.name == FOOT else self.springs.link_segments
            if isinstance(part, BeamTable) and any(part.bow_mm) and one == 1:
                raise ValueError(
                    f"part '{part.name}' has a bow, and [springs] one spring, which has no shape: give 2"
                )
        joints = [part for part in self.parts if isinstance(part, JointTable)]
        for label, q in self.postures.items():
            _check_coordinates(label, q, joints)
        return self

    def chain(self, sha256: str = "") -> Chain:
        """The chain that the file describes.

        Raises:
            ValueError: a posture leaves the passive joints dependent.
        """
        chain = Chain(
            name=self.name,
            parts=tuple(part.part() for part in self.parts),
            base=frame(rotation(self.base.turns), self.base.position_mm),
            postures={label: np.array(q, dtype=float) for label, q in self.postures.items()},
            title=self.title,
            source=self.source,
            sha256=sha256,
            link_segments=self.springs.link_segments,
            foot_segments=self.springs.foot_segments,
        )
        checks.check_postures(chain)
        return chain


def _check_coordinates(label: str, q: list[float], joints: list[JointTable]) -> None:
    where = f"posture '{label}':"
    if len(q) != len(joints):
        named = f" ({', '.join(joint.name for joint in joints)})" if joints else ""
        raise ValueError(f"{where} {len(q)} coordinates for {len(joints)} passive joints{named}: give one each")
    for joint, value in zip(joints, q, strict=True):
        if abs(value) > np.pi:
            raise ValueError(f"{where} {joint.name} = {printed(value)} rad is beyond ±π: is it in degrees?")
        if joint.limits_rad is not None:
            low, high = joint.limits_rad
            if value < low:
                raise ValueError(
                    f"{where} out of reach: {joint.name} = {printed(value)} is below its limit {printed(low)}"
                )
            if value > high:
                raise ValueError(
                    f"{where} out of reach: {joint.name} = {printed(value)} exceeds its limit {printed(high)}"
                )


_TABLES: dict[str, type[Table]] = {
    "": ModelFile,
    "units": Units,
    "base": Base,
    "turn": Turn,
    "offset": Offset,
    "springs": Springs,
    "actuator": ActuatorTable,
    "mount": MountTable,
    "beam": BeamTable,
    "joint": JointTable,
    "stiffness": StiffnessSection,
    "rectangle": Rectangle,
    "square_tube": SquareTube,
}


def known_keys(table: str) -> Iterable[str]:
    """The keys that a table may have, by its tag, see `vjm.io.errors.one_line`."""
    return list(_TABLES[table].model_fields)
