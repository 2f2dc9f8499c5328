"""Files of machines, of either kind: a chain file with or without closures, or legs on bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vjm.io.errors import naming, validated
from vjm.io.manipulator_file import (
    KIND,
    Legs,
    leg_chain,
    leg_document,
    legs_document,
    legs_folder,
    read_table,
)
from vjm.io.model_file import Model, ModelDocument, build_chain, read_document
from vjm.io.model_plausibility import standing_findings
from vjm.io.schema import ModelFile, known_keys
from vjm.machine.rigid_mechanism import LoopClosure, PoseError
from vjm.model.machine import Machine
from vjm.model.parts import deflects


def load_model(name_or_path: Model) -> Machine:
    """The machine of a file of any kind, its loops closed in all its postures and poses.

    Args:
        name_or_path: a name of the library or a path to a TOML file: of parts, of bodies and joints, or of legs. Or
            what such a file holds, as a mapping; ``format``, ``title``, ``source`` and ``units`` may be left out.

    Raises:
        ModelFileError: no such file or model, no TOML, no sane machine, or its loops do not close; one line that
            says how to correct it.

    Example:
        >>> machine = load_model("delta")
        >>> len(machine.closures), list(machine.postures)
        (5, ['home', 'side', 'low'])
    """
    document = machine_document(name_or_path)
    return build_chain(document.content, document.file, document.files)


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


def build_machine(document: ModelDocument, folder: Legs) -> Machine:
    """The machine of a manipulator's document.

    A drive may be anywhere in its leg, a leg may be rigid or have actuated joints and springs of its own, and the
    platform and the bodies may have masses.

    Raises:
        ModelFileError: as `load_model`.
    """
    one = _as_one_chain(document, folder)
    return build_chain(one.content, one.file, one.files)


def machine_document(name_or_path: Model) -> ModelDocument:
    """The document of a machine's file of any kind as that of a chain file, see `vjm.io.model_file.build_chain`.

    Raises:
        ModelFileError: as `load_model`.
    """
    document = read_document(name_or_path)
    return _as_one_chain(document, legs_folder(name_or_path)) if document.content.get("kind") == KIND else document


def _as_one_chain(document: ModelDocument, folder: Legs) -> ModelDocument:
    """The document of the chain file that says the same as a manipulator's, its loops closed at home."""
    file, table = document.file, read_table(document)
    chains: dict[str, tuple[dict[str, Any], Machine]] = {}
    files = dict(document.files)
    with naming(file):
        for leg in table.legs:
            if leg.chain not in chains:
                chain = leg_chain(leg.chain, folder, may_be_rigid=True)
                chains[leg.chain] = leg_document(leg.chain, folder).content, chain
                files |= {f"leg {name}": own for name, own in chain.files.items()}
        legs = [chain for _, chain in chains.values()]
        if not any(chain.point_springs or any(map(deflects, chain.parts)) for chain in legs):
            raise ValueError(
                "nothing deflects: no leg has a beam, a joint with a compliance, or a spring on a point; add one"
            )
        content = legs_document(table, chains)
    (home,) = content["postures"]
    written = validated(ModelFile, content, file, known_keys)
    with naming(file):
        try:
            closing = LoopClosure(written.as_written(), home, table.platform.frame)
        except PoseError as error:
            # what is implausible about how legs stand may be why loops do not close
            perhaps = "".join(f". {where}: {what}" for _, where, what in standing_findings(table))
            raise PoseError(f"posture '{home}': {error}{perhaps}") from error
        content["postures"][home] = dict(zip(closing.tree.names, closing.home.tolist(), strict=True))
    return ModelDocument(file, content, files)


def is_legs(name_or_path: Model) -> bool:
    """Whether a file is one of legs between bodies.

    Raises:
        ModelFileError: there is no such file.
    """
    return read_document(name_or_path).content.get("kind") == KIND
