"""The command ``validate export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.files import write_whole
from vjm.io.manipulator_file import load_model
from vjm.io.urdf_text import left_out, urdf_text
from vjm.model.chain import Chain
from vjm_output import terminal
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.status import OK, UsageError


def export_(
    model: Annotated[str, Parameter(help="Library model or model file of a chain, an arm or a tree.")],
    *,
    urdf: Annotated[Path, Parameter(help="URDF file to write.")],
    force: Annotated[bool, Parameter(help="Write over a file that is there.", negative="")] = False,
    strict: Strict = False,
) -> int:
    """Write a machine's geometry, joints, limits and masses as a URDF, and say what a URDF cannot hold."""
    chain = load_model(model)
    if not isinstance(chain, Chain):
        raise UsageError(
            f"{model}: its legs close loops, and a URDF is a tree: export the model file of one leg, "
            "written as a chain"
        )
    if urdf.exists() and not force:
        raise UsageError(f"{urdf}: exists already; give another --urdf, or --force")
    considered(model, strict)
    write_whole(urdf, urdf_text(chain))
    console = terminal.console()
    console.print(f"{urdf}: {len(chain.parts)} parts", soft_wrap=True)
    for line in left_out(chain):
        console.print(f"left out: {line}", soft_wrap=True, highlight=False)
    return OK
