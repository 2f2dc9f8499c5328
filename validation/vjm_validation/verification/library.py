"""Case files: reading, checking, and the ones that come with the package."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import pairwise
from typing import Annotated, Any, Literal

import pydantic
from pydantic import Field, field_validator, model_validator

from vjm.io.errors import ModelFileError, did_you_mean, one_line
from vjm.io.fields import LengthMM, Table
from vjm.io.joint_tables import ActuatedTable
from vjm.io.provenance import digest
from vjm.io.schema import AnyPart, BeamTable, Label, Turns, VectorMM
from vjm.io.shapes import AnySection
from vjm.model.load_case import ARC, COMPONENTS, RAMP

# --- The format of a case file, version 1 -------------------------------------------------------------------------

Component = Literal["x", "y", "z", "rx", "ry", "rz"]
Family = Literal["vjm", "exudyn", "opensees", "vjm-linear", "msa"]
"""Engines by what they are, without the number of springs or elements."""
Kind = Literal["exact", "code", "published"]
Measure = Literal[
    "displacement",
    "position",
    "point",
    "force",
    "turning load",
    "critical force",
    "limit force",
    "second limit force",
    "fold force",
    "second fold force",
    "stiffness",
    "compliance",
]

GROUPS = {
    "linear": "Small displacements",
    "lumped": "Rigid bars and springs",
    "bending": "Large bending in a plane",
    "columns": "Critical loads of columns",
    "post-buckling": "Behind the critical load",
    "arches": "Deep arches",
    "space": "Large bending in space",
    "paper": "The paper's own parts",
}
"""Groups of cases, in the order of the report."""
BASELINES = ("vjm-linear", "msa")
"""Linear families, which have no mesh and answer for small displacements only."""
EVENTS = ("critical force", "limit force", "second limit force", "fold force", "second fold force")
"""What is asked of an event, and not of a point of the path."""


class ChainTable(Table):
    """A chain, its parts as in a model file."""

    parts: list[AnyPart] = Field(min_length=1)
    turns: Turns = Field([], description="of the first part's root, in the world")
    posture: list[float] = Field([], description="passive joint coordinates in rad, base to tool")


class ArcTable(Table):
    """A circular arc as straight beams with rigid arms to the arc's own points; see `geometry.arc_chain`.

    Its root is at the world's origin; it begins along x and curves towards −y. The mesh is the number of its sides.
    """

    radius_mm: LengthMM
    angle_deg: float = Field(gt=0.0, lt=360.0, description="that it subtends")
    start_deg: float = Field(0.0, ge=-360.0, le=360.0, description="of its tangent at the root from x towards y")
    hinged_end: bool = Field(False, description="a hinge about z between its end and the end-effector")
    section: AnySection


class RodTable(Table):
    """A rod of constant curvature and twist at rest, a twisted bar or a helix, as straight beams.

    See `geometry.rod_chain`. It begins along x at the world's origin. The mesh is the number of its beams.
    """

    length_mm: LengthMM = Field(description="along the rod")
    curvature_per_mm: VectorMM = Field(description="twist about the rod's axis, curvatures about y and z; 1/mm")
    turns: Turns = Field([], description="of its root, in the world")
    section: AnySection


class LoadTable(Table):
    """A wrench on a body; see `vjm.model.load_case.Load`."""

    wrench: Annotated[list[float], Field(min_length=6, max_length=6)] = Field(description="N, N mm, world axes")
    part: str = Field("", description="the end-effector where it is empty; 'arc' for a point of the arc")
    at: float = Field(1.0, ge=0.0, le=1.0, description="fraction of the part's, or of the arc's, length")
    follower: bool = False
    ramped: bool = True


class ControlledPointTable(Table):
    """A point whose displacement controls the path; see `vjm.model.load_case.PointControl`."""

    part: str = ""
    at: float = Field(1.0, ge=0.0, le=1.0)
    direction: VectorMM


class LoadCaseTable(Table):
    """What is done to the chain; see `vjm.model.load_case.LoadCase`."""

    to: float
    axis: Literal["x", "y", "z", "rx", "ry", "rz", "load"] = "x"
    steps: int | None = Field(None, ge=1)
    branch: Literal[1, -1, 0] = 1
    free: list[Component] = Field([])
    loads: list[LoadTable] = Field([])
    gravity: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None
    control: Literal["ramp", "arc"] | ControlledPointTable = "ramp"
    imperfection: float = Field(0.0, ge=0.0, description="mm")

    @field_validator("control")
    @classmethod
    def _known(cls, control: str | ControlledPointTable) -> str | ControlledPointTable:
        assert not isinstance(control, str) or control in (RAMP, ARC)
        return control


class Reference(Table):
    """The answer: a number, or a function of `vjm_validation.exact` and its arguments."""

    source: str = Field(min_length=1)
    value: float | None = None
    uncertainty: float | None = Field(None, ge=0.0, description="of the value, in its unit")
    exact: str | None = Field(None, description="module.function of vjm_validation.exact")
    arguments: dict[str, Any] = Field({}, description="a table with 'make' or 'constant' names what is in exact")
    take: str | list[int | str] | None = Field(
        None, description="attributes and indices into the function's result"
    )
    times: float = Field(1.0, description="unit of the function's result in that of the quantity")

    @model_validator(mode="after")
    def _one(self) -> Reference:
        if (self.value is None) == (self.exact is None):
            raise ValueError("needs either value or exact, and not both")
        if self.value is None and self.uncertainty is not None:
            raise ValueError("has an uncertainty, which belongs to a value")
        return self


class Asked(Table):
    """One quantity and its answer."""

    quantity: str = Field(min_length=1, description="with its unit, for people")
    measure: Measure
    component: Component | None = None
    by: Component | None = Field(None, description="second index of a stiffness or compliance")
    ramp: float | None = Field(None, gt=0.0, description="where on the path; its end where it is not given")
    part: str = Field("", description="of a point")
    at: float = Field(1.0, ge=0.0, le=1.0)
    over: float = Field(1.0, description="the measured value is divided by this")
    absolute: bool = Field(False, description="without its sign, which mirrored branches differ in")
    relative_to: float | None = Field(None, gt=0.0, description="size that errors are relative to")
    kind: Kind | None = Field(None, description="where it is not the case's")
    tolerance: float | None = Field(None, gt=0.0, description="of every engine, instead of its own")
    reason: str = Field("", description="of that tolerance")
    orders: dict[Family, Annotated[float, Field(gt=0.0)]] = Field(
        {}, description="by theory, where not the engine's"
    )
    reference: Reference

    @model_validator(mode="after")
    def _complete(self) -> Asked:
        needs_component = self.measure not in ("force", *EVENTS)
        if needs_component != (self.component is not None):
            said = "needs a component" if needs_component else "has no component"
            raise ValueError(f"measure '{self.measure}' {said}, one of {', '.join(COMPONENTS)}")
        if (self.measure in ("stiffness", "compliance")) != (self.by is not None):
            raise ValueError("'by' is the second index of a stiffness or a compliance, and of nothing else")
        if self.over == 0.0:
            raise ValueError("over must not be 0")
        if (self.tolerance is None) != (not self.reason):
            raise ValueError("a tolerance of its own needs a reason, and a reason a tolerance")
        return self


class RunTable(Table):
    """One load case, and what is asked of its path."""

    name: str = ""
    load_case: LoadCaseTable
    asked: list[Asked] = Field(min_length=1)


class EngineTable(Table):
    """How one family of engines is to answer."""

    meshes: list[Annotated[int, Field(ge=1)]] = Field([], description="springs or elements of every beam")
    order: float | None = Field(None, gt=0.0, description="of convergence by theory")
    tolerance: float = Field(gt=0.0, description="relative error on the finest mesh")
    reason: str = Field(min_length=1, description="why that much")
    shear: bool = Field(False, description="the elements keep the section's shear flexibility")
    foot_spring: bool = Field(False, description="the part named foot is one spring, and not elements")

    @field_validator("meshes")
    @classmethod
    def _growing(cls, meshes: list[int]) -> list[int]:
        if any(b <= a for a, b in pairwise(meshes)):
            raise ValueError(f"= {meshes} must grow, as in [4, 8, 16]")
        return meshes


class CaseFile(Table):
    """A case: a question with a known answer."""

    format: Literal[1]
    name: Label
    title: str = Field(min_length=1, description="one line for people")
    group: Literal["linear", "lumped", "bending", "columns", "post-buckling", "arches", "space", "paper"]
    kind: Kind
    note: str = ""
    quick: bool = Field(True, description="also run by --quick")
    chain: ChainTable | None = None
    arc: ArcTable | None = None
    rod: RodTable | None = None
    runs: list[RunTable] = Field(min_length=1)
    engines: dict[Family, EngineTable] = Field(min_length=1)

    @model_validator(mode="after")
    def _sane(self) -> CaseFile:
        if sum(table is not None for table in (self.chain, self.arc, self.rod)) != 1:
            raise ValueError("needs one of [chain], [arc] and [rod]")
        if self.chain is not None and not any(_deflects(part) for part in self.chain.parts):
            raise ValueError("no part has kind = 'beam', nor a compliance: nothing deflects")
        for family, table in self.engines.items():
            if (family in BASELINES) != (not table.meshes):
                said = "has no meshes" if family in BASELINES else "needs at least three meshes"
                raise ValueError(f"engine '{family}' {said}")
            if family not in BASELINES and len(table.meshes) < 3:
                raise ValueError(f"engine '{family}' needs at least three meshes, got {table.meshes}")
        return self

    @property
    def sided(self) -> bool:
        """Whether the mesh is a number of straight sides, each of them one element."""
        return self.chain is None


def _deflects(part: AnyPart) -> bool:
    return isinstance(part, BeamTable) or (isinstance(part, ActuatedTable) and part.own > 0.0)


_TABLES: dict[str, type[Table]] = {
    "": CaseFile, "chain": ChainTable, "arc": ArcTable, "rod": RodTable, "runs": RunTable,
    "load_case": LoadCaseTable, "loads": LoadTable, "control": ControlledPointTable, "asked": Asked,
    "reference": Reference, "engines": EngineTable,
}  # fmt: skip


def known_keys(path: Iterable[str | int]) -> list[str]:
    """The keys of the innermost table on a path of keys."""
    named = [key for key in path if isinstance(key, str) and key in _TABLES]
    return list(_TABLES[named[-1] if named else ""].model_fields)


@dataclass(frozen=True)
class Case:
    """A checked case.

    Attributes:
        file: what it says.
        files: SHA-256 of the file by its name.
    """

    file: CaseFile
    files: Mapping[str, str]

    @property
    def name(self) -> str:
        """Its label."""
        return self.file.name

    @property
    def questions(self) -> tuple[tuple[RunTable, Asked], ...]:
        """Everything that is asked, run by run."""
        return tuple((run, asked) for run in self.file.runs for asked in run.asked)


@cache
def library() -> tuple[Case, ...]:
    """The cases of the package, group by group.

    Raises:
        ModelFileError: a case file is wrong; one line that says how to correct it.
    """
    files = resources.files("vjm_validation").joinpath("cases").iterdir()
    cases = [read_case(file.name, file.read_bytes()) for file in files if file.name.endswith(".toml")]
    groups = list(GROUPS)
    return tuple(sorted(cases, key=lambda case: (groups.index(case.file.group), case.name)))


def case_by_name(name: str) -> Case:
    """A case of the library.

    Raises:
        ValueError: there is none of that name.
    """
    known = {case.name: case for case in library()}
    if name not in known:
        raise ValueError(f"no case '{name}'{did_you_mean(name, known)} (there are {', '.join(known)})")
    return known[name]


def picked(names: Sequence[str], *, quick: bool = False) -> list[Case]:
    """Cases by name; all where no name is given, or all that ``quick`` leaves.

    Raises:
        ValueError: there is no case of a name.
    """
    if names:
        return [case_by_name(name) for name in names]
    return [case for case in library() if case.file.quick or not quick]


def read_case(file: str, raw: bytes) -> Case:
    """The case of a file.

    Args:
        file: its name, for messages; without its ending it is the case's name.
        raw: its bytes.

    Raises:
        ModelFileError: no TOML, or no sane case; one line that names the file, the key and the remedy.
    """
    try:
        content = tomllib.loads(raw.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise ModelFileError(f"{file}: not valid TOML: {' '.join(str(error).split())}") from error
    try:
        case = CaseFile.model_validate(content)
    except pydantic.ValidationError as error:
        first = min(error.errors(include_url=False), key=lambda one: one["type"] != "extra_forbidden")
        raise ModelFileError(
            f"{file}: {one_line(error, content, lambda _: known_keys(first['loc'][:-1]))}"
        ) from error
    if f"{case.name}.toml" != file:
        raise ModelFileError(f"{file}: its name = '{case.name}': name the file {case.name}.toml")
    return Case(case, {file: digest(raw)})
