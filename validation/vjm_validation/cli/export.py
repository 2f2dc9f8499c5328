"""The command ``validate export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io import mjcf_text, urdf_text
from vjm.io.files import check_outputs, write_whole
from vjm.io.machine_file import load_model
from vjm.io.stiffness_file import stiffness_text
from vjm_output import terminal
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.status import OK, UsageError


def export_(
    model: Annotated[str, Parameter(help="Library model or model file; a URDF has no closed loops.")],
    *,
    urdf: Annotated[Path | None, Parameter(help="URDF file to write.")] = None,
    mjcf: Annotated[Path | None, Parameter(help="MJCF file to write, with joints' springs.")] = None,
    stiffness: Annotated[
        Path | None,
        Parameter(
            help="File to write of the drives' stiffness; import reads NAME.stiffness.toml beside NAME.urdf."
        ),
    ] = None,
    force: Annotated[bool, Parameter(help="Write over a file that is there.", negative="")] = False,
    strict: Strict = False,
) -> int:
    """Write a machine's geometry, joints, limits and masses as URDF or MJCF, and say what that cannot hold."""
    chain = load_model(model)
    if chain.closures and urdf is not None:
        names = ", ".join(closure.name for closure in chain.closures)
        raise UsageError(
            f"--urdf: the closures {names} of {model} close loops, and a URDF is a tree. Give --mjcf instead"
        )
    files = {"--urdf": urdf, "--mjcf": mjcf, "--stiffness": stiffness}
    if not any(files.values()):
        raise UsageError("give the file to write: --urdf FILE, --mjcf FILE, --stiffness FILE, or several")
    for option, file in files.items():
        if file is not None and file.exists() and not force:
            raise UsageError(f"{file}: exists already; give another {option}, or --force")
    check_outputs(files)
    considered(model, strict)
    console = terminal.console()
    written = (
        (urdf, urdf_text.urdf_text, urdf_text.left_out),
        (mjcf, mjcf_text.mjcf_text, mjcf_text.left_out),
    )
    for out, text, left_out in written:
        if out is None:
            continue
        write_whole(out, text(chain))
        console.print(f"{out}: {len(chain.parts)} parts", soft_wrap=True)
        for line in left_out(chain):
            console.print(f"left out: {line}", soft_wrap=True, highlight=False, markup=False)
    if stiffness is not None:
        write_whole(stiffness, stiffness_text(chain))
        console.print(f"{stiffness}: what deflects in the drives", soft_wrap=True)
    return OK
