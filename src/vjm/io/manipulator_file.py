"""Manipulator files: legs that refer to chain files, on a platform; format 1.

The document of the chain file that says the same: parts of all legs, closures for loops.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field

from vjm.io.errors import ModelFileError, validated
from vjm.io.fields import Name, Table
from vjm.io.inertia import InertiaKgMM2, inertia_matrix, inertia_values
from vjm.io.joint_tables import Mass, Poses, Workspace
from vjm.io.model_file import (
    LibraryEntry,
    Model,
    ModelDocument,
    build_chain,
    checked,
    library_entries,
    parsed,
    read_document,
    written_document,
)
from vjm.io.schema import Axis, Base, Label, Turn, Turns, Units, VectorMM
from vjm.model.joint_limits import joint_limits
from vjm.model.machine import ATTACHMENT, BASE, FOOT, HOME, PLATFORM, ROOT, Machine, named
from vjm.model.parts import Joint, JointKind, RigidOffset
from vjm.rotations import frame, inverse_frame

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
    "units": Units, "turn": Turn, "leg": LegTable, "coupling": LegCouplingTable, "workspace": Workspace,
    "platform": PlatformTable, "body": PlatformBodyTable,
}  # fmt: skip


def manipulators() -> list[LibraryEntry]:
    """The manipulators that come with the package, by name."""
    return library_entries("manipulators")


def machines() -> list[LibraryEntry]:
    """The machines with closed loops that come with the package, by name."""
    return library_entries("machines")


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
        return resources.files("vjm").joinpath("models", "manipulators", "chains")
    return Path(name_or_path).parent


def read_table(document: ModelDocument) -> ManipulatorFile:
    """A manipulator's document, checked.

    Raises:
        ModelFileError: it is none; one line that says how to correct it.
    """
    return validated(
        ManipulatorFile, document.content, document.file, lambda tag: _TABLES.get(tag, ManipulatorFile).model_fields
    )


def leg_documents(name_or_path: Model) -> dict[str, ModelDocument]:
    """The documents of the chains that a manipulator's legs are made of, by the name that these have for them.

    Raises:
        ModelFileError: the manipulator's file is none, or a chain is not there or is no sane one.
    """
    folder = legs_folder(name_or_path)
    legs = read_table(read_document(name_or_path)).legs
    documents = {name: leg_document(name, folder) for name in dict.fromkeys(leg.chain for leg in legs)}
    for document in documents.values():
        checked(document.content, document.file, may_be_rigid=True)
    return documents


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


Content = dict[str, Any]


def legs_document(table: ManipulatorFile, chains: Mapping[str, tuple[Content, Machine]]) -> Content:
    """The document of the chain file that says the same as a manipulator file.

    Args:
        table: the manipulator file.
        chains: the document of each leg's chain, and the chain, by the name that legs have for it.

    Returns:
        Its parts are named ``leg/part``, a drive by the leg's name, the last part ``platform``. Its one posture is
        home as the legs' tables give it, which may be rounded.

    Raises:
        ValueError: names are not unique, a leg begins where no leg before it ends, none ends on the platform, or a
            leg has no such drive or coordinates.
    """
    masses: dict[str, PlatformTable | PlatformBodyTable] = {body.name: body for body in table.bodies}
    if table.platform.mass_kg:
        masses[PLATFORM] = table.platform
    carriers, parts, home = {BASE: ""}, list[Content](), dict[str, float]()
    result: Content = {key: [] for key in ("point_springs", "closures", "couplings")} | {"ends": {}}
    shared = {chains[leg.chain][1].link_segments for leg in table.legs}
    link_segments = shared.pop() if len(shared) == 1 else None
    for leg in table.legs:
        content, chain = chains[leg.chain]
        if leg.ends_on == BASE:
            raise ValueError(f"leg '{leg.name}' ends on the base: turn it round")
        if leg.starts_on not in carriers:
            raise ValueError(
                f"leg '{leg.name}' begins on '{leg.starts_on}', where no leg before it ends: it is not connected "
                "to the base"
            )
        made = _parts(leg, content, chain, own_numbers=link_segments is None)
        made[0]["after"] = carriers[leg.starts_on]
        parts += made
        home |= _home(leg, chain)
        _add_what_joins(result, leg, content, chain)
        if leg.ends_on in carriers:
            frames = [{}, _table(leg.attachment)]
            between = [made[-1]["name"], carriers[leg.ends_on]]
            result["closures"].append({"name": leg.name, "between": between, "frames": frames})
        else:
            carriers[leg.ends_on] = named(leg.name, ATTACHMENT)
            mass = None if leg.ends_on == PLATFORM else masses.get(leg.ends_on)
            parts.append(_attachment(leg, mass))
    if PLATFORM not in carriers:
        raise ValueError(f"{table.name}: no leg ends on the platform")
    other = next((body for body in masses if body not in carriers), None)
    if other is not None:
        raise ValueError(f"{table.name}: body '{other}' has a mass, but no leg ends on it")
    own = masses[PLATFORM].model_dump(include=set(_MASS), exclude_none=True) if PLATFORM in masses else {}
    parts.append({"kind": "link", "name": PLATFORM, "after": carriers[PLATFORM]} | own)
    for coupling in table.couplings:
        terms = [{"joint": f"{term.leg}/{term.joint}", "weight": term.weight} for term in coupling.terms]
        for term, asked in zip(terms, coupling.terms, strict=True):
            if term["joint"] not in home:
                raise ValueError(f"coupling '{coupling.name}': leg '{asked.leg}' has no joint '{asked.joint}'")
        result["couplings"].append({"name": coupling.name, "terms": terms})
    label = next((label for label, numbers in table.poses.items() if not any(numbers)), HOME)
    if label == HOME and any(table.poses.get(HOME, ())):
        raise ValueError(f"pose '{HOME}' is displaced from home: rename it")
    return {
        "format": 1, "name": table.name, "title": table.title, "source": table.source,
        "units": table.units.model_dump(),
        **({} if link_segments is None else {"springs": {"link_segments": link_segments}}),
        "parts": parts,
        **{key: value for key, value in result.items() if value},
        "postures": {label: home},
        "poses": {label: [0.0, 0.0, 0.0]} | {other: list(numbers) for other, numbers in table.poses.items()},
        **({} if table.workspace is None else {"workspace": table.workspace.model_dump()}),
    }  # fmt: skip


_MASS = ("mass_kg", "centre_of_mass_mm", "inertia_kg_mm2")


def _behind(leg: LegTable, part: str) -> str:
    """The part of a leg behind which another begins; an empty one is the leg's root."""
    return named(leg.name, part or ROOT)


def _turns(turns: Turns) -> list[Content]:
    return [{"turn_about": turn.turn_about.tolist(), "angle_deg": turn.angle_deg} for turn in turns]


def _reversed(turns: Turns) -> list[Content]:
    """Turns that undo turns."""
    return [turn | {"angle_deg": -turn["angle_deg"]} for turn in reversed(_turns(turns))]


def _table(base: Base) -> Content:
    return {"position_mm": list(base.position_mm), "turns": _turns(base.turns)}


def _attachment(leg: LegTable, body: PlatformTable | PlatformBodyTable | None) -> Content:
    """The rigid part from a leg's end to the body that it carries, with that body's mass."""
    back = inverse_frame(leg.attachment.frame)
    result: Content = {
        "kind": "link", "name": named(leg.name, ATTACHMENT), "translation_mm": back[:3, 3].tolist(),
        "turns": _reversed(leg.attachment.turns),
    }  # fmt: skip
    if body is not None and body.mass_kg:
        result["mass_kg"] = body.mass_kg
        result["centre_of_mass_mm"] = (back[:3, :3] @ np.array(body.centre_of_mass_mm) + back[:3, 3]).tolist()
        if body.inertia_kg_mm2 is not None:
            turned = back[:3, :3] @ inertia_matrix(body.inertia_kg_mm2) @ back[:3, :3].T
            result["inertia_kg_mm2"] = inertia_values(turned)
    return result


def _parts(leg: LegTable, content: Content, chain: Machine, *, own_numbers: bool) -> list[Content]:
    """The parts of a leg, its root first and the joint of its drive among them."""
    names = [part.name for part in chain.parts]
    taken = next((name for name in names if name in (ROOT, ATTACHMENT)), None)
    if taken is not None:
        raise ValueError(
            f"leg '{leg.name}': '{taken}' is the name of what holds a leg: rename that part of its chain"
        )
    joint = _drive(leg, chain)
    base = Base.model_validate(content.get("base", {}))
    place = leg.base.frame @ frame(p=base.position_mm)
    result: list[Content] = [
        {
            "kind": "link", "name": named(leg.name, ROOT), "translation_mm": place[:3, 3].tolist(),
            "turns": _turns([*leg.base.turns, *base.turns]),
        }
    ]  # fmt: skip
    # of a rigid part the drive acts where that ends, of any other where it begins
    behind = any(
        part.name == leg.drive and isinstance(part, RigidOffset) and not np.array_equal(part.transform, np.eye(4))
        for part in chain.parts
    )
    numbers = _spring_numbers(chain, own=own_numbers)
    for table, part in zip(content["parts"], chain.parts, strict=True):
        made = table | {"name": named(leg.name, part.name)}
        if "after" in table:
            driven = behind and table["after"] == leg.drive
            made["after"] = leg.name if driven else _behind(leg, table["after"])
        for key in {"free_length", "rides_on"} & table.keys():
            made[key] = named(leg.name, table[key])
        if "to" in table:
            made["to"] = {named(leg.name, name): ratio for name, ratio in table["to"].items()}
        if numbers.get(part.name) is not None:
            made["segments"] = numbers[part.name]
        if part.name != leg.drive:
            result.append(made)
        elif behind:
            result += [made, *joint]
        else:
            if "after" in made:
                joint[0]["after"] = made.pop("after")
            result += [*joint, made]
    return result


def _drive(leg: LegTable, chain: Machine) -> list[Content]:
    """The table of the joint that drives a leg, named by the leg, along an actuator's axis or about a given one."""
    if leg.drive is None:
        return []
    names = [part.name for part in chain.parts]
    if leg.drive not in names:
        raise ValueError(f"leg '{leg.name}': no part '{leg.drive}' to drive (there are {', '.join(names)})")
    axis, slides = leg.drive_turns_about, leg.drive_turns_about is None
    if axis is None:
        actuators = {p.name: p for p in chain.parts if isinstance(p, Joint) and p.kind is JointKind.ACTUATOR}
        if leg.drive not in actuators:
            raise ValueError(
                f"leg '{leg.name}': drive '{leg.drive}' is no actuator of {chain.name} (it has "
                f"{', '.join(actuators) or 'none'}): name one, or give drive_turns_about"
            )
        axis = actuators[leg.drive].axis
    result: Content = {"kind": "actuated", "name": leg.name, "axis": axis.tolist()}
    if slides:
        result["motion"] = "slides"
    if leg.drive_limits is not None:
        low, high = leg.drive_limits
        if low >= high:
            raise ValueError(f"leg '{leg.name}': drive_limits must be [lower, upper], got [{low:g}, {high:g}]")
        result["limits_mm" if slides else "limits_rad"] = [low, high]
    return [result]


def _spring_numbers(chain: Machine, *, own: bool) -> dict[str, int | None]:
    """Springs that each beam has by itself, by its name, where a machine cannot say it for all."""
    numbers = {beam.name: beam.own_segments for beam in chain.beams}
    if own and chain.link_segments is not None:
        numbers = {name: n or chain.link_segments for name, n in numbers.items()}
    if FOOT in numbers and (chain.foot_segments or 1) > 1:
        numbers[FOOT] = chain.foot_segments
    return numbers


def _home(leg: LegTable, chain: Machine) -> dict[str, float]:
    """Coordinates at home of a leg's joints and of its drive, by their names in the machine."""
    names = list(joint_limits(chain).given)
    if isinstance(leg.posture, list):
        if len(leg.posture) != len(names):
            raise ValueError(
                f"leg '{leg.name}': {len(leg.posture)} coordinates for {len(names)} joints "
                f"({', '.join(names) or 'none'}): give one each"
            )
        values = dict(zip(names, leg.posture, strict=True))
    else:
        try:
            passive = chain.posture(leg.posture)
        except KeyError as error:
            raise ValueError(f"leg '{leg.name}': {error.args[0]}") from error
        values = dict(zip((joint.name for joint in chain.joints), passive.tolist(), strict=True))
        values |= dict(chain.held.get(leg.posture, {}))
    own = {} if leg.drive is None else {leg.name: leg.drive_home}
    return own | {named(leg.name, name): values[name] for name in names}


def _add_what_joins(result: Content, leg: LegTable, content: Content, chain: Machine) -> None:
    """Add a leg's own springs between points, closures, couplings and end frames."""
    for spring in content.get("point_springs", []):
        # a leg's base is the body on which it begins; that part's own frame begins there
        points = [
            point if part else (leg.base.frame @ np.array([*point, 1.0]))[:3].tolist()
            for part, point in zip(spring["between"], spring["points_mm"], strict=True)
        ]
        result["point_springs"].append(_renamed(spring, leg) | {"points_mm": points})
    base = Base.model_validate(content.get("base", {}))
    for closure in content.get("closures", []):
        tables = closure.get("frames", [{}, {}])
        frames = [
            one if part else from_base(one, base) for part, one in zip(closure["between"], tables, strict=True)
        ]
        result["closures"].append(_renamed(closure, leg) | {"frames": frames})
    for own, made in zip(content.get("couplings", []), chain.couplings, strict=True):
        terms = [{"joint": named(leg.name, name), "weight": weight} for name, weight in made.terms]
        name = named(leg.name, own["name"])
        result["couplings"].append({**own, "name": name, "terms": terms, "total": made.total})
    result["ends"] |= {named(leg.name, end): _behind(leg, part) for end, part in content.get("ends", {}).items()}


def _renamed(table: Content, leg: LegTable) -> Content:
    between: Sequence[str] = table["between"]
    return table | {"name": named(leg.name, table["name"]), "between": [_behind(leg, part) for part in between]}


def from_base(table: Content, base: Base) -> Content:
    """The table of a frame of the world, from a base there."""
    pose = Base.model_validate(table)
    place = inverse_frame(base.frame) @ pose.frame
    return {"position_mm": place[:3, 3].tolist(), "turns": [*_reversed(base.turns), *_turns(pose.turns)]}
