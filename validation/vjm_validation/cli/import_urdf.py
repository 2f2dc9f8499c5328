"""The command ``validate import``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.files import write_whole
from vjm.io.model_file import build_chain
from vjm.io.urdf import import_urdf
from vjm_output import terminal
from vjm_validation.cli.status import OK, UsageError


def import_(
    urdf: Annotated[Path, Parameter(help="A robot's URDF file; xacro macros must be expanded.")],
    *,
    tip: Annotated[str | None, Parameter(help="Link at the end; the whole tree where it is left out.")] = None,
    out: Annotated[Path | None, Parameter(help="Model file to write; NAME.toml beside you by default.")] = None,
) -> int:
    """Write a model file of a URDF: axes, origins, masses, centres of mass, limits."""
    found = import_urdf(urdf, tip)
    file = out or Path(f"{found.document['name']}.toml")
    if file.exists():
        raise UsageError(f"{file}: exists already; give another --out")
    chain = build_chain(found.document, file.name)
    write_whole(file, found.text())
    console = terminal.console()
    console.print(f"{file}: {len(chain.parts)} parts, {len(found.to_fill_in)} actuated joints", soft_wrap=True)
    for line in found.notes.lines():
        console.print(line, soft_wrap=True, highlight=False, markup=False)
    if found.to_fill_in:
        console.print(
            f"to be filled in, placeholders now: the compliance of {', '.join(found.to_fill_in)}", soft_wrap=True
        )
    return OK
