"""Types of the keys in a model file.

They are tables, names, axes, vectors, matrices, turns; lengths and densities that a part can have, and sections
known by their stiffness.
"""

from __future__ import annotations

import math
import reprlib
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    StringConstraints,
    WithJsonSchema,
)

from vjm.io.errors import printed
from vjm.model import parts
from vjm.rotations import AXES, Array, rotation_from_vector

SHORTEST_MM, LONGEST_MM = 0.1, 1e5
"""Lengths outside are taken for another unit: a link of 0.1 mm or of 100 m is no robot's."""


def _plausible_length(length: float) -> float:
    if length <= 0.0:
        raise ValueError(f"must be above 0, got {printed(length)}")
    if length < SHORTEST_MM:
        raise ValueError(f"= {printed(length)} is below {SHORTEST_MM} mm: is it in metres? Write it in mm")
    if length > LONGEST_MM:
        raise ValueError(f"= {printed(length)} is above {printed(LONGEST_MM)} mm: is it in µm? Write it in mm")
    return length


def _plausible_density(density: float) -> float:
    # foam to osmium
    if not 10.0 <= density <= 25000.0:
        raise ValueError(
            f"= {printed(density)} is outside 10 to 25000 kg/m³: is it in g/cm³? Write it in kg/m³ (steel 7850)"
        )
    return density


Density = Annotated[float, AfterValidator(_plausible_density)]
"""kg/m³."""


LengthMM = Annotated[float, AfterValidator(_plausible_length), Field(description="mm, 0.1 to 1e5")]
"""A length in mm that a robot's part can have."""

Stiffness = Annotated[float, Field(ge=1e-3, le=1e18)]
"""N or N mm²: from a thread to a block of steel of one metre."""


class Table(BaseModel):
    """A TOML table: no unknown keys, no silent conversion, no nan or inf.

    What checks it is built at its first use: a file has few of the tables that there are.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, defer_build=True)


def tags_of(table: type[Table], key: str) -> tuple[str, ...]:
    """What tells a kind of table by the value of a key from the others."""
    return get_args(table.model_fields[key].annotation)


class StiffnessSection(Table):
    """A section known by its stiffness; shear is neglected where no GA is given."""

    source: str = ""
    EA_N: Stiffness = Field(description="axial")
    GJ_Nmm2: Stiffness = Field(description="torsion")
    EIy_Nmm2: Stiffness = Field(description="bending about y, deflecting along z")
    EIz_Nmm2: Stiffness = Field(description="bending about z, deflecting along y")
    GAy_N: Stiffness | None = Field(None, description="shear for deflection along y")
    GAz_N: Stiffness | None = Field(None, description="shear for deflection along z")

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²."""
        return parts.Section(
            EA=self.EA_N,
            GJ=self.GJ_Nmm2,
            EIy=self.EIy_Nmm2,
            EIz=self.EIz_Nmm2,
            GAy=math.inf if self.GAy_N is None else self.GAy_N,
            GAz=math.inf if self.GAz_N is None else self.GAz_N,
        )


Label = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
"""A name that can stand in a dotted path and in a file name."""
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]
"""Of a machine; some begin with the number of their legs."""
PartName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_-]*(/[A-Za-z][A-Za-z0-9_-]*)*$")]
"""Of a part; that of a leg is ``leg/part``."""


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
    return vector / length


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
