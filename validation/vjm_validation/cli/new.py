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
    kind: Annotated[Literal["chain", "arm", "platform"], Parameter(help="What machine to begin with.")],
    file: Annotated[Path, Parameter(help="To write; it must not exist yet.")],
) -> int:
    """Write a commented model file that runs as it is."""
    if file.suffix != ".toml":
        raise UsageError(f"{file}: a model file ends in .toml")
    if file.exists():
        raise UsageError(f"{file}: exists already; give another name, or remove it first")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", file.stem):
        raise UsageError(f"{file}: its name must start with a letter and go on with letters, digits, '_' or '-'")
    text = resources.files("vjm_validation").joinpath("cli", "templates", f"{kind}.toml").read_text("utf-8")
    write_whole(file, text.replace("NAME", file.stem, 1))
    console = terminal.console()
    console.print(f"{file}: {'an' if kind == 'arm' else 'a'} {kind}; put in your own numbers", soft_wrap=True)
    nexts = f"validate check {file}, validate stiffness {file}, validate buckling {file}"
    console.print(f"next: {nexts}", soft_wrap=True, highlight=False)
    return OK
