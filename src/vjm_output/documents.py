"""JSON documents: a pydantic model as text, its schema, and the versions that made it."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from pydantic import BaseModel, ConfigDict

from vjm import __version__
from vjm.io.findings import Finding

Matrix = list[list[float]]
"""A matrix as a document has it, row by row."""


class Row(BaseModel):
    """A document or a part of one, frozen; its schema is built at its first use, which most commands have not."""

    model_config = ConfigDict(frozen=True, defer_build=True)


class DoubtRow(Row):
    """What is implausible about an input."""

    grade: str
    where: str
    found: str


def doubt_rows(findings: Iterable[Finding]) -> list[DoubtRow]:
    """Findings as a document has them."""
    return [DoubtRow(grade=str(one.grade), where=one.where, found=one.description) for one in findings]


class VersionRow(Row):
    """What a document was made with."""

    package: str
    model_sha256: str
    data_sha256: str


MADE_OF = "all that determines it: SHA-256 of files by name, options and versions"
"""Description of a document's provenance."""
PACKAGES = ("numpy", "scipy", "exudyn", "matplotlib", "pyvista")
"""Whose versions can change a number or a picture."""


def versions() -> dict[str, str]:
    """Versions of this suite, of Python and of what computes for it; what is not installed has none."""
    installed = {
        "vjm-stiffness": __version__,
        "python": platform.python_version(),
        "machine": platform.platform(),
    }
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            installed[name] = version(name)
    return installed


def as_json(document: BaseModel) -> str:
    """A JSON document as text; what is not a number becomes null."""
    return json.dumps(document.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"


def schema(document: type[BaseModel]) -> dict[str, Any]:
    """JSON Schema of a document."""
    return document.model_json_schema(mode="serialization")
