"""Manipulator files: legs that refer to chain files, on a platform; format 1.

Lengths are mm, angles of turns degrees, joint and drive coordinates rad and mm. A leg's ``chain`` is a model of the
library or a TOML file beside the manipulator's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
import pydantic
from pydantic import Field, model_validator

from vjm.io.closure_tables import Poses, displacement
from vjm.io.errors import ModelFileError, one_line
from vjm.io.fields import Name
from vjm.io.inertia import InertiaKgMM2
from vjm.io.joint_tables import Mass
from vjm.io.model_file import LibraryEntry, ModelDocument, build_chain, parsed, read_document
from vjm.io.schema import Axis, Base, Label, Turn, Units, VectorMM, rotation
from vjm.io.sections import Table
from vjm.model.chain import Chain
from vjm.platform.manipulator import BASE, PLATFORM, Drive, Leg, LegCoupling, Manipulator, drive_of
from vjm.rotations import Array, frame

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


class Workspace(Table):
    """A box of displacements from home."""

    source: str = ""
    min_mm: VectorMM
    max_mm: VectorMM

    @model_validator(mode="after")
    def _ordered(self) -> Workspace:
        for axis, low, high in zip("xyz", self.min_mm, self.max_mm, strict=True):
            if low > high:
                raise ValueError(f"min_mm = {low:g} along {axis} is above max_mm = {high:g}: are they swapped?")
        return self


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


def load_manipulator(name_or_path: str | Path) -> Manipulator:
    """The manipulator of a file: legs from a base to a platform, see `vjm.io.machine_file.load_model`.

    Raises:
        ModelFileError: as `vjm.io.machine_file.load_model`, or it is a single chain, or more than such legs.
    """
    document = read_document(name_or_path)
    if document.content.get("kind") != KIND:
        raise ModelFileError(f"{name_or_path}: is a single chain, and this needs a manipulator (kind = '{KIND}')")
    return build_manipulator(document, legs_folder(name_or_path))


def legs_folder(name_or_path: str | Path) -> Path | Traversable:
    """Where the legs' chains lie of a model of the library or of a file."""
    for folder in ("manipulators", "machines"):
        inside = resources.files("vjm").joinpath("models", folder)
        if isinstance(name_or_path, str) and inside.joinpath(f"{name_or_path}.toml").is_file():
            return inside / "chains"
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


def build_manipulator(document: ModelDocument, folder: Legs) -> Manipulator:
    """The manipulator of a document.

    Args:
        document: as read.
        folder: of its legs, see `Legs`.

    Raises:
        ModelFileError: as `vjm.io.machine_file.load_model`.
    """
    file, table = document.file, read_table(document)
    if table.bodies or table.platform.mass_kg:
        raise ModelFileError(f"{file}: masses of the platform and of bodies are not computed here: leave them out")
    chains: dict[str, Chain] = {}
    digest = hashlib.sha256(document.sha256.encode())
    try:
        for leg in table.legs:
            if leg.chain not in chains:
                chains[leg.chain] = leg_chain(leg.chain, folder)
                digest.update(chains[leg.chain].sha256.encode())
        box = table.workspace
        return Manipulator(
            name=table.name,
            legs=tuple(_leg(leg, chains[leg.chain]) for leg in table.legs),
            home=frame(rotation(table.platform.turns), table.platform.position_mm),
            poses={label: displacement(label, numbers) for label, numbers in table.poses.items()},
            couplings=tuple(
                LegCoupling(c.name, tuple((term.leg, term.joint, term.weight) for term in c.terms))
                for c in table.couplings
            ),
            workspace=None if box is None else np.array([box.min_mm, box.max_mm]),
            title=table.title,
            source=table.source,
            sha256=digest.hexdigest(),
        )
    except ValueError as error:
        raise ModelFileError(f"{file}: {error}") from error


def leg_documents(name_or_path: str | Path) -> dict[str, ModelDocument]:
    """The documents of the chains that a manipulator's legs are made of, by the name that these have for them.

    Raises:
        ModelFileError: one of them is not there.
    """
    folder = legs_folder(name_or_path)
    legs = read_document(name_or_path).content.get("legs", [])
    return {name: leg_document(name, folder) for name in dict.fromkeys(str(leg["chain"]) for leg in legs)}


def leg_chain(name: str, folder: Legs, *, may_be_rigid: bool = False) -> Chain:
    """The chain of a leg: a file of a folder, or of the library.

    Raises:
        ModelFileError: there is none, or it is no sane chain.
    """
    document = leg_document(name, folder)
    return build_chain(document.content, document.file, document.sha256, may_be_rigid=may_be_rigid)


def leg_document(name: str, folder: Legs) -> ModelDocument:
    """The document of a leg's chain: a file of a folder, or of the library.

    Raises:
        ModelFileError: there is none, or it is no chain's.
    """
    if isinstance(folder, Mapping):
        return folder[name]
    file = folder / (name if name.endswith(".toml") else f"{name}.toml")
    if file.is_file():
        document = parsed(file.name, file.read_bytes())
        if document.content.get("kind") == KIND:
            raise ModelFileError(f"chain '{name}' is itself a manipulator: a leg needs a chain file")
        return document
    try:
        return read_document(name)
    except ModelFileError as error:
        raise ModelFileError(
            f"chain '{name}' is neither a file beside this one nor in the library: {error}"
        ) from None


def _leg(table: LegTable, chain: Chain) -> Leg:
    held = next((joint for joint in chain.moving if joint.held), None)
    if held is not None:
        what = "has a spring" if held.passive else "is held at a coordinate"
        remedy = "leave its stiffness out" if held.passive else "write kind = 'joint', and name the leg's drive"
        raise ValueError(
            f"leg '{table.name}': joint '{held.name}' of chain '{table.chain}' {what}, and joints of legs are "
            f"free: {remedy}"
        )
    return Leg(
        name=table.name,
        chain=chain,
        start=table.starts_on,
        end=table.ends_on,
        root=frame(rotation(table.base.turns), table.base.position_mm),
        attachment=frame(rotation(table.attachment.turns), table.attachment.position_mm),
        drive=leg_drive(table, chain),
        coordinate=table.drive_home,
        posture=leg_posture(table, chain),
    )


def leg_drive(table: LegTable, chain: Chain) -> Drive | None:
    """What drives a leg.

    Raises:
        ValueError: its limits are exchanged, or there is no such part.
    """
    if table.drive is None:
        return None
    low, high = table.drive_limits or (-np.inf, np.inf)
    if low >= high:
        raise ValueError(f"leg '{table.name}': drive_limits must be [lower, upper], got [{low:g}, {high:g}]")
    try:
        return drive_of(chain, table.drive, table.drive_turns_about, (low, high))
    except ValueError as error:
        raise ValueError(f"leg '{table.name}': {error}") from error


def leg_posture(table: LegTable, chain: Chain) -> Array:
    """Passive coordinates ``(n_q,)`` of a leg at home.

    Raises:
        ValueError: its chain has no such posture.
    """
    if isinstance(table.posture, list):
        return np.array(table.posture, dtype=float)
    try:
        return chain.posture(table.posture)
    except KeyError as error:
        raise ValueError(f"leg '{table.name}': {error.args[0]}") from error


def _library_files() -> list[Traversable]:
    return sorted((f for f in library_folder().iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
