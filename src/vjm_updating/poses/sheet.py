"""Sheets of tests of a robot in many postures: what all kinds have, and ``kind = "poses"``.

A sheet of poses has the robot, the markers on it, the tracker, and how the data were taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from vjm.io.fields import Turns, VectorMM
from vjm.io.schema import Label
from vjm.io.sections import Table
from vjm_updating.experiment.sheet import AnySheet, read_sheet_of
from vjm_updating.experiment.source import SheetSource

Sigma = Annotated[float, Field(gt=0.0, le=1e6)]
Three = Annotated[list[float], Field(min_length=3, max_length=3)]


class RobotTest(Table):
    """What was measured, on which model."""

    title: str = ""
    model: str = Field(min_length=1, description="a model of the library, a model file, or a URDF")
    tip: str | None = Field(None, description="of a URDF: the last link")
    rigid: bool = Field(False, description="whether the compliances of the model's joints are set aside")
    gravity: Three = Field([0.0, 0.0, -9.81], description="m/s², in the axes of the robot's base")
    order: Literal["as taken", "unknown"] = Field("unknown", description="in which the rows stand")
    source: str = ""


class PoseTest(RobotTest):
    """What was measured, and how."""

    joints: Literal["commanded", "measured"] = Field(
        "commanded",
        description="what the columns of the joints are: what the controller was told, or what was read",
    )
    encoders: Literal["motor", "output"] | None = Field(
        None, description="of measured joints: behind the motor (the usual), or behind the gear"
    )


class Rider(Table):
    """A point that rides behind a part."""

    on: Label | Literal[""] = Field("", description="part behind which it rides; empty: the last one")
    position_mm: VectorMM = Field([0.0, 0.0, 0.0], description="in the frame behind that part")
    source: str = ""


class MarkerTable(Rider):
    """A marker that the tracker sees; its place is a first guess."""

    sigma_mm: Sigma = Field(300.0, description="how well the guess is known")


class PoseMarker(MarkerTable):
    """A marker, a reflector or a frame that the tracker sees, or an inclinometer."""

    orientation: Literal["none", "quaternion", "fixed xyz", "moving xyz", "rotation vector", "tilt"] = Field(
        "none", description="how the columns of its orientation are to be read"
    )


class TrackerTable(Table):
    """What sees the markers. Its frame is found with the rest: only its errors need be known."""

    noise_mm: Sigma = Field(description="1 sigma of a coordinate of a position, where the reading has none")
    noise_rad: Sigma = Field(1e-3, description="1 sigma about an axis of an orientation, or of a tilt")
    source: str = ""


class BaseGuess(Table):
    """First guess of the base in the tracker's frame, where fewer than three postures tell."""

    position_mm: VectorMM = Field([0.0, 0.0, 0.0])
    turns: Turns = Field([])
    sigma_mm: Sigma = 1e5
    sigma_rad: Sigma = 10.0


class RobotSheet(AnySheet):
    """What the sheets of all kinds of test have."""

    test: RobotTest
    markers: Mapping[Label, MarkerTable]
    joints: dict[str, str] = Field({}, description="names of columns, where they differ: the model's joints")

    @property
    def at_output(self) -> bool:
        """Whether the joints were measured behind what bends about their own axes."""
        return False

    @property
    def ordered(self) -> bool:
        """Whether the rows stand in the order in which they were taken."""
        return self.test.order == "as taken"

    @property
    def meaning(self) -> str:
        """What the joints' columns are, for people."""
        return "commanded"

    @property
    def bends(self) -> str:
        """What lies between the joints' columns and the links, and so bends about the joints' axes."""
        return "gears, drives, and what the controllers leave of their error under load"


class PoseSheet(RobotSheet):
    """The sheet of a test of poses."""

    kind: Literal["poses"]
    test: PoseTest
    markers: dict[Label, PoseMarker] = Field(min_length=1)
    tracker: TrackerTable
    base: BaseGuess | None = None

    @property
    def at_output(self) -> bool:
        """Whether the joints were measured behind what bends about their own axes."""
        return self.test.encoders == "output"

    @property
    def meaning(self) -> str:
        """What the joints' columns are, for people."""
        if self.test.joints == "commanded":
            return "commanded"
        return "measured at the output" if self.at_output else "measured at the motor"

    @property
    def bends(self) -> str:
        """What lies between the joints' columns and the links, and so bends about the joints' axes."""
        if self.test.joints == "commanded":
            return super().bends
        return "gears, and all else between the encoders at the motors and the links"

    @model_validator(mode="after")
    def _encoders(self) -> PoseSheet:
        if self.test.encoders is not None and self.test.joints == "commanded":
            raise ValueError("[test] encoders is for joints = 'measured': write that, or leave encoders away")
        return self

    @model_validator(mode="after")
    def _gravity(self) -> PoseSheet:
        check_gravity(self.test.gravity)
        tilted = next((name for name, table in self.markers.items() if table.orientation == "tilt"), None)
        if not any(self.test.gravity) and tilted is not None:
            raise ValueError(f"[markers.{tilted}] orientation = 'tilt' is against gravity, and [test] has none")
        return self


def check_gravity(gravity: Sequence[float]) -> None:
    """Refuse a gravity that is in mm/s² or the like.

    Raises:
        ValueError: it is.
    """
    size = sum(v * v for v in gravity) ** 0.5
    if size > 100.0:
        raise ValueError(f"[test] gravity has {size:.4g} m/s²: write it in m/s²")


def read_pose_sheet(sheet: SheetSource) -> PoseSheet:
    """A sheet of poses from its file or its content.

    Raises:
        SheetError: no such file, no TOML, or no sheet of poses; one line.
    """
    return read_sheet_of(sheet, PoseSheet)
