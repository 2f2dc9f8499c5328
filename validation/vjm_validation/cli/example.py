"""The command ``validate example``."""

from __future__ import annotations

import re
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.errors import did_you_mean
from vjm.io.files import check_writable, write_together
from vjm_output import terminal
from vjm_validation.cli import OK, UsageError

PAGE = "README.md"


def example_(
    name: Annotated[str, Parameter(help="Of the example; lists them where it is left out.")] = "",
    *,
    out: Annotated[
        Path | None, Parameter(help="Folder to write; NAME beside you by default. It must not exist yet.")
    ] = None,
) -> int:
    """Copy an example into a folder: a model or a test's data, and a page about them."""
    console = terminal.console()
    if not name:
        width = max(map(len, names())) + 2
        for one in names():
            console.print(f"{one:<{width}}{_title(one)}", soft_wrap=True, highlight=False)
        console.print("next: validate example NAME", soft_wrap=True, highlight=False)
        return OK
    if name not in names():
        raise UsageError(f"{name}: no such example{did_you_mean(name, names())}; there are {', '.join(names())}")
    folder = Path(name) if out is None else out
    if folder.exists():
        raise UsageError(f"{folder}: exists already; give another folder by --out, or remove it first")
    check_writable(folder)
    write_together({folder / file.name: file.read_bytes() for file in _files(_folder(name))})
    console.print(f"{folder}: {_title(name)}; {PAGE} says more", soft_wrap=True, highlight=False)
    command = first_command(name).replace(f"{name}/", f"{folder.as_posix()}/")
    console.print(f"next: {command}", soft_wrap=True, highlight=False)
    return OK


def names() -> list[str]:
    """Every example that there is."""
    return sorted(entry.name for entry in _all().iterdir() if entry.joinpath(PAGE).is_file())


def first_command(name: str) -> str:
    """The first command of an example's page, typed where the example's folder is."""
    match = re.search(r"^    (validate .*)$", _page(name), re.MULTILINE)
    if match is None:
        raise ValueError(f"{name}: its page has no command")
    return match[1]


def _title(name: str) -> str:
    return _page(name).splitlines()[0].lstrip("# ")


def _page(name: str) -> str:
    return _folder(name).joinpath(PAGE).read_text("utf-8")


def _folder(name: str) -> Traversable:
    return _all().joinpath(name)


def _all() -> Traversable:
    return resources.files("vjm_validation").joinpath("examples")


def _files(folder: Traversable) -> list[Traversable]:
    return [entry for entry in folder.iterdir() if entry.is_file()]
