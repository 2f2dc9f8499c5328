"""The tables of a file of bodies and joints, see `vjm.io.body_file`."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from vjm.io.body_joints import BodyJointTable, Pair
from vjm.io.closure_tables import CouplingTable, Poses
from vjm.io.fields import Axis, Label, VectorMM
from vjm.io.joint_tables import Mass, PointSpringTable
from vjm.io.sections import Table


class BodyTable(Table):
    """A rigid body."""

    name: Label
    source: str = ""
    mass_kg: Mass = 0.0
    centre_of_mass_mm: VectorMM | None = Field(None, description="where it is drawn")


class BodyBeamTable(Table):
    """An elastic link; its two ends are fixed to the bodies. What is said of its section a chain file checks."""

    name: Label
    between: Pair
    from_mm: VectorMM
    to_mm: VectorMM
    y_axis: Axis = Field(
        None, description="direction of the section's y; else the world's axis that is most across"
    )
    source: str = ""
    section: dict[str, Any]
    count: int = 1
    segments: int | None = None
    mass_kg: float | None = None
    bow_mm: list[float] | None = None


class SpringTable(PointSpringTable):
    """A spring between points of two bodies, which are given where they are drawn."""


class EndTable(Table):
    """The end-effector's frame."""

    body: Label
    at_mm: VectorMM
    turns: list[dict[str, Any]] = Field([])


class BodyFile(Table):
    """A file of bodies and joints."""

    format: Literal[1]
    kind: Literal["bodies"]
    name: Label
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    units: dict[str, Any]
    springs: dict[str, Any] = Field({})
    bodies: list[BodyTable] = Field(min_length=1)
    joints: list[BodyJointTable] = Field([])
    beams: list[BodyBeamTable] = Field([])
    point_springs: list[SpringTable] = Field([])
    couplings: list[CouplingTable] = Field([])
    end: EndTable
    postures: dict[Label, dict[Label, float]] = Field(
        {}, description="coordinates of held joints; those that are not named stand as drawn"
    )
    poses: Poses = Field({})
