"""The sheet of a test of ``kind = "deflections"``: the robot, where it is loaded, the markers, what is read."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vjm.io.fields import Turns
from vjm.io.schema import Label
from vjm.io.sections import Table
from vjm_updating.experiment.sheet import read_sheet_of
from vjm_updating.experiment.source import SheetSource
from vjm_updating.poses.sheet import (
    MarkerTable,
    Rider,
    RobotSheet,
    RobotTest,
    Sigma,
    check_gravity,
)

PerLoad = Annotated[float, Field(ge=0.0, le=1e3)]


class DeflectionLoadTable(Rider):
    """Where a known wrench acts."""

    axes: Literal["base", "tool"] = Field(
        "base", description="whose axes the columns are in: base's, or the part's"
    )
    turns: Turns = Field([], description="of a force sensor's axes in those of the part; for axes = 'tool'")

    @model_validator(mode="after")
    def _turned(self) -> DeflectionLoadTable:
        if self.turns and self.axes == "base":
            raise ValueError("turns are for axes = 'tool': write that, or leave turns away")
        return self


class DeflectionMarker(MarkerTable):
    """A point or a frame whose displacement is read."""

    sigma_mm: Sigma = Field(5.0, description="how well its place is known")


class DeflectionTracker(Table):
    """What reads the displacements; a standard deviation has a fixed part and one in proportion to the load."""

    noise_mm: Sigma = Field(description="1 sigma of a coordinate of a displacement without load")
    noise_mm_per_N: PerLoad = Field(0.0, description="1 sigma more for each N of force")  # noqa: N815
    noise_mm_per_Nmm: PerLoad = Field(0.0, description="1 sigma more for each N mm of moment")  # noqa: N815
    noise_rad: Sigma = Field(1e-4, description="1 sigma about an axis of a rotation without load")
    noise_rad_per_N: PerLoad = Field(0.0, description="1 sigma more for each N of force")  # noqa: N815
    noise_rad_per_Nmm: PerLoad = Field(0.0, description="1 sigma more for each N mm of moment")  # noqa: N815
    axes: Literal["base", "own"] = Field(
        "base", description="whose axes displacements are in; 'own' ones are found"
    )
    sigma_rad: Sigma = Field(0.01, description="how well axes = 'base' are those of the base")
    source: str = ""


class DeflectionSheet(RobotSheet):
    """The sheet."""

    kind: Literal["deflections"]
    test: RobotTest
    loads: dict[Label, DeflectionLoadTable] = Field(min_length=1)
    markers: dict[Label, DeflectionMarker] = Field(min_length=1)
    tracker: DeflectionTracker

    @model_validator(mode="after")
    def _gravity(self) -> DeflectionSheet:
        check_gravity(self.test.gravity)
        return self


def read_deflection_sheet(sheet: SheetSource) -> DeflectionSheet:
    """A sheet of deflections from its file or its content.

    Raises:
        SheetError: no such file, no TOML, or no sheet of deflections; one line.
    """
    return read_sheet_of(sheet, DeflectionSheet)
