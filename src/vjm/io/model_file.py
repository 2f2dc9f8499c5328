"""Model files: the chain of a machine from TOML, by a library name or a path.

The format is described in `vjm.io.schema`, and by example in the library's ``orthoglide-chain.toml``.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vjm.io.body_file import KIND as BODIES
from vjm.io.body_file import chain_document
from vjm.io.errors import ModelFileError, did_you_mean, naming, validated
from vjm.io.files import LARGEST, bounded_bytes, toml_content
from vjm.io.provenance import digest
from vjm.io.schema import MAY_BE_RIGID, ModelFile, known_keys
from vjm.io.solid_compliance import expanded, solid_key_schema
from vjm.model.machine import Machine

Model: TypeAlias = str | Path | Mapping[str, Any]
"""A name of the library, a path to a file, or what a file holds."""
UNSAID = {"format": 1, "source": "given as a mapping", "units": {"length": "mm", "force": "N", "angle": "rad"}}
"""What a mapping need not say."""


class LibraryEntry(NamedTuple):
    """A model of the library: what to call it by, and one line for people."""

    name: str
    title: str


class ModelDocument(NamedTuple):
    """A model file as read, not yet checked.

    Attributes:
        file: its name, for messages.
        content: the TOML document.
        files: SHA-256 of each file that was read for it, by name: its own, drawings, legs.
    """

    file: str
    content: dict[str, Any]
    files: Mapping[str, str]


def load_chain(name_or_path: str | Path) -> Machine:
    """The chain of a model file.

    Args:
        name_or_path: a model of the library, such as ``orthoglide-chain``, or a path to a TOML file.

    Raises:
        ModelFileError: no such file or model, no TOML, or no sane machine; one line that says how to correct it.
    """
    document = read_document(name_or_path)
    return build_chain(document.content, document.file, document.files)


def library() -> list[LibraryEntry]:
    """The models that come with the package, by name.

    Example:
        >>> import vjm
        >>> [entry.name for entry in vjm.library()][:2]
        ['compensated-arm', 'orthoglide-chain']
    """
    return library_entries()


def library_entries(*folder: str) -> list[LibraryEntry]:
    """The models of a folder of the library, by name."""
    return [
        LibraryEntry(file.name.removesuffix(".toml"), str(parsed(file.name, file.read_bytes()).content["title"]))
        for file in _library_files(*folder)
    ]


def model_schema() -> dict[str, Any]:
    """JSON Schema of a model file."""
    result = ModelFile.model_json_schema()
    # a compliance may also be a drawing's, which is read before the rest is checked
    result["$defs"]["SolidTable"] = solid_key_schema()
    matrix = result["$defs"]["BeamTable"]["properties"]["compliance"]
    matrix["anyOf"].append({"$ref": "#/$defs/SolidTable"})
    return result


def _as_lists(value: Any) -> Any:  # noqa: ANN401
    """What a mapping holds, as TOML gives it: tuples and arrays as lists, whole numbers of NumPy as Python's."""
    if isinstance(value, Mapping):
        return {str(key): _as_lists(each) for key, each in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_as_lists(each) for each in value] if isinstance(value, list | tuple) else value


def read_document(name_or_path: Model) -> ModelDocument:
    """A model file as read, to be changed or checked, see `build_chain`; one of bodies and joints as a chain's.

    Raises:
        ModelFileError: no such file or model, or no TOML.
    """
    return as_parts(written_document(name_or_path))


def written_document(name_or_path: Model) -> ModelDocument:
    """A model file of any kind as it is written; a mapping stands for a file's content.

    Raises:
        ModelFileError: as `read_document`.
    """
    if isinstance(name_or_path, Mapping):
        name = str(name_or_path.get("name", "the mapping"))
        return ModelDocument(name, {**UNSAID, "title": name, **_as_lists(name_or_path)}, {})
    # a manipulator too, so that it can be said what it is
    files = [*_library_files(), *_library_files("manipulators"), *_library_files("machines")]
    for file in files if isinstance(name_or_path, str) else ():
        if file.name == f"{name_or_path}.toml":
            return parsed(file.name, file.read_bytes())
    path = Path(name_or_path)
    if not path.exists():
        known = [file.name.removesuffix(".toml") for file in files]
        hint = did_you_mean(path.name.removesuffix(".toml"), known)
        # a bare word was meant as a name
        if isinstance(name_or_path, str) and path.name == name_or_path and path.suffix != ".toml":
            raise ModelFileError(f"no model '{name_or_path}' in the library, which has {', '.join(known)}{hint}")
        beside = [file.name for file in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        hint = did_you_mean(path.name, beside)
        raise ModelFileError(f"{path}: no such file; give a path to a TOML file or one of {', '.join(known)}{hint}")
    if path.is_dir():
        raise ModelFileError(f"{path}: is a directory; give the model file in it")
    document = parsed(path.name, bounded_bytes(path, 4 * LARGEST))
    content, drawings = expanded(document.content, path.parent, path.name)
    return document._replace(content=content, files={**document.files, **drawings})


def as_parts(document: ModelDocument) -> ModelDocument:
    """The document of a chain file, where it is one of bodies and joints.

    Raises:
        ModelFileError: that describes no machine.
    """
    if document.content.get("kind") != BODIES:
        return document
    return document._replace(content=chain_document(document.content, document.file))


def build_chain(
    content: Mapping[str, Any], file: str, files: Mapping[str, str] | None = None, *, may_be_rigid: bool = False
) -> Machine:
    """The chain of a model document, such as one that a test sheet has changed.

    Args:
        content: as TOML gives it; not changed.
        file: name for messages.
        files: SHA-256 of what was read for it, kept in the chain.
        may_be_rigid: whether nothing needs to deflect, as in a leg of a machine.

    Raises:
        ModelFileError: as `load_chain`.
    """
    if content.get("kind") == "manipulator":
        raise ModelFileError(f"{file}: is a whole manipulator, and this takes one chain: give the file of a leg's")
    table = checked(content, file, may_be_rigid=may_be_rigid)
    with naming(file):
        return table.chain(files)


def checked(content: Mapping[str, Any], file: str, *, may_be_rigid: bool = False) -> ModelFile:
    """The tables of a chain's document, each key of its type; no posture is assembled.

    Raises:
        ModelFileError: a key is missing, unknown or of another type; one line.
    """
    return validated(ModelFile, content, file, known_keys, {MAY_BE_RIGID} if may_be_rigid else ())


def _library_files(*folder: str) -> list[Traversable]:
    files = resources.files("vjm").joinpath("models", *folder).iterdir()
    return sorted((file for file in files if file.name.endswith(".toml")), key=lambda file: file.name)


def parsed(file: str, raw: bytes) -> ModelDocument:
    """The document of a file's bytes.

    Raises:
        ModelFileError: it is no TOML.
    """
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise ModelFileError(f"{file}: not UTF-8 text (line {line}); save it as UTF-8") from error
    if not text.strip():
        raise ModelFileError(f"{file}: the file is empty; start from the library's orthoglide-chain.toml")
    return ModelDocument(file, toml_content(text, file), {file: digest(raw)})
