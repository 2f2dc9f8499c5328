"""Case files: reading, checking, and the ones that come with the package."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

import pydantic

from vjm.io.errors import ModelFileError, did_you_mean, one_line
from vjm.io.provenance import digest
from vjm_validation.verification.schema import GROUPS, Asked, CaseFile, RunTable, known_keys


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
    found = [read_case(file.name, file.read_bytes()) for file in files if file.name.endswith(".toml")]
    groups = list(GROUPS)
    return tuple(sorted(found, key=lambda case: (groups.index(case.file.group), case.name)))


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
