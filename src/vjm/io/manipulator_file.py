"""Manipulator files: legs that refer to chain files, on a platform; format 1.

Lengths are mm, angles of turns degrees, joint and drive coordinates rad and mm. A leg's ``chain`` is a model of the
library or a TOML file beside the manipulator's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import pydantic
from pydantic import Field

from vjm.io.closure_tables import Poses, Workspace
from vjm.io.errors import ModelFileError, one_line
from vjm.io.fields import Name
from vjm.io.inertia import InertiaKgMM2
from vjm.io.joint_tables import Mass
from vjm.io.model_file import (
    LibraryEntry,
    Model,
    ModelDocument,
    build_chain,
    checked,
    parsed,
    read_document,
    written_document,
)
from vjm.io.schema import Axis, Base, Label, Turn, Units, VectorMM
from vjm.io.sections import Table
from vjm.machine.legs import BASE, PLATFORM
from vjm.model.machine import Machine

KIND = "manipulator"
Legs: TypeAlias = Path | Traversable | Mapping[str, ModelDocument]
"""Where the chain files of legs lie that are not of the library, or their documents by the name that legs have for
them."""


class PlatformTable(Base):
    """The platform: its frame at home, and its mass."""

    mass_kg: Mass = 0.0
    centre_of_mass_mm: VectorMM = Field([0.0, 0.0, 0.0], description="in its frame")
    inertia_kg_mm2: InertiaKgMM2 | None = None


class PlatformBodyTable(Table):
    """A body between legs: its mass."""

    name: Label
    source: str = ""
    mass_kg: Mass
    centre_of_mass_mm: VectorMM = Field([0.0, 0.0, 0.0], description="in its frame")
    inertia_kg_mm2: InertiaKgMM2 | None = None


class LegTable(Table):
    """One leg: a chain, where it stands, what drives it."""

    name: Label
    chain: str = Field(min_length=1, description="a model of the library, or a file beside this one")
    source: str = ""
    starts_on: Label = BASE
    ends_on: Label = PLATFORM
    base: Base = Field(Base(), description="of the chain's world in the body on which the leg starts")
    attachment: Base = Field(Base(), description="of the chain's end in the body on which the leg ends")
    drive: Label | None = Field(None, description="the part that is actuated; none for a passive leg")
    drive_turns_about: Axis | None = Field(None, description="of a drive that turns; else an actuator's axis")
    drive_home: float = Field(0.0, description="mm or rad")
    drive_limits: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    posture: list[float] | Label = Field(
        [], description="coordinates at home of the chain's joints, base to tool, rad or mm, or a posture's label"
    )


class Term(Table):
    """A joint's share in a coupling."""

    leg: Label
    joint: Label
    weight: float


class LegCouplingTable(Table):
    """A rigid transmission: the weighted sum of the joints' turns from home is zero."""

    name: Label
    source: str = ""
    terms: list[Term] = Field(min_length=2)


class ManipulatorFile(Table):
    """A manipulator file."""

    format: Literal[1]
    kind: Literal["manipulator"]
    name: Name
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    units: Units
    platform: PlatformTable = PlatformTable()
    bodies: list[PlatformBodyTable] = Field([])
    workspace: Workspace | None = None
    legs: list[LegTable] = Field(min_length=1)
    couplings: list[LegCouplingTable] = Field([])
    poses: Poses = Field(min_length=1, description="displacement from home: x, y, z in mm, turns in rad")


_TABLES: dict[str, type[Table]] = {
    "units": Units,
    "base": Base,
    "turn": Turn,
    "legs": LegTable,
    "couplings": LegCouplingTable,
    "workspace": Workspace,
    "platform": PlatformTable,
    "bodies": PlatformBodyTable,
}


def _one_line(error: pydantic.ValidationError, content: Mapping[str, Any]) -> str:
    """`vjm.io.errors.one_line`, with legs by their names."""
    details = sorted(error.errors(include_url=False), key=lambda one: one["type"] != "extra_forbidden")
    inside = str(details[0]["loc"][0]) if len(details[0]["loc"]) > 1 else ""

    def known_keys(table: str) -> Iterable[str]:
        return list(_TABLES.get(table or inside, ManipulatorFile).model_fields)

    text = one_line(error, content, known_keys)
    legs = content.get("legs", [])
    for i, leg in enumerate(legs if isinstance(legs, list) else []):
        if isinstance(leg, dict) and isinstance(leg.get("name"), str):
            text = text.replace(f"legs entry {i + 1}.", f"leg '{leg['name']}': ")
            text = text.replace(f"legs entry {i + 1}", f"leg '{leg['name']}'")
    return text


def manipulators() -> list[LibraryEntry]:
    """The manipulators that come with the package, by name."""
    return [
        LibraryEntry(file.name.removesuffix(".toml"), str(parsed(file.name, file.read_bytes()).content["title"]))
        for file in _library_files()
    ]


def machines() -> list[LibraryEntry]:
    """The machines with closed loops that come with the package, by name."""
    folder = resources.files("vjm").joinpath("models", "machines")
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return [
        LibraryEntry(file.name.removesuffix(".toml"), str(parsed(file.name, file.read_bytes()).content["title"]))
        for file in files
    ]


def manipulator_schema() -> dict[str, Any]:
    """JSON Schema of a manipulator file."""
    return ManipulatorFile.model_json_schema()


def legs_folder(name_or_path: Model) -> Path | Traversable:
    """Where the legs' chains lie of a model of the library or of a file."""
    for folder in ("manipulators", "machines"):
        inside = resources.files("vjm").joinpath("models", folder)
        if isinstance(name_or_path, str) and inside.joinpath(f"{name_or_path}.toml").is_file():
            return inside / "chains"
    if isinstance(name_or_path, Mapping):
        return library_folder() / "chains"
    return Path(name_or_path).parent


def read_table(document: ModelDocument) -> ManipulatorFile:
    """A manipulator's document, checked.

    Raises:
        ModelFileError: it is none; one line that says how to correct it.
    """
    try:
        return ManipulatorFile.model_validate(document.content)
    except pydantic.ValidationError as error:
        raise ModelFileError(f"{document.file}: {_one_line(error, document.content)}") from error


def library_folder() -> Traversable:
    """Where the library's manipulators lie, and in ``chains`` their legs."""
    return resources.files("vjm").joinpath("models", "manipulators")


def leg_documents(name_or_path: Model) -> dict[str, ModelDocument]:
    """The documents of the chains that a manipulator's legs are made of, by the name that these have for them.

    Raises:
        ModelFileError: the manipulator's file is none, or a chain is not there or is no sane one.
    """
    folder = legs_folder(name_or_path)
    legs = read_table(read_document(name_or_path)).legs
    found = {name: leg_document(name, folder) for name in dict.fromkeys(leg.chain for leg in legs)}
    for document in found.values():
        checked(document.content, document.file, may_be_rigid=True)
    return found


def leg_chain(name: str, folder: Legs, *, may_be_rigid: bool = False) -> Machine:
    """The chain of a leg: a file of a folder, or of the library.

    Raises:
        ModelFileError: there is none, or it is no sane chain.
    """
    document = leg_document(name, folder)
    return build_chain(document.content, document.file, document.files, may_be_rigid=may_be_rigid)


def leg_document(name: str, folder: Legs) -> ModelDocument:
    """The document of a leg's chain: a file of a folder, or of the library.

    Raises:
        ModelFileError: there is none, or it is no chain's.
    """
    if isinstance(folder, Mapping):
        return folder[name]
    file = folder / (name if name.endswith(".toml") else f"{name}.toml")
    if file.is_file():
        document = written_document(file) if isinstance(file, Path) else parsed(file.name, file.read_bytes())
        if document.content.get("kind") == KIND:
            raise ModelFileError(f"chain '{name}' is itself a manipulator: a leg needs a chain file")
        return document
    try:
        return read_document(name)
    except ModelFileError as error:
        raise ModelFileError(
            f"chain '{name}' is neither a file beside this one nor in the library: {error}"
        ) from None


def _library_files() -> list[Traversable]:
    return sorted((f for f in library_folder().iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
