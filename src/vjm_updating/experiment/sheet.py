"""The test sheet: what was tested, how, with which instruments and which tolerances."""

from __future__ import annotations

import re
import reprlib
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

import pydantic
from pydantic import Field, field_validator, model_validator

from vjm.io.errors import did_you_mean, one_line
from vjm.io.fields import PartName, Table
from vjm.io.joint_tables import Poses
from vjm.io.schema import Label, Posture
from vjm_updating.experiment.data_file import (
    EFFORT,
    MOTION,
    POSE,
    TEMPERATURE,
    WRENCH,
    SheetError,
    SheetSource,
    Source,
    source_of_sheet,
    split_point,
    toml_of,
)

Sigma = Annotated[float, Field(ge=0.0, le=1e9)]
S = TypeVar("S", bound="AnySheet")


class Test(Table):
    """What was tested, and which end the operator controlled."""

    __test__ = False  # no test case, whatever pytest thinks of the name

    title: str = ""
    model: str = Field(min_length=1)
    joint: str = Field("", description='the joint, of a sheet of kind = "joint"')
    control: str = "displacement"
    held: list[Literal["x", "y", "z", "rx", "ry", "rz"]] = Field(
        [], description="components of the end-effector that something holds, under force control"
    )
    gravity: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None
    source: str = ""

    @property
    def by_force(self) -> bool:
        """Whether loads were imposed: an absent load is then zero, and what is neither read nor held is free."""
        return self.control == "force" or self.control in WRENCH

    @model_validator(mode="after")
    def _held(self) -> Test:
        if self.held and not self.by_force:
            raise ValueError(
                f"held is for control = \"force\": under control = '{self.control}' an absent displacement is held"
            )
        if twice := [name for name in self.held if self.held.count(name) > 1]:
            raise ValueError(f"held names '{twice[0]}' twice: leave one")
        return self

    @field_validator("control")
    @classmethod
    def _known(cls, control: str) -> str:
        if control not in ("displacement", "force") and split_point(control)[1] not in (*POSE, *WRENCH):
            raise ValueError(f"must be displacement, force or the name of a column, got '{control}'")
        return control


class Instrument(Table):
    """One channel's errors, 1-sigma: of one reading, of a constant zero error, of the scale factor.

    A reading is ``(1 + scale) · true + zero + noise``. That of ``temperature_C`` is the thermometer: its noise is
    smoothed away; a constant zero error changes nothing, for drifts count from the first reading.
    """

    noise: Sigma
    zero: Sigma = 0.0
    scale: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    held: Literal["target"] | None = Field(
        None, description="the rows carry the mark at which the operator stopped"
    )
    source: str = ""


class PointTable(Table):
    """A point of the chain other than the end-effector that carries a gauge."""

    body: PartName
    at: float = Field(1.0, ge=0.0, le=1.0)
    source: str = ""


class LeverTable(Table):
    """Where a test of one joint loads it and reads it, from the joint's axis; of no meaning for one that slides."""

    force_mm: float | None = Field(None, gt=0.0, le=1e6, description="arm of force_N")
    gauge_mm: float | None = Field(None, gt=0.0, le=1e6, description="arm of deflection_mm")
    source: str = ""


class Tolerance(Table):
    """What the manufacturer promises of the machine, 1-sigma."""

    link_length_mm: Sigma = 0.0
    modulus_rel: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    mass_rel: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        0.0, description='of each part\'s mass; of a sheet of kind = "frequencies"'
    )
    source: str = ""


class AnySheet(Table):
    """A sheet of any kind of test: where it is from."""

    file: str = Field("", exclude=True)
    folder: Path = Field(Path(), exclude=True)


KINDS_OF_SHEETS = ("joint", "poses", "deflections", "frequencies")
"""What ``kind`` may be; a sheet of ramps or of a column has none."""


class Sheet(AnySheet):
    """A test sheet."""

    kind: Literal["", "joint", "frequencies"] = Field(
        "", description="joint: torque against angle of one joint; frequencies: natural frequencies by tapping"
    )
    test: Test
    model: dict[str, Any] = Field({}, description="overrides of the model file's values")
    postures: dict[Label, Posture] = Field(
        {}, description="coordinates of the joints, mm or rad: a row, or by the joints' names, as in model files"
    )
    poses: Poses = Field({}, description="of a machine with closed loops: the end-effector from home, mm and rad")
    points: dict[Label, PointTable] = Field({})
    instrument: dict[str, Instrument] = Field({})
    lever: LeverTable = LeverTable()
    tolerance: Tolerance = Tolerance()

    @model_validator(mode="after")
    def _of_kind(self) -> Sheet:
        if self.tolerance.mass_rel and self.kind != "frequencies":
            raise ValueError('[tolerance] mass_rel goes with kind = "frequencies": leave it out')
        return self

    @model_validator(mode="after")
    def _instruments(self) -> Sheet:
        if (self.kind == "joint") != bool(self.test.joint):
            raise ValueError('kind = "joint" and [test] joint = "NAME" go together: give both or none')
        for name in self.instrument:
            if self.kind == "joint":
                if name not in (*MOTION, *EFFORT, TEMPERATURE):
                    known = ", ".join((*MOTION, *EFFORT, TEMPERATURE))
                    raise ValueError(
                        f"[instrument.{name}] is no channel of a test of one joint: write one of {known}"
                    )
                continue
            point, channel = split_point(name)
            if channel not in POSE and (point or channel not in (*WRENCH, TEMPERATURE)):
                known = ", ".join((*POSE, *WRENCH, TEMPERATURE))
                raise ValueError(
                    f'[instrument."{name}"] is no channel: write one of {known}, '
                    "in quotes behind a point's name where it has one"
                )
            if point and point not in self.points:
                raise ValueError(f"[instrument.\"{name}\"]: no point '{point}': add [points.{point}]")
        return self

    def errors(self, channel: str) -> Instrument:
        """A channel's errors; none where the sheet says nothing."""
        return self.instrument.get(channel, Instrument(noise=0.0))

    def sigma(self, channel: str) -> Instrument:
        """What is known of a channel's errors, which must be known.

        Raises:
            SheetError: nothing is.
        """
        if channel not in self.instrument:
            key = f'"{channel}"' if "." in channel else channel
            raise SheetError(f"{self.file}: channel {channel} was measured: add [instrument.{key}] with its noise")
        return self.instrument[channel]


def read_sheet(sheet: SheetSource) -> Sheet:
    """A sheet of displacements and loads from its file or its content.

    Raises:
        SheetError: no such file, no TOML, or no such sheet; one line.
    """
    source = source_of_sheet(sheet)
    kind = kind_of_sheet(source)
    if kind not in ("", "joint"):
        others = "" if kind == "frequencies" else " and `validate diagnose`"
        raise SheetError(
            f'{source.name}: kind = "{kind}" is for `validate calibrate`{others}, and for nothing else'
        )
    return read_sheet_of(source, Sheet)


def kind_of_sheet(source: Source) -> str:
    """The ``kind`` that a sheet says, one of `KINDS_OF_SHEETS`; empty where it says none.

    Raises:
        SheetError: no TOML, or no such kind; one line.
    """
    kind = toml_of(source).get("kind", "")
    if not isinstance(kind, str) or kind not in ("", *KINDS_OF_SHEETS):
        known = ", ".join(f'"{one}"' for one in KINDS_OF_SHEETS)
        near = did_you_mean(kind, KINDS_OF_SHEETS) if isinstance(kind, str) else ""
        raise SheetError(
            f"{source.name}: kind must be one of {known}, or be left out for ramps and columns, "
            f"got {reprlib.repr(kind)}{near}"
        )
    return kind


def read_sheet_of(sheet: SheetSource, kind: type[S]) -> S:
    """A sheet of a kind from its file or its content.

    Raises:
        SheetError: no such file, no TOML, or no sheet; one line.
    """
    source = source_of_sheet(sheet)
    content = toml_of(source)
    if not content:
        raise SheetError(f"{source.name}: the file is empty; a sheet needs at least [test] with its model")
    try:
        return kind.model_validate(content | {"file": source.name, "folder": source.folder})
    except pydantic.ValidationError as error:
        keys = [key for table in _tables(kind) for key in table.model_fields if key not in AnySheet.model_fields]
        said = one_line(error, content, lambda _: keys)
        raise SheetError(f"{source.name}{_line_of(said, source.raw.decode('utf-8-sig'))}: {said}") from error


def _tables(kind: object) -> list[type[Table]]:
    """The tables that a type has in it, itself first."""
    if isinstance(kind, type) and issubclass(kind, Table):
        inner = [field.annotation for field in kind.model_fields.values()]
        return [kind, *(table for one in inner for table in _tables(one))]
    return [table for one in get_args(kind) for table in _tables(one)]


def _line_of(said: str, text: str) -> str:
    """Where the table stands that a message names by its header: ``, line 12``; empty where it names none."""
    header = re.search(r'\[\w+\."?[^"\]]+"?\]', said)
    if header is None:
        return ""
    bare = header.group().replace('"', "")
    for number, line in enumerate(text.splitlines(), 1):
        if line.replace('"', "").replace(" ", "").startswith(bare):
            return f", line {number}"
    return ""
