"""The command ``validate new``."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from vjm.io.files import write_whole
from vjm_output import terminal
from vjm_validation.cli.status import OK, UsageError


def new_(
    kind: Annotated[
        Literal["chain", "arm", "platform", "bodies", "sheet"],
        Parameter(help="What machine to begin with, or the sheet of a test."),
    ],
    file: Annotated[Path, Parameter(help="To write; it must not exist yet.")],
) -> int:
    """Write a commented model file, or the sheet of a test, that runs as it is."""
    if file.suffix != ".toml":
        raise UsageError(f"{file}: a model file or sheet ends in .toml")
    if file.exists():
        raise UsageError(f"{file}: exists already; give another name, or remove it first")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", file.stem):
        raise UsageError(f"{file}: its name must start with a letter and go on with letters, digits, '_' or '-'")
    text = resources.files("vjm_validation").joinpath("cli", "templates", f"{kind}.toml").read_text("utf-8")
    write_whole(file, text.replace("NAME", file.stem, 1))
    console = terminal.console()
    what = {"arm": "an arm", "bodies": "bodies and joints"}.get(kind, f"a {kind}")
    console.print(f"{file}: {what}; put in your own numbers", soft_wrap=True)
    if kind == "sheet":
        nexts = f"validate diagnose READINGS.csv --sheet {file} --out DIR, validate calibrate with the same words"
        console.print(f"next: {nexts}", soft_wrap=True, highlight=False)
        return OK
    nexts = f"validate check {file}, validate stiffness {file}, validate show {file}, validate all {file}"
    console.print(f"next: {nexts}", soft_wrap=True, highlight=False)
    return OK
