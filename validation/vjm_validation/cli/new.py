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
from vjm_validation.new_sheet import KindOfTest, sheet_for


def new_(
    kind: Annotated[
        Literal[
            "chain", "arm", "platform", "bodies", "gantry", "boom", "axis", "scara", "five-bar", "delta", "sheet"
        ],
        Parameter(help="What machine to begin with, or the sheet of a test."),
    ],
    file: Annotated[Path, Parameter(help="To write; it must not exist yet.")],
    *,
    for_: Annotated[
        str | None,
        Parameter(name="--for", help="Of a sheet: the machine that is tested. A model's name or file."),
    ] = None,
    test: Annotated[
        KindOfTest | None,
        Parameter(help="Of a sheet --for a machine: what is read; by default poses of an arm, else displacements."),
    ] = None,
) -> int:
    """Write a commented model file, or the sheet of a test, that runs as it is.

    A platform comes with the file of its legs beside it.
    """
    if for_ is not None and kind != "sheet":
        raise UsageError(f"--for is for a sheet, and this is a {kind}: leave it out")
    if test is not None and for_ is None:
        raise UsageError("--test goes with --for MODEL: say which machine is tested")
    _check_new(file)
    files = {file: _template(kind).replace("NAME", file.stem)}
    if kind == "sheet" and for_ is not None:
        files = {file: sheet_for(for_, file, test)}
    if kind == "platform":
        leg = file.with_name(f"{file.stem}-leg.toml")
        _check_new(leg)
        files = {leg: _template("chain").replace("NAME", leg.stem), file: files[file].replace("LEG", leg.name)}
    for path, text in files.items():
        write_whole(path, text)
    console = terminal.console()
    what = {"arm": "an arm", "axis": "a linear axis", "bodies": "bodies and joints"}.get(kind, f"a {kind}")
    for path in files:
        console.print(f"{path}: {what if path == file else 'its legs'}; put in your own numbers", soft_wrap=True)
    if kind == "sheet":
        nexts = f"validate diagnose READINGS.csv --sheet {file} --out DIR, validate calibrate with the same words"
        if test == "frequencies":
            nexts = f"validate calibrate READINGS.csv --sheet {file} --out DIR"
    else:
        nexts = f"validate check {file}, validate stiffness {file}, validate show {file}, validate all {file}"
    console.print(f"next: {nexts}", soft_wrap=True, highlight=False)
    return OK


def _template(kind: str) -> str:
    return resources.files("vjm_validation").joinpath("cli", "templates", f"{kind}.toml").read_text("utf-8")


def _check_new(file: Path) -> None:
    """Raise a `UsageError` where a file cannot be begun."""
    if file.suffix != ".toml":
        raise UsageError(f"{file}: a model file or sheet ends in .toml")
    if file.exists():
        raise UsageError(f"{file}: exists already; give another name, or remove it first")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", file.stem):
        raise UsageError(f"{file}: its name must start with a letter and go on with letters, digits, '_' or '-'")
