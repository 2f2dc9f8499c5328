"""Types of the keys in a model file: names, axes, vectors, matrices, turns."""

from __future__ import annotations

import reprlib
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, StringConstraints, WithJsonSchema

from vjm.io.errors import printed
from vjm.io.sections import LONGEST_MM, Table
from vjm.rotations import AXES, Array, rotation_from_vector

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
