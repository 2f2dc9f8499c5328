"""The command ``validate postures``."""

from __future__ import annotations

import json as json_module
import sys
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.io.machine_file import load_model
from vjm.plain_numbers import plain_number
from vjm.postures import tool_postures
from vjm_output import terminal
from vjm_output.documents import doubt_rows
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.options import Json, Model
from vjm_validation.cli.status import OK, UsageError


def postures_(
    model: Model,
    *,
    tool: Annotated[
        str,
        Parameter(
            help="x,y,z in mm, in the world, and perhaps a rotation vector rx,ry,rz in rad; without it the tool "
            "may turn freely.",
        ),
    ],
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    json: Json = False,
    strict: Strict = False,
) -> int:
    """Find the joint coordinates that put the tool where it is wanted, without load; lines for [postures]."""
    pose = _numbers(tool)
    machine = load_model(model)
    doubts = considered(model, strict)
    rows = tool_postures(machine, pose[:3], pose[3:] or None, end=end)
    if json:
        said = [row.model_dump() for row in doubt_rows(doubts)]
        document = {"model": machine.name, "postures": rows, "doubts": said}
        sys.stdout.write(json_module.dumps(document, indent=2) + "\n")
        return OK
    console = terminal.console()
    for i, row in enumerate(rows, start=1):
        values = ", ".join(f"{name} = {value:.9g}" for name, value in row.items())
        console.print(f"tool-{i} = {{ {values} }}", soft_wrap=True, highlight=False)
    return OK


def _numbers(text: str) -> list[float]:
    try:
        values = [plain_number(word) for word in text.split(",")]
    except ValueError:
        raise UsageError(f"--tool: '{text}' is not three or six numbers separated by commas") from None
    if len(values) not in (3, 6) or not np.all(np.isfinite(values)):
        raise UsageError(f"--tool: needs three or six finite numbers, got '{text}'")
    return values
