"""What a result was made of, by which it is kept on disk, found again, and told from that of other inputs.

A loader notes the digest of each file that it reads, a command adds its options, and the program adds itself. What
is kept holds all of this. It is used again only where it is the same; else it is computed anew, or refused with a
line that says which input changed.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import pickle
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, assert_never

import numpy as np

import vjm
from vjm.io.files import write_whole

PACKAGES = ("vjm", "vjm_fea", "vjm_updating", "vjm_validation")
"""Of the suite, whose sources can change a number."""
LIBRARIES = ("numpy", "scipy", "numba", "exudyn", "openseespy")
"""Whose versions can."""
SHOWN = 4
"""Changes that a message lists."""


class OtherInputsError(ValueError):
    """What is kept was made of other inputs."""


@dataclass(frozen=True)
class Provenance:
    """All that determines a result.

    Attributes:
        inputs: by name the SHA-256 of a file's bytes, or an option or a version as text.
    """

    inputs: Mapping[str, str]

    @classmethod
    def of(cls, files: Mapping[str, str], /, **options: object) -> Provenance:
        """Of files, options, this program and what computes for it.

        Args:
            files: SHA-256 by name.
            options: of any kind; one that is no short text or number stands as its digest.
        """
        return cls(dict(files) | suite() | libraries()).asked(**options)

    def asked(self, **options: object) -> Provenance:
        """With more options."""
        return self.reading({name: _text(value) for name, value in options.items()})

    def reading(self, files: Mapping[str, str]) -> Provenance:
        """With more files."""
        return Provenance({**self.inputs, **files})

    @property
    def key(self) -> str:
        """One digest of all."""
        return _sealed(self.inputs)

    def changes(self, earlier: Mapping[str, str]) -> list[str]:
        """What is other than in an earlier result, input by input."""
        differences = []
        for name in dict.fromkeys((*self.inputs, *earlier)):
            before, now = earlier.get(name), self.inputs.get(name)
            if before == now:
                continue
            if before is None or now is None:
                differences.append(f"{name} is {'new' if before is None else 'gone'}")
            elif (was := _without_digest(before)) == (is_ := _without_digest(now)):
                differences.append(f"{name} has changed")
            else:
                differences.append(f"{name} was {was or 'other'} and is {is_ or 'other'}")
        return differences

    def check(self, earlier: object, where: str, remedy: str) -> None:
        """Refuse to go on with a result of other inputs than those that it was kept with.

        Raises:
            OtherInputsError: it was made of other inputs; one line that says which.
        """
        if not isinstance(earlier, Mapping):
            raise OtherInputsError(f"{where} (it does not say what it was made of): {remedy}")
        if changes := self.changes(earlier):
            said = [*changes[:SHOWN], *([f"{len(changes) - SHOWN} more"] if len(changes) > SHOWN else [])]
            raise OtherInputsError(f"{where} ({', '.join(said)}): {remedy}")

    def keep(self, file: Path, content: Any) -> None:  # noqa: ANN401
        """Write a result of lists, texts and numbers with what it was made of, whole or not at all."""
        record = {"made_of": dict(self.inputs), "content": content}
        write_whole(file, json.dumps(record | {"seal": _sealed(record)}, indent=1) + "\n")

    def kept(self, file: Path) -> Any:  # noqa: ANN401
        """What `keep` wrote of the same inputs; None where there is none, or it is not as it was written."""
        try:
            record = json.loads(file.read_bytes())
            seal = record.pop("seal")
            return record["content"] if seal == _sealed(record) and record["made_of"] == self.inputs else None
        except (OSError, ValueError, LookupError, AttributeError, TypeError):
            return None


def digest(content: bytes) -> str:
    """SHA-256 of a file's bytes."""
    return hashlib.sha256(content).hexdigest()


def suite() -> dict[str, str]:
    """The suite's version and the digest of its sources."""
    return {"version": vjm.__version__, "sources": _sources()}


@lru_cache(maxsize=1)
def _sources() -> str:
    hasher = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
            for file in sorted(Path(folder).rglob("*.py")):
                hasher.update(f"{package}/{file.relative_to(folder).as_posix()}\0".encode() + file.read_bytes())
    return hasher.hexdigest()


@lru_cache(maxsize=1)
def libraries() -> dict[str, str]:
    """Versions of what computes; what is not installed has none."""
    versions = {}
    for name in LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = ""
    return versions


def _sealed(plain: object) -> str:
    return digest(json.dumps(plain, sort_keys=True).encode())


def _without_digest(text: str) -> str:
    return re.sub(r" ?[0-9a-f]{64}$", "", text)


def _text(value: object) -> str:
    """An option as text, or its digest behind the label that it has."""
    if isinstance(value, str):
        return value
    text = json.dumps(_plain(value), sort_keys=True)
    if len(text) <= 80 and not is_dataclass(value):
        return text
    return f"{getattr(value, 'label', '')} {digest(text.encode())}".strip()


def _plain(value: object) -> Any:  # noqa: ANN401
    """A value as lists, texts and numbers, such that two are equal only where all that they hold is."""
    match value:
        case Enum():
            return str(value)
        case None | bool() | int() | float() | str():
            return value
        case np.generic():
            return value.item()
        case np.ndarray():
            return [list(value.shape), [_plain(each) for each in value.ravel().tolist()]]
        case Mapping():
            return {str(name): _plain(each) for name, each in value.items()}
        case set() | frozenset():
            return sorted(json.dumps(_plain(each), sort_keys=True) for each in value)
        case Sequence() | Collection():
            return [_plain(each) for each in value]
        case Path():
            return str(value)
        case object():
            return _of_object(value)
        case _:
            assert_never(value)


def _of_object(value: object) -> Any:  # noqa: ANN401
    kind = type(value)
    name = f"{kind.__module__}.{kind.__qualname__}"
    if name.split(".")[0] not in PACKAGES and (source := inspect.getsourcefile(kind)):
        # an engine or a law of another package, whose sources are not among the suite's
        name += f" {digest(Path(source).read_bytes())}"
    if is_dataclass(value):
        return [name, {each.name: _plain(getattr(value, each.name)) for each in fields(value)}]
    return [name, digest(pickle.dumps(value))]
