"""Tables of a model file: frames held together, coupled passive joints, poses, the workspace, and a calibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from vjm.io.fields import Label, PartName, Turns, VectorMM, rotation
from vjm.io.sections import Table
from vjm.model.closures import Closure, Coupling
from vjm.model.joint_limits import LARGEST_TURN
from vjm.rotations import Array, frame

Poses: TypeAlias = dict[Label, Annotated[list[float], Field(min_length=3, max_length=6)]]
"""Displacements by label: x, y, z in mm, and perhaps turns in rad."""


class FrameTable(Table):
    """A frame: shifted first, then turned."""

    position_mm: VectorMM = Field([0.0, 0.0, 0.0])
    turns: Turns = Field([])


class ClosureTable(Table):
    """Two frames of a machine that are held together, which closes a loop."""

    name: PartName
    source: str = ""
    between: Annotated[list[str], Field(min_length=2, max_length=2, description="two parts; '' is the base")]
    frames: Annotated[list[FrameTable], Field(min_length=2, max_length=2)] = Field(
        [FrameTable(), FrameTable()], description="from behind each part's end; from the world for the base"
    )
    holds: Literal["weld", "ball"] = Field("weld", description="all six components, or the place alone")

    def closure(self) -> Closure:
        """The closure that the table describes."""
        frames = np.array([frame(rotation(one.turns), one.position_mm) for one in self.frames])
        return Closure(self.name, (self.between[0], self.between[1]), frames, turns=self.holds == "ball")


class TermTable(Table):
    """A joint's share in a coupling."""

    joint: PartName
    weight: float


class CouplingTable(Table):
    """A rigid transmission between passive joints: their weighted sum stays."""

    name: PartName
    source: str = ""
    terms: list[TermTable] = Field(min_length=2)
    total: float | None = Field(None, description="of the weighted coordinates, rad or mm; else that at home")

    def coupling(self, postures: Mapping[str, Mapping[str, float]]) -> Coupling:
        """The coupling that the table describes.

        Args:
            postures: coordinates by joint and label, home first.
        """
        total, home = self.total, next(iter(postures.values()))
        if total is None:
            total = sum(term.weight * home.get(term.joint, 0.0) for term in self.terms)
        return Coupling(self.name, tuple((term.joint, term.weight) for term in self.terms), total)


class Workspace(Table):
    """A box of places of the end-effector: from home where the file gives poses, else in the world."""

    source: str = ""
    min_mm: VectorMM
    max_mm: VectorMM

    @property
    def corners(self) -> Array:
        """Corners ``(2, 3)``, mm."""
        return np.array([self.min_mm, self.max_mm])

    @model_validator(mode="after")
    def _ordered(self) -> Workspace:
        for axis, low, high in zip("xyz", self.min_mm, self.max_mm, strict=True):
            if low > high:
                raise ValueError(f"min_mm = {low:g} along {axis} is above max_mm = {high:g}: are they swapped?")
        return self


class CalibratedTable(Table):
    """What a calibration says of the file that it wrote."""

    not_for_use: list[str] = Field([], description="why it was written by force alone")
    valid_within: dict[PartName, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        {},
        description="ranges of joints, rad or mm, beyond which nothing tells how good it is",
    )

    @model_validator(mode="after")
    def _ordered(self) -> CalibratedTable:
        for joint, (low, high) in self.valid_within.items():
            if low > high:
                raise ValueError(
                    f"valid_within of '{joint}' begins at {low:g}, above its end {high:g}: are they swapped?"
                )
        return self


def displacement(label: str, numbers: list[float]) -> Array:
    """The displacement ``(6,)`` of a pose, mm and rad.

    Raises:
        ValueError: it has neither three nor six numbers, or a turn is likely in degrees.
    """
    if len(numbers) not in (3, 6):
        raise ValueError(f"pose '{label}' must have 3 entries (mm) or 6 (mm, rad), got {len(numbers)}")
    far = next((turn for turn in numbers[3:] if abs(turn) > LARGEST_TURN), None)
    if far is not None:
        raise ValueError(f"pose '{label}': a turn of {far:g} rad is beyond ±2π: is it in degrees?")
    return np.array(numbers + [0.0] * (6 - len(numbers)), dtype=float)
