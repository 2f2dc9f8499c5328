"""The sheet of a test of ``kind = "poses"``: the robot, the markers on it, the tracker, how the data were taken."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal

import pydantic
from pydantic import Field, model_validator

from vjm.io.errors import one_line
from vjm.io.fields import Turns, VectorMM
from vjm.io.schema import Label
from vjm.io.sections import Table
from vjm.io.toml_parsing import parse_toml
from vjm_updating.experiment.sheet import SheetError

Sigma = Annotated[float, Field(gt=0.0, le=1e6)]
Three = Annotated[list[float], Field(min_length=3, max_length=3)]


class PoseTest(Table):
    """What was measured, and how."""

    title: str = ""
    model: str = Field(min_length=1, description="a model of the library, a model file, or a URDF")
    tip: str | None = Field(None, description="of a URDF: the last link")
    rigid: bool = Field(False, description="whether the compliances of the model's joints are set aside")
    joints: Literal["commanded", "measured"] = Field(
        "commanded",
        description="what the columns of the joints are: what the controller was told, or what was read",
    )
    encoders: Literal["motor", "output"] | None = Field(
        None, description="of measured joints: behind the motor (the usual), or behind the gear"
    )
    order: Literal["as taken", "unknown"] = "unknown"
    gravity: Three = Field([0.0, 0.0, -9.81], description="m/s², in the axes of the robot's base")
    source: str = ""


class MarkerTable(Table):
    """A marker, a reflector or a frame that the tracker sees, or an inclinometer."""

    on: Label | Literal[""] = Field("", description="part behind which it rides; empty: the last one")
    position_mm: VectorMM = Field([0.0, 0.0, 0.0], description="first guess, in the frame behind that part")
    sigma_mm: Sigma = Field(300.0, description="how well the guess is known")
    orientation: Literal["none", "quaternion", "fixed xyz", "moving xyz", "rotation vector", "tilt"] = Field(
        "none", description="how the columns of its orientation are to be read"
    )
    source: str = ""


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


class PoseSheet(Table):
    """The sheet."""

    kind: Literal["poses"]
    test: PoseTest
    joints: dict[str, str] = Field({}, description="names of columns, where they differ: the model's joints")
    markers: dict[Label, MarkerTable] = Field(min_length=1)
    tracker: TrackerTable
    base: BaseGuess | None = None
    file: str = Field("", exclude=True)
    folder: Path = Field(Path(), exclude=True)

    @property
    def at_output(self) -> bool:
        """Whether the joints were measured behind what bends about their own axes."""
        return self.test.encoders == "output"

    @model_validator(mode="after")
    def _encoders(self) -> PoseSheet:
        if self.test.encoders is not None and self.test.joints == "commanded":
            raise ValueError("[test] encoders is for joints = 'measured': write that, or leave encoders away")
        return self

    @model_validator(mode="after")
    def _gravity(self) -> PoseSheet:
        size = sum(v * v for v in self.test.gravity) ** 0.5
        if size > 100.0:
            raise ValueError(f"[test] gravity has {size:.4g} m/s²: write it in m/s²")
        tilted = next((name for name, table in self.markers.items() if table.orientation == "tilt"), None)
        if size == 0.0 and tilted is not None:
            raise ValueError(f"[markers.{tilted}] orientation = 'tilt' is against gravity, and [test] has none")
        return self


def kind_of_sheet(path: Path) -> str:
    """What ``kind`` a sheet says; empty where it says none or cannot be read, which its reader refuses."""
    try:
        content = parse_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return ""
    kind = content.get("kind", "")
    return kind if isinstance(kind, str) else ""


def read_pose_sheet(path: Path) -> PoseSheet:
    """A sheet from its file.

    Raises:
        SheetError: no such file, no TOML, or no sheet of poses; one line.
    """
    try:
        content = parse_toml(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SheetError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SheetError(f"{path.name}: not UTF-8 text; save it as UTF-8") from error
    except ValueError as error:
        raise SheetError(f"{path.name}: not valid TOML: {error}") from error
    try:
        sheet = PoseSheet.model_validate(content)
    except pydantic.ValidationError as error:
        raise SheetError(f"{path.name}: {one_line(error, content, _known_keys)}") from error
    return sheet.model_copy(update={"file": path.name, "folder": path.parent})


def _known_keys(_: str) -> Iterable[str]:
    tables: tuple[type[Table], ...] = (PoseSheet, PoseTest, MarkerTable, TrackerTable, BaseGuess)
    return [name for table in tables for name in table.model_fields if name not in ("file", "folder")]
