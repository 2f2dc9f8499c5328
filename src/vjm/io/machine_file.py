"""Files of machines, of either kind: a chain file with or without closures, or legs on bodies."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.closure_tables import displacement
from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.inertia import inertia_matrix
from vjm.io.manipulator_file import (
    KIND,
    Legs,
    LegTable,
    PlatformBodyTable,
    PlatformTable,
    build_manipulator,
    leg_chain,
    leg_document,
    leg_drive,
    leg_posture,
    legs_folder,
    machines,
    manipulators,
    read_table,
)
from vjm.io.model_file import ModelDocument, build_chain, library, read_document
from vjm.io.schema import rotation
from vjm.machine.legs import MachineLeg, joined, posed
from vjm.model.chain import Chain
from vjm.model.joint_limits import joint_limits
from vjm.model.joints import Joint
from vjm.model.parts import deflects
from vjm.platform.manipulator import PLATFORM, Manipulator
from vjm.rotations import Array, frame


def load_model(name_or_path: str | Path) -> Chain | Manipulator:
    """The machine of a file: a chain, tree or closed loops of parts, or legs on a platform.

    A manipulator's file whose legs have drives behind other joints, masses, or no compliance, or whose bodies are
    held by one leg, becomes a tree of parts with closures, see `load_machine`.

    Args:
        name_or_path: a name of the library or a path to a TOML file.

    Raises:
        ModelFileError: no such file or model, no TOML, or no sane machine; one line that says how to correct it.
    """
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and not path.exists() and path.suffix != ".toml":
        names = [entry.name for entry in (*library(), *manipulators(), *machines())]
        if name_or_path not in names:
            raise ModelFileError(
                f"no model '{name_or_path}' in the library, which has {', '.join(names)}"
                f"{did_you_mean(name_or_path, names)}"
            )
    document = read_document(name_or_path)
    if document.content.get("kind") == KIND:
        return _legs(document, legs_folder(name_or_path))
    return build_chain(document.content, document.file, document.sha256)


def _legs(document: ModelDocument, folder: Path | Traversable) -> Chain | Manipulator:
    """The manipulator of a document, or the machine that is more than legs from a base to a platform.

    Raises:
        ModelFileError: it is neither.
    """
    try:
        return build_manipulator(document, folder)
    except ModelFileError as refused:
        try:
            return build_machine(document, folder)
        except ModelFileError:
            raise refused from None


def load_machine(name_or_path: str | Path) -> Chain:
    """The machine of a file of either kind, its loops closed in all its postures and poses.

    Args:
        name_or_path: as for `load_model`.

    Raises:
        ModelFileError: as `load_model`, or its loops do not close.

    Example:
        >>> machine = load_machine("delta")
        >>> len(machine.closures), list(machine.postures)
        (5, ['home', 'side', 'low'])
    """
    document = read_document(name_or_path)
    if document.content.get("kind") == KIND:
        return build_machine(document, legs_folder(name_or_path))
    return build_chain(document.content, document.file, document.sha256)


def part_tables(name_or_path: str | Path) -> list[dict[str, Any]]:
    """The tables of a file's parts as they are written; of legs on bodies those of all legs, named ``leg/part``.

    Raises:
        ModelFileError: as `load_model`.
    """
    document = read_document(name_or_path)
    if document.content.get("kind") != KIND:
        return list(document.content.get("parts", []))
    folder = legs_folder(name_or_path)
    return [
        part | {"name": f"{leg.name}/{part['name']}"}
        for leg in read_table(document).legs
        for part in leg_document(leg.chain, folder).content.get("parts", [])
    ]


def build_machine(document: ModelDocument, folder: Legs) -> Chain:
    """The machine of a manipulator's document.

    A drive may be anywhere in its leg, a leg may be rigid or have actuated joints and springs of its own, and the
    platform and the bodies may have masses.

    Args:
        document: as read.
        folder: of its legs, see `vjm.io.manipulator_file.Legs`.

    Raises:
        ModelFileError: as `load_machine`.
    """
    file, table = document.file, read_table(document)
    chains: dict[str, Chain] = {}
    digest = hashlib.sha256(document.sha256.encode())
    try:
        for leg in table.legs:
            if leg.chain not in chains:
                chains[leg.chain] = leg_chain(leg.chain, folder, may_be_rigid=True)
                digest.update(chains[leg.chain].sha256.encode())
        if not any(deflects(part) for chain in chains.values() for part in chain.parts):
            raise ValueError("nothing deflects: no leg has a beam, or a joint with a compliance; add one")
        masses = {body.name: _mass(body) for body in table.bodies}
        if table.platform.mass_kg:
            masses[PLATFORM] = _mass(table.platform)
        machine = joined(
            table.name,
            [_machine_leg(leg, chains[leg.chain]) for leg in table.legs],
            masses,
            [(c.name, [(term.leg, term.joint, term.weight) for term in c.terms]) for c in table.couplings],
        )
        return posed(
            replace(machine, title=table.title, source=table.source, sha256=digest.hexdigest()),
            {label: displacement(label, numbers) for label, numbers in table.poses.items()},
            frame(rotation(table.platform.turns), table.platform.position_mm),
        )
    except ValueError as error:
        raise ModelFileError(f"{file}: {error}") from error


def _machine_leg(table: LegTable, chain: Chain) -> MachineLeg:
    joint, home = None, _home(table, chain)
    if table.drive is not None:
        drive = leg_drive(table, chain)
        assert drive is not None
        limits = drive.limits if table.drive_limits is not None else None
        joint = Joint(table.name, drive.axis, drive.slides, limits=limits)
        home[table.name] = table.drive_home
    return MachineLeg(
        table.name,
        chain,
        table.starts_on,
        table.ends_on,
        frame(rotation(table.base.turns), table.base.position_mm),
        frame(rotation(table.attachment.turns), table.attachment.position_mm),
        joint,
        table.drive or "",
        home,
    )


def _mass(table: PlatformTable | PlatformBodyTable) -> tuple[float, Array, Array | None]:
    """Mass, kg, centre ``(3,)`` mm, and moments of inertia ``(3, 3)`` about it, kg mm²."""
    inertia = None if table.inertia_kg_mm2 is None else inertia_matrix(table.inertia_kg_mm2)
    return table.mass_kg, np.array(table.centre_of_mass_mm, dtype=float), inertia


def _home(table: LegTable, chain: Chain) -> dict[str, float]:
    """Coordinates at home of a leg's own joints by name."""
    names = list(joint_limits(chain).given)
    if isinstance(table.posture, list):
        if len(table.posture) != len(names):
            raise ValueError(
                f"leg '{table.name}': {len(table.posture)} coordinates for {len(names)} joints "
                f"({', '.join(names) or 'none'}): give one each"
            )
        return dict(zip(names, table.posture, strict=True))
    passive = leg_posture(table, chain)
    values = dict(zip((joint.name for joint in chain.joints), passive.tolist(), strict=True))
    return values | dict(chain.held.get(table.posture, {}))


def is_machine(name_or_path: str | Path) -> bool:
    """Whether a file is one of legs on bodies, or of the library's machines with closed loops.

    Raises:
        ModelFileError: there is no such file.
    """
    if name_or_path in [entry.name for entry in machines()]:
        return True
    return read_document(name_or_path).content.get("kind") == KIND
