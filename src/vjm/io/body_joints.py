"""Kinds of joints between bodies: each kind is one class, which says all that a file of bodies asks of it.

A joint between two bodies is a row of elementary joints at one place, each about or along one axis. A new kind is
a class here, written into `JOINT_KINDS`. The reader of the file, its messages, its schema and the choice of where
loops are cut ask nothing else. Everything behind the reader sees elementary joints, and rows of couplings.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, WithJsonSchema

from vjm.io.errors import did_you_mean
from vjm.io.fields import Axis, Label, VectorMM
from vjm.io.sections import Table
from vjm.rotations import Array

Content = dict[str, Any]
Pair = Annotated[list[Label], Field(min_length=2, max_length=2)]


class Motion(NamedTuple):
    """One elementary joint of a joint between bodies.

    Attributes:
        suffix: of its name behind that of the joint; empty where it has the joint's own name.
        axis: unit vector ``(3,)``, world axes as drawn.
        slides: along the axis; else it turns about it.
    """

    suffix: str
    axis: Array
    slides: bool = False


class BodyJointKind(ABC):
    """A kind of joint between bodies, passive unless a subclass says otherwise.

    Attributes:
        name: as the file's ``kind``.
        says: what it is, for the page on model files.
        keys: that it needs beside ``name``, ``between`` and ``at_mm``; it takes no others of `OWN_KEYS`.
        part: kind of the parts of a chain file that it becomes.
        given: whether a posture gives its coordinates.
        place_only: whether all that it holds is the place of a point: a loop is cut there without any joint.

    Example:
        >>> sorted(JOINT_KINDS)
        ['actuated', 'ball', 'coupled', 'cylindrical', 'joint', 'planar', 'screw', 'universal', 'weld']
        >>> [motion.suffix for motion in JOINT_KINDS["ball"].motions(None)]
        ['-x', '-y', '-z']
    """

    name: ClassVar[str]
    says: ClassVar[str]
    keys: ClassVar[tuple[str, ...]] = ("axis",)
    part: ClassVar[str] = "joint"
    given: ClassVar[bool] = True
    place_only: ClassVar[bool] = False

    @abstractmethod
    def motions(self, table: BodyJointTable) -> list[Motion]:
        """Its elementary joints, from the first body to the second."""

    def couplings(self, table: BodyJointTable) -> list[Content]:
        """Rows of couplings between its elementary joints, as a chain file has them."""
        return []


class _Single(BodyJointKind):
    """One elementary joint, which the keys of the part describe."""

    def motions(self, table: BodyJointTable) -> list[Motion]:
        """See `BodyJointKind`."""
        return [Motion("", table.axis, (table.model_extra or {}).get("motion") == "slides")]


class Actuated(_Single):
    """Driven to the coordinate that a posture gives."""

    name, part = "actuated", "actuated"
    says = "driven"


class Coupled(_Single):
    """Its coordinate follows from those of others."""

    name, part, given = "coupled", "coupled", False
    says = "follows others by its ratios `to`"


class Weld(BodyJointKind):
    """No motion at all."""

    name, keys, given = "weld", (), False
    says = "holds all"

    def motions(self, table: BodyJointTable) -> list[Motion]:
        """See `BodyJointKind`."""
        return []


class Passive(_Single):
    """A hinge or a slide."""

    name = "joint"
    says = "passive, the default"


class Screw(BodyJointKind):
    """A nut on a screw: it turns about an axis and moves ``pitch_mm`` along it in one turn."""

    name, keys = "screw", ("axis", "pitch_mm")
    says = "passive: turns about `axis` and moves along it by `pitch_mm` in a turn (left-hand: negative)"

    def motions(self, table: BodyJointTable) -> list[Motion]:
        """See `BodyJointKind`."""
        return [Motion("-slide", table.axis, slides=True), Motion("-turn", table.axis)]

    def couplings(self, table: BodyJointTable) -> list[Content]:
        """See `BodyJointKind`."""
        lead = (table.pitch_mm or 0.0) / (2.0 * np.pi)
        terms = [{"joint": f"{table.name}-slide", "weight": 1.0}, {"joint": f"{table.name}-turn", "weight": -lead}]
        return [{"name": f"{table.name}-thread", "terms": terms}]


class Cylindrical(BodyJointKind):
    """A round guide: it turns about an axis and slides along it."""

    name = "cylindrical"
    says = "passive: turns about `axis` and slides along it"

    def motions(self, table: BodyJointTable) -> list[Motion]:
        """See `BodyJointKind`."""
        return [Motion("-slide", table.axis, slides=True), Motion("-turn", table.axis)]


class Universal(BodyJointKind):
    """Two crossed hinges."""

    name, keys = "universal", ("axes",)
    says = "passive: two hinges about the two `axes`"

    def motions(self, table: BodyJointTable) -> list[Motion]:
        """See `BodyJointKind`."""
        return [Motion(f"-{i}", axis) for i, axis in enumerate(table.axes or [], 1)]


class Planar(BodyJointKind):
    """A plate on a plane: it slides in the plane across an axis, and turns about the axis."""

    name = "planar"
    says = "passive: slides in the plane across `axis`, and turns about it"

    def motions(self, table: BodyJointTable) -> list[Motion]:
        """See `BodyJointKind`."""
        axis = table.axis
        first = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
        first /= np.linalg.norm(first)
        return [Motion("-1", first, True), Motion("-2", np.cross(axis, first), True), Motion("-turn", axis)]


class Ball(BodyJointKind):
    """Three hinges through one point, about the axes of the world as drawn."""

    name, keys, place_only = "ball", (), True
    says = "passive: three hinges through one point"

    def motions(self, table: BodyJointTable) -> list[Motion]:
        """See `BodyJointKind`."""
        return [Motion(f"-{name}", axis) for name, axis in zip("xyz", np.eye(3), strict=True)]


JOINT_KINDS: Mapping[str, BodyJointKind] = {
    kind.name: kind
    for kind in (
        Actuated(), Coupled(), Weld(), Passive(), Screw(), Cylindrical(), Universal(), Planar(), Ball(),
    )
}  # fmt: skip
"""By name. Loops are cut at a joint of the last kind, where a closure has the least to hold."""
OWN_KEYS = ("axis", "axes", "pitch_mm")
"""Keys of a joint's table that some kinds need and others do not take."""


def _known_kind(kind: str) -> str:
    if kind not in JOINT_KINDS:
        raise ValueError(f"is '{kind}', which is no kind of joint{did_you_mean(kind, JOINT_KINDS)}")
    return kind


class BodyJointTable(Table):
    """A joint; its coordinate is that of the second body against the first.

    All keys that are not here are those of the part of a chain file, which checks them.
    """

    model_config = ConfigDict(extra="allow")

    name: Label
    between: Pair
    kind: Annotated[str, AfterValidator(_known_kind), WithJsonSchema({"enum": list(JOINT_KINDS)})] = "joint"
    at_mm: VectorMM
    axis: Axis = None
    axes: Annotated[list[Axis], Field(min_length=2, max_length=2)] | None = Field(
        None, description="of a universal joint: that of the first body, then that of the second"
    )
    pitch_mm: float | None = Field(
        None, description="of a screw: way along its axis in one turn; negative for a left-hand thread"
    )
    drawn: float = Field(0.0, description="coordinate where it is drawn, rad or mm")


def coordinates(table: BodyJointTable) -> list[str]:
    """Names of the coordinates that a posture gives of a joint."""
    kind = JOINT_KINDS[table.kind]
    return [table.name + motion.suffix for motion in kind.motions(table)] if kind.given else []


def check_keys(table: BodyJointTable) -> None:
    """Refuse keys that a kind does not take, or has not got.

    Raises:
        ValueError: naming the key, and what to do.
    """
    kind = JOINT_KINDS[table.kind]
    for key in OWN_KEYS:
        given = getattr(table, key) is not None
        if given != (key in kind.keys):
            what = f"takes no {key}: leave it out" if given else f"needs {key}"
            raise ValueError(f"joint '{table.name}': a joint of kind '{table.kind}' {what}")
    several = len(kind.motions(table)) != 1
    if several and table.drawn:
        raise ValueError(
            f"joint '{table.name}': a joint of kind '{table.kind}' takes no drawn: it is drawn at zero"
        )


def joint_parts(table: BodyJointTable, sign: int) -> list[Content]:
    """The parts of a joint, in the order from one body to the other.

    Args:
        table: the joint.
        sign: 1 from the first body to the second, −1 the other way.
    """
    kind, own = JOINT_KINDS[table.kind], dict(table.model_extra or {})
    return [
        own
        | {"kind": kind.part, "name": table.name + motion.suffix, "axis": (sign * motion.axis).tolist()}
        | ({"motion": "slides"} if motion.slides else {})
        for motion in kind.motions(table)[::sign]
    ]
